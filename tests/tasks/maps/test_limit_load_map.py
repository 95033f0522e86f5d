"""Limit-load maps: values, statuses, symmetry, and the curves on which they are not smooth."""

import numpy as np
import pytest
from scipy import optimize

import equimorph as em
from equimorph.errors import InputError
from equimorph.tasks.maps.limit_load import LimitLoadMap, RayStatus


def curves(lmap, kind):
    return [curve for curve in lmap.curves if curve.kind == kind and len(curve.points) > 1]


def limit(lmap, point, shift=(0.0, 0.0)):
    setting = dict(zip(lmap.grid.names, np.asarray(point) + shift, strict=True))
    return lmap.at(**setting)


def distance(point, curve):
    """From a point to the chords of a followed curve, in its parameters."""
    line = np.stack([curve.states[name] for name in curve.parameters], axis=1)
    start, chord = line[:-1], np.diff(line, axis=0)
    share = np.clip(((point - start) * chord).sum(axis=1) / (chord**2).sum(axis=1), 0.0, 1.0)
    return np.linalg.norm(start + share[:, None] * chord - point, axis=1).min()


# --- values ---------------------------------------------------------------------------------------


def test_limit_loads_of_the_spring_are_the_closed_form():
    """PHYSICS §2: F = k (1 − x_l^⅔)^{3/2} below x_l = 1; beyond, every state is stable."""
    grid = em.Grid(x_l=(0.3, 1.3, 6), k=(0.5, 2.0, 3))
    lmap = em.limit_load_map(em.Spring(), grid, "F", bound=5.0)
    x_l, k = np.meshgrid(*grid.axes(), indexing="ij")
    folds = k * np.maximum(1.0 - x_l ** (2 / 3), 0.0) ** 1.5
    stable = x_l > 1.0
    np.testing.assert_allclose(lmap.value[~stable], folds[~stable], rtol=1e-9)
    assert {LimitLoadMap.kinds[k] for k in lmap.status[~stable]} == {"fold"}
    assert {LimitLoadMap.kinds[k] for k in lmap.status[stable]} == {"none below the bound"}


def test_values_and_statuses_at_the_settings_of_the_references():
    """PHYSICS §5: a branch point at (0.9, 0), a fold at (0.9, ±0.02); the printed digits."""
    rod = em.Rod()
    grid = em.Grid(Theta=(0.8, 1.0, 2), Delta=(-0.02, 0.02, 2))
    lmap = em.limit_load_map(rod, grid, "q", within=[rod.max_curvature <= 10])
    assert [LimitLoadMap.kinds[k] for k in lmap.status[1]] == ["fold", "branch point", "fold"]
    expected = [3.9485039281, 4.2439977594, 3.9485039281]
    np.testing.assert_allclose(lmap.value[1], expected, rtol=1e-10)


def test_every_vertex_has_the_limit_load_of_its_own_ray(half):
    """The map follows natural states over the grid; `limit_load` starts anew at each setting."""
    rod, axes = half.structure, half.grid.axes()
    random = np.random.default_rng(0)
    for i, j in random.integers(0, [13, 16], size=(12, 2)):
        rest = rod.natural_state(Theta=axes[0][i], Delta=axes[1][j])
        found = em.limit_load(rest, "q", within=half.within)
        assert found.kind == LimitLoadMap.kinds[half.status[i, j]]
        assert half.value[i, j] == pytest.approx(found.value, rel=1e-9, nan_ok=True)


def test_a_uniform_load_makes_the_map_symmetric(uniform):
    """(Θ, Δ) and (Θ, −Δ) are mirror images."""
    np.testing.assert_allclose(uniform.value, uniform.value[:, ::-1], rtol=1e-9)
    np.testing.assert_array_equal(uniform.status, uniform.status[:, ::-1])


def test_settings_whose_unloaded_arch_violates_the_constraint_have_no_value(half):
    undefined = half.status == LimitLoadMap.kinds.index("undefined unloaded")
    assert undefined.any()
    np.testing.assert_array_equal(np.isnan(half.value), undefined)
    assert limit(half, (0.66, 1.36)).kind == "undefined unloaded"


def test_the_best_limit_load_under_the_left_half_load_is_where_the_paper_has_it(half):
    """PHYSICS §3, §5: best 4.0, near (0.94, 0.60), where paths just miss a branch point.

    Grid lines cross the ridge every 0.1.
    """
    (ridge,) = curves(half, "branch point")
    best = int(np.argmax(ridge.values[:, 1]))
    assert ridge.points[best] == pytest.approx((0.94, 0.60), abs=0.07)
    assert ridge.values[best, 1] == pytest.approx(4.0, rel=0.01)
    assert np.nanmax(half.value) < ridge.values[best, 1]


