"""Folds followed through grid triangles, from points on their sides to where they leave.

In the plane of a triangle a fold is a curve on the set. Steps along its tangent are halved until
their corrections are short and both tangents alike; the last one ends on the side itself.

See docs/decisions.md, "Folds are followed through their triangles" and "Strips between a fold and a
constraint are led along".
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from equimorph.arrays import Float, Items, Lanes, Parameters, Some, Values
from equimorph.columns import Columns
from equimorph.manifold.geometry.exact_points import Aim, Pinned, correct_points
from equimorph.manifold.geometry.points import VertexKind
from equimorph.manifold.geometry.setting import Setting, embed
from equimorph.manifold.geometry.simplices import plane_bases, shares_in
from equimorph.manifold.geometry.tangents import (
    fold_forms,
    fold_slopes,
    frames_in_embedding,
    split_step,
    tangent_frames,
)
from equimorph.manifold.lifting.courses import on_sides
from equimorph.manifold.lifting.pairing import FoldExit, Pairing
from equimorph.model import are_feasible, worst_excess
from equimorph.structures.metric import metric_coordinates

NOISE = 1e-6
"""Distance in the metric below which two folds are one."""
STEPS = 40
"""Steps that are tried, at most: a fold that is nearly straight takes one."""
CORRECTIONS = 10
"""Of a guess of a step, at most: those that are close enough, see `OFF`, need fewer. Of 4800 lanes
of set 923 of the soak 2000 used up 60, which took half of its time."""
PARTS = 0.0, -0.25, 0.25
"""Places where corners are looked for: parts of the way, off where a constraint would be met if it
changed evenly."""
OFF, STRAIGHT = 0.25, 0.9
"""Longest correction of a step, in its length, and least cosine of the tangents at its ends."""
BEYOND = 1e-9
"""Barycentric coordinate up to which folds end beyond the ends of a side."""


def fold_exits(pairing: Pairing, pairs: Sequence[tuple[int, int]]) -> list[FoldExit | None]:
    """Where folds leave grid triangles, given as pairs of both; None where that is not known.

    A fold that violates a constraint where it would leave ends in a corner inside, over no edge.
    What was found is kept: triangles that are bisected have other corners.
    """
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
    setting = pairing.setting
    walk = _Walk.start_from(pairing, triangle, fold)
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


def _corners(pairing: Pairing, walk: "_Walk", fold: Items) -> Pinned:
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
    store = pairing.points
    own = store.edge[: store.count] == exit_.edge
    folds = np.flatnonzero(own & (store.kind[: store.count] == VertexKind.FOLD))
    return nearest_at(pairing, [exit_], folds)[0]


def nearest_at(pairing: Pairing, exits: Sequence[FoldExit], points: Some) -> list[int]:
    """Those of some points at which folds leave a triangle or end there, −1 if there is none."""
    if len(exits) == 0 or len(points) == 0:
        return [-1] * len(exits)
    store, setting = pairing.points, pairing.setting
    place = embed(setting, store.z[points], store.p[points])
    z, p = np.stack([each.z for each in exits]), np.stack([each.p for each in exits])
    there = embed(setting, z, p)
    gap = np.linalg.norm(place - there[:, None], axis=2)
    return list(np.where((gap < NOISE).any(axis=1), points[gap.argmin(axis=1)], -1).tolist())


@dataclass(frozen=True)
class _Walk(Columns):
    """Points of folds in triangles.

    tangent: of unit length in the embedding, with changes of z and of the scaled free parameters;
    length: of the next step, at most; start: number of the corner opposite the side of the first
    point, −1 later; low: index on the lower side.
    """

    corners: Float[np.ndarray, "n 3 d"]
    z: Lanes
    p: Parameters
    tangent: Float[np.ndarray, "n full"]
    length: Values
    start: Items
    low: Items

    @classmethod
    def start_from(cls, pairing: Pairing, triangle: Items, fold: Items) -> "_Walk":
        """First points, with tangents that lead into the triangles."""
        setting, mesh, store = pairing.setting, pairing.mesh, pairing.points
        corners, z, p = mesh.vertices[mesh.triangles[triangle]], store.z[fold], store.p[fold]
        tangent = _tangents(setting, corners, z, p)
        side = shares_in(corners, p[:, setting.free]).argmin(axis=1)
        walk = cls(corners, z, p, tangent, np.full(len(z), np.inf), side, store.index[fold])
        inwards = np.take_along_axis(walk.rates(setting), side[:, None], axis=1)
        return replace(walk, tangent=tangent * np.copysign(1.0, inwards))

    def rates(self, setting: Setting) -> Float[np.ndarray, "n 3"]:
        """Changes of the barycentric coordinates along the tangents."""
        along = self.tangent[:, -len(setting.free) :] * setting.scales
        there = shares_in(self.corners, self.corners[:, 0] + along)
        return np.asarray(there - np.array([1.0, 0.0, 0.0]))

    def step(self, setting: Setting) -> tuple["_Walk", Items]:
        """Points after one step, or the same ones with a shorter step; corners opposite the sides.

        −1 where no side was reached.
        """
        way, apex = self._ways_out(setting)
        leaves = way <= self.length
        length = np.minimum(way, self.length)
        dz, dp = split_step(setting, length[:, None] * self.tangent)
        guess = replace(self, z=self.z + dz, p=self.p + dp)
        there = Pinned(guess.z, guess.p, np.zeros(len(way), bool))
        if len(stay := np.flatnonzero(~leaves)):
            there = there.with_rows(stay, guess.take(stay).inside(setting, length[stay]))
        if len(out := np.flatnonzero(leaves)):
            there = there.with_rows(out, guess.take(out).on_side(setting, length[out], apex[out]))
        known = there.found[:, None]
        there = replace(
            there, z=np.where(known, there.z, self.z), p=np.where(known, there.p, self.p)
        )
        tangent = _tangents(setting, self.corners, there.z, there.p)
        cosine = (_rows(setting, tangent) * _rows(setting, self.tangent)).sum(axis=1)
        off = np.linalg.norm(
            embed(setting, there.z, there.p) - embed(setting, guess.z, guess.p), axis=1
        )
        good = there.found & (off < OFF * length) & (np.abs(cosine) > STRAIGHT)
        moved = replace(
            self, z=there.z, p=there.p, tangent=tangent * np.copysign(1.0, cosine)[:, None],
            length=2.0 * length, start=np.full(len(self.z), -1),
        )  # fmt: skip
        waiting = replace(self, length=0.5 * length)
        return moved.where(good, waiting), np.where(good & leaves, apex, -1)

    def _ways_out(self, setting: Setting) -> tuple[Values, Items]:
        """Lengths of the straight ways out of the triangles, and corners opposite the sides."""
        rates = self.rates(setting)
        shares = np.maximum(shares_in(self.corners, self.p[:, setting.free]), 0.0)
        ways = np.where(rates < 0.0, shares / np.maximum(-rates, 1e-300), np.inf)
        started = np.flatnonzero(self.start >= 0)
        ways[started, self.start[started]] = np.inf
        return ways.min(axis=1), ways.argmin(axis=1)

    def inside(self, setting: Setting, length: Values) -> Pinned:
        """Points of folds across the tangents, from guesses, in the planes of the triangles."""
        span = plane_bases(self.corners / setting.scales)
        rows = _rows(setting, self.tangent)[:, None]
        middle = embed(setting, self.z, self.p)
        aim = Aim(setting, True, False, span, middle, rows)
        return correct_points(aim, self.z, self.p, length, self.low, iterations=CORRECTIONS)

    def on_side(self, setting: Setting, length: Values, apex: Items) -> Pinned:
        """Points of folds on sides, from guesses."""
        every = np.arange(len(apex))
        ends = [self.corners[every, (apex + k) % 3] for k in (1, 2)]
        along = (ends[1] - ends[0]) / setting.scales
        size = np.linalg.norm(along, axis=1, keepdims=True)
        along = along / size
        p = self.p.copy()
        off = (p[:, setting.free] - ends[0]) / setting.scales
        share = (off * along).sum(axis=1, keepdims=True)
        p[:, setting.free] = ends[0] + share * along * setting.scales
        middle = embed(setting, self.z, p)
        aim = Aim(setting, True, False, along[:, None], middle, middle[:, None][:, :0])
        found = correct_points(aim, self.z, p, length, self.low, iterations=CORRECTIONS)
        place = (found.p[:, setting.free] - ends[0]) / setting.scales
        share = (place * along).sum(axis=1) / size[:, 0]
        on = (share > -BEYOND) & (share < 1.0 + BEYOND)
        return replace(found, found=found.found & on)


def _rows(
    setting: Setting, tangent: Float[np.ndarray, "n full"]
) -> Float[np.ndarray, "n coordinates"]:
    """Tangents in the coordinates of the embedding."""
    return np.asarray(frames_in_embedding(setting, tangent[:, None])[:, 0])


def _tangents(
    setting: Setting, corners: Float[np.ndarray, "n 3 d"], z: Lanes, p: Parameters
) -> Float[np.ndarray, "n full"]:
    """Unit tangents of folds in the planes of triangles, of either sense."""
    d, n = len(setting.free), setting.structure.unknowns
    forms = fold_forms(setting, z, p)
    # the set near a fold: along the null vector, and along the fold in the parameters
    rows = np.zeros((len(z), d, n + d))
    rows[:, 0, :n] = metric_coordinates(setting.structure, forms.null)
    along = np.linalg.svd(forms.slope[:, None])[2][:, 1:]
    rows[:, 1:, n:] = along
    rows[:, 0] /= np.linalg.norm(rows[:, 0], axis=1, keepdims=True)
    frames = tangent_frames(setting, z, p, rows)
    held = fold_slopes(setting, z, p, frames, forms.null)[:, None]
    held /= np.maximum(np.linalg.norm(held, axis=2, keepdims=True), 1e-300)
    if d > corners.shape[1] - 1:  # no step leaves the plane
        span = plane_bases(corners / setting.scales)
        normal = np.cross(span[:, 0], span[:, 1])
        across = np.einsum("nkd,nd->nk", frames[:, :, -d:], normal)[:, None]
        held = np.concatenate([held, across], axis=1)
    direction = np.linalg.svd(held)[2][:, -1]
    tangent = np.einsum("nk,nkf->nf", direction, frames)
    size = np.linalg.norm(_rows(setting, tangent), axis=1, keepdims=True)
    return np.asarray(tangent / np.maximum(size, 1e-300))
