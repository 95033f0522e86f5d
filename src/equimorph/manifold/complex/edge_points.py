"""Exact vertices on the edges of a complex."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from equimorph.arrays import Bool, Float, Int, ItemFlags, Items, ItemValues, Pairs, Some
from equimorph.equilibria.settle import lower_index
from equimorph.linalg.lanes import results_of
from equimorph.manifold.complex.edge_kernels import bend_edges, check_edges, lean_edges
from equimorph.manifold.complex.marked_complex import TETRAHEDRA, Fabric, FacetMark, held_parameters
from equimorph.manifold.complex.vertices import Vertices, free_vertices, vertices_of
from equimorph.manifold.geometry.exact_points import (
    Aim,
    Corrected,
    Pinned,
    correct_between,
    correct_points,
)
from equimorph.manifold.geometry.points import VertexKind
from equimorph.manifold.geometry.setting import embed
from equimorph.manifold.geometry.tangents import Ends
from equimorph.tolerances import IN_BOX, SAME_VERTEX

CHUNK = 512
"""Edges that are worked on together: their work arrays stay small, and threads share the chunks."""
REACH = 0.3
"""How far from its prediction a new vertex may be corrected, relative to its edge."""
EXCESS = 0.35
"""How much longer the parts of an edge may be than they would be on a straight one, relative to
it."""
MET = (0, -2, -1)
"""Columns of a vertex's place by which candidates for the same vertex are sorted."""
WEIGHTS = np.array([0.36, 0.48, 0.8])
"""Coordinates, and a direction in them, along which vertices are in order."""
BESIDE = 0.05
"""How near to a side of the box, relative to its edge, a vertex of a refined set may lie where the
set bulges over that side; cuts may have to pass nearer."""
ALONG = 0.5
"""Least cosine of the angle between an edge and the set at its new vertex."""


def chunks(chosen: Items, marks: Int[np.ndarray, " E"]) -> list[Int[np.ndarray, " k"]]:
    """Edges in chunks of equal marks; those on curves first, because they take longest."""
    parts: list[Int[np.ndarray, " k"]] = []
    for mark in np.unique(marks[chosen])[::-1].tolist():
        own = chosen[marks[chosen] == mark]
        parts.extend(own[at : at + CHUNK] for at in range(0, len(own), CHUNK))
    return parts


Tried = tuple[Bool[np.ndarray, " _"], Vertices]
"""For which edges vertices were found, and these; lists of them are of several lengths."""


@dataclass(frozen=True)
class Places:
    """Edges with a common mark, and the places along them at which vertices are required.

    lowest: index of the cells around; of those with the lowest one, where they differ.
    """

    ends: Pairs
    mark: int
    lowest: Items
    t: ItemValues

    def take(self, some: Some) -> "Places":
        """Return some of the edges."""
        return Places(self.ends[some], self.mark, self.lowest[some], self.t[some])


def on_all_edges(fabric: Fabric, parts: Sequence[Places]) -> list[Tried]:
    """Exact vertices on edges, several parts at the same time; see `on_edges`."""
    return list(results_of([partial(on_edges, fabric, part, refining=True) for part in parts]))


def unmet(fabric: Fabric, tried: Sequence[Tried]) -> list[Tried]:
    """Of vertices found on edges those that are not in use already.

    Where cells are too coarse, an edge may lead over another vertex, which its middle finds again.
    """
    met = _met(fabric, [vertices for _, vertices in tried])
    out = []
    for (found, vertices), own in zip(tried, met, strict=True):
        kept = found.copy()
        kept[found] = ~own
        out.append((kept, vertices.take(np.flatnonzero(~own))) if own.any() else (found, vertices))
    return out


def _met(fabric: Fabric, parts: Sequence[Vertices]) -> list[ItemFlags]:
    """Which vertices of each part are in use already."""
    sizes = [len(part) for part in parts]
    out, cuts = np.zeros(sum(sizes), bool), np.cumsum(sizes)
    if len(out) == 0:
        return np.split(out, cuts[:-1])
    used = np.zeros(len(fabric.vertices), bool)
    used[fabric.cells] = True
    known, place = np.flatnonzero(used), fabric.vertices.place
    key = place[known[:, None], MET] @ WEIGHTS
    own = np.concatenate([part.place[:, MET] @ WEIGHTS for part in parts])
    order = np.argsort(own)
    first, last = (np.searchsorted(own[order], key + gap) for gap in (-SAME_VERTEX, SAME_VERTEX))
    for at in np.flatnonzero(last > first).tolist():
        for number in order[first[at] : last[at]].tolist():
            part = int(np.searchsorted(cuts, number, "right"))
            there = parts[part].place[number - cuts[part]]  # counted from the end of the part
            out[number] |= np.linalg.norm(there - place[known[at]]) <= SAME_VERTEX
    return np.split(out, cuts[:-1])


