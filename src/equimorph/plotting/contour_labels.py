"""Labels of contours, where there is room for them."""

import numpy as np
from jaxtyping import Float
from matplotlib.axes import Axes
from matplotlib.contour import ContourSet

Points = Float[np.ndarray, "_ 2"]

_LABELS_PER_LEVEL = 2
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
