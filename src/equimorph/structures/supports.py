"""Supports to draw, from the stiffness with which a point is held."""

import numpy as np
from jaxtyping import Float

from equimorph.arrays import Values
from equimorph.model import Support, SupportKind

Spots = Float[np.ndarray, "lanes 2"]
Stiffness = Float[np.ndarray, "3"]
"""Against moves in x and y and against turning: ∞ where held, 0 where free."""
AXES = np.eye(2)


def supports_of_point(
    stiffness: Stiffness, places: Spots, tangents: Spots, slide: float | None = None
) -> tuple[Support, ...]:
    """Symbols of all that holds one point of a planar structure.

    Parameters
    ----------
    stiffness
        Against moves in x, in y, and turns.
    places
        Where the point is in each state.
    tangents
        Unit vectors that point into the structure, for a clamp.
    slide
        Direction in radians along which a point that is held in x and y may move all the same.
    """
    held = np.isinf(stiffness)
    firm, fixed = held[:2], bool(held[2])
    found = []
    if slide is not None:
        kind = SupportKind.SLEEVE if fixed else SupportKind.ROLLER
        found.append(_support(kind, places, np.array([np.cos(slide), np.sin(slide)])))
    elif firm.all():
        found.append(Support(SupportKind.CLAMP if fixed else SupportKind.PIN, places, tangents))
    elif firm.any():
        kind = SupportKind.SLEEVE if fixed else SupportKind.ROLLER
        found.append(_support(kind, places, AXES[int(np.argmin(firm))]))
    elif fixed:
        found.append(Support(SupportKind.GRIP, places, tangents))
    for axis, stiff in zip(AXES, stiffness[:2], strict=True):
        if 0.0 < stiff < np.inf:
            found.append(_support(SupportKind.SPRING, places, axis))
    if 0.0 < stiffness[2] < np.inf:
        found.append(Support(SupportKind.COIL, places, tangents))
    return tuple(found)


def unit_vectors(angles: Values) -> Spots:
    """Unit vectors at angles."""
    return np.stack([np.cos(angles), np.sin(angles)], axis=1)


def _support(kind: SupportKind, places: Spots, direction: Float[np.ndarray, "2"]) -> Support:
    return Support(kind, places, np.tile(direction, (len(places), 1)))
