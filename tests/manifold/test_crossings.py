"""Sets whose smooth sheets cross, as in symmetric slices: closed forms, and the arch at Δ = 0."""

import numpy as np
import pytest
from hypothesis import given, strategies as st

from draws import few
from equimorph import lift, plotting, storage
from equimorph.manifold import (
    EquilibriumSet,
    VertexKind,
    cell_sizes,
    equilibrium_set,
    locate,
    refine,
    restricted,
)
from equimorph.manifold.complex.excerpts import fabric_of
from equimorph.manifold.geometry.topology import adjacency
from equimorph.manifold.refining.quality import confined_angles, smallest_angles
from equimorph.model import Box, Descriptor
from equimorph.structures import Rod
from oracles.complexes import assert_crossings, assert_faithful, assert_upright
from oracles.polynomial import slaved
from oracles.specimens import toggle
from oracles.surfaces import (
    crossing_sheets,
    hilltop,
    hilltop_beside_tricritical,
    pitchforks,
    returning,
    three_planes,
    transcriticals,
    tricritical,
    tricritical_beside_cusp,
)
from typecheck import unchecked

intervals = st.tuples(st.integers(3, 7), st.integers(3, 7))
cubics = st.sampled_from([-2.0, -0.7, 0.6, 1.0, 1.9])
slants = st.sampled_from([-0.4, 0.0, 0.3])
BOX = Box(a=(-1.0, 1.1), b=(-1.0, 1.2))


def lifted(structure, box, checks=0, **options) -> EquilibriumSet:
    """Set without checks of shapes, which the tests that lift by `equilibrium_set` make."""
    with unchecked():
        return equilibrium_set(structure, box, checks=checks, **options)


def crossed(eset: EquilibriumSet) -> np.ndarray:
    """Unknowns and parameters where sheets cross."""
    at = eset.kinds == 7
    return np.column_stack([eset.points.z[at], eset.coordinates[at]])


@few(4)
@given(cubics, st.integers(2, 12))
def test_pitchfork_diagram_has_all_four_branches_in_one_point(cubic, count):
    """x (cubic·x² − a) = 0 over a."""
    eset = lifted(pitchforks(cubic, 0.0), Box(a=(-1, 1.3)), fixed={"b": 0.0}, intervals=(count,))
    assert_faithful(eset)
    assert_crossings(eset)
    assert crossed(eset) == pytest.approx(np.zeros((1, 2)), abs=1e-12)
    assert (eset.audit.components, eset.audit.euler_characteristic) == (1, 1)
    assert len(eset.boundaries) == 4
    assert sorted(piece.index for piece in eset.strata) == (
        [0, 0, 0, 1] if cubic > 0 else [0, 1, 1, 1]
    )
    beyond = 1.0 if cubic > 0 else -0.9
    states = eset.at(a=beyond)
    root = np.sqrt(beyond / cubic)
    assert np.sort(states.z[:, 0]) == pytest.approx([-root, 0.0, root], abs=1e-12)


@few(4)
@given(cubics, slants, st.integers(2, 12))
def test_transcritical_diagram_exchanges_stability(skew, b, count):
    """x (skew·x − a − b/2) = 0: both branches change their index where they cross."""
    eset = lifted(transcriticals(skew, 0.5), Box(a=(-1, 1.3)), fixed={"b": b}, intervals=(count,))
    assert_faithful(eset)
    assert_crossings(eset)
    assert crossed(eset) == pytest.approx(np.array([[0.0, -b / 2]]), abs=1e-12)
    assert sorted(piece.index for piece in eset.strata) == [0, 0, 1, 1]


def test_slaved_unknowns_and_checks_of_shapes_change_nothing():
    eset = equilibrium_set(
        slaved(pitchforks(1.0, 0.3), 2.0, 0.5), BOX, fixed={}, intervals=(3, 4), checks=2
    )
    assert_faithful(eset)
    assert_crossings(eset)
    assert eset.audit.missing == 0


