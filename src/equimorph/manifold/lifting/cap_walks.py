"""Where a constraint acts, followed through grid triangles, from its points on their sides.

On the set a constraint acts along a curve, which passes folds and leads from an end of one open
chain to that of another, or of the same. Where two constraints take turns it has a kink: there it
goes on along the other one, to the side on which that one is the larger, or the smaller one of two.

See docs/decisions.md, "Constraints are followed where several chains end on them".
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import groupby, pairwise
from operator import itemgetter

import numpy as np

from equimorph.arrays import Bool, Items
from equimorph.manifold.geometry.exact_points import Aim, correct_points
from equimorph.manifold.geometry.points import VertexKind
from equimorph.manifold.geometry.setting import Setting, embed
from equimorph.manifold.geometry.simplices import shares_in
from equimorph.manifold.geometry.tangents import (
    cap_slopes,
    frames_in_embedding,
    split_step,
    tangent_frames,
)
from equimorph.manifold.lifting.courses import on_sides
from equimorph.manifold.lifting.fold_walks import nearest_at, points_over
from equimorph.manifold.lifting.pairing import CapExit, Pairing
from equimorph.manifold.lifting.polygon_cuts import planes
from equimorph.manifold.lifting.polygons import Polygon
from equimorph.manifold.lifting.walks import Walk, directions, tangent_rows

STEPS = 120
"""Steps that are tried, at most: one without kinks takes some 10, and each kink as many again."""
KINK = 1e-3
"""Length of a step in the embedding below which one that fails has met a kink."""
PAST = 8.0
"""Length of the first step behind a kink, in that of the last one before it; longer where the
constraint that acts behind takes over farther along itself."""
ASIDE = 4.0
"""How far from a kink slopes are taken, before it and behind, in lengths of the step that is not
taken yet: one of two lengths met it. Differences across it mean nothing."""
BENT = 0.02
"""Sine of the angle of a kink from which on it is one."""


def cap_exits(pairing: Pairing, pairs: Sequence[tuple[int, int]]) -> list[CapExit | None]:
    """Where constraints leave grid triangles, given as pairs of these and of points on their sides.

    None where that is not known. What was found is kept: triangles that are bisected have other
    corners.
    """
    if not pairs:
        return []
    corners = pairing.mesh.triangles[[triangle for triangle, _ in pairs]].tolist()
    keys = [(*own, cap) for own, (_, cap) in zip(corners, pairs, strict=True)]
    known = pairing.cap_exits
    new = {key: pair for key, pair in zip(keys, pairs, strict=True) if key not in known}
    if new:
        known.update(zip(new, _follow(pairing, *np.array(list(new.values())).T), strict=True))
    return [known[key] for key in keys]


def cap_at(pairing: Pairing, exit_: CapExit) -> int:
    """Number of the known point at which a constraint leaves a triangle, −1 if there is none."""
    return nearest_at(pairing, [exit_], points_over(pairing, exit_.edge, VertexKind.CAP))[0]


def _follow(pairing: Pairing, triangle: Items, cap: Items) -> list[CapExit | None]:
    """Follow constraints from points on sides of grid triangles to where they leave these."""
    setting, store, mesh = pairing.setting, pairing.points, pairing.mesh
    corners, z, p = mesh.vertices[mesh.triangles[triangle]], store.z[cap], store.p[cap]
    index = store.index[cap]
    walk = Walk.start_from(setting, corners, z, p, index, VertexKind.CAP)
    left, edge = np.ones(len(cap), bool), np.full(len(cap), -1)
    ways = [[each] for each in zip(z, p, index.tolist(), strict=True)]
    for _ in range(STEPS):
        lanes = np.flatnonzero(left)
        if len(lanes) == 0:
            break
        before = walk.take(lanes)
        own, apex = before.step(setting)
        moved = np.flatnonzero((own.z != before.z).any(axis=1) | (own.p != before.p).any(axis=1))
        there = setting.structure.index(own.z[moved], own.p[moved])
        for k, each in zip(moved.tolist(), there.tolist(), strict=True):
            ways[lanes[k]].append((own.z[k], own.p[k], each))
        walk = walk.with_rows(lanes, _past_kinks(setting, own, apex < 0))
        out = np.flatnonzero(apex >= 0)
        shares = shares_in(corners[lanes[out]], own.p[out][:, setting.free])
        edge[lanes[out]] = on_sides(mesh, triangle[lanes[out]], apex[out], shares)[0]
        left[lanes[out]] = False
    return [
        CapExit(int(edge[k]), walk.z[k], walk.p[k], way) if edge[k] >= 0 else None
        for k, way in enumerate(ways)
    ]


def _past_kinks(setting: Setting, walk: Walk, inside: Bool[np.ndarray, " n"]) -> Walk:
    """Turn those walks that are stuck at kinks, along the constraint that acts behind."""
    lanes = np.flatnonzero(inside & (walk.length < KINK))
    if len(lanes) == 0:
        return walk
    stuck = walk.take(lanes)
    frames = tangent_frames(setting, stuck.z, stuck.p, stuck.rows)
    dz, dp = split_step(setting, ASIDE * stuck.length[:, None] * stuck.tangent)
    here = cap_slopes(setting, stuck.z - dz, stuck.p - dp, frames)
    there = cap_slopes(setting, stuck.z + dz, stuck.p + dp, frames)
    along = directions(setting, stuck.corners, frames, there)
    falls = (along * here).sum(axis=1)
    rows = frames_in_embedding(setting, frames)
    ahead = (np.einsum("nkc,nc->nk", rows, tangent_rows(setting, stuck.tangent)) * there).sum(
        axis=1
    )
    tangent = np.einsum("nk,nkf->nf", along, frames)
    # the other one acts once the first has fallen by as much as the other rises up to the kink
    farther = np.maximum(np.abs(ahead) / np.maximum(np.abs(falls), 1e-300), 1.0)
    turned = replace(stuck, tangent=tangent, length=PAST * farther * stuck.length)
    bent = np.abs(falls) > BENT * np.linalg.norm(here, axis=1)
    return walk.with_rows(lanes, turned.where(bent, stuck))


@dataclass
class Linked:
    """Polygons that chains of a triangle form along constraints, and what leads out of it.

    polygons: None if some end leads nowhere; astray: triangle and end, three times, where it leads
    to a point that is not known; apart: whether no end is known to lead to another chain.
    """

    polygons: list[Polygon] | None
    astray: list[tuple[int, int, int, int]]
    apart: bool


def link(pairing: Pairing, chains: Mapping[int, Sequence[Polygon]]) -> dict[int, Linked]:
    """Join the open chains over each triangle where constraints lead from end to end."""
    pairs = [
        (triangle, end)
        for triangle, own in chains.items()
        for chain in own
        for end in (chain.points[0], chain.points[-1])
    ]
    exits = dict(zip(pairs, cap_exits(pairing, pairs), strict=True))
    return {triangle: _linked(pairing, own, exits) for triangle, own in chains.items()}


def _linked(
    pairing: Pairing,
    chains: Sequence[Polygon],
    exits: Mapping[tuple[int, int], CapExit | None],
) -> Linked:
    """Join the chains of one triangle."""
    triangle = chains[0].triangle
    partner: dict[int, int] = {}
    astray = []
    ends = [end for chain in chains for end in (chain.points[0], chain.points[-1])]
    for end in ends:
        exit_ = exits[triangle, end]
        if exit_ is not None:
            partner[end] = cap_at(pairing, exit_)
            if partner[end] < 0:
                astray.append((triangle, end, end, end))
    # a way that was lost from one end may be known from the other
    partner = {other: end for end, other in partner.items() if other >= 0} | partner
    mutual = all(partner.get(other) == end for end, other in partner.items())
    if not mutual or partner.keys() != set(ends):
        own = {end: other for chain in chains for end, other in _both_ways(chain)}
        return Linked(None, astray, not astray and partner.items() <= own.items())
    return Linked(list(_cycles(chains, partner)), [], False)


def _both_ways(chain: Polygon) -> tuple[tuple[int, int], tuple[int, int]]:
    first, last = chain.points[0], chain.points[-1]
    return (first, last), (last, first)


def _cycles(chains: Sequence[Polygon], partner: Mapping[int, int]) -> Iterator[Polygon]:
    """Polygons of chains whose ends are partners."""
    by_end = {chain.points[0]: chain.points for chain in chains}
    by_end |= {chain.points[-1]: chain.points[::-1] for chain in chains}
    while by_end:
        start, points, gaps = next(iter(by_end)), list[int](), list[int]()
        while start in by_end:
            own = by_end.pop(start)
            del by_end[own[-1]]
            gaps.append(len(points))
            points.extend(own)
            start = partner[own[-1]]
        yield Polygon(chains[0].triangle, tuple(points), True, tuple(gaps[1:]))


def turns_of(exit_: CapExit) -> int:
    """Number of folds that a constraint passes on its way."""
    return sum(one[2] != other[2] for one, other in pairwise(exit_.way))


def passed_on_the_way(pairing: Pairing, triangle: int, exit_: CapExit) -> tuple[int, ...] | None:
    """Add corners that a constraint passes, with points between them; the innermost without any.

    Their numbers; None if a corner was not found.
    """
    setting, store = pairing.setting, pairing.points
    parts = [list(own) for _, own in groupby(exit_.way, key=itemgetter(2))]
    if len(parts) == 1:
        inner = parts[0][1:-1]
        if not inner:
            return None
        corners = pairing.mesh.vertices[pairing.mesh.triangles[triangle]]
        places = np.array([p[setting.free] for _, p, _ in inner])
        depth = shares_in(np.tile(corners, (len(inner), 1, 1)), places).min(axis=1)
        return (store.add(*inner[int(depth.argmax())], VertexKind.CAP),)
    span, points = planes(pairing, [triangle]), list[int]()
    for number, (one, other) in enumerate(pairwise(parts)):
        if number:
            points.append(store.add(*one[len(one) // 2], VertexKind.CAP))
        (z, p, low), (to_z, to_p, high) = one[-1], other[0]
        guess = 0.5 * (z + to_z)[None], 0.5 * (p + to_p)[None]
        middle = embed(setting, *guess)
        around = np.linalg.norm(embed(setting, z[None], p[None]) - middle, axis=1)
        aim = Aim(setting, True, True, span, middle, middle[:, None][:, :0])
        found = correct_points(aim, *guess, around, np.array([min(low, high)]))
        if not found.found[0]:
            return None
        points.append(store.add(found.z[0], found.p[0], min(low, high), VertexKind.CORNER))
    return tuple(points)
