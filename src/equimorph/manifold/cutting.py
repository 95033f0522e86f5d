"""Cut polygons along folds into pieces of one index, and pieces into triangles."""

from collections.abc import Callable, Sequence

import numpy as np
from jaxtyping import Bool, Float, Int

Piece = tuple[int, ...]
Chord = tuple[int, int]


def match_folds(
    polygon: Sequence[int], is_fold: Callable[[int], bool], index: Callable[[int], int]
) -> list[list[Chord]]:
    """All ways to join the folds of a polygon by chords that do not cross and part the indices.

    Returned are sets of chords for which every piece has one index; exactly one means that the
    folds are joined without doubt, none that the polygon contradicts itself.
    """
    start = next((k for k, point in enumerate(polygon) if is_fold(point)), None)
    if start is None:
        same = len({index(point) for point in polygon}) == 1
        return [[]] if same else []
    turned = [*polygon[start:], *polygon[:start]]
    folds: list[int] = []
    arcs: list[int | None] = []
    for point in turned:
        if is_fold(point):
            folds.append(point)
            arcs.append(None)
        elif arcs[-1] is None or arcs[-1] == index(point):
            arcs[-1] = index(point)
        else:
            return []
    if len(folds) % 2 or any(arc is None for arc in arcs):
        return []
    found = {frozenset(chords) for chords in _matchings(folds, [arc or 0 for arc in arcs])}
    return [sorted(chords) for chords in sorted(found, key=sorted)]


def _matchings(folds: list[int], arcs: list[int]) -> list[list[Chord]]:
    """Chords for folds in a circle; arcs[k] is the index between folds k and k + 1.

    A set of chords that do not cross always joins two neighbours; the arc between them becomes a
    piece, and the arcs on both sides merge, so that they must have the same index.
    """
    if len(folds) == 2:
        low, high = sorted(folds)
        return [[(low, high)]] if arcs[0] != arcs[1] else []
    found: list[list[Chord]] = []
    count = len(folds)
    for k in range(count):
        after, before = (k + 1) % count, (k - 1) % count
        if arcs[before] != arcs[after] or arcs[k] == arcs[after]:
            continue
        keep = [i for i in range(count) if i not in {k, after}]
        # fold `before` is now followed by the merged arc; the arcs of k and of `after` are gone
        rest_folds, rest_arcs = [folds[i] for i in keep], [arcs[i] for i in keep]
        low, high = sorted((folds[k], folds[after]))
        found.extend([(low, high), *rest] for rest in _matchings(rest_folds, rest_arcs))
    return found


def cut(polygon: Sequence[int], chords: Sequence[Chord], middle: dict[Chord, int]) -> list[Piece]:
    """Pieces of a polygon between chords; `middle` holds extra points on some chords."""
    pieces = [tuple(polygon)]
    for chord in chords:
        for number, piece in enumerate(pieces):
            if chord[0] in piece and chord[1] in piece:
                i, j = sorted((piece.index(chord[0]), piece.index(chord[1])))
                extra = (middle[chord],) if chord in middle else ()
                inside, outside = piece[i : j + 1], (*piece[j:], *piece[: i + 1])
                # from the end of each part back to its beginning runs the chord
                pieces[number] = (*inside, *extra)
                pieces.append((*outside, *extra))
                break
    return pieces


def triangulate(
    corners: Piece,
    sides: Sequence[frozenset[int]],
    place: Float[np.ndarray, "corners dims"],
) -> list[tuple[int, int, int]] | None:
    """Triangles of a piece, with the least sum of squared diagonals; None if there is no way.

    `sides` tells on which sides of the grid triangle each corner lies: a diagonal between corners
    on one side could coincide with one of the neighbour's.
    """
    count = len(corners)
    if count == 3:
        return [(corners[0], corners[1], corners[2])]
    gap = ((place[:, None] - place[None]) ** 2).sum(axis=2)
    diagonal = np.where(_allowed(sides), gap, np.inf)
    around = np.arange(count)
    # the polygon's own sides cost nothing
    diagonal[around, around - 1] = diagonal[around - 1, around] = 0.0
    apex = _cheapest_apexes(diagonal)
    return None if apex is None else [_named(corners, triple) for triple in _fan_out(apex)]


def can_be_triangulated(sides: Sequence[frozenset[int]]) -> bool:
    """Whether corners that lie on these sides of the grid triangle have enough diagonals."""
    if len(sides) <= 3:
        return len(sides) == 3
    places = np.zeros((len(sides), 1))
    return triangulate(tuple(range(len(sides))), sides, places) is not None


def _allowed(sides: Sequence[frozenset[int]]) -> Bool[np.ndarray, "corners corners"]:
    return np.array([[not (a & b) for b in sides] for a in sides])


def _cheapest_apexes(
    diagonal: Float[np.ndarray, "corners corners"],
) -> Int[np.ndarray, "corners corners"] | None:
    """Corner k that completes the triangle on each chord (i, j), by dynamic programming.

    ``cost(i, j) = diagonal(i, j) + min_k (cost(i, k) + cost(k, j))``, i < k < j.
    """
    count = len(diagonal)
    cost = np.full((count, count), np.inf)
    apex = np.full((count, count), -1)
    cost[np.arange(count - 1), np.arange(1, count)] = 0.0
    for width in range(2, count):
        for i in range(count - width):
            j = i + width
            ways = cost[i, i + 1 : j] + cost[i + 1 : j, j]
            best = int(ways.argmin())
            cost[i, j], apex[i, j] = ways[best] + diagonal[i, j], i + 1 + best
    return apex if np.isfinite(cost[0, count - 1]) else None


def _fan_out(apex: Int[np.ndarray, "corners corners"]) -> list[tuple[int, int, int]]:
    """Places of the triangles' corners, from the triangle on the last side inwards."""
    triangles, todo = [], [(0, len(apex) - 1)]
    while todo:
        i, j = todo.pop()
        if j - i >= 2:
            k = int(apex[i, j])
            triangles.append((i, k, j))
            todo += [(i, k), (k, j)]
    return triangles


def _named(corners: Piece, places: tuple[int, int, int]) -> tuple[int, int, int]:
    i, k, j = places
    return corners[i], corners[k], corners[j]
