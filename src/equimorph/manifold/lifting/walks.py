"""Curves on the set followed in the planes of grid triangles: folds, and where a constraint acts.

And folds along constraints in grid tetrahedra, whose faces are the sides of these.

Steps along the tangent are halved until their corrections are short and both tangents alike, and
lead from one end to the other; the last one ends on the side itself.

See docs/decisions.md, "Folds are followed through their triangles".
"""

from dataclasses import dataclass, replace

import numpy as np

from equimorph.arrays import Float, Items, Lanes, Parameters, Values
from equimorph.columns import Columns
from equimorph.manifold.geometry.exact_points import STEPS, Aim, Pinned, correct_points
from equimorph.manifold.geometry.points import VertexKind
from equimorph.manifold.geometry.setting import Setting, embed
from equimorph.manifold.geometry.simplices import plane_bases, shares_in
from equimorph.manifold.geometry.tangents import (
    cap_slopes,
    fold_forms,
    fold_rows,
    fold_slopes,
    frames_in_embedding,
    split_step,
    tangent_frames,
)

OFF, STRAIGHT = 0.25, 0.9
"""Longest correction of a step, in its length, and least cosine of the tangents at its ends."""
SWAYED = 0.02
"""How far a step along a fold may be from the mean of the tangents at its ends, in its length: that
of an arc is so to third order, one to a fold beside it is not, be their tangents alike."""
CORRECTIONS = 10
"""Of a guess of a step, at most: those that are close enough, see `OFF`, need fewer. Of 4800 lanes
of set 923 of the soak 2000 used up 60, which took half of its time."""
FEW = replace(STEPS, iterations=CORRECTIONS)
AT_KINKS = replace(FEW, contraction=0.5)
"""Limits of corrections; across a kink of a constraint they are as long as the ones before."""
BEYOND = 1e-9
"""Barycentric coordinate up to which points lie beyond sides: that of round-off."""
Full = Float[np.ndarray, "n full"]
Simplices = Float[np.ndarray, "n corners d"]
"""Corners of triangles or tetrahedra, in free parameters."""


@dataclass(frozen=True)
class Walk(Columns):
    """Points of folds, or of where a constraint acts, in triangles; where both meet, in tetrahedra.

    kind: `FOLD`, `CAP`, or `CORNER` for both; tangent: of unit length in the embedding, with
    changes of z and of the scaled free parameters; rows: a basis, in the embedding, of a space near
    that of the set, of a constraint with an orientation by which its excess rises on the same side
    all the way; length: of the next step, at most; start: number of the corner opposite the side of
    the first point, −1 later; low: index on the lower side of a fold.
    """

    kind: VertexKind
    corners: Simplices
    z: Lanes
    p: Parameters
    tangent: Full
    rows: Float[np.ndarray, "n d coordinates"]
    length: Values
    start: Items
    low: Items

    @classmethod
    def start_from(
        cls, setting: Setting, corners: Simplices, z: Lanes, p: Parameters, low: Items,
        kind: VertexKind,
    ) -> "Walk":  # fmt: skip
        """First points on sides of triangles or tetrahedra, with tangents that lead into these."""
        n, d = setting.structure.unknowns, len(setting.free)
        rows = np.zeros((len(z), d, n + d))
        rows[:, :, n:] = np.eye(d)
        tangent, rows = _tangents(setting, kind, corners, z, p, rows)
        side = shares_in(corners, p[:, setting.free]).argmin(axis=1)
        walk = cls(kind, corners, z, p, tangent, rows, np.full(len(z), np.inf), side, low)
        inwards = np.take_along_axis(walk.rates(setting), side[:, None], axis=1)
        sense = np.copysign(1.0, inwards)
        rows[:, 0] *= sense
        return replace(walk, tangent=tangent * sense)

    def rates(self, setting: Setting) -> Float[np.ndarray, "n corners"]:
        """Changes of the barycentric coordinates along the tangents."""
        along = self.tangent[:, -len(setting.free) :] * setting.scales
        there = shares_in(self.corners, self.corners[:, 0] + along)
        return np.asarray(there - np.eye(self.corners.shape[1])[0])

    def step(self, setting: Setting) -> tuple["Walk", Items]:
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
        off = np.linalg.norm(
            embed(setting, there.z, there.p) - embed(setting, guess.z, guess.p), axis=1
        )
        good = there.found & (off < OFF * length)
        # a step that is bent out of the triangle passed the side
        good &= leaves | (shares_in(self.corners, there.p[:, setting.free]).min(axis=1) > -BEYOND)
        tangent, rows, cosine = self.tangent.copy(), self.rows.copy(), np.zeros(len(way))
        if len(near := np.flatnonzero(good)):
            own, at = self.take(near), there.take(near)
            found = _tangents(setting, self.kind, own.corners, at.z, at.p, own.rows)
            tangent[near], rows[near] = found
            alike = tangent_rows(setting, found[0]) * tangent_rows(setting, own.tangent)
            cosine[near] = alike.sum(axis=1)
        if self.kind != VertexKind.CAP:  # null vectors have no orientation
            tangent, cosine = tangent * np.copysign(1.0, cosine)[:, None], np.abs(cosine)
            good &= self._swayed(setting, there, tangent) < SWAYED
        good &= cosine > STRAIGHT
        moved = replace(
            self, z=there.z, p=there.p, tangent=tangent, rows=rows, length=2.0 * length,
            start=np.full(len(self.z), -1),
        )  # fmt: skip
        # where it leads inwards a point on a side is the first one, or another one of that side
        outwards = np.take_along_axis(moved.rates(setting), apex[:, None], axis=1)[:, 0] < 0.0
        good &= ~leaves | outwards
        waiting = replace(self, length=0.5 * length)
        return moved.where(good, waiting), np.where(good & leaves, apex, -1)

    def _swayed(self, setting: Setting, there: Pinned, tangent: Full) -> Values:
        """How far steps are from the mean of the tangents at their ends, in their lengths."""
        step = embed(setting, there.z, there.p) - embed(setting, self.z, self.p)
        size = np.linalg.norm(step, axis=1, keepdims=True)
        mean = 0.5 * tangent_rows(setting, self.tangent + tangent)
        return np.asarray(
            np.linalg.norm(step - size * mean, axis=1) / np.maximum(size[:, 0], 1e-300)
        )

    def _ways_out(self, setting: Setting) -> tuple[Values, Items]:
        """Lengths of the straight ways out, and corners opposite the sides."""
        rates = self.rates(setting)
        shares = np.maximum(shares_in(self.corners, self.p[:, setting.free]), 0.0)
        ways = np.where(rates < 0.0, shares / np.maximum(-rates, 1e-300), np.inf)
        started = np.flatnonzero(self.start >= 0)
        ways[started, self.start[started]] = np.inf
        return ways.min(axis=1), ways.argmin(axis=1)

    def inside(self, setting: Setting, length: Values) -> Pinned:
        """Points across the tangents, from guesses."""
        span = plane_bases(self.corners / setting.scales)
        rows = tangent_rows(setting, self.tangent)[:, None]
        middle = embed(setting, self.z, self.p)
        return self._corrected(setting, span, middle, rows, length)

    def on_side(self, setting: Setting, length: Values, apex: Items) -> Pinned:
        """Points on sides, from guesses."""
        count = self.corners.shape[1]
        others = (apex[:, None] + np.arange(1, count)) % count
        side = np.take_along_axis(self.corners, others[:, :, None], axis=1)
        span, p = plane_bases(side / setting.scales), self.p.copy()
        off = (p[:, setting.free] - side[:, 0]) / setting.scales
        flat = np.einsum("nk,nkd->nd", np.einsum("nd,nkd->nk", off, span), span)
        p[:, setting.free] = side[:, 0] + flat * setting.scales
        middle = embed(setting, self.z, p)
        guess = replace(self, p=p)
        found = guess._corrected(setting, span, middle, middle[:, None][:, :0], length)
        on = shares_in(side, found.p[:, setting.free]).min(axis=1) > -BEYOND
        return replace(found, found=found.found & on)

    def _corrected(
        self,
        setting: Setting,
        span: Float[np.ndarray, "n m d"],
        middle: Float[np.ndarray, "n coordinates"],
        rows: Float[np.ndarray, "n k coordinates"],
        length: Values,
    ) -> Pinned:
        fold, cap = _met(self.kind)
        aim = Aim(setting, fold, cap, span, middle, rows)
        low, limits = self.low if fold else None, AT_KINKS if cap else FEW
        return correct_points(aim, self.z, self.p, length, low, limits=limits)


