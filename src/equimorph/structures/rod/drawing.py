"""What to draw around a rod: its supports, loads, tendons and bending segments."""

from collections.abc import Sequence

import numpy as np

from equimorph.arrays import Float, Lanes, Parameters, Values
from equimorph.model import Actuator, ActuatorKind, Couples, Drawing, Forces, Support as Symbol
from equimorph.model.drawing import supports_of_point
from equimorph.structures.rod.any_rod import AnyRod
from equimorph.structures.rod.centreline import Centreline, Vectors
from equimorph.structures.rod.ends import Support, stiffness
from equimorph.structures.rod.terms import (
    Couple,
    Curvature,
    LineLoad,
    PointForce,
    Pressure,
    Tendon,
    Term,
)

STATIONS = np.linspace(0.05, 0.95, 13)
"""Arclengths at which line loads are drawn."""
SEGMENT = 33
"""Points along a tendon or a bending segment."""
ENDS = np.array([0.0, 1.0])
"""Arclengths of the supports."""

Amplitudes = Sequence[tuple[Term, Values]]


def rod_drawing(
    rod: AnyRod, supports: tuple[Symbol, ...], amplitudes: Amplitudes, z: Lanes, p: Parameters
) -> Drawing:
    """Forces and couples where they act, actuators along the rod, and the supports.

    `amplitudes` are all terms of the rod with their values in each state.
    """
    forces: list[Forces] = []
    couples: list[Couples] = []
    lines = [each for each in amplitudes if isinstance(each[0], LineLoad | Pressure)]
    if lines:
        line = rod.centreline(z, p, STATIONS)
        total = sum((_per_length(*each, line) for each in lines), np.zeros_like(line.places))
        forces.append(Forces(line.places, total, distributed=True))
    points = [(term, size) for term, size in amplitudes if isinstance(term, PointForce)]
    if points:
        places = rod.places(z, p, np.array([float(term.s) for term, _ in points]))
        axes = places.shape[2]
        pushes = [size[:, None] * _direction(term, axes) for term, size in points]
        forces.append(Forces(places, np.stack(pushes, axis=1)))
    turns = [(term, size) for term, size in amplitudes if isinstance(term, Couple)]
    if turns:
        places = rod.places(z, p, np.array([float(term.s) for term, _ in turns]))
        couples.append(Couples(places, np.stack([size for _, size in turns], axis=1)))
    actuators = tuple(
        _actuator(rod, term, z, p) for term, _ in amplitudes if isinstance(term, Curvature | Tendon)
    )
    return Drawing(supports, tuple(forces), tuple(couples), actuators)


def rod_supports(ends: tuple[Support, Support], line: Centreline) -> tuple[Symbol, ...]:
    """Symbols of both ends; `line` is the centreline at `ENDS`."""
    found: list[Symbol] = []
    for side, end in enumerate(ends):
        inward = (1.0 - 2.0 * side) * line.tangents[:, side]
        places, turning = line.places[:, side], stiffness(end.turning)
        found += supports_of_point(*end.along_directions, turning, places, inward)
    return tuple(found)


def _direction(term: LineLoad | PointForce, axes: int) -> Float[np.ndarray, " axes"]:
    """Direction of a load, of two or three numbers, along two or three axes."""
    given = np.array(term.direction, float)
    return np.append(given, np.zeros(3 - len(given)))[:axes]


def _per_length(term: Term, size: Values, line: Centreline) -> Vectors:
    """Force per arclength at the `STATIONS`."""
    push = line.normals[:, :, 0]
    if isinstance(term, LineLoad):
        density = term.density().density(STATIONS)[:, None]
        push = np.zeros_like(push) + density * _direction(term, push.shape[2])
    return np.asarray(size[:, None, None] * push)


def _actuator(rod: AnyRod, term: Curvature | Tendon, z: Lanes, p: Parameters) -> Actuator:
    s = np.linspace(term.start, term.stop, SEGMENT)
    line = rod.centreline(z, p, s)
    if isinstance(term, Curvature):
        return Actuator(ActuatorKind.CURVATURE, line.places)
    cable = line.places
    for k, offset in enumerate(term.profiles()[: line.normals.shape[2]]):
        cable = cable + offset.density(s)[:, None] * line.normals[:, :, k]
    return Actuator(ActuatorKind.CABLE, cable)
