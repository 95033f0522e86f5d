"""Charts of sets whose sheets cross: pitchforks and transcriticals in closed form."""

import matplotlib.pyplot as plt
import numpy as np
import pytest

import equimorph as em
from equimorph import charts, plotting
from equimorph.charts.preparation import cut_along_crossings
from equimorph.manifold import EquilibriumSet, equilibrium_set, part, refine
from equimorph.model import Box, Descriptor
from oracles.surfaces import pitchforks, transcriticals, tricritical
from typecheck import unchecked

BOX = Box(a=(-1.0, 1.1), b=(-1.0, 1.2))
BELOW, ABOVE = 2.2 * (1.0 - 0.3 * 0.1), 2.2 * (1.1 + 0.3 * 0.1)
"""Areas of the box where a + 0.3·b is negative, and positive."""
X = Descriptor("x", "1", lambda z, p: z[:, 0].copy())


def lifted(structure, accuracy: float = 0.02) -> EquilibriumSet:
    with unchecked():  # shapes are checked on small sets elsewhere
        return refine(equilibrium_set(structure, BOX, checks=0, intervals=(4, 5)), accuracy)


@pytest.fixture(scope="module")
def pitchfork():
    """x (x² − a − 0.3·b) = 0."""
    return lifted(pitchforks(1.0, 0.3))


@pytest.fixture(scope="module")
def coarse_pitchfork():
    """The same set as it was lifted."""
    with unchecked():
        return equilibrium_set(pitchforks(1.0, 0.3), BOX, checks=0, intervals=(2, 3))


@pytest.fixture(scope="module")
def atlas(pitchfork):
    with unchecked():
        return em.dissect(pitchfork)


def test_charts_end_where_sheets_cross(atlas):
    """Both halves of the cylinder and the plane behind the crossing have one area."""
    sizes = [(chart.index, chart.domain.size) for chart in atlas.charts]
    assert all(chart.single_valued for chart in atlas.charts)
    known = [(0, BELOW), (0, ABOVE), (0, ABOVE), (1, ABOVE)]
    for (index, size), (own, area) in zip(sorted(sizes), known, strict=True):
        assert index == own
        assert size == pytest.approx(area, rel=1e-6)
    for chart in atlas.charts:
        assert {edge.kind for edge in chart.domain.edges} == {"box", "crossing"}


def test_every_pair_of_charts_meets_along_the_crossing(atlas):
    assert [each.kind for each in atlas.transitions] == 6 * ["crossing"]
    for transition in atlas.transitions:
        np.testing.assert_allclose(transition.states.z, 0.0, atol=1e-9)
        a, b = transition.coords[0].T
        np.testing.assert_allclose(a + 0.3 * b, 0.0, atol=1e-12)
        assert sorted(b[[0, -1]]) == pytest.approx([-1.0, 1.2])
        first, second = transition.charts
        at = transition.coords[0][:-1]
        np.testing.assert_allclose(transition.cross(at, first), at, atol=1e-12)
        assert first != second


def test_states_have_their_charts_and_points_their_states(atlas):
    points = np.random.default_rng(4).uniform(BOX.lower, BOX.upper, (40, 2))
    u = points @ [1.0, 0.3]
    points, u = points[np.abs(u) > 1e-3], u[np.abs(u) > 1e-3]
    seen = np.zeros(len(points), int)
    for chart in atlas.charts:
        with unchecked():
            known = chart.state(points)
        inside = known.inside
        seen += inside
        x = known.states.z[inside, 0]
        np.testing.assert_allclose(x * (x**2 - u[inside]), 0.0, atol=1e-12)
    assert np.array_equal(seen, np.where(u > 0.0, 3, 1))


def test_preferred_sheet_goes_on_through_the_crossing(coarse_pitchfork):
    """The lowest x is −√u for u = a + 0.3·b > 0 and 0 before: continuous, without a barrier."""
    with unchecked():
        reduction = em.reduce(coarse_pitchfork, prefer=charts.lowest(X))
        assert reduction.barriers == ()
        assert reduction.domain.size == pytest.approx(2.1 * 2.2, rel=1e-6)
        points = np.random.default_rng(5).uniform(BOX.lower, BOX.upper, (30, 2))
        x = reduction.state(points).states.z[:, 0]
    u = points @ [1.0, 0.3]
    np.testing.assert_allclose(x, -np.sqrt(np.maximum(u, 0.0)), atol=1e-9)


def test_mirror_images_of_equal_energy_are_told_apart_everywhere_alike(coarse_pitchfork):
    """Their energies differ by round-off, which must not draw barriers."""
    with unchecked():
        reduction = em.reduce(coarse_pitchfork, prefer=lambda states: states.energy)
    assert reduction.barriers == ()
    assert reduction.domain.size == pytest.approx(2.1 * 2.2, rel=1e-6)


