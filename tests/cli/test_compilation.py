from pathlib import Path

import pytest

from equimorph.cli.compilation import are_compiled, evaluate, march
from equimorph.study import read_problem

EXAMPLES = sorted((Path(__file__).parents[2] / "examples").glob("*.toml"))


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_every_structure_can_be_compiled_before_a_run(path: Path):
    _, _, problem = read_problem(path)
    evaluate(problem)


def test_marching_is_compiled_on_a_spring():
    march()
    assert are_compiled()
