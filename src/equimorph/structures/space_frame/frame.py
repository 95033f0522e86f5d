"""The frame in space: rods between rigid joints, ball joints and hinges, loads, initial stress."""

from collections.abc import Iterable, Mapping
from functools import cached_property
from typing import Annotated, ClassVar

import numpy as np

from equimorph.argument_checks import check_arguments
from equimorph.argument_vocabulary import count
from equimorph.arrays import Flags, Float, Lanes, Parameters, Values
from equimorph.errors import InputError
from equimorph.model import Descriptor, remember_call
from equimorph.structures.any_network import is_symmetry
from equimorph.structures.contract import Readers, Symmetry, Written
from equimorph.structures.discrete import continue_equilibria
from equimorph.structures.frame.images import SpatialImage, find_images
from equimorph.structures.frame.patterns import Actuators, Loads, Patterns
from equimorph.structures.network import Joints
from equimorph.structures.resolution import IN_SPACE, Waves
from equimorph.structures.rod.fibres import Stressed
from equimorph.structures.space_frame.fields import SpatialFrameFields
from equimorph.structures.space_frame.mechanics import SpatialFrameMechanics
from equimorph.structures.space_frame.member import SpatialMemberSpec, SpatialSupportSpec
from equimorph.structures.space_frame.model import SpatialFrameModel
from equimorph.structures.space_frame.network import spatial_network
from equimorph.structures.spatial.quaternions import LONGEST_STEP
from equimorph.structures.spatial.windings import GUESSES
from equimorph.structures.unit_system import Units, unit_system


class GrowingModel(SpatialFrameModel):
    """A frame whose initial strains are scaled by a last parameter."""

    @cached_property
    def strains(self) -> Float[np.ndarray, "pieces scalars 3"]:
        """Actuated strains of the cross-sections by parameter."""
        found = super().strains.copy()
        found[:, -1] = 0.0
        return found

    @cached_property
    def elongation(self) -> Float[np.ndarray, "pieces scalars"]:
        """Actuated strain along the pieces by parameter."""
        found = super().elongation.copy()
        found[:, -1] = 0.0
        return found


class GrowingFrame(SpatialFrameMechanics):
    """Mechanics of a frame whose initial stress grows with its last parameter, from 0 to 1."""

    def __init__(self, model: SpatialFrameModel) -> None:
        """Take the initial strains of a frame as one more pattern."""
        given, strains = model.patterns, model.strains[None, :, -1]
        initial = model.elongation[None, :, -1] * model.lengths
        none = vars(Patterns.none(model.network, 1))
        last = {**none, "strains": strains, "length": initial}
        pairs = ((each, last[name]) for name, each in vars(given).items())
        both = Patterns(*(np.concatenate(pair) for pair in pairs))
        names = ("network", "mesh", "length", "bending", "system")
        super().__init__(
            GrowingModel(patterns=both, **{name: getattr(model, name) for name in names})
        )

    @property
    def scales(self) -> Float[np.ndarray, " parameters"]:
        """One each: nothing is measured by them."""
        return np.ones(self.model.patterns.count)


def grow_stress(model: SpatialFrameModel, p: Parameters) -> tuple[Lanes, Flags]:
    """Natural states: initial strains and actuators grow together from the frame as drawn."""
    growing = GrowingFrame(model)
    target = np.concatenate([p, np.ones((len(p), 1))], axis=1)
    return continue_equilibria(growing, growing.natural_guess, np.zeros_like(target), target)


SECTION = ("t", "n", "b")


class DescribedSpatialFrame(SpatialFrameFields):
    """A frame in space with its descriptors, in the user's units."""

    waves: ClassVar[Waves] = IN_SPACE
    written: ClassVar[Written] = {
        "displacement(joint,axis)": "displacement",
        "place(joint,axis)": "place",
        "rotation(joint,axis)": "rotation",
        "force(member,joint,t)": "force",
        "moment(member,joint,b)": "moment",
        "hinge(member,joint)": "hinge",
        "max_curvature(member)": "member_curvature",
        "max_curvature": "max_curvature",
        "max_shortening": "max_shortening",
        **Stressed.written,
        "max_strain(member)": "member_strain",
        "max_stress(member)": "member_stress",
        "reaction(joint,axis)": "reaction",
        "couple(joint,axis)": "couple",
        "travel(load)": "travel",
        "effort(actuator)": "effort_of",
        "energy": "total_energy",
    }
    readers: ClassVar[Readers] = Stressed.readers

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


SUPPORTS = (
    "supports by joint: fixed, pinned, axes to hold (x, yz, xyz), or a table of x, y, z (held or "
    "the stiffness of a spring), plane, line, rotation (held, or the axis about which it turns)"
)


class SpatialFrame(DescribedSpatialFrame):
    """Network of elastic rods in space, with displacements and rotations of any size.

    Members are unshearable, geometrically exact rods that bend about two axes and twist, straight
    or circular arcs as drawn, which is free of stress. Without EA they are inextensible; with it
    sets end at ``max_shortening <= 0.99``. They meet at rigid joints, at ball joints, or at hinges
    about axes. Dead loads act on joints or along members.

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
        Elements of each piece of a member and their polynomial degree; see `resolving`.
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
    longest_step = LONGEST_STEP
    upward: ClassVar[str] = "z"
    finds_orbits: ClassVar[bool] = True

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
    def guesses_per_start(self) -> float:
        """More where some wind."""
        return GUESSES if self.model.most_half_windings else 1.0

    @property
    def unstressed(self) -> SpatialFrameMechanics:
        """Mechanics of the frame without initial stress."""
        return GrowingFrame(self.model) if self.model.stressed else self

    def natural(self, p: Parameters) -> tuple[Lanes, Flags]:
        """Natural state: the frame as drawn, or with its initial stress growing from nothing."""
        if self.model.stressed:
            return grow_stress(self.model, p)
        return super().natural(p)

    @cached_property
    def _symmetries(self) -> tuple[Symmetry, ...]:
        return (*self._half_turn, *find_images(self, SpatialImage))

    @cached_property
    def _half_turn(self) -> tuple[Symmetry, ...]:
        """The half turn about the line, if it is a symmetry: it reverses what acts across."""
        if not self.line_turns.possible:
            return ()
        across = self.line_turns.breaking[:, :-1].any(axis=0)
        across |= (self.model.patterns.turns @ self.line_turns.cross.T).any(axis=(1, 2))
        signs = np.where(across, -1.0, 1.0)

        def apply(z: Lanes, p: Parameters) -> tuple[Lanes, Parameters]:
            return self.turn(z, p, np.full(len(z), np.pi)), signs * p

        found = Symmetry("half turn about the line", apply, signs, along_orbits=True)
        return (found,) if is_symmetry(self, apply) else ()

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
