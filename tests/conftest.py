"""Types and array shapes are checked at run time in the whole package while the tests run.

EQUIMORPH_SHAPES=unchecked leaves the checks out; see `typecheck`.
"""

import gc
import os
import sys
from collections.abc import Generator
from pathlib import Path

import pytest
from hypothesis import settings
from numba.core.dispatcher import Dispatcher

# until all tests are collected: syntax trees are many objects, and next to none is garbage
gc.disable()

# a test that is right stays right on a busy machine, and says the same each time
settings.register_profile("equimorph", deadline=None, derandomize=True)
settings.load_profile("equimorph")

# checked modules and rewritten tests take seconds to compile: kept, whatever the environment says
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
sys.dont_write_bytecode = False

# whichever way pytest is started, `typecheck` and `oracles` are found beside this file
sys.path.insert(0, str(Path(__file__).parent))
if os.environ.get("EQUIMORPH_SHAPES", "checked") != "unchecked":
    from typecheck import compile_share, install

    install()
    if worker := os.environ.get("PYTEST_XDIST_WORKER"):
        number, count = int(worker.removeprefix("gw")), int(os.environ["PYTEST_XDIST_WORKER_COUNT"])
        compile_share(Path(__file__).parents[1] / "src" / "equimorph", number, count)

TENTHS = 10
END_TO_END = (
    *("cli", "explorer", "paper", "plotting", "study", "validation"),
    *("test_argument_checks.py", "test_docs_site.py", "test_frame_gallery.py", "test_gallery.py"),
    *("test_readme.py", "test_route_certificates.py"),
)
"""Folders and files of tests that run what others test piece by piece, with the checks: here these
only cost time."""

collect_ignore = ["typing/uses.py"]
"""Read by type checkers, never run: half of its lines are wrong."""


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption(
        "--tenth",
        type=lambda text: int(text) % TENTHS,
        help="run every tenth of the tests that are selected, from this one (0 to 9) on",
    )


@pytest.hookimpl(trylast=True)  # of what markers and names leave
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Every tenth test: cases of one test, which take about equally long, go to all tenths."""
    first = config.getoption("tenth")
    if first is not None:
        kept = items[first::TENTHS]
        config.hook.pytest_deselected(items=[item for item in items if item not in kept])
        items[:] = kept


COARSE = 80
"""Dots per inch of figures that tests save: what they show is the same, and drawn sooner."""


def pytest_collection_finish() -> None:
    """What lives as long as the tests need not be looked through again and again for garbage."""
    if style := sys.modules.get("equimorph.plotting.style"):
        style.RESOLUTION = COARSE
    gc.enable()
    gc.collect()
    gc.freeze()


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item: pytest.Item) -> Generator[None, object, object]:
    """Whole programs run without checks of shapes, their fixtures, too."""
    folder = item.path.relative_to(Path(__file__).parent.parent).parts
    if folder[0] == "tests" and folder[1] in END_TO_END:
        from typecheck import unchecked  # noqa: PLC0415  # found beside this file

        with unchecked():
            return (yield)
    return (yield)


def pytest_sessionfinish(session: pytest.Session, exitstatus: int) -> None:
    """An empty tenth is no failure."""
    nothing = exitstatus == pytest.ExitCode.NO_TESTS_COLLECTED
    if nothing and session.config.getoption("tenth") is not None:
        session.exitstatus = pytest.ExitCode.OK


MADE = set()
"""Calls of kernels by the package whose code this process did not have yet."""
COMPILE = Dispatcher._compile_for_args


def _note_and_compile(self: Dispatcher, *args: object) -> object:
    if sys._getframe(1).f_globals["__name__"].partition(".")[0] == "equimorph":
        MADE.add((self, tuple(self.typeof_pyval(each) for each in args)))
    return COMPILE(self, *args)


Dispatcher._compile_for_args = _note_and_compile


@pytest.fixture(autouse=True)
def _calls_of_kernels_are_listed() -> Generator[None]:
    """What `compile_ahead` does not know would be compiled while someone waits."""
    yield
    if MADE:
        from equimorph.linalg.compile_ahead import known_calls  # noqa: PLC0415  # after the hook

        known = {(each.name, each.types) for each in known_calls()}
        new = {(f"{of.py_func.__module__}.{of.py_func.__name__}", types) for of, types in MADE}
        MADE.clear()
        assert new <= known, "write the list with benchmarks/list_kernel_calls.py"


@pytest.fixture(scope="session")
def finished(tmp_path_factory: pytest.TempPathFactory) -> tuple[object, Path]:
    """Outcome and results folder of the small spring study, run once; change nothing there."""
    from studies import finished_run  # noqa: PLC0415  # imports the package, so after the hook

    return finished_run(tmp_path_factory.mktemp("finished"))
