"""Newton's method for F(z; p) = 0, at fixed parameters or in one plane, in lanes.

It takes the fused step of structures and nothing else. `equilibria.settle` corrects points without
further conditions by it, and structures their natural states.

See docs/decisions.md, "One corrector".
"""

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np

from equimorph.arrays import Flags, Float, Int, Lanes, Parameters, Values
from equimorph.linalg.simd import LANES
from equimorph.structures import newton_kernels
from equimorph.structures.equations import Advance
from equimorph.structures.newton_kernels import correct_lanes
from equimorph.tolerances import CONVERGED

Numbers = Int[np.ndarray, " lanes"]


@runtime_checkable
class Steps(Protocol):
    """The part of equations that Newton's method needs."""

    @property
    def unknowns(self) -> int:
        """Entries of z that the metric measures."""

    @property
    def mass(self) -> Float[np.ndarray, " unknowns"]:
        """Diagonal of the mass matrix."""

    def advance(
        self, z: Lanes, p: Parameters, dp: Parameters, row: Lanes, corner: Values, defect: Values
    ) -> Advance:
        """One Newton step along the curve with parameter velocity `dp`; see `Advance`."""


@dataclass(frozen=True)
class Limits:
    """How long steps may be, and when a lane ends.

    Parameters
    ----------
    iterations
        Most steps.
    longest
        Length in the metric to which steps are shortened.
    too_long
        Length of a step at which a lane is given up: the guess was not near. One for all lanes, or
        one each.
    converged
        A shorter step is the last; Newton squares what is left.
    following
        Estimate of the next step, from the last two, below which it is not taken.
    contraction, free
        Each step must be at most so much of the one before, after so many steps that need not.
    exempt
        Index of lanes whose steps need not contract: theirs is the sheet that is sought.
    multipliers
        Weight of squared multipliers in the length of steps.
    """

    iterations: int = 60
    longest: float = 0.7
    too_long: float | Values = np.inf
    converged: float = CONVERGED
    following: float = 0.0
    contraction: float = np.inf
    free: int = 0
    exempt: Numbers | None = None
    multipliers: float = 0.0

    def too_long_of(self, lanes: int) -> Values:
        """Lengths at which lanes are given up, one each."""
        if isinstance(self.too_long, np.ndarray):
            return self.too_long
        return np.full(lanes, float(self.too_long))

    @property
    def lengths(self) -> tuple[float, float, float]:
        """What `newton_kernels.stand_after` compares lengths with."""
        return float(self.converged), float(self.following), float(self.contraction)


@dataclass(frozen=True)
class Through:
    """Planes through the guesses in which points are sought, parameters moving along `dp`.

    In each lane ``row·dz + corner·ds = 0`` where the parameters change by ds·dp; a row of zeros
    holds the parameters.
    """

    dp: Parameters
    row: Lanes
    corner: Values

    def take(self, rows: Numbers) -> tuple[Parameters, Lanes, Values]:
        """Copies of the arrays of some lanes."""
        return self.dp.take(rows, axis=0), self.row.take(rows, axis=0), self.corner.take(rows)


@dataclass(frozen=True)
class Newton:
    """Where Newton's method ended.

    Parameters
    ----------
    z, p
        Points; the last ones where nothing was found.
    status
        How lanes ended, as in `newton_kernels`.
    size, first
        Lengths of the last and of the first step.
    index
        Negative eigenvalues of the constrained Hessian where the last step began.
    tangents
        Tangents (dz, ds) of the curves there; none at fixed parameters.
    """

    z: Lanes
    p: Parameters
    status: Numbers
    size: Values
    first: Values
    index: Numbers
    tangents: Float[np.ndarray, "lanes k bordered"]

    @property
    def found(self) -> Flags:
        """Which lanes converged."""
        return np.asarray(self.status == newton_kernels.FOUND)


def newton(
    equations: Steps, z: Lanes, p: Parameters, limits: Limits, through: Through | None = None
) -> Newton:
    """Correct guesses to points with F(z; p) = 0, in planes through them or at fixed parameters.

    The limits say how long steps may be, and when a lane ends.
    """
    (lanes, size), k = z.shape, 0 if through is None else 1
    # structures compute whole blocks of lanes: the rest of one goes with the first lane
    rows = np.arange(lanes) if lanes >= LANES else _FILLED[lanes]
    z, p, most = z.take(rows, axis=0), p.take(rows, axis=0), len(rows)
    zero, one, still = np.zeros(most), np.ones(most), np.zeros((most, size))
    if through is None:
        velocity, row, corner, moved = np.zeros(p.shape), still, one, (p[:, :0], still[:, :0], one)
    else:
        moved = (velocity, row, corner) = through.take(rows)
    work = (rows.copy(), np.full(most, np.inf), z, p, *moved)
    result = _nothing(lanes, size, p.shape[1], k)
    exempt = np.zeros((lanes, 0), int) if limits.exempt is None else limits.exempt[:, None]
    weights = np.full(size, float(limits.multipliers))
    weights[: equations.unknowns] = equations.mass
    guards, lengths, left = (limits.too_long_of(lanes), exempt), limits.lengths, lanes
    longest = float(limits.longest)
    for number in range(1, limits.iterations + 1):
        if left == 0:
            break
        m = max(left, LANES)
        step = equations.advance(z[:m], p[:m], velocity[:m], row[:m], corner[:m], zero[:m])
        free = number <= limits.free or limits.contraction == np.inf
        rule = (free, number >= limits.iterations, number == 1)
        given = (step.dz, step.dt, step.index, step.tangent_z, step.tangent_t)
        left = correct_lanes(given, work, left, result, guards, weights, lengths, longest, rule)
    return Newton(*result)


_FILLED = [np.arange(LANES if lanes else 0) % max(lanes, 1) for lanes in range(LANES)]
"""Lanes of blocks that are filled up."""


def _nothing(lanes: int, size: int, parameters: int, k: int) -> tuple[np.ndarray, ...]:
    """What is told of lanes, to be written."""
    return (
        np.empty((lanes, size)),
        np.empty((lanes, parameters)),
        np.empty(lanes, int),
        np.empty(lanes),
        np.empty(lanes),
        np.empty(lanes, int),
        np.empty((lanes, k, size + k)),
    )
