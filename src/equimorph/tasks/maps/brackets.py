"""Grid edges on which a map jumps or bends, narrowed down by bisection."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

from equimorph.structures import Structure
from equimorph.tasks.maps.samples import Sampler, Samples, difference, joined

Edges = Int[np.ndarray, "edges 2"]

RATIO = 2.0
"""Difference over an edge relative to the smaller of its neighbours' in line that is suspicious."""
SHRINKING = 0.6
"""A smooth map's differences halve with each bisection; those of 2^−0.6 and slower are sharp."""
LOOK_BACK = 3
NEGLIGIBLE = 0.1
ASIDE = (0.45, 0.56)
"""Shares of a pair at which is looked where the middle gives no answer."""


@dataclass(frozen=True)
class Brackets:
    """Pairs of settings between which a map may not be smooth, and the grid edges they lie on.

    Attributes
    ----------
    a, b
        Samples at both ends.
    edge
        Number of the edge.
    before
        Differences of the ends at the last bisections, the oldest first; ∞ if there were fewer.
    """

    a: Samples
    b: Samples
    edge: Int[np.ndarray, " brackets"]
    before: Float[np.ndarray, "last brackets"]

    @classmethod
    def new(cls, a: Samples, b: Samples, edge: Int[np.ndarray, " brackets"]) -> "Brackets":
        """Pairs that were not bisected yet."""
        return cls(a, b, edge, np.full((LOOK_BACK, len(edge)), np.inf))

    def __len__(self) -> int:
        """Return the number of pairs."""
        return len(self.edge)

    def take(self, some: Int[np.ndarray, " some"]) -> "Brackets":
        """Return some of the pairs."""
        return Brackets(self.a.take(some), self.b.take(some), self.edge[some], self.before[:, some])

    def with_more(self, more: "Brackets") -> "Brackets":
        """Return these and others."""
        edge = np.concatenate([self.edge, more.edge])
        before = np.concatenate([self.before, more.before], axis=1)
        return Brackets(joined([self.a, more.a]), joined([self.b, more.b]), edge, before)


def grid_edges(shape: tuple[int, int]) -> Edges:
    """Vertices at both ends of all grid edges: those along the first axis come first."""
    number = np.arange(shape[0] * shape[1]).reshape(shape)
    down = np.stack([number[:-1], number[1:]], axis=-1).reshape(-1, 2)
    right = np.stack([number[:, :-1], number[:, 1:]], axis=-1).reshape(-1, 2)
    return np.concatenate([down, right])


def suspicious(
    differences: Float[np.ndarray, " edges"], shape: tuple[int, int]
) -> Bool[np.ndarray, " edges"]:
    """Edges whose ends differ in kind, or much more than those of the edges before and behind."""
    count = (shape[0] - 1) * shape[1]
    down = differences[:count].reshape(shape[0] - 1, shape[1])
    right = differences[count:].reshape(shape[0], shape[1] - 1)
    return np.concatenate([_stands_out(down, 0).ravel(), _stands_out(right, 1).ravel()])


def _stands_out(
    values: Float[np.ndarray, "rows columns"], axis: int
) -> Bool[np.ndarray, "rows columns"]:
    line = np.moveaxis(values, axis, 0)
    known = np.where(np.isfinite(line) & (line > 0.0), line, np.inf)
    rim = np.full((1, line.shape[1]), np.inf)
    usual = np.minimum(np.concatenate([rim, known[:-1]]), np.concatenate([known[1:], rim]))
    return np.moveaxis(np.isinf(line) | (line > RATIO * usual), 0, axis)


def halved(structure: Structure, sampler: Sampler, pairs: Brackets) -> Brackets:
    """Halves of pairs with the greater difference, as long as they may be sharp.

    Both halves are kept where both change kind, and at first where neither is negligible: beside a
    jump a map is often steep. Differences of a smooth map shrink with the pair.
    """
    a, b = pairs.a, pairs.b
    middle = _between(sampler, a, b)
    left, right = difference(structure, a, middle), difference(structure, middle, b)
    young = np.isinf(pairs.before[0])
    both = np.isinf(left) & np.isinf(right)
    both |= young & (np.minimum(left, right) > NEGLIGIBLE * np.maximum(left, right))
    twice, go_left = np.flatnonzero(both), left >= right
    low, high = a.where(go_left, middle), middle.where(go_left, b)
    others = middle.where(go_left, a).take(twice), b.where(go_left, middle).take(twice)
    order = np.concatenate([np.arange(len(pairs)), twice])
    a, b, before = joined([low, others[0]]), joined([high, others[1]]), pairs.before[:, order]
    now = difference(structure, a, b)
    smooth = np.isfinite(now) & (now <= before[0] * 0.5 ** (SHRINKING * LOOK_BACK))
    smooth &= ~np.isinf(before[0]) | (now == 0.0)
    before = np.concatenate([before[1:], now[None]])
    return Brackets(a, b, pairs.edge[order], before).take(np.flatnonzero(~smooth))


def narrowed(structure: Structure, sampler: Sampler, pairs: Brackets, bisections: int) -> Brackets:
    """Pairs that stay sharp through some bisections."""
    for _ in range(bisections):
        if len(pairs):
            pairs = halved(structure, sampler, pairs)
    return pairs


def _between(sampler: Sampler, a: Samples, b: Samples) -> Samples:
    """Samples in the middle of pairs; beside it where there is no answer."""
    middle = sampler(0.5 * (a.setting + b.setting))
    for share in ASIDE:
        lost = ~np.isfinite(middle.z).all(axis=1) & np.isfinite(a.z + b.z).all(axis=1)
        if not lost.any():
            break
        at = np.flatnonzero(lost)
        here = a.setting[at] + share * (b.setting[at] - a.setting[at])
        order = np.where(lost, np.cumsum(lost) - 1 + len(lost), np.arange(len(lost)))
        middle = joined([middle, sampler(here)]).take(order)
    return middle


def cells_beside(edge: Int[np.ndarray, " n"], shape: tuple[int, int]) -> Int[np.ndarray, "n 2"]:
    """Cells on both sides of edges numbered as in `grid_edges`; −1 beyond the rim of the grid."""
    rows, columns = shape
    count = (rows - 1) * columns
    i, j = np.where(edge < count, np.divmod(edge, columns), np.divmod(edge - count, columns - 1))
    back = np.where(edge < count, j - 1, i - 1)
    first = np.where(edge < count, i * (columns - 1) + back, back * (columns - 1) + j)
    last = np.where(edge < count, j < columns - 1, i < rows - 1)
    second = np.where(last, i * (columns - 1) + j, -1)
    return np.stack([np.where(back >= 0, first, -1), second], axis=1)


def edges_ahead(edge: Int[np.ndarray, " n"], shape: tuple[int, int]) -> Int[np.ndarray, " m"]:
    """Edges of the cells that an odd number of sharp edges enters: one of them ends there."""
    columns = shape[1]
    count = (shape[0] - 1) * columns
    cells = cells_beside(np.unique(edge), shape).ravel()
    cell, many = np.unique(cells[cells >= 0], return_counts=True)
    i, j = np.divmod(cell[many % 2 == 1], columns - 1)
    down, right = i * columns + j, count + i * (columns - 1) + j
    return np.unique(np.concatenate([down, down + 1, right, right + columns - 1]))
