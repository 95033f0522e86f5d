"""Sets made ready for charts: cut along crossings, with vertices at cusps, without folded cells."""

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from equimorph.arrays import (
    Bool,
    Facets,
    Float,
    Int,
    ItemFlags,
    Items,
    ItemValues,
    Pairs,
    Some,
    VertexFlags,
    VertexNumbers,
)
from equimorph.manifold import EquilibriumSet
from equimorph.manifold.complex.excerpts import excerpt_of
from equimorph.manifold.complex.kept_tables import kept
from equimorph.manifold.geometry.points import VertexKind, on_fold
from equimorph.manifold.geometry.simplices import volumes
from equimorph.manifold.geometry.tangents import fold_forms
from equimorph.manifold.geometry.topology import (
    Adjacency,
    adjacency,
    count_corners,
    cut_at_crossings,
    facets_of,
    flags_of,
    keys_of,
    orientation,
    pieces,
    runs,
)
from equimorph.manifold.queries.cusps import cusps_of
from equimorph.manifold.queries.levels import whole_set

ROUNDS = 6
"""Most rounds of flips."""
OPPOSITE = [[1, 2], [2, 0], [0, 1]]
"""Edges of triangles, by the corner opposite to them."""


def cut_along_crossings(eset: EquilibriumSet) -> EquilibriumSet:
    """A set cut along its crossings, which become boundaries; a set without crossings as it is."""
    return _cut_along_crossings(eset) if eset.crossings else eset


@kept
def _cut_along_crossings(eset: EquilibriumSet) -> EquilibriumSet:
    crossings, folds = (
        facets_of(curves, len(eset.names)) for curves in (eset.crossings, eset.folds)
    )
    cells, origin = cut_at_crossings(eset.cells, crossings, len(eset.points))
    whole = adjacency(cells)
    folded = whole.facets[flags_of(np.sort(origin[whole.facets], axis=1), folds)]
    return replace(
        eset,
        points=eset.points[origin],
        kinds=eset.kinds[origin],
        index=eset.index[origin],
        grid_vertex=eset.grid_vertex[origin],
        cells=cells,
        folds=tuple(pieces(folded)),
        crossings=(),
    )


def crossing_facets(eset: EquilibriumSet, whole: Adjacency) -> Bool[np.ndarray, " F"]:
    """Facets at which a set that `cut_along_crossings` cut ends where other sheets cross."""
    met = (eset.kinds == VertexKind.CROSSING)[whole.facets].all(axis=1)
    return np.asarray(met & (whole.counts == 1) & ~on_box(eset, whole.facets))


def first_copies(eset: EquilibriumSet) -> VertexNumbers:
    """For each vertex the first one that is the same state."""
    own = np.arange(len(eset.points))
    met = np.flatnonzero(eset.kinds == VertexKind.CROSSING)
    if len(met):
        rows = np.concatenate([eset.points.z[met], eset.points.p[met]], axis=1)
        _, first, inverse = np.unique(rows, axis=0, return_index=True, return_inverse=True)
        own[met] = met[first[inverse.ravel()]]
    return own


def on_box(eset: EquilibriumSet, facets: Facets) -> ItemFlags:
    """Whether facets lie on a side of the box; points in one dimension never do."""
    size = eset.box.upper - eset.box.lower
    places, out = eset.coordinates[facets], np.zeros(len(facets), bool)
    for bound in (eset.box.lower, eset.box.upper):
        out |= (np.abs(places - bound) <= 1e-9 * size).all(axis=1).any(axis=1)
    return out


def with_cusp_vertices(eset: EquilibriumSet) -> tuple[EquilibriumSet, VertexNumbers]:
    """A set over two parameters with vertices at its cusps, and which of them these are.

    Without cusps, or over other parameters, it is the set itself.
    """
    made = _with_cusps(eset) if len(eset.names) == 2 else None
    return made or (eset, np.zeros(0, int))


@kept
def _with_cusps(eset: EquilibriumSet) -> tuple[EquilibriumSet, VertexNumbers] | None:
    folded = on_fold(eset.kinds)
    excerpt = excerpt_of(eset, count_corners(folded, eset.cells) >= len(eset.names), folded)
    met, ends, found = cusps_of(excerpt.fabric)
    if len(met) + len(found) == 0:
        return None
    recut = excerpt.put_back(excerpt.fabric.bisect(ends, found))
    whole = whole_set(recut)
    new = len(recut.points) - len(found) + np.arange(len(found))
    cusps = recut.numbers[np.append(excerpt.used[met], new)]
    # straight sides of cells at a cusp may pass it on its wrong side
    fixed = facets_of((*whole.folds, *whole.crossings), 2)
    ground = _Ground(whole.coordinates, on_fold(whole.kinds), _existence(whole, cusps))
    cells = _flip(whole.cells, ground, fixed, whole.stratum, whole.adjacency)
    return replace(whole, cells=cells), cusps


