"""Descriptors of a frame in space: moves, turns, forces, moments, curvature, reactions, efforts."""

import re
from collections.abc import Callable

import numpy as np

from equimorph.arrays import Lanes, Parameters, Values
from equimorph.errors import InputError, suggestion
from equimorph.model import Descriptor, position
from equimorph.structures.space_frame.fields import SpatialFrameFields

AXES = ("x", "y", "z")
SECTION = ("t", "n", "b")
WRITTEN = (
    *("displacement(joint,axis)", "place(joint,axis)", "rotation(joint,axis)"),
    *("force(member,joint,t)", "moment(member,joint,b)", "hinge(member,joint)"),
    *("max_curvature(member)", "max_curvature", "reaction(joint,axis)", "couple(joint,axis)"),
    *("travel(load)", "effort(actuator)", "energy"),
)
CONJUGATE = {
    **{"force": "length", "force/length": "length²", "1/length": "force·length²"},
    **{"length": "force", "rad": "force·length", "1": "force·length"},
}
"""Units of efforts and travels by the unit of their parameter."""
_CALL = re.compile(r"(\w+)(?:\(([\w-]+)(?:,([\w-]+))?(?:,([\w-]+))?\))?")
Function = Callable[[Lanes, Parameters], Values]


def _make(frame: SpatialFrameFields, name: str, unit: str, value: Function) -> Descriptor:
    return Descriptor(name, frame.model.system.label(unit), value, name, frame.signature)


def _axis(given: str, among: tuple[str, ...]) -> int:
    if given not in among:
        raise InputError(f"`axis` must be one of {', '.join(among)}; got {given!r}.")
    return among.index(given)


def displacement(frame: SpatialFrameFields, joint: str, axis: str) -> Descriptor:
    """Move of a joint along an axis, from where it is drawn."""
    at, along, unit = frame.model.network.joint(joint), _axis(axis, AXES), frame.model.length

    def value(z: Lanes, p: Parameters) -> Values:
        return np.asarray(unit * frame.displacements(z, p)[:, at, along])

    name, label = f"displacement({joint},{axis})", frame.model.system.label("length")
    return Descriptor(name, label, value, f"u_{axis}({joint})", frame.signature)


def place(frame: SpatialFrameFields, joint: str, axis: str) -> Descriptor:
    """Coordinate of a joint."""
    moved = displacement(frame, joint, axis)
    drawn = float(frame.model.network.places[frame.model.network.joint(joint), AXES.index(axis)])

    def value(z: Lanes, p: Parameters) -> Values:
        return np.asarray(drawn + moved.function(z, p))

    return Descriptor(
        f"place({joint},{axis})", moved.unit, value, f"{axis}({joint})", frame.signature
    )


def rotation(frame: SpatialFrameFields, joint: str, axis: str) -> Descriptor:
    """Component of the rotation vector of a joint, in radians; its size is at most π."""
    made, along = frame.model.network, _axis(axis, AXES)
    at = made.joint(joint)
    if made.body_of_joint[at] < 0:
        raise InputError(
            f"`rotation({joint},{axis})` must be of a joint to which a member is rigidly joined."
        )

    def value(z: Lanes, p: Parameters) -> Values:
        return frame.turns_of_joints(z, p)[:, at, along].copy()

    return _make(frame, f"rotation({joint},{axis})", "rad", value)


def hinge(frame: SpatialFrameFields, member: str, joint: str) -> Descriptor:
    """Angle of the hinge of a member at a joint, in radians."""
    made = frame.model.network
    at, side = made.end(member, joint)
    node = int(made.body_of_end[at, side])
    found = np.flatnonzero(frame.model.hinged == node)
    if not len(found):
        raise InputError(
            f"`hinge({member},{joint})` must be of a member that is hinged about an axis; got none."
        )
    column = 4 * len(frame.model.free) + int(found[0])

    def value(z: Lanes, p: Parameters) -> Values:
        del p
        return z[:, column].copy()

    return _make(frame, f"hinge({made.edge_names[at]},{joint})", "rad", value)


def force(frame: SpatialFrameFields, member: str, joint: str, axis: str) -> Descriptor:
    """Force in a member at a joint along its tangent t (tension is positive), normal or binormal.

    It is the force of what lies beyond the cross-section, towards the member's end.
    """
    return _at_end(frame, "force", (member, joint, axis))


def moment(frame: SpatialFrameFields, member: str, joint: str, axis: str) -> Descriptor:
    """Moment in a member at a joint about its tangent t (torque), normal or binormal."""
    return _at_end(frame, "moment", (member, joint, axis))


