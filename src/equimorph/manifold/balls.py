"""Sheet lifting, part five: discs close into spheres around tetrahedra, filled by coning.

A sphere of four triangles of one index bounds one tetrahedron. Others are coned from an exact point
inside: on the fold surface that parts two indices, on the constraint that cuts the ball off, else
amid all its vertices. Several closed fold curves on a sphere each bound a disc of the fold surface.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Bool, Int

from equimorph.manifold.assembly import Discs
from equimorph.manifold.mesh import SLACK
from equimorph.manifold.pairing import Pairing
from equimorph.manifold.pins import Pinned, pin
from equimorph.manifold.points import AMID, CAP, CORNER, FOLD
from equimorph.manifold.spheres import Sphere, Spheres, find_spheres
from equimorph.manifold.topology import chains

Facet = tuple[int, int, int]
Tetrahedron = tuple[int, int, int, int]


@dataclass(frozen=True)
class Balls:
    """Tetrahedra with their index, and their facets on folds and on constraints.

    owner, fold_owner, cap_owner: grid tetrahedra below them; doubtful: those over which a ball
    could not be closed and cut without doubt.
    """

    corners: Int[np.ndarray, "n 4"]
    index: Int[np.ndarray, " n"]
    owner: Int[np.ndarray, " n"]
    folds: Int[np.ndarray, "f 3"]
    fold_owner: Int[np.ndarray, " f"]
    caps: Int[np.ndarray, "c 3"]
    cap_owner: Int[np.ndarray, " c"]
    doubtful: Int[np.ndarray, " k"]


@dataclass
class _Found:
    """What is known of the balls that are not plain tetrahedra."""

    corners: list[Tetrahedron] = field(default_factory=list)
    index: list[int] = field(default_factory=list)
    owner: list[int] = field(default_factory=list)
    folds: list[Facet] = field(default_factory=list)
    fold_owner: list[int] = field(default_factory=list)
    caps: list[Facet] = field(default_factory=list)
    cap_owner: list[int] = field(default_factory=list)
    doubtful: set[int] = field(default_factory=set)


@dataclass
class _Region:
    """Connected triangles of one index on a sphere, and the fold curves around them."""

    triangles: list[Facet]
    index: int
    curves: list[int]
    apex: int = -1


@dataclass
class _Ball:
    """How a sphere will be filled."""

    owner: int
    cap: int
    """Point on the constraint from which the sphere was closed; −1 if there is none."""
    lid: list[Facet]
    """Triangles on the constraint that close it."""
    regions: list[_Region]
    curves: list[list[int]]
    """Points along closed fold curves, each once."""
    middles: list[int]
    """Fold point inside each curve."""


def fill(pairing: Pairing, discs: Discs, wanted: Bool[np.ndarray, " N"]) -> Balls:
    """Fill all spheres over wanted grid tetrahedra."""
    spheres = find_spheres(pairing.mesh, discs, wanted)
    found = _Found(doubtful=set(spheres.doubtful.tolist()))
    balls = []
    for sphere, cap in zip(spheres.others, _caps(pairing, spheres, found), strict=True):
        if sphere.owner in found.doubtful:
            continue
        ball = _regions(sphere, cap)
        if ball is None:
            found.doubtful.add(sphere.owner)
        else:
            balls.append(ball)
    _pin_folds(pairing, balls, found)
    _pin_amid(pairing, balls, found)
    for ball in balls:
        if ball.owner not in found.doubtful:
            _cone(ball, found)
    return Balls(
        np.concatenate([spheres.plain, np.array(found.corners, int).reshape(-1, 4)]),
        np.concatenate([spheres.plain_index, np.array(found.index, int)]),
        np.concatenate([spheres.plain_owner, np.array(found.owner, int)]),
        np.array(found.folds, int).reshape(-1, 3),
        np.array(found.fold_owner, int),
        np.array(found.caps, int).reshape(-1, 3),
        np.array(found.cap_owner, int),
        np.array(sorted(found.doubtful), int),
    )


def _caps(pairing: Pairing, spheres: Spheres, found: _Found) -> list[int]:
    """Points on the constraint from which open spheres are closed; −1 where none is needed.

    A rim of three points can be closed by their triangle.
    """
    caps = [-1] * len(spheres.others)
    groups: dict[int, list[tuple[int, list[int]]]] = {CAP: [], CORNER: []}
    for k, sphere in enumerate(spheres.others):
        ends = [p for p in sphere.rim if int(pairing.points.kind[p]) == CORNER]
        if len(ends) == 2:
            # the fold runs from corner to corner, maybe far from the middle of the rim
            groups[CORNER].append((k, ends))
        elif ends:
            found.doubtful.add(sphere.owner)
        elif sphere.rim and len(sphere.triangles) > 3:
            groups[CAP].append((k, sphere.rim))
    for kind, wanted in groups.items():
        points = _pinned(pairing, [group for _, group in wanted], kind)
        for (k, _), point in zip(wanted, points, strict=True):
            caps[k] = point
            if point < 0 and (kind == CORNER or len(spheres.others[k].rim) > 3):
                found.doubtful.add(spheres.others[k].owner)
    return caps


def _lid(rim: list[int], cap: int) -> list[Facet]:
    """Triangles that close a sphere along its rim."""
    if cap >= 0:
        return [(a, b, cap) for a, b in map(sorted, _links(rim))]
    return [(rim[0], rim[1], rim[2])] if rim else []


def _regions(sphere: Sphere, cap: int) -> _Ball | None:
    """Part a closed sphere along its folds; None if that contradicts itself."""
    lid = _lid(sphere.rim, cap)
    triangles, index = [*sphere.triangles, *lid], list(sphere.index)
    by_edge: dict[frozenset[int], list[int]] = {}
    for number, triangle in enumerate(triangles):
        for pair in _sides(triangle):
            by_edge.setdefault(pair, []).append(number)
    # the lid takes the index of what it closes
    index += [index[by_edge[_sides(facet)[0]][0]] for facet in lid]
    vertices = {point for triangle in triangles for point in triangle}
    if len(vertices) - len(by_edge) + len(triangles) != 2:
        return None
    folded = {pair for pair, (a, b) in by_edge.items() if index[a] != index[b]}
    curves = _closed_curves(folded)
    if curves is None:
        return None
    curve_of = {pair: k for k, curve in enumerate(curves) for pair in _links(curve)}
    regions = _flood(triangles, index, by_edge, curve_of)
    jumps = all(abs(index[a] - index[b]) == 1 for a, b in (by_edge[pair] for pair in folded))
    if len(regions) != len(curves) + 1 or not jumps:
        return None
    return _Ball(sphere.owner, cap, lid, regions, curves, [-1] * len(curves))


def _closed_curves(folded: set[frozenset[int]]) -> list[list[int]] | None:
    pairs = np.array(sorted(sorted(pair) for pair in folded), int).reshape(-1, 2)
    lines = [line.tolist() for line in chains(pairs)]
    closed = all(line[0] == line[-1] for line in lines)
    once = len({point for line in lines for point in line}) == sum(len(k) - 1 for k in lines)
    return [line[:-1] for line in lines] if closed and once else None


def _flood(
    triangles: list[Facet],
    index: list[int],
    by_edge: dict[frozenset[int], list[int]],
    curve_of: dict[frozenset[int], int],
) -> list[_Region]:
    """Connected pieces of the sphere between fold curves."""
    regions, seen = [], [False] * len(triangles)
    for seed in range(len(triangles)):
        if seen[seed]:
            continue
        seen[seed], todo, own, curves = True, [seed], [], set()
        while todo:
            number = todo.pop()
            own.append(triangles[number])
            for pair in _sides(triangles[number]):
                if pair in curve_of:
                    curves.add(curve_of[pair])
                    continue
                for other in by_edge[pair]:
                    if not seen[other]:
                        seen[other] = True
                        todo.append(other)
        regions.append(_Region(own, index[seed], sorted(curves)))
    return regions


def _pin_folds(pairing: Pairing, balls: list[_Ball], found: _Found) -> None:
    """Find a fold point inside every fold curve; it can be the one on the constraint."""
    wanted = []
    for ball in balls:
        for k, curve in enumerate(ball.curves):
            if ball.cap in curve:
                ball.middles[k] = ball.cap
            else:
                wanted.append((ball, k))
    points = _pinned(pairing, [ball.curves[k] for ball, k in wanted], FOLD)
    for (ball, k), point in zip(wanted, points, strict=True):
        ball.middles[k] = point
        if point < 0:
            found.doubtful.add(ball.owner)


def _pin_amid(pairing: Pairing, balls: list[_Ball], found: _Found) -> None:
    """Choose the apex of every region: on a fold, on the constraint, else amid its vertices."""
    wanted = []
    for ball in balls:
        for region in ball.regions:
            if region.curves:
                region.apex = ball.middles[region.curves[0]]
            elif not region.curves and ball.cap >= 0:
                region.apex = ball.cap
            elif len(region.triangles) == 4:
                region.apex = region.triangles[0][0]
            else:
                wanted.append((ball, region))
    groups = [sorted({p for facet in region.triangles for p in facet}) for _, region in wanted]
    points = _pinned(pairing, groups, AMID)
    for (ball, region), point in zip(wanted, points, strict=True):
        region.apex = point
        if point < 0 or pairing.points.index[point] != region.index:
            found.doubtful.add(ball.owner)


def _pinned(pairing: Pairing, groups: Sequence[Sequence[int]], kind: int) -> list[int]:
    """Numbers of new exact points of a kind amid groups; −1 where none was found."""
    out = [-1] * len(groups)
    if not groups:
        return out
    setting, store = pairing.setting, pairing.points
    pinned = _pin_inside(pairing, groups, kind)
    lanes, folded = np.flatnonzero(pinned.found), kind in {FOLD, CORNER}
    index = setting.structure.index(pinned.z[lanes], pinned.p[lanes]).tolist()
    for lane, own in zip(lanes.tolist(), index, strict=True):
        # at folds the count is round-off
        low = int(store.index[list(groups[lane])].min()) if folded else own
        out[lane] = store.add(pinned.z[lane], pinned.p[lane], low, kind)
    return out


def _pin_inside(pairing: Pairing, groups: Sequence[Sequence[int]], kind: int) -> Pinned:
    """Pin points in the box: where one would leave it, the parameter that leaves is held."""
    setting, store = pairing.setting, pairing.points
    axes = np.eye(len(setting.free))
    pinned = pin(setting, store, groups, kind, np.tile(axes, (len(groups), 1, 1)))
    low, high = pairing.mesh.vertices.min(axis=0), pairing.mesh.vertices.max(axis=0)
    for held in range(len(axes)):
        free = pinned.p[:, setting.free]
        outside = np.maximum(low - free, free - high) / (high - low)
        worst = outside.argmax(axis=1) == held
        lanes = np.flatnonzero(worst & (outside[:, held] > SLACK))
        if len(lanes) == 0:
            continue
        span = np.tile(np.delete(axes, held, axis=0), (len(lanes), 1, 1))
        again = pin(setting, store, [groups[lane] for lane in lanes.tolist()], kind, span)
        pinned.z[lanes], pinned.p[lanes], pinned.found[lanes] = again.z, again.p, again.found
    inside = pairing.mesh.covers(pinned.p[:, setting.free])
    return Pinned(pinned.z, pinned.p, pinned.found & inside)


def _cone(ball: _Ball, found: _Found) -> None:
    """Tetrahedra from the apex of each region to its triangles and to the folds around it."""
    fans = [
        [(a, b, middle) for a, b in map(sorted, _links(curve)) if middle not in {a, b}]
        for curve, middle in zip(ball.curves, ball.middles, strict=True)
    ]
    for fan in fans:
        found.folds.extend(fan)
        found.fold_owner.extend([ball.owner] * len(fan))
    found.caps.extend(ball.lid)
    found.cap_owner.extend([ball.owner] * len(ball.lid))
    for region in ball.regions:
        around = [facet for k in region.curves for facet in fans[k]]
        facets = [facet for facet in (*region.triangles, *around) if region.apex not in facet]
        own = [(a, b, c, region.apex) for a, b, c in facets]
        found.corners.extend(own)
        found.index.extend([region.index] * len(own))
        found.owner.extend([ball.owner] * len(own))


def _sides(triangle: Facet) -> tuple[frozenset[int], ...]:
    a, b, c = triangle
    return frozenset((a, b)), frozenset((b, c)), frozenset((c, a))


def _links(curve: list[int]) -> list[frozenset[int]]:
    return [frozenset((curve[k - 1], curve[k])) for k in range(len(curve))]
