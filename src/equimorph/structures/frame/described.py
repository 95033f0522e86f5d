"""Descriptors of a frame as methods."""

from collections.abc import Mapping
from typing import ClassVar

import numpy as np

from equimorph.argument_checks import check_arguments
from equimorph.arrays import Lanes, Parameters, Values
from equimorph.errors import InputError
from equimorph.model import Descriptor, remember_call
from equimorph.structures.frame.fields import FrameFields
from equimorph.structures.frame.member import AXES


class DescribedFrame(FrameFields):
    """A planar frame with its descriptors, in the user's units."""

    written: ClassVar[Mapping[str, str]] = {
        "displacement(joint,axis)": "displacement",
        "rotation(joint)": "rotation",
        "rotation(member,joint)": "rotation",
        "axial(member,joint)": "axial",
        "shear(member,joint)": "shear",
        "moment(member,joint)": "moment",
        "max_curvature(member)": "member_curvature",
        "max_curvature": "max_curvature",
        "reaction(joint,axis)": "reaction",
        "travel(load)": "travel",
        "effort(actuator)": "effort_of",
        "energy": "total_energy",
    }

    @check_arguments
    @remember_call
    def rotation(self, where: str, joint: str | None = None) -> Descriptor:
        """Turn of a joint, or of the end of a member there, in radians."""
        made, model = self.model.network, self.model
        if joint is None:
            node, name = int(model.joint_nodes[made.joint(where)]), f"rotation({where})"
        else:
            member, side = made.end(where, joint)
            node = int(model.member_nodes[member, -side])
            name = f"rotation({made.edge_names[member]},{joint})"
        if node < 0:
            raise InputError(
                f"`rotation({where})` must be of a joint where a member is not hinged; name a "
                f"member: rotation(member,{where})."
            )

        def value(z: Lanes, p: Parameters) -> Values:
            return self.turns(z, self.scalars(z, p))[:, node].copy()

        return self._make(name, "rad", value)

    @check_arguments
    def axial(self, member: str, joint: str) -> Descriptor:
        """Axial force in a member at a joint, positive in tension."""
        return self._end_force("axial", member, joint)

    @check_arguments
    def shear(self, member: str, joint: str) -> Descriptor:
        """Shear force in a member at a joint, to the left of the way from its start to its end.

        It is the force of what lies beyond the cross-section, toward the member's end, on what lies
        before.
        """
        return self._end_force("shear", member, joint)

    @remember_call
    def _end_force(self, kind: str, member: str, joint: str) -> Descriptor:
        model = self.model
        at, side = model.network.end(member, joint)
        points = model.directions.reshape(len(model.lengths), -1)
        node, drawn = model.member_nodes[at, -side], points[at, -side]

        def value(z: Lanes, p: Parameters) -> Values:
            angle = self.turns(z, self.scalars(z, p))[:, node] + drawn
            x, y = self.end_forces(z, p)[:, at, side].T
            if kind == "axial":
                return np.asarray(model.force * (x * np.cos(angle) + y * np.sin(angle)))
            return np.asarray(model.force * (y * np.cos(angle) - x * np.sin(angle)))

        return self._make(f"{kind}({model.network.edge_names[at]},{joint})", "force", value)

    @check_arguments
    @remember_call
    def moment(self, member: str, joint: str) -> Descriptor:
        """Bending moment in a member at a joint, positive where it bends to its left."""
        at, side = self.model.network.end(member, joint)

        def value(z: Lanes, p: Parameters) -> Values:
            return np.asarray(self.model.energy * self.end_moments(z, p)[:, at, side])

        name = f"moment({self.model.network.edge_names[at]},{joint})"
        return self._make(name, "force·length", value)

    @check_arguments
    @remember_call
    def reaction(self, joint: str, axis: str) -> Descriptor:
        """Force (axis "x" or "y"), or couple ("angle"), of a support on its joint."""
        at, along = self.model.network.support_place(joint, axis)

        def value(z: Lanes, p: Parameters) -> Values:
            if along == 2:
                return np.asarray(self.model.energy * self.couples(z, p)[:, at])
            return np.asarray(self.model.force * self.reactions(z, p)[:, at, along])

        quantity = "force·length" if along == 2 else "force"
        return self._make(f"reaction({joint},{axis})", quantity, value)

    @property
    def support_reactions(self) -> tuple[Descriptor, ...]:
        """Reactions along all that supports hold or spring."""
        network = self.model.network
        held = np.argwhere(network.supports != 0.0).tolist()
        return tuple(self.reaction(network.joints[at], AXES[along]) for at, along in held)

    def first_move(self) -> Descriptor:
        """The turn of the first joint that can, or the energy."""
        model = self.model
        for joint, node in zip(model.network.joints, model.joint_nodes.tolist(), strict=True):
            if node >= 0 and model.place[node] >= 0:
                return self.rotation(joint)
        return self.total_energy
