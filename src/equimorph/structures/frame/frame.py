"""The frame: rods between rigid or hinged joints, loads on them, rods that bend or lengthen."""

from collections.abc import Iterable, Mapping
from typing import Annotated

import numpy as np

from equimorph.argument_checks import check_arguments
from equimorph.argument_vocabulary import count
from equimorph.array_types import Float
from equimorph.arrays import Lanes, Parameters, Velocity
from equimorph.structures.contract import Symmetry
from equimorph.structures.frame.described import DescribedFrame
from equimorph.structures.frame.inertia import frame_material, member_masses
from equimorph.structures.frame.member import MemberSpec, SupportSpec
from equimorph.structures.frame.model import FrameModel
from equimorph.structures.frame.network import frame_network
from equimorph.structures.frame.patterns import Actuators, Loads
from equimorph.structures.frame.symmetry import symmetries
from equimorph.structures.network import Joints
from equimorph.structures.unit_system import Units, unit_system

SUPPORTS = (
    "supports by joint: fixed, pinned, axes to hold (x, y or xy), or a table of x, y, angle to "
    "'held' or a positive stiffness"
)


class Frame(DescribedFrame):
    """Planar network of elastic rods, with displacements and turns of any size.

    Members are unshearable, geometrically exact rods, straight or circular arcs as drawn, which is
    free of stress. Without EA they are inextensible; with it they have the energy ½ EA ε² per
    length in addition to ½ EI (κ − κ₀)². They meet at rigid or hinged joints. Dead loads act on
    joints or along members. x points right, y up; angles and couples count counterclockwise.

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
        "weight": a direction, for line loads of the members' weights.
    actuators
        By the name of the actuator, per unit of the parameter: ``{"a": {"curvature": {"A-B": 1}}}``
        changes intrinsic curvatures, "length" the members' lengths, "move" places of supports
        (x, y) and "turn" their angles.
    elements, degree
        Elements of each member and their polynomial degree.
    units
        Units of force and length of all numbers, like ``{"force": "kN", "length": "mm"}``; places,
        stiffnesses and weights may then be texts with units. None: any one system.

    Raises
    ------
    InputError
        For a joint without member, joints apart, stiffness that is not positive, EI and EA in
        different units, a mechanism (with the joint that moves), supports that hold inextensible
        members twice, a hinge or load without meaning, or a parameter without effect.

    Examples
    --------
    A cantilever of two members under a tip load of P L²/EI = 2 [Mattiasson1981]_:

    >>> from equimorph import Frame, lift
    >>> joints = {"A": (0, 0), "B": (0.5, 0), "C": (1, 0)}
    >>> frame = Frame(joints, [("A", "B"), ("B", "C")], {"A": "fixed"}, {"P": {"C": (0, -1)}})
    >>> bent = lift(frame.natural_state(), to={"P": 2.0}).end.state
    >>> round(-frame.displacement("C", "y")(bent), 5)
    0.49346
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

    def _find_symmetries(self) -> tuple[Symmetry, ...]:
        return symmetries(self)

    # --- in time --------------------------------------------------------------------------------

    @property
    def massless(self) -> str:
        """How a frame is given its mass."""
        return 'Give every member one, like Member(("A", "B"), mass=0.2).'

    def inertia(self, z: Lanes, p: Parameters) -> Float[np.ndarray, "lanes unknowns unknowns"]:
        """Mass matrix of the members, each as heavy everywhere."""
        masses = member_masses(self.model)
        if masses is None:
            return super().inertia(z, p)
        return frame_material(self, masses).inertia(z, p)

    def inertial_force(self, z: Lanes, p: Parameters, velocity: Velocity) -> Velocity:
        """Forces of inertia of the members at constant rates of the unknowns."""
        masses = member_masses(self.model)
        if masses is None:
            return super().inertial_force(z, p, velocity)
        return frame_material(self, masses).inertial_force(z, p, velocity)
