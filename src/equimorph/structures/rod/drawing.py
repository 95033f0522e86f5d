"""What to draw around a rod: its supports, loads, tendons and bending segments."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from equimorph.arrays import Lanes, Parameters, Values
from equimorph.model import Actuator, ActuatorKind, Couples, Drawing, Forces, Support
from equimorph.model.drawing import supports_of_point, unit_vectors
from equimorph.structures.rod.ends import FREE, HELD, End, Holding
from equimorph.structures.rod.measured import Measured
from equimorph.structures.rod.profiles import profile
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

Amplitudes = Sequence[tuple[Term, Values]]


def rod_drawing(
    rod: Measured, ends: tuple[End, End], amplitudes: Amplitudes, z: Lanes, p: Parameters
) -> Drawing:
    """Supports at the ends, forces and couples where they act, actuators along the rod.

    `amplitudes` are all terms of the rod with their values in each state.
    """
    forces: list[Forces] = []
    couples: list[Couples] = []
    lines = [each for each in amplitudes if isinstance(each[0], LineLoad | Pressure)]
    if lines:
        places, normals = _along(rod, z, p, STATIONS)
        total = sum((_per_length(*each, normals) for each in lines), np.zeros_like(places))
        forces.append(Forces(places, total, distributed=True))
    points = [(term, size) for term, size in amplitudes if isinstance(term, PointForce)]
    if points:
        places = rod.shape(z, p, np.array([float(term.s) for term, _ in points]))
        pushes = [size[:, None] * np.array(term.direction)[:2] for term, size in points]
        forces.append(Forces(places, np.stack(pushes, axis=1)))
    turns = [(term, size) for term, size in amplitudes if isinstance(term, Couple)]
    if turns:
        places = rod.shape(z, p, np.array([float(term.s) for term, _ in turns]))
        couples.append(Couples(places, np.stack([size for _, size in turns], axis=1)))
    actuators = tuple(
        _actuator(rod, term, z, p) for term, _ in amplitudes if isinstance(term, Curvature | Tendon)
    )
    return Drawing(_supports(rod, ends, z, p), tuple(forces), tuple(couples), actuators)


def _supports(rod: Measured, ends: tuple[End, End], z: Lanes, p: Parameters) -> tuple[Support, ...]:
    fields = rod.fields(z, p, np.array([0.0, 1.0]))
    found: list[Support] = []
    for side, end in enumerate(ends):
        stiffness = np.array([_stiffness(each) for each in (end.x, end.y, end.angle)])
        inward = (1.0 - 2.0 * side) * unit_vectors(fields[:, side, 0])
        found += supports_of_point(stiffness, fields[:, side, 2:], inward, end.slide)
    return tuple(found)


def _stiffness(holding: Holding) -> float:
    return {HELD: np.inf, FREE: 0.0}[holding] if isinstance(holding, str) else holding


def _along(
    rod: Measured, z: Lanes, p: Parameters, s: Float[np.ndarray, " points"]
) -> tuple[Float[np.ndarray, "lanes points 2"], Float[np.ndarray, "lanes points 2"]]:
    """Places at arclengths, and unit normals to the left."""
    fields = rod.fields(z, p, s)
    angles = fields[:, :, 0]
    return fields[:, :, 2:], np.stack([-np.sin(angles), np.cos(angles)], axis=2)


def _per_length(
    term: Term, size: Values, normals: Float[np.ndarray, "lanes points 2"]
) -> Float[np.ndarray, "lanes points 2"]:
    """Force per arclength at the `STATIONS`."""
    if isinstance(term, LineLoad):
        normals = term.density().density(STATIONS)[:, None] * np.array(term.direction)[:2]
    return np.asarray(size[:, None, None] * normals)


def _actuator(rod: Measured, term: Curvature | Tendon, z: Lanes, p: Parameters) -> Actuator:
    s = np.linspace(term.start, term.stop, SEGMENT)
    places, normals = _along(rod, z, p, s)
    if isinstance(term, Curvature):
        return Actuator(ActuatorKind.CURVATURE, places)
    offset = profile(term.offset, "offset", term.kinks).density(s)
    return Actuator(ActuatorKind.CABLE, places + offset[:, None] * normals)
