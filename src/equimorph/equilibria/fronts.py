"""Points on curves with their tangents, and one predictor–corrector step of many lanes."""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float, Int

from equimorph.arrays import Flags, Lanes, Values
from equimorph.equilibria import kernels
from equimorph.equilibria.curves import Curve, dual, squared_length
from equimorph.equilibria.kernels import ARRIVAL, BRANCH, CONSTRAINT, FOLD, RETURN

__all__ = [
    "ARRIVAL",
    "BRANCH",
    "CONSTRAINT",
    "FOLD",
    "RETURN",
    "Bracket",
    "Front",
    "initial_front",
    "new_scalars",
    "onto_curve",
    "step_along",
]


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
    length = squared_length(curve.metric, curve.weight, front.tangent_z, front.tangent_t)
    norm = np.sqrt(length)
    return replace(
        front, tangent_z=front.tangent_z / norm[:, None], tangent_t=front.tangent_t / norm
    )


def step_along(curve: Curve, front: Front, length: Values) -> tuple[Front, Flags]:
    """Go `length` along each curve, predicted by the tangent; see `onto_curve`."""
    z = front.z + length[:, None] * front.tangent_z
    return onto_curve(curve, front, (z, front.t + length * front.tangent_t), length)


def onto_curve(
    curve: Curve, front: Front, guess: tuple[Lanes, Values], length: Values
) -> tuple[Front, Flags]:
    """Points at pseudo-arclength `length` from `front`, corrected from guesses, and the success.

    The corrector is Newton on the curve and the pseudo-arclength condition. A point counts only if
    the first correction is below a quarter of the length and its tangent within acos 0.9 of that of
    `front`.
    """
    metric, lanes = curve.metric, len(length)
    numbers, counts = new_scalars(lanes)
    trial = np.ascontiguousarray(guess[0]).copy()
    row, corner = dual(metric, curve.weight, front.tangent_z, front.tangent_t)
    numbers[kernels.TRIAL], numbers[kernels.CORNER] = guess[1], corner
    numbers[kernels.DEFECT] = kernels.row_sums(row, trial - front.z) - length
    numbers[kernels.DEFECT] += corner * (guess[1] - front.t)
    numbers[kernels.LENGTH], numbers[kernels.WEIGHT] = length, curve.weight**2
    out = replace(front, tangent_z=np.zeros_like(trial), index=np.zeros(lanes, int))
    closing = (numbers[kernels.CORNER], numbers[kernels.DEFECT])
    while (counts[kernels.STAGE] == kernels.CORRECTING).any():
        open_lanes = counts[kernels.STAGE] == kernels.CORRECTING
        move = curve.advance(trial, numbers[kernels.TRIAL], row, *closing)
        state = (trial, numbers, counts, lanes, kernels.EXACT, 0.0)
        kernels.correct(move.dz, move.dt, move.tangent_z, move.tangent_t, metric.mass, *state)
        new = open_lanes & (counts[kernels.STAGE] == kernels.CONVERGED)
        out.tangent_z[new] = move.tangent_z[new] / numbers[kernels.NORM, new, None]
        out.index[new] = move.index[new]
    good = counts[kernels.STAGE] == kernels.CONVERGED
    t, slope = numbers[kernels.TRIAL].copy(), np.where(good, numbers[kernels.NEW_SLOPE], 0.0)
    return replace(out, z=trial, t=t, tangent_t=slope), good


def new_scalars(
    lanes: int,
) -> tuple[Float[np.ndarray, "numbers lanes"], Int[np.ndarray, "counts lanes"]]:
    """Empty scalars of lanes: the rows are named in `kernels`."""
    return np.zeros((kernels.NUMBERS, lanes)), np.zeros((kernels.COUNTS, lanes), np.int64)
