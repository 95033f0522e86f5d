"""What stands around a structure in a picture: supports and loads."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import Circle, Polygon
from matplotlib.quiver import Quiver

from equimorph.plotting import style
from equimorph.structures import Rod, Spring, States, Truss

_HUB = 0.026  # radius of a rotary actuator, in lengths of the rod
_JOINT = 0.02  # size of a truss's support, as a share of the picture
_MOVED = 1e-3  # way of a support, in lengths of the rod, that is worth a rail
_STATIONS = np.linspace(0.05, 0.95, 13)
_LONGEST_ARROW = 0.1  # of a line load, as a share of the width of the picture
_FORCE_ARROW = 1.6  # longest arrow of a point force, in longest ones of line loads
_CLEARANCE = 0.012  # between arrow heads and rod, in lengths of the rod
_GROUND = "#d9d9d9"


def frame_shapes(ax: Axes, outlines: Float[np.ndarray, "lanes points 2"], room: float) -> None:
    """Equal aspect, and limits around all outlines with `room`, a share of their width."""
    points = outlines.reshape(-1, 2)
    low, high = points.min(axis=0), points.max(axis=0)
    margin = room * max(high - low)
    ax.set_xlim(low[0] - margin, high[0] + margin)
    ax.set_ylim(low[1] - margin, high[1] + margin)
    ax.set_aspect("equal")


def draw_supports(ax: Axes, states: States) -> None:
    """Supports of a structure, where they stay on the way through the states."""
    if isinstance(states.structure, Rod):
        _draw_rod_supports(ax, states.structure, states)
    elif isinstance(states.structure, Spring):
        _draw_guides(ax, states)
    elif isinstance(states.structure, Truss):
        _draw_truss_supports(ax, states.structure, states)


@dataclass(frozen=True)
class MovingParts:
    """Parts of a picture that follow the structure from state to state.

    Attributes
    ----------
    pointers, pointer_lines
        Marks that move with the actuators (pointers on the hubs of a rod, the ends of a spring),
        and the two points of each for every state.
    arrows, tails, heads
        Arrows of the load, and for every state where they start and how far they reach.
    """

    pointers: tuple[Line2D, ...]
    pointer_lines: Float[np.ndarray, "pointers states 2 2"]
    arrows: Quiver | None
    tails: Float[np.ndarray, "states arrows 2"]
    heads: Float[np.ndarray, "states arrows 2"]

    def follow(self, k: int) -> None:
        """Move the parts to where they belong at state number `k`."""
        for pointer, lines in zip(self.pointers, self.pointer_lines, strict=True):
            pointer.set_data(*lines[k].T)
        if self.arrows is not None:
            self.arrows.set_offsets(self.tails[k])
            self.arrows.set_UVC(*self.heads[k].T)

    def artists(self) -> tuple[Artist, ...]:
        """Artists to draw anew in each picture."""
        return self.pointers if self.arrows is None else (*self.pointers, self.arrows)


def moving_parts(ax: Axes, states: States) -> MovingParts:
    """Prepare the moving parts for the way through the states; `follow` places them."""
    structure = states.structure
    look: dict[str, Any] = {"color": style.INK, "linewidth": 1.2, "zorder": 6}
    lines = np.empty((0, len(states), 2, 2))
    tails = heads = np.empty((len(states), 0, 2))
    if isinstance(structure, Rod):
        lines = _pointer_lines(structure, states)
        tails, heads = _rod_arrows(structure, states)
    elif isinstance(structure, Spring):
        look |= {"linestyle": "none", "marker": "o", "markersize": 5, "markerfacecolor": "white"}
        lines = states.shape()[None]
        tails, heads = _tip_arrow(states)
    elif isinstance(structure, Truss):
        tails = structure.joint_places(states.z)
        heads = _FORCE_ARROW * _longest_one(structure.nodal_forces(states.p))
    pointers = tuple(ax.plot([], [], **look)[0] for _ in lines)
    if not heads.any():
        return MovingParts(pointers, lines, None, tails, heads)
    heads = heads * _LONGEST_ARROW * np.ptp(ax.get_xlim())
    if isinstance(structure, Rod):  # loads press on the rod, the spring's force pulls its point
        size = np.hypot(*np.moveaxis(heads, -1, 0))[:, :, None]
        clearance = _CLEARANCE * structure.units.value("length")
        tails = tails - heads * (1.0 + clearance / np.where(size > 0.0, size, np.inf))
    arrows = ax.quiver(
        *tails[0].T, *heads[0].T, angles="xy", scale_units="xy", scale=1.0, color=style.FAINT,
        width=0.0045, headwidth=4.0, headlength=4.5, headaxislength=4.2, zorder=3,
    )  # fmt: skip
    return MovingParts(pointers, lines, arrows, tails, heads)


def _pointer_lines(rod: Rod, states: States) -> Float[np.ndarray, "ends states 2 2"]:
    """Lines along the held end tangents of a rod, through the hubs."""
    held = np.flatnonzero(rod.mechanics.held)
    hubs = states.shape()[:, [0, -1]].swapaxes(0, 1)[held]
    angles = rod.nodal_angles(states.z, states.p)[:, [0, -1]].T[held]
    along = 1.7 * _hub(rod) * np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    return np.stack([hubs - along, hubs + along], axis=2)


def _rod_arrows(
    rod: Rod, states: States
) -> tuple[Float[np.ndarray, "states arrows 2"], Float[np.ndarray, "states arrows 2"]]:
    """Line loads at stations along the rod, and point forces where they act."""
    places, forces = rod.point_forces(states.p)
    tails = states.shape(np.concatenate([_STATIONS, places]))
    line = _longest_one(rod.line_load(states.p, _STATIONS))
    return tails, np.concatenate([line, _FORCE_ARROW * _longest_one(forces)], axis=1)


def _longest_one(vectors: Float[np.ndarray, "*n 2"]) -> Float[np.ndarray, "*n 2"]:
    """Scale vectors so that the longest has length 1: what reads well, whatever the unit."""
    longest = float(np.linalg.norm(vectors, axis=-1).max(initial=0.0))
    return vectors / longest if longest > 0.0 else vectors


def _hub(rod: Rod) -> float:
    return _HUB * rod.units.value("length")


def _tip_arrow(
    states: States,
) -> tuple[Float[np.ndarray, "states arrows 2"], Float[np.ndarray, "states arrows 2"]]:
    """Force F on the free end of the spring, downward if positive."""
    down = states["F"][:, None]
    heads = np.stack([np.zeros_like(down), -down], axis=-1)
    return states.shape()[:, -1:], _longest_one(heads)


def _draw_rod_supports(ax: Axes, rod: Rod, states: States) -> None:
    """Hubs where an angle is held, hinges where it is free, rails where a support moves."""
    ends = states.shape(np.array([0.0, 1.0]))
    supported = [end.x != "free" and end.y != "free" for end in rod.ends]
    if all(supported):
        ax.plot(*ends[0].T, color=style.FAINT, linewidth=0.5, linestyle=(0, (6, 3)), zorder=0)
    for end, places in zip(rod.ends, ends.swapaxes(0, 1), strict=True):
        if end.x == "free" and end.y == "free":
            continue
        way = np.ptp(places, axis=0).max()
        moves = way > _MOVED * rod.units.value("length")
        if moves:
            ax.plot(*places.T, color=_GROUND, linewidth=3.0, solid_capstyle="butt", zorder=0)
        for place in places[[0, -1]] if moves else places[:1]:
            _draw_support(ax, place, _hub(rod), hinged=end.angle == "free")


def _draw_support(ax: Axes, place: Float[np.ndarray, " 2"], radius: float, *, hinged: bool) -> None:
    """Hub of an actuator, or hinge."""
    look: dict[str, Any] = {"facecolor": _GROUND, "edgecolor": style.INK, "lw": 0.6, "zorder": 5}
    foot = place + radius * np.array([[0.0, 0.0], [-1.2, -2.0], [1.2, -2.0]])
    ax.add_patch(Polygon(foot, **look) if hinged else Circle((place[0], place[1]), radius, **look))
    ax.plot(*place, ".", color=style.INK, markersize=2.5, zorder=7)


def _draw_truss_supports(ax: Axes, truss: Truss, states: States) -> None:
    """Hinges at joints that are held, rollers at those that are held along some axes only."""
    places, held = truss.joint_places(states.z[:1])[0], truss.network.held
    low, high = np.ptp(states.shape().reshape(-1, 2), axis=0)
    radius = _JOINT * float(max(low, high))
    for place, axes in zip(places, held, strict=True):
        if axes.all():
            _draw_support(ax, place, radius, hinged=True)
        elif axes.any():
            _draw_support(ax, place, radius, hinged=False)


def _draw_guides(ax: Axes, states: States) -> None:
    """Rail of the moved end on y = 0 and guide of the free end on x = 0."""
    outlines = states.shape()
    reach = outlines[:, 0, 0].max()
    low, high = outlines[:, -1, 1].min(), outlines[:, -1, 1].max()
    room = 0.12 * max(reach, high - low)
    for x, y in (([0, 0], [low - room, high + room]), ([0, reach + room], [0, 0])):
        ax.plot(x, y, color=_GROUND, linewidth=3.0, solid_capstyle="butt", zorder=0)
    ends = np.concatenate(outlines[[0, -1]])
    ax.plot(*ends.T, "o", color=style.FAINT, markersize=4, markerfacecolor="white", zorder=3)