@few(4)
@given(cubics, slants, intervals)
def test_pitchfork_curve_joins_both_halves_of_a_cylinder_to_a_plane(cubic, slant, grid):
    """x (cubic·x² − a − slant·b) = 0; the crossing a + slant·b = 0 runs through the box."""
    eset = lifted(pitchforks(cubic, slant), BOX, intervals=grid)
    assert_faithful(eset)
    assert_crossings(eset)
    x, a, b = crossed(eset).T
    np.testing.assert_allclose(x, 0.0, atol=1e-9)
    np.testing.assert_allclose(a + slant * b, 0.0, atol=1e-12)
    assert (len(eset.crossings), eset.folds) == (1, ())
    assert sorted(b[[b.argmin(), b.argmax()]]) == pytest.approx([-1.0, 1.2])
    assert sorted(piece.index for piece in eset.strata) == (
        [0, 0, 0, 1] if cubic > 0 else [0, 1, 1, 1]
    )
    # two discs that share an arc
    assert (eset.audit.components, eset.audit.euler_characteristic) == (1, 1)


@few(4)
@given(cubics, slants, intervals)
def test_transcritical_planes_cross_along_a_line(skew, slant, grid):
    eset = lifted(transcriticals(skew, slant), BOX, intervals=grid)
    assert_faithful(eset)
    assert_crossings(eset)
    assert (len(eset.crossings), eset.folds, len(eset.strata)) == (1, (), 4)
    assert (eset.audit.components, eset.audit.euler_characteristic) == (1, 1)


@pytest.mark.slow
@few(4)
@given(cubics, intervals)
def test_folds_leave_the_pitchforks_where_these_turn_subcritical(cubic, grid):
    """x (x⁴ + cubic·b x² − a): one fold curve a = −(cubic·b)²/4 through the origin."""
    eset = lifted(tricritical(cubic), BOX, intervals=grid)
    assert_faithful(eset)
    assert_crossings(eset)
    assert (len(eset.crossings), len(eset.folds)) == (1, 1)
    x, b = eset.points.z[:, 0], eset.points["b"]
    folded = eset.folds[0]
    np.testing.assert_allclose(x[folded] ** 2, -cubic * b[folded] / 2, atol=1e-8)
    hub = np.intersect1d(eset.folds[0], eset.crossings[0])
    np.testing.assert_allclose(eset.coordinates[hub], [[0.0, 0.0]], atol=1e-9)
    assert sorted(piece.index for piece in eset.strata) == [0, 0, 0, 1, 1, 1]


@pytest.mark.slow
@few(4)
@given(st.sampled_from([0.4, 1.0, 2.5]), intervals)
def test_fold_of_the_symmetric_sheet_passes_its_pitchforks(k, grid):
    """s² + k x² = a, x (s − b) = 0: hilltop at the origin, where two eigenvalues vanish."""
    eset = lifted(hilltop(k), BOX, intervals=grid)
    assert_faithful(eset)
    assert_crossings(eset)
    assert (len(eset.crossings), len(eset.folds)) == (1, 1)
    s, x, a, b = crossed(eset).T
    np.testing.assert_allclose(np.stack([s - b, x, a - b**2]), 0.0, atol=1e-7)
    hub = np.intersect1d(eset.folds[0], eset.crossings[0])
    np.testing.assert_allclose(eset.coordinates[hub], [[0.0, 0.0]], atol=1e-3)


def assert_hilltop_at_0(eset):
    """Nothing is bisected, and the fold meets the crossing at 0."""
    assert_faithful(eset)
    assert_crossings(eset)
    assert eset.audit.bisected == 0
    hub = np.intersect1d(eset.folds[0], eset.crossings[0])
    np.testing.assert_allclose(eset.coordinates[hub], [[0.0, 0.0]], atol=1e-3)


