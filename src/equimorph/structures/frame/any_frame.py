"""What planar frames and frames in space have in common."""

from abc import abstractmethod
from dataclasses import replace
from functools import cached_property
from typing import Any, ClassVar, NamedTuple, NoReturn

import numpy as np

from equimorph.arrays import Float, Lanes, Parameters, Values, Velocity
from equimorph.errors import InputError
from equimorph.model import (
    Actuator,
    ActuatorKind,
    Couples,
    Descriptor,
    Drawing,
    Forces,
    Support,
    remember_call,
)
from equimorph.structures.collapse import Shortening
from equimorph.structures.frame.strength import StressedFrame
from equimorph.structures.material_points import MaterialPoints, SupportSpring, SupportSprings
from equimorph.structures.network import direction_of_mechanism
from equimorph.structures.resolution import Refinable
from equimorph.structures.rod.discretisation import error_by_refinement
from equimorph.tolerances import SINGULAR

WALKED = 17
"""Places along a piece of a member where it is drawn."""
SEGMENT = np.linspace(0.0, 1.0, WALKED)
"""Shares of the length of a piece at which it is drawn if an actuator works in it."""
NAMED = 6
"""Members that a message names."""
TURN = 1e-3
"""Largest turn of a mechanism that is looked at."""
MOVING = 1e-6
"""Displacement that counts as one, where members turn by as much."""
FINER = 4
"""Degrees by which the elements are higher that estimate the error."""
HIGHEST = 16
"""Highest degree of elements."""

Along = Float[np.ndarray, "lanes pieces points space"]


class Stretch(NamedTuple):
    """Points of a walk on one piece: which, the piece, whether from its start, shares of it."""

    points: np.ndarray
    piece: int
    forward: bool
    shares: np.ndarray


