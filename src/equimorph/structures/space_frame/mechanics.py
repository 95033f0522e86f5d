"""Mechanics of a frame in space: its matrix, solves with it, guesses, in batches."""

from functools import cached_property, partial
from typing import NamedTuple

import numpy as np

from equimorph.array_types import Float
from equimorph.arrays import Entries, Flags, Lanes, Parameters, Sides, Values
from equimorph.linalg import BorderedSolution
from equimorph.linalg.dense import no_border
from equimorph.linalg.sparse import SparseLayout
from equimorph.structures.discrete import linearise
from equimorph.structures.equations import AnyBorder, JointEquations, Shift, Solver
from equimorph.structures.space_frame.kernels import linearise_lanes
from equimorph.structures.space_frame.lagrangian import SpatialFrameLagrangian
from equimorph.structures.space_frame.model import SpatialFrameModel
from equimorph.structures.space_frame.tables import Tables
from equimorph.structures.spatial.quaternions import RIGHT, conjugate, exponential, product

LARGEST_TAIL = 5e-4
"""Highest Legendre coefficients of w, half of radians, of an element that represents its part."""
FORCES = 10.0
"""Spread of the forces of random guesses, in units of bending stiffness over length squared."""


class Coordinates(NamedTuple):
    """Lengths ρ of the free quaternions and rotations of them, in place of their four numbers.

    radius: ρ; basis: the unit quaternion and its products with e₁, e₂, e₃, in rows; pivot: second
    derivative by ρ; mixed: slope by the rotation over ρ.
    """

    radius: Float[np.ndarray, "lanes free"]
    basis: Float[np.ndarray, "lanes free 4 4"]
    pivot: Float[np.ndarray, "lanes free"]
    mixed: Float[np.ndarray, "lanes free 3"]


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

    def linearised(
        self, z: Lanes, p: Parameters, dp: Parameters, shift: Shift = None
    ) -> tuple[np.ndarray, ...]:
        """F, F_p·dp, and the entries of F_z − shift·mass in rotations with F and the shift."""
        lowered = np.zeros(len(z)) if shift is None else shift
        y = self.scalars(z, p)
        rates = np.zeros_like(y)
        rates[:, self.constraints : -1] = dp
        turns = self.held_turns(np.stack([y, rates]))
        moved = np.einsum("kab,l...b->l...ka", RIGHT, turns[0])
        velocity = 2.0 * np.einsum("l...ka,l...a->l...k", moved, turns[1])
        count = len(self.model.held)
        held = turns[0].reshape(len(z), 4 * count), velocity.reshape(len(z), 3 * count)
        given = (z, p, dp, *held, lowered[:, None])
        out = linearise(linearise_lanes, self.tables.shared, self.layout, given)
        first, last = 3 * len(self.model.free), self.tables.count
        slots = self.layout.diagonal[first:last]
        out[2][:, slots] -= lowered[:, None] * self.mass[4 * len(self.model.free) :]
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
        entries, residual, lowered = parts
        at = self._coordinates(z, residual, lowered)
        return partial(self._solved, at, entries)

    # --- solves in rotations --------------------------------------------------------------------

    def _coordinates(self, z: Lanes, residual: Lanes, shift: Values) -> Coordinates:
        """Lengths and rotations at states with their F."""
        q, slope = self.quaternions(z), self.quaternions(residual)
        radius = np.linalg.norm(q, axis=2)
        unit = q / radius[..., None]
        turned = np.einsum("kab,lnb->lnka", RIGHT, unit)
        basis = np.concatenate([unit[:, :, None], turned], axis=2)
        pivot = 0.5 * self.model.stiff_lengths * (3.0 * radius**2 - 1.0)
        pivot = pivot - shift[:, None] * self.mass[: self._rows : 4]
        mixed = 0.5 * np.einsum("lnka,lna->lnk", turned, slope)
        return Coordinates(radius, basis, pivot, mixed)

    def _split(
        self, at: Coordinates, rows: Float[np.ndarray, "lanes k size"]
    ) -> tuple[Float[np.ndarray, "lanes k free"], Float[np.ndarray, "lanes k reduced"]]:
        """Rows by lengths, and by rotations and all else with the lengths eliminated."""
        lanes, k = rows.shape[:2]
        free = rows[:, :, : self._rows].reshape(lanes, k, len(self.model.free), 4)
        turned = np.einsum("lnka,lsna->lsnk", at.basis, free)
        along = turned[..., 0]
        across = 0.5 * at.radius[:, None, :, None] * turned[..., 1:]
        across = across + (at.mixed / at.pivot[..., None])[:, None] * along[..., None]
        flat = across.reshape(lanes, k, 3 * len(self.model.free))
        return along, np.concatenate([flat, rows[:, :, self._rows :]], axis=2)

    def _solved(
        self,
        at: Coordinates,
        entries: Entries,
        rhs: Sides,
        border: AnyBorder,
    ) -> BorderedSolution:
        """Solve with the matrix of these entries, which is reduced to rotations."""
        around = no_border(len(rhs), self.size) if border is None else border
        k = around[0].shape[1]
        columns, small_columns = self._split(at, around[0])
        rows, small_rows = self._split(at, around[1])
        right, small = self._split(at, rhs[:, :, : self.size])
        weighted = rows / at.pivot[:, None]
        corner = around[2] - np.einsum("lan,lbn->lab", weighted, columns)
        last = rhs[:, :, self.size :] - np.einsum("lsn,lan->lsa", right, weighted)
        given = np.concatenate([small, last], axis=2)
        found = self.layout.solve(entries, (small_columns, small_rows, corner), given)
        reduced = found.x.shape[2] - k
        turns = found.x[:, :, : 3 * len(self.model.free)]
        turns = turns.reshape(*turns.shape[:2], len(self.model.free), 3)
        along = right + np.einsum("lnk,lsnk->lsn", at.mixed, turns)
        along = along - np.einsum("lsa,lan->lsn", found.x[:, :, reduced:], columns)
        along = along / at.pivot[:, None]
        parts = np.concatenate(
            [along[..., None], 0.5 * at.radius[:, None, :, None] * turns], axis=3
        )
        q = np.einsum("lnka,lsnk->lsna", at.basis, parts)
        q = q.reshape(*q.shape[:2], self._rows)
        x = np.concatenate([q, found.x[:, :, 3 * len(self.model.free) :]], axis=2)
        with np.errstate(over="ignore", invalid="ignore"):
            scale = (at.pivot * (2.0 / at.radius) ** 6).prod(axis=1)
            determinant = found.determinant * scale
        determinant[~np.isfinite(determinant)] = np.nan
        negative = found.negative + (at.pivot < 0.0).sum(axis=1)
        return BorderedSolution(x, negative, found.pivot_ratio, found.pivoted, determinant)

    # --- guesses --------------------------------------------------------------------------------

    def sample(self, p: Parameters, generator: np.random.Generator) -> Lanes:
        """Random turns of the bodies, waves along the members, angles of hinges, and forces."""
        model, lanes = self.model, len(p)
        size = generator.uniform(size=(lanes, 1))
        vectors = np.zeros((lanes, len(model.turning), 3))
        bodies = len(model.network.bodies)
        vectors[:, :bodies] = 0.5 * generator.normal(size=(lanes, bodies, 3))
        s, modes = model.mesh.nodes, np.arange(1, 4)
        for row in model.piece_nodes:
            ends = vectors[:, row[[0, -1]]]
            amplitude = generator.normal(size=(lanes, 3, 3)) * (1.0 / modes)[:, None]
            waves = np.einsum("nm,lmk->lnk", np.sin(np.pi * np.outer(s, modes)), amplitude)
            base = ends[:, :1] * (1.0 - s)[:, None] + ends[:, 1:] * s[:, None]
            vectors[:, row[1:-1]] = (base + waves)[:, 1:-1]
        q = exponential(size[:, :, None] * vectors)[:, model.free].reshape(lanes, self._rows)
        angles = size * generator.normal(size=(lanes, len(model.hinged)))
        forces = FORCES * size * generator.normal(size=(lanes, self.constraints))
        return np.concatenate([q, angles, forces], axis=1)

    def natural_guess(self, p: Parameters) -> Lanes:
        """The frame as drawn."""
        z = np.zeros((len(p), self.size))
        z[:, : self._rows : 4] = 1.0
        return z

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
