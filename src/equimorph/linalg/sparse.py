"""The sparse layout: symmetric matrices of one pattern, in batches of lanes.

See docs/decisions.md, "Sparse LDLᵀ without pivoting for trusses, frames and energies".
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from heapq import heappop, heappush

import numpy as np

from equimorph.arrays import Float, Int, Values
from equimorph.linalg.dense import Border, BorderedSolution, no_border, solve_bordered
from equimorph.linalg.determinants import clear_overflows
from equimorph.linalg.lanes import over_lanes
from equimorph.linalg.sparse_kernels import solve_sparse

GONE = -1
"""Degree of what is eliminated."""
SWEEPS = 4
"""Inverse iterations by which the smallest eigenvalue is estimated."""

GROWTH = 1e5
"""Largest growth of diagonal entries, relative to the matrix, of a factorisation that is trusted.

Without pivoting the backward error is this factor times round-off: eleven digits remain.
"""


@dataclass(frozen=True)
class _Elimination:
    """An order of elimination and the places that it touches; see `kernels.eliminate`."""

    order: Int[np.ndarray, " size"]
    start: Int[np.ndarray, " starts"]
    rows: Int[np.ndarray, " below"]
    alike: Int[np.ndarray, "2 size"]
    target: Int[np.ndarray, " pairs"]
    scatter: Int[np.ndarray, " entries"]


@dataclass(frozen=True, eq=False)
class SparseLayout:
    """Symmetric matrices of one sparsity pattern, many lanes at a time."""

    rows: Int[np.ndarray, " entries"]
    columns: Int[np.ndarray, " entries"]
    """Places of the entries of the lower triangle, row ≥ column, each once; the diagonal must be
    complete. A lane's matrix is the array of its entries in this order."""
    size: int
    """Number of rows."""
    multipliers: int = 0
    """How many rows at the end have a zero diagonal (Lagrange multipliers): they are eliminated
    after all others, unless there are ranks."""
    ranks: Int[np.ndarray, " size"] | None = None
    """Rows of lower rank are eliminated first."""

    @cached_property
    def diagonal(self) -> Int[np.ndarray, " size"]:
        """Numbers of the entries on the diagonal, by row."""
        entries = np.flatnonzero(self.rows == self.columns)
        return entries[np.argsort(self.rows[entries])]

    @cached_property
    def elimination(self) -> _Elimination:
        """Order and places of the elimination."""
        return self._places(np.arange(self.size))

    @cached_property
    def second_elimination(self) -> _Elimination:
        """Another order: of rows of the same degree the last ones go first."""
        return self._places(np.arange(self.size)[::-1])

    def _places(self, row: Int[np.ndarray, " size"]) -> _Elimination:
        """Order and places of an elimination, where of rows of the same degree earlier ones go."""
        ranks, turn = self.ranks, np.argsort(row)
        if ranks is None:
            ranks = (np.arange(self.size) >= self.size - self.multipliers).astype(int)
        below = _elimination(turn[self.rows], turn[self.columns], ranks[row])
        order = row[[variable for variable, _ in below]]
        place = np.empty(self.size, int)
        place[order] = np.arange(self.size)
        start = np.concatenate([[0], np.cumsum([len(others) for _, others in below])])
        rows = np.empty(start[-1], int)
        for k, (_, others) in enumerate(below):
            rows[start[k] : start[k + 1]] = np.sort(place[row[others]])
        low, high = np.sort(np.stack([place[self.rows], place[self.columns]]), axis=0)
        known = np.arange(self.size).repeat(np.diff(start)) * self.size + rows
        slot = self.size + np.searchsorted(known, low * self.size + high)
        scatter = np.where(low == high, low, slot)
        alike, target = _updates(start, rows, known)
        return _Elimination(order, start, rows, alike, target, scatter)

    def dense(self, values: Float[np.ndarray, "lanes entries"]) -> Float[np.ndarray, "lanes n n"]:
        """Return the matrices in full."""
        full = np.zeros((len(values), self.size, self.size))
        full[:, self.rows, self.columns] = values
        full[:, self.columns, self.rows] = values
        return full

    def solve(
        self,
        values: Float[np.ndarray, "lanes entries"],
        border: Border | None,
        rhs: Float[np.ndarray, "lanes sides bordered"],
    ) -> BorderedSolution:
        """Solve ``[A Cᵀ; R D] x = rhs`` with border (C, R, D), and count A's inertia.

        LDLᵀ without pivoting, but the last pivot, which shows a singular A at folds, is eliminated
        together with the border by Gauss with partial pivoting. Lanes whose entries grow by more
        than `GROWTH` (or are no numbers) are solved again in another order, in which other parts
        of A are regular; those that grow in both, by the pivoted dense factorisation.
        """
        around = no_border(len(values), self.size) if border is None else border
        arrays = [np.ascontiguousarray(a) for a in (values, *around, rhs)]
        found, growth = _solve_in_order(self.elimination, arrays)
        if len(unsafe := np.flatnonzero(~(growth <= GROWTH))):
            some = [a[unsafe] for a in arrays]
            again, growth[unsafe] = _solve_in_order(self.second_elimination, some)
            found.take_over(unsafe, again)
        if len(unsafe := np.flatnonzero(~(growth <= GROWTH))):
            full = self.dense(arrays[0][unsafe])
            found.take_over(unsafe, solve_bordered(full, *(a[unsafe] for a in arrays[1:])))
            found.pivoted[unsafe] = True
        clear_overflows(found.determinant)
        np.divide(1.0, np.maximum(growth, 1.0), out=found.pivot_ratio)
        return found

    def smallest_size(self, values: Float[np.ndarray, "1 entries"]) -> float:
        """Smallest absolute eigenvalue of a matrix, by inverse iteration; 0 if it is singular."""
        vector = np.random.default_rng(0).normal(size=(1, 1, self.size))
        smallest = np.inf
        for _ in range(SWEEPS):
            vector = self.solve(values, None, vector / np.linalg.norm(vector)).x
            length = float(np.linalg.norm(vector))
            if not np.isfinite(length):
                return 0.0
            smallest = 1.0 / length
        return smallest


