"""States with numbers: their shapes in one frame, and their places on a surface."""

from typing import Any

import numpy as np
from jaxtyping import Float
from matplotlib.axes import Axes
from mpl_toolkits.mplot3d import proj3d

from equimorph.plotting import style
from equimorph.plotting.badges import BOX
from equimorph.plotting.outlines import farthest_apart
from equimorph.plotting.surroundings import Surroundings, frame_shapes
from equimorph.plotting.symbols import with_unit
from equimorph.structures import States

_SAME = 1e-6
_ROOM = 0.09
_AWAY = 11.0  # from a point to its number, in typographic points


def numbered_shapes(ax: Axes, states: States) -> None:
    """Shapes of states, each numbered where it is farthest from the others; equal ones once."""
    around = Surroundings(states)
    outlines = around.outlines
    frame_shapes(ax, around, _ROOM)
    around.draw_still(ax)
    different = [
        k
        for k, outline in enumerate(outlines)
        if not any(np.abs(outline - other).max() < _SAME for other in outlines[:k])
    ]
    colours = style.progress_map()(np.linspace(0.0, 1.0, len(states)))
    shown = outlines[different]
    for k, outline, at in zip(different, shown, farthest_apart(shown), strict=True):
        ax.plot(*outline.T, color=colours[k], linewidth=1.3, zorder=2)
        up = bool(outline[at, 1] >= np.median(shown[:, at, 1]))
        text = ax.annotate(
            str(k + 1), tuple(outline[at].tolist()), (0, 2.5 if up else -2.5),
            textcoords="offset points", ha="center", va="bottom" if up else "top",
            color=colours[k], weight="bold", zorder=4,
        )  # fmt: skip
        text.set_path_effects(style.RIM)
    unit = states.structure.length_unit
    ax.set_xlabel(with_unit("$x$", unit))
    ax.set_ylabel(with_unit("$y$", unit))


def number_in_space(ax: Any, places: Float[np.ndarray, "_ 3"]) -> None:
    """Number places in three-dimensional axes, away from their middle as it is seen."""
    x, y, _ = proj3d.proj_transform(*places.T, ax.get_proj())
    seen = np.stack([np.asarray(x), np.asarray(y)], axis=1)
    outward = seen - seen.mean(axis=0)
    outward /= np.maximum(np.linalg.norm(outward, axis=1, keepdims=True), 1e-12)
    for number, (there, way) in enumerate(zip(seen, outward, strict=True), start=1):
        ax.annotate(
            str(number), tuple(there), tuple(_AWAY * way), textcoords="offset points", size=6.5,
            ha="center", va="center", zorder=8, bbox=BOX,
        )  # fmt: skip