def test_subcritical_pitchfork_leaves_a_gap_beyond_its_crossing():
    with unchecked():
        eset = lifted(pitchforks(-1.0, 0.3))
        reduction = em.reduce(eset, prefer=charts.lowest(X))
        stable = em.dissect(part(eset, eset.cell_index == 0))
    assert len(reduction.gaps.loops) == 1
    assert reduction.domain.size == pytest.approx(BELOW, rel=1e-6)
    assert len(stable) == 1
    assert "crossing" in {edge.kind for edge in reduction.domain.edges}


def test_path_of_an_atlas_leads_from_one_side_branch_to_the_other(atlas):
    """Both meet at the crossing, and nowhere else."""
    structure = atlas.eset.structure
    root = float(np.sqrt(0.5))
    start, goal = (structure.state(x, a=0.5, b=0.0) for x in (-root, root))
    with unchecked():
        way = atlas.path(start, goal)
    x, u = way.states.z[:, 0], way.states.p @ [1.0, 0.3]
    np.testing.assert_allclose(x * (x**2 - u), 0.0, atol=1e-9)
    assert np.abs(u).min() < 1e-12
    assert way.states.z[[0, -1], 0] == pytest.approx([-root, root])


def test_planes_that_exchange_their_stability():
    with unchecked():
        atlas = em.dissect(lifted(transcriticals(0.6, 0.3)))
    assert sorted(chart.index for chart in atlas.charts) == [0, 0, 1, 1]
    sizes = sorted(chart.domain.size for chart in atlas.charts)
    assert sizes == pytest.approx([BELOW, BELOW, ABOVE, ABOVE], rel=1e-6)


def test_folds_and_crossings_both_part_charts():
    """x (x⁴ + b x² − a): folds a = −b²/4, b < 0, of length ∫ over the box: area 1/12 each."""
    with unchecked():
        eset = lifted(tricritical(1.0), 0.005)
        atlas = em.dissect(eset)
    kinds = [each.kind for each in atlas.transitions]
    assert (len(atlas), kinds.count("fold")) == (6, 2)
    narrow = sorted(chart.domain.size for chart in atlas.charts)[:2]
    assert narrow == pytest.approx([1.0 / 12.0] * 2, rel=0.02)


def test_descriptors_tell_sheets_apart_off_the_plane(pitchfork):
    """(x, b): on the cylinder all states differ; the whole plane x = 0 is one line."""
    with unchecked():
        cylinder = part(
            pitchfork, np.abs(pitchfork.points.z[pitchfork.cells, 0]).max(axis=1) > 1e-9
        )
        chart = charts.DescriptorChart(cylinder, (X, "b"))
        assert chart.single_valued
        states = chart.state(np.array([[0.5, 0.2], [-0.7, 0.4]])).states
    np.testing.assert_allclose(states["a"], [0.25 - 0.06, 0.49 - 0.12], atol=1e-9)


def test_cut_sets_keep_their_cells_and_states(pitchfork):
    apart = cut_along_crossings(pitchfork)
    assert len(apart.cells) == len(pitchfork.cells)
    assert np.array_equal(apart.points.z[apart.cells], pitchfork.points.z[pitchfork.cells])
    assert apart.crossings == ()
    along = len(pitchfork.crossings[0])
    assert len(apart.points) == len(pitchfork.points) + 3 * along


def test_branch_points_have_a_look_of_their_own_in_figures(atlas):
    with unchecked():
        ax = plotting.chart_domain(atlas.charts[0])
    drawn = {line.get_linestyle() for line in ax.get_lines()}
    assert len(drawn) >= 2
    plt.close(ax.figure)


def test_states_that_are_not_resolved_are_named(pitchfork, monkeypatch):
    """Of x (x² − a − 0.3·b) = 0 the states with x > 0.4 count as not resolved.

    On the cylinder (x, b) leads to one state, and (x², b) to two. Such states were dropped in
    silence: the chart had a "gap" there, and there seemed to be one solution fewer.
    """
    monkeypatch.setattr(type(pitchfork.structure), "resolved", lambda self, z, p: z[:, 0] <= 0.4)
    with unchecked():
        cylinder = part(
            pitchfork, np.abs(pitchfork.points.z[pitchfork.cells, 0]).max(axis=1) > 1e-9
        )
        chart = charts.DescriptorChart(cylinder, (X, "b"))
        found = chart.state(np.array([[0.5, 0.2], [-0.7, 0.4]]))
        beyond = em.solve_shape(cylinder, {X: 0.5, em.value_of(chart.eset.structure, "b"): 0.2})
        square = Descriptor("x²", "1", lambda z, p: z[:, 0] ** 2)
        both = em.solve_shape(cylinder, {square: 0.25, em.value_of(cylinder.structure, "b"): 0.2})
    assert found.status.tolist() == ["not resolved", "inside"]
    assert np.isnan(found.states.z[0, 0])
    assert (beyond.status, beyond.unresolved) == ("refused", 1)
    assert beyond.why.endswith("; 1 left out that the discretisation does not resolve")
    np.testing.assert_allclose(both.states.z[:, 0], [-0.5], atol=1e-9)
    assert both.unresolved == 1
    assert "1 left out" in repr(both)
