"""Atlases: the spring in closed form, surfaces, the arch with lifts across its cut."""

import numpy as np
import pytest
from hypothesis import given, strategies as st

import equimorph as em
from equimorph.charts import Transition
from equimorph.charts.conflicts import overlapping
from equimorph.charts.coordinates import coordinates_of
from equimorph.charts.location import Cells
from equimorph.charts.regions import count_regions
from equimorph.errors import InputError
from equimorph.manifold import part
from oracles.charted import lifted, spring_fold
from oracles.polynomial import fold_form
from oracles.surfaces import cusp, sphere, swallowtail
from typecheck import unchecked


@pytest.fixture(scope="module")
def spring_atlas(spring_set):
    return em.dissect(spring_set)


@pytest.fixture(scope="module")
def arch_atlas(arch_set):
    with unchecked():
        return em.dissect(part(arch_set, arch_set.cell_index == 0))


def test_the_spring_has_three_charts(spring_atlas):
    """Panel (d): two stable ones, cut from the cusp (1, 0) to the box, and the unstable one."""
    assert len(spring_atlas) == 3
    assert [chart.index for chart in spring_atlas.charts] == [0, 0, 1]
    assert all(chart.single_valued for chart in spring_atlas.charts)
    x = np.linspace(0.3, 1.0, 10_001)
    wedge = 2.0 * np.trapezoid(spring_fold(x), x)
    sizes = [chart.domain.size for chart in spring_atlas.charts]
    assert sizes[0] + sizes[1] == pytest.approx(1.0 + wedge, rel=3e-3)
    assert sizes[2] == pytest.approx(wedge, rel=5e-3)
    assert spring_atlas.eset.audit.clean


def test_transitions_of_the_spring_are_its_folds_and_one_cut(spring_atlas):
    """Folds in closed form; the cut begins at the cusp (1, 0) and ends on the box."""
    kinds = sorted(transition.kind for transition in spring_atlas.transitions)
    assert kinds == ["cut", "fold", "fold"]
    for transition in spring_atlas.transitions:
        x, force = transition.coords[0].T
        delta = transition.states.z[:, 0]
        np.testing.assert_allclose(force, (1 - x / np.cos(delta)) * np.sin(delta), atol=1e-10)
        if transition.kind == "fold":
            np.testing.assert_allclose(np.abs(force), spring_fold(x), rtol=0, atol=1e-8)
        else:
            ends = transition.coords[0][[0, -1]]
            ends = ends[np.argsort(ends[:, 0])]
            assert ends[0] == pytest.approx([1.0, 0.0], abs=1e-6)
            assert ends[1, 0] == pytest.approx(1.3, abs=1e-12)


def test_transitions_are_one_to_one_both_ways(spring_atlas):
    for transition in spring_atlas.transitions:
        first, second = transition.charts
        at = 0.5 * (transition.coords[0][1:] + transition.coords[0][:-1])
        there = transition.cross(at, first)
        np.testing.assert_allclose(transition.cross(there, second), at, rtol=0, atol=1e-12)
        with pytest.raises(InputError, match="`coords` must lie on the transition"):
            transition.cross(np.array([[0.4, 0.4]]), first)
        with pytest.raises(InputError, match="`source` must be one of"):
            transition.cross(at, 7)


@pytest.fixture
def bend():
    """A transition from (0, 0) over (1, 0) to (1, 1), stretched twice and three times."""
    ours = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]])
    states = em.States(em.Spring(), np.zeros((3, 1)), np.ones((3, 3)))
    facets = np.array([[0, 1], [1, 2]])
    return Transition((0, 1), "cut", states, (ours, ours * [2.0, 3.0]), facets)


def test_points_on_a_transition_keep_their_share_of_a_chord(bend):
    there = bend.cross(np.array([[0.25, 0.0], [1.0, 0.5], [1.0, 1.0]]), 0)
    np.testing.assert_allclose(there, [[0.5, 0.0], [2.0, 1.5], [2.0, 3.0]], rtol=0, atol=1e-15)


@pytest.mark.parametrize(
    ("place", "lies"),
    [((0.25, 5e-7), True), ((0.25, 2e-6), False), ((-5e-7, 0.0), True), ((-2e-6, 0.0), False)],
)
def test_points_belong_to_a_transition_up_to_a_millionth_of_its_extent(bend, place, lies):
    """Beyond its ends as well as beside it."""
    if lies:
        expected = [2.0 * max(place[0], 0.0), 0.0]
        np.testing.assert_allclose(bend.cross(np.array([place]), 0)[0], expected, atol=1e-15)
    else:
        with pytest.raises(InputError, match="`coords` must lie on the transition"):
            bend.cross(np.array([place]), 0)


