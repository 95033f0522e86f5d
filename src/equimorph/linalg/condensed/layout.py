"""The condensed layout: chains of elements whose inner nodes are eliminated inside the element."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float, Int

from equimorph.linalg.condensed.kernels import solve_condensed
from equimorph.linalg.dense import BorderedSolution, solve_bordered
from equimorph.linalg.lanes import over_lanes

PIVOT_GUARD = 1e-6
"""Smallest pivot ratio that is trusted; below it a lane is factored again, dense and pivoted."""


@dataclass(frozen=True, eq=False)
class CondensedLayout:
    """Saddle-point matrices ``[H B; Bᵀ 0]`` of chained elements, many lanes at a time.

    H is the assembly of one element matrix per element, the same for every lane, plus a diagonal
    for each lane. B holds m columns (constraint gradients).

    Parameters
    ----------
    stiffness
        Symmetric element matrices over degree + 1 nodes each, ends first and last.
    ends
        First (0 or 1) and last (elements − 1 or elements) vertex that is an unknown; an end vertex
        left out is prescribed.
    """

    stiffness: Float[np.ndarray, "elements order order"]
    ends: Int[np.ndarray, "2"]

    @property
    def nodes(self) -> int:
        """Number of nodes, prescribed ones included."""
        return int(self.stiffness.shape[0] * (self.stiffness.shape[1] - 1) + 1)

    @property
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
        return full

    def solve(
        self,
        diagonal: Float[np.ndarray, "lanes nodes"],
        border: Float[np.ndarray, "lanes m nodes"],
        columns: Float[np.ndarray, "lanes k size"],
        rows: Float[np.ndarray, "lanes k size"],
        corner: Float[np.ndarray, "lanes k k"],
        rhs: Float[np.ndarray, "lanes sides bordered"],
    ) -> BorderedSolution:
        """Solve ``[A Cᵀ; R D] x = rhs`` with ``A = [H B; Bᵀ 0]``, and count A's inertia.

        ``In(A) = In(H) + In(−BᵀH⁻¹B)`` with the pivots' signs as In(H). Lanes with a pivot ratio
        below `PIVOT_GUARD` (or not a number) are solved again by the pivoted dense factorisation.
        """
        lanes = len(diagonal)
        x, ratio = np.empty(rhs.shape), np.empty(lanes)
        negative = np.empty(lanes, dtype=np.int64)
        arrays = [np.ascontiguousarray(a) for a in (diagonal, border, columns, rows, corner, rhs)]
        over_lanes(solve_condensed, (self.stiffness, self.ends), arrays, [x, negative, ratio])
        unsafe = ~(ratio >= PIVOT_GUARD)
        if unsafe.any():
            again = solve_bordered(
                self.dense(diagonal[unsafe], border[unsafe]),
                columns[unsafe],
                rows[unsafe],
                corner[unsafe],
                rhs[unsafe],
            )
            x[unsafe], negative[unsafe] = again.x, again.negative
        return BorderedSolution(x, negative, ratio, unsafe)
