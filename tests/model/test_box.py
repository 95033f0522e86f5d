"""Boxes and grids: what they hold, and what they refuse."""

import re

import numpy as np
import pytest

from equimorph.errors import InputError
from equimorph.model import Box, Grid
from typecheck import unchecked


@pytest.mark.parametrize(
    "bounds",
    [
        (1.0, 1.0), (2.0, 1.0), (0.0, np.inf), (np.nan, 1.0), (0.0, 1.0, 5), (0.0, "wide"), 1.0,
        ("0", "1"), (True, 2.0), (False, True), None, "01", {0: 1},
    ],
)  # fmt: skip
def test_bounds_that_span_nothing_are_refused(bounds):
    said = f"`a` must be two finite numbers (lower, upper), lower < upper; got {bounds!r}."
    with unchecked(), pytest.raises(InputError, match=f"^{re.escape(said)}$"):
        Box(a=bounds)


def test_a_box_has_at_least_one_side():
    with pytest.raises(InputError, match=r"^`Box` must name at least one parameter; got none\.$"):
        Box()


@pytest.mark.parametrize(
    "sides",
    [
        (0.0, 1.0, 0), (0.0, 1.0, 2.5), (1.0, 1.0, 3), (0.0, 1.0), (0.0, 1.0, True), (True, 2.0, 3),
        (0.0, 1.0, np.inf), (0.0, 1.0, np.nan),
    ],
)  # fmt: skip
def test_grids_without_whole_intervals_are_refused(sides):
    said = (
        "`a` must be (lower, upper, intervals): finite lower < upper and a whole number of "
        f"intervals >= 1; got {sides!r}."
    )
    with unchecked(), pytest.raises(InputError, match=f"^{re.escape(said)}$"):
        Grid(a=sides)


def test_a_grid_has_at_least_one_parameter():
    with pytest.raises(InputError, match=r"^`Grid` must name at least one parameter; got none\.$"):
        Grid()


def test_single_precision_bounds_are_numbers():
    """Their magnitude is compared as a number of double precision, without an overflow warning."""
    with unchecked():
        box = Box(a=np.array([0.0, 3.0], dtype=np.float32))
    assert repr(box) == "Box(a=(0, 3))"


def test_a_box_contains_its_sides_and_what_slack_adds():
    """Slack counts in widths of each side: 0.1 of 2 and of 4."""
    box = Box(a=(0, 2), b=(-2, 2))
    points = np.array([[0.0, -2.0], [2.0, 2.0], [2.19, 2.39], [2.21, 0.0], [1.0, -2.41]])
    assert box.contains(points).tolist() == [True, True, False, False, False]
    assert box.contains(points, slack=0.1).tolist() == [True, True, True, False, False]
    assert bool(box.contains(points[0]))


def test_boxes_and_grids_say_what_they_are():
    grid = Grid(b=(-2, 2, 4), a=(0, 0.5, 1))
    assert repr(grid) == "Grid(b=(-2, 2, 4), a=(0, 0.5, 1))"
    assert repr(grid.box) == "Box(b=(-2, 2), a=(0, 0.5))"
    assert (grid.names, grid.intervals) == (("b", "a"), (4, 1))
    b, a = grid.axes()
    assert b.tolist() == [-2.0, -1.0, 0.0, 1.0, 2.0]
    assert a.tolist() == [0.0, 0.5]


def test_a_grid_goes_through_equidistant_values():
    grid = Grid.of_values(Theta=np.linspace(0.2, 2.5, 24), Delta=[-1.0, 0.0, 1.0])
    assert repr(grid) == "Grid(Theta=(0.2, 2.5, 23), Delta=(-1, 1, 2))"
    np.testing.assert_allclose(grid.axes()[0], np.linspace(0.2, 2.5, 24), rtol=1e-15)


@pytest.mark.parametrize("values", [[1.0], [0.0, 1.0, 3.0], [1.0, 0.0], [0.0, 0.0]])
def test_other_values_make_no_grid(values):
    with pytest.raises(InputError, match=r"`Theta` must be"):
        Grid.of_values(Theta=values)
