"""Sheet lifting, part three: polygons become triangles of a conforming complex."""

from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float, Int

from equimorph.manifold.cutting import (
    Chord,
    Piece,
    can_be_triangulated,
    cut,
    match_folds,
    triangulate,
)
from equimorph.manifold.normals import existence_normals
from equimorph.manifold.pairing import Pairing
from equimorph.manifold.pins import pin
from equimorph.manifold.points import CAP, CORNER, FOLD
from equimorph.manifold.polygons import Loops, Polygon, edges_at

SAME_SIDE = 0.3
"""Least cosine between the sides of two folds that can belong to one fold curve in a triangle."""


@dataclass
class Cells:
    """Triangles of points with their index, and the sides that lie on folds or constraints."""

    corners: list[tuple[int, int, int]] = field(default_factory=list)
    index: list[int] = field(default_factory=list)
    folds: set[Chord] = field(default_factory=set)
    caps: set[Chord] = field(default_factory=set)
    undecided: list[int] = field(default_factory=list)
    """Grid triangles whose polygons could not be cut without doubt."""


@dataclass
class _Plan:
    """How a polygon will be cut: its points and chords, once extra points are found."""

    polygon: Polygon
    points: list[int]
    sides: dict[int, frozenset[int]]
    """Sides of the grid triangle on which each point lies; extra points inside it lie on none."""
    chords: list[Chord] = field(default_factory=list)
    middle: dict[Chord, int] = field(default_factory=dict)


def assemble(pairing: Pairing, loops: Loops) -> Cells:
    """Triangulate all polygons; plain ones are triangles already."""
    cells = Cells()
    cells.corners = [tuple(row) for row in loops.plain.tolist()]
    cells.index = pairing.points.index[loops.plain[:, 0]].tolist() if len(loops.plain) else []
    plans = [_plan(pairing, polygon) for polygon in loops.polygons]
    _close(pairing, plans, cells)
    plans = [plan for plan in plans if _join_folds(pairing, plan, cells)]
    _split_chords(pairing, plans, cells)
    for plan in plans:
        _fill(pairing, plan, cells)
    return cells


def _plan(pairing: Pairing, polygon: Polygon) -> _Plan:
    at_corner = {
        vertex: frozenset(pair) for vertex, pair in edges_at(pairing, polygon.triangle).items()
    }
    points = np.array(polygon.points)
    vertices, edges = pairing.points.vertex[points].tolist(), pairing.points.edge[points].tolist()
    sides = {
        point: at_corner[vertex] if vertex >= 0 else frozenset([edge])
        for point, vertex, edge in zip(polygon.points, vertices, edges, strict=True)
    }
    return _Plan(polygon, list(polygon.points), sides)


def _same_side(plan: _Plan, chord: Chord) -> bool:
    """Whether two points lie on one side of the grid triangle."""
    first, second = _sides_of(plan, chord)
    return bool(first & second)


def _is_fold(pairing: Pairing, point: int) -> bool:
    return int(pairing.points.kind[point]) in {FOLD, CORNER}


def _close(pairing: Pairing, plans: list[_Plan], cells: Cells) -> None:
    """Close open polygons along the constraint, through a corner if a fold leaves there."""
    wanted: list[tuple[_Plan, int]] = []
    for plan in plans:
        if not plan.polygon.open:
            continue
        first, last = plan.points[0], plan.points[-1]
        odd = sum(_is_fold(pairing, point) for point in plan.points) % 2
        if odd:
            wanted.append((plan, CORNER))
        elif _same_side(plan, (first, last)):
            wanted.append((plan, CAP))
        else:
            cells.caps.add(_chord(first, last))
    pairs = [(plan.points[0], plan.points[-1]) for plan, _ in wanted]
    extra = _pinned(pairing, pairs, [kind for _, kind in wanted])
    for (plan, _), point in zip(wanted, extra, strict=True):
        if point is None:
            cells.undecided.append(plan.polygon.triangle)
            continue
        cells.caps.update({_chord(plan.points[0], point), _chord(plan.points[-1], point)})
        plan.points.append(point)


def _join_folds(pairing: Pairing, plan: _Plan, cells: Cells) -> bool:
    """Decide which folds of the polygon belong together; False if that is not certain."""
    index = pairing.points.index
    ways = match_folds(
        plan.points, lambda point: _is_fold(pairing, point), lambda point: int(index[point])
    )
    if len(ways) > 1:
        ways = _continuous(pairing, ways)
    if len(ways) != 1:
        cells.undecided.append(plan.polygon.triangle)
        return False
    plan.chords = ways[0]
    return True


