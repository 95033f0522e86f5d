"""Figures of charts: what is drawn is what the charts say."""

import numpy as np
import pytest

import equimorph as em
import sets
from equimorph.errors import InputError
from equimorph.plotting import chart_domain, parameterisation
from equimorph.plotting.charts import rows_of
from oracles.charted import lifted
from oracles.polynomial import fold_form
from typecheck import unchecked


@pytest.fixture(scope="module")
def spring_set():
    return sets.spring_set()


def test_barriers_are_thick_and_gaps_hatched(spring_set):
    with unchecked():
        tie = em.reduce(
            spring_set, prefer=em.charts.lowest(spring_set.structure.descriptor("energy"))
        )
        loaded = em.reduce(spring_set, prefer=em.quasi_static("F"))
    widths = [line.get_linewidth() for line in chart_domain(tie).lines]
    assert max(widths) == 2.6
    hatches = [patch.get_hatch() for patch in chart_domain(loaded).patches]
    assert "////" in hatches


def test_the_frame_leaves_the_same_share_free_on_all_sides(spring_set):
    """4 % of the box around a reduction, and of the angles that a chart by descriptors covers."""
    spring = spring_set.structure
    with unchecked():
        tie = em.reduce(spring_set, prefer=em.charts.lowest(spring.descriptor("energy")))
        angles = em.DescriptorChart(spring_set, [spring.angle, "x_l"])
    box = np.stack([spring_set.box.lower, spring_set.box.upper], axis=1)
    covered = spring.angle(spring_set.points)
    turned = np.array([[covered.min(), covered.max()], box[0]])
    for chart, places in ((tie, box), (angles, turned)):
        ax = chart_domain(chart)
        room = 0.04 * np.diff(places) * [-1.0, 1.0]
        np.testing.assert_allclose([ax.get_xlim(), ax.get_ylim()], places + room, atol=1e-9)


def test_panels_show_the_set_above_and_every_chart_below(spring_set):
    angle = spring_set.structure.angle
    with unchecked():
        failing, angles = em.Projection(spring_set), em.DescriptorChart(spring_set, [angle, "x_l"])
        figure = parameterisation([(failing, angles), em.dissect(spring_set)], angle)
    flat = [ax for ax in figure.axes if ax.name != "3d"]
    assert len(figure.axes) - len(flat) == 2
    assert len(flat) == 2 + 3
    assert "δ" in flat[1].get_xlabel()
    left, bottom = np.array([ax.get_position().bounds[:2] for ax in flat]).T
    assert (np.diff(left[:2]) > 0.0).all()
    assert (np.diff(left[2:]) > 0.0).all()
    assert bottom[:2].min() > bottom[2:].max()  # a row for each, with room for both


def test_only_charts_over_two_coordinates_are_drawn():
    curve = em.Projection(lifted(fold_form(), em.Box(a=(-1, 1)), (7,)))
    with pytest.raises(InputError, match="`chart` must have two coordinates; got 1"):
        chart_domain(curve)


@pytest.mark.parametrize(
    ("widths", "places"),
    [
        ([1, 2, 1, 3], [(0, 0), (0, 1), (0, 3), (1, 0)]),
        ([5, 1], [(0, 0), (1, 0)]),
        ([1], [(0, 0)]),
    ],
)
def test_panels_fill_rows_of_four_columns(widths, places):
    assert rows_of(widths) == places
