"""Descriptors of a frame: displacements, turns, forces, moments, curvature, reactions, efforts."""

import re
from collections.abc import Callable

import numpy as np

from equimorph.arrays import Lanes, Parameters, Values
from equimorph.errors import InputError, suggestion
from equimorph.model import Descriptor, position
from equimorph.structures.frame.fields import FrameFields
from equimorph.structures.frame.member import AXES

WRITTEN = (
    *("displacement(joint,axis)", "rotation(joint)", "rotation(member,joint)"),
    *("axial(member,joint)", "shear(member,joint)", "moment(member,joint)"),
    *("max_curvature(member)", "max_curvature", "reaction(joint,axis)"),
    *("travel(load)", "effort(actuator)", "energy"),
)
CONJUGATE = {
    "force": "length",
    "force/length": "length²",
    "force·length": "rad",
    "1/length": "force·length²",
    "length": "force",
    "rad": "force·length",
    "1": "force·length",
}
"""Units of efforts and travels by the unit of their parameter."""
_CALL = re.compile(r"(\w+)(?:\(([\w-]+)(?:,([\w-]+))?\))?")


def _make(
    frame: FrameFields, name: str, unit: str, value: Callable[[Lanes, Parameters], Values]
) -> Descriptor:
    return Descriptor(name, frame.model.system.label(unit), value, name, frame.signature)


def displacement(frame: FrameFields, joint: str, axis: str) -> Descriptor:
    """Move of a joint along x or y, from where it is drawn."""
    at = frame.model.network.joint(joint)
    if axis not in AXES[:2]:
        raise InputError(f"`axis` must be x or y; got {axis!r}. Turns are rotation({joint}).")
    along, unit = AXES.index(axis), frame.model.length

    def value(z: Lanes, p: Parameters) -> Values:
        return np.asarray(unit * frame.displacements(z, p)[:, at, along])

    name = f"displacement({joint},{axis})"
    label = frame.model.system.label("length")
    return Descriptor(name, label, value, f"u_{axis}({joint})", frame.signature)


def rotation(frame: FrameFields, where: str, joint: str | None = None) -> Descriptor:
    """Turn of a joint, or of the end of a member there, in radians."""
    made = frame.model.network
    if joint is not None:
        member, side = made.end(where, joint)
        node, name = (
            frame.model.member_nodes[member, -side],
            f"rotation({made.members[member].name},{joint})",
        )
    else:
        node, name = frame.model.joint_nodes[made.joint(where)], f"rotation({where})"
        if node < 0:
            raise InputError(
                f"`rotation({where})` must be of a joint where a member is not hinged; name a "
                f"member: rotation(member,{where})."
            )

    def value(z: Lanes, p: Parameters) -> Values:
        return frame.turns(z, frame.scalars(z, p))[:, node].copy()

    return _make(frame, name, "rad", value)


def end_force(frame: FrameFields, kind: str, member: str, joint: str) -> Descriptor:
    """Axial force (tension is positive) or shear force in a member at a joint.

    Shear is the force across the member, to its left, of what lies beyond the cross-section toward
    the member's end on what lies before.
    """
    at, side = frame.model.network.end(member, joint)
    unit = frame.model.bending / frame.model.length**2
    node = frame.model.member_nodes[at, -side]
    point = at * frame.model.mesh.element_nodes.size
    point += side * (frame.model.mesh.element_nodes.size - 1)

    def value(z: Lanes, p: Parameters) -> Values:
        angle = frame.turns(z, frame.scalars(z, p))[:, node] + frame.model.directions[point]
        x, y = frame.end_forces(z, p)[:, at, side].T
        along = x * np.cos(angle) + y * np.sin(angle)
        return np.asarray(
            unit * (along if kind == "axial" else y * np.cos(angle) - x * np.sin(angle))
        )

    name = frame.model.network.members[at].name
    return _make(frame, f"{kind}({name},{joint})", "force", value)


def moment(frame: FrameFields, member: str, joint: str) -> Descriptor:
    """Bending moment in a member at a joint, positive where it bends to its left."""
    at, side = frame.model.network.end(member, joint)
    unit = frame.model.bending / frame.model.length

    def value(z: Lanes, p: Parameters) -> Values:
        return np.asarray(unit * frame.end_moments(z, p)[:, at, side])

    name = frame.model.network.members[at].name
    return _make(frame, f"moment({name},{joint})", "force·length", value)


