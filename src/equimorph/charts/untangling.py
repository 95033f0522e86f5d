"""Triangles that project the wrong way round are flipped with a neighbour."""

import numpy as np
from jaxtyping import Float, Int

from equimorph.manifold.geometry.simplices import volumes
from equimorph.manifold.geometry.topology import adjacency, keys_of, orientation

ROUNDS = 6


def untangled(
    corners: Int[np.ndarray, "C 3"],
    places: Float[np.ndarray, "V 2"],
    fixed: Int[np.ndarray, "n 2"],
) -> Int[np.ndarray, "C 3"]:
    """Triangles with the same vertices, fewer of which overlap their neighbours in the plane.

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
        if len(bad) == 0 or not _flipped(out, places, bad[np.argsort(area[bad])], kept):
            break
    return out


def _flipped(
    corners: Int[np.ndarray, "C 3"],
    places: Float[np.ndarray, "V 2"],
    bad: Int[np.ndarray, " n"],
    kept: set[int],
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
        # what lies around them is known anew in the next round
        keys = _keys(first, base) + _keys(second, base)
        touched |= {beside for key in keys for beside in around.get(key, ())}
        count += 1
    return count


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
        before = volumes(places[corners[[cell, others[0]]]]).min()
        after = volumes(places[np.array(new)]).min()
        if after > before and (best is None or after > best[0]):
            best = (after, others[0], *new)
    return None if best is None else best[1:]
