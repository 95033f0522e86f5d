"""The frame: rods between rigid or hinged joints, loads on them, rods that bend or lengthen."""

from collections.abc import Iterable, Mapping
from dataclasses import replace
from functools import cached_property
from typing import Annotated, Any

import numpy as np
from jaxtyping import Float

from equimorph.argument_checks import check_arguments
from equimorph.argument_vocabulary import count
from equimorph.arrays import Lanes, Parameters, Values
from equimorph.errors import InputError
from equimorph.model import Descriptor, Drawing, Parameter
from equimorph.structures.contract import Symmetry
from equimorph.structures.frame import descriptors
from equimorph.structures.frame.drawing import frame_drawing
from equimorph.structures.frame.fields import FrameFields
from equimorph.structures.frame.inertia import frame_inertia, member_masses
from equimorph.structures.frame.member import MemberSpec, SupportSpec, support_data
from equimorph.structures.frame.model import FrameModel
from equimorph.structures.frame.network import FrameNetwork, frame_network
from equimorph.structures.frame.patterns import Actuators, Loads, Patterns, patterns
from equimorph.structures.frame.symmetry import symmetries
from equimorph.structures.network import Joints, direction_of_mechanism, length_limits
from equimorph.structures.rod.discretisation import Mesh, error_by_refinement, reference_element
from equimorph.structures.unit_system import Units, unit_system
from equimorph.tolerances import SINGULAR

SUPPORTS = (
    "supports by joint: fixed, pinned, axes to hold (x, y or xy), or a table of x, y, angle to "
    "'held' or a positive stiffness"
)
WALKED = 17
"""Places along a member where it is drawn."""


