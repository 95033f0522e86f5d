"""Least squares on an equilibrium set: Newton in tangent coordinates, along sides where it ends.

Sides are those of the box, and the constraints of the set (caps). A point that runs against one
moves on along it, and leaves it where the squares fall inwards: an active-set method
[NocedalWright2006]_, chapter 16, on curved faces.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from equimorph.arrays import Bool, Flags, Float, Lanes, Numbers, Parameters, Some, Values
from equimorph.columns import Columns
from equimorph.manifold.geometry.setting import Setting
from equimorph.manifold.geometry.tangents import cap_slopes, frames_in_embedding, split_step
from equimorph.manifold.queries.nearest import Frames, Ground, SetPoints, free_steps
from equimorph.model import worst_excess
from equimorph.tolerances import LAST_STEP, LONGEST_STEP, METRIC_DIFFERENCE

Residuals = Callable[[Lanes, Parameters], Float[np.ndarray, "lanes m"]]
Steps = Float[np.ndarray, "lanes k"]

CURVING = 1e-3
"""Step along the set by which the change of the gradient is measured."""
ITERATIONS, HALVINGS = 60, 12
"""Largest numbers of Newton steps, and of halvings of one step."""
SHORTER = 0.5 ** np.arange(4.0)
"""Shares of a step that are tried at once."""
LEVEL = 1e-14
"""Predicted fall of the squares, relative to them, that is lost in round-off."""
STALLED = 1e-9
"""The same below which a point whose norm falls no further is at a minimum."""
INWARDS = 1e-7
"""Fall of the norm per step inwards, relative to its largest slope, above which a side is left."""


def nearest(
    ground: Ground, spot: SetPoints, residuals: Residuals
) -> tuple[SetPoints, Values, Flags]:
    """Local minima of ``½‖r‖²`` from points on, the norms ‖r‖, and which are minima inside.

    Newton with the second derivatives measured along the set. Minima on a side of the box or on a
    constraint of the set are minima along it, beyond which the norm may fall on.
    """
    descent = _Descent.begun(ground, spot, residuals)
    for _ in range(ITERATIONS):
        todo = np.flatnonzero(~descent.ended)
        if len(todo) == 0:
            break
        for lanes in descent.faces(todo):
            descent.advance(lanes)
    return descent.spot, descent.value, descent.minimum & ~descent.held.any(axis=1)


@dataclass
class _Descent:
    """Points on their way, each on a face: which sides it is held on."""

    ground: Ground
    residuals: Residuals
    """Where the points may be, and what is to be small."""
    spot: SetPoints
    value: Values
    """The points and their norms."""
    held: Bool[np.ndarray, "lanes sides"]
    """For each point, whether it is held on a side: lower and upper sides of the box in turn, then
    the constraints."""
    ended: Flags
    minimum: Flags
    """Which points rest, and which of these at a minimum along their face."""

    @classmethod
    def begun(cls, ground: Ground, spot: SetPoints, residuals: Residuals) -> "_Descent":
        """At the starts, held nowhere."""
        count, d = len(spot.z), len(ground.setting.free)
        none = np.zeros(count, bool)
        value = np.linalg.norm(residuals(spot.z, spot.p), axis=1)
        held = np.zeros((count, 2 * d + 1), bool)
        return cls(ground, residuals, spot, value, held, none, none.copy())

    def faces(self, todo: Some) -> Iterator[Some]:
        """Points by the faces that they are on."""
        _, number = np.unique(self.held[todo], axis=0, return_inverse=True)
        for each in range(int(number.max(initial=-1)) + 1):
            yield todo[number.ravel() == each]

    def face(self, held: Bool[np.ndarray, " sides"]) -> Ground:
        """The ground on some of its sides."""
        d = len(self.ground.setting.free)
        sides = np.flatnonzero(held[:d] | held[d : 2 * d])
        return replace(self.ground, sides=tuple(sides.tolist()), cap=bool(held[-1]))

    def advance(self, lanes: Some) -> None:
        """Take a step from points on one face: along it, onto a further side, or off one."""
        face = self.face(self.held[lanes[0]])
        move = _newton_step(face, self.spot.take(lanes), self.residuals)
        still = move.small(self.value[lanes])
        self._release(lanes[still], np.ones(int(still.sum()), bool))
        share, side = self._room(move)
        hits = np.flatnonzero(~still & (share < 1.0))
        landed = self._land(lanes[hits], move.take(hits), share[hits], side[hits])
        share = np.where(share < 1.0, 0.5 * share, 1.0)  # where no side could be reached
        others = np.flatnonzero(~still)
        others = others[~np.isin(others, hits[landed])]
        self._descend(face, lanes[others], move.take(others), share[others])

    def _descend(self, face: Ground, lanes: Some, move: "_Move", share: Values) -> None:
        """Go on along the face as long a part of the step as makes the norm smaller."""
        if len(lanes) == 0:
            return
        step = share[:, None] * move.step
        value = self.value[lanes]
        new, norm, better = _shorten(face, move, step, self.residuals, value)
        self.spot, self.value[lanes] = self.spot.with_rows(lanes, new), norm
        self._release(lanes[~better], (move.fall < STALLED * value**2)[~better])

    def _room(self, move: "_Move") -> tuple[Values, Numbers]:
        """Share of each step at which it meets a side, and which one; ∞ if none."""
        ground = self.ground
        setting, spot, box = ground.setting, move.spot, ground.eset.box
        along = np.einsum("lk,lkd->ld", move.step, free_steps(setting, move.frames))
        along = np.where(np.abs(along) > 1e-12 * LONGEST_STEP, along * setting.scales, 0.0)
        place = spot.p[:, setting.free]
        with np.errstate(divide="ignore", invalid="ignore"):
            shares = [
                np.where(along < 0.0, (box.lower - place) / along, np.inf),
                np.where(along > 0.0, (box.upper - place) / along, np.inf),
            ]
        room = np.column_stack([*shares, self._room_below_caps(move)])
        room = np.maximum(room, 0.0)
        side = room.argmin(axis=1)
        return room[np.arange(len(room)), side], side

    def _room_below_caps(self, move: "_Move") -> Values:
        """Share of each step at which a constraint becomes active, as far as slopes tell."""
        setting, spot = self.ground.setting, move.spot
        room = np.full(len(spot.z), np.inf)
        if not setting.constraints or move.step.shape[1] == 0:
            return room
        excess = worst_excess(setting.constraints, spot.z, spot.p)
        slopes = cap_slopes(setting, spot.z, spot.p, move.frames)
        rise = np.einsum("lk,lk->l", slopes, move.step)
        rising = rise > 1e-9 * np.abs(slopes).max(axis=1) * np.abs(move.step).max(axis=1)
        room[rising] = -excess[rising] / rise[rising]
        return room

    def _land(self, lanes: Some, move: "_Move", share: Values, side: Numbers) -> Flags:
        """Put points onto the sides that their steps meet; where that raises no norm."""
        landed, ground = np.zeros(len(lanes), bool), self.ground
        setting, d = ground.setting, len(ground.setting.free)
        held = self.held[lanes].copy()
        held[np.arange(len(lanes)), side] = True
        dz, dp = split_step(
            setting, np.einsum("lk,lkf->lf", share[:, None] * move.step, move.frames)
        )
        z, p = move.spot.z + dz, move.spot.p + dp
        for lower, bound in ((0, ground.eset.box.lower), (d, ground.eset.box.upper)):
            at = np.flatnonzero((side >= lower) & (side < lower + d))
            p[at, setting.free[side[at] - lower]] = bound[side[at] - lower]
        for k, lane in enumerate(lanes.tolist()):
            face, one = self.face(held[k]), slice(k, k + 1)
            guess = SetPoints(z[one], p[one], move.spot.rows[one])
            frames, rows = face.frames(SetPoints(move.spot.z[one], move.spot.p[one], guess.rows))
            new, good = face.move(guess, frames, np.zeros(frames.shape[:2]))
            norm = np.linalg.norm(self.residuals(new.z, new.p), axis=1)
            near = share[k] * np.linalg.norm(move.step[k]) < LAST_STEP
            if good[0] and (norm[0] < self.value[lane] or near):
                self.spot = self.spot.with_rows(lanes[one], SetPoints(new.z, new.p, rows))
                self.value[lane], self.held[lane], landed[k] = norm[0], held[k], True
        return landed

    def _release(self, lanes: Some, minimum: Flags) -> None:
        """Let resting points leave the side off which the norm falls most; the others end."""
        for lane, least in zip(lanes.tolist(), minimum.tolist(), strict=True):
            sides = np.flatnonzero(self.held[lane]).tolist()
            slopes = {side: self._inwards(lane, side) for side in sides}
            side = max(slopes, key=lambda each: slopes[each], default=-1)
            if side >= 0 and slopes[side] > INWARDS:
                self.held[lane, side] = False
            else:
                self.ended[lane], self.minimum[lane] = True, least

    def _inwards(self, lane: int, side: int) -> float:
        """Fall of the norm off a side, relative to the largest slope; negative if it rises."""
        setting, d = self.ground.setting, len(self.ground.setting.free)
        held = self.held[lane].copy()
        held[side] = False
        face, spot = self.face(held), self.spot.take(np.array([lane]))
        frames, _ = face.frames(spot)
        gradient, slope = _gradient(face, spot, frames, self.residuals)
        if side == 2 * d:
            outwards = cap_slopes(setting, spot.z, spot.p, frames)[0]
        else:
            outwards = free_steps(setting, frames)[0, :, side % d] * (1.0 if side >= d else -1.0)
        size = np.linalg.norm(slope) * max(self.value[lane], 1e-300) * np.linalg.norm(outwards)
        return float(gradient[0] @ outwards / max(size, 1e-300))


@dataclass(frozen=True)
class _Move(Columns):
    """A Newton step along frames from points, and the fall of the squares that it predicts."""

    spot: SetPoints
    frames: Frames
    step: Steps
    fall: Values

    def small(self, value: Values) -> Flags:
        """Which steps are lost in round-off, in length or in what they gain."""
        short = np.linalg.norm(self.step, axis=1) < LAST_STEP
        return np.asarray(short | (self.fall < LEVEL * value**2))


def _gradient(
    ground: Ground, spot: SetPoints, frames: Frames, residuals: Residuals
) -> tuple[Float[np.ndarray, "lanes k"], Float[np.ndarray, "lanes m k"]]:
    """Gradient of ½‖r‖² along frames, and the derivative of r."""
    lanes, k = frames.shape[:2]
    # all sides at once: a call costs more than its lanes
    steps = [split_step(ground.setting, METRIC_DIFFERENCE * frames[:, i]) for i in range(k)]
    sides = [(spot.z + s * dz, spot.p + s * dp) for dz, dp in steps for s in (1.0, -1.0)]
    z, p = (np.concatenate(each) for each in zip((spot.z, spot.p), *sides, strict=True))
    values = residuals(z, p).reshape(1 + 2 * k, lanes, -1)
    slope = np.moveaxis(values[1::2] - values[2::2], 0, 2) / (2.0 * METRIC_DIFFERENCE)
    return np.einsum("lmk,lm->lk", slope, values[0]), slope


def _newton_step(ground: Ground, spot: SetPoints, residuals: Residuals) -> _Move:
    """Step towards a minimum: that of Newton, uphill directions reversed."""
    frames, rows = ground.frames(spot)
    spot = SetPoints(spot.z, spot.p, rows)
    lanes, k = frames.shape[:2]
    if k == 0:
        return _Move(spot, frames, np.zeros((lanes, 0)), np.zeros(lanes))
    gradient, slope = _gradient(ground, spot, frames, residuals)
    hessian = np.einsum("lmi,lmj->lij", slope, slope)
    curved, measured = _second_derivatives(ground, spot, frames, residuals)
    # at a side of the box, where there is no beyond, Gauss–Newton has to do
    hessian[measured] = 0.5 * (curved + np.swapaxes(curved, 1, 2))[measured]
    values, vectors = np.linalg.eigh(hessian)
    size = np.maximum(np.abs(values), 1e-9 * (1.0 + np.abs(values).max(axis=1, keepdims=True)))
    along = np.einsum("lij,li->lj", vectors, gradient) / size
    step = -np.einsum("lij,lj->li", vectors, along)
    length = np.linalg.norm(step, axis=1, keepdims=True)
    step = step * np.minimum(1.0, LONGEST_STEP / np.maximum(length, 1e-300))
    return _Move(spot, frames, step, -np.einsum("lk,lk->l", gradient, step))


def _second_derivatives(
    ground: Ground, spot: SetPoints, frames: Frames, residuals: Residuals
) -> tuple[Float[np.ndarray, "lanes k k"], Flags]:
    """Second derivatives along the set, from gradients on both sides; and where there are."""
    lanes, k = frames.shape[:2]
    sides = np.concatenate([np.eye(k), -np.eye(k)])
    step = np.repeat(CURVING * sides, lanes, axis=0)
    each = np.tile(np.arange(lanes), 2 * k)
    many, own = spot.take(each), frames[each]
    there, good = ground.move(many, own, step)
    there = many.with_rows(np.flatnonzero(good), there.take(good))
    turned = _align(ground.setting, ground.frames(there)[0], own)
    gradient = _gradient(ground, there, turned, residuals)[0].reshape(2, k, lanes, k)
    curved = np.moveaxis(gradient[0] - gradient[1], 0, 1) / (2.0 * CURVING)
    measured = good.reshape(2 * k, lanes).all(axis=0)
    return curved, measured & np.isfinite(curved).all(axis=(1, 2))


def _align(setting: Setting, frames: Frames, others: Frames) -> Frames:
    """Frames turned in their spaces until they agree with others as well as they can."""
    ours, theirs = (frames_in_embedding(setting, each) for each in (frames, others))
    left, _, right = np.linalg.svd(ours @ np.swapaxes(theirs, 1, 2))
    return np.asarray(np.swapaxes(left @ right, 1, 2) @ frames)


def _shorten(
    ground: Ground, move: _Move, step: Steps, residuals: Residuals, value: Values
) -> tuple[SetPoints, Values, Flags]:
    """Points after steps, halved until the norm falls; the norms, and where it does."""
    spot, frames = move.spot, move.frames
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
        there, good = ground.move(spot.take(each), frames[each], tried)
        size = np.linalg.norm(residuals(there.z, there.p), axis=1)
        good &= size < value[each]
        longest = good.reshape(lengths.shape).argmax(axis=0) * len(todo) + np.arange(len(todo))
        some = np.flatnonzero(good[longest])
        at, taken = todo[some], longest[some]
        best = best.with_rows(at, there.take(taken))
        norm[at], better[at] = size[taken], True
        share[todo] = 0.5 * lengths[-1]
    return best, norm, better