def _met(kind: VertexKind) -> tuple[bool, bool]:
    """Whether points of a kind are those of folds, and of a constraint."""
    return kind != VertexKind.CAP, kind != VertexKind.FOLD


def tangent_rows(
    setting: Setting, tangent: Float[np.ndarray, "n full"]
) -> Float[np.ndarray, "n coordinates"]:
    """Tangents in the coordinates of the embedding."""
    return np.asarray(frames_in_embedding(setting, tangent[:, None])[:, 0])


def _tangents(
    setting: Setting,
    kind: VertexKind,
    corners: Simplices,
    z: Lanes,
    p: Parameters,
    rows: Float[np.ndarray, "n d coordinates"],
) -> tuple[Full, Float[np.ndarray, "n d coordinates"]]:
    """Unit tangents of curves, and bases of the tangent spaces.

    Those of folds have either sense; a constraint rises on one side, by the rows' orientation.
    """
    (fold, cap), held = _met(kind), list[Float[np.ndarray, "n d"]]()
    if fold:
        forms = fold_forms(setting, z, p)
        frames = tangent_frames(setting, z, p, fold_rows(setting, forms))
        held.append(fold_slopes(setting, z, p, frames, forms.null))
    else:
        frames = tangent_frames(setting, z, p, rows)
    if cap:
        held.append(cap_slopes(setting, z, p, frames))
    along = (
        np.cross(held[0], held[1])
        if fold and cap
        else directions(setting, corners, frames, held[0])
    )
    tangent = np.einsum("nk,nkf->nf", along, frames)
    size = np.linalg.norm(tangent_rows(setting, tangent), axis=1, keepdims=True)
    return tangent / np.maximum(size, 1e-300), frames_in_embedding(setting, frames)


def directions(
    setting: Setting,
    corners: Float[np.ndarray, "n 3 d"],
    frames: Float[np.ndarray, "n d full"],
    slope: Float[np.ndarray, "n d"],
) -> Float[np.ndarray, "n d"]:
    """Unit vectors, in frames, across slopes and in the planes of triangles.

    The slopes are on their right over two parameters; over three as the planes' normals tell.
    """
    if len(setting.free) == corners.shape[1] - 1:
        along = np.stack([-slope[:, 1], slope[:, 0]], axis=1)
    else:
        span = plane_bases(corners / setting.scales)
        normal = np.cross(span[:, 0], span[:, 1])
        along = np.cross(slope, np.einsum("nkd,nd->nk", frames[:, :, -len(setting.free) :], normal))
    size = np.linalg.norm(along, axis=1, keepdims=True)
    return np.asarray(along / np.maximum(size, 1e-300))
