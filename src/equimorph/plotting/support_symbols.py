"""Symbols of supports: outlines in units of their size, x along the support's direction."""

from dataclasses import dataclass

import numpy as np

from equimorph.arrays import Float
from equimorph.model import SupportKind

Outline = Float[np.ndarray, "points 2"]


@dataclass(frozen=True, eq=False)
class Stroke:
    """A filled area, or a line; zorder: above which things it lies."""

    outline: Outline
    filled: bool = False
    edge: float = 0.8
    zorder: float = 1.5


def _line(*points: tuple[float, float], width: float = 0.8, zorder: float = 1.5) -> Stroke:
    return Stroke(np.array(points), edge=width, zorder=zorder)


def _area(*points: tuple[float, float], edge: float = 0.6, zorder: float = 1.5) -> Stroke:
    return Stroke(np.array(points), filled=True, edge=edge, zorder=zorder)


def _circle(x: float, y: float, radius: float, zorder: float = 1.5) -> Stroke:
    angle = np.linspace(0.0, 2.0 * np.pi, 33)
    around = np.stack([x + radius * np.cos(angle), y + radius * np.sin(angle)], axis=1)
    return Stroke(around, filled=True, edge=0.6, zorder=zorder)


def _box(x: float, y: float, edge: float = 0.6) -> Stroke:
    return _area((-x, -y), (x, -y), (x, y), (-x, y), (-x, -y), edge=edge)


def _spiral(turns: float, inner: float, outer: float) -> Stroke:
    share = np.linspace(0.0, 1.0, 60)
    angle, radius = 2.0 * np.pi * turns * share - 0.5 * np.pi, inner + (outer - inner) * share
    return Stroke(np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=1))


_TEETH = [(1.0 + 0.4 * i, 0.7 * (-1.0) ** i) for i in range(6)]
_JOINT = _circle(0.0, 0.0, 0.4, zorder=7.0)
SYMBOLS: dict[SupportKind, tuple[Stroke, ...]] = {
    SupportKind.CLAMP: (
        _area((0.0, -2.2), (-1.3, -2.2), (-1.3, 2.2), (0.0, 2.2), edge=0.0),
        _line((0.0, -2.2), (0.0, 2.2), width=1.2),
    ),
    SupportKind.PIN: (
        _area((0.0, 0.0), (-1.2, -2.0), (1.2, -2.0), (0.0, 0.0)),
        _line((-1.9, -2.0), (1.9, -2.0)),
        _JOINT,
    ),
    SupportKind.ROLLER: (
        _area((0.0, 0.0), (-1.1, -1.6), (1.1, -1.6), (0.0, 0.0)),
        _circle(-0.65, -2.0, 0.4),
        _circle(0.65, -2.0, 0.4),
        _line((-1.9, -2.4), (1.9, -2.4)),
        _JOINT,
    ),
    SupportKind.SLEEVE: (
        _box(1.3, 0.8),
        _line((-2.8, 1.2), (2.8, 1.2)),
        _line((-2.8, -1.2), (2.8, -1.2)),
    ),
    SupportKind.GRIP: (_box(0.9, 0.9),),
    SupportKind.SPRING: (
        _line((0.0, 0.0), (0.8, 0.0), *_TEETH, (3.4, 0.0), (4.2, 0.0)),
        _line((4.2, -1.4), (4.2, 1.4)),
        _JOINT,
    ),
    SupportKind.COIL: (_spiral(2.25, 0.4, 1.7), _line((1.7, 0.0), (1.7, -1.0))),
}
"""How each kind is drawn."""

HUB: tuple[Stroke, ...] = (
    _circle(0.0, 0.0, 1.1, zorder=5.0),
    _line((-1.9, 0.0), (1.9, 0.0), width=1.2, zorder=6.0),
    _circle(0.0, 0.0, 0.2, zorder=7.0),
)
"""A clamp that turns from state to state: the hub of a rotary actuator, with a pointer."""

UPRIGHT = frozenset({SupportKind.PIN, SupportKind.COIL})
"""Kinds that stand upright on the ground for any direction of the structure."""
AWAY = frozenset({SupportKind.SPRING})
"""Kinds that reach along their direction, away from the structure."""