class AnyFrame(StressedFrame, Shortening, Refinable):
    """A frame: what its model says in the units of its user, and what is drawn of it."""

    stations: ClassVar[int]
    """Places along a piece at which a line load is drawn."""
    turn_of_unknowns: ClassVar[float]
    """Turn in radians of a node one of whose unknowns changes by 1."""

    def _describe(self) -> None:
        """Names and scales of parameters; refuse frames that are not sound."""
        model = self.model
        self.network, self.system = model.network, model.system
        self.resolution = model.mesh.elements, model.mesh.degree
        self.energy_scale, self.displacement_unit = model.energy, model.length
        self._set_parameters(model.patterns.length * model.length)
        self._refuse_singular()
        self._set_scales()

    @property
    def longest_piece(self) -> float:
        """Length of the longest piece of a member."""
        return float(self.model.network.lengths.max())

    def quantity(self, k: int) -> str:
        """What a parameter measures; "1" if it has several kinds of effects."""
        return self.model.patterns.quantity(k)

    def _set_scales(self) -> None:
        """Measure parameters by what turns a node by one radian, or bends a member by as much."""
        count = len(self.parameters)
        p = np.zeros((count, count))
        z = self.natural_guess(p)
        columns = self.parameter_derivative(z, p, np.eye(count))
        moves = self.solve(z, p, -columns[:, None]).x[:, 0, : self.unknowns]
        turns = self.turn_of_unknowns * np.abs(moves).max(axis=1)
        self.parameters = tuple(
            replace(each, scale=min(self.model.patterns.typical(k), 1.0 / max(turn, 1e-300)))
            for k, (each, turn) in enumerate(zip(self.parameters, turns.tolist(), strict=True))
        )

    def options(self) -> dict[str, Any]:
        """Resolution."""
        return {"elements": self.model.mesh.elements, "degree": self.model.mesh.degree}

    # --- soundness ------------------------------------------------------------------------------

    @property
    def unstressed(self) -> Any:
        """Mechanics of the frame without initial stress."""
        return self

    @abstractmethod
    def moved_by(self, turns: Float[np.ndarray, " rows"]) -> Float[np.ndarray, " unknowns"]:
        """Change of the unknowns by turns in the rows of `layout`."""

    @abstractmethod
    def circulating(
        self, forces: Float[np.ndarray, " multipliers"]
    ) -> Float[np.ndarray, "pieces space"]:
        """Forces in the pieces without loads."""

    @abstractmethod
    def turns_of_ends(self, z: Lanes, p: Parameters) -> Float[np.ndarray, "lanes pieces 2 ..."]:
        """Turns of the ends of the pieces."""

    @abstractmethod
    def largest_curvatures(self, z: Lanes, p: Parameters) -> Float[np.ndarray, "lanes pieces"]:
        """Largest bending curvature in every piece."""

    def _refuse_singular(self) -> None:
        """Refuse mechanisms, and forces that deformations do not determine.

        The joint or member that moves is named, or the members that supports stretch.
        """
        bare = self.unstressed
        p = np.zeros((1, bare.model.patterns.count))
        z = bare.natural_guess(p)
        entries = bare.parts(z, p)[0]
        if bare.layout.smallest_size(entries) > 10.0 * SINGULAR * float(np.abs(entries).max()):
            return
        values, vectors = np.linalg.eigh(bare.layout.dense(entries)[0])
        least = int(np.argmin(np.abs(values)))
        if np.abs(values[least]) > SINGULAR * np.abs(values).max():
            return
        count = bare.layout.size - self.constraints
        turns, forces = vectors[:count, least], vectors[count:, least]
        if np.abs(turns).max() > np.abs(forces).max(initial=0.0):
            self._refuse_mechanism(turns)
        self._refuse_stress(forces)

    def _refuse_mechanism(self, turns: Float[np.ndarray, " rows"]) -> NoReturn:
        made, p = self.model.network, np.zeros((2, self.model.patterns.count))
        z = self.natural_guess(p)
        change = self.moved_by(TURN * turns / np.abs(turns).max())
        z[0, : self.unknowns] += change
        z[1, : self.unknowns] -= change
        there, back = self.displacements(z, p)
        if np.abs(there - back).max() > MOVING:
            at, direction = direction_of_mechanism(there - back)
            what = f"joint {made.joints[at]} can move along ({direction})"
        else:
            ends = np.abs(self.turns_of_ends(z[:1], p[:1])[0])
            piece = int(np.argmax(ends.reshape(len(ends), -1).max(axis=1)))
            what = f"member {made.name_of_member(piece)} can turn about itself"
        raise InputError(
            f"`frame` must not be a mechanism; {what} without force. Add a member or a support, or "
            "leave out a hinge."
        )

    def _refuse_stress(self, forces: Float[np.ndarray, " multipliers"]) -> NoReturn:
        made, size = self.model.network, np.linalg.norm(self.circulating(forces), axis=1)
        names = [made.edge_names[k] for k in np.flatnonzero(size > 0.1 * size.max())]
        if len(names) > NAMED:
            names = [*names[:NAMED], f"{len(names) - NAMED} more"]
        raise InputError(
            f"`supports` must not stretch or squeeze inextensible members; got {', '.join(names)} "
            "held at a length that they have already. Give one of them EA, or release a support."
        )

    @abstractmethod
    def guess_for(self, finer: Any, z: Lanes, p: Parameters) -> Float[np.ndarray, "lanes finer"]:
        """States as guesses of those of the same frame with other elements."""

    @cached_property
    def refined(self) -> Any:
        """The same frame with elements of a degree higher by four."""
        data = {name: value for name, value in self.identity().items() if name != "kind"}
        return type(self)(**{**data, "degree": min(data["degree"] + FINER, HIGHEST)})

    def error_estimate(self, z: Lanes, p: Parameters) -> Values:
        """Bound of the errors of displacements, turns of ends and max |κ|, by a higher degree.

        Twice their largest change on a finer frame; displacements and curvature are relative to the
        mean length of the pieces of members. Infinite where the finer frame has no equilibrium near
        the state, as may happen at a fold.
        """
        finer = self.refined

        def correction(at: Lanes) -> Lanes:
            return np.asarray(finer.solve(at, p, -finer.residual(at, p)[:, None]).x[:, 0])

        def change(at: Lanes) -> Values:
            largest = np.zeros(len(z))
            for name in ("displacements", "turns_of_ends", "largest_curvatures"):
                apart = np.abs(getattr(finer, name)(at, p) - getattr(self, name)(z, p))
                largest = np.maximum(largest, apart.max(axis=tuple(range(1, apart.ndim))))
            return largest

        return error_by_refinement(self.guess_for(finer, z, p), correction, change)

    # --- pictures -------------------------------------------------------------------------------

    @abstractmethod
    def stretched_tangents(
        self, z: Lanes, p: Parameters
    ) -> Float[np.ndarray, "lanes pieces elements order space"]:
        """Derivatives of the places by arclength as drawn, at the nodes of every element."""

    def outline(self, z: Lanes, p: Parameters, s: Float[np.ndarray, " points"]) -> Along:
        """Places along the pieces at shares of their lengths, moves of the joints included."""
        model, mesh, field = self.model, self.model.mesh, self.stretched_tangents(z, p)
        count = mesh.elements * mesh.degree
        inner = field[:, :, :, :-1].reshape(*field.shape[:2], count, field.shape[4])
        whole = np.concatenate([inner, field[:, :, -1:, -1]], axis=2)
        moved = np.einsum("ij,lkja->lkia", mesh.integration(s)[:, : count + 1], whole)
        joints = model.network.places[None] / model.length + self.displacements(z, p)
        starts = joints[:, model.network.ends[:, 0]]
        return np.asarray(starts[:, :, None] + moved * model.lengths[:, None, None])

    def walk(self, s: Float[np.ndarray, " points"] | None) -> list[Stretch]:
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
    ) -> Float[np.ndarray, "lanes points space"]:
        """Places along a walk over all pieces of members, some of which it passes twice.

        `s` runs from 0 to 1 along it; all pieces get equal lengths.
        """
        parts = self.walk(s)
        shares, at = np.unique(np.concatenate([each.shares for each in parts]), return_inverse=True)
        whole, out = self.outline(z, p, shares), np.empty((len(z), len(at), self.network.space))
        for points, piece, _, _ in parts:
            out[:, points] = whole[:, piece, at[: len(points)]]
            at = at[len(points) :]
        return np.asarray(out * self.model.length)

    @abstractmethod
    def drawn_supports(
        self, z: Lanes, p: Parameters, places: Float[np.ndarray, "lanes joints space"]
    ) -> tuple[Support, ...]:
        """Symbols of the supports, at places of the joints."""

    def drawing(self, z: Lanes, p: Parameters) -> Drawing:
        """Supports of the joints, loads on joints and members, members that bend or lengthen."""
        model, given = self.model, self.model.patterns
        places = model.network.places + model.length * self.displacements(z, p)
        loaded = np.flatnonzero(given.forces.any(axis=(0, 2)))
        turned = np.flatnonzero(given.couples.any(axis=0))
        forces, couples = [*self._line_loads(z, p), *self.drawn_pressures(z, p)], []
        if len(loaded):
            vectors = model.force * np.einsum("lk,kja->lja", p, given.forces[:, loaded])
            forces.append(Forces(places[:, loaded], vectors))
        if len(turned):
            moments = model.energy * np.einsum("lk,kj->lj", p, given.couples[:, turned])
            couples.append(Couples(places[:, turned], moments))
        supports = self.drawn_supports(z, p, places)
        return Drawing(supports, tuple(forces), tuple(couples), self._drawn_actuators(z, p))

    def _line_loads(self, z: Lanes, p: Parameters) -> list[Forces]:
        model, given = self.model, self.model.patterns
        lines = np.flatnonzero(given.lines.any(axis=(0, 2)))
        if not len(lines):
            return []
        stations = np.linspace(0.0, 1.0, self.stations)
        along = model.length * self.outline(z, p, stations)[:, lines]
        density = np.einsum("lk,kma->lma", p, given.lines[:, lines]) * model.force / model.length
        vectors = np.repeat(density[:, :, None], len(stations), axis=2)
        pairs = zip(np.moveaxis(along, 1, 0), np.moveaxis(vectors, 1, 0), strict=True)
        return [Forces(*each, distributed=True) for each in pairs]

    def drawn_pressures(self, z: Lanes, p: Parameters) -> list[Forces]:
        """Pressures, which frames in space do not have."""
        return []

    def _drawn_actuators(self, z: Lanes, p: Parameters) -> tuple[Actuator, ...]:
        given = self.model.patterns
        kinds = (
            (ActuatorKind.LENGTH, given.length.any(axis=0)),
            (ActuatorKind.CURVATURE, given.strains.any(axis=(0, 2))),
        )
        if not any(some.any() for _, some in kinds):
            return ()
        lines = self.model.length * self.outline(z, p, SEGMENT)
        return tuple(
            Actuator(kind, lines[:, k]) for kind, some in kinds for k in np.flatnonzero(some)
        )

    # --- in time --------------------------------------------------------------------------------

    @property
    def massless(self) -> str:
        """How a frame is given its mass."""
        return "Give every member one, like mass=0.2."

    def inertia(self, z: Lanes, p: Parameters) -> Float[np.ndarray, "lanes unknowns unknowns"]:
        """Mass matrix of the members, each as heavy everywhere."""
        own = self.material
        return super().inertia(z, p) if own is None else own.inertia(z, p)

    def inertial_force(self, z: Lanes, p: Parameters, velocity: Velocity) -> Velocity:
        """Forces of inertia of the members at constant rates of the unknowns."""
        own = self.material
        if own is None:
            return super().inertial_force(z, p, velocity)
        return own.inertial_force(z, p, velocity)

    @property
    @abstractmethod
    def springs_of_joints(self) -> list[SupportSpring]:
        """Stiffness of each spring along an axis, gaps that it opens, and moves of all joints."""

    @property
    def sprung(self) -> MaterialPoints | None:
        """Points of the members, where the unknowns leave springs at supports free."""
        points = self.material
        if points is None:
            return None
        starts = np.repeat(self.network.ends[:, 0], len(self.model.mesh.weights))
        each = [one._replace(moves=one.moves[starts]) for one in self.springs_of_joints]
        springs = SupportSprings.of(each, self.constraints, self.network.space)
        return None if springs.follow else replace(points, springs=springs)

    @property
    def material(self) -> MaterialPoints | None:
        """Masses of the points of the members; None if a mass is not known."""
        model, space = self.model, self.network.space
        if model.masses is None:
            return None

        def places(z: Lanes, p: Parameters) -> Float[np.ndarray, "lanes points space"]:
            return self.outline(z, p, model.mesh.nodes).reshape(len(z), -1, space)

        heavy = model.masses * model.length**2 / self.energy_scale
        return MaterialPoints(self, places, np.outer(heavy, model.mesh.weights).ravel())

    # --- descriptors ----------------------------------------------------------------------------

    @property
    def may_collapse(self) -> bool:
        """A member that stretches may be pressed together, too."""
        return any(each.EA is not None for each in self.model.network.made)

    @property
    @remember_call
    def max_curvature(self) -> Descriptor:
        """Largest bending curvature in all members."""
        return self._curvature("max_curvature", "max |κ|", slice(None))

    @remember_call
    def member_curvature(self, member: str) -> Descriptor:
        """Largest bending curvature in a member."""
        pieces = [at for at, _ in self.model.network.pieces_of(member)]
        return self._curvature(f"max_curvature({member})", "", pieces)

    def _curvature(self, name: str, symbol: str, pieces: Any) -> Descriptor:
        def value(z: Lanes, p: Parameters) -> Values:
            largest = self.largest_curvatures(z, p)[:, pieces]
            return np.asarray(largest.max(axis=1) / self.model.length)

        return self._make(name, "1/length", value, symbol)
