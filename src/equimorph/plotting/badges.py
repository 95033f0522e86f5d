"""Numbers of way-points and other places, each beside its point where there is room."""

from typing import Any

import numpy as np
from jaxtyping import Float
from matplotlib.axes import Axes
from matplotlib.transforms import Affine2D, Transform

from equimorph.plotting import style

Places = Float[np.ndarray, "_ 2"]

_DISTANCES = np.array(
    [11.0, 14.0, 17.0, 20.0, 24.0, 28.0, 33.0]
)  # from a point to its badge, in typographic points
_DIRECTIONS = np.linspace(0.0, 2 * np.pi, 24, endpoint=False)
_ENOUGH = 4.0  # room around a badge that is enough
_DETOUR = 0.15  # room that a badge gives up to be a point nearer
_RIM = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1], [-1, -1]])
_SPACING = 2.0  # of the points that stand for a curve
# Way-points nearer to a numbered one than this, in points, get no number.
_CROWDED = 6.0
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

    Returns
    -------
    Places around the badges, where nothing else should be written.
    """
    for place, _ in _badges(corners, _to_points(ax).transform(corners)):
        ax.plot(*place, "o", **_DOT, zorder=7)
    return number_points(ax, corners)


def number_points(ax: Axes, places: Places) -> Places:
    """Number places; those that are the same share a badge.

    A badge stands where it hides no curve already drawn, with a thin line to its point.

    Returns
    -------
    Places around the badges, where nothing else should be written.
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
    # First the ends, then the others as far as there is room.
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