# --- curves ---------------------------------------------------------------------------------------


def test_curves_say_how_well_they_are_known(uniform, half):
    """1e-10 where there is a cause; else half of a bracket, 8⁻⁴ of an edge (8⁻¹⁵ at the rim)."""
    for lmap in (uniform, half):
        edge = max(axis[1] - axis[0] for axis in lmap.grid.axes())
        for curve in lmap.curves:
            assert curve.errors.shape == curve.points.shape[:1]
            exact = curve.kind not in ("jump", "kink")
            bound = 1e-10 if exact else 0.5 * edge * 8.0**-4
            assert (curve.errors <= 1.01 * bound).all(), curve.kind


def test_the_map_jumps_where_two_folds_merge(uniform):
    """PHYSICS §4.4 at Θ = 0.6: between Δ = 0.75 and 0.76, from 1.317 to 2.042 (2.0392).

    Both loads hold at Δ = 0.75 and 0.76; the map changes by less than 0.01 from there.
    """
    upper = max(curves(uniform, "cusp"), key=lambda curve: curve.points[:, 1].max())
    (place,) = np.flatnonzero(np.abs(upper.points[:, 0] - 0.6) < 1e-9)
    assert 0.75 < upper.points[place, 1] < 0.76
    assert upper.values[place] == pytest.approx([1.317, 2.0392], abs=0.01)


def test_points_of_a_jump_are_cusps_of_the_fold_curves(uniform):
    """Followed by another method: folds in (Δ, q) at fixed Θ, with their cusp located."""
    fold = limit(uniform, (0.6, 0.7)).state
    box = em.Box(Delta=(0.7, 0.8), q=(0.0, 5.0))
    followed = em.fold_curve(fold, ("Delta", "q"), box=box)
    (cusp,) = [event.state for event in followed.events if event.kind == "cusp"]
    upper = max(curves(uniform, "cusp"), key=lambda curve: curve.points[:, 1].max())
    place = int(np.argmin(np.abs(upper.points[:, 0] - 0.6)))
    assert upper.points[place, 1] == pytest.approx(cusp["Delta"], abs=1e-8)
    assert upper.states["q"][place] == pytest.approx(cusp["q"], abs=1e-8)


@pytest.mark.parametrize("which", ["uniform", "half"])
def test_limit_loads_differ_on_both_sides_of_every_jump(which, request):
    """Evaluated anew 1e-3 beside the curve, across it along a grid line."""
    lmap = request.getfixturevalue(which)
    jumps = [c for kind in ("cusp", "jump") for c in curves(lmap, kind)]
    assert jumps
    for curve in jumps:
        for point, (low, high) in list(zip(curve.points, curve.values, strict=True))[::4]:
            if high - low < 0.1 or point[1] in (-1.5, 1.5) or point[0] in (0.3, 1.5):
                continue
            across = (0.0, 1e-3)
            sides = [limit(lmap, point, sign * np.array(across)).value for sign in (-1, 1)]
            assert abs(sides[1] - sides[0]) > 0.6 * (high - low)


def test_symmetric_branch_points_lie_on_the_symmetric_settings(uniform):
    """The path at Δ = 0 meets a pitchfork; its load there is that of PHYSICS §5 at Θ = 0.9."""
    (curve,) = curves(uniform, "branch point")
    np.testing.assert_allclose(curve.points[:, 1], 0.0, atol=1e-9)
    place = int(np.argmin(np.abs(curve.points[:, 0] - 0.9)))
    assert curve.points[place, 0] == pytest.approx(0.9, abs=1e-12)
    assert curve.states["q"][place] == pytest.approx(4.2439977594, rel=1e-9)


