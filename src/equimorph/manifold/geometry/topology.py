"""Topology of simplicial complexes: facets, components, strata, boundary pieces, orientation."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations

import numpy as np

from equimorph.arrays import (
    Bool,
    CellFlags,
    CellNumbers,
    Cells,
    Facets,
    Float,
    Int,
    ItemFlags,
    Items,
    Pairs,
    VertexFlags,
    VertexNumbers,
)
from equimorph.linalg.graphs import components
from equimorph.manifold.geometry.facet_kernels import join_cells
from equimorph.manifold.geometry.kernels import orient, orient_facets, walk_chains
from equimorph.manifold.geometry.simplices import volumes

PAIR = 2
"""Corners of an edge, eigenvalues that vanish together, halves of a sheet."""


@dataclass(frozen=True)
class Adjacency:
    """Facets of cells, and how cells hang together across them.

    facets (F, d), sorted, with their cell counts; cell_facets (C, d + 1): facet opposite to each
    corner; across: facets that pairs of cells share (where more than two do, a chain of pairs), and
    places of these in the flat `cell_facets`.
    """

    facets: Int[np.ndarray, "F d"]
    counts: Int[np.ndarray, " F"]
    cell_facets: Cells
    across: Int[np.ndarray, " N"]
    places: Int[np.ndarray, "N 2"]

    @cached_property
    def links(self) -> Int[np.ndarray, "N 2"]:
        """Pairs of cells that share a facet."""
        return np.asarray(self.places // self.cell_facets.shape[1])

    @cached_property
    def beside(self) -> Int[np.ndarray, "F most"]:
        """Cells that have each facet, −1 where there are fewer than of others."""
        out = np.full((len(self.facets), int(self.counts.max(initial=1))), -1)
        number, cells = self.cell_facets.ravel(), self.cell_facets.shape[1]
        # of values assigned to one entry the last one stays: the first cell of each facet
        out[number[::-1], 0] = np.arange(len(number))[::-1] // cells
        after = np.arange(len(self.across)) - np.searchsorted(self.across, self.across)
        out[self.across, 1 + after] = self.places[:, 1] // cells
        return out

    @property
    def manifold(self) -> Bool[np.ndarray, " N"]:
        """Links across facets of exactly two cells."""
        return np.asarray(self.counts[self.across] == 2)


def keys_of(rows: Int[np.ndarray, "n k"], base: int) -> Items:
    """One number per sorted row of vertices below `base`."""
    assert base ** rows.shape[1] < 2**63, "more vertices than fit into a key"
    if rows.shape[1] == 2:  # much cheaper than sorting pairs, or triples
        return np.asarray(np.minimum(*rows.T) * base + np.maximum(*rows.T))
    if rows.shape[1] == 3:
        a, b, c = rows.T
        low, high = (f(f(a, b), c) for f in (np.minimum, np.maximum))
        return np.asarray((low * base + (a + b + c - low - high)) * base + high)
    keys = np.zeros(len(rows), np.int64)
    for column in np.sort(rows, axis=1).T:
        keys = keys * base + column
    return keys


def rows_of(keys: Items, base: int, length: int) -> Int[np.ndarray, "n k"]:
    """Rows of vertices that `keys_of` made keys of."""
    columns = []
    for _ in range(length):
        keys, column = np.divmod(keys, base)
        columns.append(column)
    return np.stack(columns[::-1], axis=1)


def faces_of(cells: Cells, size: int) -> Int[np.ndarray, "n size"]:
    """All distinct faces of cells with `size` corners."""
    base = int(cells.max(initial=0)) + 1
    sides = [cells[:, list(chosen)] for chosen in combinations(range(cells.shape[1]), size)]
    keys = distinct(np.concatenate([keys_of(side, base) for side in sides]))
    return rows_of(keys, base, size)


def distinct(keys: Items) -> Int[np.ndarray, " m"]:
    """Return distinct numbers, none negative, in order.

    Sorting beats the hashing of `np.unique` several times over.
    """
    keys = np.sort(keys)
    return keys[np.diff(keys, prepend=-1) > 0]


def among(keys: Items, known: Int[np.ndarray, " m"]) -> ItemFlags:
    """Which keys are among known ones that are in order."""
    if len(known) == 0:
        return np.zeros(len(keys), bool)
    at = np.minimum(np.searchsorted(known, keys), len(known) - 1)
    return np.asarray(known[at] == keys)


def places_among(rows: Int[np.ndarray, "n k"], known: Int[np.ndarray, "m k"], base: int) -> Items:
    """Place of each row of vertices below `base` among known rows; −1 for none."""
    sought, keys = keys_of(rows, base), keys_of(known, base)
    if len(keys) == 0:
        return np.full(len(sought), -1)
    order = np.argsort(keys)
    at = order[np.minimum(np.searchsorted(keys[order], sought), len(keys) - 1)]
    return np.where(keys[at] == sought, at, -1)


def count_corners(chosen: VertexFlags, cells: Int[np.ndarray, "n corners"]) -> Items:
    """How many corners of each cell are among the chosen vertices.

    Column by column: reductions over rows of a few flags cost several times as much.
    """
    out = np.zeros(len(cells), np.int8)
    for column in cells.T:
        out += chosen[column]
    return out


def adjacency(cells: Cells) -> Adjacency:
    """Facets and links of segments, triangles or tetrahedra."""
    base = int(cells.max(initial=0)) + 1
    return Adjacency(*join_cells(np.ascontiguousarray(cells, int), base))


def flags_of(facets: Int[np.ndarray, "F d"], chosen: Facets) -> Bool[np.ndarray, " F"]:
    """Which of the facets are among the chosen ones."""
    base = max(int(facets.max(initial=0)), int(chosen.max(initial=0))) + 1
    return np.isin(keys_of(facets, base), keys_of(chosen, base))


def runs(start: Int[np.ndarray, " runs"], count: Int[np.ndarray, " runs"]) -> tuple[Items, Items]:
    """Run of each of its members, and their numbers: start, start + 1, … of one after the other."""
    run = np.repeat(np.arange(len(count)), count)
    return run, np.arange(len(run)) + np.repeat(start - np.cumsum(count) + count, count)


def labels(cells: int, links: Pairs) -> CellNumbers:
    """Connected pieces of cells over links, largest first."""
    label = components(cells, links)
    sizes = np.bincount(label)
    rank = np.empty(len(sizes), int)
    rank[np.argsort(-sizes, kind="stable")] = np.arange(len(sizes))
    return np.asarray(rank[label])


def euler_characteristic(cells: Cells, facets: int | None = None) -> int:
    """Vertices − edges + triangles − tetrahedra; the number of facets may be known."""
    corners = cells.shape[1]
    numbers = [
        np.count_nonzero(np.bincount(cells.ravel())),
        *(
            facets if facets is not None and k == corners - 1 else len(faces_of(cells, k))
            for k in range(2, corners)
        ),
    ]
    signs = (-1) ** np.arange(corners)
    return int(signs @ [*numbers, len(cells)])


def pieces(facets: Facets) -> list[Int[np.ndarray, "..."]]:
    """Connected pieces of points, edges or triangles.

    Points come one by one, edges as polylines (see `chains`), triangles as arrays of them.
    """
    if facets.shape[1] == 1:
        return list(facets)
    if facets.shape[1] == 2:
        return chains(facets)
    label = labels(len(facets), adjacency(facets).links) if len(facets) else np.zeros(0, int)
    return [facets[label == k] for k in range(label.max(initial=-1) + 1)]


def facets_of(curves: Sequence[Int[np.ndarray, "..."]], d: int) -> Facets:
    """Facets of all of several pieces, such as the folds of a set; see `pieces`."""
    each = [np.stack([c[:-1], c[1:]], axis=1) if d == 2 else c.reshape(-1, d) for c in curves]
    return np.concatenate([np.zeros((0, d), int), *each])


def chains(pairs: Pairs) -> list[Int[np.ndarray, "..."]]:
    """Polylines along edges, split where other than two meet; closed ones repeat the start."""
    if len(pairs) == 0:
        return []
    vertices, seen, ends = np.unique(pairs, return_index=True, return_inverse=True)
    order = np.argsort(ends.ravel(), kind="stable") // PAIR
    first = np.concatenate([[0], np.cumsum(np.bincount(ends.ravel()))])
    points, starts = walk_chains(ends.reshape(-1, PAIR), first, order, np.argsort(seen))
    return np.split(vertices[points], starts[1:])


def orientation(cells: Cells, whole: Adjacency) -> tuple[CellNumbers, int]:
    """Signs that orient all cells coherently, and the number of contradictions."""
    mates = np.full(cells.size, -1)
    first, second = whole.places[whole.manifold].T
    mates[first], mates[second] = second, first
    signs = np.zeros(len(cells), int)
    return signs, int(orient(mates.reshape(cells.shape), _induced_signs(cells), signs)) // 2


def _induced_signs(cells: Cells) -> Cells:
    """Orientation that each cell gives its facets, relative to their vertices in order."""
    signs = np.empty(cells.shape, int)
    orient_facets(np.ascontiguousarray(cells), signs)
    return signs


def projected_volume(
    coordinates: Float[np.ndarray, "V d"], cells: Cells
) -> Float[np.ndarray, " C"]:
    """Signed volumes of the cells over the space of the free parameters."""
    return volumes(coordinates[cells])


@dataclass(frozen=True)
class Senses:
    """How cells are oriented.

    signs: coherent orientation of the manifold patches, in which the projected volume of most cells
    has the sign of the parity of their index; overturned: cells that project against it.
    """

    signs: CellNumbers
    contradictions: int
    overturned: CellFlags


def senses(
    cells: Cells,
    index: CellNumbers,
    coordinates: Float[np.ndarray, "V d"],
    whole: Adjacency,
    component: CellNumbers | None = None,
) -> Senses:
    """Orientation of cells with the index that each has.

    Patches end where more than two cells share a facet; where none do, they are the components,
    which may be known.
    """
    signs, contradictions = orientation(cells, whole)
    manifold = whole.manifold
    if component is None or not manifold.all():
        component = labels(len(cells), whole.links[manifold])
    volume = projected_volume(coordinates, cells) * signs * np.where(index % 2 == 0, 1, -1)
    total = np.sign(np.bincount(component, weights=volume, minlength=1)).astype(int)
    return Senses(signs * total[component], contradictions, volume * total[component] < 0)


def count_unbalanced(
    cells: Cells,
    index: CellNumbers,
    whole: Adjacency,
    sense: Senses,
    facets: Bool[np.ndarray, " F"],
) -> int:
    """Number of the facets whose cells, with the orientation of their index, do not cancel.

    As they do where sheets cross: det [F_z F_p; tᵀ] changes its sign along each of them. Where a
    pair of eigenvalues vanishes it does so on one of the two alone, whose halves are left over.
    """
    if len(cells) == 0:
        return 0
    around, count = whole.cell_facets.ravel(), len(whole.counts)
    induced = _induced_signs(cells) * sense.signs[:, None]
    total = np.bincount(around, weights=induced.ravel(), minlength=count)
    own = np.repeat(index, cells.shape[1])
    most, least = np.full(count, own.min()), np.full(count, own.max())
    np.maximum.at(most, around, own)
    np.minimum.at(least, around, own)
    return int((np.abs(total) != np.where(most - least == PAIR, PAIR, 0))[facets].sum())


def cut_at_crossings(
    cells: Cells, crossings: Int[np.ndarray, "x d"], count: int
) -> tuple[Cells, VertexNumbers]:
    """Cells parted at facets on crossings, and for each vertex then the one that it was.

    Cells keep a vertex of a crossing in common as long as facets lead from one to the other around
    it without crossing. The first `count` vertices are those that there were.
    """
    if len(crossings) == 0:
        return cells, np.arange(count)
    corners = cells.shape[1]
    whole = adjacency(cells)
    joined = ~flags_of(whole.facets, crossings)[whole.across]
    links, facets = whole.links[joined], whole.facets[whole.across[joined]]
    same = [cells[own][:, None] == facets[:, :, None] for own in links.T]
    first, second = (
        (own[:, None] * corners + at.argmax(axis=2)).ravel()
        for own, at in zip(links.T, same, strict=True)
    )
    around = components(cells.size, np.stack([first, second], axis=1))
    met = np.isin(cells.ravel(), crossings)
    # vertices off the crossings are never divided
    key = np.where(met, around, -1 - cells.ravel())
    _, first, label = np.unique(key, return_index=True, return_inverse=True)
    origin = cells.ravel()[first]
    order = np.argsort(origin, kind="stable")
    number = np.empty(len(order), int)
    again = np.diff(origin[order], prepend=-1) == 0
    number[order] = np.where(again, count + np.cumsum(again) - 1, origin[order])
    more = origin[order][again]
    return number[label].reshape(cells.shape), np.concatenate([np.arange(count), more])