class Frame(FrameFields):
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
        self._loads, self._actuators = dict(loads or {}), dict(actuators or {})
        found = patterns(made, self._actuators, self._loads)
        self._check_drift(made)
        length = float(made.lengths.mean())
        bending = float(np.mean([float(member.EI) for member in made.members]))
        mesh = Mesh(np.linspace(0.0, 1.0, elements + 1), reference_element(degree))
        scaled = found.scaled(length, bending)
        super().__init__(FrameModel(made, scaled, mesh, length, bending, system))
        self.length_unit, self.energy_scale = system.label("length"), bending / length
        self.parameters = tuple(
            self._parameter(k, name, found)
            for k, name in enumerate([*self._actuators, *self._loads])
        )
        refuse_singular(self)
        self._set_scales()

    @staticmethod
    def _check_drift(made: FrameNetwork) -> None:
        for axis, stiff in zip("xy", made.supports.T, strict=False):
            if not stiff.any():
                raise InputError(
                    f"`frame` must be no mechanism; nothing holds it in {axis}. Add a support."
                )

    def _parameter(self, k: int, name: str, found: Patterns) -> Parameter:
        unit = self.model.system.label(found.unit(k))
        if k >= len(self._actuators):
            return Parameter(name, unit, 1.0, "load", 0.0)
        limits = length_limits(self.model.network.lengths, found.length[k])
        return Parameter(name, unit, 1.0, "actuator", 0.0, *limits)

    def _set_scales(self) -> None:
        """Measure parameters by what turns a node by one radian, or bends a member by as much."""
        count = len(self.parameters)
        z, p = np.zeros((count, self.size)), np.zeros((count, count))
        columns = self.parameter_derivative(z, p, np.eye(count))
        turns = np.abs(self.solve(z, p, -columns[:, None]).x[:, 0, : self.unknowns]).max(axis=1)
        self.parameters = tuple(
            replace(each, scale=min(self.model.patterns.typical(k), 1.0 / max(turn, 1e-300)))
            for k, (each, turn) in enumerate(zip(self.parameters, turns.tolist(), strict=True))
        )

    def identity(self) -> dict[str, Any]:
        """Kind, and what the frame is made from."""
        made, mesh = self.model.network, self.model.mesh
        supports = {
            joint: support_data(row) for joint, row in zip(made.joints, made.supports, strict=True)
        }
        return {
            "kind": self.kind,
            "joints": dict(zip(made.joints, made.places.tolist(), strict=True)),
            "members": [member.data() for member in made.members],
            "supports": {joint: table for joint, table in supports.items() if table},
            "loads": _plain(self._loads),
            "actuators": _plain(self._actuators),
            "elements": mesh.elements,
            "degree": mesh.degree,
            **({} if self.model.system.plain else {"units": self.model.system.data()}),
        }

    def natural_guess(self, p: Parameters) -> Lanes:
        """The frame as drawn."""
        return np.zeros((len(p), self.size))

    def symmetries(self) -> tuple[Symmetry, ...]:
        """Mirror images and half turns that leave the frame as it is."""
        return self._symmetries

    @cached_property
    def _symmetries(self) -> tuple[Symmetry, ...]:
        return symmetries(self)

    @cached_property
    def refined(self) -> "Frame":
        """The same frame with elements of a degree higher by four."""
        data = self.identity()
        del data["kind"]
        return Frame(**{**data, "degree": min(data["degree"] + 4, 16)})

    def error_estimate(self, z: Lanes, p: Parameters) -> Values:
        """Bound of the errors of displacements, turns of ends and max |κ|, by a higher degree.

        Displacements and curvature are relative to the mean length of the members.
        """
        return discretisation_error(self, self.refined, z, p)

    def shape(
        self, z: Lanes, p: Parameters, s: Float[np.ndarray, " points"] | None = None
    ) -> Float[np.ndarray, "lanes points 2"]:
        """Places along a walk over all members, some of which it passes twice.

        `s` runs from 0 to 1 along it; all members get equal lengths.
        """
        made = self.model.network
        walk = made.walk
        place = np.linspace(0.0, 1.0, (len(walk) - 1) * (WALKED - 1) + 1) if s is None else s
        place = np.clip(np.asarray(place, dtype=float), 0.0, 1.0) * (len(walk) - 1)
        step = np.minimum(place.astype(int), len(walk) - 2)
        share = place - step
        out = np.empty((len(z), len(place), 2))
        pairs = [frozenset(pair) for pair in made.ends.tolist()]
        for k in np.unique(step):
            here = step == k
            member = pairs.index(frozenset(walk[k : k + 2].tolist()))
            forward = made.ends[member, 0] == walk[k]
            at = share[here] if forward else 1.0 - share[here]
            out[:, here] = self.outline(z, p, at)[:, member]
        return np.asarray(out * self.model.length)

    # --- in time --------------------------------------------------------------------------------

    @property
    def time_unit(self) -> str:
        """Seconds in a frame with units, else that of its numbers."""
        return self.model.system.time_unit

    def effort_unit(self, parameter: Parameter) -> str:
        """Unit of the effort of a parameter, like N for a length."""
        system = self.model.system
        plain = system.plain
        return super().effort_unit(parameter) if plain else system.conjugate(parameter.unit)

    @property
    def massless(self) -> str:
        """How a frame is given its mass."""
        return 'Give every member one, like Member(("A", "B"), mass=0.2).'

    def inertia(self, z: Lanes, p: Parameters) -> Float[np.ndarray, "lanes unknowns unknowns"]:
        """Mass matrix of the members, each as heavy everywhere."""
        masses = member_masses(self.model)
        return super().inertia(z, p) if masses is None else frame_inertia(self, masses, z, p)

    def drawing(self, z: Lanes, p: Parameters) -> Drawing:
        """Supports of the joints, loads on joints and members, members that bend or lengthen."""
        return frame_drawing(self, z, p)

    # --- descriptors ----------------------------------------------------------------------------

    @check_arguments
    def displacement(self, joint: str, axis: str) -> Descriptor:
        """Move of a joint along x or y, from where it is drawn."""
        return descriptors.displacement(self, joint, axis)

    @check_arguments
    def rotation(self, where: str, joint: str | None = None) -> Descriptor:
        """Turn of a joint, or of the end of a member there, in radians."""
        return descriptors.rotation(self, where, joint)

    @check_arguments
    def axial(self, member: str, joint: str) -> Descriptor:
        """Axial force in a member at a joint, positive in tension."""
        return descriptors.end_force(self, "axial", member, joint)

    @check_arguments
    def shear(self, member: str, joint: str) -> Descriptor:
        """Shear force in a member at a joint, to the left of the way from its start to its end."""
        return descriptors.end_force(self, "shear", member, joint)

    @check_arguments
    def moment(self, member: str, joint: str) -> Descriptor:
        """Bending moment in a member at a joint, positive where it bends to its left."""
        return descriptors.moment(self, member, joint)

    @property
    def max_curvature(self) -> Descriptor:
        """Largest |κ| in all members."""
        return descriptors.max_curvature(self)

    @check_arguments
    def reaction(self, joint: str, axis: str) -> Descriptor:
        """Force (axis "x" or "y"), or couple ("angle"), of a support on its joint."""
        return descriptors.reaction(self, joint, axis)

    @check_arguments
    def travel(self, load: str) -> Descriptor:
        """Displacement along a load, work per unit of its parameter."""
        return descriptors.travel(self, load)

    def effort(self, z: Lanes, p: Parameters) -> Parameters:
        """∂L/∂p: what actuators bear, and minus the travel of loads."""
        return super().effort(z, p)

    @property
    def total_energy(self) -> Descriptor:
        """Energy of the frame and its loads."""
        return descriptors.total_energy(self)

    @property
    def elevation(self) -> Descriptor:
        """The travel of the first load, or the turn of a joint."""
        return descriptors.elevation(self)

    @check_arguments
    def descriptor(self, text: str) -> Descriptor:
        """Return the descriptor written like ``displacement(B,y)`` or ``moment(A-B,A)``."""
        return descriptors.descriptor_from_text(self, text)


