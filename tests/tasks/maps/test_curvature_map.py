"""Curvature maps: the first stable state at a load, what happens on the way, and barriers."""

from dataclasses import replace

import numpy as np
import pytest

import equimorph as em
from equimorph.equilibria import TraceOptions
from equimorph.equilibria.first_stable import WAYS, FirstStable
from equimorph.errors import InputError


def curvatures(load, **grid):
    rod = em.Rod(load=load)
    return em.curvature_map(rod, em.Grid(**grid), "q", 2.5, within=[rod.max_curvature <= 20])


@pytest.fixture(scope="module")
def cmap():
    """Uniform load: inside is an arch that stands, left and right of it ones that snap."""
    return curvatures("uniform", Theta=(0.4, 1.2, 4), Delta=(-1.0, 1.0, 10))


def curves(amap, kind):
    return [curve for curve in amap.curves if curve.kind == kind and len(curve.points) > 1]


# --- values ---------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("load", "Theta", "Delta", "expected", "kind"),
    [
        ("uniform", 0.96, 0.0, 2.132, "stable"),
        ("left-half", 0.96, 0.0, 14.179, "snaps"),
        ("left-half", 0.64, 0.52, 3.028, "stable"),
    ],
)
def test_curvatures_at_the_settings_of_the_references(load, Theta, Delta, expected, kind):
    """PHYSICS §3, §5 (the third is close to the best, 3.02), decisions, "Values that differ"."""
    around = {"Theta": (Theta - 1e-3, Theta + 1e-3, 2), "Delta": (Delta - 1e-3, Delta + 1e-3, 2)}
    found = curvatures(load, **around)
    assert found.value[1, 1] == pytest.approx(expected, rel=2e-3)
    assert found.kinds[found.status[1, 1]] == kind


def test_states_are_those_of_a_lift_where_it_arrives_and_snaps_are_where_it_does_not(cmap):
    """Every other setting, lifted one by one from its own natural state."""
    rod, axes = cmap.structure, cmap.grid.axes()
    for i in range(0, 5, 2):
        for j in range(0, 11, 2):
            path = em.lift(rod.natural_state(Theta=axes[0][i], Delta=axes[1][j]), {"q": 2.5})
            assert path.arrived == (cmap.kinds[cmap.status[i, j]] == "stable")
            assert path.arrived != cmap.snaps[i, j]
            if path.arrived:
                expected = rod.max_curvature(path.end.state)
                assert cmap.value[i, j] == pytest.approx(expected, rel=1e-9)


def test_states_beyond_a_snap_are_on_the_path_through_the_folds(cmap):
    """The lift through folds passes the state of the map as its first stable one at q = 2.5."""
    rod, axes = cmap.structure, cmap.grid.axes()
    i, j = (int(k[0]) for k in np.nonzero(cmap.snaps))
    rest = rod.natural_state(Theta=axes[0][i], Delta=axes[1][j])
    path = em.lift(rest, {"q": 6.0}, through_folds=True)
    q = path.states["q"]
    crossed = np.flatnonzero((q[:-1] - 2.5) * (q[1:] - 2.5) < 0.0)
    first = next(k for k in crossed if path.index[k] == path.index[k + 1] == 0)
    here = curvature_at_crossing(path, first)
    assert here == pytest.approx(cmap.value[i, j], rel=1e-8)


def curvature_at_crossing(path, k):
    """Largest curvature at q = 2.5, lifted from the point before the crossing."""
    back = em.lift(path.states[k], {"q": 2.5})
    assert back.arrived
    return path.states.structure.max_curvature(back.end.state)


def test_all_states_are_stable_equilibria_at_the_load(cmap):
    reached = np.isfinite(cmap.value).ravel()
    assert reached.all()
    np.testing.assert_array_equal(cmap.states["q"], 2.5)
    np.testing.assert_array_equal(cmap.states.index, 0)
    assert cmap.states.residual.max() < 1e-10


def test_a_uniform_load_makes_the_map_symmetric(cmap):
    np.testing.assert_allclose(cmap.value, cmap.value[:, ::-1], rtol=1e-9)
    np.testing.assert_array_equal(cmap.status, cmap.status[:, ::-1])


# --- curves ---------------------------------------------------------------------------------------


def test_barriers_are_folds_at_the_load_and_the_map_jumps_there(cmap):
    barriers = curves(cmap, "fold")
    assert len(barriers) == 2
    for barrier in barriers:
        np.testing.assert_allclose(barrier.states["q"], 2.5, rtol=1e-12)
        assert np.abs(barrier.states.margin).max() < 1e-6
        assert (np.diff(barrier.values, axis=1) > 1.0).all()


def test_limit_loads_along_a_barrier_equal_the_load(cmap):
    """Another method: on the side of the standing arch the limit load tends to 2.5."""
    for point in curves(cmap, "fold")[0].points[::3]:
        inside = point * np.array([1.0, 1.0 - 1e-5])
        rest = cmap.structure.natural_state(Theta=inside[0], Delta=inside[1])
        assert em.limit_load(rest, "q").value == pytest.approx(2.5, abs=1e-3)


