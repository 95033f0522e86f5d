"""Descriptors of a frame in space as methods."""

from collections.abc import Mapping
from typing import ClassVar

import numpy as np

from equimorph.argument_checks import check_arguments
from equimorph.arrays import Lanes, Parameters, Values
from equimorph.errors import InputError
from equimorph.model import Descriptor, remember_call
from equimorph.structures.space_frame.fields import SpatialFrameFields

SECTION = ("t", "n", "b")


class DescribedSpatialFrame(SpatialFrameFields):
    """A frame in space with its descriptors, in the user's units."""

    written: ClassVar[Mapping[str, str]] = {
        "displacement(joint,axis)": "displacement",
        "place(joint,axis)": "place",
        "rotation(joint,axis)": "rotation",
        "force(member,joint,t)": "force",
        "moment(member,joint,b)": "moment",
        "hinge(member,joint)": "hinge",
        "max_curvature(member)": "member_curvature",
        "max_curvature": "max_curvature",
        "reaction(joint,axis)": "reaction",
        "couple(joint,axis)": "couple",
        "travel(load)": "travel",
        "effort(actuator)": "effort_of",
        "energy": "total_energy",
    }

    @check_arguments
    @remember_call
    def place(self, joint: str, axis: str) -> Descriptor:
        """Coordinate x, y or z of a joint."""
        moved, made = self.displacement(joint, axis), self.model.network
        drawn = float(made.places[made.joint(joint), self.axis(axis)])

        def value(z: Lanes, p: Parameters) -> Values:
            return np.asarray(drawn + moved.function(z, p))

        return self._make(f"place({joint},{axis})", "length", value, f"{axis}({joint})")

    @check_arguments
    @remember_call
    def rotation(self, joint: str, axis: str) -> Descriptor:
        """Component of the rotation vector of a joint, in radians; its size is at most π."""
        made, along = self.model.network, self.axis(axis)
        at = made.joint(joint)
        if made.body_of_joint[at] < 0:
            raise InputError(
                f"`rotation({joint},{axis})` must be of a joint to which a member is rigidly "
                "joined."
            )

        def value(z: Lanes, p: Parameters) -> Values:
            return self.turns_of_joints(z, p)[:, at, along].copy()

        return self._make(f"rotation({joint},{axis})", "rad", value)

    @check_arguments
    @remember_call
    def hinge(self, member: str, joint: str) -> Descriptor:
        """Angle of the hinge of a member at a joint, in radians, 0 as drawn."""
        made = self.model.network
        at, side = made.end(member, joint)
        found = np.flatnonzero(self.model.hinged == int(made.body_of_end[at, side]))
        if not len(found):
            raise InputError(
                f"`hinge({member},{joint})` must be of a member that is hinged about an axis; got "
                "none."
            )
        column = 4 * len(self.model.free) + int(found[0])

        def value(z: Lanes, p: Parameters) -> Values:
            del p
            return z[:, column].copy()

        return self._make(f"hinge({made.edge_names[at]},{joint})", "rad", value)

    @check_arguments
    def force(self, member: str, joint: str, axis: str) -> Descriptor:
        """Force in a member at a joint along its tangent "t", normal "n" or binormal "b".

        It is the force of what lies beyond the cross-section, towards the member's end; tension is
        positive.
        """
        return self._at_end("force", member, joint, axis)

    @check_arguments
    def moment(self, member: str, joint: str, axis: str) -> Descriptor:
        """Moment in a member at a joint about its tangent "t", normal "n" or binormal "b"."""
        return self._at_end("moment", member, joint, axis)

    @remember_call
    def _at_end(self, kind: str, member: str, joint: str, axis: str) -> Descriptor:
        made, mesh = self.model.network, self.model.mesh
        at, side = made.end(member, joint)
        if axis not in SECTION:
            raise InputError(f"`axis` must be one of {', '.join(SECTION)}; got {axis!r}.")
        along, element, node = SECTION.index(axis), (at + side) * mesh.elements - side, -side

        def value(z: Lanes, p: Parameters) -> Values:
            unit = self.cross_sections(z, p)[:, element, node, :, along]
            if kind == "force":
                return np.asarray(
                    self.model.force * (self.end_forces(z, p)[:, at, side] * unit).sum(axis=1)
                )
            moments = self.moments(z, p)[:, element, node]
            return np.asarray(self.model.energy * (moments * unit).sum(axis=1))

        name = f"{kind}({made.edge_names[at]},{joint},{axis})"
        return self._make(name, "force" if kind == "force" else "force·length", value)

    @check_arguments
    @remember_call
    def reaction(self, joint: str, axis: str) -> Descriptor:
        """Force of a support on its joint along x, y or z."""
        at, along = self.model.network.joint(joint), self.axis(axis)
        if not len(self.model.network.supports[at].directions):
            raise InputError(f"`{joint}` must be held or sprung by a support; it is free.")

        def value(z: Lanes, p: Parameters) -> Values:
            return np.asarray(self.model.force * self.reactions(z, p)[:, at, along])

        return self._make(f"reaction({joint},{axis})", "force", value)

    @property
    def support_reactions(self) -> tuple[Descriptor, ...]:
        """Forces of all supports, and couples of those that hold a rotation."""
        network = self.model.network
        supports = list(zip(network.joints, network.supports, strict=True))
        held = [joint for joint, each in supports if len(each.directions)]
        turned = [joint for joint, each in supports if each.holds_rotation]
        return (
            *(self.reaction(joint, axis) for joint in held for axis in "xyz"),
            *(self.couple(joint, axis) for joint in turned for axis in "xyz"),
        )

    @check_arguments
    @remember_call
    def couple(self, joint: str, axis: str) -> Descriptor:
        """Couple of a support that holds a rotation, about x, y or z."""
        at, along = self.model.network.joint(joint), self.axis(axis)
        self.model.network.held_body(joint)

        def value(z: Lanes, p: Parameters) -> Values:
            return np.asarray(self.model.energy * self.couples(z, p)[:, at, along])

        return self._make(f"couple({joint},{axis})", "force·length", value)
