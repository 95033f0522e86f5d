"""The two structures of the article, drawn with their symbols: the spring and the curved rod."""

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes

import equimorph as em

SPRING, ROD = {"x_l": 0.8, "F": 0.02}, {"Theta": 0.9, "Delta": 0.15}
"""Settings of the structures that are drawn; the rod under the left-half load."""
THIN: dict[str, Any] = {"color": "#1a1a1a", "linewidth": 0.6}
DASHED = THIN | {"linestyle": (0, (5, 3)), "zorder": 0.5}
COIL = 0.035 * np.array([0.0, 0.0, *np.tile([1.0, -1.0], 7), 0.0, 0.0])
"""Distances of the corners of the coil from its axis."""


def models(folder: Path) -> dict[str, float]:
    """Draw both structures; there is nothing to compute."""
    em.plotting.save(spring_model(), folder, "spring-model")
    em.plotting.save(rod_model(), folder, "rod-model")
    return {}


def spring_model() -> Axes:
    """Draw the spring from its actuator A to the loaded roller B."""
    state = max(em.find_equilibria(em.Spring(), SPRING).stable, key=lambda each: each.z[0])
    ax = em.plotting.portraits(state.batch, [" "])
    ax.lines[-1].set_visible(False)
    (a, b), angle = state.shape(), float(state.z[0])
    along = (b - a) / np.linalg.norm(b - a)
    across, side = np.array([along[1], -along[0]]), np.sign(b[0] - a[0])
    shares = np.array([0.0, *np.linspace(0.25, 0.75, len(COIL) - 2), 1.0])
    coil = a + shares[:, None] * (b - a) + COIL[:, None] * across
    ax.plot(*coil.T, color="#1f5f99", linewidth=1.4, zorder=3)
    ax.plot([0.0, 0.0, a[0]], [1.35 * b[1], 0.0, 0.0], **DASHED)
    mark_angle(ax, a, side, angle, 0.18, "δ")
    measure(ax, a[0], -0.14, "$x_l$")
    middle = 0.5 * (a + b) + 0.08 * across * np.sign(across[1])
    for text, place, right, up in (
        ("A", a, -0.05, 0.05), ("B", b, -0.04, 0.05), ("$F$", b, 0.03, 0.12), ("$k$", middle, 0, 0)
    ):  # fmt: skip
        ax.text(place[0] + right * side, place[1] + up, text, ha="center", va="center", size=8)
    ax.set(ylim=(-0.22, 1.4 * b[1]))
    ax.set_axis_off()
    return ax


def rod_model() -> Axes:
    """Draw the rod between its rotary actuators under a load that covers half of it."""
    path = em.lift(em.Rod("left-half").natural_state(**ROD), {"q": 1.0})
    ax, shape = em.plotting.portraits(path.states[-1:], [" "]), path.end.state.shape()
    for name, place, side in (("A", shape[0], 1.0), ("B", shape[-1], -1.0)):
        angle = ROD["Theta"] + side * ROD["Delta"]
        ax.plot([place[0], place[0] + 0.24 * side], [0.0, 0.0], **DASHED)
        mark_angle(ax, place, side, angle, 0.13, f"$\\theta_{name}$")
        ax.text(place[0] - 0.09 * side, 0.0, name, ha="center", va="center", size=8)
    measure(ax, shape[-1, 0], -0.1, "$ν L$")
    for at, gap, text in ((0.2, np.array([-0.12, 0.12]), "$q\\,Q(s)$"), (0.75, 0.03, "$s$")):
        x, y = shape[int(at * len(shape))] + gap
        ax.text(x, y, text, ha="center", va="center", size=8)
    ax.set(ylim=(-0.17, ax.get_ylim()[1]))
    ax.set_axis_off()
    return ax


def mark_angle(ax: Axes, place: Any, side: float, angle: float, radius: float, text: str) -> None:
    """Draw the arc of an angle above the horizontal, with its symbol."""
    turn = np.linspace(0.0, angle, 30)
    ax.plot(place[0] + radius * side * np.cos(turn), place[1] + radius * np.sin(turn), **THIN)
    x, y = 1.3 * radius * np.cos(angle / 2), 1.3 * radius * np.sin(angle / 2)
    ax.text(place[0] + side * x, place[1] + y, text, ha="center", va="center", size=8)


def measure(ax: Axes, x: float, y: float, text: str) -> None:
    """Draw a dimension line from x = 0, with its symbol below."""
    look = {"arrowstyle": "<|-|>,head_width=0.12,head_length=0.3", "shrinkA": 0, "shrinkB": 0}
    ax.annotate("", (x, y), (0.0, y), arrowprops={**look, **THIN})
    ax.text(0.5 * x, y - 0.04, text, ha="center", va="center", size=8)
