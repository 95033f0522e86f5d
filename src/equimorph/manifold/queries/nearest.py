"""Least squares on an equilibrium set, or on its folds: Newton in tangent coordinates."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from equimorph.arrays import Flags, Lanes, Parameters, Rows, Values
from equimorph.manifold.complex.equilibrium_set import EquilibriumSet
from equimorph.manifold.geometry.exact_points import Aim, corrected
from equimorph.manifold.geometry.setting import Setting, embed
from equimorph.manifold.geometry.tangents import (
    best_corners,
    fold_slopes,
    placed_frames,
    split_step,
    tangent_frames,
)

Frames = Float[np.ndarray, "lanes k full"]
Residuals = Callable[[Lanes, Parameters], Float[np.ndarray, "lanes m"]]

DIFFERENCE = 1e-5
"""Step of central differences along orthonormal tangents, in the metric."""
CURVING = 1e-3
"""Step along the set by which the change of the gradient is measured."""
ITERATIONS, HALVINGS = 40, 12
"""Largest numbers of Newton steps, and of halvings of one step."""
SHORTER = 0.5 ** np.arange(4.0)
"""Shares of a step that are tried at once."""
LONGEST = 0.3
"""Longest step in the metric."""
STILL = 1e-9
"""Length of a step that is the last."""
FAR = 1e3
"""Distance from its guess within which any corrected point will do."""


@dataclass(frozen=True)
class Spot:
    """Points of a set, with bases of spaces near their tangent spaces."""

    z: Lanes
    p: Parameters
    rows: Rows

    def take(self, some: Int[np.ndarray, " n"] | Flags) -> "Spot":
        """Some of the points."""
        return Spot(self.z[some], self.p[some], self.rows[some])

    def replaced(self, some: Int[np.ndarray, " n"], others: "Spot") -> "Spot":
        """The same with some of the points replaced."""
        z, p, rows = self.z.copy(), self.p.copy(), self.rows.copy()
        z[some], p[some], rows[some] = others.z, others.p, others.rows
        return Spot(z, p, rows)


def spots(eset: EquilibriumSet, vertices: Int[np.ndarray, " n"]) -> Spot:
    """Vertices of a set, with the planes of cells around them."""
    around = eset.cells[np.isin(eset.cells, vertices).any(axis=1)]
    used, corners = np.unique(around, return_inverse=True)
    near = eset.points[used]
    rows = best_corners(eset.setting, near.z, near.p, corners.reshape(around.shape))
    place = np.searchsorted(used, vertices)
    return Spot(near.z[place], near.p[place], rows[place])


def local_minima(
    pairs: Int[np.ndarray, "n 2"], value: Float[np.ndarray, " V"]
) -> Int[np.ndarray, " some"]:
    """Vertices of some edges that no neighbour beats, the least first."""
    least = np.full(len(value), np.inf)
    for one, other in (pairs.T, pairs.T[::-1]):
        np.minimum.at(least, one, value[other])
    minima = np.flatnonzero(np.isfinite(least) & (value <= least))
    return np.asarray(minima[np.argsort(value[minima], kind="stable")])


@dataclass(frozen=True)
class Ground:
    """A set on which, or on whose folds, something is nearest.

    Parameters
    ----------
    setting
        Of the set.
    eset
        The set; its box bounds the search.
    fold
        Whether only folds count.
    """

    setting: Setting
    eset: EquilibriumSet
    fold: bool = False

    def frames(self, spot: Spot) -> tuple[Frames, Rows]:
        """Orthonormal directions along which points may move, and bases of the tangent spaces."""
        frames = tangent_frames(self.setting, spot.z, spot.p, spot.rows)
        rows = placed_frames(self.setting, frames)
        if self.fold:
            slopes = fold_slopes(self.setting, spot.z, spot.p, frames)[:, :, None]
            basis = np.linalg.qr(slopes, mode="complete")[0][:, :, 1:]
            frames = np.einsum("ldk,ldf->lkf", basis, frames)
        return frames, rows

    def moved(
        self, spot: Spot, frames: Frames, step: Float[np.ndarray, "lanes k"]
    ) -> tuple[Spot, Flags]:
        """Points of the set orthogonally above steps, and whether there are any in the box."""
        dz, dp = split_step(self.setting, np.einsum("lk,lkf->lf", step, frames))
        rows = placed_frames(self.setting, frames)
        there, good = self.corrected(Spot(spot.z + dz, spot.p + dp, rows))
        return Spot(there.z, there.p, spot.rows), good

    def corrected(self, spot: Spot) -> tuple[Spot, Flags]:
        """Points of the set orthogonally above points, and whether there are any in the box."""
        lanes, d = len(spot.z), len(self.setting.free)
        span = np.tile(np.eye(d), (lanes, 1, 1))
        middle = embed(self.setting, spot.z, spot.p)
        aim = Aim(self.setting, self.fold, False, span, middle, spot.rows)
        pinned = corrected(aim, spot.z, spot.p, np.full(lanes, FAR))
        good = pinned.found & self.eset.box.contains(pinned.p[:, self.setting.free], slack=1e-9)
        return Spot(pinned.z, pinned.p, spot.rows), good

    def nearest(self, spot: Spot, residuals: Residuals) -> tuple[Spot, Values, Flags]:
        """Local minima of ``½‖r‖²`` from points on, the norms ‖r‖, and whether they are minima.

        Newton with the second derivatives measured along the set. Those that run against the box
        or a constraint end there, and are no minima.
        """
        value = np.linalg.norm(residuals(spot.z, spot.p), axis=1)
        done, todo = np.zeros(len(value), bool), np.arange(len(value))
        for _ in range(ITERATIONS):
            if len(todo) == 0:
                break
            here = spot.take(todo)
            step, frames, rows = self._newton_step(here, residuals)
            here = Spot(here.z, here.p, rows)
            new, norm, better = self._shortened(here, frames, step, residuals, value[todo])
            small = np.linalg.norm(step, axis=1) < STILL
            done[todo[small]] = True
            spot, value[todo] = spot.replaced(todo, new), norm
            todo = todo[better & ~small]
        return spot, value, done

    def _gradient(
        self, spot: Spot, frames: Frames, residuals: Residuals
    ) -> tuple[Float[np.ndarray, "lanes k"], Float[np.ndarray, "lanes m k"]]:
        """Gradient of ½‖r‖² along frames, and the derivative of r."""
        lanes, k = frames.shape[:2]
        # all sides at once: a call costs more than its lanes
        steps = [split_step(self.setting, DIFFERENCE * frames[:, i]) for i in range(k)]
        sides = [(spot.z + s * dz, spot.p + s * dp) for dz, dp in steps for s in (1.0, -1.0)]
        z, p = (np.concatenate(each) for each in zip((spot.z, spot.p), *sides, strict=True))
        values = residuals(z, p).reshape(1 + 2 * k, lanes, -1)
        slope = np.moveaxis(values[1::2] - values[2::2], 0, 2) / (2.0 * DIFFERENCE)
        return np.einsum("lmk,lm->lk", slope, values[0]), slope

    def _newton_step(
        self, spot: Spot, residuals: Residuals
    ) -> tuple[Float[np.ndarray, "lanes k"], Frames, Rows]:
        """Step towards a minimum: that of Newton, uphill directions reversed."""
        frames, rows = self.frames(spot)
        k = frames.shape[1]
        if k == 0:
            return np.zeros((len(spot.z), 0)), frames, rows
        gradient, slope = self._gradient(spot, frames, residuals)
        hessian = np.einsum("lmi,lmj->lij", slope, slope)
        curved, measured = self._curved(Spot(spot.z, spot.p, rows), frames, residuals)
        # at a side of the box, where there is no beyond, Gauss–Newton has to do
        hessian[measured] = 0.5 * (curved + np.swapaxes(curved, 1, 2))[measured]
        values, vectors = np.linalg.eigh(hessian)
        size = np.maximum(np.abs(values), 1e-9 * (1.0 + np.abs(values).max(axis=1, keepdims=True)))
        along = np.einsum("lij,li->lj", vectors, gradient) / size
        step = -np.einsum("lij,lj->li", vectors, along)
        length = np.linalg.norm(step, axis=1, keepdims=True)
        return step * np.minimum(1.0, LONGEST / np.maximum(length, 1e-300)), frames, rows

    def _curved(
        self, spot: Spot, frames: Frames, residuals: Residuals
    ) -> tuple[Float[np.ndarray, "lanes k k"], Flags]:
        """Second derivatives along the set, from gradients on both sides; and where there are."""
        lanes, k = frames.shape[:2]
        sides = np.concatenate([np.eye(k), -np.eye(k)])
        step = np.repeat(CURVING * sides, lanes, axis=0)
        each = np.tile(np.arange(lanes), 2 * k)
        many, own = spot.take(each), frames[each]
        there, good = self.moved(many, own, step)
        there = many.replaced(np.flatnonzero(good), there.take(good))
        turned = self._aligned(self.frames(there)[0], own)
        gradient = self._gradient(there, turned, residuals)[0].reshape(2, k, lanes, k)
        curved = np.moveaxis(gradient[0] - gradient[1], 0, 1) / (2.0 * CURVING)
        measured = good.reshape(2 * k, lanes).all(axis=0)
        return curved, measured & np.isfinite(curved).all(axis=(1, 2))

    def _aligned(self, frames: Frames, others: Frames) -> Frames:
        """Frames turned in their spaces until they agree with others as well as they can."""
        ours, theirs = (placed_frames(self.setting, each) for each in (frames, others))
        left, _, right = np.linalg.svd(ours @ np.swapaxes(theirs, 1, 2))
        return np.asarray(np.swapaxes(left @ right, 1, 2) @ frames)

    def _shortened(
        self,
        spot: Spot,
        frames: Frames,
        step: Float[np.ndarray, "lanes k"],
        residuals: Residuals,
        value: Values,
    ) -> tuple[Spot, Values, Flags]:
        """Points after steps, halved until the norm falls; the norms, and where it does."""
        best, norm = spot, value.copy()
        better, share = np.zeros(len(value), bool), np.ones(len(value))
        for _ in range(1 + HALVINGS // len(SHORTER)):
            todo = np.flatnonzero(~better)
            if len(todo) == 0 or frames.shape[1] == 0:
                break
            # most steps gain at once; of others several lengths are tried side by side
            lengths = share[todo] * (SHORTER[:1] if share[todo[0]] == 1.0 else SHORTER)[:, None]
            each = np.tile(todo, len(lengths))
            tried = lengths.reshape(-1, 1) * step[each]
            there, good = self.moved(spot.take(each), frames[each], tried)
            size = np.linalg.norm(residuals(there.z, there.p), axis=1)
            good &= size < value[each]
            longest = good.reshape(lengths.shape).argmax(axis=0) * len(todo) + np.arange(len(todo))
            some = np.flatnonzero(good[longest])
            at, taken = todo[some], longest[some]
            best = best.replaced(at, there.take(taken))
            norm[at], better[at] = size[taken], True
            share[todo] = 0.5 * lengths[-1]
        return best, norm, better
