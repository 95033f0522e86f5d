"""Points on curves with their tangents, and one predictor–corrector step of many lanes."""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float, Int

from equimorph.equilibria.curves import Curve, correction_size, dual, squared_length

Lanes = Float[np.ndarray, "lanes size"]
Values = Float[np.ndarray, " lanes"]
Flags = Bool[np.ndarray, " lanes"]

ACCEPTED = 1e-7
"""Size of the last correction: Newton is quadratic, so the point itself is good to its square."""

ARRIVAL, RETURN, FOLD, BRANCH, CONSTRAINT = 1, 2, 4, 8, 16
"""Bits of what can happen in a step."""


@dataclass(frozen=True)
class Front:
    """Points on the curves with unit tangents: where each lane is now."""

    z: Lanes
    t: Values
    tangent_z: Lanes
    tangent_t: Values
    index: Int[np.ndarray, " lanes"]

    def take(self, lanes: Int[np.ndarray, " some"] | Flags) -> "Front":
        """Return some of the lanes."""
        return Front(
            self.z[lanes],
            self.t[lanes],
            self.tangent_z[lanes],
            self.tangent_t[lanes],
            self.index[lanes],
        )

    def updated(self, new: "Front", where: Flags) -> "Front":
        """Return `new` on some of the lanes and this on the others."""
        wide = where[:, None]
        return Front(
            np.where(wide, new.z, self.z),
            np.where(where, new.t, self.t),
            np.where(wide, new.tangent_z, self.tangent_z),
            np.where(where, new.tangent_t, self.tangent_t),
            np.where(where, new.index, self.index),
        )


@dataclass(frozen=True)
class Bracket:
    """Steps in which something happened: lane numbers, both ends, step lengths, arclength before.

    what: bits of `ARRIVAL`, `RETURN`, `FOLD`, `BRANCH`, `CONSTRAINT`.
    """

    lanes: Int[np.ndarray, " some"]
    before: Front
    after: Front
    step: Float[np.ndarray, " some"]
    travelled: Float[np.ndarray, " some"]
    what: Int[np.ndarray, " some"]

    def take(self, at: Int[np.ndarray, " fewer"]) -> "Bracket":
        """Return some of the brackets."""
        return Bracket(
            self.lanes[at],
            self.before.take(at),
            self.after.take(at),
            self.step[at],
            self.travelled[at],
            self.what[at],
        )


def initial_front(curve: Curve, z: Lanes, t: Values) -> Front:
    """Unit tangents at known points, pointing towards growing t."""
    still = np.zeros_like(z)
    one, none = np.ones(len(z)), np.zeros(len(z))
    step = curve.advance(z, t, still, one, none)
    return _unit(curve, Front(z + step.dz, t, step.tangent_z, step.tangent_t, step.index))


def _unit(curve: Curve, front: Front) -> Front:
    length = squared_length(curve.structure, curve.weight, front.tangent_z, front.tangent_t)
    norm = np.sqrt(length)
    return replace(
        front, tangent_z=front.tangent_z / norm[:, None], tangent_t=front.tangent_t / norm
    )


def step_along(
    curve: Curve, front: Front, length: Values, bend: Lanes
) -> tuple[Front, Values, Flags]:
    """Go `length` along each curve: predict, correct, and tell the turning and the success.

    The predictor adds ½ length² times the curvature estimate `bend` (dT/ds); the corrector is
    Newton on the curve and the pseudo-arclength condition. A step counts only if the first
    correction is below a quarter of its length and the tangents stay within acos 0.9.
    """
    dz = length[:, None] * front.tangent_z + 0.5 * (length**2)[:, None] * bend
    guess = replace(front, z=front.z + dz, t=front.t + length * front.tangent_t)
    out, good = _corrected(curve, front, guess, length)
    # row·tangent = 1 by construction, so the cosine of the turning is 1 over the new length
    norm = np.sqrt(squared_length(curve.structure, curve.weight, out.tangent_z, out.tangent_t))
    cosine = np.where(good, 1.0 / norm, -1.0)
    turning = np.arccos(np.clip(cosine, -1.0, 1.0))
    return _unit(curve, out), turning, np.asarray(good & (cosine >= 0.9))


def _corrected(curve: Curve, front: Front, guess: Front, length: Values) -> tuple[Front, Flags]:
    """Newton from a guess to the point at arclength `length` along the tangents of `front`."""
    row, corner = dual(curve.structure, curve.weight, front.tangent_z, front.tangent_t)
    out = Front(*(column.copy() for column in vars(guess).values()))
    todo, good = np.arange(len(length)), np.zeros(len(length), bool)
    last = np.full(len(length), np.inf)
    for iteration in range(6):
        here = curve.take(todo)
        defect = np.einsum("li,li->l", row[todo], out.z[todo] - front.z[todo])
        defect += corner[todo] * (out.t[todo] - front.t[todo]) - length[todo]
        move = here.advance(out.z[todo], out.t[todo], row[todo], corner[todo], defect)
        size = correction_size(curve.structure, here.weight, move.dz, move.dt)
        limit = 0.25 * length[todo] if iteration == 0 else 0.5 * last[todo]
        alive = size <= np.maximum(limit, ACCEPTED)
        out.z[todo[alive]] += move.dz[alive]
        out.t[todo[alive]] += move.dt[alive]
        last[todo] = size
        done = alive & (size <= ACCEPTED)
        ready = todo[done]
        out.tangent_z[ready], out.tangent_t[ready] = move.tangent_z[done], move.tangent_t[done]
        out.index[ready], good[ready] = move.index[done], True
        todo = todo[alive & ~done]
        if len(todo) == 0:
            break
    return out, good