@given(st.floats(-1.25, 1.25), st.floats(0.31, 1.29))
def test_every_state_of_the_spring_lies_in_one_chart(spring_atlas, delta, x):
    """States by (δ, x_l); those within 1e-3 of a fold or of the cut are left aside."""
    force = (1.0 - x / np.cos(delta)) * np.sin(delta)
    on_cut = x > 0.99 and abs(force) < 0.03
    if abs(force) > 0.499 or abs(x - np.cos(delta) ** 3) < 1e-3 or on_cut:
        return
    structure = spring_atlas.eset.structure
    states = em.States(structure, np.array([[delta]]), np.array([[x, force, 1.0]]))
    with unchecked():
        inside = [chart.contains(states)[0] for chart in spring_atlas.charts]
        number, coords = spring_atlas.locate(states)
    assert sum(inside) == 1
    assert inside[number[0]]
    assert coords[0] == pytest.approx([x, force])
    chart = spring_atlas.charts[number[0]]
    with unchecked():
        found = chart.state(coords)
    assert found.states.z[0, 0] == pytest.approx(delta, abs=1e-9)
    np.testing.assert_allclose(chart.coords(found.states), coords, rtol=0, atol=1e-10)


def test_a_path_leads_around_the_cusp_from_chart_to_chart(spring_atlas):
    """From δ > 0 to δ < 0 at x_l = 0.5: both stable charts if only they are there."""
    stable = em.dissect(part(spring_atlas.eset, spring_atlas.eset.cell_index == 0))
    here = spring_atlas.eset.at(x_l=0.5, F=0.0)
    up, down = max(here.stable, key=lambda s: s.z[0]), min(here.stable, key=lambda s: s.z[0])
    path = stable.path(up, down)
    assert [chart for chart, _, _ in path.legs] in ([0, 1], [1, 0])
    assert path.coords[:, 0].max() > 1.0
    assert (path.states.index == 0).all()
    assert path.states.residual.max() < 1e-10
    # neighbours are in one cell, of a coarse grid here
    assert np.abs(np.diff(path.states.z[:, 0])).max() < 0.4
    for chart, coords, states in path.legs:
        np.testing.assert_array_equal(coords, stable.charts[chart].coords(states))
    # through the fold it is shorter
    short = spring_atlas.path(up, down)
    assert len(short.legs) == 3
    assert short.legs[1][0] == 2


def test_a_path_between_pieces_is_refused(spring_set):
    short = part(spring_set, (spring_set.cell_index == 0) & _left(spring_set))
    atlas = em.dissect(short)
    here = spring_set.at(x_l=0.5, F=0.0).stable
    with pytest.raises(InputError, match="`goal` must be joined to `start`"):
        atlas.path(here[0], here[1])


def _left(eset):
    return (eset.coordinates[eset.cells][:, :, 0] < 0.95).all(axis=1)


def test_charts_of_the_arch_cover_its_bistable_region_twice(arch_set, arch_atlas):
    """Upper and lower in the bistable region; areas add up to that of the set."""
    assert len(arch_atlas) == 2
    assert all(chart.single_valued for chart in arch_atlas.charts)
    stable = arch_set.cells[arch_set.cell_index == 0]
    areas = count_regions(arch_set.coordinates, stable).areas()
    whole = sum(count * area for count, area in areas.items())
    assert sum(chart.domain.size for chart in arch_atlas.charts) == pytest.approx(whole, rel=2e-3)
    rise = arch_set.structure.height(0.5)
    at = np.array([[1.0, 0.0]])
    heights = [rise(chart.state(at).states)[0] for chart in arch_atlas.charts]
    assert sorted(heights) == pytest.approx([-0.1496, 0.2258], abs=1e-4)


def test_the_cut_of_the_arch_runs_from_cusp_to_cusp(arch_atlas):
    (cut,) = arch_atlas.transitions
    ends = cut.coords[0][[0, -1]]
    ends = ends[np.argsort(ends[:, 1])]
    assert ends == pytest.approx(
        np.array([[1.12327601, -0.58931659], [1.12327601, 0.58931659]]), abs=1e-7
    )
    assert cut.states.residual.max() < 1e-10


