"""Connected surfaces that the discs over the faces of each grid tetrahedron form."""

from dataclasses import dataclass

import numpy as np

from equimorph.arrays import Bool, Int, Items, Pairs, Triples
from equimorph.manifold.complex.base_mesh import BaseMesh
from equimorph.manifold.geometry.facet_kernels import join_triangles
from equimorph.manifold.geometry.topology import labels, runs
from equimorph.manifold.lifting.discs import Discs


@dataclass(frozen=True)
class Surfaces:
    """Triangles of surfaces over grid tetrahedra, closed or open along loops at a constraint.

    corners, index, surface: of the triangles, those of one surface in a row; met: which of their
    sides ab, bc, ca lie where another sheet crosses; owner: grid tetrahedron of each surface;
    sides, rim, side_index: open sides, with their loop and the adjacent index; rim_surface: of the
    loops.
    """

    corners: Triples
    index: Items
    surface: Items
    met: Bool[np.ndarray, "n 3"]
    owner: Int[np.ndarray, " S"]
    sides: Int[np.ndarray, "r 2"]
    rim: Int[np.ndarray, " r"]
    side_index: Int[np.ndarray, " r"]
    rim_surface: Int[np.ndarray, " rims"]


@dataclass(frozen=True)
class Spheres:
    """Spheres that are tetrahedra of one index, general ones, and undecided grid tetrahedra."""

    plain: Int[np.ndarray, "P 4"]
    plain_index: Int[np.ndarray, " P"]
    plain_owner: Int[np.ndarray, " P"]
    others: Surfaces
    doubtful: Int[np.ndarray, " k"]


@dataclass(frozen=True)
class Rings:
    """Closed curves that edges form, group by group.

    label: curve of each edge; amount: of curves of each group; closed: groups in which two edges
    meet at every point.
    """

    label: Items
    amount: Int[np.ndarray, " groups"]
    closed: Bool[np.ndarray, " groups"]


@dataclass(frozen=True)
class _Copies:
    """Triangles of discs as seen from the grid tetrahedra, sorted by the pieces that they form."""

    corners: Triples
    index: Items
    owner: Items
    met: Bool[np.ndarray, "n 3"]
    shares: Triples
    """How many triangles of the same tetrahedron share sides ab, bc, ca; of the same sheet, where
    another crosses."""
    starts: Int[np.ndarray, " pieces"]
    sizes: Int[np.ndarray, " pieces"]


def find_spheres(mesh: BaseMesh, discs: Discs, wanted: Bool[np.ndarray, " N"]) -> Spheres:
    """Join the discs around flagged grid tetrahedra without undecided triangles."""
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
    others, doubtful = _surfaces(copies, plain)
    return Spheres(
        points[four, :, 0],
        copies.index[starts[candidates[four]]],
        copies.owner[starts[candidates[four]]],
        others,
        doubtful,
    )


def _surfaces(
    copies: _Copies, plain: Bool[np.ndarray, " pieces"]
) -> tuple[Surfaces, Int[np.ndarray, " k"]]:
    """Pieces that are not plain, and the owners of those with unclosed rims or crowded sides."""
    piece = np.repeat(np.arange(len(copies.sizes)), copies.sizes)
    sides = np.stack([copies.corners, np.roll(copies.corners, -1, axis=1)], axis=2)
    open_ = (copies.shares == 1) & ~plain[piece, None]
    row, side = np.nonzero(open_)
    rims = rings(sides[row, side], piece[row], len(plain))
    crowded = np.logical_or.reduceat((copies.shares > 2).any(axis=1), copies.starts)
    bad = ~plain & (crowded | ~rims.closed)
    good = ~plain & ~bad
    number = np.cumsum(good) - 1
    own, kept = good[piece], good[piece[row]]
    _, first, rim = np.unique(rims.label[kept], return_index=True, return_inverse=True)
    surfaces = Surfaces(
        copies.corners[own],
        copies.index[own],
        number[piece[own]],
        copies.met[own],
        copies.owner[copies.starts[good]],
        sides[row[kept], side[kept]],
        rim,
        copies.index[row[kept]],
        number[piece[row[kept]]][first],
    )
    return surfaces, np.unique(copies.owner[copies.starts[bad]])


def rings(edges: Pairs, group: Items, groups: int) -> Rings:
    """Curves of edges that hang together within their group."""
    base = int(edges.max(initial=0)) + 1
    _, ends = np.unique((group[:, None] * base + edges).ravel(), return_inverse=True)
    ends = ends.reshape(-1, 2)
    degree = np.bincount(ends.ravel())
    of_point = labels(len(degree), ends)
    _, first, label = np.unique(of_point[ends[:, 0]], return_index=True, return_inverse=True)
    closed = np.ones(groups, bool)
    closed[group[(degree[ends] != 2).any(axis=1)]] = False
    return Rings(label, np.bincount(group[first], minlength=groups), closed)


def _copies(mesh: BaseMesh, discs: Discs, wanted: Bool[np.ndarray, " N"]) -> _Copies:
    """Every triangle of a disc once for each adjacent flagged grid tetrahedron."""
    amount = np.bincount(discs.owner, minlength=len(mesh.triangles))
    first = np.concatenate([[0], np.cumsum(amount)])
    by_owner = np.argsort(discs.owner, kind="stable")
    unclear = np.zeros(len(mesh.triangles), bool)
    unclear[discs.doubtful] = True
    clear = np.flatnonzero(wanted & ~unclear[mesh.faces].any(axis=1))
    faces = mesh.faces[clear].ravel()
    count = amount[faces]
    triangle = by_owner[runs(first[faces], count)[1]]
    owner = np.repeat(np.repeat(clear, 4), count)
    met = discs.met[triangle]
    shares, piece = _pieces(
        discs.corners[triangle], owner, np.where(met, 1 + discs.sheet[triangle, None], 0)
    )
    order = np.argsort(piece, kind="stable")
    sizes = np.bincount(piece)
    starts = np.cumsum(sizes) - sizes
    corners, index = discs.corners[triangle[order]], discs.index[triangle[order]]
    return _Copies(corners, index, owner[order], met[order], shares[order], starts, sizes)


def _pieces(corners: Triples, owner: Items, sheet: Triples) -> tuple[Triples, Items]:
    """How many triangles share each side within a tetrahedron, and the pieces that they form.

    Sides of different sheets are different. Owners are in order.
    """
    shares, piece = np.empty(corners.shape, int), np.empty(len(owner), int)
    join_triangles(*map(np.ascontiguousarray, (corners, sheet, owner)), shares, piece)
    return shares, piece