def _plain(given: Any) -> Any:
    """Tables of numbers, as plain data."""
    if isinstance(given, Mapping):
        return {name: _plain(value) for name, value in given.items()}
    if isinstance(given, int | float | np.number):
        return float(given)
    return [float(value) for value in given]


def refuse_singular(frame: FrameFields) -> None:
    """Refuse mechanisms, and forces that deformations do not determine.

    Raises
    ------
    InputError
        With the joint or member that moves, or the members that supports stretch.
    """
    z, p = np.zeros((1, frame.size)), np.zeros((1, len(frame.parameters)))
    matrix = frame.layout.dense(frame.entries(z, p))[0]
    values, vectors = np.linalg.eigh(matrix)
    least = int(np.argmin(np.abs(values)))
    if np.abs(values[least]) > SINGULAR * np.abs(values).max():
        return
    mode = vectors[:, least]
    turns, forces = mode[: frame.unknowns], mode[frame.unknowns :]
    if np.abs(turns).max() > np.abs(forces).max(initial=0.0):
        _refuse_mechanism(frame, mode)
    _refuse_stress(frame, forces)


def _refuse_mechanism(frame: FrameFields, mode: Float[np.ndarray, " size"]) -> None:
    made, p = frame.model.network, np.zeros((1, len(frame.parameters)))
    step = 1e-3 * mode[None] / np.abs(mode).max()
    moves = (frame.displacements(step, p) - frame.displacements(-step, p))[0]
    if np.abs(moves).max() > 1e-6:
        at, direction = direction_of_mechanism(moves)
        what = f"joint {made.joints[at]} can move along ({direction})"
    else:
        ends = frame.turns_of_ends(step, p)[0]
        member = int(np.argmax(np.abs(ends).max(axis=1)))
        what = f"member {made.members[member].name} can turn"
    raise InputError(
        f"`frame` must be no mechanism; {what} without force. Add a member or a support, or leave "
        "out a hinge."
    )


def _refuse_stress(frame: FrameFields, forces: Float[np.ndarray, " multipliers"]) -> None:
    made, count = frame.model.network, frame.constraints
    size = sum(np.abs(forces @ each.start[:count]) for each in frame.model.forces)
    some = np.asarray(size) > 0.1 * np.max(size)
    names = [member.name for member, stressed in zip(made.members, some, strict=True) if stressed]
    raise InputError(
        f"`supports` must not stretch or squeeze inextensible members; got {', '.join(names)} held "
        "at a length that they have already. Give one of them EA, or release a support."
    )


def discretisation_error(frame: FrameFields, finer: FrameFields, z: Lanes, p: Parameters) -> Values:
    """Twice the largest change of displacements, turns of ends and max |κ| on a finer frame.

    Displacements and curvature are relative to the mean length of the members. Infinite where the
    finer frame has no equilibrium near the state, as may happen at a fold.
    """
    model, fine = frame.model, finer.model
    matrix = model.mesh.interpolation(fine.mesh.nodes)
    turns = frame.turns(z, frame.scalars(z, p))[:, model.member_nodes] @ matrix.T
    nodes = np.zeros((len(z), len(fine.place)))
    nodes[:, fine.member_nodes] = turns
    start = np.concatenate([nodes[:, fine.place >= 0], z[:, frame.unknowns :]], axis=1)

    def correction(at: Lanes) -> Lanes:
        return np.asarray(finer.solve(at, p, -finer.residual(at, p)[:, None]).x[:, 0])

    def change(at: Lanes) -> Values:
        largest = np.zeros(len(z))
        for name in ("displacements", "turns_of_ends", "largest_curvatures"):
            apart = np.abs(getattr(finer, name)(at, p) - getattr(frame, name)(z, p))
            largest = np.maximum(largest, apart.max(axis=tuple(range(1, apart.ndim))))
        return largest

    return error_by_refinement(start, correction, change)