@pytest.mark.parametrize("grid", [(3, 3), (4, 5)])
@pytest.mark.parametrize(("k", "bend"), [(0.4, 1.5), (2.5, 0.5), (2.5, 1.5)])
def test_hilltops_are_found_on_crossings_that_bend(k, bend, grid):
    """s² + k x² (1 + 3 bend s²) = a, x (s + bend s³ − b) = 0: the hilltop at 0 needs no bisection.

    With guesses on the chord of the crossing Newton's method did not come near it: 3 to 10
    triangles were bisected here, and two sets of frames of the soak had no end of it.
    """
    eset = lifted(hilltop(k, bend), BOX, intervals=grid)
    assert_hilltop_at_0(eset)


@pytest.mark.parametrize("grid", [(3, 3), (4, 5)])
@pytest.mark.parametrize("soft", [1e-2, 1e-4])
def test_hilltops_are_found_where_another_eigenvalue_is_small_all_around(soft, grid):
    """The hilltop of a soft sheet, whose eigenvalue 2 soft s vanishes on the fold.

    Between known points of the crossing this is the smallest eigenvalue. With its null vector
    Newton's method left the crossing: 4 to 12 triangles were bisected here.
    """
    eset = lifted(hilltop(2.5, 1.5, soft), BOX, intervals=grid)
    assert_hilltop_at_0(eset)


@pytest.mark.parametrize("box", [Box(a=(-0.91, 0.43), b=(-0.62, 0.41)), BOX])
@pytest.mark.parametrize("c", [0.03, 0.1, 0.3])
def test_hilltops_are_found_beside_folds_that_leave_their_pitchforks(box, c):
    """Both lie on one chord: the cubic coefficient of the crossing changes its sign in each.

    Each is a hub of its own sheet: 9 to 23 triangles were bisected until they were parted. One of
    the ends was taken for the hilltop before (wrong cells; set 904 of the soak with a bound on
    rotations). Both may be one point if they are nearer than 1e-3 of a chord.
    """
    eset = lifted(hilltop_beside_tricritical(c), box, checks=2, intervals=(3, 3))
    assert_faithful(eset)
    assert_crossings(eset)
    assert eset.audit.bisected <= 2
    hubs = np.intersect1d(np.concatenate(eset.folds), np.concatenate(eset.crossings))
    exact = np.array([[0.0, 0.0], [-(c**3) / 4, c**4 / 16]])[: len(hubs)]
    assert len(hubs) == 2 or c < 0.1
    off = np.linalg.norm(eset.coordinates[hubs] - exact[:, None], axis=2)
    np.testing.assert_allclose(off.min(axis=1), 0.0, atol=1e-6)


@pytest.mark.parametrize("grid", [(2, 2), (3, 3)])
def test_folds_leave_pitchforks_in_triangles_with_other_folds(grid):
    """x (y³ − 0.6 y² + b y − a), y = x²: the hub at 0, the cusp at b = 0.12.

    The polygon around the hub has a pair of folds more. It was bisected until they were parted: 8
    and 9 triangles.
    """
    eset = lifted(tricritical_beside_cusp(0.6), BOX, intervals=grid)
    assert_faithful(eset)
    assert_crossings(eset)
    assert (eset.audit.bisected, len(eset.crossings), len(eset.folds)) == (0, 1, 1)
    y, b = eset.points.z[:, 0] ** 2, eset.points["b"]
    folded = eset.folds[0]
    np.testing.assert_allclose(b[folded], 1.2 * y[folded] - 3 * y[folded] ** 2, atol=1e-8)
    hub = np.intersect1d(folded, eset.crossings[0])
    np.testing.assert_allclose(eset.coordinates[hub], [[0.0, 0.0]], atol=1e-9)


@pytest.mark.slow
@few(4)
@given(intervals)
def test_sheet_can_fold_where_it_crosses_another(grid):
    """x (x² + b x + a): the second sheet, a = −x² − b x, folds at x = −b/2."""
    # off the round numbers, which put a grid line through the origin, where three kinds meet
    eset = lifted(crossing_sheets(), Box(a=(-1, 1.1), b=(-1.03, 1.5)), intervals=grid)
    assert_faithful(eset)
    assert_crossings(eset)
    assert (len(eset.crossings), len(eset.folds)) == (1, 1)
    hub = np.intersect1d(eset.folds[0], eset.crossings[0])
    np.testing.assert_allclose(eset.coordinates[hub], [[0.0, 0.0]], atol=1e-9)