def test_snapping_begins_where_two_folds_merge(cmap):
    """On the grid line Θ = 0.6: the cusp of the folds, located by following them."""
    rest = cmap.structure.natural_state(Theta=0.6, Delta=0.7)
    fold = em.limit_load(rest, "q").state
    box = em.Box(Delta=(0.7, 0.8), q=(0.0, 5.0))
    followed = em.fold_curve(fold, ("Delta", "q"), box=box)
    (cusp,) = [event.state for event in followed.events if event.kind == "cusp"]
    edge = max(curves(cmap, "snap"), key=lambda curve: curve.points[:, 1].max())
    place = int(np.argmin(np.abs(edge.points[:, 0] - 0.6)))
    assert edge.points[place] == pytest.approx([0.6, cusp["Delta"]], abs=1e-9)
    assert edge.states["q"][place] == pytest.approx(cusp["q"], abs=1e-9)
    np.testing.assert_allclose(edge.values[:, 0], edge.values[:, 1], rtol=1e-2)


def test_every_curve_has_a_cause(cmap, loops):
    """Also where paths through many folds reconnect: each place is exact.

    One point is not on a curve: at (0.9145, 0) the extremum at the crown splits into two.
    """
    for found in (cmap, loops):
        assert {curve.kind for curve in found.curves} <= {"fold", "snap", "gap", "place", "edge"}
        for curve in found.curves:
            assert (curve.errors <= 1e-10).all() or len(curve.points) == 1, curve.kind


@pytest.fixture(scope="module")
def loops():
    """Left half loaded: around (0.5, 0) paths pass six folds up to the bound, or come back."""
    return curvatures("left-half", Theta=(0.45, 0.7, 3), Delta=(-0.16, 0.24, 5))


def test_states_end_where_paths_reconnect_at_a_branch_point(loops):
    """1e-8 beside the gap, across it in Δ, there is a stable state on one side only.

    At Θ = 0.45 and 0.5333, above, a cusp of the path lies 5e-7 and 5.4e-6 beside the branch point
    that is the reason.
    """
    points = np.concatenate([curve.points for curve in curves(loops, "gap")])
    lines = np.abs(points[:, :1] - loops.grid.axes()[0]).min(axis=1) < 1e-12
    across = np.array([[0.0, 1e-8]])
    settings = np.concatenate([points[lines] - across, points[lines] + across])
    states, found = loops.sheet.states(settings)
    assert found.all()
    start, options = loops.sheet.parameters(settings), TraceOptions(record=False)
    options = replace(options, through_folds=True, through_branch_points=True)
    walk = FirstStable(loops.structure, 2, 0.0, loops.bound, loops.within, options)
    way = walk(states, start, np.full(len(start), loops.at))[2]
    reached = np.isin(way, [WAYS.index(each) for each in ("stable", "snaps", "branches off")])
    assert reached.reshape(2, 6).sum(axis=0).tolist() == [1] * 6


@pytest.mark.parametrize("load", ["uniform", "left-half"])
def test_what_steps_hide_changes_no_end_of_a_path(load):
    """Bit for bit, with steps searched and not; paths turn at up to six folds on the way."""
    rod = em.Rod(load=load)
    low, high = ([0.45, -0.16], [0.7, 0.24]) if load == "left-half" else ([0.2, -1.5], [1.2, 1.5])
    settings = np.random.default_rng(5).uniform(low, high, (60, 2))
    states = [rod.natural_state(Theta=x, Delta=y) for x, y in settings.tolist()]
    z, p = np.stack([each.z for each in states]), np.stack([each.p for each in states])
    within, at = (rod.max_curvature <= 20,), np.full(len(z), 2.5)
    options = replace(TraceOptions(record=False), through_folds=True, through_branch_points=True)
    ends = []
    for searched in (True, False):
        own = replace(options, look_inside=searched, locate_folds=searched)
        ends.append(FirstStable(rod, 2, 0.0, 100.0, within, own)(z, p, at)[0])
    np.testing.assert_array_equal(*ends)


def test_extrema_are_equal_where_the_place_of_the_largest_changes(cmap):
    """Where Δ = 0 the arch is symmetric and its two largest curvatures mirror each other."""
    (curve,) = curves(cmap, "place")
    np.testing.assert_allclose(curve.points[:, 1], 0.0, atol=1e-10)


# --- other structures, wrong input ---------------------------------------------------------------


def test_another_descriptor_of_another_structure():
    """PHYSICS §2: the spring's F = k (1 − x_l/cos δ) sin δ with x_l > 1 has one stable state."""
    spring = em.Spring()
    grid = em.Grid(x_l=(1.1, 1.3, 2), k=(1.0, 2.0, 2))
    found = em.curvature_map(spring, grid, "F", 0.1, descriptor=spring.descriptor("angle"))
    delta = found.value
    x_l, k = np.meshgrid(*grid.axes(), indexing="ij")
    np.testing.assert_allclose(k * (1 - x_l / np.cos(delta)) * np.sin(delta), 0.1, rtol=1e-9)
    assert not found.snaps.any()


def test_a_load_below_the_unloaded_one_is_refused():
    grid = em.Grid(Theta=(0.5, 1, 2), Delta=(0, 1, 2))
    with pytest.raises(InputError, match="`at` must lie between q = 0 and `bound` = 100; got -1"):
        em.curvature_map(em.Rod(), grid, "q", -1.0)