def _solve_in_order(
    how: _Elimination, arrays: Sequence[np.ndarray]
) -> tuple[BorderedSolution, Values]:
    """Bordered solutions by one order of elimination, and the growth of the entries."""
    lanes, rhs = len(arrays[0]), arrays[-1]
    x, (growth, ratio), determinant = (
        np.empty(rhs.shape),
        np.empty((2, lanes)),
        np.empty((lanes, 2)),
    )
    negative = np.empty(lanes, dtype=np.int64)
    shared = (how.start, how.rows, how.alike, how.target, how.scatter, how.order)
    if lanes:
        over_lanes(solve_sparse, shared, arrays, [x, negative, growth, determinant])
    found = BorderedSolution(x, negative, ratio, np.zeros(lanes, bool), determinant)
    return found, growth


def _updates(
    start: Int[np.ndarray, " starts"],
    rows: Int[np.ndarray, " below"],
    known: Int[np.ndarray, " below"],
) -> tuple[Int[np.ndarray, "2 size"], Int[np.ndarray, " pairs"]]:
    """Groups of columns with the same rows below, and the places that pairs of these update.

    As in `sparse_kernels.eliminate`; known: column · size + row of each entry of L.
    """
    size, count = len(start) - 1, np.diff(start)
    alike, tables, total = np.zeros((2, size), int), [], 0
    for k in range(size - 1, -1, -1):
        below = rows[start[k] : start[k + 1]]
        if len(below) and below[0] == k + 1 and len(below) == count[k + 1] + 1:
            alike[:, k] = alike[:, k + 1] + [1, 0]
            continue
        right, left = np.tril_indices(len(below), -1)
        tables.append(size + np.searchsorted(known, below[left] * size + below[right]))
        alike[1, k] = total
        total += len(left)
    return alike, np.concatenate(tables).astype(np.int32)


def _elimination(
    rows: Int[np.ndarray, " entries"],
    columns: Int[np.ndarray, " entries"],
    ranks: Int[np.ndarray, " size"],
) -> list[tuple[int, Int[np.ndarray, " below"]]]:
    """Variables in the order of elimination, each with the later ones in its column of L.

    Minimum degree among those of the lowest rank that are left.
    """
    size, rank = len(ranks), ranks.tolist()
    near: list[set[int]] = [set() for _ in range(size)]
    for i, j in zip(rows.tolist(), columns.tolist(), strict=True):
        if i != j:
            near[i].add(j)
            near[j].add(i)
    degree = [len(each) for each in near]
    queue = sorted(zip(rank, degree, range(size), strict=True))
    below = []
    while queue:
        _, count, variable = heappop(queue)
        if count != degree[variable]:  # it has another degree by now, or is gone
            continue
        others, near[variable], degree[variable] = near[variable], set(), GONE
        for other in others:
            near[other] |= others
            near[other] -= {variable, other}
            if len(near[other]) != degree[other]:
                degree[other] = len(near[other])
                heappush(queue, (rank[other], degree[other], other))
        below.append((variable, np.fromiter(others, int, len(others))))
    return below