def test_constraint_cuts_both_sheets_where_they_cross():
    """b ≤ 0.3 + x + a/2 cuts the plane and the cylinder, and their crossing at b = 0.3."""
    slanted = Descriptor("cut", "1", lambda z, p: p[:, 1] - z[:, 0] - 0.5 * p[:, 0])
    eset = lifted(pitchforks(1.0, 0.0), BOX, within=[slanted <= 0.3], intervals=(4, 5))
    assert_faithful(eset)
    assert_crossings(eset)
    ends = eset.crossings[0][[0, -1]]
    assert sorted(eset.points["b"][ends]) == pytest.approx([-1.0, 0.3])


@pytest.mark.slow
def test_three_sheets_that_meet_in_one_point_are_not_called_clean():
    """x (x − a) (x − b): three crossings meet at the origin, which this complex cannot hold."""
    eset = lifted(three_planes(), BOX, intervals=(2, 3))
    assert not eset.audit.clean
    assert eset.audit.undecided > 0


@pytest.fixture(scope="module")
def symmetric_slice():
    """The arch over (Θ, q) at Δ = 0."""
    arch = Rod()
    return lifted(
        arch,
        Box(Theta=(0.5, 1.5), q=(0.0, 6.0)),
        fixed={"Delta": 0.0},
        within=[arch.max_curvature <= 20],
        intervals=(8, 12),
        checks=2,
    )


def first_pitchforks(eset: EquilibriumSet) -> np.ndarray:
    """Crossings that end the stability of the upright symmetric arch, in order of Θ."""
    cells = eset.cells[eset.cell_index == 0]
    stable = np.intersect1d(cells, np.flatnonzero((eset.kinds == 7) & (eset.index == 0)))
    stable = stable[eset.structure.height(0.5)(eset.points)[stable] > 0]
    return stable[np.argsort(eset.points["Theta"][stable])]


def test_symmetric_slice_of_the_arch_is_clean(symmetric_slice):
    eset = symmetric_slice
    assert_faithful(eset)
    assert_crossings(eset)
    assert eset.audit.checked > 0
    # inverted arch without load, ends turned by ±α: pitchfork at α = 0.80846 (PHYSICS §5)
    unloaded = (eset.kinds == 7) & (eset.points["q"] < 1e-9) & (eset.index == 0)
    assert eset.points["Theta"][unloaded] == pytest.approx([0.80846], abs=5e-6)


def test_pitchforks_of_the_slice_are_those_that_lifts_along_the_load_meet(symmetric_slice):
    """At each Θ of a vertex the load is raised from the natural state to the branch point.

    But where a fold meets the pitchforks: that is a multiple point.
    """
    eset = symmetric_slice
    pitchforks = first_pitchforks(eset)
    chosen = pitchforks[~np.isin(pitchforks, np.concatenate(eset.folds))][::3]
    assert len(chosen) >= 4
    for vertex in chosen:
        state = eset.points[vertex]
        path = lift(eset.structure.natural_state(Theta=state["Theta"]), to={"q": 8.0})
        assert path.end.kind == "branch point"
        assert path.end.state["q"] == pytest.approx(state["q"], abs=1e-8)


