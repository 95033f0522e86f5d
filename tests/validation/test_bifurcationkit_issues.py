"""Situations that another continuation program reported as faults, rebuilt from energies.

BifurcationKit.jl, issue 223: seen from its side branch a pitchfork is an eigenvalue that touches
zero and grows again, which is overlooked unless steps are tiny; with longer ones the path jumps to
the trivial branch. Issue 19: after a pitchfork the branch that is switched to is not the one that
bifurcates.
"""

import numpy as np
import pytest

import equimorph as em
from typecheck import unchecked

STEPS = [0.02, 0.05, 0.5, 2.0]


def pitchfork(sign, scale=1.0):
    """E = scale (sign x⁴/4 + p x²/2): x = 0, and x² = −p/sign."""
    return em.EnergyStructure(
        f"{scale}*({sign}*x**4/4 + p*x**2/2)",
        [em.Unknown("x", 0.0, (-2.0, 2.0))],
        [em.Parameter("p", "1", 1.0, "load", 0.0)],
    )


def equilibrium(structure, x, p):
    return em.structures.States(structure, np.array([[x]]), np.array([[p]]))[0]


@pytest.mark.parametrize("largest", STEPS)
@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e3])
@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_pitchfork_is_met_from_its_side_branch(side, scale, largest):
    """Issue 223: f = −x³ − p x from x = ±1 at p = −1, with any step; at x = p = 0, to round-off."""
    start = equilibrium(pitchfork(1, scale), side, -1.0)
    options = em.TraceOptions(largest_step=largest, first_step=min(largest, 0.05))
    with unchecked():
        path = em.lift(start, {"p": 1.0}, options=options)
    assert path.end.kind == "branch point"
    np.testing.assert_allclose([path.end.state.z[0], path.end.state["p"]], 0.0, atol=1e-9)
    x = path.states.z[:, 0]
    assert (side * x >= -1e-9).all()  # on its own side all the way
    np.testing.assert_allclose(x**2, -path.states["p"], atol=1e-9)
    with unchecked():
        ways = em.branches(path.end.state, "p", path=path)
    np.testing.assert_allclose([way.state.z[0] for way in ways], 0.0, atol=1e-9)
    assert sorted(way.state.index for way in ways) == [0, 1]


@pytest.mark.parametrize("begin", [2.0, 0.1, 1e-3])
@pytest.mark.parametrize("distance", [1e-3, 0.05, 0.5])
@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e3])
def test_switching_at_a_pitchfork_ends_on_the_branch_that_bifurcates(scale, distance, begin):
    """Issue 19: f = α x + x³ from α = 2 down; beyond α = 0 both sides have x² = −α and go on."""
    with unchecked():
        path = em.lift(equilibrium(pitchfork(1, scale), 0.0, begin), {"p": -10.0})
        assert path.end.kind == "branch point"
        ways = em.branches(path.end.state, "p", path=path, distance=distance)
        ends = [em.lift(way.state, {"p": -10.0}).end for way in ways]
    assert sorted(np.sign(way.state.z[0]) for way in ways) == [-1.0, 1.0]
    for way in ways:
        assert way.state.z[0] ** 2 == pytest.approx(-way.state["p"], rel=1e-9)
        assert way.state.z[0] ** 2 > 0.0
    assert [end.kind for end in ends] == ["arrived", "arrived"]
    found = sorted(end.state.z[0] for end in ends)
    np.testing.assert_allclose(found, [-np.sqrt(10.0), np.sqrt(10.0)], rtol=1e-10)