def _continuous(pairing: Pairing, ways: list[list[Chord]]) -> list[list[Chord]]:
    """Ways in which every chord joins folds whose sheets lie on the same side.

    In the narrow wedge behind a cusp two fold curves run side by side at every scale: there only
    the side on which the sheets exist tells them apart.
    """
    folds = sorted({fold for way in ways for chord in way for fold in chord})
    normals = existence_normals(pairing.setting, pairing.points, np.array(folds))
    normal = dict(zip(folds, normals, strict=True))
    return [way for way in ways if all(normal[a] @ normal[b] > SAME_SIDE for a, b in way)]


def _split_chords(pairing: Pairing, plans: list[_Plan], cells: Cells) -> None:
    """Put an exact fold point on chords that would lie on a grid edge, or block triangulation."""
    wanted = [(plan, chord) for plan in plans for chord in _chords_to_split(plan)]
    extra = _pinned(pairing, [chord for _, chord in wanted], [FOLD] * len(wanted))
    for (plan, chord), point in zip(wanted, extra, strict=True):
        if point is None:
            cells.undecided.append(plan.polygon.triangle)
        else:
            plan.middle[chord] = point


def _chords_to_split(plan: _Plan) -> list[Chord]:
    """Chords between ends on one grid edge, and as many others as free all pieces for triangles.

    Where a corner of the grid triangle sees two fold curves cross both its sides, one of them with
    a cusp, the sheet between them lies over the corner twice, and has no allowed diagonal.
    """
    chosen = [chord for chord in plan.chords if _same_side(plan, chord)]
    for chord in plan.chords:
        stand_in = {split: -1 - number for number, split in enumerate(chosen)}
        pieces = cut(plan.points, plan.chords, stand_in)
        if all(can_be_triangulated(_sides_of(plan, piece)) for piece in pieces):
            break
        if chord not in chosen:
            chosen.append(chord)
    return chosen


def _sides_of(plan: _Plan, piece: Piece) -> list[frozenset[int]]:
    return [plan.sides.get(point, frozenset()) for point in piece]


def _pinned(pairing: Pairing, pairs: list[Chord], kinds: list[int]) -> list[int | None]:
    """Numbers of new exact points between pairs; None where none was found."""
    if not pairs:
        return []
    found = pin(pairing.setting, pairing.points, np.array(pairs), np.array(kinds))
    index = pairing.points.index
    out: list[int | None] = []
    for lane, (pair, kind) in enumerate(zip(pairs, kinds, strict=True)):
        if not found.found[lane]:
            out.append(None)
            continue
        low = int(min(index[pair[0]], index[pair[1]]))
        out.append(pairing.points.add(found.z[lane], found.p[lane], low, kind))
    return out


def _fill(pairing: Pairing, plan: _Plan, cells: Cells) -> None:
    """Cut a polygon and triangulate its pieces."""
    for chord in plan.chords:
        if chord in plan.middle:
            cells.folds.update(_chord(end, plan.middle[chord]) for end in chord)
        else:
            cells.folds.add(chord)
    for piece in cut(plan.points, plan.chords, plan.middle):
        index = {
            int(pairing.points.index[point]) for point in piece if not _is_fold(pairing, point)
        }
        triangles = _triangles(pairing, plan, piece)
        if len(index) != 1 or triangles is None:
            cells.undecided.append(plan.polygon.triangle)
            continue
        cells.corners.extend(triangles)
        cells.index.extend([index.pop()] * len(triangles))


def _triangles(pairing: Pairing, plan: _Plan, piece: Piece) -> list[tuple[int, int, int]] | None:
    if len(piece) <= 3:
        return [(piece[0], piece[1], piece[2])] if len(piece) == 3 else None
    place = embedding(pairing, np.array(piece))
    return triangulate(piece, _sides_of(plan, piece), place)


def embedding(pairing: Pairing, points: Int[np.ndarray, " n"]) -> Float[np.ndarray, "n dims"]:
    """Configuration in the metric and scaled free parameters: Euclidean distances measure."""
    structure, free = pairing.setting.structure, pairing.setting.free
    u = pairing.points.z[points, : structure.unknowns] * np.sqrt(structure.mass)
    x = pairing.points.p[points][:, free] / pairing.setting.scales
    return np.concatenate([u, x], axis=1)


def _chord(a: int, b: int) -> Chord:
    return (a, b) if a < b else (b, a)
