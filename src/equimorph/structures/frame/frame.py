"""The frame: rods between rigid or hinged joints; its loads, actuators, descriptors, symmetries."""

from collections.abc import Iterable, Mapping
from functools import cached_property
from typing import Annotated, ClassVar

import numpy as np

from equimorph.argument_checks import check_arguments
from equimorph.argument_vocabulary import count
from equimorph.arrays import Lanes, Parameters, Values
from equimorph.errors import InputError
from equimorph.model import Descriptor, remember_call
from equimorph.structures.contract import Readers, Symmetry, Written
from equimorph.structures.frame.fields import FrameFields
from equimorph.structures.frame.images import PlanarImage, find_images
from equimorph.structures.frame.model import FrameModel
from equimorph.structures.frame.network import AXES, MemberSpec, SupportSpec, frame_network
from equimorph.structures.frame.patterns import Actuators, Loads
from equimorph.structures.network import Joints
from equimorph.structures.resolution import IN_PLANE, Waves
from equimorph.structures.rod.fibres import Stressed
from equimorph.structures.unit_system import Units, unit_system


class DescribedFrame(FrameFields):
    """A planar frame with its descriptors, in the user's units."""

    waves: ClassVar[Waves] = IN_PLANE
    written: ClassVar[Written] = {
        "displacement(joint,axis)": "displacement",
        "rotation(joint)": "rotation",
        "rotation(member,joint)": "rotation",
        "axial(member,joint)": "axial",
        "shear(member,joint)": "shear",
        "moment(member,joint)": "moment",
        "max_curvature(member)": "member_curvature",
        "max_curvature": "max_curvature",
        "max_shortening": "max_shortening",
        **Stressed.written,
        "max_strain(member)": "member_strain",
        "max_stress(member)": "member_stress",
        "reaction(joint,axis)": "reaction",
        "travel(load)": "travel",
        "effort(actuator)": "effort_of",
        "energy": "total_energy",
    }
    readers: ClassVar[Readers] = Stressed.readers

    @check_arguments
    @remember_call
    def rotation(self, where: str, joint: str | None = None) -> Descriptor:
        """Turn of a joint, or of the end of a member there, in radians."""
        made, model = self.model.network, self.model
        if joint is None:
            node, name = int(model.joint_nodes[made.joint(where)]), f"rotation({where})"
        else:
            member, side = made.end(where, joint)
            node = int(model.piece_nodes[member, -side])
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
        node, drawn = model.piece_nodes[at, -side], points[at, -side]

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


SUPPORTS = (
    "supports by joint: fixed, pinned, axes to hold (x, y or xy), or a table of x, y, angle to "
    "'held' or a positive stiffness"
)


class Frame(DescribedFrame):
    """Planar network of elastic rods, with displacements and turns of any size.

    Members are unshearable, geometrically exact rods, straight or circular arcs as drawn, which is
    free of stress. Without EA they are inextensible; with it they have the energy ½ EA ε² per
    length in addition to ½ EI (κ − κ₀)², and sets end at ``max_shortening <= 0.99``. They meet at
    rigid or hinged joints. Dead loads act on joints or along members. x points right, y up; angles
    and couples count counterclockwise.

    Pressure is a force per length, normal to the members of a chain wherever they turn, to the left
    of the way along the chain if positive. It has the potential −p V with the area V to the right
    of the chain, up to its chord: where the chain closes, so that a ring run through
    counterclockwise is pressed inward, or where each of its ends is held or moves along x or along
    y, as on rods; see `Pressure`. Energies and efforts count the chord as a wall, reactions do not.

    Unknowns are the turns of Gauss–Lobatto nodes along the members; the multipliers are forces that
    balance without loads, one for each independent cycle of members and supports in x and in y.

    Parameters
    ----------
    joints
        Places by name.
    members
        `Member`s, or pairs of joints.
    supports
        By joint: "fixed", "pinned", the axes that a roller holds ("x", "y"), or a table from "x",
        "y", "angle" to "held" or the stiffness of a spring.
    loads
        By the name of the load parameter, which multiplies them: forces (x, y) or (x, y, couple)
        by joint; line loads (x, y) per length by member, like ``{"q": {"A-B": (0, -1)}}``;
        "weight": a direction, for line loads of the members' weights; "pressure": the joints of a
        chain of members, like ``{"p": {"pressure": ["A", "B", "C", "A"]}}``.
    actuators
        By the name of the actuator, per unit of the parameter: ``{"a": {"curvature": {"A-B": 1}}}``
        changes intrinsic curvatures, "length" the members' lengths, "move" places of supports
        (x, y) and "turn" their angles.
    elements, degree
        Elements of each member and their polynomial degree; see `resolving`.
    units
        Units of force and length of all numbers, like ``{"force": "kN", "length": "mm"}``; places,
        stiffnesses and weights may then be texts with units. None: any one system.

    Raises
    ------
    InputError
        For a joint without member, joints apart, stiffness that is not positive, EI and EA in
        different units, a mechanism (with the joint that moves), supports that hold inextensible
        members twice, a hinge or load without meaning, a parameter without effect, or pressure
        without a potential or on members that stretch or lengthen.

    Examples
    --------
    A cantilever of two members under a tip load of P L²/EI = 2 [Mattiasson1981]_:

    >>> from equimorph import Frame, lift
    >>> joints = {"A": (0, 0), "B": (0.5, 0), "C": (1, 0)}
    >>> frame = Frame(joints, [("A", "B"), ("B", "C")], {"A": "fixed"}, {"P": {"C": (0, -1)}})
    >>> bent = lift(frame.natural_state(), to={"P": 2.0}).end.state
    >>> round(-frame.displacement("C", "y")(bent), 5)
    0.49346

    A ring of radius 1 buckles under a pressure of 3 EI/R³ [TimoshenkoGere1961]_, in two ways:

    >>> from equimorph import Member
    >>> joints = {"A": (0, -1), "B": (1, 0), "C": (0, 1), "D": (-1, 0)}
    >>> pairs = [("A", "B"), ("B", "C"), ("C", "D"), ("D", "A")]
    >>> arcs = [Member(pair, curvature=1.0) for pair in pairs]
    >>> loads = {"p": {"pressure": ["A", "B", "C", "D", "A"]}}
    >>> ring = Frame(joints, arcs, {"A": "pinned", "C": "x"}, loads)
    >>> end = lift(ring.natural_state(), to={"p": 5.0}).end
    >>> end.kind, round(end.state["p"], 5)
    ('multiple point', 3.0)
    """

    @check_arguments
    def __init__(
        self,
        joints: Joints,
        members: Iterable[MemberSpec],
        supports: Annotated[Mapping[str, SupportSpec], SUPPORTS],
        loads: Loads | None = None,
        actuators: Actuators | None = None,
        *,
        elements: Annotated[int, count(1, 1000)] = 2,
        degree: int = 8,
        units: Units | None = None,
    ) -> None:
        system = unit_system(units)
        made = frame_network(joints, members, supports, system)
        self._name_parameters(actuators, loads)
        effects = self._actuators, self._loads
        super().__init__(FrameModel.of(made, effects, (elements, degree), system))
        self._describe()

    def natural_guess(self, p: Parameters) -> Lanes:
        """The frame as drawn."""
        return np.zeros((len(p), self.size))

    @cached_property
    def _symmetries(self) -> tuple[Symmetry, ...]:
        return find_images(self, PlanarImage)