def _existence(eset: EquilibriumSet, cusps: Some) -> Float[np.ndarray, "V 2"]:
    """Vectors at vertices on folds towards where states exist; none elsewhere, nor at cusps."""
    out = np.zeros((len(eset.points), len(eset.names)))
    own = on_fold(eset.kinds)
    own[cusps] = False
    forms = fold_forms(eset.setting, eset.points.z[own], eset.points.p[own])
    out[own] = forms.existence / eset.setting.scales
    return out


def flip_inverted_triangles(
    corners: Int[np.ndarray, "C 3"],
    places: Float[np.ndarray, "V 2"],
    fixed: Pairs,
    sheet: Int[np.ndarray, " C"],
    whole: Adjacency,
) -> Int[np.ndarray, "C 3"]:
    """Flip edges so that fewer triangles overlap their neighbours in the plane.

    Next to cusps and curved folds chords may lie beyond the fold. The edge that such a triangle
    shares with the neighbour that it lies over is exchanged for the other diagonal of both.

    Parameters
    ----------
    corners
        Triangles of sheets that can be oriented.
    places
        Places of all vertices in the plane.
    fixed
        Edges that stay, beside those between sheets.
    sheet
        Sheet of each triangle, within which it overlaps others.
    whole
        Which triangles share edges.
    """
    plain = _Ground(places, np.zeros(len(places), bool), np.zeros_like(places))
    return _flip(corners, plain, fixed, sheet, whole)


@dataclass(frozen=True)
class _Ground:
    """Places of vertices in the plane, which lie on folds, and from there to where states exist.

    An edge from a fold to where the states that meet there do not exist passes a cusp on its wrong
    side, though no triangle overlaps another one.
    """

    places: Float[np.ndarray, "V 2"]
    folded: VertexFlags
    existence: Float[np.ndarray, "V 2"]

    def areas(self, corners: Int[np.ndarray, "n 3"]) -> ItemValues:
        """Signed areas of triangles."""
        return volumes(self.places[corners])

    def astray(self, one: Items, other: Items) -> ItemFlags:
        """Which edges between vertices pass a cusp on its wrong side."""
        way = self.places[other] - self.places[one]
        ahead, back = (np.einsum("nk,nk->n", way, self.existence[each]) for each in (one, other))
        out, into = self.folded[one], self.folded[other]
        return np.asarray((out & ~into & (ahead < 0.0)) | (into & ~out & (back > 0.0)))

    def bad(self, corners: Int[np.ndarray, "n 3"]) -> ItemFlags:
        """Triangles that are turned over, or that have such an edge."""
        out = self.areas(corners) < 0.0
        some = np.flatnonzero(count_corners(self.folded, corners))
        out[some] |= np.any([self.astray(*corners[some][:, k].T) for k in OPPOSITE], axis=0)
        return out


def _flip(
    corners: Int[np.ndarray, "C 3"],
    ground: _Ground,
    fixed: Pairs,
    sheet: Int[np.ndarray, " C"],
    whole: Adjacency,
) -> Int[np.ndarray, "C 3"]:
    """Flip edges so that fewer triangles are bad; see `flip_inverted_triangles` and `_Ground`."""
    places = ground.places
    (a, b), base = whole.links.T, len(places)
    apart = np.zeros(len(whole.facets), bool)
    apart[whole.across[sheet[a] != sheet[b]]] = True
    signs = orientation(corners, _without(whole, apart))[0]
    area = volumes(places[corners]) * signs
    out = corners.copy()
    turned = signs * np.sign(np.bincount(sheet, area))[sheet] < 0
    out[turned] = out[turned][:, ::-1]
    kept, outer = keys_of(fixed, base), keys_of(whole.facets[apart], base)
    area, bad = ground.areas(out), ground.bad(out)
    for _ in range(ROUNDS):
        some = np.flatnonzero(bad)
        some = some[np.argsort(area[some], kind="stable")]
        flipped = _flip_once(out, ground, some, kept, outer) if len(some) else []
        if not flipped:
            break
        area[flipped], bad[flipped] = ground.areas(out[flipped]), ground.bad(out[flipped])
    return out


