"""Tetrahedra over a mesh that is bisected in a few places: what stays is not found once more.

A disc over a grid triangle depends on the points over its corners and on the curves along its
sides; a ball over a grid tetrahedron on the discs over its faces.
"""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float, Int

from equimorph.manifold.assembly import Discs, assemble
from equimorph.manifold.balls import Balls, fill
from equimorph.manifold.pairing import Pairing
from equimorph.manifold.polygons import find_loops
from equimorph.manifold.topology import flags_of

Rows = Int[np.ndarray, "n k"]


@dataclass(frozen=True)
class Volumes:
    """Discs that are not plain triangles, and balls, with what they depend on.

    doubtful: triangles of `discs`, and tetrahedra of `balls`, that need division.
    """

    triangles: Int[np.ndarray, "T 3"]
    tetrahedra: Int[np.ndarray, "N 4"]
    faces: Int[np.ndarray, "N 4"]
    around: Float[np.ndarray, "T 6"]
    discs: Discs
    balls: Balls


def volumes_over(pairing: Pairing, known: Volumes | None) -> Volumes:
    """Balls over all grid tetrahedra; those that are known stay where nothing changed."""
    mesh, around = pairing.mesh, _around(pairing)
    same = np.zeros(len(mesh.triangles), bool)
    if known is not None:
        count = len(known.triangles)
        same[:count] = (mesh.triangles[:count] == known.triangles).all(axis=1)
        same[:count] &= (around[:count] == known.around).all(axis=1)
        same[known.discs.doubtful] = False
    loops = find_loops(pairing, ~same)
    discs = assemble(pairing, loops)
    plain = np.arange(len(loops.plain))
    discs = discs if known is None else _with_discs(discs, known.discs, same)
    same[discs.doubtful] = False
    kept = np.zeros(len(mesh.tetrahedra), bool)
    if known is not None:
        count = len(known.tetrahedra)
        kept[:count] = (mesh.tetrahedra[:count] == known.tetrahedra).all(axis=1)
        kept[:count] &= (mesh.faces[:count] == known.faces).all(axis=1)
        kept &= same[mesh.faces].all(axis=1)
        kept[known.balls.doubtful] = False
    balls = fill(pairing, discs, ~kept)
    balls = balls if known is None else _with_balls(balls, known.balls, kept)
    special = replace(
        discs,
        corners=np.delete(discs.corners, plain, axis=0),
        index=np.delete(discs.index, plain),
        owner=np.delete(discs.owner, plain),
    )
    return Volumes(mesh.triangles, mesh.tetrahedra, mesh.faces, around, special, balls)


def _around(pairing: Pairing) -> Float[np.ndarray, "T 6"]:
    """What tells whether something changed around each triangle: its curves and its points."""
    mesh, points, curves = pairing.mesh, pairing.points, pairing.curves
    live = np.unique(pairing.rays[: points.count])
    live = live[live >= 0]
    edge = np.array(curves.edge, int)[live]
    # sums of irrational shares differ for different sets of curves
    share = np.modf((live + 1) * np.sqrt(2.0))[0]
    of_edge = np.bincount(edge, share, len(mesh.edges))
    vertex = points.vertex[: points.count]
    of_vertex = np.bincount(vertex[vertex >= 0], minlength=len(mesh.vertices))
    return np.concatenate([of_edge[mesh.sides], of_vertex[mesh.triangles]], axis=1)


def _with_discs(new: Discs, known: Discs, same: Bool[np.ndarray, " T"]) -> Discs:
    """New discs, and known ones over triangles that are the same."""
    kept = same[known.owner]
    corners = known.corners[kept]
    return replace(
        new,
        corners=np.concatenate([new.corners, corners]),
        index=np.concatenate([new.index, known.index[kept]]),
        owner=np.concatenate([new.owner, known.owner[kept]]),
        folds=_joined(new.folds, known.folds, corners),
        caps=_joined(new.caps, known.caps, corners),
        crossings=_joined(new.crossings, known.crossings, corners),
    )


def _with_balls(new: Balls, known: Balls, kept: Bool[np.ndarray, " N"]) -> Balls:
    """New balls, and known ones over tetrahedra that are the same."""
    old = kept[known.owner]
    corners = known.corners[old]
    return replace(
        new,
        corners=np.concatenate([new.corners, corners]),
        index=np.concatenate([new.index, known.index[old]]),
        owner=np.concatenate([new.owner, known.owner[old]]),
        folds=_joined(new.folds, known.folds, corners),
        caps=_joined(new.caps, known.caps, corners),
    )


def _joined(new: Rows, known: Rows, corners: Rows) -> Rows:
    """New facets, and those known ones that belong to some cells."""
    size = corners.shape[1]
    facets = np.concatenate([np.delete(corners, k, axis=1) for k in range(size)])
    kept = known[flags_of(known, facets)] if len(known) else known
    return np.unique(np.sort(np.concatenate([new, kept]), axis=1), axis=0)
