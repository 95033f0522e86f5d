"""Sets made ready for charts: cut along crossings, with vertices at cusps, without folded cells."""

from dataclasses import replace

import numpy as np

from equimorph.arrays import Bool, Facets, Float, Int, ItemFlags, Items, Pairs, VertexNumbers
from equimorph.manifold import EquilibriumSet
from equimorph.manifold.complex.excerpts import Excerpt, excerpt_of
from equimorph.manifold.complex.kept_tables import from_cache, kept
from equimorph.manifold.complex.marked_complex import Fabric
from equimorph.manifold.complex.vertices import Vertices
from equimorph.manifold.geometry.points import VertexKind, on_fold
from equimorph.manifold.geometry.simplices import volumes
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
)
from equimorph.manifold.queries.cusps import cusps_on_edges
from equimorph.manifold.queries.levels import whole_set

ROUNDS = 6
"""Most rounds of flips."""


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


def add_cusp_vertices(excerpt: Excerpt, fabric: Fabric) -> tuple[Fabric, Int[np.ndarray, " cusps"]]:
    """An excerpt over two parameters with vertices at its cusps, and which of them these are.

    `fabric`: what was made of its cells; all of its vertices are those of the excerpt.
    """
    count, used = len(fabric.vertices), excerpt.used

    def cusps() -> tuple[Pairs, Vertices]:
        ends, found = cusps_on_edges(excerpt.fabric)
        return used[ends], found

    ends, found = from_cache(excerpt.eset, "cusps", cusps)
    if len(ends):
        fabric = fabric.bisect(np.searchsorted(used, ends), found)
    return fabric, np.arange(count, len(fabric.vertices))


def with_cusp_vertices(eset: EquilibriumSet) -> EquilibriumSet:
    """A set with vertices at its cusps; the set itself if it has none."""
    made = _with_cusps(eset) if len(eset.names) == 2 else None
    return eset if made is None else made


@kept
def _with_cusps(eset: EquilibriumSet) -> EquilibriumSet | None:
    folded = on_fold(eset.kinds)
    excerpt = excerpt_of(eset, count_corners(folded, eset.cells) >= len(eset.names), folded)
    fabric, cusps = add_cusp_vertices(excerpt, excerpt.fabric)
    return whole_set(excerpt.put_back(fabric)) if len(cusps) else None


def flip_inverted_triangles(
    corners: Int[np.ndarray, "C 3"], places: Float[np.ndarray, "V 2"], fixed: Pairs
) -> Int[np.ndarray, "C 3"]:
    """Flip edges so that fewer triangles overlap their neighbours in the plane.

    Next to cusps and curved folds chords may lie beyond the fold. The edge that such a triangle
    shares with the neighbour that it lies over is exchanged for the other diagonal of both.

    Parameters
    ----------
    corners
        Triangles of a sheet that can be oriented.
    places
        Places of all vertices in the plane.
    fixed
        Edges that stay.
    """
    signs, _ = orientation(corners, adjacency(corners))
    area = volumes(places[corners]) * signs
    out = corners.copy()
    turned = signs * np.sign(area.sum()) < 0
    out[turned] = out[turned][:, ::-1]
    base = len(places)
    kept = set(keys_of(fixed, base).tolist())
    for _ in range(ROUNDS):
        area = volumes(places[out])
        bad = np.flatnonzero(area < 0.0)
        if len(bad) == 0 or not _flip_once(out, places, bad[np.argsort(area[bad])], kept):
            break
    return out


def _flip_once(
    corners: Int[np.ndarray, "C 3"], places: Float[np.ndarray, "V 2"], bad: Items, kept: set[int]
) -> int:
    """Flip an edge of each bad triangle where that helps; changes `corners`."""
    around: dict[int, list[int]] = {}
    base = len(places)
    near = np.flatnonzero(np.isin(corners, corners[bad]).any(axis=1)).tolist()
    for cell in near:
        a, b, c = corners[cell].tolist()
        for pair in ((a, b), (b, c), (c, a)):
            around.setdefault(min(pair) * base + max(pair), []).append(cell)
    touched: set[int] = set()
    count = 0
    for cell in bad.tolist():
        best = _best_flip(corners, places, cell, around, kept)
        if best is None or touched & {cell, best[0]}:
            continue
        other, first, second = best
        corners[cell], corners[other] = first, second
        touched |= {cell, other}
        # their neighbours are computed again in the next round
        keys = _keys(first, base) + _keys(second, base)
        touched |= {beside for key in keys for beside in around.get(key, ())}
        count += 1
    return count


def _area(places: Float[np.ndarray, "V 2"], a: int, b: int, c: int) -> float:
    """Signed area of a single triangle; `volumes` takes ten times as long."""
    (x, y), (x_b, y_b), (x_c, y_c) = places[[a, b, c]].tolist()
    area: float = 0.5 * ((x_b - x) * (y_c - y) - (y_b - y) * (x_c - x))
    return area


def _keys(triangle: tuple[int, int, int], base: int) -> list[int]:
    a, b, c = triangle
    return [min(p) * base + max(p) for p in ((a, b), (b, c), (c, a))]


def _best_flip(
    corners: Int[np.ndarray, "C 3"],
    places: Float[np.ndarray, "V 2"],
    cell: int,
    around: dict[int, list[int]],
    kept: set[int],
) -> tuple[int, tuple[int, int, int], tuple[int, int, int]] | None:
    """Neighbour with which to flip, and both new triangles."""
    base, own = len(places), corners[cell].tolist()
    best = None
    for k in range(3):
        c, a, b = own[k], own[(k + 1) % 3], own[(k + 2) % 3]
        key = min(a, b) * base + max(a, b)
        others = [other for other in around.get(key, ()) if other != cell]
        if key in kept or len(others) != 1:
            continue
        d = next(v for v in corners[others[0]].tolist() if v not in {a, b})
        new = ((a, d, c), (d, b, c))
        pair = (own, corners[others[0]].tolist())
        before, after = (min(_area(places, *each) for each in both) for both in (pair, new))
        if after > before and (best is None or after > best[0]):
            best = (after, others[0], *new)
    return None if best is None else best[1:]
