"""The frame in space: rods between rigid joints, ball joints and hinges, with loads on them."""

from collections.abc import Iterable, Mapping
from dataclasses import replace
from functools import cached_property
from typing import Annotated, Any, ClassVar, NamedTuple

import numpy as np
from jaxtyping import Float

from equimorph.argument_checks import check_arguments
from equimorph.argument_vocabulary import count
from equimorph.arrays import Flags, Lanes, Parameters, Values
from equimorph.model import Descriptor, Drawing, Parameter
from equimorph.structures.network import Joints, length_limits
from equimorph.structures.rod.discretisation import Mesh, reference_element
from equimorph.structures.space_frame import descriptors
from equimorph.structures.space_frame.drawing import spatial_frame_drawing
from equimorph.structures.space_frame.fields import SpatialFrameFields
from equimorph.structures.space_frame.member import SpatialMemberSpec
from equimorph.structures.space_frame.model import SpatialFrameModel
from equimorph.structures.space_frame.network import spatial_network
from equimorph.structures.space_frame.patterns import (
    SpatialActuators,
    SpatialLoads,
    SpatialPatterns,
    spatial_patterns,
)
from equimorph.structures.space_frame.soundness import (
    discretisation_error,
    grow_stress,
    refuse_singular,
)
from equimorph.structures.space_frame.supports import SpatialSupportSpec
from equimorph.structures.unit_system import Units, unit_system

SUPPORTS = (
    "supports by joint: fixed, pinned, axes to hold (x, yz, xyz), or a table of x, y, z (held or "
    "the stiffness of a spring), plane, line, rotation (held, or the axis about which it turns)"
)
WALKED = 17
"""Places along a piece of a member where it is drawn."""


class Stretch(NamedTuple):
    """Points of a walk on one piece: which, the piece, whether from its start, shares of it."""

    points: np.ndarray
    piece: int
    forward: bool
    shares: np.ndarray


