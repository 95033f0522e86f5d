"""Folds followed through grid triangles, from points on their sides to where they leave.

See docs/decisions.md, "Folds are followed through their triangles" and "Strips between a fold and a
constraint are led along".
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from equimorph.arrays import Items, Some
from equimorph.manifold.geometry.exact_points import Aim, Pinned, correct_points
from equimorph.manifold.geometry.points import VertexKind
from equimorph.manifold.geometry.setting import embed
from equimorph.manifold.geometry.simplices import plane_bases, shares_in
from equimorph.manifold.lifting.courses import on_sides
from equimorph.manifold.lifting.pairing import CapExit, FoldExit, Pairing
from equimorph.manifold.lifting.walks import Walk
from equimorph.model import are_feasible, worst_excess

NOISE = 1e-6
"""Distance in the metric below which two folds are one."""
STEPS = 80
"""Steps that are tried, at most: a fold that is nearly straight takes one."""
PARTS = 0.0, -0.25, 0.25
"""Places where corners are looked for: parts of the way, off where a constraint would be met if it
changed evenly."""


def fold_exits(pairing: Pairing, pairs: Sequence[tuple[int, int]]) -> list[FoldExit | None]:
    """Where folds leave grid triangles, given as pairs of both; None where that is not known.

    A fold that violates a constraint where it would leave ends in a corner inside, over no edge.
    What was found is kept: triangles that are bisected have other corners.
    """
    if not pairs:
        return []
    corners = pairing.mesh.triangles[[triangle for triangle, _ in pairs]].tolist()
    keys = [(*own, fold) for own, (_, fold) in zip(corners, pairs, strict=True)]
    new = {key: pair for key, pair in zip(keys, pairs, strict=True) if key not in pairing.exits}
    if new:
        pairing.exits.update(
            zip(new, _follow(pairing, *np.array(list(new.values())).T), strict=True)
        )
    return [pairing.exits[key] for key in keys]


def _follow(pairing: Pairing, triangle: Items, fold: Items) -> list[FoldExit | None]:
    """Follow folds from points on sides of grid triangles to where they leave these."""
    setting, store, mesh = pairing.setting, pairing.points, pairing.mesh
    corners = mesh.vertices[mesh.triangles[triangle]]
    first = store.z[fold], store.p[fold], store.index[fold]
    walk = Walk.start_from(setting, corners, *first, VertexKind.FOLD)
    left, edge = np.ones(len(fold), bool), np.full(len(fold), -1)
    inside_z, inside_p, depth = walk.z.copy(), walk.p.copy(), np.zeros(len(fold))
    for _ in range(STEPS):
        lanes = np.flatnonzero(left)
        if len(lanes) == 0:
            break
        own, apex = walk.take(lanes).step(replace(setting, constraints=()))
        walk = walk.with_rows(lanes, own)
        there = np.flatnonzero(apex >= 0)
        shares = shares_in(own.corners, own.p[:, setting.free])
        deeper = (apex < 0) & (shares.min(axis=1) > depth[lanes])
        known = lanes[deeper]
        inside_z[known], inside_p[known] = own.z[deeper], own.p[deeper]
        depth[known] = shares[deeper].min(axis=1)
        edge[lanes[there]] = on_sides(
            pairing.mesh, triangle[lanes[there]], apex[there], shares[there]
        )[0]
        left[lanes[(apex >= 0) | (own.length == 0.0)]] = False  # on a side, none moves any more
    found, out = edge >= 0, np.zeros(len(edge), bool)
    out[found] = ~are_feasible(setting.constraints, walk.z[found], walk.p[found])
    lanes = np.flatnonzero(out)
    corner = _corners(pairing, walk.take(lanes), fold[lanes])
    walk.z[lanes], walk.p[lanes], edge[lanes] = corner.z, corner.p, -1
    found[lanes] = corner.found
    return [
        FoldExit(
            int(edge[k]), walk.z[k], walk.p[k], (inside_z[k], inside_p[k]) if depth[k] else None
        )
        if good
        else None
        for k, good in enumerate(found.tolist())
    ]


def _corners(pairing: Pairing, walk: Walk, fold: Items) -> Pinned:
    """Corners in which folds meet a constraint before they leave triangles."""
    setting, store = pairing.setting, pairing.points
    start = store.z[fold], store.p[fold]
    low, high = (worst_excess(setting.constraints, *at) for at in (start, (walk.z, walk.p)))
    with np.errstate(invalid="ignore"):
        met = np.nan_to_num(np.clip(low / (low - high), 0.0, 1.0), nan=0.5)
    span = plane_bases(walk.corners / setting.scales)
    around = np.linalg.norm(embed(setting, walk.z, walk.p) - embed(setting, *start), axis=1)
    best = Pinned(walk.z.copy(), walk.p.copy(), np.zeros(len(fold), bool))
    for part in PARTS:
        lanes = np.flatnonzero(~best.found)
        if len(lanes) == 0:
            break
        share = np.clip(met + part, 0.0, 1.0)[lanes, None]
        z, p = (
            a[lanes] + share * (b[lanes] - a[lanes])
            for a, b in zip(start, (walk.z, walk.p), strict=True)
        )
        middle = embed(setting, z, p)
        aim = Aim(setting, True, True, span[lanes], middle, middle[:, None][:, :0])
        best = best.with_rows(lanes, correct_points(aim, z, p, around[lanes], walk.low[lanes]))
    return best


def fold_at(pairing: Pairing, exit_: FoldExit) -> int:
    """Number of the known fold where a fold leaves a triangle, −1 if there is none."""
    return nearest_at(pairing, [exit_], points_over(pairing, exit_.edge, VertexKind.FOLD))[0]


def points_over(pairing: Pairing, edge: int, kind: VertexKind) -> Items:
    """Points of a kind on the curves and arcs over an edge; not those of curves taken back."""
    curves = pairing.curves
    live = [each for each in np.flatnonzero(curves.edge == edge).tolist() if pairing.alive(each)]
    lines = [*(curves.inner.get(each, ()) for each in live), *pairing.arcs.get(edge, ())]
    own = np.array([point for line in lines for point in line], int)
    return np.asarray(own[pairing.points.kind[own] == kind])


def nearest_at(pairing: Pairing, exits: Sequence[FoldExit | CapExit], points: Some) -> list[int]:
    """Those of some points at which curves leave a triangle or end there, −1 if there is none."""
    if len(exits) == 0 or len(points) == 0:
        return [-1] * len(exits)
    store, setting = pairing.points, pairing.setting
    place = embed(setting, store.z[points], store.p[points])
    z, p = np.stack([each.z for each in exits]), np.stack([each.p for each in exits])
    there = embed(setting, z, p)
    gap = np.linalg.norm(place - there[:, None], axis=2)
    return list(np.where((gap < NOISE).any(axis=1), points[gap.argmin(axis=1)], -1).tolist())
