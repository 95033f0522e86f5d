"""Sets of rods in space: sheets beside the plane, mirror images, and a study from file to film."""

from pathlib import Path

import numpy as np
import pytest

import equimorph as em
from equimorph.manifold import VertexKind
from equimorph.study import run_study

LATERAL, REJOINED = 1.601471549048, 2.476483
"""Loads between which the round arch at (0.9, 0) is stable beside its plane only; SPACE."""
TWISTED = 1.0
"""Energy above which stable states are of another pair, with five times that energy."""
EXAMPLE = Path(__file__).parents[2] / "examples" / "sideways.toml"
FEWER = "intervals = [4, 2]\nchecks = 0"
"""A coarser grid without checks, for speed."""
pytestmark = pytest.mark.slow


def aside(rod, states):
    """Places z of the middle."""
    return rod.position(0.5)[2](states)


def test_the_arch_over_theta_and_load_has_two_sheets_aside_that_are_mirror_images():
    """Stable beside the plane between both loads only, ± z each; in the plane elsewhere.

    States twisted by two whole turns, whose bending the bound allows, need shorter elements.
    """
    rod = em.SpatialRod(torsion=0.77, lateral=1.0).resolving(15.0)
    assert "sideways mirror" in [each.name for each in rod.symmetries()]
    within, box = [rod.max_curvature <= 9.0], em.Box(Theta=(0.8, 1.0), q=(0.0, 3.0))
    eset = em.equilibrium_set(rod, box, within=within, intervals=(2, 4))
    assert eset.audit.clean
    for load in (1.2, 1.8, 2.2):
        near = eset.at(Theta=0.9, q=load).stable
        places = np.sort(aside(rod, near)[near.energy < TWISTED])
        beside = places[np.abs(places) > 1e-6]
        assert len(beside) == (2 if LATERAL < load < REJOINED else 0)
        np.testing.assert_allclose(beside, -beside[::-1], atol=1e-9)


def test_a_twisted_clamped_rod_that_is_pushed_together_has_its_folds_where_lifts_meet_them():
    """Over (twist, span), of unequal stiffnesses and slightly curved, so that nothing has orbits.

    Lifts from stable states end at folds; there the set has two states fewer or more.
    """
    rod = em.SpatialRod(
        torsion=0.77, lateral=1.3, loads={}, coordinates={}, curvature=0.4, side_curvature=0.1
    )
    box, within = em.Box(twist_B=(3.0, 8.0), nu=(0.75, 0.9)), [rod.max_curvature <= 8.0]
    eset = em.equilibrium_set(rod, box, within=within, intervals=(4, 2), checks=0)
    assert eset.audit.clean
    met = []
    for state in eset.at(twist_B=6.0, nu=0.82).stable:
        for name, value in (("twist_B", 3.0), ("twist_B", 8.0), ("nu", 0.9)):
            end = em.lift(state, {name: value}).end
            if end.kind == "fold":
                place = {each: float(end.state[each]) for each in ("twist_B", "nu")}
                sides = [len(eset.at(**{**place, name: place[name] + d})) for d in (-1e-4, 1e-4)]
                assert abs(sides[0] - sides[1]) == 2
                met.append(name)
    assert {"twist_B", "nu"} == set(met)


def test_a_round_rod_has_its_looping_folds_in_the_set_over_twist_and_span():
    """Pinned on its orbits: each fold of the set is where a lift throws a loop, to 2e-8.

    Beyond 0.434966 (`tests/structures/test_orbits.py`), at a twist of 9, only loops are stable:
    every state is there twice, turned by half a turn.
    """
    rod = em.SpatialRod(torsion=0.75, lateral=1.0, loads={}, span=0.95, phase=True)
    box, within = em.Box(twist_B=(8.5, 9.5), nu=(0.38, 0.5)), [rod.max_curvature <= 14.0]
    eset = em.equilibrium_set(rod, box, within=within, intervals=(2, 2))
    assert eset.audit.clean
    folds = eset.points[eset.kinds == VertexKind.FOLD]
    start = em.lift(rod.natural_state(twist_B=9.0), {"nu": 0.6}).end.state
    for twist, span in set(zip(folds["twist_B"].round(12), folds["nu"].round(8), strict=True)):
        there = em.lift(start, [{"twist_B": float(twist)}, {"nu": 0.3}]).end
        assert there.kind == "fold"
        assert there.state["nu"] == pytest.approx(float(span), abs=2e-8)
    for span, count in ((0.43, 2), (0.44, 6)):
        states = eset.at(twist_B=9.0, nu=span)
        assert len(states) == count
        np.testing.assert_allclose(states.energy[::2], states.energy[1::2], rtol=1e-9)


def test_a_set_over_angle_load_and_side_force_holds_what_lifts_reach():
    """Three free parameters; the stable states near the plane, by a lift each, to 1e-9."""
    across = {"side": em.PointForce(0.5, (0.0, 0.0, 1.0))}
    rod = em.SpatialRod("uniform", torsion=0.77, lateral=1.0, loads=across)
    box = em.Box(Theta=(0.85, 0.95), q=(1.2, 2.0), side=(0.01, 0.03))
    within = [rod.max_curvature <= 7.0]
    eset = em.equilibrium_set(rod, box, within=within, intervals=(2, 2, 2))
    assert eset.audit.clean
    for theta, load, side in ((0.9, 1.7, 0.02), (0.87, 1.3, 0.015), (0.93, 1.9, 0.026)):
        rest = rod.natural_state(Theta=theta)
        lifted = em.lift(rest, [{"side": side}, {"q": load}]).end.state
        states = eset.at(Theta=theta, q=load, side=side).stable
        apart = np.abs(aside(rod, states) - float(aside(rod, lifted)))
        assert apart.min() < 1e-9
        assert states.energy[apart.argmin()] == pytest.approx(lifted.energy, abs=1e-9)


def test_a_study_of_a_rod_in_space_has_its_route_figures_film_and_files(tmp_path):
    """Both ends of the route lie in the plane; it goes aside and stays stable."""
    file, out = tmp_path / "sideways.toml", tmp_path / "out"
    text = EXAMPLE.read_text(encoding="utf-8").replace("intervals = [6, 4]", FEWER)
    file.write_text(text, encoding="utf-8")
    outcome = run_study(file, out)
    assert outcome.equilibrium_set.audit.clean
    route = outcome.of("route")["sideways"][0]
    assert route.arrived
    states, rod = route.states, outcome.problem.structure
    assert states.margin.min() > 0.01
    places = np.abs(aside(rod, states))
    assert places.max() > 0.1
    assert max(places[0], places[-1]) < 1e-9
    for name in ("index.html", "results.h5", "sideways-film.gif", "sideways-shapes.png"):
        assert (out / name).stat().st_size > 1000
    em.storage.write_shapes(out / "route.vtp", states)
    assert (out / "route.vtp").stat().st_size > 1000
