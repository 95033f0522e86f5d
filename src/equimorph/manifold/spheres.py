"""Connected surfaces that the discs over the faces of each grid tetrahedron form."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Int
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from equimorph.manifold.assembly import Discs
from equimorph.manifold.mesh import BaseMesh
from equimorph.manifold.topology import chains, keys_of


@dataclass(frozen=True)
class Sphere:
    """Triangles of a closed surface over one grid tetrahedron, or of one open at a constraint.

    rim: points along the open edge, in order; empty for closed ones.
    """

    owner: int
    triangles: list[tuple[int, int, int]]
    index: list[int]
    rim: list[int]


@dataclass(frozen=True)
class Spheres:
    """Spheres that are tetrahedra of one index, others, and grid tetrahedra that need division."""

    plain: Int[np.ndarray, "P 4"]
    plain_index: Int[np.ndarray, " P"]
    plain_owner: Int[np.ndarray, " P"]
    others: list[Sphere]
    doubtful: Int[np.ndarray, " k"]


@dataclass(frozen=True)
class _Copies:
    """Triangles of discs as seen from the grid tetrahedra, sorted by the pieces that they form."""

    corners: Int[np.ndarray, "n 3"]
    index: Int[np.ndarray, " n"]
    owner: Int[np.ndarray, " n"]
    shares: Int[np.ndarray, "n 3"]
    """How many triangles of the same tetrahedron share sides ab, bc, ca."""
    starts: Int[np.ndarray, " pieces"]
    sizes: Int[np.ndarray, " pieces"]


def find_spheres(mesh: BaseMesh, discs: Discs, wanted: Bool[np.ndarray, " N"]) -> Spheres:
    """Join the discs around wanted grid tetrahedra but those beside doubtful triangles."""
    copies = _copies(mesh, discs, wanted)
    starts, sizes = copies.starts, copies.sizes
    lowest, highest = (f.reduceat(copies.index, starts) for f in (np.minimum, np.maximum))
    closed = np.logical_and.reduceat((copies.shares == 2).all(axis=1), starts)
    candidates = np.flatnonzero(closed & (sizes == 4) & (lowest == highest))
    rows = starts[candidates, None] + np.arange(4)
    points = np.sort(copies.corners[rows].reshape(-1, 12), axis=1).reshape(-1, 4, 3)
    four = (points == points[:, :, :1]).all(axis=(1, 2))
    plain = np.zeros(len(starts), bool)
    plain[candidates[four]] = True
    others, doubtful = [], []
    for piece in np.flatnonzero(~plain).tolist():
        sphere = _sphere(copies, slice(starts[piece], starts[piece] + sizes[piece]))
        if sphere is None:
            doubtful.append(int(copies.owner[starts[piece]]))
        else:
            others.append(sphere)
    return Spheres(
        points[four, :, 0],
        copies.index[starts[candidates[four]]],
        copies.owner[starts[candidates[four]]],
        others,
        np.array(sorted(set(doubtful)), int),
    )


def _copies(mesh: BaseMesh, discs: Discs, wanted: Bool[np.ndarray, " N"]) -> _Copies:
    """Every triangle of a disc once for each wanted grid tetrahedron beside it."""
    amount = np.bincount(discs.owner, minlength=len(mesh.triangles))
    first = np.concatenate([[0], np.cumsum(amount)])
    by_owner = np.argsort(discs.owner, kind="stable")
    unclear = np.zeros(len(mesh.triangles), bool)
    unclear[discs.doubtful] = True
    clear = np.flatnonzero(wanted & ~unclear[mesh.faces].any(axis=1))
    faces = mesh.faces[clear].ravel()
    count = amount[faces]
    offset = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count)
    triangle = by_owner[np.repeat(first[faces], count) + offset]
    owner = np.repeat(np.repeat(clear, 4), count)
    shares, piece = _pieces(discs.corners[triangle], owner)
    order = np.argsort(piece, kind="stable")
    sizes = np.bincount(piece)
    starts = np.cumsum(sizes) - sizes
    corners, index = discs.corners[triangle[order]], discs.index[triangle[order]]
    return _Copies(corners, index, owner[order], shares[order], starts, sizes)


def _pieces(
    corners: Int[np.ndarray, "n 3"], owner: Int[np.ndarray, " n"]
) -> tuple[Int[np.ndarray, "n 3"], Int[np.ndarray, " n"]]:
    """How many triangles share each side within a tetrahedron, and the pieces that they form."""
    base = int(corners.max(initial=0)) + 1
    keys = np.stack([keys_of(corners[:, [k, (k + 1) % 3]], base) for k in range(3)], axis=1)
    _, edges = np.unique(keys.ravel(), return_inverse=True)
    local = np.repeat(owner, 3) * (edges.max(initial=0) + 1) + edges.ravel()
    _, inverse, counts = np.unique(local, return_inverse=True, return_counts=True)
    order = np.argsort(inverse, kind="stable")
    same = np.flatnonzero(inverse[order[1:]] == inverse[order[:-1]])
    a, b = order[same] // 3, order[same + 1] // 3
    graph = coo_array((np.ones(len(a)), (a, b)), shape=(len(owner), len(owner)))
    _, piece = connected_components(graph, directed=False)
    return counts[inverse].reshape(-1, 3), piece


def _sphere(copies: _Copies, own: slice) -> Sphere | None:
    """One piece, if it is closed, or open along one loop."""
    corners, shares = copies.corners[own], copies.shares[own]
    if shares.max() > 2:
        return None
    sides = np.stack([corners, np.roll(corners, -1, axis=1)], axis=2)
    loops = [line.tolist() for line in chains(sides[shares == 1])]
    if len(loops) > 1 or any(line[0] != line[-1] for line in loops):
        return None
    triangles = [(int(a), int(b), int(c)) for a, b, c in corners]
    rim = loops[0][:-1] if loops else []
    return Sphere(int(copies.owner[own][0]), triangles, copies.index[own].tolist(), rim)
