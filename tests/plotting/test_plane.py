"""The parameter plane of the spring: regions and folds in closed form, and the route on it."""

import numpy as np
import pytest
from matplotlib.figure import Figure
from matplotlib.text import Annotation
from scipy.integrate import quad

import equimorph as em
from equimorph import plotting
from equimorph.charts.regions import count_equilibria, count_regions, empty_regions
from equimorph.errors import InputError
from equimorph.plotting.labels import label_contours
from equimorph.tasks.planning.smoothing import smoothed
from equimorph.tasks.route import Route
from typecheck import unchecked


def fold_load(x_l):
    """PHYSICS §2: F/k at the folds."""
    return np.maximum(1 - np.abs(x_l) ** (2 / 3), 0.0) ** 1.5


def texts(ax):
    return [text.get_text() for text in ax.texts]


def bar_labels(ax):
    """Counts beside the colour bar, the axes that were added last."""
    return [text.get_text() for text in ax.figure.axes[-1].get_yticklabels()]


def distance_from(line, place):
    along = np.diff(line, axis=0)
    share = np.sum((place - line[:-1]) * along, axis=1) / np.maximum(
        np.sum(along**2, axis=1), 1e-300
    )
    nearest = line[:-1] + np.clip(share, 0.0, 1.0)[:, None] * along
    return np.linalg.norm(nearest - place, axis=1).min()


def line_labelled(ax, label):
    (line,) = [line for line in ax.lines if line.get_label() == label]
    return line


def test_the_spring_has_three_equilibria_inside_the_cusp_and_one_outside(spring_set):
    """Area inside by quadrature. Chords between exact fold points, one per grid line, lose 1 %."""
    areas = count_equilibria(spring_set).areas()
    inside = quad(lambda x: 2 * min(fold_load(x), 0.3), 0.3, 1.0, points=[0.41])[0]
    assert areas[3] == pytest.approx(inside, rel=0.02)
    assert sum(areas.values()) == pytest.approx(1.1 * 0.6, rel=1e-6)
    assert areas[2] == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize("intervals", [(12, 12), (24, 24), (25, 16)])
def test_regions_of_several_equilibria_end_at_the_cusp(intervals):
    """The cusp lies at x_l = 1; cells that lie overturned next to it make no sliver beyond."""
    box = em.Box(x_l=(0.4, 1.4), F=(-0.3, 0.3))
    eset = em.equilibrium_set(em.Spring(), box, intervals=intervals, checks=0)
    for stable_only, most in ((False, 3), (True, 2)):
        regions = count_equilibria(eset, stable_only=stable_only)
        assert regions.largest == most
        ends = [loop[:, 0].max() for level in regions.levels[1:] for loop in level]
        assert max(ends) == pytest.approx(1.0, abs=1e-6)


def test_every_place_counts_as_many_equilibria_as_the_set_has_there(spring_set):
    regions = count_equilibria(spring_set)
    for x_l, force in ((0.5, 0.1), (0.7, -0.02), (0.9, 0.15), (1.2, -0.2)):
        expected = len(spring_set.at(x_l=x_l, F=force))
        assert regions.count(np.array([[x_l, force]])).tolist() == [expected]


def test_drawn_stability_boundary_is_the_closed_form(spring_set):
    """Fold vertices are exact: 1e-9 is a hundred times their residual over the smallest slope."""
    ax = plotting.parameter_plane(spring_set)
    x_l, force = line_labelled(ax, "stability boundary").get_data()
    np.testing.assert_allclose(np.abs(force), fold_load(x_l), rtol=0, atol=1e-9)


def test_counts_are_written_into_their_regions(spring_set):
    assert sorted(texts(plotting.parameter_plane(spring_set))) == ["1", "3"]
    assert sorted(texts(plotting.parameter_plane(spring_set, count="stable"))) == ["1", "2"]


@pytest.fixture(scope="module")
def capped_set():
    """|δ| ≤ 0.9 leaves no state over part of the box: F = (1 − x_l/cos δ) sin δ at δ = ±0.9."""
    spring = em.Spring()
    within = [spring.angle <= 0.9, spring.angle >= -0.9]
    box = em.Box(x_l=(0.3, 1.4), F=(-0.6, 0.6))
    with unchecked():
        return em.equilibrium_set(spring, box, within=within, intervals=(12, 12), checks=0)


def test_where_a_set_is_cut_is_not_counted_as_zero(capped_set):
    """Beyond |δ| = 0.9 there are stable states: no 0 is written there, and it is hatched."""
    for count in ("all", "stable"):
        ax = plotting.parameter_plane(capped_set, count=count)
        assert "0" not in texts(ax)
        hatched = [patch for patch in ax.patches if patch.get_hatch()]
        assert len(hatched) >= 2
        assert {patch.get_label() for patch in hatched} == {"cut at δ = 0.9 or δ = -0.9"}
        assert any("cut at" in text.get_text() for text in ax.get_legend().get_texts())
        assert "0" not in bar_labels(ax)
        for x_l, force in ((0.4, 0.55), (0.4, -0.55), (1.38, 0.5), (0.9, 0.0)):
            known = [each.stable for each in capped_set.at(x_l=x_l, F=force)]
            empty = not (any(known) if count == "stable" else known)
            there = any(patch.get_path().contains_point((x_l, force)) for patch in hatched)
            assert there == empty