def on_edges(fabric: Fabric, target: Places, *, refining: bool = False) -> Tried:
    """Exact vertices at places along edges with a mark, and for which edges they were found.

    For `refining`, their tangent spaces may be rough: those at the start of the last step of
    Newton; and vertices very near to a side of the box, which make slivers, are refused.
    """
    found, vertices = _orthogonally(fabric, target, rough=refining)
    left = np.flatnonzero(~found)
    if fabric.dimension != TETRAHEDRA or target.mark & FacetMark.CROSSING or len(left) == 0:
        return found, vertices
    again, more = _beside_sides(fabric, target.take(left), BESIDE if refining else 0.0)
    at = np.concatenate([np.flatnonzero(found), left[again]])
    found[left[again]] = True
    return found, vertices.join(more).take(np.argsort(at))


@dataclass(frozen=True)
class _Guess:
    """Points on the cubics over edges.

    place: in the embedding; plane: the mean of the tangent spaces at both ends; length: of the
    edges.
    """

    z: Float[np.ndarray, "n size"]
    p: Float[np.ndarray, "n P"]
    place: Float[np.ndarray, "n coordinates"]
    plane: Float[np.ndarray, "n d coordinates"]
    length: ItemValues


Metric = tuple[Int[np.ndarray, " d"], Float[np.ndarray, " d"], Float[np.ndarray, " unknowns"]]
"""Free parameters, their scales, and roots of the mass: the embedding, as kernels take it."""


def _metric(fabric: Fabric) -> Metric:
    setting = fabric.setting
    return np.asarray(setting.free), np.asarray(setting.scales), np.sqrt(setting.structure.mass)


def _guess(fabric: Fabric, target: Places) -> _Guess:
    store, ends, d, metric = fabric.vertices, target.ends, fabric.dimension, _metric(fabric)
    flat = np.empty((len(ends), 2, d))
    if target.mark == 0:
        lean_edges(store.place, store.rows, ends, flat)
    else:
        chord = np.subtract(*(store.place[ends[:, side]] for side in (1, 0)))
        for side in range(2):
            flat[:, side] = fabric.end(ends, side, target.mark).along(chord)
    held = np.isin(np.arange(d), held_parameters(target.mark, d))
    count, width = len(ends), store.rows.shape[2]
    found = _Guess(
        np.empty((count, store.z.shape[1])),
        np.empty((count, store.p.shape[1])),
        np.empty((count, width)),
        np.empty((count, d, width)),
        np.empty(count),
    )
    out = found.z, found.p, found.place, found.plane, found.length
    known = store.z, store.p, store.place, store.frame, store.rows
    bend_edges(known, metric, ends, target.t, held, flat, out)
    return found


def _beside_sides(fabric: Fabric, target: Places, least: float) -> Tried:
    """Vertices on edges that the set bulges over a side of the box from, and for which edges.

    They keep the parameter that the side holds, which must be off it by more than `least`,
    relative to the edge.
    """
    setting, store, d, mark = fabric.setting, fabric.vertices, fabric.dimension, target.mark
    guess = _guess(fabric, target)
    z, p, place, plane = guess.z, guess.p, guess.place, guess.plane
    first = fabric.end(target.ends, 0, mark)
    freely = on_curves(fabric, mark, z, p, place, plane, guess.length, first)
    found = np.zeros(len(z), bool)
    for k in range(d):
        free = freely.p[:, setting.free[k]]
        beyond = (free < fabric.box[0, k]) | (free > fabric.box[1, k])
        a, b = store.p[target.ends, setting.free[k]].T
        there = a + target.t * (b - a)
        room = np.abs(there[:, None] - fabric.box[:, k]).min(axis=1) / setting.scales[k]
        own = np.flatnonzero(freely.found & beyond & (room > least * guess.length) & ~found)
        if len(own) == 0:
            continue
        near_z, near_p = z[own], p[own].copy()
        near_p[:, setting.free[k]] = there[own]
        end = first.take(own)
        row = plane[own][:, :, plane.shape[2] - d + k]
        end = replace(end, slopes=np.concatenate([end.slopes, row[:, None]], axis=1))
        place[own] = embed(setting, near_z, near_p)
        given = near_z, near_p, place[own], plane[own], guess.length[own]
        pinned = on_curves(fabric, mark | FacetMark.SIDE << 2 * k, *given, end)
        z[own], p[own], found[own] = pinned.z, pinned.p, pinned.found
    return _accept(fabric, target, Pinned(z, p, found), guess)


