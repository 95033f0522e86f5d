"""Rods in PyElastica: a second physics, with other equations, another damping and other errors.

References: the equilibria of the library, and the fold at Δ = 0.418136 of PHYSICS.
"""

import numpy as np
import pytest

import equimorph as em
from equimorph.dynamics import ReplaySettings, replay

pytest.importorskip("elastica", reason="PyElastica is not installed (extra `replay-cosserat`)")

FOLD = 0.418136


@pytest.fixture(scope="module")
def upright():
    return em.lift(em.Rod("uniform").natural_state(Theta=1.0), {"q": 2.5}).end.state


def played(start, to, rate, links=16, **more):
    used = ReplaySettings(links=links, **more)
    return replay(to, start, rate=rate, simulator="pyelastica", settings=used)


@pytest.mark.slow
def test_an_arch_rests_where_the_library_says(upright):
    """Discretisation, stretching and shear together."""
    found = played(upright, {"Theta": 1.002}, 0.1, links=8, step=0.1, hold=4.0)
    assert found.independent
    assert not found.snapped
    assert found.deviation[-1] < 2e-2


def test_what_it_does_not_cover_is_refused_by_name():
    clamped, held = {"Theta": 1.0}, {"A": "xy", "C": "xy"}
    joints, bars = {"A": (-1, 0), "B": (0, 0.1), "C": (1, 0)}, [("A", "B"), ("B", "C")]
    others = {
        "couples": em.Rod("uniform", loads={"M": em.Couple(0.5)}).natural_state(**clamped),
        "pressure": em.Rod("uniform", loads={"p": em.Pressure()}).natural_state(**clamped),
        "ends other than": em.Rod(ends=("clamped", "free")).natural_state(),
        "stretching": em.Rod("uniform", axial=30.0).natural_state(**clamped),
        "for a truss": em.Truss(
            joints, bars, held, {"F": {"B": (0, -1)}}, masses={"B": 1.0}
        ).natural_state(),
    }
    for what, start in others.items():
        with pytest.raises(em.errors.InputError, match=what):
            em.SimulatedPlant(start, simulator="pyelastica", rate=1.0)


@pytest.mark.slow
def test_its_errors_are_of_second_order_in_the_number_of_links(upright):
    """What is left with the stretching taken off: it is that of a section of r = 0.005 L."""
    rests = [
        played(
            upright, {"Theta": 1.001}, 0.1, links=links, step=0.05, damping=0.2, hold=6.0
        ).deviation[-1]
        for links in (6, 12, 24)
    ]
    stretch = rests[2] - (rests[1] - rests[2]) / 3.0
    assert abs(stretch) < 1e-3
    assert (rests[0] - rests[1]) / (rests[1] - rests[2]) == pytest.approx(4.0, abs=0.8)


@pytest.mark.slow
@pytest.mark.parametrize("extra", [{}, {"stiffness": lambda s: 1.0 + 0.5 * s, "curvature": -0.5}])
def test_a_motion_stays_near_the_equilibria(extra):
    """Varying stiffness and intrinsic curvature, too."""
    start = em.lift(em.Rod("uniform", **extra).natural_state(Theta=1.0), {"q": 1.0}).end.state
    found = played(start, [{"Theta": 1.2}, {"Delta": 0.2}], 0.05, step=0.05)
    assert not found.snapped
    assert np.nanmax(found.deviation) < 1e-2


@pytest.mark.slow
def test_the_wrong_way_snaps_late_and_lands_where_the_gradient_flow_does(upright):
    """The fold of 16 links is 1e-2 early; how late it leaves is what the normal form predicts."""
    before = em.lift(upright, {"Delta": 0.38}).end.state
    found = played(before, {"Delta": 0.55}, 0.05, damping=0.2, hold=8.0)
    assert found.snapped
    assert found.lateness == pytest.approx(found.expected_lateness, rel=0.2)
    fold = em.lift(before, {"Delta": 0.55}).end.state
    landed = next(way.state for way in em.snap_landing(fold) if way.landed)
    held = em.lift(landed, {"Delta": 0.55}).end.state
    assert np.abs(found.landed_in.shape() - held.shape()).max() < 1e-6
    assert np.linalg.norm(found.points[-1] - played_reference(held, 16), axis=1).max() < 6e-3


def played_reference(state, links):
    from equimorph.dynamics.rods import ChainedRod  # noqa: PLC0415

    return ChainedRod(state.structure, links).places(state.batch)[0, 0]
