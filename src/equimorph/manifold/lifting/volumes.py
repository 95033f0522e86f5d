"""Tetrahedra over a mesh that is bisected in a few places: what stays is not found once more.

A disc over a grid triangle depends on the points over its corners and on the curves along its
sides; a ball over a grid tetrahedron on the discs over its faces.
"""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float, Int

from equimorph.manifold.lifting.balls import Balls, fill
from equimorph.manifold.lifting.discs import Discs, assemble
from equimorph.manifold.lifting.loops import find_loops
from equimorph.manifold.lifting.pairing import Pairing


@dataclass(frozen=True)
class Volumes:
    """Discs and balls, with what they depend on.

    doubtful: triangles of `discs`, and tetrahedra of `balls`, that need division. What discs say of
    folds and constraints is not kept: balls say it of their facets.
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
    discs = assemble(pairing, find_loops(pairing, ~same))
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
    return Volumes(mesh.triangles, mesh.tetrahedra, mesh.faces, around, discs, balls)


def _around(pairing: Pairing) -> Float[np.ndarray, "T 6"]:
    """What tells whether something changed around each triangle: its curves and its points."""
    mesh, points, curves = pairing.mesh, pairing.points, pairing.curves
    rays = pairing.rays[: points.count]
    in_use = np.zeros(len(curves.edge), bool)
    in_use[rays[rays >= 0]] = True
    live = np.flatnonzero(in_use)
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
    return replace(
        new,
        corners=np.concatenate([new.corners, known.corners[kept]]),
        index=np.concatenate([new.index, known.index[kept]]),
        owner=np.concatenate([new.owner, known.owner[kept]]),
        met=np.concatenate([new.met, known.met[kept]]),
        sheet=np.concatenate([new.sheet, known.sheet[kept]]),
    )


def _with_balls(new: Balls, known: Balls, kept: Bool[np.ndarray, " N"]) -> Balls:
    """New balls, and known ones over tetrahedra that are the same."""

    def joined(name: str, owner: str) -> Int[np.ndarray, "..."]:
        own = kept[getattr(known, owner)]
        return np.concatenate([getattr(new, name), getattr(known, name)[own]])

    return replace(
        new,
        **{name: joined(name, "owner") for name in ("corners", "index", "owner")},
        **{name: joined(name, "fold_owner") for name in ("folds", "fold_owner")},
        **{name: joined(name, "cap_owner") for name in ("caps", "cap_owner")},
        **{name: joined(name, "crossing_owner") for name in ("crossings", "crossing_owner")},
    )