def test_pitchfork_curve_passes_through_the_known_load():
    """(0.9, 0): q = 4.2439977594 (PHYSICS §5), in the diagram over q, and its four branches."""
    arch = Rod()
    eset = lifted(
        arch,
        Box(q=(0, 6)),
        fixed={"Theta": 0.9, "Delta": 0.0},
        within=[arch.max_curvature <= 20],
        intervals=(30,),
        checks=1,
    )
    assert_faithful(eset)
    assert_crossings(eset)
    loads = eset.points["q"][eset.kinds == 7]
    assert np.abs(loads - 4.2439977594).min() < 1e-9
    # all that is connected through the crossing: both symmetric halves and both side branches
    at = int(np.argmin(np.where(eset.kinds == 7, np.abs(eset.points["q"] - 4.2439977594), np.inf)))
    around = np.flatnonzero((eset.cells == at).any(axis=1))
    assert sorted(eset.cell_index[around]) == [0, 1, 1, 1]
    assert len(np.unique(eset.stratum[around])) == 4
    assert len(np.unique(eset.component[around])) == 1
    # the fold of the symmetric path (PHYSICS §5) lies beyond the box; that of no other is lost
    assert eset.audit.missing == 0


def test_both_asymmetric_sheets_are_attached_along_the_pitchfork(symmetric_slice):
    """Of the four cells two are their own mirror image; the others are each other's."""
    eset = symmetric_slice
    (mirror,) = eset.structure.symmetries()
    whole = adjacency(eset.cells)
    n, mass = eset.structure.unknowns, eset.structure.mass
    image, _ = mirror.apply(eset.points.z, eset.points.p)
    off = np.sqrt((image - eset.points.z)[:, :n] ** 2 @ mass)
    crossed = np.isin(eset.kinds, (7,))
    for facet in np.flatnonzero(whole.counts == 4):
        around = np.flatnonzero((whole.cell_facets == facet).any(axis=1))
        free = [[v for v in eset.cells[cell] if not crossed[v]] for cell in around]
        symmetric = [bool(off[own].max() < 1e-6) for own in free]
        assert symmetric.count(True) == 2
        assert (off[eset.cells[around[np.array(symmetric)]]] < 1e-6).all()
    # above (0.9, 4.2) two mirror images of equal energy lie just beside the symmetric arch
    over = eset.at(Theta=0.9, q=4.2)
    height = eset.structure.height(0.5)(over)
    tilted = np.flatnonzero((over.index == 1) & (height > 0))
    assert len(tilted) == 2
    assert np.ptp(over.energy[tilted]) < 1e-12


def test_no_state_is_lost_beside_the_pitchfork(symmetric_slice):
    """Θ = 0.9: branch point at 4.2439977594 (PHYSICS §5), subcritical: three states before it.

    Their amplitudes grow like the root of the distance.
    """
    away = 10.0 ** -np.arange(4.0, 9.5)
    loads = 4.2439977594 + np.concatenate([-away, away])
    with unchecked():
        over = symmetric_slice.over(Theta=np.full(len(loads), 0.9), q=loads)
    arch = symmetric_slice.structure
    amplitudes = []
    for number, states in enumerate(over):
        near = np.abs(arch.height(0.5)(states.states) - 0.2332) < 0.003
        tilt = (arch.height(1 / 3)(states.states) - arch.height(2 / 3)(states.states))[near]
        order = np.argsort(tilt)
        index = states.index[near][order].tolist()
        assert index == ([1, 0, 1] if number < len(away) else [1])
        if number < len(away):
            amplitudes.append(np.abs(tilt[order])[[0, 2]])
    growth = np.array(amplitudes) / np.sqrt(away)[:, None]
    np.testing.assert_allclose(growth[:-1], growth[2, 0], rtol=0.01)
    # the load is known to 5e-11: 2.5 % of the last amplitude
    np.testing.assert_allclose(growth[-1], growth[2, 0], rtol=0.03)


