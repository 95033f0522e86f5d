"""Fitted shapes with the measured points, and the residuals."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from mpl_toolkits.axes_grid1 import make_axes_locatable

from equimorph.argument_checks import check_arguments
from equimorph.array_types import Float
from equimorph.errors import InputError
from equimorph.plotting import style
from equimorph.plotting.labels import with_unit
from equimorph.plotting.shapes import prepare_axes
from equimorph.plotting.viewpoint import flat_shapes
from equimorph.tasks.calibration.calibrate import Calibration
from equimorph.tasks.calibration.measurements import MeasuredShape

_ROOM = 0.06
"""Empty border, as a share of the width of the outlines."""
_BELOW = 1.15
"""Inches for the residuals and the labels above them."""
_GAP = 0.42
"""Inches between the shapes and the residuals."""
_LOOKS: tuple[tuple[str, str, dict[str, Any]], ...] = (
    ("$x$", "o", {}),
    ("$y$", "s", {"mfc": "white"}),
    ("$z$", "^", {"mfc": "white"}),
)


@check_arguments
def calibration(found: Calibration, measured: MeasuredShape, ax: Axes | None = None) -> Axes:
    """Shapes at the fitted unknowns under the measured points; below, the residuals.

    Parameters
    ----------
    found
        A calibration on one `MeasuredShape` alone.
    measured
        What it was fitted to.
    ax
        Where to draw; None makes a figure one column wide.

    Returns
    -------
    The axes of the shapes.

    Raises
    ------
    InputError
        If the residuals are not those of the measured points.
    """
    points = np.asarray(measured.points, dtype=float)
    there = np.isfinite(points)
    if there.sum() != len(found.residuals):
        raise InputError(
            f"`measured` must be the shape that was fitted, with {len(found.residuals)} numbers; "
            f"got {there.sum()}."
        )
    left = np.full(points.shape, np.nan)
    left[there] = found.residuals
    colours = style.progress_map()(np.linspace(0.0, 0.85, len(points)))
    with style.house_style():
        ax, around = prepare_axes(found.states, ax, room=_ROOM, below=_BELOW)
        around.draw_shapes(ax, colours, 2, linewidths=1.0)
        for dots, colour in zip(flat_shapes(found.states.structure, points), colours, strict=True):
            ax.plot(
                *dots.T, "o", ms=3, mfc="white", mec=colour, mew=0.8, linestyle="none", zorder=3
            )
        below = make_axes_locatable(ax).append_axes("bottom", size=_BELOW - _GAP, pad=_GAP)
        places = np.linspace(0.0, 1.0, points.shape[1]) if measured.s is None else measured.s
        _draw_residuals(below, np.asarray(places, dtype=float), left, colours)
        unit = found.states.structure.length_unit
        below.set_ylabel(
            "residual / σ" if measured.sigma is not None else with_unit("residual", unit)
        )
    return ax


def _draw_residuals(
    ax: Axes,
    places: Float[np.ndarray, " points"],
    left: Float[np.ndarray, "states points space"],
    colours: Float[np.ndarray, "states 4"],
) -> None:
    """Residuals, fitted minus measured coordinates, over the arclengths of the points."""
    ax.axhline(0.0, color=style.FAINT, linewidth=style.HAIRLINE, zorder=1)
    for own, colour in zip(left, colours, strict=True):
        for values, (_, marker, look) in zip(own.T, _LOOKS, strict=False):
            ax.plot(
                places, values, marker, ms=2.8, color=colour, mew=0.7, zorder=3, **look
            )  # fmt: skip
    for name, marker, look in _LOOKS[: left.shape[2]]:
        ax.plot([], [], marker, ms=2.8, color=style.INK, mew=0.7, label=name, **look)
    largest = np.nanmax(np.abs(left), initial=1e-300)
    ax.set_ylim(-1.2 * largest, 1.2 * largest)
    ax.set_xlabel("$s$")
    ax.yaxis.set_major_locator(style.few_ticks())
    ax.legend(
        loc="lower right", bbox_to_anchor=(1.0, 0.97), ncols=2, handletextpad=0.1, columnspacing=0.8
    )
