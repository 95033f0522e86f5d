"""What to draw around a frame: supports, loads, and members that bend or lengthen."""

import numpy as np
from jaxtyping import Float

from equimorph.arrays import Lanes, Parameters
from equimorph.linalg.dense import multiply
from equimorph.model import Actuator, ActuatorKind, Couples, Drawing, Forces, Support
from equimorph.model.drawing import supports_of_point, unit_vectors
from equimorph.structures.frame.fields import FrameFields

STATIONS = np.linspace(0.0, 1.0, 9)
"""Shares of a member's length at which its line load is drawn."""
SEGMENT = np.linspace(0.0, 1.0, 17)
"""Shares of a member's length at which it is drawn if an actuator works in it."""


def frame_drawing(frame: FrameFields, z: Lanes, p: Parameters) -> Drawing:
    """Supports and forces at joints and along members, in the user's units."""
    model, given = frame.model, frame.model.patterns
    length, force = model.length, model.bending / model.length**2
    places = model.network.places + length * frame.displacements(z, p)
    lines = np.flatnonzero(given.lines.any(axis=(0, 2)))
    loaded = np.flatnonzero(given.forces.any(axis=(0, 2)))
    turned = np.flatnonzero(given.couples.any(axis=0))
    forces: list[Forces] = []
    couples: list[Couples] = []
    if len(lines):
        along = length * frame.outline(z, p, STATIONS)[:, lines]
        density = np.einsum("lk,kma->lma", p, given.lines[:, lines]) * force / length
        vectors = np.repeat(density[:, :, None], len(STATIONS), axis=2)
        members = range(len(lines))
        forces += [Forces(along[:, m], vectors[:, m], distributed=True) for m in members]
    if len(loaded):
        vectors = force * np.einsum("lk,kja->lja", p, given.forces[:, loaded])
        forces.append(Forces(places[:, loaded], vectors))
    if len(turned):
        moments = force * length * multiply(p, given.couples[:, turned])
        couples.append(Couples(places[:, turned], moments))
    supports = _supports(frame, z, p, places)
    return Drawing(supports, tuple(forces), tuple(couples), _actuators(frame, z, p))


def _supports(
    frame: FrameFields, z: Lanes, p: Parameters, places: Float[np.ndarray, "lanes joints 2"]
) -> tuple[Support, ...]:
    made, turns = frame.model.network, _turns(frame, z, p)
    found: list[Support] = []
    for joint, stiffness in enumerate(made.supports):
        if stiffness.any():
            inward = unit_vectors(turns[:, joint] + _inward_angle(frame, joint))
            found += supports_of_point(stiffness, places[:, joint], inward)
    return tuple(found)


def _turns(frame: FrameFields, z: Lanes, p: Parameters) -> Float[np.ndarray, "lanes joints"]:
    """Turns of the joints; 0 where all members are hinged."""
    nodes = frame.model.joint_nodes
    return np.where(nodes >= 0, frame.turns(z, frame.scalars(z, p))[:, nodes], 0.0)


def _inward_angle(frame: FrameFields, joint: int) -> float:
    """Mean direction from a joint into its members, as drawn."""
    model = frame.model
    tangents = model.tangents.reshape(len(model.lengths), -1, 2)
    total = np.zeros(2)
    for (start, end), tangent in zip(model.network.ends, tangents, strict=True):
        total += tangent[0] * (start == joint) - tangent[-1] * (end == joint)
    return float(np.arctan2(total[1], total[0]))


def _actuators(frame: FrameFields, z: Lanes, p: Parameters) -> tuple[Actuator, ...]:
    given, lines = frame.model.patterns, frame.model.length * frame.outline(z, p, SEGMENT)
    kinds = ((ActuatorKind.LENGTH, given.length), (ActuatorKind.CURVATURE, given.curvature))
    return tuple(
        Actuator(kind, lines[:, member])
        for kind, effects in kinds
        for member in np.flatnonzero(effects.any(axis=0))
    )
