"""Tasks on the set of a round rod in space that a small force pushes aside as it turns inside out.

Over the load q at Θ = 0.9: the stable sheet from the upright arch, sideways, to the inverted one,
which the plane does not know, and what lies beside it. Each task is checked by lifts, which share
no cells with it.
"""

import numpy as np
import pytest

import equimorph as em

SIDE = 0.02
CAP = 12.0
TWISTED = 1.0
"""Energy above which stable states are of another pair, with five times that energy."""


@pytest.fixture(scope="module")
def rod():
    across = {"side": em.PointForce(0.5, (0.0, 0.0, 1.0))}
    return em.SpatialRod("uniform", torsion=1 / 1.3, lateral=1.0, loads=across)


@pytest.fixture(scope="module")
def eset(rod):
    within = [rod.max_curvature <= CAP]
    fixed = {"Theta": 0.9, "side": SIDE}
    return em.equilibrium_set(
        rod, em.Box(q=(0.0, 3.0)), fixed=fixed, within=within, intervals=(4,), checks=0
    )


@pytest.fixture(scope="module")
def path(rod):
    """The stable sheet, by a lift."""
    return em.lift(rod.natural_state(Theta=0.9), [{"side": SIDE}, {"q": 3.0}])


@pytest.fixture(scope="module")
def ends(eset, rod):
    """Upright and inverted."""
    height = rod.height(0.5)
    upright = max(eset.at(q=0.0).stable, key=height)
    return upright, min(eset.at(q=2.9).stable, key=height)


def height_on(path, rod, load):
    """Height of the middle of the lifted state at a load."""
    start = path.states[int(np.flatnonzero(path.states["q"] <= load)[-1])]
    return rod.height(0.5)(em.lift(start, {"q": load}).end.state)


def other_side(eset):
    """The stable state at q = 2 that leans against the force."""
    states = eset.at(q=2.0).stable
    states = states[states.energy < TWISTED]
    return states[int(np.argmin(eset.structure.position(0.5)[2](states)))]


def test_the_set_is_clean_and_holds_the_lifted_states(eset, path, rod):
    assert eset.audit.clean
    for load in (0.4, 1.7, 2.3):
        heights = rod.height(0.5)(eset.at(q=load).stable)
        assert np.abs(heights - height_on(path, rod, load)).min() < 1e-9


def test_plan_finds_the_way_that_is_impossible_in_the_plane(eset, ends):
    """Stable all the way; in its plane the arch has a subcritical pitchfork at q = 4.244."""
    route = em.plan(eset, *ends, margin=0.01)
    assert route.arrived
    assert (route.states.index == 0).all()
    assert route.states.margin.min() > 0.01
    places = route.states.structure.position(0.5)[2](route.states)
    assert places.max() == pytest.approx(0.1986, abs=1e-3)  # as without a force; SPACE 1.2


def test_optimise_finds_the_lowest_middle(eset, path, rod):
    """On the sheet it falls all the way to q = 3."""
    best = em.optimise(eset, rod.height(0.5)).best
    assert best.state["q"] == pytest.approx(3.0)
    assert best.value == pytest.approx(float(rod.height(0.5)(path.end.state)), abs=1e-9)


def test_solve_shape_finds_the_state_of_a_height(eset, rod, path):
    target = height_on(path, rod, 1.9)
    found = em.solve_shape(eset, {rod.height(0.5): target})
    loads = found.states["q"][found.index == 0]
    assert np.abs(loads - 1.9).min() < 1e-8


def test_track_moves_the_middle(ends, rod, path):
    """The load that a height needs, by tracking and by the lift."""
    found = em.track(ends[0], {rod.height(0.5): height_on(path, rod, 1.8)}, actuators=["q"])
    assert found.arrived
    assert found.path.end.state["q"] == pytest.approx(1.8, abs=1e-8)


@pytest.mark.slow
def test_snaps_start_at_folds_and_land_on_the_sheet_of_the_lift(eset, path):
    """The pair on the other side of the force ends at two folds; energies are those of lifts."""
    graph = em.snap_graph(eset)
    snaps = [(each, each.landings[0]) for each in graph.snaps]
    loads = sorted(float(landing.state["q"]) for _, landing in snaps)
    other = other_side(eset)
    folds = [em.lift(other, {"q": load}).end for load in (0.0, 3.0)]
    assert [each.kind for each in folds] == ["fold", "fold"]
    np.testing.assert_allclose(loads, [float(each.state["q"]) for each in folds], atol=1e-9)
    for snap, landing in snaps:
        assert (eset.index[snap.vertices] <= 1).all()
        start = path.states[int(np.flatnonzero(path.states["q"] <= landing.state["q"])[-1])]
        there = em.lift(start, {"q": float(landing.state["q"])}).end.state
        assert landing.state.energy == pytest.approx(there.energy, abs=1e-9)
        fold = min((each.state for each in folds), key=lambda s: abs(s["q"] - there["q"]))
        assert landing.released == pytest.approx(fold.energy - there.energy, abs=1e-6)


def test_robust_optimum_is_the_best_height_under_the_worse_force(eset, rod):
    """A lift to either end of the forces: the guaranteed height is the larger of both."""
    height, within = rod.height(0.5), [rod.max_curvature <= 9.0]
    robust = em.robust_optimum(eset, height, {"side": 0.005}, within=within)
    at = (em.lift(robust.state, {"side": SIDE + d}).end.state for d in (-0.005, 0.005))
    assert robust.guaranteed == pytest.approx(max(float(height(each)) for each in at), abs=1e-9)
    assert rod.max_curvature(robust.state) == pytest.approx(9.0, abs=1e-8)  # the bound is active


@pytest.mark.slow
def test_maps_of_stiff_rods_in_space_are_those_of_the_plane():
    """A strip with A = 3 stays in its plane: limit loads of the planar rod, 4.2439977594 first."""
    grid = em.Grid(Theta=(0.85, 0.95, 2), Delta=(0.0, 0.04, 2))
    found, flat = (
        em.limit_load_map(each, grid, "q")
        for each in (em.SpatialRod(torsion=1.0, lateral=3.0), em.Rod())
    )
    np.testing.assert_allclose(found.value, flat.value, atol=2e-8)
    assert found.at(Theta=0.9, Delta=0.0).value == pytest.approx(4.2439977594, abs=1e-8)


def test_charts_tell_that_heights_alone_are_not_single_valued(eset, rod):
    assert not em.DescriptorChart(eset, [rod.height(0.5)]).single_valued


def test_distance_from_the_edge_of_stability_is_that_to_the_nearer_fold(eset, ends):
    """Infinite on the sheet without folds; on the other side of the force 0.2903, by a lift."""
    found = em.stability_distance(eset, ends[0])
    assert found.in_parameters == found.along_the_set == np.inf
    other = other_side(eset)
    folds = [float(em.lift(other, {"q": load}).end.state["q"]) for load in (0.0, 3.0)]
    nearer = min(abs(fold - 2.0) for fold in folds)
    assert em.stability_distance(eset, other).in_parameters == pytest.approx(nearer, abs=1e-9)
