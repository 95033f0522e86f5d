"""What to draw around a rod in space: its supports, loads, tendons and bending segments."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from equimorph.arrays import Lanes, Parameters, Values
from equimorph.model import Actuator, ActuatorKind, Drawing, Forces, Support, SupportKind
from equimorph.structures.rod.drawing import SEGMENT, STATIONS
from equimorph.structures.rod.ends import HELD
from equimorph.structures.rod.terms import Curvature, LineLoad, PointForce, Tendon, Term
from equimorph.structures.spatial.effects import direction_in_space
from equimorph.structures.spatial.ends import AXES, Ends, SpatialEnd
from equimorph.structures.spatial.fields import SpatialFields

Amplitudes = Sequence[tuple[Term, Values]]
Spots = Float[np.ndarray, "lanes 3"]


class RodDrawing:
    """Draws the states of one rod; lengths in the user's unit."""

    def __init__(self, fields: SpatialFields, ends: Ends, length: float) -> None:
        self.fields, self.ends, self.length = fields, ends, length

    def __call__(self, amplitudes: Amplitudes, z: Lanes, p: Parameters) -> Drawing:
        """Supports at the ends, forces where they act, actuators along the rod."""
        forces: list[Forces] = []
        lines = [(term, size) for term, size in amplitudes if isinstance(term, LineLoad)]
        if lines:
            total = sum((_per_length(*each) for each in lines), np.zeros((len(z), 1, 3)))
            places = self._places(z, p, STATIONS)
            forces.append(Forces(places, total + np.zeros_like(places), distributed=True))
        points = [(term, size) for term, size in amplitudes if isinstance(term, PointForce)]
        if points:
            places = self._places(z, p, np.array([float(term.s) for term, _ in points]))
            pushes = [size[:, None] * direction_in_space(term.direction) for term, size in points]
            forces.append(Forces(places, np.stack(pushes, axis=1)))
        actuators = tuple(
            self._actuator(term, z, p)
            for term, _ in amplitudes
            if isinstance(term, Curvature | Tendon)
        )
        return Drawing(self._supports(z, p), tuple(forces), (), actuators)

    def _places(
        self, z: Lanes, p: Parameters, s: Float[np.ndarray, " points"]
    ) -> Float[np.ndarray, "lanes points 3"]:
        return self.length * self.fields.at(z, p, s).places

    def _supports(self, z: Lanes, p: Parameters) -> tuple[Support, ...]:
        fields = self.fields.at(z, p, np.array([0.0, 1.0]))
        places, tangents = self.length * fields.places, fields.frames[..., 0]
        found: list[Support] = []
        for side, end in enumerate(self.ends):
            inward = (1.0 - 2.0 * side) * tangents[:, side]
            found += _supports_of(end, places[:, side], inward)
        return tuple(found)

    def _actuator(self, term: Curvature | Tendon, z: Lanes, p: Parameters) -> Actuator:
        s = np.linspace(term.start, term.stop, SEGMENT)
        fields = self.fields.at(z, p, s)
        places = self.length * fields.places
        if isinstance(term, Curvature):
            return Actuator(ActuatorKind.CURVATURE, places)
        left, aside = (each.density(s)[:, None] for each in term.profiles())
        frames = fields.frames
        return Actuator(ActuatorKind.CABLE, places + left * frames[..., 1] + aside * frames[..., 2])


def _per_length(term: LineLoad, size: Values) -> Float[np.ndarray, "lanes points 3"]:
    """Force per arclength at the `STATIONS`."""
    shape = term.density().density(STATIONS)[:, None] * direction_in_space(term.direction)
    return np.asarray(size[:, None, None] * shape)


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