def _accept(fabric: Fabric, target: Places, at: Corrected | Pinned, guess: _Guess) -> Tried:
    """Those vertices on edges that are close to where they were looked for, and of the index."""
    lowest, mark = target.lowest, target.mark
    found = _are_close(fabric, target, at, guess)
    if isinstance(at, Corrected):
        found &= at.index == lowest
        return found, free_vertices(fabric.setting, at if found.all() else at.take(found))
    if mark & FacetMark.CROSSING:
        lowest = fabric.vertices.index[target.ends].max(axis=1)
    found = of_index(fabric, mark, at, found, lowest)
    vertices = vertices_at(fabric, mark, at, found, lowest, guess.plane)
    way = np.subtract(*(fabric.vertices.place[target.ends[:, side]] for side in (1, 0)))
    good = _along(replace(fabric, vertices=vertices), mark, way[found])
    found[found] = good
    return found, vertices if good.all() else vertices.take(np.flatnonzero(good))


def _are_close(fabric: Fabric, target: Places, at: Corrected | Pinned, guess: _Guess) -> ItemFlags:
    """Which points lie close to their places, between the ends of their edges and in the box.

    And, where tangent spaces are known, whether the edges lead along these.
    """
    store, free = fabric.vertices, at.p[:, fabric.setting.free]
    inside = (free >= fabric.box[0] - IN_BOX) & (free <= fabric.box[1] + IN_BOX)
    found = at.found & inside.all(axis=1)
    none = np.zeros((len(found), 0, 0))
    told = at.z, at.p, at.frames if isinstance(at, Corrected) else none
    edges, near = (_metric(fabric), target.ends, target.t), (guess.place, guess.length)
    check_edges(store.place, *edges, near, (REACH, EXCESS, ALONG), told, found)
    return np.asarray(found)


def _orthogonally(fabric: Fabric, target: Places, *, rough: bool) -> Tried:
    """Vertices corrected orthogonally to the mean of the tangent spaces at both ends of edges."""
    guess, mark = _guess(fabric, target), target.mark
    near = guess.z, guess.p, guess.place, guess.plane, guess.length
    at: Corrected | Pinned
    if mark == 0 and rough:
        at = correct_between(fabric.setting, *near)
    else:
        at = on_curves(fabric, mark, *near, fabric.end(target.ends, 0, mark))
    return _accept(fabric, target, at, guess)


def on_curves(
    fabric: Fabric,
    mark: int,
    z: Float[np.ndarray, "n size"],
    p: Float[np.ndarray, "n P"],
    place: Float[np.ndarray, "n coordinates"],
    plane: Float[np.ndarray, "n d coordinates"],
    length: ItemValues,
    end: Ends,
) -> Pinned:
    """Points on folds, constraints, crossings or sides of the box near places with planes."""
    setting, d = fabric.setting, fabric.dimension
    inside = replace(end, rows=plane).allowed
    rows = np.swapaxes(inside, 1, 2) @ plane
    span = np.delete(np.eye(d), held_parameters(mark, d), axis=0)
    aim = Aim(
        setting,
        bool(mark & FacetMark.FOLD),
        bool(mark & FacetMark.CAP),
        np.tile(span, (len(place), 1, 1)),
        place,
        rows,
        bool(mark & FacetMark.CROSSING),
        plane if len(span) == d else None,
    )
    return correct_points(aim, z, p, length)


def of_index(fabric: Fabric, mark: int, at: Pinned, found: ItemFlags, lowest: Items) -> ItemFlags:
    """Which points, of those that were found, have the right index."""
    good = found.copy()
    structure = fabric.setting.structure
    singular = bool(mark & (FacetMark.FOLD | FacetMark.CROSSING))
    count = partial(lower_index, structure) if singular else structure.index
    good[found] = count(at.z[found], at.p[found]) == lowest[found]
    return good


def vertices_at(
    fabric: Fabric,
    mark: int,
    at: Pinned,
    found: ItemFlags,
    index: Items,
    plane: Float[np.ndarray, "n d coordinates"],
) -> Vertices:
    """Vertices on folds and so on where they were found."""
    fold, cap, crossing = (
        bool(mark & each) for each in (FacetMark.FOLD, FacetMark.CAP, FacetMark.CROSSING)
    )
    kind = {
        (False, False): VertexKind.REFINED,
        (True, False): VertexKind.FOLD,
        (False, True): VertexKind.CAP,
        (True, True): VertexKind.CORNER,
    }
    kinds = np.full(found.sum(), VertexKind.CROSSING if crossing else kind[fold, cap])
    rows, nowhere = np.ascontiguousarray(plane[found]), np.full(found.sum(), -1)
    known = at.z[found], at.p[found], kinds, index[found], nowhere
    return vertices_of(fabric.setting, *known, rows)


def _along(fabric: Fabric, mark: int, chords: Float[np.ndarray, "n coordinates"]) -> ItemFlags:
    """Whether edges lead along the set, as seen at their new vertices, which are all there are.

    A point on another fold nearby sees its edge at a large angle.
    """
    own = np.tile(np.arange(len(chords))[:, None], (1, 2))
    flat = fabric.end(own, 0, mark).nearest(chords)
    return np.asarray(np.linalg.norm(flat, axis=1) >= ALONG * np.linalg.norm(chords, axis=1))