def _at_end(frame: SpatialFrameFields, kind: str, where: tuple[str, str, str]) -> Descriptor:
    """A component of the force or moment at the end of a piece; where: member, joint, axis."""
    made, mesh = frame.model.network, frame.model.mesh
    at, side = made.end(*where[:2])
    along = _axis(where[2], SECTION)
    element, node = (at + side) * mesh.elements - side, -side
    unit = frame.model.bending / frame.model.length ** (2 if kind == "force" else 1)

    def value(z: Lanes, p: Parameters) -> Values:
        axis = frame.cross_sections(z, p)[:, element, node, :, along]
        if kind == "force":
            vector = frame.end_forces(z, p)[:, at, side]
        else:
            vector = frame.moments(z, p)[:, element, node]
        return np.asarray(unit * (vector * axis).sum(axis=1))

    name = f"{kind}({made.edge_names[at]},{where[1]},{where[2]})"
    return _make(frame, name, "force" if kind == "force" else "force·length", value)


def max_curvature(frame: SpatialFrameFields, member: str | None = None) -> Descriptor:
    """Largest bending curvature in a member, or in all of them."""
    pieces, name = list(range(frame.model.pieces)), "max_curvature"
    if member is not None:
        pieces = [at for at, _ in frame.model.network.pieces_of(member)]
        name = f"max_curvature({member})"

    def value(z: Lanes, p: Parameters) -> Values:
        largest = frame.largest_curvatures(z, p)[:, pieces]
        return np.asarray(largest.max(axis=1) / frame.model.length)

    symbol, label = "max |κ|" if member is None else name, frame.model.system.label("1/length")
    return Descriptor(name, label, value, symbol, frame.signature)


def reaction(frame: SpatialFrameFields, joint: str, axis: str) -> Descriptor:
    """Force of a support on its joint along an axis."""
    at, along = frame.model.network.joint(joint), _axis(axis, AXES)
    if not len(frame.model.network.supports[at].directions):
        raise InputError(f"`{joint}` must be held or sprung by a support; it is free.")
    unit = frame.model.bending / frame.model.length**2

    def value(z: Lanes, p: Parameters) -> Values:
        return np.asarray(unit * frame.reactions(z, p)[:, at, along])

    return _make(frame, f"reaction({joint},{axis})", "force", value)


def couple(frame: SpatialFrameFields, joint: str, axis: str) -> Descriptor:
    """Couple of a support on its joint about an axis."""
    at, along = frame.model.network.joint(joint), _axis(axis, AXES)
    frame.model.network.held_body(joint)
    unit = frame.model.bending / frame.model.length

    def value(z: Lanes, p: Parameters) -> Values:
        return np.asarray(unit * frame.couples(z, p)[:, at, along])

    return _make(frame, f"couple({joint},{axis})", "force·length", value)


def effort(frame: SpatialFrameFields, parameter: str, sign: float = 1.0) -> Descriptor:
    """∂E/∂p of a parameter, or minus that."""
    at = position(frame.parameters, parameter)
    unit = frame.model.bending / frame.model.length
    label = CONJUGATE[frame.model.patterns.unit(at)]
    name = f"{'effort' if sign > 0.0 else 'travel'}({parameter})"

    def value(z: Lanes, p: Parameters) -> Values:
        return np.asarray(sign * unit * frame.effort(z, p)[:, at])

    return _make(frame, name, label, value)


def travel(frame: SpatialFrameFields, load: str) -> Descriptor:
    """Displacement along a load: the work per unit of its parameter."""
    if frame.parameters[position(frame.parameters, load)].role != "load":
        raise InputError(f"`travel({load})` must be that of a load; got an actuator.")
    return effort(frame, load, -1.0)


def total_energy(frame: SpatialFrameFields) -> Descriptor:
    """Energy of the frame and its loads."""
    unit = frame.model.bending / frame.model.length

    def value(z: Lanes, p: Parameters) -> Values:
        return np.asarray(unit * frame.energy(z, p))

    label = frame.model.system.label("force·length")
    return Descriptor("energy", label, value, "E", frame.signature)


def elevation(frame: SpatialFrameFields) -> Descriptor:
    """The travel of the first load, or the energy."""
    for parameter in frame.parameters:
        if parameter.role == "load":
            return travel(frame, parameter.name)
    return total_energy(frame)


def descriptor_from_text(frame: SpatialFrameFields, text: str) -> Descriptor:
    """Descriptor written like ``displacement(B,z)`` or ``moment(A-B,A,t)``."""
    found = _CALL.fullmatch(re.sub(r"\s", "", text))
    name, *given = found.groups() if found else ("", None, None, None)
    arguments = [each for each in given if each is not None]
    makers: dict[tuple[str, int], Callable[..., Descriptor]] = {
        ("displacement", 2): displacement,
        ("place", 2): place,
        ("rotation", 2): rotation,
        ("hinge", 2): hinge,
        ("force", 3): force,
        ("moment", 3): moment,
        ("max_curvature", 0): max_curvature,
        ("max_curvature", 1): max_curvature,
        ("reaction", 2): reaction,
        ("couple", 2): couple,
        ("travel", 1): travel,
        ("effort", 1): effort,
        ("energy", 0): total_energy,
    }
    maker = makers.get((name, len(arguments)))
    if maker is None:
        raise InputError(
            f"`descriptor` must be one of {', '.join(WRITTEN)}; got {text!r}."
            f"{suggestion(text, WRITTEN)}"
        )
    return maker(frame, *arguments)
