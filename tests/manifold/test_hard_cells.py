"""Cells that are hard to decide: thin wedges behind cusps, tongues along constraints."""

from pathlib import Path

import pytest

from equimorph.manifold import equilibrium_set
from equimorph.model import Box
from equimorph.structures import Rod
from equimorph.study.prepare import prepare
from equimorph.study.problem import parse_study
from oracles.complexes import assert_faithful
from typecheck import unchecked

EXAMPLES = Path(__file__).parents[2] / "examples"
FAST = {(0.0, 80.0), (1.0, 10.0), (2.5, 20.0), (12.0, 80.0)}
CASES = [
    pytest.param(q, cap, marks=[] if (q, cap) in FAST else [pytest.mark.slow])
    for q in (0.0, 1.0, 2.5, 4.0, 6.0, 9.0, 12.0)
    for cap in (10.0, 20.0, 40.0, 80.0)
]


@pytest.mark.parametrize(("q", "cap"), CASES)
def test_left_half_load_runs_clean(q, cap):
    """Loads from 0, where the rod is symmetric, to 12; caps of max |κ| from 10 to 80."""
    rod = Rod(load="left-half")
    with unchecked():
        eset = equilibrium_set(
            rod,
            Box(Theta=(0.2, 2.5), Delta=(-2, 2)),
            fixed={"q": q},
            within=[rod.max_curvature <= cap],
            intervals=(12, 21),
            checks=1,
        )
    assert eset.audit.clean, eset.audit
    assert eset.crossings == ()


@pytest.mark.parametrize(
    ("load", "intervals"),
    [("left-half", (31, 33)), ("uniform", (31, 33)), ("left-half", (51, 19))],
)
def test_points_that_close_cells_along_a_constraint_are_of_their_sheet(load, intervals):
    """Both ends on one side of a grid triangle, and a fold inside that its edges do not show.

    Near (0.80, 0) points on the constraint amid two of index 13 have index 14, far outside: cells
    that they close hide the fold.
    """
    rod = Rod(load=load)
    with unchecked():
        eset = equilibrium_set(
            rod,
            Box(Theta=(0.2, 2.5), Delta=(-2, 2)),
            fixed={"q": 2.5},
            within=[rod.max_curvature <= 40],
            intervals=intervals,
            checks=0,
        )
    assert eset.audit.bisected > 0
    assert eset.audit.clean, eset.audit
    assert_faithful(eset)


def test_a_tongue_that_ends_at_a_side_of_a_cell_is_told():
    """Beyond Θ = 0.8305 this grid has no vertex inside the tongue of index 9, whose folds go on.

    The folds turn around its tip, outside the cell through whose side it leaves: the set ends there
    with a named cell, not in silence.
    """
    rod = Rod(load="uniform")
    with unchecked():
        eset = equilibrium_set(
            rod,
            Box(Theta=(0.2, 2.5), Delta=(-2, 2)),
            fixed={"q": 2.5},
            within=[rod.max_curvature <= 40],
            intervals=(51, 19),
            checks=0,
        )
    indices = [eset.at(Theta=theta, Delta=0.0).index.tolist() for theta in (0.825, 0.832)]
    whole = [9 in each for each in indices]
    assert whole == [True, True] or (eset.audit.undecided == 1 and not eset.audit.clean)


@pytest.mark.parametrize(
    ("name", "box", "grid"),
    [
        ("beam", Box(nu=(0.97, 1.0), P=(-38.0, 42.0)), (41, 41)),
        ("beam", Box(nu=(0.97, 1.0), P=(-38.0, 42.0)), (33, 37)),
        pytest.param("arm", Box(k1=(-1.5, 1.6), P=(1.0, 4.0)), (25, 25), marks=pytest.mark.slow),
        pytest.param("arm", Box(k1=(-1.5, 1.6), P=(1.0, 4.0)), (33, 29), marks=pytest.mark.slow),
    ],
)
def test_wedges_behind_the_cusps_of_the_gallery_are_decided(name, box, grid):
    """Parameters of different sizes: in ν and P the wedge is hundreds of times longer than wide."""
    file = EXAMPLES / f"{name}.toml"
    rod = prepare(parse_study(file.read_text(encoding="utf-8"), file.name)).structure
    fixed = {"theta_A": 1.5707963267948966} if name == "arm" else {"theta_A": 0.0, "theta_B": 0.0}
    cap = 10 if name == "arm" else 12
    with unchecked():
        eset = equilibrium_set(
            rod,
            box,
            fixed=fixed,
            within=[rod.max_curvature <= cap],
            intervals=grid,
            checks=0,
        )
    assert_faithful(eset)
    assert len(eset.folds) == 1