def test_states_beside_the_pitchfork_do_not_depend_on_round_off(symmetric_slice):
    """1e-9 before the branch point, Θ moved by 2e-12 at most: 80 times the same three states.

    Round-off in the residual, 1e-16, would move both tilted ones by 5 %, and merge some with the
    upright one. They are mirror images: the slope of r, 4e-12, has a round-off of 1e-16.
    """
    angles = 0.9 + np.random.default_rng(0).uniform(-2e-12, 2e-12, 80)
    with unchecked():
        over = symmetric_slice.over(Theta=angles, q=np.full(80, 4.2439977594 - 1e-9))
    arch, tilts = symmetric_slice.structure, []
    for states in over:
        near = np.abs(arch.height(0.5)(states.states) - 0.2332) < 0.003
        tilt = (arch.height(1 / 3)(states.states) - arch.height(2 / 3)(states.states))[near]
        order = np.argsort(tilt)
        assert states.index[near][order].tolist() == [1, 0, 1]
        tilts.append(tilt[order])
    left, upright, right = np.transpose(tilts)
    np.testing.assert_allclose(-left, right, rtol=1e-6)
    np.testing.assert_allclose(upright, 0.0, atol=1e-6 * right.min())
    # the branch point moves by 1e-11 with the angle
    np.testing.assert_allclose(right, right[0], rtol=0.01)


def test_set_with_crossings_comes_back_from_its_file(symmetric_slice, tmp_path):
    path = tmp_path / "slice.h5"
    storage.save_set(path, symmetric_slice)
    again = storage.load_set(path)
    assert all(map(np.array_equal, again.crossings, symmetric_slice.crossings))
    assert again.audit == symmetric_slice.audit
    assert np.array_equal(again.stratum, symmetric_slice.stratum)


def test_figure_names_the_branch_points(symmetric_slice):
    eset = symmetric_slice
    ax = plotting.surface(eset, eset.structure.height(1 / 3))
    assert "branch points" in [text.get_text() for text in ax.get_legend().get_texts()]


def angles_off_curves(eset: EquilibriumSet) -> np.ndarray:
    """Smallest angles, in degrees, of triangles that are not squeezed between curves."""
    fabric = fabric_of(eset)
    return np.degrees(smallest_angles(fabric.squared)[~confined_angles(fabric, np.radians(10.0))])


@pytest.fixture(scope="module")
def refined_slice(symmetric_slice):
    with unchecked():
        return refine(symmetric_slice, 0.02)


def test_symmetric_slice_is_refined(refined_slice):
    eset = refined_slice
    with unchecked():
        assert_faithful(eset)
        assert_crossings(eset)
        assert_upright(eset)
    assert eset.audit.deviation <= 0.02
    # the fold beside a pitchfork curve meets it at 0.3°; only beside that corner cells are sharp
    assert eset.audit.smallest_angle < 1.0
    with unchecked():
        free = angles_off_curves(eset)
    assert np.count_nonzero(free < 10.0) <= 0.005 * len(free)


def test_slice_cut_at_an_end_angle_has_the_known_pitchfork_on_its_edge(refined_slice):
    """(0.9, 0): q = 4.2439977594 (PHYSICS §5)."""
    angle = Descriptor("angle", "rad", lambda z, p: p[:, 0] - 0.0)
    assert refined_slice.structure.parameters[0].name == "Theta"
    with unchecked():
        below = restricted(refined_slice, angle <= 0.9)
    assert below.audit.clean
    assert_crossings(below)
    ends = (below.kinds == 7) & (np.abs(below.points["Theta"] - 0.9) < 1e-12)
    assert np.abs(below.points["q"][ends] - 4.2439977594).min() < 1e-9


def test_queries_of_the_refined_slice_agree_with_those_of_the_coarse_one(
    symmetric_slice, refined_slice, tmp_path
):
    generator = np.random.default_rng(5)
    at = {"Theta": generator.uniform(0.5, 1.5, 60), "q": generator.uniform(0.0, 6.0, 60)}
    with unchecked():
        coarse, fine = symmetric_slice.over(**at), refined_slice.over(**at)
        path = tmp_path / "slice.h5"
        storage.save_set(path, refined_slice)
        again = storage.load_set(path)
    assert np.array_equal(coarse.point, fine.point)
    for number in range(60):
        energies = [np.sort(own[number].states.energy) for own in (coarse, fine)]
        np.testing.assert_allclose(*energies, atol=1e-11)
    assert all(map(np.array_equal, again.crossings, refined_slice.crossings))
    assert again.audit == refined_slice.audit
    # the upright arch above (0.9, 4.2) is told from both tilted ones by its shape
    upright = refined_slice.at(Theta=0.9, q=4.2)
    upright = upright[np.flatnonzero(upright.index == 0)]
    state = upright[int(np.argmax(refined_slice.structure.height(0.5)(upright)))]
    with unchecked():
        found = locate(refined_slice, state.shape())
    assert found.state["q"] == pytest.approx(4.2, abs=1e-6)


