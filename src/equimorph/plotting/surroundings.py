"""Shapes with their supports, loads and actuators: what a structure says of itself, drawn.

Structures in space are seen by a parallel projection; see `viewpoint` and `tubes`.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.patches import Polygon
from matplotlib.patheffects import AbstractPathEffect, Stroke as Casing

from equimorph.arrays import Float
from equimorph.model import ActuatorKind, Constraint, Drawing, Obstacle, Support, SupportKind
from equimorph.plotting import style
from equimorph.plotting.depth import Viewpoint, draw_triad, viewpoint_of
from equimorph.plotting.labels import with_unit
from equimorph.plotting.scene import Picture, draw_solids, moving_solid
from equimorph.plotting.support_symbols import AWAY, HUB, SYMBOLS, UPRIGHT, Stroke
from equimorph.structures import States

_RADIUS = 0.022
"""Unit of the symbols of supports, as a share of the size of the structure."""
_LINE_LOAD, _FORCE = 0.09, 0.15
"""Longest arrows of distributed loads and of forces, as shares of the size of the structure."""
_COUPLE = 0.06
"""Radius of the arc of a couple, as a share of the size of the structure."""
_LEAST_ROOM = 0.02
"""Empty room around symbols and arrows, as a share of the size of the structure."""
_CLEARANCE = 0.012
"""Gap between arrow heads and structure, as a share of its size."""
_MOVED = 1e-3
"""Change of a place, relative to the size, or of a direction, that counts as one."""
_GROUND, _LOAD = "#d9d9d9", "#6f6f6f"
_SHAFT = 0.65 / 72
"""Inches of the width of an arrow's shaft."""
_HEAD = 0.022
"""Length of the head of a couple's arrow, as a share of the size of the structure."""

Lines = Float[np.ndarray, "states points 2"]


def _turning_arrow() -> Float[np.ndarray, "points 2"]:
    """Arc of three quarters counterclockwise, with the two barbs of a head at its end."""
    angle = np.linspace(-0.75 * np.pi, 0.75 * np.pi, 40)
    arc = _COUPLE * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    barbs = angle[-1] - 0.5 * np.pi + np.array([-0.45, 0.45])
    left, right = arc[-1] + _HEAD * np.stack([np.cos(barbs), np.sin(barbs)], axis=1)
    return np.concatenate([arc, [left, arc[-1], right]])


_TURN = _turning_arrow()


@dataclass(frozen=True, eq=False)
class Moving:
    """An artist, and how it is brought to where it belongs in state number k."""

    artist: Artist
    place: Callable[[int], None]


