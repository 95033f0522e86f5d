"""Every example runs as its first lines say."""

import subprocess
import sys
from pathlib import Path

import pytest

EXAMPLES = sorted((Path(__file__).parents[1] / "examples").glob("*.py"))


@pytest.mark.slow
@pytest.mark.parametrize("example", EXAMPLES, ids=lambda path: path.stem)
def test_an_example_runs_and_leaves_its_figure(example: Path, tmp_path: Path):
    subprocess.run([sys.executable, example], cwd=tmp_path, check=True, timeout=600)
    assert (tmp_path / f"{example.stem}.png").stat().st_size > 10_000
