"""Types and array shapes are checked at run time in the whole package while the tests run.

EQUIMORPH_SHAPES=unchecked leaves the checks out; see `typecheck`.
"""

import os
import sys
from pathlib import Path

import pytest
from hypothesis import settings

# a test that is right stays right on a busy machine, and says the same each time
settings.register_profile("equimorph", deadline=None, derandomize=True)
settings.load_profile("equimorph")

# checked modules and rewritten tests take seconds to compile: kept, whatever the environment says
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
sys.dont_write_bytecode = False

# whichever way pytest is started, `typecheck` and `oracles` are found beside this file
sys.path.insert(0, str(Path(__file__).parent))
if os.environ.get("EQUIMORPH_SHAPES", "checked") != "unchecked":
    from typecheck import install

    install()


@pytest.fixture(scope="session")
def finished(tmp_path_factory: pytest.TempPathFactory) -> tuple[object, Path]:
    """Outcome and results folder of the small spring study, run once; change nothing there."""
    from studies import finished_run  # noqa: PLC0415  # imports the package, so after the hook

    return finished_run(tmp_path_factory.mktemp("finished"))
