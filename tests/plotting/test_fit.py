"""Figures fit at any size and with long names: nothing leaves them, tick labels stay apart."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from PIL import Image

import equimorph as em
from equimorph import plotting
from equimorph.plotting import style
from equimorph.plotting.style import label_boxes, touching, whole_figure
from fits import SIZES, check_fit
from typecheck import unchecked

LOAD = "force_that_pushes_the_crown_of_the_arch_down"
MOVE = "shortening_of_the_left_bar_by_its_actuator"


@pytest.fixture(scope="module")
def truss_set():
    """A shallow two-bar truss whose parameters have long names."""
    truss = em.Truss(
        {"A": (-1, 0), "B": (0, 0.2), "C": (1, 0)}, [("A", "B"), ("B", "C")],
        {"A": "xy", "C": "xy"}, {LOAD: {"B": (0, -1)}}, {MOVE: {"A-B": 1.0}},
    )  # fmt: skip
    box = em.Box(**{LOAD: (-2e-3, 4e-3), MOVE: (-0.01, 0.01)})
    with unchecked():
        return em.equilibrium_set(truss, box, intervals=(6, 4), checks=0)


@pytest.fixture(scope="module")
def way(truss_set):
    stable = truss_set.at(**{LOAD: 0.0, MOVE: 0.0}).stable
    up = max(stable, key=truss_set.structure.displacement("B", "y"))
    goal = em.lift(up, {LOAD: 1e-3, MOVE: 5e-3}).end.state
    return em.plan(truss_set, up, goal)


def crown(eset):
    return eset.structure.displacement("B", "y")


def branch(eset):
    """Over the load alone."""
    return em.equilibrium_set(eset.structure, em.Box(**{LOAD: (-2e-3, 4e-3)}), checks=0)


def reached(eset, route):
    """The region of the joint, and a motion in it."""
    start, move = route.path.states[0], eset.structure.displacement("B", "x")
    place = {each: each(start) + change for each, change in ((crown(eset), -0.01), (move, 2e-3))}
    return em.reachable(eset, start, list(place)), em.track(start, place, actuators=[LOAD, MOVE])


FIGURES = {
    "surface": lambda eset, _: plotting.surface(eset),
    "parameter_plane": plotting.parameter_plane,
    "solutions": lambda eset, route: plotting.solutions(eset, eset.points[:1]),
    "margins": lambda _, route: plotting.margins(route),
    "shapes": lambda _, route: plotting.shapes(route),
    "schedule_strips": lambda _, route: plotting.schedule_strips(route.schedule),
    "alternative_routes": lambda eset, route: plotting.alternative_routes(eset, [route, route]),
    "route_panels": lambda eset, route: plotting.route_panels(eset, route, crown(eset)),
    "portraits": lambda eset, _: plotting.portraits(eset.points[:2], [LOAD, MOVE]),
    "diagram": lambda eset, _: plotting.diagram(branch(eset)),
    "level_plane": lambda eset, _: plotting.level_plane(
        eset, (em.value_of(eset.structure, MOVE), crown(eset)), em.effort_of(eset.structure, MOVE),
        [0.0, 0.01]
    ),
    "chart_domain": lambda eset, _: plotting.chart_domain(
        em.reduce(eset, prefer=em.charts.lowest(eset.structure.descriptor("energy")))
    ),
    "network_changes": lambda eset, _: plotting.network_changes(
        em.network_changes(em.barriers(eset))
    ),
    "reach_panels": lambda eset, route: plotting.reach_panels(*reached(eset, route)),
}  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("name", FIGURES)
def test_figures_with_long_names_fit_at_all_sizes(name, truss_set, way):
    with style.house_style(), unchecked():
        drawn = FIGURES[name](truss_set, way)
        figure = drawn if not hasattr(drawn, "figure") else drawn.get_figure(root=True)
        width, height = figure.get_size_inches()
        for size in SIZES:
            figure.set_size_inches(size * width, size * height)
            check_fit(figure)


def test_a_legend_that_is_too_wide_is_saved_whole(tmp_path):
    with style.house_style():
        ax = style.new_axes(2.0, 1.5, (0.4, 0.4, 0.1, 0.1))
        (line,) = ax.plot([0, 1], [0.0, 1.0], label="a long name of what is drawn " * 2)
        style.legend_below(ax, [line, line], room=True)
        check_fit(ax.figure)
    (file,) = style.save(ax, tmp_path, "wide", ["png"])
    with Image.open(file) as picture:
        assert picture.width > 2.0 * style.RESOLUTION


def test_a_figure_that_fits_keeps_its_size(tmp_path):
    with style.house_style():
        ax = style.new_axes(3.0, 2.0, (0.5, 0.5, 0.2, 0.2))
        ax.plot([0, 1], [0, 1])
    (file,) = style.save(ax, tmp_path, "plain", ["png"])
    with Image.open(file) as picture:
        assert picture.size == (3 * style.RESOLUTION, 2 * style.RESOLUTION)


@pytest.mark.parametrize("width", [0.5, 0.8, 1.5])
def test_tick_labels_are_thinned_out_until_they_stand_apart(width):
    with style.house_style():
        ax = style.new_axes(0.3 + width, 1.0, (0.2, 0.4, 0.1, 0.1))
        ax.plot(np.array([1234567.0, 1234567.9]), [0, 1])
        ax.ticklabel_format(useOffset=False)
        whole_figure(ax.figure)
    assert not touching(ax.xaxis)
    assert len(label_boxes(ax.xaxis)) >= 1


def test_margins_show_limits_with_what_is_limited(route):
    angle = route.path.states.structure.angle
    schedule = replace(route.schedule, descriptors={"angle": angle(route.states)})
    ax = plotting.margins(replace(route, schedule=schedule), within=[angle <= 1.4, angle <= 9.0])
    lowest = ax.figure.axes[-1]
    assert [1.4, 1.4] in [list(line.get_ydata()) for line in lowest.lines]
    assert 1.4 < lowest.get_ylim()[1] < 9.0


def test_labels_of_margins_are_no_longer_than_their_panels(route):
    """They are broken into lines, also inside words, but not inside units."""
    angle = route.path.states.structure.angle
    names = ("the larger one of the couples of both motors at the ends of the strip", "m" * 60)
    long = [replace(angle, name=name, symbol=name) for name in names]
    values = {each.name: each(route.states) for each in long}
    schedule = replace(route.schedule, descriptors=values)
    ax = plotting.margins(replace(route, schedule=schedule), within=[each <= 1.4 for each in long])
    ax.figure.draw_without_rendering()
    boxes = [each.yaxis.label.get_window_extent() for each in ax.figure.axes]
    assert len(boxes) == 3
    assert all(below.y1 <= above.y0 for above, below in pairwise(boxes))
