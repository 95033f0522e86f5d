"""Cuts of complexes where a function changes its sign: exact vertices on the edges it crosses.

Edges along which sheets cross are cut in all sheets at once.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from equimorph.arrays import (
    Bool,
    EdgeFlags,
    Float,
    Int,
    ItemFlags,
    Items,
    ItemValues,
    Pairs,
    Some,
    VertexFlags,
)
from equimorph.manifold.complex.edge_points import Places, on_edges
from equimorph.manifold.complex.marked_complex import Fabric, FacetMark, edges_of
from equimorph.manifold.complex.vertices import Vertices, vertices_of
from equimorph.manifold.geometry.topology import keys_of, runs

TRIALS = 60
"""Largest number of iterations of the bracketed root finder on one edge."""
ELSEWHERE = (0.5, 0.25, 0.75, 0.1, 0.9)
"""Fractions between the bounds of a root that are tried if the expected place has no vertex."""
ROUND_OFF = 1e-12
"""Part of the range of a function below which its values count as zero."""
STILL = 1e-11
"""Share of an edge by which the last step moves at most."""
PATIENCE = 4
"""Steps in which a bracket must halve; else it is halved from then on: regula falsi creeps up to
jumps."""
NARROW, STEEP = 1e-7, 1e-3
"""A function jumps where it changes by this share of its values at the ends within so small a share
of an edge; the place of a jump need not be known better."""
Values = Float[np.ndarray, " V"]
Function = Callable[[Vertices], Values]
Ends = Pairs
Between = Callable[
    [Fabric, Ends, int, Items, Float[np.ndarray, "n 2"]],
    tuple[ItemFlags, Vertices],
]
Rows = Int[np.ndarray, " _"]
SharedEnds = Int[np.ndarray, "_ 2"]


@dataclass(frozen=True)
class Cut:
    """A fabric cut along a level, values at its vertices, and how many edges could not be cut."""

    fabric: Fabric
    values: Values
    lost: int

    @property
    def on_level(self) -> VertexFlags:
        """Vertices on the level."""
        return np.asarray(self.values == 0.0)


def cut_between(
    fabric: Fabric, values: Values, between: Between, function: Function | None = None
) -> Cut:
    """Put vertices on edges whose ends have values of different signs, until no such edge is left.

    Parameters
    ----------
    values
        At the vertices of the fabric; new vertices have the value zero.
    between
        Finds the new vertices: of a fabric, edges, their mark and indices, and their values; tells
        on which edges it found some.
    function
        Gives values to vertices that cuts of one sheet put on another that crosses it, in place of
        zero: it may depend on the sheet.
    """
    base, found = 1 << 31, _Found.nothing(fabric.vertices)
    while True:
        ends, of_cells = edges_of(fabric.cells, len(fabric.vertices))
        crossed = values[ends[:, 0]] * values[ends[:, 1]] < 0.0
        marks, keys = fabric.edge_marks(ends), keys_of(ends, base)
        lowest = np.full(len(ends), np.iinfo(int).max)
        for side in of_cells.T:
            np.minimum.at(lowest, side, fabric.cell_index)
        # cuts lead from new vertices, where the function vanishes: most edges that are crossed
        # at all are so from the beginning, and their vertices are found side by side
        fresh = np.flatnonzero(crossed & ~np.isin(keys, found.asked))
        for mark in np.unique(marks[fresh]).tolist():
            own = fresh[marks[fresh] == mark]
            done, more = between(fabric, ends[own], mark, lowest[own], values[ends[own]])
            found = found.join(keys[own], done, more)
        lost = found.asked[found.row < 0]
        chosen = _one_per_cell(crossed & ~np.isin(keys, lost), of_cells)
        if len(chosen) == 0:
            return Cut(fabric, values, len(lost))
        chosen = chosen[first_copies(fabric, ends[chosen], marks[chosen])]
        for mark in np.unique(marks[chosen]).tolist():
            own = chosen[marks[chosen] == mark]
            more = found.of(keys[own])
            cut, whole = with_copies(fabric, ends[own], more)
            others = whole.take(np.arange(len(more), len(whole)))
            known = function(others) if function else np.zeros(len(others))
            known = np.where(np.abs(known) <= ROUND_OFF * np.abs(values).max(), 0.0, known)
            fabric = fabric.bisect(cut, whole)
            values = np.concatenate([values, np.zeros(len(more)), known])


@dataclass(frozen=True)
class _Found:
    """Examined edges, by their keys, and their vertices; row −1: no vertex."""

    asked: Items
    row: Items
    vertices: Vertices

    @classmethod
    def nothing(cls, like: Vertices) -> "_Found":
        """No edges yet."""
        none = np.zeros(0, int)
        return cls(none, none, like.take(none))

    def join(
        self, keys: Int[np.ndarray, " more"], done: Bool[np.ndarray, " more"], more: Vertices
    ) -> "_Found":
        """These edges and more of them."""
        row = np.full(len(keys), -1)
        row[done] = len(self.vertices) + np.arange(len(more))
        asked = np.concatenate([self.asked, keys])
        return _Found(asked, np.concatenate([self.row, row]), self.vertices.join(more))

    def of(self, keys: Some) -> Vertices:
        """Vertices on edges that have some."""
        order = np.argsort(self.asked)
        return self.vertices.take(self.row[order[np.searchsorted(self.asked[order], keys)]])


def _one_per_cell(crossed: EdgeFlags, of_cells: Int[np.ndarray, "C sides"]) -> Items:
    """Crossed edges, no two of one cell; as many as agree on an order that looks random."""
    rank = np.where(crossed, (np.arange(len(crossed)) * 2654435761) % 4294967296 + 1, 0)
    best = rank[of_cells].max(axis=1)
    beaten = np.zeros(len(crossed), bool)
    for side in of_cells.T:
        beaten[side[rank[side] < best]] = True
    return np.flatnonzero(crossed & ~beaten)


def roots(
    fabric: Fabric,
    ends: Pairs,
    mark: int,
    index: Items,
    known: Float[np.ndarray, "n 2"],
    value_of: Callable[[Vertices, Some], Float[np.ndarray, " some"]],
) -> tuple[ItemFlags, Vertices]:
    """Edges on which a function vanishes or jumps through zero, and the vertices there.

    By regula falsi (Illinois), and by halves where that is slow. `known` are the values at both
    ends, of different signs; `value_of` gives those at vertices on the edges that its second
    argument names. The edges have one mark, and each has an index.
    """
    low, high = np.zeros(len(ends)), np.ones(len(ends))
    at_low, at_high = known.T.copy()
    size = np.maximum(np.abs(at_low), np.abs(at_high))
    below, above = at_low.copy(), at_high.copy()
    todo, done = np.arange(len(ends)), np.zeros(len(ends), bool)
    moved = np.zeros(len(ends), int)
    lanes, found, last = [], [], np.full(len(ends), np.inf)
    widths, slow = np.full((PATIENCE, len(ends)), np.inf), np.zeros(len(ends), bool)
    for number in range(TRIALS):
        t = low[todo] - at_low[todo] * (high - low)[todo] / (at_high - at_low)[todo]
        slow |= high - low > 0.5 * widths[number % PATIENCE]
        t = np.where(slow[todo], 0.5 * (low + high)[todo], t)
        widths[number % PATIENCE] = high - low
        bounds = low[todo], high[todo]
        good, at, t = _somewhere(fabric, ends[todo], mark, index[todo], bounds, t)
        todo, t = todo[good], t[good]
        value = value_of(at, todo)
        ended = (np.abs(value) <= ROUND_OFF * size[todo]) | (np.abs(t - last[todo]) < STILL)
        jumps = np.abs(above - below)[todo] > STEEP * size[todo]
        ended |= jumps & ((high - low)[todo] < NARROW)
        last[todo] = t
        found.append(at.take(np.flatnonzero(ended)))
        lanes.append(todo[ended])
        done[todo[ended]] = True
        todo, t, value = todo[~ended], t[~ended], value[~ended]
        if len(todo) == 0:
            break
        left = value * at_low[todo] > 0.0
        low[todo], high[todo] = np.where(left, t, low[todo]), np.where(left, high[todo], t)
        below[todo], above[todo] = (
            np.where(left, value, below[todo]), np.where(left, above[todo], value)
        )  # fmt: skip
        # an end that stays twice counts half, so that it moves eventually
        share = np.where(moved[todo] == np.where(left, -1, 1), 0.5, 1.0)
        at_low[todo] = np.where(left, value, share * at_low[todo])
        at_high[todo] = np.where(left, share * at_high[todo], value)
        moved[todo] = np.where(left, -1, 1)
    whole = found[0]
    for more in found[1:]:
        whole = whole.join(more)
    return done, whole.take(np.argsort(np.concatenate(lanes)))


def _somewhere(
    fabric: Fabric,
    ends: Pairs,
    mark: int,
    index: Items,
    bounds: tuple[ItemValues, ItemValues],
    t: ItemValues,
) -> tuple[ItemFlags, Vertices, ItemValues]:
    """Vertices on edges at the places that are proposed, or elsewhere between the bounds."""
    (low, high), t = bounds, t.copy()
    target = Places(ends, mark, index, t)
    good, at = on_edges(fabric, target)
    order = np.flatnonzero(good)
    for share in ELSEWHERE:
        left = np.flatnonzero(~good)
        if len(left) == 0:
            break
        t[left] = low[left] + share * (high - low)[left]
        more, vertices = on_edges(fabric, target.take(left))
        good[left[more]] = True
        at, order = at.join(vertices), np.concatenate([order, left[more]])
    return good, at.take(np.argsort(order)), t


def _crossing_edges(fabric: Fabric) -> tuple[SharedEnds, Rows]:
    """Edges on crossings, of all sheets, in the order of keys that copies of one edge share."""
    facets = fabric.facets[(fabric.marks & FacetMark.CROSSING) > 0]
    if len(facets) == 0 or facets.shape[1] == 1:
        return np.zeros((0, 2), int), np.zeros(0, int)
    ends, _ = edges_of(facets, len(fabric.vertices))
    keys = _keys(fabric, ends)
    order = np.argsort(keys, kind="stable")
    return ends[order], keys[order]


def first_copies(fabric: Fabric, ends: SharedEnds, marks: Rows) -> Bool[np.ndarray, " _"]:
    """Which edges are no copies of earlier ones."""
    out = np.ones(len(ends), bool)
    own = np.flatnonzero((marks & FacetMark.CROSSING) > 0)
    if len(own):
        _, first = np.unique(_keys(fabric, ends[own]), return_index=True)
        out[np.delete(own, first)] = False
    return out


def copies(fabric: Fabric, ends: SharedEnds) -> tuple[Rows, SharedEnds]:
    """Rows of edges on crossings, and the edges of other sheets that are the same."""
    every, keys = _crossing_edges(fabric)
    if len(every) == 0:
        return np.zeros(0, int), every
    wanted = _keys(fabric, ends)
    start, stop = (np.searchsorted(keys, wanted, side) for side in ("left", "right"))
    row, at = runs(start, stop - start)
    found = every[at]
    other = (np.sort(ends[row], axis=1) != found).any(axis=1)
    # the same points may be joined by an edge off the crossing
    base = len(fabric.vertices)
    on = np.isin(keys_of(ends, base), keys_of(every, base))[row]
    return row[other & on], found[other & on]


def with_copies(fabric: Fabric, ends: SharedEnds, more: Vertices) -> tuple[SharedEnds, Vertices]:
    """Edges to be cut at vertices, with the copies of those on crossings."""
    row, others = copies(fabric, ends)
    if len(row) == 0:
        return ends, more
    shared = np.full(len(ends), -1)
    met = np.unique(row)
    shared[met] = fabric.vertices.shared.max() + 1 + np.arange(len(met))
    first, second = (fabric.vertices.rows[others[:, side]] for side in range(2))
    plane = first + first @ np.swapaxes(second, 1, 2) @ second
    own = more.take(row)
    known = own.z, own.p, own.kinds, own.index, own.grid_vertex
    new = vertices_of(fabric.setting, *known, plane)
    whole = more.join(new)
    whole = replace(whole, shared=np.concatenate([shared, shared[row]]))
    return np.concatenate([ends, others]), whole


def duplicates(fabric: Fabric) -> SharedEnds:
    """Edges off the crossings between points that other edges join, too."""
    ends, _ = edges_of(fabric.cells, len(fabric.vertices))
    both = (fabric.vertices.shared[ends] >= 0).all(axis=1)
    ends = ends[both]
    keys = _keys(fabric, ends)
    _, inverse, counts = np.unique(keys, return_inverse=True, return_counts=True)
    plain = (fabric.edge_marks(ends) & FacetMark.CROSSING) == 0
    return np.asarray(ends[plain & (counts[inverse] > 1)])


def _keys(fabric: Fabric, ends: SharedEnds) -> Rows:
    """One number for all edges between the same points."""
    shared = fabric.vertices.shared
    return np.asarray(keys_of(shared[ends] + 1, int(shared.max(initial=0)) + 2))
