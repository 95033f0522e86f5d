"""Symbols of the supports of a frame in space."""

import numpy as np

from equimorph.array_types import Float
from equimorph.model import Support, SupportKind
from equimorph.structures.space_frame.network import SpatialNetwork
from equimorph.structures.space_frame.supports import SpatialSupport


def spatial_symbols(
    made: SpatialNetwork, places: Float[np.ndarray, "lanes joints 3"]
) -> tuple[Support, ...]:
    """Symbols of the supports, at places of the joints."""
    found: list[Support] = []
    for joint, support in enumerate(made.supports):
        if support.data:
            found += _symbols(support, places[:, joint], _inward(made, joint))
    return tuple(found)


def _symbols(
    support: SpatialSupport, places: Float[np.ndarray, "lanes 3"], inward: Float[np.ndarray, "3"]
) -> list[Support]:
    """Symbols of one support."""
    hard = support.directions[np.isinf(support.stiffness)]
    turns, found = not support.holds_rotation, []

    def symbol(kind: SupportKind, direction: Float[np.ndarray, "3"]) -> Support:
        return Support(kind, places, np.tile(direction, (len(places), 1)))

    if len(hard) == 3:
        found.append(symbol(SupportKind.PIN if turns else SupportKind.CLAMP, inward))
    elif len(hard):
        sliding = np.linalg.svd(hard)[2][-1]
        found.append(symbol(SupportKind.ROLLER if turns else SupportKind.SLEEVE, sliding))
    elif not turns:
        found.append(symbol(SupportKind.GRIP, inward))
    for direction, stiff in zip(support.directions, support.stiffness, strict=True):
        if np.isfinite(stiff):
            found.append(symbol(SupportKind.SPRING, direction))
    return found


def _inward(made: SpatialNetwork, joint: int) -> Float[np.ndarray, "3"]:
    """Mean direction from a joint into its members, as drawn."""
    total = np.zeros(3)
    for (start, end), chord in zip(made.ends, made.chords, strict=True):
        unit = chord / np.linalg.norm(chord)
        total += unit * (start == joint) - unit * (end == joint)
    size = float(np.linalg.norm(total))
    return total / size if size > 1e-9 else np.array([1.0, 0.0, 0.0])