def test_branch_points_without_symmetry_are_those_of_the_followed_curve(half):
    """Under the left-half load: the branch curve of the events, in three parameters."""
    (curve,) = curves(half, "branch point")
    start = curve.states[len(curve.points) // 2]
    box = em.Box(Theta=(0.25, 1.2), Delta=(0.3, 0.9), q=(0.0, 10.0))
    options = em.TraceOptions(largest_step=0.05)
    followed = em.branch_curve(start, ("Theta", "Delta", "q"), along="q", box=box, options=options)
    # chords shorter than 0.05 of a curve with a curvature below 5 miss it by 0.05²·5/8
    for state in curve.states:
        point = np.array([state[name] for name in followed.parameters])
        assert distance(point, followed) < 1.6e-3


def test_fold_and_constraint_coincide_where_they_exchange(half):
    """There the fold has max |κ| = 10, and the limit load is continuous."""
    found = curves(half, "exchange")
    assert found
    for curve in found:
        np.testing.assert_allclose(half.structure.max_curvature(curve.states), 10.0, rtol=1e-9)
        assert np.abs(curve.states.margin).max() < 1e-6
        assert np.ptp(curve.values, axis=1).max() < 0.05


def test_two_extrema_reach_the_bound_together_where_its_place_changes(half):
    """At the place, |κ| = 10 at two arclengths, by Brent's method; the limit load is continuous.

    Both sides lie 1/32 of an edge of 0.1 to 0.19 apart.
    """
    (curve,) = curves(half, "place")
    for state in curve.states:
        for part in ((0.0, 0.25), (0.75, 1.0)):
            assert largest(half.structure, state, *part) == pytest.approx(10.0, rel=1e-10)
    assert np.ptp(curve.values, axis=1).max() < 0.02


def largest(rod, state, start, stop):
    """Largest |κ| between two arclengths, where there is at most one maximum inside."""

    def size(s):
        return -abs(rod.fields(state.z[None], state.p[None], np.array([s]))[0, 0, 1])

    inside = optimize.minimize_scalar(
        size, bounds=(start, stop), method="bounded", options={"xatol": 1e-9}
    )
    return -min(inside.fun, size(start), size(stop))


def test_at_the_edge_the_unloaded_arch_has_the_largest_curvature_allowed(uniform):
    edge = curves(uniform, "edge")[0]
    np.testing.assert_allclose(uniform.structure.max_curvature(edge.states), 10.0, rtol=1e-9)
    np.testing.assert_array_equal(edge.states["q"], 0.0)
    assert limit(uniform, edge.points[5] * (1 + 1e-6)).kind == "undefined unloaded"
    assert limit(uniform, edge.points[5] * (1 - 1e-6)).kind != "undefined unloaded"


# --- wrong input ----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("grid", "load", "more", "message"),
    [
        ({"Theta": (0.5, 1, 2)}, "q", {}, "`grid` must have two parameters; got Theta"),
        ({"Theta": (0.5, 1, 2), "q": (0, 1, 2)}, "q", {}, "`load` must be neither in `grid`"),
        ({"Theta": (0.5, 1, 2), "Delta": (0, 1, 2)}, "load", {}, "`load` must be a parameter"),
        ({"Theta": (0.5, 1, 2), "Delta": (0, 1, 2)}, "q", {"bound": 0.0}, "`bound` must exceed q"),
    ],
)
def test_wrong_questions_are_named(grid, load, more, message):
    with pytest.raises(InputError, match=message):
        em.limit_load_map(em.Rod(), em.Grid(**grid), load, **more)


def test_settings_outside_the_grid_are_refused(uniform):
    with pytest.raises(InputError, match="`setting` must lie in"):
        uniform.at(Theta=2.0, Delta=0.0)
    with pytest.raises(InputError, match="`setting` must give Theta and Delta; got Theta"):
        uniform.at(Theta=1.0)


def test_unstable_natural_states_bear_no_load():
    """E = k x²/2 − x⁴/4 − F x with k = a + b rests at x = 0 where k > 0: F ≤ 2 (k/3)^(3/2)."""
    parameters = [
        em.Parameter("a", "1", 1.0, "actuator", 0.5),
        em.Parameter("b", "1", 1.0, "actuator", 0.5),
        em.Parameter("F", "1", 1.0, "load", 0.0),
    ]
    unknowns = [em.Unknown("x", 0.0, guesses=(-2, 2))]
    owner = em.EnergyStructure("(a + b)*x**2/2 - x**4/4 - F*x", unknowns, parameters)
    lmap = em.limit_load_map(owner, em.Grid(a=(-1.0, 1.0, 8), b=(-0.9, 1.0, 8)), "F")
    stiffness = np.add.outer(*lmap.grid.axes())
    known = np.where(stiffness > 0.0, 2.0 * (np.maximum(stiffness, 0.0) / 3.0) ** 1.5, np.nan)
    np.testing.assert_allclose(lmap.value, known, atol=1e-9)
    assert np.all(lmap.status[stiffness <= 0.0] == RayStatus.NO_NATURAL_STATE)
    assert em.strongest(lmap).best.value == pytest.approx(2.0 * (2.0 / 3.0) ** 1.5)
