"""Shafts and columns that buckle in any direction: Greenhill's two problems.

A straight clamped rod under a twisting moment M and a tension T buckles where the linear equation
of `clamped_buckling_moment` has a solution [Greenhill1883]_; a heavy column of height L, stiffness
B and weight q per length where J₋⅓(⅔ √(q L³/B)) = 0, q = 7.8373 B/L³ [Greenhill1881]_. Round rods
have two modes at once: a multiple point, which a lift finds to 1e-6 and does not pass.
"""

import pytest
from scipy.optimize import brentq
from scipy.special import jv

import equimorph as em
from oracles.kirchhoff import clamped_buckling_moment

TORSION = 0.97
ALONG = (1.0, 0.0, 0.0)


@pytest.mark.parametrize("tension", [0.0, 20.0])
def test_a_twisted_shaft_buckles(tension):
    """8.986818915818 without tension, both modes at once. Tolerance: of multiple points."""
    shaft = em.SpatialRod(
        torsion=TORSION, lateral=1.0, ends=("clamped", "guided"), EI=1.0, length=1.0,
        loads={"T": em.PointForce(1.0, ALONG)},
    )  # fmt: skip
    start = shaft.natural_state()
    if tension:
        start = em.lift(start, {"T": tension}).end.state
    wanted = clamped_buckling_moment(tension)
    end = em.lift(start, {"twist_B": 1.02 * wanted / TORSION}).end
    assert end.kind == "multiple point"
    assert "2 eigenvalues" in end.detail
    assert end.state["twist_B"] * TORSION == pytest.approx(wanted, rel=2e-6)


@pytest.mark.parametrize("lateral", [1.0, 3.0])
def test_a_heavy_column_buckles(lateral):
    """7.837347 in its weak plane, `lateral` times as much in the other.

    Tolerance: 1e-8, of six elements of degree six, and that of multiple points for a round one.
    """
    first = 2.25 * brentq(lambda x: jv(-1.0 / 3.0, x), 1.5, 2.2, xtol=1e-14) ** 2
    assert first == pytest.approx(7.8373, abs=5e-5)
    column = em.SpatialRod(
        torsion=0.77, lateral=lateral, ends=("clamped", "free"), EI=1.0, length=1.0,
        loads={"q": em.LineLoad("uniform", (-1.0, 0.0, 0.0))},
    )  # fmt: skip
    path = em.lift(column.natural_state(), {"q": 1.02 * lateral * first}, through_folds=True)
    if lateral == 1.0:
        assert path.end.kind == "multiple point"
        assert path.end.state["q"] == pytest.approx(first, rel=2e-6)
        return
    loads = [each.state["q"] for each in path.events if each.kind == "branch point"]
    assert loads == pytest.approx([first, lateral * first], rel=1e-8)
    assert path.end.state.index == 2
