"""From where structures in space are seen, and how that becomes a plane."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from matplotlib.axes import Axes

from equimorph.array_types import Float
from equimorph.model import Actuator, Drawing, Forces, Support
from equimorph.plotting import style
from equimorph.structures import Structure

_AZIMUTH, _ELEVATION = np.deg2rad(28.0), np.deg2rad(22.0)
"""To the right of the front, and above the horizon."""
_UPRIGHT = {"y": np.eye(3), "z": np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])}
"""Rows: right, up and towards the front, for the axis that is upward."""
_TRIAD, _CORNER = 0.14, 0.04
"""Longest arms of the directions, and their distance from the corner, as shares of the axes."""
_END_ON = 0.05
"""Length of the picture of a unit vector below which its direction has no meaning."""


@dataclass(frozen=True)
class Viewpoint:
    """Parallel projection of space.

    Parameters
    ----------
    upward
        Axis that is upward in the picture: y or z.
    """

    upward: str

    @cached_property
    def frame(self) -> Float[np.ndarray, "3 3"]:
        """Unit vectors to the right, upward and towards the viewer, as columns."""
        (sa, ca), (se, ce) = ((np.sin(a), np.cos(a)) for a in (_AZIMUTH, _ELEVATION))
        right, toward = np.array([ca, 0.0, -sa]), np.array([sa * ce, se, ca * ce])
        upright = np.stack([right, np.cross(toward, right), toward])
        return np.asarray((upright @ _UPRIGHT[self.upward]).T)

    def flat(self, vectors: Float[np.ndarray, "*n 3"]) -> Float[np.ndarray, "*n 2"]:
        """Places or vectors in the plane of the picture."""
        return np.asarray(vectors @ self.frame[:, :2])

    def directions(self, vectors: Float[np.ndarray, "*n 3"]) -> Float[np.ndarray, "*n 2"]:
        """Unit vectors in the plane of the picture; to the right where they are seen end-on."""
        flat = self.flat(vectors)
        size = np.linalg.norm(flat, axis=-1, keepdims=True)
        seen = flat / np.maximum(size, _END_ON)
        return np.where(size > _END_ON, seen, np.array([1.0, 0.0]))

    def drawing(self, drawing: Drawing) -> Drawing:
        """Supports, forces and actuators in the plane of the picture; couples are planar."""
        return Drawing(
            tuple(
                Support(each.kind, self.flat(each.places), self.directions(each.directions))
                for each in drawing.supports
            ),
            tuple(
                Forces(self.flat(each.places), self.flat(each.vectors), each.distributed)
                for each in drawing.forces
            ),
            actuators=tuple(
                Actuator(each.kind, self.flat(each.line)) for each in drawing.actuators
            ),
        )


def draw_triad(ax: Axes, viewpoint: Viewpoint, unit: str) -> None:
    """Directions x, y, z in the lower left corner, of the length that stands below them."""
    ax.set_xticks([])
    ax.set_yticks([])
    for side in ax.spines.values():
        side.set_visible(False)
    (left, right), (low, high) = ax.get_xlim(), ax.get_ylim()
    size = _TRIAD * min(right - left, high - low)
    length = _round_length(size)
    arms = viewpoint.flat(length * np.eye(3))
    reach = np.minimum(arms.min(axis=0), 0.0)
    foot = np.array([left, low]) + _CORNER * (right - left + high - low) - reach
    for name, arm in zip("xyz", arms, strict=True):
        ax.annotate(
            "", tuple(foot + arm), tuple(foot), zorder=9,
            arrowprops={"arrowstyle": "-|>", "linewidth": 0.6, "color": style.INK,
                        "mutation_scale": 4.0, "shrinkA": 0.0, "shrinkB": 0.0},
        )  # fmt: skip
        ax.annotate(
            f"${name}$", tuple(foot + arm), tuple(5.0 * arm / np.linalg.norm(arm)), ha="center",
            va="center", textcoords="offset points", size=7, zorder=9,
        )  # fmt: skip
    words = f"{length:g}" if unit == "1" else f"{length:g} {unit}"
    ax.annotate(
        words, tuple(foot + 0.3 * arms[0]), (0, -7), textcoords="offset points", size=6, va="top",
        ha="left", color=style.FAINT, zorder=9,
    )  # fmt: skip


def _round_length(most: float) -> float:
    """1, 2 or 5 times a power of ten, not longer than `most`."""
    power = 10.0 ** np.floor(np.log10(most))
    return float(power * max(each for each in (1.0, 2.0, 5.0) if each * power <= most))


def viewpoint_of(structure: Structure) -> Viewpoint:
    """From where a structure in space is seen."""
    return Viewpoint(structure.upward)


def flat_shapes(
    structure: Structure, shapes: Float[np.ndarray, "*n space"]
) -> Float[np.ndarray, "*n 2"]:
    """Shapes as they are seen: planar ones as they are."""
    return shapes if shapes.shape[-1] == 2 else viewpoint_of(structure).flat(shapes)
