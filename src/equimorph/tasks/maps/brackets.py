"""Samples of a map, and pairs of them between which it jumps or bends, narrowed by division."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from equimorph.arrays import Bool, Edges, Float, Int, Lanes, Parameters, Settings, Shaped, Values
from equimorph.columns import Columns
from equimorph.structures import Structure
from equimorph.structures.metric import metric_length

RATIO = 2.0
"""Difference over an edge relative to the smaller of its neighbours' in line that is suspicious."""
PARTS = 8
"""Parts into which a pair is divided at once: a batch of rays takes hardly longer than one."""
SHRINKING = 0.6
"""A smooth map's differences shrink with the interval h like h; those like h^0.6 are sharp."""
NEGLIGIBLE = 1e-3
"""Smaller differences are nothing to look for: where an extremum lies is known less well."""
ASIDE = (0.0, 0.4, -0.37)
"""Where to look around a dividing point that gives no answer, in lengths of the parts."""


@dataclass(frozen=True)
class Samples(Columns):
    """Values of a map at settings, with the states that they were read from."""

    setting: Settings
    """Where."""
    value: Values
    """What the map shows; not a number where it is not defined."""
    kind: Int[np.ndarray, " lanes"]
    """Number of the status."""
    place: Values
    """Which constraint, and where on the structure it is met; zero where it says nothing."""
    z: Lanes
    p: Parameters
    """State and all parameters; not numbers where there is no state."""
    passed: Shaped[np.ndarray, " lanes"]
    """Critical states on the way, a tuple of `Passed` for each lane; none in maps that do not
    ask."""


Sampler = Callable[[Settings], Samples]


def sample_distance(structure: Structure, a: Samples, b: Samples) -> Values:
    """Distance of states, values and places of two settings per lane; ∞ where kinds differ.

    Zero where kinds are the same and the map shows nothing on both sides.
    """
    gap = metric_length(structure, a.z - b.z) + np.abs(a.place - b.place)
    gap = gap + np.linalg.norm((a.p - b.p) / structure.scales, axis=1)
    shown = np.isfinite(gap) & (np.isfinite(a.value) | np.isfinite(b.value))
    return np.where(a.kind != b.kind, np.inf, np.where(shown, gap, 0.0))


@dataclass(frozen=True)
class Brackets(Columns):
    """Pairs of settings between which a map may not be smooth, and the grid edges they lie on."""

    a: Samples
    b: Samples
    """Samples at both ends."""
    edge: Int[np.ndarray, " brackets"]
    """Number of the edge."""

    def __len__(self) -> int:
        """Return the number of pairs."""
        return len(self.edge)


def grid_edges(shape: tuple[int, int]) -> Edges:
    """Vertices at both ends of all grid edges: those along the first axis come first."""
    number = np.arange(shape[0] * shape[1]).reshape(shape)
    down = np.stack([number[:-1], number[1:]], axis=-1).reshape(-1, 2)
    right = np.stack([number[:, :-1], number[:, 1:]], axis=-1).reshape(-1, 2)
    return np.concatenate([down, right])


def suspicious_edges(
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


def divide(structure: Structure, sampler: Sampler, pairs: Brackets) -> Brackets:
    """Parts of pairs that stay sharp: their ends differ in kind, or by more than a smooth map's."""
    count = len(pairs)
    before = sample_distance(structure, pairs.a, pairs.b)
    # one after the other: all first ends, all first dividing points, ..., all second ends
    cuts = Samples.concatenate([pairs.a, _between(sampler, pairs), pairs.b])
    a, b = (cuts.take(np.arange(PARTS * count) + shift) for shift in (0, count))
    now = sample_distance(structure, a, b)
    least = np.where(np.isfinite(before), PARTS**-SHRINKING * before, np.inf)
    least = np.maximum(least, NEGLIGIBLE)
    sharp = np.isinf(now) | (now > np.tile(least, PARTS))
    return Brackets(a, b, np.tile(pairs.edge, PARTS)).take(np.flatnonzero(sharp))


def narrow(structure: Structure, sampler: Sampler, pairs: Brackets, times: int) -> Brackets:
    """Pairs that stay sharp when they are divided some times."""
    for _ in range(times):
        if len(pairs):
            pairs = divide(structure, sampler, pairs)
    return pairs


def _between(sampler: Sampler, pairs: Brackets) -> Samples:
    """Samples at all dividing points of pairs, or next to them where a path is lost."""
    a, b = pairs.a, pairs.b
    share = np.repeat(np.arange(1, PARTS) / PARTS, len(pairs))
    start, length = (np.tile(each, (PARTS - 1, 1)) for each in (a.setting, b.setting - a.setting))
    defined = np.tile(np.isfinite(a.z + b.z).all(axis=1), PARTS - 1)
    found, open_ = sampler(start[:0]), np.arange(len(share))
    order = np.zeros(len(share), int)
    for aside in ASIDE:
        here = (share[open_] + aside / PARTS)[:, None]
        order[open_] = len(found.kind) + np.arange(len(open_))
        found = Samples.concatenate([found, sampler(start[open_] + here * length[open_])])
        lost = ~np.isfinite(found.z[order[open_]]).all(axis=1) & defined[open_]
        open_ = open_[lost]
        if not len(open_):
            break
    return found.take(order)


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
