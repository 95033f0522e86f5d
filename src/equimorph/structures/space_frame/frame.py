"""The frame in space: rods between rigid joints, ball joints and hinges, with loads on them."""

from collections.abc import Iterable, Mapping
from typing import Annotated, ClassVar

import numpy as np

from equimorph.argument_checks import check_arguments
from equimorph.argument_vocabulary import count
from equimorph.array_types import Float
from equimorph.arrays import Flags, Lanes, Parameters
from equimorph.structures.frame.patterns import Actuators, Loads
from equimorph.structures.network import Joints
from equimorph.structures.space_frame.described import DescribedSpatialFrame
from equimorph.structures.space_frame.initial_stress import GrowingFrame, grow_stress
from equimorph.structures.space_frame.mechanics import SpatialFrameMechanics
from equimorph.structures.space_frame.member import SpatialMemberSpec
from equimorph.structures.space_frame.model import SpatialFrameModel
from equimorph.structures.space_frame.network import spatial_network
from equimorph.structures.space_frame.supports import SpatialSupportSpec
from equimorph.structures.unit_system import Units, unit_system

SUPPORTS = (
    "supports by joint: fixed, pinned, axes to hold (x, yz, xyz), or a table of x, y, z (held or "
    "the stiffness of a spring), plane, line, rotation (held, or the axis about which it turns)"
)


class SpatialFrame(DescribedSpatialFrame):
    """Network of elastic rods in space, with displacements and rotations of any size.

    Members are unshearable, geometrically exact rods that bend about two axes and twist, straight
    or circular arcs as drawn, which is free of stress. Without EA they are inextensible. They meet
    at rigid joints, at ball joints, or at hinges about axes. Dead loads act on joints or along
    members.

    Unknowns are quaternions of Gauss–Lobatto nodes along the members, which rigidly joined members
    share, and angles of hinges; the multipliers are forces that balance without loads, three for
    each independent cycle of members and supports.

    Parameters
    ----------
    joints
        Places by name.
    members
        `SpatialMember`s, or sequences of joints.
    supports
        By joint: "fixed", "pinned" (a ball joint), the axes that a roller holds ("x", "yz"), or a
        table: "x", "y", "z", each "held" or the stiffness of a spring; or "plane", the normal of a
        plane in which it slides; or "line", the direction along which it slides; and "rotation",
        "held" or the axis about which alone it turns.
    loads
        By the name of the load parameter, which multiplies them: forces (x, y, z) by joint; line
        loads (x, y, z) per length by member, like ``{"q": {"A-B": (0, 0, -1)}}``; "weight": a
        direction, for line loads of the members' weights.
    actuators
        By the name of the actuator, per unit of the parameter: "move" places of supports
        (x, y, z), "turn" rotations that supports hold (a rotation vector; of several parameters
        one after the other), "length" changes the members' lengths, and "curvature" their
        intrinsic strains (twist, curvature about n, curvature about b).
    elements, degree
        Elements of each piece of a member and their polynomial degree.
    units
        Units of force and length of all numbers, like ``{"force": "kN", "length": "mm"}``; places,
        stiffnesses and weights may then be texts with units. None: any one system.

    Raises
    ------
    InputError
        For a joint without member, joints apart or in one place, stiffness that is not positive, a
        mechanism (with the joint or the member that moves), supports that hold inextensible members
        twice, a hinge or load without meaning, or a parameter without effect.

    Examples
    --------
    A right-angle bend, loaded across its plane: its end moves by P L³ (1/3 + 1/3 + EI/GJ)/EI.

    >>> from equimorph import SpatialFrame, SpatialMember, lift
    >>> joints = {"A": (0, 0, 0), "B": (1, 0, 0), "C": (1, 1, 0)}
    >>> member = SpatialMember(("A", "B", "C"), EI=1.0, GJ=0.5)
    >>> frame = SpatialFrame(joints, [member], {"A": "fixed"}, {"P": {"C": (0, 0, -1)}})
    >>> state = lift(frame.natural_state(), to={"P": 0.01}).end.state
    >>> round(-frame.displacement("C", "z")(state) / 0.01, 3)
    2.666
    """

    kind: ClassVar[str] = "spatial frame"
    upward: ClassVar[str] = "z"

    @check_arguments
    def __init__(
        self,
        joints: Joints,
        members: Iterable[SpatialMemberSpec],
        supports: Annotated[Mapping[str, SpatialSupportSpec], SUPPORTS],
        loads: Loads | None = None,
        actuators: Actuators | None = None,
        *,
        elements: Annotated[int, count(1, 1000)] = 2,
        degree: int = 6,
        units: Units | None = None,
    ) -> None:
        system = unit_system(units)
        made = spatial_network(joints, members, supports, system)
        self._name_parameters(actuators, loads)
        effects = self._actuators, self._loads
        super().__init__(SpatialFrameModel.of(made, effects, (elements, degree), system))
        self._describe()

    @property
    def unstressed(self) -> SpatialFrameMechanics:
        """Mechanics of the frame without initial stress."""
        return GrowingFrame(self.model) if self.model.stressed else self

    def natural(self, p: Parameters) -> tuple[Lanes, Flags]:
        """Natural state: the frame as drawn, or with its initial stress growing from nothing."""
        if self.model.stressed:
            return grow_stress(self.model, p)
        return super().natural(p)

    # --- pictures -------------------------------------------------------------------------------

    def frames(
        self, z: Lanes, p: Parameters, s: Float[np.ndarray, " points"] | None = None
    ) -> Float[np.ndarray, "lanes points 3 3"]:
        """Cross-sections along the walk of `shape`: the columns are t, n, b; t points ahead."""
        parts = self.walk(s)
        shares, at = np.unique(np.concatenate([each.shares for each in parts]), return_inverse=True)
        out, whole = np.empty((len(z), len(at), 3, 3)), self.axes_along(z, p, shares)
        for points, piece, forward, _ in parts:
            signs = np.ones(3) if forward else np.array([-1.0, 1.0, -1.0])
            out[:, points] = whole[:, piece, at[: len(points)]] * signs
            at = at[len(points) :]
        return out

    @property
    def flatness(self) -> float:
        """Width over thickness of a rectangle with the mean ratio of bending stiffnesses."""
        _, aside, bend = self.model.rigidity.mean(axis=0)
        return float(np.sqrt(aside / bend))
