"""Mechanics of a frame: energy, forces, stiffness and their derivatives, for batches of lanes."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar, NamedTuple

import numpy as np

from equimorph.arrays import (
    Bool,
    Entries,
    Flags,
    Float,
    Int,
    Lanes,
    Nodal,
    Parameters,
    Scalars,
    Values,
)
from equimorph.linalg.dense import multiply
from equimorph.linalg.graphs import components
from equimorph.linalg.intervals import Interval
from equimorph.linalg.lanes import over_lanes
from equimorph.linalg.sparse import SparseLayout
from equimorph.structures.discrete import DiscreteStructure, linearise
from equimorph.structures.equations import Direction, Enclosed
from equimorph.structures.frame.kernels import linearise_lanes, second_lanes
from equimorph.structures.frame.model import FrameModel
from equimorph.structures.frame.pressure import FramePressure
from equimorph.structures.rod.planar_energy import PlanarEnergy
from equimorph.structures.whole_turns import WholeTurns


@dataclass(frozen=True, eq=False)
class Tables:
    """Sparsity of F_z, and what the kernel adds to which of its entries.

    Members are condensed onto their ends first, then the multipliers are eliminated, then the
    joints: what remains for these is the network's stiffness.
    """

    model: FrameModel

    @cached_property
    def layout(self) -> SparseLayout:
        """One entry for each pair in an element, in a member and the forces that pass it."""
        model, n = self.model, self.model.unknowns
        found = {(i, i) for i in range(n + model.multipliers)}
        for row in model.place[model.nodes].tolist():
            found |= {(i, j) for i in row for j in row if i >= j >= 0}
        for chain in model.chains:
            row = model.place[chain.nodes].tolist()
            found |= {(i, j) for i in row for j in row if i >= j >= 0}
        forces = self.which
        for m, row in enumerate(model.place[model.piece_nodes].tolist()):
            through = [n + c for c in forces[m, : self.ties[m, 0]].tolist()]
            found |= {(c, i) for c in through for i in row if i >= 0}
            if model.network.made[m].EA is not None:
                found |= {(c, d) for c in through for d in through if c >= d}
        corner = model.quadratic[: model.multipliers, : model.multipliers]
        found |= {(n + c, n + d) for c, d in zip(*np.nonzero(np.tril(corner)), strict=True)}
        rows, columns = np.array(sorted(found)).T
        return SparseLayout(rows, columns, n + model.multipliers, model.multipliers, self.ranks)

    @cached_property
    def ranks(self) -> Int[np.ndarray, " size"]:
        """Turn of each variable in the elimination.

        Without its forces, a member that is hinged at both ends turns freely: its start waits.
        """
        model = self.model
        late = np.zeros(len(model.place), bool)
        late[model.joint_nodes[model.network.rigid]] = True
        late[model.piece_nodes[model.network.hinged.all(axis=1), 0]] = True
        of_nodes = np.where(late, 2, 0)[model.place >= 0]
        return np.concatenate([of_nodes, np.ones(model.multipliers, int)])

    @cached_property
    def _slots(self) -> dict[tuple[int, int], int]:
        pairs = zip(self.layout.rows.tolist(), self.layout.columns.tolist(), strict=True)
        return {pair: slot for slot, pair in enumerate(pairs)}

    @cached_property
    def ties(self) -> Int[np.ndarray, "members 2"]:
        """Number of multipliers, and of scalars, that have a force in each member."""
        acting, m = self.model.acting, self.model.multipliers
        return np.stack([acting[:, :m].sum(axis=1), acting.sum(axis=1)], axis=1)

    @cached_property
    def which(self) -> Int[np.ndarray, "members most"]:
        """These scalars, multipliers first; rows are filled up with 0."""
        acting = self.model.acting
        found = np.zeros((len(acting), max(int(self.ties[:, 1].max()), 1)), int)
        for m, row in enumerate(acting):
            found[m, : row.sum()] = np.flatnonzero(row)
        return found

    def _compact(self, table: Float[np.ndarray, "points scalars"]) -> Float[np.ndarray, "points n"]:
        """Columns of the scalars that have a force in the member of each point."""
        columns = self.which[self.model.owner]
        some = np.arange(columns.shape[1]) < self.ties[self.model.owner, 1:]
        return np.where(some, np.take_along_axis(table, columns, axis=1), 0.0)

    @cached_property
    def diagonal(self) -> Int[np.ndarray, " nodes"]:
        """Entry on the diagonal of each node; −1 for prescribed ones."""
        place = self.model.place
        return np.where(place >= 0, self.layout.diagonal[place], -1)

    @cached_property
    def edges(self) -> Int[np.ndarray, "points most"]:
        """Entry of each multiplier in `which` and the node at each point, or −1."""
        model, n = self.model, self.model.unknowns
        places = model.place[model.nodes].ravel().tolist()
        rows = self.which[model.owner].tolist()
        slots = [
            [self._slots.get((n + c, i), -1) for c in row]
            for row, i in zip(rows, places, strict=True)
        ]
        return np.array(slots)

    @cached_property
    def corners(self) -> Int[np.ndarray, "members most most"]:
        """Entry of each pair of multipliers in `which`, or −1."""
        n = self.model.unknowns
        rows = self.which.tolist()
        return np.array(
            [[[self._slots.get((n + c, n + d), -1) for d in row] for c in row] for row in rows]
        )

    @cached_property
    def constant(self) -> Float[np.ndarray, " entries"]:
        """Entries that do not depend on the state."""
        model, m = self.model, self.model.multipliers
        total = np.zeros((model.unknowns + m, model.unknowns + m))
        for element, nodes in zip(model.stiffness, model.nodes, strict=True):
            places = model.place[nodes]
            some = places >= 0
            total[np.ix_(places[some], places[some])] += element[np.ix_(some, some)]
        free = model.place >= 0
        total[model.place[free], model.place[free]] += model.springs[free]
        total[model.unknowns :, model.unknowns :] = model.quadratic[:m, :m]
        return np.asarray(total[self.layout.rows, self.layout.columns])

    @cached_property
    def held(self) -> Bool[np.ndarray, " elements"]:
        """Elements with a prescribed node."""
        return np.asarray((self.model.place[self.model.nodes] < 0).any(axis=1))

    @cached_property
    def shared(self) -> tuple[np.ndarray, ...]:
        """What the kernel shares among lanes."""
        model = self.model
        slope = np.argwhere(model.slope)
        arrays = (
            model.nodes, self.held, model.place, model.stiffness, model.springs, model.softness,
            self._compact(model.sine), self._compact(model.cosine), self.which, self.ties,
            self.diagonal, self.edges, self.corners, model.stretch, model.turned, slope,
            model.slope[slope[:, 0], slope[:, 1]], model.quadratic[: model.multipliers],
            self.constant,
        )  # fmt: skip
        return tuple(np.ascontiguousarray(array) for array in arrays)

    @cached_property
    def of_points(self) -> tuple[np.ndarray, ...]:
        """What kernels of second derivatives and moments share among lanes."""
        model = self.model
        arrays = (
            model.nodes, model.place, model.softness, self._compact(model.sine),
            self._compact(model.cosine), self.which, self.ties, model.stretch, model.turned,
        )  # fmt: skip
        return tuple(np.ascontiguousarray(array) for array in arrays)


Points = Float[np.ndarray, "lanes points"]

GUESSES = 3.0
"""Random guesses for each start of a search."""
RESOLVED = 1e-3
"""Largest of the two highest Legendre coefficients of a turn in a resolved element."""


class Pulls(NamedTuple):
    """Tension P times the weights, P' = dP/dψ, and the strain e, at the points."""

    tension: Points
    shear: Points
    strain: Points


