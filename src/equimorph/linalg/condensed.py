"""The condensed layout: chains of elements whose inner nodes are eliminated inside the element."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from equimorph.arrays import Determinants, Flags, Float, Int, Numbers, Values
from equimorph.errors import InputError
from equimorph.linalg.bordered_kernels import solve_condensed
from equimorph.linalg.dense import Border, BorderedSolution, solve_bordered
from equimorph.linalg.determinants import clear_overflows
from equimorph.linalg.lanes import over_lanes
from equimorph.linalg.null_vectors import Sides, near_null
from equimorph.linalg.simd import LANES

PIVOT_GUARD = 1e-8
"""Smallest pivot ratio that is trusted as it is; below it solutions are refined.

A pivot ε among pivots of size 1 makes another of size 1/ε: the ratio is ε², the loss of digits ε.
"""
REFINABLE = 1e-12
"""Smallest pivot ratio whose solutions are refined; below it a lane is solved dense and pivoted."""
REFINED = 1e-8
"""Largest refinement, relative to the solution, after which a solution is trusted."""


@dataclass(frozen=True, eq=False)
class Coupling:
    """Work of all nodes of a chain on each other, through two sums along the chain.

    H has ``pull (W_ij sin(θ_i − θ_j) + m_i m_j Re(q exp(i(θ_i + θ_j))))`` beside its elements and
    diagonal, with ``W_ij = ½ sign(e − f) m_i m_j`` between elements e and f.
    """

    inside: Float[np.ndarray, "elements order order"]
    """W within each element; antisymmetric."""
    weights: Float[np.ndarray, "elements order"]
    """m of the nodes of every element, which are added up where elements meet."""
    closed: Float[np.ndarray, "2"]
    """Real and imaginary part of q."""

    @property
    def tables(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """What kernels read."""
        return self.inside, self.weights, self.closed

    @cached_property
    def _assembled(self) -> tuple[Float[np.ndarray, "nodes nodes"], Float[np.ndarray, " nodes"]]:
        """W and m of all nodes."""
        elements, order = self.weights.shape
        at = (np.arange(elements)[:, None] * (order - 1) + np.arange(order)).ravel()
        sides = np.sign(np.arange(elements)[:, None] - np.arange(elements))
        work = 0.5 * sides[:, None, :, None] * self.weights[:, :, None, None] * self.weights
        work[range(elements), :, range(elements)] = self.inside
        whole, m = np.zeros((at[-1] + 1,) * 2), np.zeros(at[-1] + 1)
        np.add.at(whole, (at[:, None], at), work.reshape(len(at), -1))
        np.add.at(m, at, self.weights.ravel())
        return whole, m

    def matrix(
        self, turns: Float[np.ndarray, "lanes nodes"], pull: Values
    ) -> Float[np.ndarray, "lanes nodes nodes"]:
        """Return this part of H in full."""
        whole, m = self._assembled
        unit = np.cos(turns) + 1j * np.sin(turns)
        coupled = whole * (unit[:, :, None] * unit.conj()[:, None]).imag
        arm, q = m * unit, complex(*self.closed)
        coupled += (q * arm[:, :, None] * arm[:, None]).real
        return np.asarray(pull[:, None, None] * coupled)


UNCOUPLED = Coupling(np.zeros((0, 0, 0)), np.zeros((0, 0)), np.zeros(2))
Bent = tuple[Float[np.ndarray, "lanes turned"], Values]
"""Angles θ of all nodes, and pulls, for a coupling; of no nodes without one."""


@dataclass(frozen=True, eq=False)
class CondensedLayout:
    """Saddle-point matrices ``[H B; Bᵀ T]`` of chained elements, many lanes at a time.

    H is the assembly of one element matrix per element, the same for every lane, plus a diagonal
    for each lane. B holds m columns (constraint gradients). The trailing block T (m × m) is zero
    where it is left out; minus the compliances of elastic supports otherwise.

    Parameters
    ----------
    stiffness
        Symmetric element matrices over degree + 1 nodes each, ends first and last.
    ends
        First (0 or 1) and last (elements − 1 or elements) vertex that is an unknown; an end vertex
        left out is prescribed.
    coupling
        What couples all nodes, by angles and a pull of each lane.
    """

    stiffness: Float[np.ndarray, "elements order order"]
    ends: Int[np.ndarray, "2"]
    coupling: Coupling = UNCOUPLED

    @cached_property
    def nodes(self) -> int:
        """Number of nodes, prescribed ones included."""
        return int(self.stiffness.shape[0] * (self.stiffness.shape[1] - 1) + 1)

    @cached_property
    def unknown(self) -> slice:
        """Nodes that are unknowns."""
        held = len(self.stiffness) - int(self.ends[1])
        return slice(int(self.ends[0]), self.nodes - held)

    @cached_property
    def assembled(self) -> Float[np.ndarray, "nodes nodes"]:
        """The sum of the element matrices."""
        degree = self.stiffness.shape[1] - 1
        matrix = np.zeros((self.nodes, self.nodes))
        for e, element in enumerate(self.stiffness):
            span = slice(e * degree, (e + 1) * degree + 1)
            matrix[span, span] += element
        return matrix

    def dense(
        self,
        diagonal: Float[np.ndarray, "lanes nodes"],
        border: Float[np.ndarray, "lanes m nodes"],
        trailing: Float[np.ndarray, "lanes m m"] | None = None,
        bent: Bent | None = None,
    ) -> Float[np.ndarray, "lanes size size"]:
        """Return the saddle-point matrices in full."""
        lanes, m = border.shape[:2]
        inner = self.unknown
        n = inner.stop - inner.start
        full = np.zeros((lanes, n + m, n + m))
        full[:, :n, :n] = self.assembled[inner, inner]
        at = np.arange(n)
        full[:, at, at] += diagonal[:, inner]
        full[:, n:, :n] = border[:, :, inner]
        full[:, :n, n:] = border[:, :, inner].transpose(0, 2, 1)
        if trailing is not None:
            full[:, n:, n:] = trailing
        if bent is not None and len(self.coupling.weights):
            full[:, :n, :n] += self.coupling.matrix(*bent)[:, inner, inner]
        return full

    def solve(
        self,
        diagonal: Float[np.ndarray, "lanes nodes"],
        border: Float[np.ndarray, "lanes m nodes"],
        columns: Float[np.ndarray, "lanes k size"],
        rows: Float[np.ndarray, "lanes k size"],
        corner: Float[np.ndarray, "lanes k k"],
        rhs: Float[np.ndarray, "lanes sides bordered"],
        *,
        trailing: Float[np.ndarray, "lanes m m"] | None = None,
        bent: Bent | None = None,
    ) -> BorderedSolution:
        """Solve ``[A Cᵀ; R D] x = rhs`` with ``A = [H B; Bᵀ T]``, and count A's inertia.

        ``In(A) = In(H) + In(T − BᵀH⁻¹B)`` with the pivots' signs as In(H). A small pivot loses
        digits of the solution: a step of iterative refinement brings them back. Lanes with a pivot
        ratio below `REFINABLE` (or not a number) are solved again by the pivoted dense
        factorisation.
        """
        lanes, m = len(diagonal), border.shape[1]
        if trailing is None:
            trailing = np.zeros((lanes, m, m))
        turns, pull = (np.empty((lanes, 0)), np.empty(lanes)) if bent is None else bent
        given = (diagonal, border, columns, rows, corner, rhs, trailing, turns, pull)
        self._check(*given)
        arrays = [np.ascontiguousarray(a) for a in given]
        x, negative, ratio, determinant = self._solve(*arrays)
        pivoted = np.zeros(lanes, bool)
        found = BorderedSolution(x, negative, ratio, pivoted, determinant)
        if not ratio.min(initial=1.0) >= PIVOT_GUARD:
            doubtful = np.flatnonzero(~(ratio >= PIVOT_GUARD))
            refined = doubtful[ratio[doubtful] >= REFINABLE]
            x[refined], good = self._refine([a[refined] for a in arrays], x[refined])
            pivoted[doubtful] = True
            pivoted[refined[good]] = False
        if len(unsafe := np.flatnonzero(pivoted)):
            full = [a[unsafe] for a in arrays]
            matrices = self.dense(full[0], full[1], full[6], (full[7], full[8]))
            found.take_over(unsafe, solve_bordered(matrices, *full[2:6]))
        clear_overflows(determinant)
        return found

    def near_null(
        self, diagonal: Float[np.ndarray, "lanes nodes"], border: Float[np.ndarray, "lanes m nodes"]
    ) -> Float[np.ndarray, "lanes size"]:
        """Unit vectors near null vectors of ``[H B; Bᵀ 0]``: `null_vectors.near_null` at once.

        Lanes with an unsafe pivot go through `solve`.
        """
        (lanes, m, _), size = border.shape, self.unknown.stop - self.unknown.start + border.shape[1]
        if lanes == 0:
            return np.zeros((0, size))
        # whole blocks: the last lane fills up one with fewer
        at = np.minimum(np.arange(max(lanes, LANES)), lanes - 1)
        matrix, rest = (diagonal[at], border[at]), np.zeros((len(at), m, m))
        bent, least = (np.empty((len(at), 0)), np.empty(len(at))), np.full(len(at), np.inf)

        def at_once(rhs: Sides, around: Border) -> Sides:
            x, _, ratio, _ = self._solve(*matrix, *around, rhs, rest, *bent)
            np.minimum(least, ratio, out=least)
            return x

        found = near_null(at_once, len(at), size)[:lanes]
        unsafe = (~(least[:lanes] >= PIVOT_GUARD)).nonzero()[0]
        if len(unsafe):
            own = diagonal[unsafe], border[unsafe]
            found[unsafe] = near_null(
                lambda rhs, around: self.solve(*own, *around, rhs).x, len(unsafe), size
            )
        return found

    def _check(self, *arrays: np.ndarray) -> None:
        """Refuse shapes that do not fit: the kernel does not check what it reads."""
        given = [array.shape for array in arrays]
        lanes, m, k = given[0][0], given[1][1], given[2][1]
        size, sides = self.unknown.stop - self.unknown.start + m, given[5][1]
        nodes, columns, corner = self.nodes, (lanes, k, size), (lanes, k, k)
        bent = (lanes, nodes if len(self.coupling.weights) else 0), (lanes,)
        ends = (corner, (lanes, sides, size + k), (lanes, m, m), *bent)
        shapes = [(lanes, nodes), (lanes, m, nodes), columns, columns, *ends]
        if given == shapes:
            return
        names = ["diagonal", "border", "columns", "rows", "corner", "rhs", "trailing"]
        names += ["turns", "pull"]
        for name, shape, other in zip(names, shapes, given, strict=True):
            if other != shape:
                raise InputError(f"`{name}` must have shape {shape}; got {other}.")

    def _solve(
        self, *arrays: np.ndarray
    ) -> tuple[
        Float[np.ndarray, "lanes sides bordered"],
        Numbers,
        Values,
        Determinants,
    ]:
        """Solutions, negative eigenvalues, pivot ratios, determinants by condensed elimination."""
        lanes = len(arrays[0])
        x, ratio, determinant = np.empty(arrays[5].shape), np.empty(lanes), np.empty((lanes, 2))
        outputs = x, np.empty(lanes, dtype=np.int64), ratio, determinant
        shared = self.stiffness, self.ends, self.coupling.tables
        over_lanes(solve_condensed, shared, arrays, outputs)
        return outputs

    def _refine(
        self, arrays: list[np.ndarray], x: Float[np.ndarray, "lanes sides bordered"]
    ) -> tuple[Float[np.ndarray, "lanes sides bordered"], Flags]:
        """Solutions after a step of iterative refinement, and which of them can be trusted."""
        diagonal, border, columns, rows, corner, rhs, trailing, *bent = arrays
        n = columns.shape[2]
        full = np.zeros((len(x), rhs.shape[2], rhs.shape[2]))
        full[:, :n, :n] = self.dense(diagonal, border, trailing, (bent[0], bent[1]))
        full[:, :n, n:], full[:, n:, :n] = columns.transpose(0, 2, 1), rows
        full[:, n:, n:] = corner
        defect = np.ascontiguousarray(rhs - np.einsum("lij,lsj->lsi", full, x))
        change = self._solve(*arrays[:5], defect, trailing, *bent)[0]
        size, largest = (np.abs(a).max(axis=(1, 2), initial=0.0) for a in (change, x))
        return x + change, np.asarray(size <= REFINED * largest)