def max_curvature(frame: FrameFields, member: str | None = None) -> Descriptor:
    """Largest |κ| in a member, or in all of them."""
    members = slice(None)
    name = "max_curvature"
    if member is not None:
        at = frame.model.network.member(member)[0]
        members = slice(at, at + 1)
        name = f"max_curvature({frame.model.network.members[at].name})"

    def value(z: Lanes, p: Parameters) -> Values:
        largest = frame.largest_curvatures(z, p)[:, members]
        return np.asarray(largest.max(axis=1) / frame.model.length)

    symbol = "max |κ|" if member is None else name
    label = frame.model.system.label("1/length")
    return Descriptor(name, label, value, symbol, frame.signature)


def reaction(frame: FrameFields, joint: str, axis: str) -> Descriptor:
    """Force, or couple, of a support on its joint."""
    at, along = frame.model.network.support_place(joint, axis)
    force = frame.model.bending / frame.model.length**2

    def value(z: Lanes, p: Parameters) -> Values:
        if along == 2:
            return np.asarray(force * frame.model.length * frame.couples(z, p)[:, at])
        return np.asarray(force * frame.reactions(z, p)[:, at, along])

    unit = "force·length" if along == 2 else "force"
    return _make(frame, f"reaction({joint},{axis})", unit, value)


def effort(frame: FrameFields, parameter: str, sign: float = 1.0) -> Descriptor:
    """∂E/∂p of a parameter, or minus that."""
    at = position(frame.parameters, parameter)
    unit = frame.model.bending / frame.model.length
    label = CONJUGATE[frame.model.patterns.unit(at)]
    name = f"{'effort' if sign > 0.0 else 'travel'}({parameter})"

    def value(z: Lanes, p: Parameters) -> Values:
        return np.asarray(sign * unit * frame.effort(z, p)[:, at])

    return _make(frame, name, label, value)


def travel(frame: FrameFields, load: str) -> Descriptor:
    """Displacement along a load: the work per unit of its parameter."""
    if frame.parameters[position(frame.parameters, load)].role != "load":
        raise InputError(f"`travel({load})` must be that of a load; got an actuator.")
    return effort(frame, load, -1.0)


def total_energy(frame: FrameFields) -> Descriptor:
    """Energy of the frame and its loads."""
    unit = frame.model.bending / frame.model.length

    def value(z: Lanes, p: Parameters) -> Values:
        return np.asarray(unit * frame.energy(z, p))

    label = frame.model.system.label("force·length")
    return Descriptor("energy", label, value, "E", frame.signature)


def elevation(frame: FrameFields) -> Descriptor:
    """The travel of the first load, or the turn of the first joint that can."""
    for parameter in frame.parameters:
        if parameter.role == "load":
            return travel(frame, parameter.name)
    model = frame.model
    free = [j for j, node in enumerate(model.joint_nodes) if node >= 0 and model.place[node] >= 0]
    if free:
        return rotation(frame, model.network.joints[free[0]])
    return total_energy(frame)


def descriptor_from_text(frame: FrameFields, text: str) -> Descriptor:
    """Descriptor written like ``displacement(B,y)`` or ``moment(A-B,A)``."""
    found = _CALL.fullmatch(re.sub(r"\s", "", text))
    name, *given = found.groups() if found else ("", None, None)
    arguments = [each for each in given if each is not None]
    makers: dict[tuple[str, int], Callable[..., Descriptor]] = {
        ("displacement", 2): displacement,
        ("rotation", 1): rotation,
        ("rotation", 2): rotation,
        ("moment", 2): moment,
        ("max_curvature", 0): max_curvature,
        ("max_curvature", 1): max_curvature,
        ("reaction", 2): reaction,
        ("travel", 1): travel,
        ("effort", 1): effort,
        ("energy", 0): total_energy,
    }
    if name in {"axial", "shear"} and len(arguments) == 2:
        return end_force(frame, name, *arguments)
    maker = makers.get((name, len(arguments)))
    if maker is None:
        raise InputError(
            f"`descriptor` must be one of {', '.join(WRITTEN)}; got {text!r}."
            f"{suggestion(text, WRITTEN)}"
        )
    return maker(frame, *arguments)
