"""Cut polygons along folds and crossings into pieces, and pieces into triangles.

See docs/decisions.md, "Folds and constraints are built into the cells".
"""

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, field
from functools import cache, lru_cache
from itertools import chain, combinations, product

import numpy as np

from equimorph.arrays import Bool, Float, Int
from equimorph.manifold.geometry.points import VertexKind
from equimorph.manifold.geometry.simplices import plane_bases
from equimorph.manifold.lifting.pairing import Pairing
from equimorph.manifold.lifting.polygons import Polygon

Piece = tuple[int, ...]
Chord = tuple[int, int]

MOST_FOLDS = 16
"""Folds of a polygon of which it is not known with which others they belong together, at most: 16
can be joined in 1430 ways, each two more in 3.4 times as many."""
REGULAR, TURN, MEETING = 0, 1, 2
"""What the points of polygons are."""
SORTS = MEETING, TURN
"""Of points that are joined by chords."""
OVERTURNED = 1e6
"""What an overturned grid triangle costs, in longest squared diagonals: more than any of these."""


def match_folds(
    polygon: Sequence[int],
    singular: Callable[[int], int],
    index: Callable[[int], int],
    joined: Collection[Chord] = (),
) -> list[list[Chord]]:
    """All ways to join the folds of a polygon by chords that do not cross and part the indices.

    With the chords `joined`, which are known.

    Returned are sets of chords for which every piece has one index; exactly one means that the
    folds are joined with certainty, none that the polygon contradicts itself. `singular` gives the
    kind of each point: `REGULAR`, a `TURN` (fold), or a `MEETING` with another sheet. Meetings are
    joined with each other, and may part equal indices.
    """
    start = next((k for k, point in enumerate(polygon) if singular(point)), None)
    if start is None:
        same = len({index(point) for point in polygon}) == 1
        return [[]] if same else []
    turned = [*polygon[start:], *polygon[:start]]
    folds: list[int] = []
    arcs: list[int | None] = []
    for point in turned:
        if singular(point):
            folds.append(point)
            arcs.append(None)
        elif arcs[-1] is None or arcs[-1] == index(point):
            arcs[-1] = index(point)
        else:
            return []
    free = set(folds).difference(*joined)
    if len(folds) % 2 or len(free) > MOST_FOLDS or any(arc is None for arc in arcs):
        return []
    kinds = {point: singular(point) for point in folds}
    ways = _matchings(folds, [arc or 0 for arc in arcs], kinds, joined)
    return sorted(sorted(way) for way in ways)


def _matchings(
    folds: list[int], arcs: list[int], kinds: dict[int, int], joined: Collection[Chord]
) -> list[list[Chord]]:
    """Chords for folds in a circle; arcs[k] is the index between folds k and k + 1.

    The first of some folds side by side is joined with another one; what lies inside this chord
    and what lies behind it are matched separately, each arc of a piece with the same index.
    """
    own = {end: chord for chord in joined for end in chord}

    def fits(a: int, b: int, inside: int, outside: int) -> bool:
        known = all(own.get(end, (a, b)) == (a, b) for end in (a, b))
        return known and kinds[a] == kinds[b] and (kinds[a] == MEETING or inside != outside)

    @cache
    def ways(first: int, end: int, outside: int) -> list[list[Chord]]:
        if first == end:
            return [[]]
        inside, found = arcs[first], list[list[Chord]]()
        for k in range(first + 1, end, 2):
            one, other = sorted((folds[first], folds[k]))
            if arcs[k - 1] == inside and arcs[k] == outside and fits(one, other, inside, outside):
                within, behind = ways(first + 1, k, inside), ways(k + 1, end, outside)
                found += [[(one, other), *a, *b] for a in within for b in behind]
        return found

    return ways(0, len(folds), arcs[-1])


def match_around_hub(
    polygon: Sequence[int], singular: Callable[[int], int], index: Callable[[int], int]
) -> list[list[Chord]]:
    """All ways to join folds where one of them crosses the chord of a crossing: they meet in a hub.

    The polygon is parted at the ends of the two chords that cross, and each part, which reaches as
    far as the hub, is joined by itself. The index differs on both sides of the fold. See
    `match_folds`.
    """
    found: list[list[Chord]] = []
    at = {sort: [k for k, each in enumerate(polygon) if singular(each) == sort] for sort in SORTS}
    for ends, turns in product(*(list(combinations(at[sort], 2)) for sort in SORTS)):
        order = sorted((*ends, *turns))
        if (order[0] in ends) == (order[2] in ends) != (order[1] in ends) == (order[3] in ends):
            doubled = [*polygon, *polygon]
            stops = [*order[1:], order[0] + len(polygon)]
            parts = [doubled[a + 1 : b] for a, b in zip(order, stops, strict=True)]
            own = [match_folds(part, singular, index) for part in parts]
            if all(own) and _are_parted(parts, [order[0] in turns, order[1] in turns], index):
                chords = [chord_of(polygon[a], polygon[b]) for a, b in (ends, turns)]
                found += [sorted([*chords, *chain(*way)]) for way in product(*own)]
    return sorted(found)


