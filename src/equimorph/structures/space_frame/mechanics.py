"""Mechanics of a frame in space: its matrix, solves with it, guesses, in batches."""

from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np

from equimorph.arrays import Entries, Flags, Float, Int, Lanes, Parameters, Sides, Values
from equimorph.linalg import BorderedSolution
from equimorph.linalg.dense import no_border
from equimorph.linalg.determinants import clear_overflows
from equimorph.linalg.lanes import over_lanes
from equimorph.linalg.sparse import SparseLayout
from equimorph.structures.discrete import linearise
from equimorph.structures.equations import AnyBorder, Direction, JointEquations, Shift, Solver
from equimorph.structures.space_frame.derivative_kernels import equations_lanes
from equimorph.structures.space_frame.energy_kernels import energies_lanes
from equimorph.structures.space_frame.guesses import random_guesses
from equimorph.structures.space_frame.kernels import linearise_lanes
from equimorph.structures.space_frame.lagrangian import SpatialFrameLagrangian
from equimorph.structures.space_frame.model import SpatialFrameModel
from equimorph.structures.space_frame.network import Turning
from equimorph.structures.space_frame.reduction_kernels import eliminate_lengths, restore_lengths
from equimorph.structures.spatial.mechanics import pairs_of
from equimorph.structures.spatial.quaternions import (
    are_near,
    conjugate,
    product,
    with_unit_rotations,
)

NONE = -1
"""Coordinate of an element, or entry, that there is none of."""


