"""Every array shape in the package is checked at run time while the tests run.

The checks cost ten times a lift; EQUIMORPH_SHAPES=unchecked leaves them out for a single file.
"""

import os
import sys
from collections.abc import Sequence
from importlib.abc import MetaPathFinder
from importlib.machinery import ModuleSpec, PathFinder
from pathlib import Path
from types import ModuleType

import pytest
from hypothesis import settings
from jaxtyping import install_import_hook

COMPILED = ("kernels", "simd")


class PlainCompiledModules(MetaPathFinder):
    """Keeps the hook away from modules that numba compiles: it can compile bare functions only."""

    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        if fullname.startswith("equimorph.") and fullname.endswith(COMPILED):
            return PathFinder.find_spec(fullname, path, target)
        return None


# a test that is right stays right on a busy machine, and says the same each time
settings.register_profile("equimorph", deadline=None, derandomize=True)
settings.load_profile("equimorph")

# whichever way pytest is started, `typecheck` and `oracles` are found beside this file
sys.path.insert(0, str(Path(__file__).parent))
if os.environ.get("EQUIMORPH_SHAPES", "checked") != "unchecked":
    install_import_hook("equimorph", "typecheck.check")
    sys.meta_path.insert(0, PlainCompiledModules())


@pytest.fixture(scope="session")
def finished(tmp_path_factory: pytest.TempPathFactory) -> tuple[object, Path]:
    """Outcome and results folder of the small spring study, run once; change nothing there."""
    from studies import finished_run  # noqa: PLC0415  # imports the package, so after the hook

    return finished_run(tmp_path_factory.mktemp("finished"))