def _are_parted(
    parts: Sequence[Sequence[int]], turns: Sequence[bool], index: Callable[[int], int]
) -> bool:
    """Whether the index of parts around a hub changes where they begin with a fold."""
    own = [index(part[0]) for part in parts]
    return all(own[k] != own[k - 1] for k in range(len(parts)) if turns[k % 2])


def crossed_chords(plan: "Plan") -> tuple[Chord, Chord] | None:
    """Chord of a crossing and that of the fold that crosses it, if there are such."""
    place = {point: k for k, point in enumerate(plan.points)}
    by_sort: list[list[Chord]] = [
        [chord for chord in plan.chords if plan.singular(chord[0]) == sort] for sort in SORTS
    ]
    for met, fold in product(*by_sort):
        low, high = sorted(place[end] for end in met)
        if sum(low < place[end] < high for end in fold) == 1:
            return met, fold
    return None


def between(chord: Chord, middle: dict[Chord, int]) -> tuple[int, ...]:
    """Extra points on a chord, from its first end to its second.

    `middle` holds one for some pairs of points, which may be an end and another extra point.
    """
    point = middle.get(chord_of(*chord))
    if point is None:
        return ()
    before, behind = between((chord[0], point), middle), between((point, chord[1]), middle)
    return *before, point, *behind


def cut(polygon: Sequence[int], chords: Sequence[Chord], middle: dict[Chord, int]) -> list[Piece]:
    """Pieces of a polygon between chords, with the points `between` their ends."""
    pieces = [tuple(polygon)]
    for chord in chords:
        for number, piece in enumerate(pieces):
            if chord[0] in piece and chord[1] in piece:
                i, j = sorted((piece.index(chord[0]), piece.index(chord[1])))
                extra = between((piece[i], piece[j]), middle)
                inside, outside = piece[i : j + 1], (*piece[j:], *piece[: i + 1])
                # from the end of each part back to its beginning runs the chord
                pieces[number] = (*inside, *extra[::-1])
                pieces.append((*outside, *extra))
                break
    return pieces


def triangulate(
    places: Float[np.ndarray, "pieces corners dims"],
    sides: Int[np.ndarray, "pieces corners"],
    flat: Float[np.ndarray, "pieces corners 2"] | None = None,
) -> tuple[Int[np.ndarray, "pieces triangles 3"], Bool[np.ndarray, " pieces"]]:
    """Triangles of pieces with equally many corners, with the least sum of squared diagonals.

    Returned are the places of the triangles' corners in their piece, and which pieces can be
    triangulated. `sides` flags, one bit each, on which sides of the grid triangle a corner lies: a
    diagonal between corners on one side could coincide with one of the neighbour's. `flat`: places
    in the plane of the grid triangle, for pieces with corners inside it, over which as little as
    can be is overturned.
    """
    count = places.shape[1]
    gap = ((places[:, :, None] - places[:, None]) ** 2).sum(axis=3)
    diagonal = np.where((sides[:, :, None] & sides[:, None]) == 0, gap, np.inf)
    around = np.arange(count)
    # sides of the polygon cost nothing
    diagonal[:, around, around - 1] = diagonal[:, around - 1, around] = 0.0
    overturned = None if flat is None else OVERTURNED * gap.max() * _overturned(flat)
    apex, cost = _cheapest_apexes(diagonal, overturned)
    return _fan_out(apex), np.isfinite(cost)


def _overturned(
    flat: Float[np.ndarray, "pieces corners 2"],
) -> Float[np.ndarray, "pieces corners corners corners"]:
    """Areas of the triangles of any three corners that lie the other way round than their piece."""
    x, y = np.moveaxis(flat, 2, 0)
    twice = x[:, :, None] * y[:, None] - x[:, None] * y[:, :, None]
    whole = np.trace(np.roll(twice, -1, axis=2), axis1=1, axis2=2)
    area = twice[:, :, :, None] + twice[:, None] + np.swapaxes(twice, 1, 2)[:, :, None]
    return np.asarray(np.maximum(-0.5 * area * np.sign(whole)[:, None, None, None], 0.0))


@lru_cache(maxsize=4096)
def chords_to_split(sides: tuple[int, ...], chords: tuple[Chord, ...]) -> tuple[Chord, ...]:
    """Chords between ends on one grid edge, and further ones until all pieces have triangles.

    Where a corner of the grid triangle sees two fold curves cross both its sides, one of them with
    a cusp, the sheet between them lies over the corner twice, and has no allowed diagonal. `sides`
    are those of the grid triangle on which each corner of the polygon lies, one bit each.
    """
    chosen = [chord for chord in chords if sides[chord[0]] & sides[chord[1]]]
    for chord in chords:
        stand_in = {split: -1 - number for number, split in enumerate(chosen)}
        pieces = cut(range(len(sides)), chords, stand_in)
        if all(
            has_triangulation(tuple(sides[at] if at >= 0 else 0 for at in piece))
            for piece in pieces
        ):
            break
        if chord not in chosen:
            chosen.append(chord)
    return tuple(chosen)


