"""Figures of what is best: landscapes, moving optima, strongest settings, schedules in strips."""

import numpy as np
import pytest
from matplotlib.collections import LineCollection

import equimorph as em
from equimorph import plotting
from equimorph.errors import InputError
from equimorph.model import Schedule
from equimorph.tasks.optimising.landscapes import Barriers
from equimorph.tasks.optimising.optimum_path import Jump
from typecheck import unchecked


def valley(spring) -> em.Landscape:
    """Values over 4 × 3 settings, two of them in a gap, with a straight barrier of each kind."""
    grid = em.Grid(x_l=(0.5, 0.8, 3), F=(-0.1, 0.1, 2))
    x, y = grid.axes()
    value = np.add.outer(x, y)
    gaps = np.zeros((4, 3), bool)
    gaps[3, :2] = True
    ends = [[[a, 0.0], [a, 0.1]] for a in x[:3]] + [[[x[0], -0.1], [x[1], -0.1]]]
    kinds = ("stability",) * 3 + ("preference",)
    barriers = Barriers(np.array(ends), np.zeros((4, 2)), kinds)
    states = em.States(spring, np.zeros((10, 1)), np.zeros((10, 3)))
    return em.Landscape(grid, np.where(gaps, np.nan, value), states, gaps, barriers)


@pytest.fixture(scope="module")
def spring():
    return em.Spring()


def test_barriers_of_a_landscape_are_joined_between_the_cells(spring, tmp_path):
    """Three neighbouring edges over F = 0.05 make one line, half a cell longer at both ends."""
    ax = plotting.landscape(spring, valley(spring), spring.descriptor("energy"))
    lines = [each for each in ax.collections if isinstance(each, LineCollection)]
    (whole,) = lines[0].get_segments()
    np.testing.assert_allclose(whole[:, 1], 0.05)
    np.testing.assert_allclose(sorted(whole[[0, -1], 0]), [0.45, 0.75])
    words = {text.get_text() for text in ax.get_legend().get_texts()}
    assert words == {"barrier: stability", "barrier: preference", "no stable state"}
    assert all(file.exists() for file in plotting.save(ax, tmp_path, "valley"))


def test_strips_show_what_moves_and_nothing_else():
    steps = np.linspace(0.0, 1.0, 5)
    values = np.stack([steps, 0.0 * steps, -2.0 * steps, 1.0 + steps], axis=1)
    ends = np.array([0, 4])
    schedule = Schedule(
        ("a", "b", "c", "P"), ("actuator",) * 3 + ("load",), ("rad", "rad", "m", "N"),
        values, steps, steps, {}, {}, ends,
    )  # fmt: skip
    figure = plotting.schedule_strips(schedule)
    names = [text.get_text() for ax in figure.axes for text in ax.texts]
    assert sorted(names) == ["P", "a", "c"]
    ticks = [text.get_text() for ax in figure.axes for text in ax.get_yticklabels()]
    assert {"1 (rad)", "0 (m)", "2 (N)"} <= set(ticks)
    with pytest.raises(InputError, match="must move a parameter"):
        plotting.schedule_strips(
            Schedule(
                ("b",), ("load",), ("N",), values[:, 1:2], steps, steps, {}, {}, np.array([0, 4])
            )
        )


def test_the_strips_that_move_most_are_kept():
    """Of 26 parameters that move by 0.001, 0.002, … the two that move least are left out."""
    steps, count = np.linspace(0.0, 1.0, 5), 26
    names = tuple(f"p{k}" for k in range(count))
    schedule = Schedule(
        names, ("actuator",) * count, ("rad",) * count,
        0.001 * steps[:, None] * np.arange(1.0, count + 1.0), steps, steps, {}, {},
        np.array([0, 4]),
    )  # fmt: skip
    figure = plotting.schedule_strips(schedule)
    words = [text.get_text().strip("$") for ax in figure.axes for text in ax.texts]
    shown = [word.replace("_{", "").replace("}", "").replace("_", "") for word in words]
    assert sorted(set(names) - set(shown)) == ["p0", "p1"]


def test_a_jump_of_an_optimum_breaks_its_line(spring):
    z, p = np.array([[0.5], [0.6], [0.9]]), np.tile([0.8, 0.0, 1.0], (3, 1))
    p[:, 0] = [0.8, 0.7, 0.9]
    states = em.States(spring, z, p)
    jump = Jump(0.5, states[1], states[2], (2.0, 1.0))
    found = em.FollowedOptimum(
        status="arrived", why="", states=states, at=np.array([0.0, 0.5, 0.5]),
        values=np.array([1.0, 2.0, 1.0]), certificates=(), jumps=(jump,),
    )  # fmt: skip
    ax = plotting.followed(found, spring.descriptor("energy"), ["x_l"])
    assert np.isnan(ax.lines[0].get_ydata()).sum() == 1
    np.testing.assert_array_equal(ax.lines[2].get_ydata(), [2.0, 1.0])


def test_strongest_settings_are_marked_on_their_map(spring):
    """F_lim = k (1 − x_l^⅔)^(3/2) is largest at the corner (0.7, 1.2) of the map."""
    with unchecked():
        lmap = em.limit_load_map(spring, em.Grid(x_l=(0.7, 0.9, 3), k=(0.8, 1.2, 3)), "F")
        sure, robust = em.strongest(lmap), em.strongest(lmap, offsets={"x_l": 0.02})
    ax = plotting.strongest_settings(lmap, sure, robust)
    marks = [line.get_xydata() for line in ax.lines if line.get_marker() == "o"]
    np.testing.assert_allclose(marks[0][0], [0.7, 1.2], atol=1e-6)
    beside = plotting.beside_strongest(lmap, [sure.best, robust.best])
    assert beside.get_xscale() == "log"
    assert len(beside.get_legend().get_texts()) == 4
