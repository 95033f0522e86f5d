"""Mechanics of a rod in space: its matrix, solves with it, and Newton steps, in batches."""

from functools import cached_property, partial

import numpy as np
from jaxtyping import Float, Int

from equimorph.arrays import Entries, Lanes, Parameters, Values
from equimorph.linalg import Border, BorderedSolution
from equimorph.linalg.condensed import PIVOT_GUARD
from equimorph.linalg.dense import no_border
from equimorph.linalg.lanes import over_lanes
from equimorph.linalg.sparse import SparseLayout
from equimorph.structures.equations import Advance, Direction, JointEquations, Solver
from equimorph.structures.spatial.derivative_kernels import equations_lanes
from equimorph.structures.spatial.lagrangian import (
    LENGTH_STIFFNESS,
    Nodes,
    SpatialLagrangian,
    blocks_of,
)
from equimorph.structures.spatial.quaternions import FRAME, RIGHT, Jet, normalised
from equimorph.structures.spatial.solve_kernels import solve_bordered_lanes
from equimorph.structures.spatial.step_kernels import advance_lanes
from equimorph.structures.spatial.tables import equation_tables, pairs_of, step_tables


class SpatialMechanics(SpatialLagrangian, JointEquations):
    """Mechanics of the Lagrangian of a `SpatialModel`; methods as in `structures.contract`."""

    @cached_property
    def layout(self) -> SparseLayout:
        """Sparsity of F_z: dense blocks of elements, and a border."""
        rows, columns = (np.concatenate(each) for each in zip(*self._places, strict=True))
        keys = np.unique(rows * self.size + columns)
        return SparseLayout(keys // self.size, keys % self.size, self.size, self.constraints)

    @cached_property
    def _places(self) -> list[tuple[Int[np.ndarray, " some"], Int[np.ndarray, " some"]]]:
        """Rows and columns, row ≥ column, of the blocks of the elements, then of the border."""
        first, count = self.model.unknown_nodes.start, self.unknowns // 4
        found = []
        for nodes in self.mesh.element_nodes:
            at = (4 * (nodes - first))[:, None] + np.arange(4)
            at = at[(nodes >= first) & (nodes < first + count)].ravel()
            rows, columns = np.meshgrid(at, at, indexing="ij")
            low = rows >= columns
            found.append((rows[low], columns[low]))
        m = np.arange(self.unknowns, self.size)
        rows, columns = np.meshgrid(m, np.arange(self.size), indexing="ij")
        low = rows >= columns
        return [*found, (rows[low], columns[low])]

    @cached_property
    def _slots(self) -> list[Int[np.ndarray, " some"]]:
        """Numbers of the entries of each of `_places`."""
        keys = self.layout.rows * self.size + self.layout.columns
        return [np.searchsorted(keys, r * self.size + c) for r, c in self._places]

    def entries(self, z: Lanes, p: Parameters, shift: Values | None = None) -> Entries:
        """Entries of F_z − shift·mass in the order of `layout`."""
        moved = np.zeros(len(z)) if shift is None else shift
        parts = [self._entries(z[at], p[at], moved[at]) for at in blocks_of(len(z))]
        return np.concatenate(parts)

    def _entries(self, z: Lanes, p: Parameters, shift: Values) -> Entries:
        """`entries` of one block of lanes."""
        given, y = self.jets(z, p)
        q, inverse, square = (jet[0] for jet in normalised(given))
        blocks, crossing, closing = self._second(q, y)
        slope = self.slope(q[None], y)[0]
        projector = (np.eye(4) - q[..., :, None] * q[..., None, :]) * inverse[..., None, None]
        nodes = self.mesh.element_nodes
        p_left = projector[:, nodes]
        blocks = np.einsum("leiab,leibjc,lejcd->leiajd", p_left, blocks, p_left, optimize=True)
        own = self._own_blocks(given[0], q, inverse, square, slope)
        border = np.einsum("lmia,liab->lmib", crossing, projector)
        return self._place_entries(blocks, own, border, closing, shift)

    def _own_blocks(
        self, given: Nodes, q: Nodes, inverse: np.ndarray, square: np.ndarray, slope: Nodes
    ) -> Float[np.ndarray, "lanes nodes 4 4"]:
        """Blocks of the nodes by the change of directions and lengths."""
        along = (q * slope).sum(axis=-1)[..., None, None]
        across = slope - along[..., 0] * q
        mixed = across[..., :, None] * q[..., None, :]
        unit = np.eye(4)
        own = along * (unit - q[..., :, None] * q[..., None, :])
        own = -(own + mixed + np.swapaxes(mixed, -1, -2)) * (inverse**2)[..., None, None]
        inner = self.model.unknown_nodes
        excess = square[:, inner, None, None] - 1.0
        outer = given[:, inner, :, None] * given[:, inner, None, :]
        own[:, inner] += 0.5 * self.stiff_lengths[:, None, None] * (excess * unit + 2.0 * outer)
        return np.asarray(own)

    def _place_entries(
        self,
        blocks: np.ndarray,
        own: np.ndarray,
        border: np.ndarray,
        closing: np.ndarray,
        shift: Values,
    ) -> Entries:
        """Write blocks of elements and nodes, and the border, to their entries."""
        lanes, inner = len(blocks), self.model.unknown_nodes
        out = np.zeros((lanes, len(self.layout.rows)))
        count = len(self.mesh.nodes)
        free = np.zeros(count, bool)
        free[inner] = True
        for e, nodes in enumerate(self.mesh.element_nodes):
            mine = np.repeat(free[nodes], 4)
            block = blocks[:, e].reshape(lanes, len(mine), len(mine))[:, mine][:, :, mine]
            low = np.tril_indices(block.shape[1])
            out[:, self._slots[e]] += block[:, low[0], low[1]]
        slots = self._node_slots
        own = own[:, inner]
        own[:, :, range(4), range(4)] -= shift[:, None, None] * self.mass.reshape(-1, 4)
        low = np.tril_indices(4)
        out[:, slots] += own[:, :, low[0], low[1]]
        m = self.constraints
        rows = np.zeros((lanes, m, self.size))
        rows[:, :, : self.unknowns] = border[:, :, inner].reshape(lanes, m, self.unknowns)
        rows[:, :, self.unknowns :] = closing
        r, c = self._places[-1]
        out[:, self._slots[-1]] = rows[:, r - self.unknowns, c]
        return out

    @cached_property
    def _node_slots(self) -> Int[np.ndarray, "nodes 10"]:
        """Numbers of the entries of the lower triangle of each node."""
        keys = self.layout.rows * self.size + self.layout.columns
        first = 4 * np.arange(self.unknowns // 4)[:, None]
        row, column = np.tril_indices(4)
        return np.searchsorted(keys, (first + row) * self.size + first + column)

    def _second(
        self, q: Nodes, y: Float[np.ndarray, "1 lanes scalars"]
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Second derivatives of L by unit quaternions of elements, by these and λ, and by λ."""
        turned, moved, strain = (jet[0] for jet in self.element_strains(q[None]))
        local = q[:, self.mesh.element_nodes]
        weights, model, m = self.weights[..., None], self.model, self.constraints
        order = local.shape[2]
        jacobian = 2.0 * np.einsum("eij,leika->leikja", self.slopes, turned)
        own = -2.0 * np.einsum("kab,leib->leika", RIGHT, moved)
        i = np.arange(order)
        jacobian[:, :, i, :, i] += np.moveaxis(own, 2, 0)
        torsion = np.einsum("ls,sei->lei", y[0], model.torsion)
        stiff = np.repeat((weights * model.stiffness)[None], len(q), axis=0)
        stiff[..., 0] += self.weights * torsion
        rows = jacobian.reshape(*jacobian.shape[:2], 3 * order, 4 * order)
        scaled = rows * stiff.reshape(*rows.shape[:3])[..., None]
        blocks = np.matmul(np.swapaxes(rows, -1, -2), scaled)
        blocks = blocks.reshape(*blocks.shape[:2], order, 4, order, 4)
        moment = 2.0 * weights * self.section_moments(strain[None], y)[0]
        skew = np.einsum("leik,kab->leiab", moment, RIGHT)
        mixed = np.einsum("eij,leiab->lejaib", self.slopes, skew)
        blocks = blocks + mixed + mixed.transpose(0, 1, 4, 5, 2, 3)
        pull, axial = (jet[0] for jet in self.section_forces(q[None], y))
        stretch = weights * self.stretches(axial[None], y)[0]
        force = np.einsum("ls,seic->leic", y[0], model.force)
        curved = 2.0 * np.einsum("leik,leic,kcab->leiab", stretch, force, FRAME, optimize=True)
        soft = weights * model.softness
        curved = curved - np.einsum("eik,leika,leikb->leiab", soft, pull, pull, optimize=True)
        blocks[:, :, i, :, i] += np.moveaxis(curved, 2, 0)
        sided = np.einsum("meic,kcab,leib->lmeika", model.force[:m], FRAME, local, optimize=True)
        ahead = np.einsum("lmeika,leia->lmeik", sided, local)
        crossing = 2.0 * np.einsum("leik,lmeika->lmeia", stretch, sided)
        crossing -= np.einsum("eik,lmeik,leika->lmeia", soft, ahead, pull, optimize=True)
        closing = model.quadratic[:m, :m] - np.einsum(
            "eik,lmeik,lneik->lmn", soft, ahead, ahead, optimize=True
        )
        return blocks, self.assemble(crossing), closing

    # --- equations ------------------------------------------------------------------------------

    def equations(self, z: Lanes, p: Parameters, *directions: Direction) -> Jet:
        """F with its derivatives along none, one or two directions."""
        self.check_widths((z, p), *directions)
        lanes, k = len(z), len(directions)
        moves_z, moves_p = np.empty((lanes, k, self.size)), np.empty((lanes, k, self.parameters))
        for i, (dz, dp) in enumerate(directions):
            moves_z[:, i], moves_p[:, i] = dz, dp
        out = np.empty((lanes, 2**k, self.size))
        inputs = [np.ascontiguousarray(z), np.ascontiguousarray(p), moves_z, moves_p]
        over_lanes(equations_lanes, (*pairs_of(2**k), *self._equation_tables), inputs, [out])
        return np.moveaxis(out, 1, 0)

    def residual(self, z: Lanes, p: Parameters) -> Lanes:
        """F(z; p)."""
        return np.ascontiguousarray(self.equations(z, p)[0])

    def parameter_derivative(self, z: Lanes, p: Parameters, dp: Parameters) -> Lanes:
        """F_p·dp."""
        return np.ascontiguousarray(self.equations(z, p, (np.zeros_like(z), dp))[1])

    def second_derivative(self, z: Lanes, p: Parameters, v: Direction, w: Direction) -> Lanes:
        """D²F[v, w]."""
        return np.ascontiguousarray(self.equations(z, p, v, w)[3])

    def linearised(self, z: Lanes, p: Parameters, dp: Parameters) -> tuple[np.ndarray, ...]:
        """F and F_p·dp."""
        both = self.equations(z, p, (np.zeros_like(z), dp))
        return np.ascontiguousarray(both[0]), np.ascontiguousarray(both[1])

    # --- solves ---------------------------------------------------------------------------------

    def solve(
        self,
        z: Lanes,
        p: Parameters,
        rhs: Float[np.ndarray, "lanes sides bordered"],
        border: Border | None = None,
        shift: Values | None = None,
    ) -> BorderedSolution:
        """Solve with F_z − shift·mass, bordered.

        One kernel; lanes with an unsafe pivot take the sparse solve, which may pivot.
        """
        self.check_widths((z, p))
        lanes = len(z)
        around = no_border(lanes, self.size) if border is None else border
        lowered = np.zeros(lanes) if shift is None else shift * (2.0 / LENGTH_STIFFNESS)
        inputs = [np.ascontiguousarray(each) for each in (z, p, lowered, *around, rhs)]
        x, (determinant, ratio) = np.empty(rhs.shape), np.empty((2, lanes))
        negative = np.empty(lanes, dtype=np.int64)
        outputs = [x, negative, determinant, ratio]
        over_lanes(solve_bordered_lanes, self._step_tables, inputs, outputs)
        negative -= 3 - self.constraints
        determinant *= self.determinant_sign
        unsafe = ~(ratio >= PIVOT_GUARD)
        if unsafe.any():
            entries = self.entries(z[unsafe], p[unsafe], None if shift is None else shift[unsafe])
            some = tuple(np.ascontiguousarray(each[unsafe]) for each in around)
            again = self.layout.solve(entries, (some[0], some[1], some[2]), rhs[unsafe])
            x[unsafe], negative[unsafe] = again.x, again.negative
            determinant[unsafe], ratio[unsafe] = again.determinant, again.pivot_ratio
        return BorderedSolution(x, negative, ratio, unsafe, determinant)

    def solver(
        self, parts: tuple[np.ndarray, ...], z: Lanes, p: Parameters, shift: Values | None = None
    ) -> Solver:
        """Solves with F_z − shift·mass."""
        del parts
        return partial(self.solve, z, p, shift=shift)

    def index(self, z: Lanes, p: Parameters) -> Int[np.ndarray, " lanes"]:
        """Negative eigenvalues of the constrained Hessian, from the pivots of the fused step."""
        row, one, none = np.zeros_like(z), np.ones(len(z)), np.zeros(len(z))
        return self.advance(z, p, np.zeros_like(p), row, one, none).index

    @cached_property
    def _equation_tables(self) -> tuple[np.ndarray, ...]:
        return equation_tables(self.model, 0.5 * self.stiff_lengths)

    @cached_property
    def _step_tables(self) -> tuple[np.ndarray, ...]:
        return step_tables(self.model, 0.5 * self.stiff_lengths)

    def advance(
        self, z: Lanes, p: Parameters, dp: Parameters, row: Lanes, corner: Values, defect: Values
    ) -> Advance:
        """One Newton step along the curve with parameter velocity `dp`.

        One fused kernel; lanes with an unsafe pivot take the general solve.
        """
        return self.fused_advance(advance_lanes, self._step_tables, z, p, dp, row, corner, defect)

    @property
    def determinant_sign(self) -> float:
        """Directions without a closure have the pivot −1 in the fused kernel."""
        return (-1.0) ** (3 - self.constraints)