def _without(whole: Adjacency, apart: Bool[np.ndarray, " F"]) -> Adjacency:
    """Adjacency that does not connect cells across some facets."""
    some = ~apart[whole.across]
    return replace(whole, places=whole.places[some], across=whole.across[some])


def _flip_once(
    corners: Int[np.ndarray, "C 3"],
    ground: _Ground,
    bad: Items,
    kept: Int[np.ndarray, " kept"],
    outer: Int[np.ndarray, " outer"],
) -> list[int]:
    """Flip an edge of each bad triangle where that helps; changes `corners`. Return the flipped."""
    base = len(ground.places)
    near = np.zeros(base, bool)
    near[corners[bad]] = True
    cells = np.flatnonzero(count_corners(near, corners))
    keys = np.concatenate([keys_of(corners[cells][:, k], base) for k in OPPOSITE])
    around = _Around(keys, np.tile(cells, 3)).without(outer)
    cell, other, *new = _best_flips(corners, ground, bad, around, kept)
    # their neighbours are computed again in the next round
    sides = np.stack(new, axis=1)[:, :, OPPOSITE].reshape(-1, 2)
    of_side, neighbours = around.beside(keys_of(sides, base))
    ends = np.searchsorted(of_side, 6 * np.arange(len(cell) + 1))
    flips = zip(cell.tolist(), other.tolist(), pairwise(ends.tolist()), strict=True)
    touched, chosen = set[int](), []
    for k, (one, two, (first, last)) in enumerate(flips):
        if not touched & {one, two}:
            touched |= {one, two, *neighbours[first:last].tolist()}
            chosen.append(k)
    corners[cell[chosen]], corners[other[chosen]] = (each[chosen] for each in new)
    return [*cell[chosen].tolist(), *other[chosen].tolist()]


@dataclass(frozen=True)
class _Around:
    """Edges of cells by their keys, sorted, and the cell of each."""

    keys: Items
    cells: Items

    def without(self, others: Items) -> "_Around":
        """The others, sorted."""
        left = np.flatnonzero(~np.isin(self.keys, others))
        left = left[np.argsort(self.keys[left], kind="stable")]
        return _Around(self.keys[left], self.cells[left])

    def beside(self, keys: Items) -> tuple[Some, Some]:
        """Edge by edge, which it is, and the cells that have it."""
        first, last = (np.searchsorted(self.keys, keys, side) for side in ("left", "right"))
        edge, place = runs(first, last - first)
        return edge, self.cells[place]

    def others(self, keys: Items, cells: Items) -> tuple[Some, Some]:
        """Which cells share an edge with just one other cell, and this one."""
        first, last = (np.searchsorted(self.keys, keys, side) for side in ("left", "right"))
        some = np.flatnonzero(last - first == 2)
        first = first[some]
        return some, self.cells[first] + self.cells[first + 1] - cells[some]


def _best_flips(
    corners: Int[np.ndarray, "C 3"],
    ground: _Ground,
    bad: Items,
    around: _Around,
    kept: Int[np.ndarray, " kept"],
) -> tuple[Some, Some, Int[np.ndarray, "some 3"], Int[np.ndarray, "some 3"]]:
    """Bad triangles, neighbours with which to flip them, and both new triangles."""
    base, before = len(ground.places), ground.areas(corners[bad])
    worst, other = np.full(len(bad), -np.inf), np.full(len(bad), -1)
    new = np.zeros((2, len(bad), 3), int)
    for k, opposite in enumerate(OPPOSITE):
        keys = keys_of(corners[bad][:, opposite], base)
        own, beside = around.others(np.where(np.isin(keys, kept), -1, keys), bad)
        c, a, b = corners[bad[own, None], [k, *opposite]].T
        d = corners[beside].sum(axis=1) - a - b
        pair = np.array([[a, d, c], [d, b, c]]).transpose(0, 2, 1)
        least = np.minimum(*(ground.areas(each) for each in pair))
        area = np.minimum(before[own], ground.areas(corners[beside]))
        old, later = ground.astray(a, b), ground.astray(c, d)
        # edges that are handed to the next vertex of the fold may turn triangles over for a while
        handed = old & ~later & (ground.folded[c] != ground.folded[d])
        least[handed] = np.inf
        good = (area < 0.0) & (least > area) & (old | ~later)
        good = np.flatnonzero((good | handed) & (least > worst[own]))
        own = own[good]
        worst[own], other[own], new[:, own] = least[good], beside[good], pair[:, good]
    some = np.flatnonzero(other >= 0)
    return bad[some], other[some], new[0, some], new[1, some]