def test_plane_of_the_slice_shows_where_the_upright_arch_tilts(refined_slice):
    ax = plotting.parameter_plane(refined_slice, count="stable")
    labels = [text.get_text() for text in ax.get_legend().get_texts()]
    assert labels == ["stability boundary", "branch points"]


@pytest.mark.parametrize("cap", [0.3, 0.1, 0.01])
@pytest.mark.parametrize("slant", [-0.4, 0.3])
def test_side_branches_that_leave_the_constraint_within_a_cell_are_strips(slant, cap):
    """x (x² − a − slant·b), x² ≤ cap²: a strip of width 2·cap, however coarse the grid is.

    Area: chords over x = 0 … ±cap lie within cap²/3 of the parabola, relatively.
    """
    square = Descriptor("square", "1", lambda z, p: z[:, 0] ** 2)
    eset = lifted(pitchforks(1.0, slant), BOX, within=[square <= cap**2], intervals=(4, 5))
    with unchecked():
        assert_faithful(eset)
        assert_crossings(eset)
    assert sorted(stratum.index for stratum in eset.strata) == [0, 0, 0, 1]
    assert (eset.audit.components, len(eset.crossings), eset.folds) == (1, 1, ())
    assert eset.audit.bisected == 0 or cap > 0.1
    plane = 2.1 * 2.2
    strip = 2.0 * np.linalg.norm(np.cross([cap, cap**2, 0.0], [0.0, -2.2 * slant, 2.2]))
    assert cell_sizes(eset).sum() == pytest.approx(plane + strip, abs=strip * cap**2)


@pytest.mark.parametrize(
    ("turn", "share", "slant", "bend"),
    [
        pytest.param(0.1, 1.2, -0.3, 0.0, id="before the crossing"),
        pytest.param(0.1, 2.3, -0.3, 0.2, id="beyond the crossing"),
        pytest.param(0.03, 1.5, 0.13, 0.0, id="narrower"),
        pytest.param(0.03, 1.5, -0.3, 0.2, id="narrower and bent", marks=pytest.mark.slow),
    ],
)
def test_side_branches_that_turn_back_before_they_leave_the_constraint_are_strips(
    turn, share, slant, bend
):
    """x (x⁴ − 2 turn x² − a − slant·b − bend·b²), x² ≤ share·turn: folds at x² = turn.

    The strip from the folds to the crossing is turn² wide, in intervals of 0.4. Set 724 of the soak
    had 132 undecided triangles along such a strip.
    """
    structure = returning(turn, slant, bend)
    square = Descriptor("square", "1", lambda z, p: z[:, 0] ** 2)
    eset = lifted(structure, BOX, within=[square <= share * turn], intervals=(5, 4))
    with unchecked():
        assert_faithful(eset)
        assert_crossings(eset)
    assert sorted(stratum.index for stratum in eset.strata) == [0, 0, 0, 1, 1, 1]
    assert (len(eset.crossings), len(eset.folds)) == (1, 2)
    assert (eset.audit.components, eset.audit.euler_characteristic) == (1, 1)
    b = np.linspace(-0.9, 1.1, 7)
    for level in (-0.98, -0.2):
        inner = turn * (1.0 + np.array([-1.0, 1.0]) * np.sqrt(1.0 + level))
        roots = np.sqrt(inner[inner <= share * turn])
        found = eset.over(a=level * turn**2 - slant * b - bend * b**2, b=b)
        expected = np.tile(np.sort([0.0, *roots, *-roots]), (len(b), 1))
        values = found.states.z[np.lexsort((found.states.z[:, 0], found.point)), 0]
        np.testing.assert_allclose(values.reshape(len(b), -1), expected, atol=1e-9)