@dataclass(frozen=True, eq=False)
class Surroundings:
    """Shapes of states and what stands around them, in the coordinates of the axes."""

    states: States
    """At least one, of one structure."""
    obstacles: tuple[Obstacle, ...] = ()
    """Half-planes and discs that the shapes must stay clear of."""

    @cached_property
    def _shapes(self) -> Float[np.ndarray, "states points space"]:
        return self.states.shape()

    @cached_property
    def viewpoint(self) -> Viewpoint | None:
        """From where a structure in space is seen; None for a planar one."""
        return None if self._shapes.shape[2] == 2 else viewpoint_of(self.states.structure)

    @cached_property
    def outlines(self) -> Lines:
        """Shapes, as they are seen."""
        return self._shapes if self.viewpoint is None else self.viewpoint.flat(self._shapes)

    @cached_property
    def drawing(self) -> Drawing:
        """What the structure says of itself, as it is seen."""
        drawing = self.states.drawing()
        return drawing if self.viewpoint is None else self.viewpoint.drawing(drawing)

    @cached_property
    def size(self) -> float:
        """Larger side of the box around all shapes."""
        return float(np.ptp(self.outlines.reshape(-1, 2), axis=0).max()) or 1.0

    @property
    def loaded(self) -> int:
        """State to draw loads at: of the most loaded ones the first that the loads meet.

        Arrows then cross the other shapes least.
        """
        total = np.zeros(len(self.states))
        against = np.zeros(len(self.states))
        for each in self.drawing.forces:
            total += np.linalg.norm(each.vectors, axis=2).sum(axis=1)
            against -= (each.vectors * each.places).sum(axis=(1, 2))
        for couple in self.drawing.couples:
            total += np.abs(couple.moments).sum(axis=1)
        most = total >= 0.99 * total.max()
        return int(np.where(most, against, -np.inf).argmax())

    def moves(self, support: Support) -> bool:
        """Whether a support changes its place on the way through the states."""
        return bool(np.ptp(support.places, axis=0).max() > _MOVED * self.size)

    def turns(self, support: Support) -> bool:
        """Whether a clamp changes its direction."""
        change = np.ptp(support.directions, axis=0).max()
        return support.kind is SupportKind.CLAMP and bool(change > _MOVED)

    def strokes(self, support: Support) -> list[tuple[Stroke, Lines]]:
        """Strokes of the symbol of a support, and their outlines in every state."""
        symbol = HUB if self.turns(support) else SYMBOLS[support.kind]
        along = support.directions
        if support.kind in UPRIGHT:
            along = np.tile([1.0, 0.0], (len(along), 1))
        across = np.stack([-along[:, 1], along[:, 0]], axis=1)
        middle = self.outlines.reshape(-1, 2).mean(axis=0)
        inward = middle - support.places.mean(axis=0)
        if support.kind in AWAY and along.mean(axis=0) @ inward > 0.0:
            along, across = -along, -across
        rolls = support.kind is SupportKind.ROLLER
        if rolls and across.mean(axis=0) @ inward < -1e-9 * self.size:
            across = -across
        found = []
        for stroke in symbol:
            x, y = _RADIUS * self.size * stroke.outline.T[:, None, :, None]
            outline = support.places[:, None] + x * along[:, None] + y * across[:, None]
            found.append((stroke, outline))
        return found

    @cached_property
    def arrows(self) -> list[tuple[Lines, Lines]]:
        """Tails and heads of the arrows of each group of forces; they press on the structure."""
        found = []
        for distributed, longest in ((True, _LINE_LOAD), (False, _FORCE)):
            groups = [each for each in self.drawing.forces if each.distributed == distributed]
            most = max(
                (float(np.linalg.norm(each.vectors, axis=2).max()) for each in groups), default=0.0
            )
            for each in groups if most > 0.0 else ():
                vectors = each.vectors * (longest * self.size / most)
                length = np.linalg.norm(vectors, axis=2, keepdims=True)
                gap = _CLEARANCE * self.size * vectors / np.where(length > 0.0, length, np.inf)
                found.append((each.places - gap - vectors, each.places - gap))
        return found

    @property
    def extent(self) -> Float[np.ndarray, "points 2"]:
        """Points that axes must show: shapes, symbols and arrows."""
        parts = [self.outlines]
        for support in self.drawing.supports:
            parts += [outline for _, outline in self.strokes(support)]
        parts += [tails for tails, _ in self.arrows]
        return np.concatenate([part.reshape(-1, 2) for part in parts])

    # --- artists --------------------------------------------------------------------------------

    def draw_shapes(self, ax: Axes, colours: Any, zorder: float, **look: Any) -> None:
        """Draw all shapes: lines with a look, or solids in one picture; limits must be final."""
        if self.viewpoint is not None:
            picture = Picture(self.viewpoint, ax)
            draw_solids(picture, self.states, self.size, colours, zorder)
            return
        lines = LineCollection(list(self.outlines), colors=colours, zorder=zorder, **look)
        ax.add_collection(lines)

    def moving_shape(self, ax: Axes, colour: Any) -> Moving:
        """The shape, to be placed state by state; limits must be final."""
        if self.viewpoint is None:
            return _line(ax, self.outlines, color=colour, linewidth=3.0, zorder=4)
        picture = Picture(self.viewpoint, ax, ax.figure.dpi)
        return Moving(*moving_solid(picture, self.states, self.size, colour, 4))

    def label_axes(self, ax: Axes) -> None:
        """Axes of the plane with their unit; of space the directions x, y, z and a scale."""
        unit = self.states.structure.length_unit
        if self.viewpoint is not None:
            draw_triad(ax, self.viewpoint, unit)
            return
        ax.set_xlabel(with_unit("$x$", unit))
        ax.set_ylabel(with_unit("$y$", unit))
        ax.xaxis.set_major_locator(style.few_ticks())
        ax.yaxis.set_major_locator(style.few_ticks())

    def draw_still(self, ax: Axes) -> None:
        """Draw everything for a figure: moving supports at both ends of the way, loads once."""
        self.draw_grounds(ax)
        for support in self.drawing.supports:
            ends = (0, -1) if self.moves(support) or self.turns(support) else (0,)
            for k in ends:
                for moving in self._support(ax, support):
                    moving.place(k)
        for moving in (*self._actuators(ax), *self._loads(ax)):
            moving.place(self.loaded)

    def draw_grounds(self, ax: Axes) -> None:
        """Draw obstacles, and the rails of supports that move."""
        for obstacle in self.obstacles:
            _draw_obstacle(ax, obstacle)
        for support in self.drawing.supports:
            if self.moves(support):
                ax.plot(
                    *support.places.T, color=_GROUND, linewidth=3.0, solid_capstyle="butt",
                    zorder=0, gid="rail",
                )  # fmt: skip

    def moving_parts(self, ax: Axes) -> tuple[Moving, ...]:
        """Artists of all supports, actuators and loads, to be placed state by state."""
        supports = [each for one in self.drawing.supports for each in self._support(ax, one)]
        return (*supports, *self._actuators(ax), *self._loads(ax))

    def _support(self, ax: Axes, support: Support) -> list[Moving]:
        name = f"{'hub' if self.turns(support) else support.kind.value}"
        found = []
        for stroke, outline in self.strokes(support):
            look: dict[str, Any] = {"linewidth": stroke.edge, "zorder": stroke.zorder, "gid": name}
            if stroke.filled:
                small = stroke.zorder > 6.0
                face = "white" if small and name != "hub" else style.INK if small else _GROUND
                edge = style.INK if stroke.edge else "none"
                area = Polygon(outline[0], facecolor=face, edgecolor=edge, **look)
                found.append(Moving(ax.add_patch(area), partial(_place_area, area, outline)))
            else:
                found.append(_line(ax, outline, color=style.INK, **look))
        return found

    def _actuators(self, ax: Axes) -> list[Moving]:
        found = []
        for actuator in self.drawing.actuators:
            line, name = actuator.line, f"actuator {actuator.kind.value}"
            if actuator.kind is ActuatorKind.LENGTH:
                cut = max(1, line.shape[1] // 3)
                inner = line[:, cut:-cut] if line.shape[1] > 2 else _middle(line)
                casing: list[AbstractPathEffect] = [
                    Casing(linewidth=4.4, foreground=style.INK),
                    Casing(),
                ]
                moving = _line(ax, inner, color="white", linewidth=2.8, zorder=4.5, gid=name)
                moving.artist.set_path_effects(casing)
                found.append(moving)
            elif actuator.kind is ActuatorKind.CURVATURE:
                found.append(_line(ax, line, color=_GROUND, linewidth=6.0, zorder=0.5, gid=name))
            else:
                found.append(
                    _line(ax, line, color=style.INK, linewidth=0.6, zorder=4.5, gid=name,
                          linestyle=(0, (4, 1.5)))
                )  # fmt: skip
        return found

    def _loads(self, ax: Axes) -> list[Moving]:
        look: dict[str, Any] = {"color": _LOAD, "zorder": 3, "gid": "load"}
        found = []
        groups = sorted(self.drawing.forces, key=lambda each: not each.distributed)
        for each, (tails, heads) in zip(groups, self.arrows, strict=False):
            arrows = ax.quiver(
                *tails[0].T, *(heads - tails)[0].T, angles="xy", scale_units="xy", scale=1.0,
                units="inches", width=_SHAFT, headwidth=5.5, headlength=6.5, headaxislength=6.0,
                minlength=0.1, **look,
            )  # fmt: skip
            found.append(Moving(arrows, partial(_place_arrows, arrows, tails, heads)))
            if each.distributed:
                found.append(_line(ax, tails, linewidth=0.5, **look))
        for couple in self.drawing.couples:
            found += self._couples(ax, couple.places, couple.moments, look)
        return found

    def _couples(
        self, ax: Axes, places: Lines, moments: Float[np.ndarray, "states places"],
        look: dict[str, Any],
    ) -> list[Moving]:  # fmt: skip
        """Arcs around the places of couples, with a head where they end."""
        largest, found = np.abs(moments).max(), []
        for place, moment in zip(places.swapaxes(0, 1), moments.T, strict=True):
            if largest == 0.0:
                continue
            sign = np.stack([np.ones_like(moment), np.sign(moment)], axis=1)
            sign[np.abs(moment) <= 1e-3 * largest] = np.nan
            whole = self.size * sign[:, None] * _TURN
            found.append(_line(ax, place[:, None] + whole, linewidth=0.9, **look))
        return found


def obstacles_of(constraints: Sequence[Constraint]) -> tuple[Obstacle, ...]:
    """Obstacles that constraints keep shapes away from."""
    found = (each.descriptor.obstacle for each in constraints)
    return tuple(each for each in found if each is not None)


def _draw_obstacle(ax: Axes, obstacle: Obstacle) -> None:
    """Hatch what is forbidden, as far as the axes reach: call it after `frame_shapes`."""
    (left, right), (low, high) = ax.get_xlim(), ax.get_ylim()
    x, y = np.meshgrid(np.linspace(left, right, 400), np.linspace(low, high, 400))
    gap = obstacle.distance(np.stack([x, y], axis=2))
    area = ax.contourf(x, y, gap, [-np.inf, 0.0], colors=["#f2f2f2"], hatches=["////"], zorder=0.2)
    area.set_edgecolor(style.FAINT)
    area.set_linewidth(0.0)
    ax.contour(x, y, gap, [0.0], colors=[style.INK], linewidths=0.8, zorder=0.3)


def frame_shapes(ax: Axes, around: Surroundings, room: float) -> None:
    """Equal aspect, and limits around everything with `room`, a share of the shapes' size."""
    low, high = limits(around, room)
    ax.set_xlim(low[0], high[0])
    ax.set_ylim(low[1], high[1])
    ax.set_aspect("equal")


def limits(
    around: Surroundings, room: float
) -> tuple[Float[np.ndarray, "2"], Float[np.ndarray, "2"]]:
    """Lower left and upper right corner of the picture."""
    outlines, extent = around.outlines.reshape(-1, 2), around.extent
    least, most = _LEAST_ROOM * around.size, room * around.size
    low = np.minimum(outlines.min(axis=0) - most, extent.min(axis=0) - least)
    high = np.maximum(outlines.max(axis=0) + most, extent.max(axis=0) + least)
    return low, high


def _line(ax: Axes, outline: Lines, **look: Any) -> Moving:
    (line,) = ax.plot(*outline[0].T, **look)
    return Moving(line, lambda k: line.set_data(*outline[k].T))


def _place_area(area: Polygon, outline: Lines, k: int) -> None:
    area.set_xy(outline[k])


def _place_arrows(arrows: Any, tails: Lines, heads: Lines, k: int) -> None:
    arrows.set_offsets(tails[k])
    arrows.set_UVC(*(heads - tails)[k].T)


def _middle(line: Lines) -> Lines:
    """Middle third of straight lines."""
    return np.stack([(2.0 * line[:, 0] + line[:, 1]) / 3, (line[:, 0] + 2.0 * line[:, 1]) / 3], 1)