@lru_cache(maxsize=4096)
def has_triangulation(sides: tuple[int, ...]) -> bool:
    """Whether corners that lie on these sides of the grid triangle have enough diagonals."""
    if len(sides) <= 3:
        return len(sides) == 3
    return bool(triangulate(np.zeros((1, len(sides), 1)), np.array([sides]))[1][0])


def _cheapest_apexes(
    diagonal: Float[np.ndarray, "pieces corners corners"],
    overturned: Float[np.ndarray, "pieces corners corners corners"] | None = None,
) -> tuple[Int[np.ndarray, "pieces corners corners"], Float[np.ndarray, " pieces"]]:
    """Corner k that completes the triangle on each chord (i, j), by dynamic programming.

    ``cost(i, j) = diagonal(i, j) + min_k (cost(i, k) + cost(k, j) + overturned(i, k, j))``, i < k <
    j.
    """
    pieces, count, _ = diagonal.shape
    cost, apex = np.full(diagonal.shape, np.inf), np.full(diagonal.shape, -1)
    cost[:, np.arange(count - 1), np.arange(1, count)] = 0.0
    own = np.arange(pieces)
    for width in range(2, count):
        for i in range(count - width):
            j = i + width
            ways = cost[:, i, i + 1 : j] + cost[:, i + 1 : j, j]
            if overturned is not None:
                ways += overturned[:, i, i + 1 : j, j]
            best = ways.argmin(axis=1)
            cost[:, i, j] = ways[own, best] + diagonal[:, i, j]
            apex[:, i, j] = i + 1 + best
    return apex, cost[:, 0, count - 1]


def _fan_out(
    apex: Int[np.ndarray, "pieces corners corners"],
) -> Int[np.ndarray, "pieces triangles 3"]:
    """Places of the triangles' corners, from the triangle on the last side inwards."""
    pieces, count, _ = apex.shape
    own = np.arange(pieces)
    triangles = np.empty((pieces, count - 2, 3), int)
    # chords that wait for their triangle: never more than there are triangles
    waiting = np.zeros((pieces, count, 2), int)
    waiting[:, 0, 1] = count - 1
    waiting_for = np.ones(pieces, int)
    for number in range(count - 2):
        waiting_for -= 1
        i, j = waiting[own, waiting_for].T
        k = apex[own, i, j]
        triangles[:, number] = np.stack([i, k, j], axis=1)
        for first, last in ((i, k), (k, j)):
            wide = last - first >= 2
            waiting[own[wide], waiting_for[wide]] = np.stack([first, last], axis=1)[wide]
            waiting_for += wide
    return triangles


SINGULAR: dict[int, int] = {
    VertexKind.FOLD: TURN,
    VertexKind.CORNER: TURN,
    VertexKind.CROSSING: MEETING,
}
"""What points of some kinds are to `cutting`; those of all other kinds are regular."""


@dataclass
class Plan:
    """How a polygon will be cut: its points and chords, once extra points are found.

    sides: of the grid triangle, on which each point lies, one bit each; extra points inside it lie
    on none. kinds: of the points, as in `Points`. sheet: number of the polygon.
    """

    polygon: Polygon
    points: list[int]
    sides: dict[int, int]
    kinds: dict[int, int]
    chords: list[Chord] = field(default_factory=list)
    middle: dict[Chord, int] = field(default_factory=dict)
    sheet: int = 0

    def singular(self, point: int) -> int:
        """Return what a point of the polygon is to `cutting`."""
        return SINGULAR.get(self.kinds[point], REGULAR)

    def those(self, singular: int) -> list[int]:
        """Singular points of a sort."""
        return [point for point in self.points if self.singular(point) == singular]

    def insert(self, place: int, points: Sequence[int], kinds: Sequence[int]) -> None:
        """Lead the side that ends at a place through extra points."""
        self.points[place:place] = points
        self.kinds.update(zip(points, kinds, strict=True))

    def on(self, points: Sequence[int]) -> list[int]:
        """Sides on which points lie; all points of a chord with others on it count as on one."""
        sides = dict(self.sides)
        for k, chord in enumerate(each for each in self.chords if each in self.middle):
            for point in (*chord, *between(chord, self.middle)):
                sides[point] = sides.get(point, 0) | 8 << k
        return [sides.get(point, 0) for point in points]


def chord_of(a: int, b: int) -> Chord:
    """Chord between two points, in either order."""
    return (a, b) if a < b else (b, a)


def planes(pairing: Pairing, triangles: list[int]) -> Float[np.ndarray, "n 2 d"]:
    """Orthonormal bases of the planes of grid triangles, in scaled parameters."""
    mesh = pairing.mesh
    return plane_bases(mesh.vertices[mesh.triangles[triangles]] / pairing.setting.scales)
