from pathlib import Path

import pytest

from equimorph.cli.run import evaluate, kernels_are_in_cache, march
from equimorph.study import read_problem

EXAMPLES = sorted((Path(__file__).parents[2] / "examples").glob("*.toml"))


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_every_structure_can_be_compiled_before_a_run(path: Path):
    _, _, problem = read_problem(path)
    evaluate(problem)


def test_a_study_around_settings_without_natural_states_can_be_compiled(tmp_path: Path):
    """At Θ = 0 the arch has none; what is compiled must not decide what can be computed."""
    text = (EXAMPLES[0].parent / "arch.toml").read_text()
    path = tmp_path / "around.toml"
    path.write_text(text.replace("Theta = [0.2, 2.5]", "Theta = [-2.5, 2.5]"))
    _, _, problem = read_problem(path)
    assert problem.ground.extent is not None
    assert problem.ground.extent.box.lower[0] == -2.5
    evaluate(problem)


def test_marching_is_compiled_on_a_spring():
    march()
    assert kernels_are_in_cache()