class FrameMechanics(DiscreteStructure):
    """Mechanics of a frame, whose Lagrangian is a `FrameModel`; `Frame` adds names and checks."""

    kind: ClassVar[str] = "frame"

    def __init__(self, model: FrameModel) -> None:
        self.model, self.tables = model, Tables(model)
        self.unknowns, self.constraints = model.unknowns, model.multipliers
        self.mass = model.mass

    @cached_property
    def pressure(self) -> FramePressure | None:
        """What pressures do; None without any."""
        chains = self.model.chains
        return FramePressure(self.model, self.layout, chains) if chains else None

    @property
    def layout(self) -> SparseLayout:
        """Sparsity of F_z."""
        return self.tables.layout

    # --- states ---------------------------------------------------------------------------------

    def scalars(self, z: Lanes, p: Parameters, constant: float = 1.0) -> Scalars:
        """(Multipliers, parameters, 1); the constant is 0 for directions."""
        ones = np.full((len(z), 1), constant)
        return np.concatenate([z[:, self.unknowns :], p, ones], axis=1)

    def turns(self, z: Lanes, y: Scalars) -> Nodal:
        """ψ at all nodes."""
        place = self.model.place
        return np.where(place >= 0, z[:, place], multiply(y, self.model.turned.T))

    def _fields(
        self, z: Lanes, p: Parameters, constant: float = 1.0
    ) -> tuple[Scalars, Nodal, Points]:
        """Scalars, turns of the nodes, and strains at the points."""
        y = self.scalars(z, p, constant)
        return y, self.turns(z, y), multiply(y, self.model.stretch.T)[:, self.model.owner]

    def _turned(self, turns: Nodal) -> tuple[Points, Points]:
        """Sines and cosines of ψ at the points."""
        psi = turns[:, self.model.nodes.ravel()]
        return np.sin(psi), np.cos(psi)

    def _pulls(self, y: Scalars, turned: tuple[Points, Points], strain: Points) -> Pulls:
        """P, P' and e for sines and cosines of the turns at the points."""
        sine, cosine = turned
        across, along = multiply(y, self.model.sine.T), multiply(y, self.model.cosine.T)
        return Pulls(across * sine + along * cosine, across * cosine - along * sine, strain)

    def stretches(self, z: Lanes, p: Parameters) -> tuple[Points, Points]:
        """Turns ψ, and lengths relative to the free ones, at the points."""
        y, turns, strain = self._fields(z, p)
        tension = self._pulls(y, self._turned(turns), strain).tension
        return turns[:, self.model.nodes.ravel()], 1.0 + strain + self.model.softness * tension

    # --- contract -------------------------------------------------------------------------------

    def linearised(self, z: Lanes, p: Parameters, dp: Parameters) -> tuple[Lanes, Lanes, Entries]:
        """F, F_p·dp and the entries of F_z."""
        out = linearise(linearise_lanes, self.tables.shared, self.layout, (z, p, dp))
        if self.pressure is not None:
            y, dy = self.scalars(z, p), self.scalars(np.zeros_like(z), dp, 0.0)
            turns, moved = self.turns(z, y), self.turns(np.zeros_like(z), dy)
            free, (residual, column, entries) = self.model.place >= 0, out
            residual[:, : self.unknowns] += self.pressure.moments(y, turns)[:, free]
            column[:, : self.unknowns] += self.pressure.change(y, turns, dy, moved)[:, free]
            self.pressure.add_entries(entries, y, turns)
        return out

    @cached_property
    def planar_energy(self) -> PlanarEnergy:
        """The Lagrangian as tables, with N = −P."""
        model = self.model
        points = -model.sine.T, -model.cosine.T, model.stretch[model.owner].T
        sines, cosines, stretch = (np.ascontiguousarray(each) for each in points)
        return PlanarEnergy(
            place=model.place, turned=model.turned, elements=model.nodes,
            stiffness=model.stiffness, springs=model.springs, slope=model.slope.T,
            points=model.nodes.ravel(), sine=sines, cosine=cosines, stretch=stretch,
            tension=np.zeros_like(sines), softness=model.softness, quadratic=model.quadratic,
            pressure=np.array([each.row for each in model.chains]).reshape(-1, model.scalars),
            areas=tuple(each.whole_area for each in model.chains),
        )  # fmt: skip

    def enclosure(self, z: Interval, p: Interval) -> Enclosed:
        """Bounds over boxes."""
        return self.planar_energy.bounds(z, p)

    def plain_energy(self) -> dict[str, Any]:
        """Tables of the Lagrangian."""
        return self.planar_energy.numbers()

    def energy(self, z: Lanes, p: Parameters) -> Values:
        """Energy of members, springs and loads: L − λ·∂L/∂λ, so that constraints add nothing."""
        model, (y, turns, strain) = self.model, self._fields(z, p)
        pulls = self._pulls(y, self._turned(turns), strain)
        total = 0.5 * (multiply(turns, self.planar_energy.assembled) * turns).sum(axis=1)
        total -= (multiply(y, model.slope.T) * turns).sum(axis=1)
        stored = (1.0 + strain + 0.5 * model.softness * pulls.tension) * pulls.tension
        total -= stored.sum(axis=1)
        total += 0.5 * (multiply(y, model.quadratic) * y).sum(axis=1)
        if self.pressure is not None:
            total += self.pressure.energy(y, turns)
        gaps = self.residual(z, p)[:, self.unknowns :]
        return np.asarray(total - (z[:, self.unknowns :] * gaps).sum(axis=1))

    def nodal_moments(self, z: Lanes, p: Parameters) -> Nodal:
        """∂L/∂ψ at all nodes: zero at unknown ones, a support's couple where it is prescribed."""
        model, (y, turns, strain) = self.model, self._fields(z, p)
        pulls = self._pulls(y, self._turned(turns), strain)
        stretch = 1.0 + strain + model.softness * pulls.tension
        total = multiply(turns, self.planar_energy.assembled) - multiply(y, model.slope.T)
        if self.pressure is not None:
            total += self.pressure.moments(y, turns)
        return np.asarray(total - multiply(stretch * pulls.shear, self._gather))

    @cached_property
    def _gather(self) -> Float[np.ndarray, "points nodes"]:
        """Sum at the nodes."""
        return np.asarray(np.eye(len(self.model.place))[self.model.nodes.ravel()])

    def effort(self, z: Lanes, p: Parameters) -> Parameters:
        """∂L/∂p: what actuators bear, and minus the travel of loads."""
        model, (y, turns, strain) = self.model, self._fields(z, p)
        sine, cosine = turned = self._turned(turns)
        pulls = self._pulls(y, turned, strain)
        stretch = 1.0 + strain + model.softness * pulls.tension
        own = model.own
        total = multiply(y, model.quadratic[:, own]) - multiply(turns, model.slope[:, own])
        total -= multiply(stretch * sine, model.sine[:, own])
        total -= multiply(stretch * cosine, model.cosine[:, own])
        total -= multiply(pulls.tension, model.stretch[model.owner][:, own])
        held = model.place < 0
        if self.pressure is not None:
            total += self.pressure.effort(turns)[:, own]
        if held.any():
            total += multiply(self.nodal_moments(z, p)[:, held], model.turned[held][:, own])
        return np.asarray(total)

    def second_derivative(self, z: Lanes, p: Parameters, v: Direction, w: Direction) -> Lanes:
        """D²F[v, w]."""
        given = [np.ascontiguousarray(each) for each in (z, p, *v, *w)]
        out = np.empty(given[0].shape)
        if len(out):
            over_lanes(second_lanes, self.tables.of_points, given, [out])
        if self.pressure is not None:
            (y, turns, _), *both = (
                self._fields(*each, constant)
                for each, constant in (((z, p), 1.0), (v, 0.0), (w, 0.0))
            )
            changes = [each for yv, tv, _ in both for each in (yv, tv)]
            bent = self.pressure.second(y, turns, *changes)
            out[:, : self.unknowns] += bent[:, self.model.place >= 0]
        return out

    # --- guesses --------------------------------------------------------------------------------

    @property
    def guesses_per_start(self) -> float:
        """Three at least: one in a hundred leads to states whose joints turn far."""
        return max(super().guesses_per_start, GUESSES)

    def sample(self, p: Parameters, generator: np.random.Generator) -> Lanes:
        """Random turns of the joints around those of supports, waves along the members, and forces.

        A few half waves in each member and forces of the size of its buckling load.
        """
        model, lanes = self.model, len(p)
        nodes = np.zeros((lanes, len(model.place)))
        around = self._turns_of_supports(p)
        turn = generator.normal(size=around.shape)
        modes, s = np.arange(1, 4), np.linspace(0.0, 1.0, model.piece_nodes.shape[1])
        size = generator.uniform(size=(lanes, 1))
        for row, ends in zip(model.piece_nodes, model.network.ends, strict=True):
            base, middle = (
                each[:, ends[:1]] * (1.0 - s) + each[:, ends[1:]] * s for each in (turn, around)
            )
            waves = generator.normal(size=(lanes, len(modes))) * (1.5 / modes)
            nodes[:, row] = middle + size * (base + waves @ np.sin(np.pi * np.outer(modes, s)))
        forces = 10.0 * size * generator.normal(size=(lanes, self.constraints))
        return np.concatenate([nodes[:, model.place >= 0], forces], axis=1)

    def _turns_of_supports(self, p: Parameters) -> Float[np.ndarray, "lanes joints"]:
        """Turns that supports hold, or springs have at rest; their mean where there is neither."""
        model, node = self.model, self.model.joint_nodes
        known = ((model.place < 0) | (model.springs > 0.0))[node] & (node >= 0)
        found = (self.scalars(np.zeros((len(p), self.size)), p) @ model.turned.T)[:, node]
        mean = found[:, known].sum(axis=1, keepdims=True) / max(int(known.sum()), 1)
        return np.asarray(np.where(known, found, mean))

    @cached_property
    def whole_turns(self) -> WholeTurns:
        """Turns by 2π of each rigidly joined part that no support holds."""
        model = self.model
        row, free = model.piece_nodes, model.place >= 0
        joined = np.stack([row[:, :-1], row[:, 1:]], axis=2).reshape(-1, 2)
        part = components(len(free), joined)
        parts = part[free] == np.setdiff1d(part, part[~free])[:, None]
        return WholeTurns.of_parts(
            parts, (parts & (model.springs[free] > 0.0)).any(axis=1), self.size
        )

    def resolved(self, z: Lanes, p: Parameters) -> Flags:
        """Whether the highest Legendre coefficients of ψ are small in every element."""
        psi = self.turns(z, self.scalars(z, p))
        tail = np.abs(psi[:, self.model.nodes] @ self.model.mesh.reference.to_legendre[-2:].T)
        return np.asarray(tail.max(axis=(1, 2)) < RESOLVED)