def test_lifts_across_the_cut_go_from_chart_to_chart(arch_atlas):
    """A step of 0.02 across, both ways, at places along the cut."""
    (cut,) = arch_atlas.transitions
    line = cut.coords[0]
    middle = 0.5 * (line[1:] + line[:-1])[2:-2:4]
    along = (line[1:] - line[:-1])[2:-2:4]
    normal = np.stack([-along[:, 1], along[:, 0]], axis=1)
    normal *= 0.01 / np.linalg.norm(normal, axis=1, keepdims=True)
    for one, other in ((middle - normal, middle + normal), (middle + normal, middle - normal)):
        with unchecked():
            first, second = (
                [chart.state(at) for chart in arch_atlas.charts] for at in (one, other)
            )
        for k in range(len(middle)):
            # on each side the state of the cut's sheet belongs to one chart
            for number, chart in enumerate(first):
                if not chart.inside[k]:
                    continue
                goal = dict(zip(("Theta", "Delta"), other[k].tolist(), strict=True))
                end = em.lift(chart.states[k], to=goal).end
                if end.kind != "arrived":
                    continue
                there = second[1 - number]
                stayed = second[number]
                gaps = [
                    np.abs(each.states.z[k] - end.state.z).max() if each.inside[k] else np.inf
                    for each in (there, stayed)
                ]
                assert min(gaps) < 1e-8
        crossed = sum(
            a.inside[k] and not b.inside[k]
            for a, b in zip(first, second, strict=True)
            for k in range(len(middle))
        )
        assert crossed >= len(middle) - 1


def test_surfaces_are_dissected_along_their_folds():
    """Sphere: two caps. Cusp: one cut. One parameter: strata."""
    ball = em.dissect(lifted(sphere(), em.Box(a=(-1.3, 1.2), b=(-1.5, 1.5)), (7, 8)))
    assert [chart.index for chart in ball.charts] in ([0, 1], [1, 0])
    assert all(chart.single_valued for chart in ball.charts)
    with unchecked():
        folded = em.dissect(lifted(cusp(), em.Box(a=(-2, 1), b=(-3, 3)), (9, 10)))
    assert len(folded) == 3
    assert all(chart.single_valued for chart in folded.charts)
    curve = em.dissect(lifted(fold_form(), em.Box(a=(-1, 1)), (7,)))
    assert len(curve) == 2
    assert [len(each.states) for each in curve.transitions] == [1]


@pytest.mark.parametrize("seed", [0, 3, 22, 32, 34, 38, 42, 75])
def test_cuts_begin_at_the_cusp_wherever_the_grid_lies(seed):
    """Closed form: x³ + a x + b has its cusp at a = b = 0. In some boxes a vertex lies there."""
    draw = np.random.default_rng(seed)
    half, *ends = draw.uniform([0.3, -2.5, 0.2], [3.0, -0.3, 1.5])
    intervals = tuple(draw.integers(4, 14, 2).tolist())
    box = em.Box(a=tuple(ends), b=(-half * draw.uniform(0.4, 1.0), half))
    with unchecked():
        atlas = em.dissect(lifted(cusp(), box, intervals))
    assert len(atlas) == 3
    assert all(chart.single_valued for chart in atlas.charts)
    assert sorted(each.kind for each in atlas.transitions) == ["cut", "fold", "fold"]
    for each in atlas.transitions:
        gap = np.abs(each.coords[0][[0, -1]]).max(axis=1)
        assert gap.min() < 1e-9
    place = atlas.eset.coordinates[atlas.eset.cells]
    areas = np.abs(np.linalg.det(np.diff(place, axis=1)))
    assert areas.min() > 1e-9 * np.median(areas)


@pytest.mark.slow
def test_bodies_are_dissected_along_their_folds():
    """Swallowtail: charts that do not overlap."""
    box = em.Box(a=(-1.5, 0.5), b=(-1, 1), c=(-1, 1))
    with unchecked():
        body = em.dissect(lifted(swallowtail(), box, (3, 3, 3)))
        for chart in body.charts:
            cells = Cells(body.eset, coordinates_of(body.eset, ("a", "b", "c")), chart.numbers)
            assert len(overlapping(cells, np.zeros(0, int))) == 0


def test_empty_sets_are_not_dissected(spring_set):
    with pytest.raises(InputError, match="`eset` must have cells; got an empty set"):
        em.dissect(part(spring_set, spring_set.cell_index == 5))
