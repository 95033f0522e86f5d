"""What to draw at the ends of a rod in space."""

import numpy as np

from equimorph.array_types import Float
from equimorph.model import Support, SupportKind
from equimorph.structures.rod.centreline import Centreline
from equimorph.structures.rod.ends import HELD
from equimorph.structures.spatial.ends import AXES, Ends, SpatialEnd

Spots = Float[np.ndarray, "lanes 3"]


def spatial_supports(ends: Ends, line: Centreline) -> tuple[Support, ...]:
    """Supports of both ends; `line` is the centreline there."""
    found: list[Support] = []
    for side, end in enumerate(ends):
        inward = (1.0 - 2.0 * side) * line.tangents[:, side]
        found += _supports_of(end, line.places[:, side], inward)
    return tuple(found)


def _supports_of(end: SpatialEnd, places: Spots, inward: Spots) -> list[Support]:
    """Symbols of one end."""
    along = [end.along(axis) for axis in AXES]
    held = np.array([each == HELD for each in along])
    found = []

    def towards(axis: int) -> Spots:
        return np.tile(np.eye(3)[axis], (len(places), 1))

    if held.all():
        kind = SupportKind.PIN if end.turns else SupportKind.CLAMP
        found.append(Support(kind, places, inward))
    elif held.any():
        kind = SupportKind.ROLLER if end.turns else SupportKind.SLEEVE
        found.append(Support(kind, places, towards(int(np.argmin(held)))))
    elif not end.turns:
        found.append(Support(SupportKind.GRIP, places, inward))
    for axis, each in enumerate(along):
        if not isinstance(each, str):
            found.append(Support(SupportKind.SPRING, places, towards(axis)))
    return found
