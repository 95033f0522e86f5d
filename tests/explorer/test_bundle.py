"""The committed program of the page is what its sources give."""

import subprocess
from pathlib import Path
from shutil import which

import pytest

FOLDER = Path(__file__).parents[2] / "explorer"


@pytest.fixture
def node() -> str:
    found = which("node")
    if found is None:
        pytest.skip("node is not installed")
    if not (FOLDER / "node_modules" / "esbuild").is_dir():
        pytest.skip("the sources' packages are not installed: run `make explorer`")
    return found


def test_the_committed_program_is_what_the_sources_give(node):
    done = subprocess.run(
        [node, "build.mjs", "--check"], cwd=FOLDER, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
