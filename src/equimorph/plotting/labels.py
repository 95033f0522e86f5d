"""Words and numbers in figures: printed symbols, labels of axes and contours, numbered points."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.contour import ContourSet
from matplotlib.transforms import Affine2D, Transform

from equimorph.arrays import Float
from equimorph.model import Constraint, Descriptor, position
from equimorph.plotting import style
from equimorph.structures import Structure

_SYMBOLS = {
    "Theta": "Θ",
    "Delta": "Δ",
    "theta_A": "$θ_A$",
    "theta_B": "$θ_B$",
    "nu": "ν",
    "q": "$q$",
    "x_l": "$x_l$",
    "F": "$F$",
    "k": "$k$",
    "max_curvature": "max |κ|",
}


def symbol(name: str) -> str:
    """Symbol of a parameter or descriptor by name; one without a symbol is put in plain words.

    Examples
    --------
    >>> symbol("Theta"), symbol("max_curvature"), symbol("tip_load")
    ('Θ', 'max |κ|', 'tip load')
    """
    return _SYMBOLS.get(name, name.replace("_", " "))


def with_unit(label: str, unit: str) -> str:
    """Label with its unit in brackets; a pure number has none.

    Examples
    --------
    >>> with_unit("Δ", "rad"), with_unit("ν", "")
    ('Δ (rad)', 'ν')
    """
    return label if unit in ("", "1") else f"{label} ({unit})"


def parameter_label(structure: Structure, name: str) -> str:
    """Axis label of a parameter."""
    parameter = structure.parameters[position(structure.parameters, name)]
    return with_unit(symbol(name), parameter.unit)


def descriptor_label(descriptor: Descriptor) -> str:
    """Axis label of a descriptor."""
    printed = _SYMBOLS.get(descriptor.name) or descriptor.symbol or symbol(descriptor.name)
    return with_unit(printed, descriptor.unit)


def constraint_label(constraints: Sequence[Constraint]) -> str:
    """Legend entry for the edges that constraints cut into a set."""
    named = [
        f"{c.descriptor.symbol or symbol(c.descriptor.name)} = {c.bound:g}" for c in constraints
    ]
    return " or ".join(named) or "edge of the set"


Points = Float[np.ndarray, "_ 2"]

_LABELS_PER_LEVEL = 2
"""Labels on each contour, if there is room."""
_ROOM, _SHORTEST = 0.05, 0.15
"""Distance from other things and labels, and shortest line with a label, in widths of the frame."""
_APART = 0.35
"""Least distance of two labels of one level, in widths of the frame."""


def label_contours(ax: Axes, lines: ContourSet, taken: Points) -> None:
    """Write at most two labels on each level, far from each other, the frame and places `taken`."""
    corner = np.array([ax.get_xlim()[0], ax.get_ylim()[0]])
    size = np.array([ax.get_xlim()[1], ax.get_ylim()[1]]) - corner
    full, found = (taken - corner) / size, []
    for path in lines.get_paths():
        pieces = [np.asarray(p) for p in path.to_polygons(closed_only=False)]
        choices = _choices([(piece - corner) / size for piece in pieces if len(piece) > 1])
        for _ in range(_LABELS_PER_LEVEL):
            place = roomiest(choices, full)
            if place is None:
                break
            full = np.concatenate([full, place[None]])
            found.append(tuple(corner + place * size))
            choices = choices[np.linalg.norm(choices - place, axis=1) > _APART]
    if found:
        for text in ax.clabel(lines, fontsize=6, fmt="%g", inline_spacing=2, manual=found):
            text.set_zorder(6)


def _choices(pieces: list[Points]) -> Points:
    """Points of the pieces that are long enough."""
    lengths = [np.linalg.norm(np.diff(piece, axis=0), axis=1).sum() for piece in pieces]
    long = [p for p, length in zip(pieces, lengths, strict=True) if length > _SHORTEST]
    return np.concatenate([np.empty((0, 2)), *long])


def roomiest(choices: Points, full: Points) -> Float[np.ndarray, "2"] | None:
    """The point farthest from the frame and from all that is taken; None if none is far enough.

    In shares of the frame.
    """
    if not len(choices):
        return None
    room = np.minimum(choices, 1.0 - choices).min(axis=1)
    gaps = np.linalg.norm(choices[:, None] - full[None], axis=2).min(axis=1, initial=np.inf)
    room = np.minimum(room, gaps)
    best = int(room.argmax())
    return np.asarray(choices[best]) if room[best] > _ROOM else None


Places = Float[np.ndarray, "_ 2"]

_DISTANCES = np.array([11.0, 14.0, 17.0, 20.0, 24.0, 28.0, 33.0])
"""Distances from a point to its badge that are tried, in typographic points."""
_DIRECTIONS = np.linspace(0.0, 2 * np.pi, 24, endpoint=False)
"""Directions from a point to its badge that are tried."""
_ENOUGH = 4.0
"""Room around a badge, in typographic points, beyond which more is no better."""
_DETOUR = 0.15
"""Room that a badge gives up to stand nearer to its place, relative to the distance saved."""
_RIM = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1], [-1, -1]])
_SPACING = 2.0
"""Distance between the points that stand for a curve, in typographic points."""
_CROWDED = 6.0
"""Way-points nearer to a numbered one than this, in typographic points, get no number."""
_COLOUR = style.ROUTE_COLOUR
_DOT: dict[str, Any] = {"ms": 4, "color": _COLOUR, "mec": "white", "mew": 0.7}
BOX: dict[str, Any] = {
    "boxstyle": "round,pad=0.2,rounding_size=0.6", "fc": "white", "ec": _COLOUR, "lw": 0.6,
}  # fmt: skip
"""Frame of a number."""
_LEADER: dict[str, Any] = {
    "arrowstyle": "-", "color": _COLOUR, "lw": 0.5, "shrinkA": 0, "shrinkB": 0,
}  # fmt: skip


def number_way_points(ax: Axes, corners: Places) -> Places:
    """Mark the way-points and number them; those at one place share a badge.

    Returns places around the badges, where nothing else should be written.
    """
    for place, _ in _badges(corners, _to_points(ax).transform(corners)):
        ax.plot(*place, "o", **_DOT, zorder=7)
    return number_points(ax, corners)


def number_points(ax: Axes, places: Places) -> Places:
    """Number places; those that are the same share a badge.

    A badge stands where it hides no curve already drawn, with a thin line to its point. Returns
    places around the badges, where nothing else should be written.
    """
    to_points = _to_points(ax)
    lines = [to_points.transform(np.asarray(line.get_xydata())) for line in ax.lines]
    taken = np.concatenate([np.empty((0, 2)), *(_dense(line) for line in lines if len(line) > 1)])
    frame = to_points.transform(np.column_stack([ax.get_xlim(), ax.get_ylim()]))
    rims = np.empty((0, 2))
    for place, text in _badges(places, to_points.transform(places)):
        here, half = to_points.transform(place), np.array([2.0 + 1.9 * len(text), 5.0])
        middle = _roomiest(here, half, np.concatenate([taken, rims]), frame)
        rims = np.concatenate([rims, _dense(middle + half * _RIM)])
        offset = (float(middle[0] - here[0]), float(middle[1] - here[1]))
        ax.annotate(
            text, tuple(place.tolist()), offset, textcoords="offset points", size=6.5,
            ha="center", va="center", zorder=7.5, bbox=BOX, arrowprops=_LEADER,
        )  # fmt: skip
    return np.asarray(to_points.inverted().transform(rims))


def _to_points(ax: Axes) -> Transform:
    """From data to typographic points."""
    figure = ax.get_figure(root=True)
    assert figure is not None
    return ax.transData + Affine2D().scale(72 / figure.dpi)


def _badges(corners: Places, there: Places) -> list[tuple[Float[np.ndarray, " 2"], str]]:
    """Places and numbers of the badges; `there` are the corners in typographic points."""
    badges: dict[int, list[int]] = {}
    # First the ends, then the points between them as far as there is room.
    last = len(corners) - 1
    for k in sorted(range(len(corners)), key=lambda k: k not in (0, last)):
        near = [j for j in badges if np.hypot(*(there[k] - there[j])) < _CROWDED]
        if not near:
            badges[k] = [k + 1]
        elif np.allclose(corners[near[0]], corners[k], rtol=0, atol=1e-9):
            badges[near[0]].append(k + 1)
    return [(corners[k], ", ".join(map(str, sorted(numbers)))) for k, numbers in badges.items()]


def _roomiest(
    here: Float[np.ndarray, " 2"], half: Float[np.ndarray, " 2"], taken: Places, frame: Places
) -> Float[np.ndarray, " 2"]:
    """Middle of a badge of half sizes `half`: near its point, off what is taken, in the frame."""
    around = np.column_stack([np.cos(_DIRECTIONS), np.sin(_DIRECTIONS)])
    distance = np.repeat(_DISTANCES, len(around))
    tried = here + (_DISTANCES[:, None, None] * around).reshape(-1, 2)
    beside = np.maximum(np.abs(tried[:, None] - taken) - half, 0.0)
    room = np.linalg.norm(beside, axis=2).min(axis=1, initial=_ENOUGH)
    inside = np.minimum(tried - half - frame[0], frame[1] - half - tried).min(axis=1)
    return np.asarray(tried[np.argmax(np.minimum(room, inside) - _DETOUR * distance)])


def _dense(line: Float[np.ndarray, "points 2"]) -> Places:
    """Points along a polyline, close enough to stand for it."""
    steps = np.hypot(*np.diff(line, axis=0).T)
    length = np.concatenate([[0.0], np.cumsum(steps)])
    at = np.linspace(0.0, length[-1], 2 + int(length[-1] / _SPACING))
    return np.column_stack([np.interp(at, length, line[:, k]) for k in (0, 1)])
