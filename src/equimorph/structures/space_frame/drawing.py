"""What to draw around a frame in space: supports, loads, and members that bend or lengthen."""

import numpy as np
from jaxtyping import Float

from equimorph.arrays import Lanes, Parameters
from equimorph.model import Actuator, ActuatorKind, Drawing, Forces, Support, SupportKind
from equimorph.structures.space_frame.fields import SpatialFrameFields
from equimorph.structures.space_frame.supports import SpatialSupport

STATIONS = np.linspace(0.0, 1.0, 3)
"""Shares of a piece's length at which its line load is drawn."""
SEGMENT = np.linspace(0.0, 1.0, 17)
"""Shares of a piece's length at which it is drawn if an actuator works in it."""


def spatial_frame_drawing(frame: SpatialFrameFields, z: Lanes, p: Parameters) -> Drawing:
    """Supports and forces at joints and along members, in the user's units."""
    model, given = frame.model, frame.model.patterns
    length, force = model.length, model.bending / model.length**2
    places = model.network.places + length * frame.displacements(z, p)
    lines = np.flatnonzero(given.lines.any(axis=(0, 2)))
    loaded = np.flatnonzero(given.forces.any(axis=(0, 2)))
    forces: list[Forces] = []
    if len(lines):
        along = length * frame.outline(z, p, STATIONS)[:, lines]
        density = np.einsum("lk,kma->lma", p, given.lines[:, lines]) * force / length
        vectors = np.repeat(density[:, :, None], len(STATIONS), axis=2)
        forces += [Forces(along[:, m], vectors[:, m], distributed=True) for m in range(len(lines))]
    if len(loaded):
        vectors = force * np.einsum("lk,kja->lja", p, given.forces[:, loaded])
        forces.append(Forces(places[:, loaded], vectors))
    return Drawing(_supports(frame, places), tuple(forces), (), _actuators(frame, z, p))


def _supports(
    frame: SpatialFrameFields, places: Float[np.ndarray, "lanes joints 3"]
) -> tuple[Support, ...]:
    made, found = frame.model.network, []
    for joint, support in enumerate(made.supports):
        if support.data:
            found += _symbols(support, places[:, joint], _inward(frame, joint))
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


def _inward(frame: SpatialFrameFields, joint: int) -> Float[np.ndarray, "3"]:
    """Mean direction from a joint into its members, as drawn."""
    made, total = frame.model.network, np.zeros(3)
    for (start, end), chord in zip(made.ends, made.chords, strict=True):
        unit = chord / np.linalg.norm(chord)
        total += unit * (start == joint) - unit * (end == joint)
    size = float(np.linalg.norm(total))
    return total / size if size > 1e-9 else np.array([1.0, 0.0, 0.0])


def _actuators(frame: SpatialFrameFields, z: Lanes, p: Parameters) -> tuple[Actuator, ...]:
    given = frame.model.patterns
    kinds = (
        (ActuatorKind.LENGTH, given.length.any(axis=0)),
        (ActuatorKind.CURVATURE, given.strains.any(axis=(0, 2))),
    )
    if not any(some.any() for _, some in kinds):
        return ()
    lines = frame.model.length * frame.outline(z, p, SEGMENT)
    return tuple(
        Actuator(kind, lines[:, piece]) for kind, some in kinds for piece in np.flatnonzero(some)
    )