@pytest.mark.parametrize("cap", [0.3, 1e-2, 1e-3, 1e-4, 1e-5])
def test_side_branches_of_a_diagram_may_leave_the_constraint_within_an_interval(cap):
    """x (x² − a) over a with |x| ≤ cap: an arc of the side branch over a ≤ cap², and the line."""
    size = Descriptor("size", "1", lambda z, p: np.abs(z[:, 0]))
    box, within = Box(a=(-1, 1.3)), [size <= cap]
    eset = lifted(pitchforks(1.0, 0.0), box, fixed={"b": 0.0}, within=within, intervals=(5,))
    assert_faithful(eset)
    assert_crossings(eset)
    assert sorted(stratum.index for stratum in eset.strata) == [0, 0, 0, 1]
    ends = eset.points.z[eset.kinds == VertexKind.CAP, 0]
    assert np.sort(ends) == pytest.approx([-cap, cap], rel=1e-9)


def test_crossing_leaves_through_the_constraint_that_bounds_its_side_branches():
    """x (x² − a), x² ≤ 0.02·(b + 0.1): where b → −0.1 the strip gets narrower than any cell."""
    wedge = Descriptor("wedge", "1", lambda z, p: z[:, 0] ** 2 - 0.02 * p[:, 1])
    eset = lifted(pitchforks(1.0, 0.0), BOX, within=[wedge <= 0.002], intervals=(4, 5))
    with unchecked():
        assert_faithful(eset)
        assert_crossings(eset)
    met = np.unique(np.concatenate(eset.crossings))
    assert eset.coordinates[met, 1].min() == pytest.approx(-0.1, abs=1e-9)
    assert sorted(stratum.index for stratum in eset.strata) == [0, 0, 0, 1]


@pytest.mark.slow
@pytest.mark.parametrize("intervals", [(17, 11), (24, 41)])
def test_side_branches_of_a_flat_arch_leave_the_constraint_beside_their_crossing(intervals):
    """Over span and load at Θ = 1.642, with max |κ| ≤ 8.37: pitchforks end on the constraint."""
    arch = Rod()
    with unchecked():
        eset = equilibrium_set(
            arch,
            Box(nu=(0.6517, 0.8763), q=(-2.1871, 8.8459)),
            fixed={"Theta": 1.642, "Delta": 0.0},
            within=[arch.max_curvature <= 8.37],
            intervals=intervals,
        )
        assert_faithful(eset)
    assert eset.audit.crossings > 0


@pytest.mark.slow
@pytest.mark.parametrize(
    ("degree", "a", "load", "cap", "intervals"),
    [
        (4, (-0.6045, 0.6457), (-0.9097, -0.1394), 13.08, (6, 4)),
        (4, (-0.8381, 0.6701), (-1.8168, 1.6665), 11.97, (7, 6)),
        (8, (-0.8976, -0.12), (-1.2126, -0.8126), 5.0, (5, 10)),
    ],
)
def test_side_branches_that_a_coarse_frame_does_not_resolve_are_lifted(
    degree, a, load, cap, intervals
):
    """The symmetric toggle: curves through its pitchforks belong to the set all the same.

    In the last box the toggle has buckled modes of any number, whose curvature grows with it: from
    |κ| = 5.14 on degree 8 does not resolve them, and degree 4 resolves too few below.
    """
    frame = toggle(degree=degree)
    within = [frame.max_curvature <= cap]
    with unchecked():
        eset = equilibrium_set(frame, Box(a=a, P=load), within=within, intervals=intervals)
        assert_faithful(eset)
    assert eset.audit.crossings > 0
    assert eset.audit.unresolved > 0
