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


@pytest.fixture(scope="module")
def rod():
    across = {"side": em.PointForce(0.5, (0.0, 0.0, 1.0))}
    return em.SpatialRod("uniform", torsion=1 / 1.3, lateral=1.0, loads=across, degree=5)


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
def test_snaps_start_at_folds_and_land_on_stable_states(eset):
    graph = em.snap_graph(eset)
    assert len(graph.strata) >= 2
    assert graph.snaps
    for snap in graph.snaps:
        assert (np.abs(eset.index[snap.vertices]) <= 1).all()
        assert snap.released[0] > 0.0 or snap.target < 0


def test_robust_optimum_is_worse_than_the_best_under_other_forces(eset, rod):
    """A lift at the worse force gives the guaranteed height."""
    within = [rod.max_curvature <= 9.0]
    robust = em.robust_optimum(eset, rod.height(0.5), {"side": 0.005}, within=within)
    assert robust.guaranteed >= em.optimise(eset, rod.height(0.5), within=within).best.value - 1e-9


def test_maps_of_limit_loads_take_rods_in_space(rod):
    """No limit load below q = 3 where a force pushes the round arch aside; see `path`."""
    grid = em.Grid(Theta=(0.85, 0.95, 2), side=(0.01, 0.03, 2))
    found = em.limit_load_map(rod, grid, "q", bound=2.0)
    assert found.at(Theta=0.9, side=0.02).kind == "none below the bound"


def test_charts_tell_that_heights_alone_are_not_single_valued(eset, rod):
    assert not em.DescriptorChart(eset, [rod.height(0.5)]).single_valued


def test_distance_from_the_edge_of_stability_is_infinite_on_a_sheet_without_folds(eset, ends):
    found = em.stability_distance(eset, ends[0])
    assert found.in_parameters == found.along_the_set == np.inf