class SpatialFrame(SpatialFrameFields):
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
        loads: SpatialLoads | None = None,
        actuators: SpatialActuators | None = None,
        *,
        elements: Annotated[int, count(1, 1000)] = 2,
        degree: int = 6,
        units: Units | None = None,
    ) -> None:
        system = unit_system(units)
        made = spatial_network(joints, members, supports, system)
        self._loads, self._actuators = dict(loads or {}), dict(actuators or {})
        found = spatial_patterns(made, self._actuators, self._loads)
        length = float(made.drawn_lengths.mean())
        bending = float(np.mean([each.strain[2] for each in made.made]))
        mesh = Mesh(np.linspace(0.0, 1.0, elements + 1), reference_element(degree))
        scaled = found.scaled(length, bending)
        super().__init__(SpatialFrameModel(made, scaled, mesh, length, bending, system))
        self.length_unit, self.energy_scale = system.label("length"), bending / length
        self.parameters = tuple(
            self._parameter(k, name, found)
            for k, name in enumerate([*self._actuators, *self._loads])
        )
        refuse_singular(self)
        self._set_scales()

    def _parameter(self, k: int, name: str, found: SpatialPatterns) -> Parameter:
        unit = self.model.system.label(found.unit(k))
        if k >= len(self._actuators):
            return Parameter(name, unit, 1.0, "load", 0.0)
        limits = length_limits(self.model.network.drawn_lengths, found.length[k])
        return Parameter(name, unit, 1.0, "actuator", 0.0, *limits)

    def _set_scales(self) -> None:
        """Measure parameters by what turns a node by one radian, or bends a member by as much."""
        count = len(self.parameters)
        z, p = self.natural_guess(np.zeros((count, count))), np.zeros((count, count))
        columns = self.parameter_derivative(z, p, np.eye(count))
        moves = self.solve(z, p, -columns[:, None]).x[:, 0, : self.unknowns]
        turns = 2.0 * np.abs(moves).max(axis=1)
        self.parameters = tuple(
            replace(each, scale=min(self.model.patterns.typical(k), 1.0 / max(turn, 1e-300)))
            for k, (each, turn) in enumerate(zip(self.parameters, turns.tolist(), strict=True))
        )

    def identity(self) -> dict[str, Any]:
        """Kind, and what the frame is made from."""
        made, mesh = self.model.network, self.model.mesh
        supports = zip(made.joints, made.supports, strict=True)
        return {
            "kind": self.kind,
            "joints": dict(zip(made.joints, made.places.tolist(), strict=True)),
            "members": [member.data() for member in made.members],
            "supports": {joint: dict(each.data) for joint, each in supports if each.data},
            "loads": _plain(self._loads),
            "actuators": _plain(self._actuators),
            "elements": mesh.elements,
            "degree": mesh.degree,
            **({} if self.model.system.plain else {"units": self.model.system.data()}),
        }

    def natural(self, p: Parameters) -> tuple[Lanes, Flags]:
        """Natural state: the frame as drawn, or with its initial stress growing from nothing."""
        if self.model.stressed:
            return grow_stress(self, p)
        return super().natural(p)

    @cached_property
    def refined(self) -> "SpatialFrame":
        """The same frame with elements of a degree higher by four."""
        data = self.identity()
        del data["kind"]
        return SpatialFrame(**{**data, "degree": min(data["degree"] + 4, 16)})

    def error_estimate(self, z: Lanes, p: Parameters) -> Values:
        """Bound of the errors of displacements, turns of ends and max |κ|, by a higher degree.

        Displacements and curvature are relative to the mean length of the pieces.
        """
        return discretisation_error(self, self.refined, z, p)

    # --- pictures -------------------------------------------------------------------------------

    def _walk(self, s: Float[np.ndarray, " points"] | None) -> list[Stretch]:
        """Walk over all pieces, piece by piece."""
        made = self.model.network
        walk = made.walk
        place = np.linspace(0.0, 1.0, (len(walk) - 1) * (WALKED - 1) + 1) if s is None else s
        place = np.clip(np.asarray(place, dtype=float), 0.0, 1.0) * (len(walk) - 1)
        step = np.minimum(place.astype(int), len(walk) - 2)
        number = {frozenset(pair): k for k, pair in enumerate(made.ends.tolist())}
        found = []
        for k in np.unique(step):
            here = np.flatnonzero(step == k)
            piece = number[frozenset(walk[k : k + 2].tolist())]
            forward = bool(made.ends[piece, 0] == walk[k])
            share = place[here] - k
            found.append(Stretch(here, piece, forward, share if forward else 1.0 - share))
        return found

    def shape(
        self, z: Lanes, p: Parameters, s: Float[np.ndarray, " points"] | None = None
    ) -> Float[np.ndarray, "lanes points 3"]:
        """Places along a walk over all pieces, some of which it passes twice.

        `s` runs from 0 to 1 along it; all pieces get equal lengths.
        """
        parts = self._walk(s)
        shares, at = np.unique(np.concatenate([each.shares for each in parts]), return_inverse=True)
        out, whole = np.empty((len(z), len(at), 3)), self.outline(z, p, shares)
        for points, piece, _, _ in parts:
            out[:, points] = whole[:, piece, at[: len(points)]]
            at = at[len(points) :]
        return np.asarray(out * self.model.length)

    def frames(
        self, z: Lanes, p: Parameters, s: Float[np.ndarray, " points"] | None = None
    ) -> Float[np.ndarray, "lanes points 3 3"]:
        """Cross-sections along the walk of `shape`: the columns are t, n, b; t points ahead."""
        parts = self._walk(s)
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

    def drawing(self, z: Lanes, p: Parameters) -> Drawing:
        """Supports of the joints, loads on joints and members, members that bend or lengthen."""
        return spatial_frame_drawing(self, z, p)

    # --- descriptors ----------------------------------------------------------------------------

    @check_arguments
    def displacement(self, joint: str, axis: str) -> Descriptor:
        """Move of a joint along x, y or z, from where it is drawn."""
        return descriptors.displacement(self, joint, axis)

    @check_arguments
    def place(self, joint: str, axis: str) -> Descriptor:
        """Coordinate x, y or z of a joint."""
        return descriptors.place(self, joint, axis)

    @check_arguments
    def rotation(self, joint: str, axis: str) -> Descriptor:
        """Component of the rotation vector of a joint, in radians."""
        return descriptors.rotation(self, joint, axis)

    @check_arguments
    def hinge(self, member: str, joint: str) -> Descriptor:
        """Angle of the hinge of a member at a joint, in radians, 0 as drawn."""
        return descriptors.hinge(self, member, joint)

    @check_arguments
    def force(self, member: str, joint: str, axis: str) -> Descriptor:
        """Force in a member at a joint along its tangent "t", normal "n" or binormal "b"."""
        return descriptors.force(self, member, joint, axis)

    @check_arguments
    def moment(self, member: str, joint: str, axis: str) -> Descriptor:
        """Moment in a member at a joint about its tangent "t", normal "n" or binormal "b"."""
        return descriptors.moment(self, member, joint, axis)

    @property
    def max_curvature(self) -> Descriptor:
        """Largest bending curvature in all members."""
        return descriptors.max_curvature(self)

    @check_arguments
    def reaction(self, joint: str, axis: str) -> Descriptor:
        """Force of a support on its joint along x, y or z."""
        return descriptors.reaction(self, joint, axis)

    @check_arguments
    def couple(self, joint: str, axis: str) -> Descriptor:
        """Couple of a support that holds a rotation, about x, y or z."""
        return descriptors.couple(self, joint, axis)

    @check_arguments
    def travel(self, load: str) -> Descriptor:
        """Displacement along a load, work per unit of its parameter."""
        return descriptors.travel(self, load)

    @property
    def total_energy(self) -> Descriptor:
        """Energy of the frame and its loads."""
        return descriptors.total_energy(self)

    @property
    def elevation(self) -> Descriptor:
        """The travel of the first load, or the energy."""
        return descriptors.elevation(self)

    @check_arguments
    def descriptor(self, text: str) -> Descriptor:
        """Return the descriptor written like ``displacement(B,z)`` or ``moment(A-B,A,t)``."""
        return descriptors.descriptor_from_text(self, text)


def _plain(given: Any) -> Any:
    """Tables of numbers, as plain data."""
    if isinstance(given, Mapping):
        return {name: _plain(value) for name, value in given.items()}
    if isinstance(given, int | float | np.number):
        return float(given)
    return [float(value) for value in given]