def test_the_colour_bar_has_a_zero_where_an_empty_region_is_seen(spring_set):
    """A fold beyond which nothing is: E' = x² − p − 1 has no root where p < −1."""
    fold = em.EnergyStructure(
        "x**3/3 - x - p*x + r*x/100",
        [em.Unknown("x", 1.0, guesses=(-2, 2))],
        [em.Parameter("p", "1", 1.0, "actuator", 0.0), em.Parameter("r", "1", 1.0, "load", 0.0)],
    )
    with unchecked():
        eset = em.equilibrium_set(fold, em.Box(p=(-2, 0), r=(-1, 1)), intervals=(6, 6), checks=0)
    assert bar_labels(plotting.parameter_plane(eset, count="stable")) == ["0", "1"]
    assert bar_labels(plotting.parameter_plane(spring_set, count="stable")) == ["1", "2"]


def test_parts_without_equilibria_and_covered_ones_fill_the_box(capped_set):
    regions = count_regions(capped_set.coordinates, capped_set.cells)
    lower, upper = capped_set.box.lower, capped_set.box.upper
    empty = empty_regions(regions, lower, upper)
    cells = sum(0.5 * abs((a[:-1, 0] * a[1:, 1] - a[1:, 0] * a[:-1, 1]).sum()) for (a, *_) in empty)
    assert cells + sum(regions.areas().values()) == pytest.approx(np.prod(upper - lower), rel=1e-9)


def test_a_region_without_equilibria_inside_others_is_a_part_with_no_hole():
    """An annulus of triangles: the square inside is empty, and so is the frame around it."""
    angle = np.linspace(0.0, 2.0 * np.pi, 9)[:-1]
    ring = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    places, k = np.concatenate([0.4 * ring, 0.8 * ring]), np.arange(8)
    cells = np.concatenate(
        [np.stack([k, k + 8, (k + 1) % 8], 1), np.stack([k + 8, 8 + (k + 1) % 8, (k + 1) % 8], 1)]
    )
    parts = empty_regions(count_regions(places, cells), np.array([-1.0, -1]), np.array([1.0, 1]))
    assert sorted(len(loops) for loops in parts) == [1, 2]


def test_axes_carry_symbols_units_and_the_box(spring_set):
    ax = plotting.parameter_plane(spring_set)
    assert ax.get_xlabel() == "$x_l$ (natural length)"
    assert ax.get_xlim() == (0.3, 1.4)
    assert ax.get_ylim() == (-0.3, 0.3)


def test_way_points_are_numbered_and_those_at_one_place_share_a_badge(spring_set, route):
    ax = plotting.parameter_plane(spring_set, route)
    assert {"1, 6", "2", "3", "4", "5"} <= set(texts(ax))


def test_a_refused_route_ends_in_a_cross_at_the_fold(spring_set, refused):
    ax = plotting.parameter_plane(spring_set, refused)
    line = line_labelled(ax, "route, refused (× fold)")
    (cross,) = [each for each in ax.lines if each.get_marker() == "x"]
    x_l, force = (float(values[0]) for values in cross.get_data())
    assert x_l == pytest.approx(0.8, abs=1e-12)
    assert force == pytest.approx(fold_load(0.8), abs=1e-9)
    assert line.get_xdata()[-1] == x_l


def test_a_route_without_path_is_left_out(spring_set):
    nothing = Route("refused", "the goal is unstable", [])
    ax = plotting.parameter_plane(spring_set, nothing)
    assert not [line for line in ax.lines if str(line.get_label()).startswith("route")]


def test_drawing_into_given_axes_makes_no_other_figure(spring_set):
    ax = Figure().add_subplot()
    assert plotting.parameter_plane(spring_set, ax=ax) is ax


def test_an_unknown_count_is_named(spring_set):
    with pytest.raises(InputError, match='`count` must be "all" or "stable"; got \'some\''):
        plotting.parameter_plane(spring_set, count="some")


def test_arrow_heads_lie_on_the_drawn_line_where_corners_are_rounded(spring_set, route):
    """They would lie beside it on the chords between way-points."""
    ax = plotting.parameter_plane(spring_set, smoothed(route, 0.05))
    heads = [each for each in ax.texts if isinstance(each, Annotation) and each.arrow_patch]
    line = np.column_stack(line_labelled(ax, "route").get_data())
    places = np.array([head.xy for head in heads if not head.get_text()])
    assert len(places) == 2
    assert max(distance_from(line, place) for place in places) < 1e-9


def test_labels_of_one_level_keep_apart():
    """A straight level across the frame has room for two labels, a short one for one."""
    x, y = np.meshgrid(np.linspace(0.0, 1.0, 41), np.linspace(0.0, 1.0, 41))
    for width, count in ((1.0, 2), (0.4, 1)):
        ax = Figure().add_subplot()
        ax.set(xlim=(0.0, 1.0), ylim=(0.0, 1.0))
        lines = ax.contour(width * x, y, y, levels=[0.5])
        label_contours(ax, lines, np.empty((0, 2)))
        assert [text.get_text() for text in ax.texts] == count * ["0.5"]