@dataclass(frozen=True, eq=False)
class Tables:
    """Sparsity of F_z in rotations, and what the kernel adds to which of its entries.

    Rows are three for each free node, one for each hinge, and the multipliers. Members are
    condensed onto the joints first; joints and multipliers follow by minimum degree.
    """

    model: SpatialFrameModel

    @cached_property
    def count(self) -> int:
        """Number of rows before the multipliers."""
        return 3 * len(self.model.free) + len(self.model.hinged)

    @cached_property
    def _body_of(self) -> Int[np.ndarray, " nodes"]:
        """The node whose rotation moves each: its parent, if it is hinged."""
        found = np.arange(len(self.model.turning))
        found[self.model.hinged] = self.model.parents
        return found

    @cached_property
    def hinge_of(self) -> Int[np.ndarray, " nodes"]:
        """Number of the hinge of each node, or −1."""
        found = np.full(len(self.model.turning), NONE)
        found[self.model.hinged] = np.arange(len(self.model.hinged))
        return found

    @cached_property
    def hinges_of(self) -> Int[np.ndarray, "elements 2"]:
        """Hinges of both ends of each element, or −1."""
        return np.asarray(self.hinge_of[self.model.nodes[:, [0, -1]]])

    @cached_property
    def dofs(self) -> Int[np.ndarray, "elements coordinates"]:
        """Row of each coordinate of an element: three a node, then the angles of its ends' hinges.

        −2 − k for the component k of what supports hold, −1 for a hinge that is not there.
        """
        model = self.model
        body = self._body_of[model.nodes]
        held = np.full(len(model.turning), NONE)
        held[model.held] = np.arange(len(model.held))
        axes = np.arange(3)
        free = 3 * model.place[body][..., None] + axes
        fixed = -2 - (3 * held[body][..., None] + axes)
        rows = np.where((model.turning[body] == Turning.HELD)[..., None], fixed, free)
        angles = np.where(self.hinges_of >= 0, 3 * len(model.free) + self.hinges_of, NONE)
        return np.concatenate([rows.reshape(len(rows), -1), angles], axis=1)

    @cached_property
    def _crossing(self) -> Int[np.ndarray, "elements most"]:
        """Row of each multiplier that has a force in an element; −1 beyond them."""
        acting = self.model.acting
        most = max(int(acting.ties.max(initial=0)), 1)
        some = np.arange(acting.numbers.shape[1]) < acting.ties[:, None]
        rows = np.where(some, self.count + acting.numbers, NONE)[:, :most]
        return np.asarray(rows[self.model.owner])

    @cached_property
    def _corner_pairs(self) -> Int[np.ndarray, "pairs 2"]:
        """Pairs of multipliers that supports tie by giving way."""
        m = self.model.multipliers
        return self.count + np.argwhere(np.tril(self.model.quadratic[:m, :m]))

    @cached_property
    def layout(self) -> SparseLayout:
        """One entry for each pair in an element, in a piece and the forces that pass it."""
        size = self.count + self.model.multipliers
        elements = self._pairs(self.dofs, self.dofs)
        borders = self._pairs(self._crossing, self.dofs)
        corners = self._pairs(self._crossing[self._first], self._crossing[self._first])
        soft = self.model.compliance > 0.0
        keys = [elements[elements >= 0], borders[borders >= 0], corners[soft][corners[soft] >= 0]]
        nodes = np.arange(size) * size + np.arange(size)
        own = 3 * np.arange(len(self.model.free))[:, None] + np.arange(3)
        inner = self._pairs(own, own)
        ties = self._corner_pairs[:, 0] * size + self._corner_pairs[:, 1]
        found = np.unique(np.concatenate([*keys, nodes, inner[inner >= 0], ties]))
        multipliers = self.model.multipliers
        return SparseLayout(found // size, found % size, size, multipliers, self.ranks)

    @property
    def _first(self) -> slice:
        """The first element of each piece."""
        return slice(None, None, self.model.mesh.elements)

    def _pairs(
        self, rows: Int[np.ndarray, "some r"], columns: Int[np.ndarray, "some c"]
    ) -> Int[np.ndarray, "some r c"]:
        """Keys of the entries of pairs of rows, row ≥ column; −1 where there is none."""
        size = self.count + self.model.multipliers
        a, b = rows[:, :, None], columns[:, None, :]
        keys = np.maximum(a, b) * size + np.minimum(a, b)
        return np.where((a >= 0) & (b >= 0), keys, NONE)

    def _slots(self, keys: np.ndarray) -> np.ndarray:
        """Entries with these keys; −1 where there is none."""
        layout = self.layout
        known = layout.rows * layout.size + layout.columns
        at = np.minimum(np.searchsorted(known, keys), len(known) - 1)
        return np.where(known[at] == keys, at, NONE)

    @cached_property
    def ranks(self) -> Int[np.ndarray, " size"]:
        """Turn of each row in the elimination: inner nodes of the pieces, then joints and forces.

        Without forces, what members join rigidly turns freely as a whole, unless a support holds
        it: one body or one angle of each such part waits until the end.
        """
        model = self.model
        bodies = np.arange(len(model.turning)) < len(model.network.bodies)
        nodes, angles = np.where(bodies[model.free], 1, 0), np.ones(len(model.hinged), int)
        for part in self._rigid_parts:
            turning = model.turning[part]
            if (turning == Turning.HELD).any():
                continue
            free = part[turning == Turning.FREE]
            if len(free):
                nodes[model.place[free[0]]] = 2
            else:
                angles[self.hinge_of[part[0]]] = 2
        return np.concatenate([np.repeat(nodes, 3), angles, np.ones(model.multipliers, int)])

    @property
    def _rigid_parts(self) -> list[Int[np.ndarray, " bodies"]]:
        """Bodies that members join, part by part; hinges join nothing."""
        part = np.arange(len(self.model.network.bodies))
        for a, b in self.model.network.body_of_end.tolist():
            part[part == part[b]] = part[a]
        return [np.flatnonzero(part == each) for each in np.unique(part)]

    @cached_property
    def node_slots(self) -> Int[np.ndarray, "free 6"]:
        """Entries of the lower triangle of each free node."""
        own = 3 * np.arange(len(self.model.free))[:, None] + np.arange(3)
        row, column = np.tril_indices(3)
        return self._slots(self._pairs(own, own)[:, row, column])

    @cached_property
    def constant(self) -> Float[np.ndarray, " entries"]:
        """Entries that do not depend on the state."""
        found = np.zeros(len(self.layout.rows))
        pairs = self._corner_pairs
        slots = self._slots(pairs[:, 0] * self.layout.size + pairs[:, 1])
        quadratic = self.model.quadratic
        found[slots] = quadratic[pairs[:, 0] - self.count, pairs[:, 1] - self.count]
        return found

    @cached_property
    def shared(self) -> tuple[np.ndarray, ...]:
        """What the kernel shares among lanes."""
        model = self.model
        rows = model.quadratic[: model.multipliers]
        at = np.argwhere(rows)
        arrays = (
            *self._elements, model.free, model.place, model.held,
            model.hinged, model.parents, model.hinge_axes, self.hinges_of, model.stiff_lengths,
            4.0 * model.node_weights[model.free], self.dofs,
            self._slots(self._pairs(self.dofs, self.dofs)),
            self._slots(self._pairs(self._crossing, self.dofs)),
            self._slots(self._pairs(self._crossing[self._first], self._crossing[self._first])),
            self.node_slots, at, rows[at[:, 0], at[:, 1]], self.constant,
        )  # fmt: skip
        return tuple(np.ascontiguousarray(array) for array in arrays)

    @property
    def _elements(self) -> tuple[np.ndarray, ...]:
        """What supports hold, elements, and the forces that act in pieces."""
        model, acting = self.model, self.model.acting
        return (
            model.patterns.turns[:, model.held], model.nodes, model.owner,
            model.mesh.reference.derivative, 1.0 / model.element_lengths,
            model.weights, model.tangents, model.arclengths, model.stiff, model.moment_of_strain,
            model.compliance, acting.counts, acting.ties, acting.numbers, acting.start, acting.drop,
            model.strains, model.elongation[..., None],
        )  # fmt: skip

    @cached_property
    def _by_jets(self) -> tuple[np.ndarray, ...]:
        """What supports hold, elements, forces that act in pieces, nodes and hinges."""
        model, acting = self.model, self.model.acting
        slopes = model.mesh.reference.derivative / model.element_lengths[:, None, None]
        return (
            model.patterns.turns[:, model.held], model.nodes, model.owner, slopes, model.weights,
            model.tangents, model.arclengths, model.stiff, model.moment_of_strain,
            model.compliance, acting.counts, acting.numbers, acting.start, acting.drop,
            model.strains, model.elongation[..., None], model.free, model.held, model.hinged,
            model.parents, model.hinge_axes,
        )  # fmt: skip

    @cached_property
    def of_jets(self) -> tuple[np.ndarray, ...]:
        """What the kernel of F and its derivatives along directions shares among lanes."""
        model = self.model
        arrays = *self._by_jets, model.stiff_lengths, model.quadratic[: model.multipliers]
        return tuple(np.ascontiguousarray(array) for array in arrays)

    @cached_property
    def of_moments(self) -> tuple[np.ndarray, ...]:
        """What the kernel of moments shares among lanes."""
        model, reference = self.model, self.model.mesh.reference
        sums = reference.integral * model.element_lengths[:, None, None]
        arrays = *self._by_jets, sums, reference.nodes, model.drawn
        return tuple(np.ascontiguousarray(array) for array in arrays)

    @cached_property
    def of_energy(self) -> tuple[np.ndarray, ...]:
        """What the kernel of energies shares among lanes."""
        model = self.model
        arrays = (
            *self._elements, model.free, model.place, model.held, model.hinged, model.parents,
            model.hinge_axes, model.stiff_lengths, model.quadratic,
        )  # fmt: skip
        return tuple(np.ascontiguousarray(array) for array in arrays)


LARGEST_TAIL = 5e-4
"""Highest Legendre coefficients of w, half of radians, of an element that represents its part."""


class SpatialFrameMechanics(SpatialFrameLagrangian, JointEquations):
    """Mechanics of the Lagrangian of a `SpatialFrameModel`; `SpatialFrame` adds names and checks.

    F_z is factored in rotations, three a node, from which lengths of quaternions are eliminated at
    the nodes: its pattern is that of `Tables`.
    """

    def __init__(self, model: SpatialFrameModel) -> None:
        super().__init__(model)
        self.tables = Tables(model)

    @property
    def layout(self) -> SparseLayout:
        """Sparsity of F_z in rotations."""
        return self.tables.layout

    # --- contract -------------------------------------------------------------------------------

    def energy(self, z: Lanes, p: Parameters) -> Values:
        """L without the multipliers' part."""
        self.scalars(z, p)
        found, given = np.empty(len(z)), [np.ascontiguousarray(each) for each in (z, p)]
        over_lanes(energies_lanes, self.tables.of_energy, given, [found])
        return found

    def second_derivative(self, z: Lanes, p: Parameters, v: Direction, w: Direction) -> Lanes:
        """D²F[v, w]."""
        for each in ((z, p), v, w):
            self.scalars(*each)
        given = [np.ascontiguousarray(each) for each in (z, p)]
        given += [np.stack(each, axis=1) for each in zip(v, w, strict=True)]
        out = np.empty((len(z), 4, self.size))
        over_lanes(equations_lanes, (*pairs_of(4), *self.tables.of_jets), given, [out])
        return out[:, 3].copy()

    def linearised(
        self, z: Lanes, p: Parameters, dp: Parameters, shift: Shift = None
    ) -> tuple[np.ndarray, ...]:
        """F, F_p·dp, and the entries of F_z − shift·mass in rotations with F and the shift."""
        lowered = np.zeros((len(z), 1)) if shift is None else shift[:, None]
        given = (z, p, dp, lowered)
        out = linearise(linearise_lanes, self.tables.shared, self.layout, given)
        first, last = 3 * len(self.model.free), self.tables.count
        slots = self.layout.diagonal[first:last]
        out[2][:, slots] -= lowered * self.mass[4 * len(self.model.free) :]
        return *out, out[0], lowered

    def solve(
        self, z: Lanes, p: Parameters, rhs: Sides, border: AnyBorder = None, shift: Shift = None
    ) -> BorderedSolution:
        """Solve with the KKT matrix F_z − shift·mass, bordered, by sparse LDLᵀ."""
        parts = self.linearised(z, p, np.zeros_like(p), shift)[2:]
        return self.solver(parts, z, p)(rhs, border)

    def solver(
        self, parts: tuple[np.ndarray, ...], z: Lanes, p: Parameters, shift: Shift = None
    ) -> Solver:
        """Solves with the matrix whose parts are given, which is reduced to rotations."""
        assert shift is None, "the parts contain it"
        entries, *at = parts
        return partial(self._solve_reduced, (z, *at), entries)

    def _solve_reduced(
        self, at: tuple[np.ndarray, ...], entries: Entries, rhs: Sides, border: AnyBorder
    ) -> BorderedSolution:
        """Solve with the matrix of these entries, which is reduced to rotations.

        at: states, F and shifts.
        """
        columns, rows, corner = no_border(len(rhs), self.size) if border is None else border
        free, (lanes, sides, width) = len(self.model.free), rhs.shape
        k = columns.shape[1]
        small = [np.empty((lanes, k, self.size - free)) for _ in range(2)]
        small += [np.empty((lanes, k, k)), np.empty((lanes, sides, width - free))]
        given = [np.ascontiguousarray(each) for each in (*at, columns, rows, corner, rhs)]
        over_lanes(eliminate_lengths, self._of_lengths, given, small)
        found = self.layout.solve(entries, (small[0], small[1], small[2]), small[3])
        x, negative, scale = np.empty(rhs.shape), np.empty(lanes, np.int64), np.empty((lanes, 2))
        given = [*given[:4], given[6], found.x]
        over_lanes(restore_lengths, self._of_lengths, given, [x, negative, scale])
        scale[:, 0] *= found.determinant[:, 0]
        scale[:, 1] += found.determinant[:, 1]
        clear_overflows(scale)
        negative += found.negative
        return BorderedSolution(x, negative, found.pivot_ratio, found.pivoted, scale)

    @cached_property
    def _of_lengths(self) -> tuple[np.ndarray, np.ndarray]:
        """Stiffness of the lengths of quaternions, and their masses."""
        return self.model.stiff_lengths, np.ascontiguousarray(self.mass[: self._rows : 4])

    # --- guesses --------------------------------------------------------------------------------

    def sample(self, p: Parameters, generator: np.random.Generator) -> Lanes:
        """Random turns and waves, in the plane of a plane frame, too, and forces."""
        q, angles, forces = random_guesses(self.model, len(p), generator)
        return np.concatenate([q.reshape(len(p), self._rows), angles, forces], axis=1)

    def as_guess(self, mean: Lanes) -> Lanes:
        """Means of states with rotations: quaternions of length 1."""
        return with_unit_rotations(mean, self._rows)

    def natural_guess(self, p: Parameters) -> Lanes:
        """The frame as drawn."""
        z = np.zeros((len(p), self.size))
        z[:, : self._rows : 4] = 1.0
        return z

    def may_resolve(self, z: Lanes, p: Parameters) -> Flags:
        """Whether rotations jump nowhere in an element: those that do are of the elements alone."""
        return are_near(self.turns(z, p)[:, self.model.nodes])

    @cached_property
    def _tail(self) -> Float[np.ndarray, "2 order"]:
        return np.asarray(self.model.mesh.reference.to_legendre[-2:])

    def resolved(self, z: Lanes, p: Parameters) -> Flags:
        """Whether the rotations are smooth in every element."""
        w = self.turns(z, p)[:, self.model.nodes]
        # relative to the first node: the size of a turn does not matter
        first = np.broadcast_to(conjugate(w[:, :, :1]), w.shape)
        tail = np.einsum("ci,leia->leca", self._tail, product(first, w))
        return np.asarray(np.abs(tail).max(axis=(1, 2, 3)) < LARGEST_TAIL)
