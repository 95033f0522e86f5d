import pytest

from equimorph.errors import InputError
from equimorph.manifold import INTERVALS
from equimorph.study.prepare import Problem, prepare
from equimorph.study.problem import parse_study


def _prepare(text: str) -> Problem:
    return prepare(parse_study(text, "arch.toml"))


def test_a_study_becomes_objects(arch_text: str):
    problem = _prepare(arch_text)
    assert problem.ground.extent.box.names == ("Theta", "Delta")
    assert [str(constraint) for constraint in problem.ground.extent.constraints] == [
        "max_curvature <= 20"
    ]
    assert problem.questions[0].within[0].bound == 20.0


def test_what_is_left_out_takes_the_structures_default(arch_text: str):
    """A rod's span is sin 1 unless given, PHYSICS section 3."""
    structure = _prepare(arch_text).structure
    given = _prepare(arch_text.replace('load = "uniform"', "span = 0.9")).structure
    assert structure.identity()["span"] == pytest.approx(0.8414709848078965, rel=1e-15)
    assert given.identity()["span"] == 0.9


def test_a_load_table_reaches_the_rod(arch_text: str):
    problem = _prepare(arch_text.replace('"uniform"', "[[0, 2], [0.5, 2], [0.5, 0], [1, 0]]"))
    assert problem.structure.identity()["load"] == [[0, 2], [0.5, 2], [0.5, 0], [1, 0]]


def test_a_study_without_intervals_takes_those_of_the_library(arch_text: str):
    assert (
        _prepare(arch_text.replace("intervals = [5, 9]", "")).ground.extent.intervals
        == INTERVALS[2]
    )


# What is changed in the study, and what the line must say.
WRONG = {
    "free parameter unknown": (
        "Delta = [-2.0",
        "Delt = [-2.0",
        r"in `set\.box`: .*Theta, Delta, q.*Did you mean Delta\?",
    ),
    "degrees for the box": (
        "Theta = [0.2, 2.5]",
        "Theta = [10, 140]",
        r"in `set\.box`: `Theta` must be an angle in radians, within ±20; got 140\. .*write 2\.443",
    ),
    "rod without a bound": (
        'within = ["max_curvature <= 20"]\nintervals',
        'within = ["height(0.5) >= -0.1"]\nintervals',
        r"`set\.within` must bound the max_curvature of .*, .*; got height\(0\.5\) >= -0\.1",
    ),
    "degrees fixed": (
        "{ Theta = [0.2, 2.5], Delta = [-2.0, 2.0] }\nfixed = { q = 2.5 }",
        "{ Theta = [0.2, 2.5], q = [-2.0, 2.0] }\nfixed = { Delta = 30 }",
        r"in `set\.fixed`: `Delta` must be an angle in radians",
    ),
    "fixed parameter unknown": ("q = 2.5", "w = 2.5", r"in `set\.fixed`: `w` must be a parameter"),
    "parameter free and fixed": ("q = 2.5", "Theta = 1.0", r"`set\.fixed` must not name .*Theta"),
    "span fixed too long": ("q = 2.5", "nu = 1.0", r"in `set\.fixed`: `nu` must be .*got 1\.0"),
    "span fixed at zero": ("q = 2.5", "nu = 0.0", r"in `set\.fixed`: `nu` must be .*got 0\.0"),
    "span free beyond one": ("Delta = [-2.0, 2.0]", "nu = [0.5, 1.5]", r"in `set\.box`: `nu`"),
    "constraint on an unknown descriptor": (
        "max_curvature <= 20",
        "max_kurvature <= 20",
        r"in `set\.within\[0\]`: `descriptor` must be one of .*Did you mean max_curvature\?",
    ),
    "choice by an unknown descriptor": (
        'highest = "height(0.5)"',
        'highest = "higth(0.5)"',
        r"in `route\[0\]\.start`: `descriptor`",
    ),
    "place beyond the rod": (
        'highest = "height(0.5)"',
        'highest = "height(1.5)"',
        r"in `route\[0\]\.start`: ",
    ),
    "point outside the box": (
        "at = { Theta = 1.0, Delta = 0.0 }",
        "at = { Theta = 3.0, Delta = 0.0 }",
        r"`equilibria\[0\]\.at\.Theta` must lie in the box, 0\.2 to 2\.5; got 3",
    ),
    "point that names too little": (
        "at = { Theta = 1.0, Delta = 0.0 }",
        "at = { Theta = 1.0 }",
        r"`equilibria\[0\]\.at` must name the free parameters Theta, Delta; got Theta",
    ),
    "way-point outside the box": (
        "{ Delta = 1.3 }",
        "{ Delta = 2.3 }",
        r"`route\[0\]\.via\[1\]\.Delta` must lie in the box, -2 to 2; got 2\.3",
    ),
    "way-point along a fixed parameter": (
        "{ Delta = 1.3 }",
        "{ q = 3.0 }",
        r"`route\[0\]\.via\[1\]` must name only free parameters \(Theta, Delta\); got q",
    ),
    "load that jumps backward": (
        '"uniform"',
        "[[0, 1], [0.7, 1], [0.3, 1], [1, 1]]",
        r"in `structure`: `load` must be .*got s falling from 0\.7 to 0\.3",
    ),
}


@pytest.mark.parametrize("case", WRONG)
def test_what_does_not_fit_the_structure_is_named_with_its_key(case: str, arch_text: str):
    old, new, line = WRONG[case]
    assert old in arch_text
    with pytest.raises(InputError, match=line):
        _prepare(arch_text.replace(old, new, 1))


def test_a_goal_outside_the_box_is_named(arch_text: str):
    wrong = arch_text.replace("goal = { at = { Theta = 1.0", "goal = { at = { Theta = 0.1")
    with pytest.raises(InputError, match=r"`route\[0\]\.goal\.at\.Theta` must lie in the box"):
        _prepare(wrong)
