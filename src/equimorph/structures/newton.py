"""Newton's method for F(z; p) = 0, at fixed parameters or in one plane, in lanes.

It takes the fused step of structures and nothing else. `equilibria.settle` corrects points without
further conditions by it, and structures their natural states.

See docs/decisions.md, "One corrector".
"""

from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from typing import Protocol, runtime_checkable

import numpy as np

from equimorph.arrays import Flags, Float, Int, Lanes, Parameters, Values
from equimorph.linalg.compiled import is_awaited
from equimorph.linalg.lanes import results_of, shares_of
from equimorph.linalg.simd import LANES
from equimorph.structures import newton_kernels
from equimorph.structures.equations import Advance, CompiledNewton
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

    @property
    def compiled_newton(self) -> CompiledNewton | None:
        """Newton's method compiled as a whole; None: it is not."""

    def advance(
        self, z: Lanes, p: Parameters, dp: Parameters, row: Lanes, corner: Values, defect: Values
    ) -> Advance:
        """One Newton step along the curve with parameter velocity `dp`; see `Advance`."""

    def correction(self, z: Lanes, p: Parameters) -> Advance:
        """One Newton step at fixed parameters."""


@dataclass(frozen=True)
class Limits:
    """How long steps may be, and when a lane ends."""

    iterations: int = 60
    """Most steps."""
    longest: float = 0.7
    """Length in the metric to which steps are shortened."""
    too_long: float | Values = np.inf
    """Length of a step at which a lane is given up: the guess was not near. One for all lanes, or
    one each."""
    converged: float = CONVERGED
    """A shorter step is the last; Newton squares what is left."""
    following: float = 0.0
    """Estimate of the next step, from the last two, below which it is not taken."""
    contraction: float = np.inf
    free: int = 0
    """Each step must be at most so much of the one before, after so many steps that need not."""
    exempt: Numbers | None = None
    """Index of lanes whose steps need not contract: theirs is the sheet that is sought."""
    multipliers: float = 0.0
    """Weight of squared multipliers in the length of steps."""

    def take(self, some: Numbers) -> "Limits":
        """Limits of some of the lanes, without the guards that points must pass afterwards."""
        too_long, exempt = self.too_long, self.exempt
        return Limits(
            self.iterations,
            self.longest,
            too_long[some] if isinstance(too_long, np.ndarray) else too_long,
            self.converged,
            self.following,
            self.contraction,
            self.free,
            None if exempt is None else exempt[some],
            self.multipliers,
        )

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
    """Where Newton's method ended."""

    z: Lanes
    p: Parameters
    """Points; the last ones where nothing was found."""
    status: Numbers
    """How lanes ended, as in `newton_kernels`."""
    size: Values
    first: Values
    """Lengths of the last and of the first step."""
    index: Numbers
    """Negative eigenvalues of the constrained Hessian where the last step began."""
    tangents: Float[np.ndarray, "lanes k bordered"]
    """Tangents (dz, ds) of the curves there; none at fixed parameters."""

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
    loop = _loop_of(equations, z, p)
    if loop is not None and (shares := shares_of(lanes)) > 1:
        return _shared(equations, z, p, limits, through, shares)
    # structures compute whole blocks of lanes: the rest of one goes with the first lane
    rows = np.arange(lanes) if lanes >= LANES else _FILLED[lanes]
    most = len(rows)
    still = (np.zeros((most, 0)), np.zeros((most, 0)), np.ones(most))
    moved = still if through is None else through.take(rows)
    work = (rows.copy(), np.full(most, np.inf), z.take(rows, axis=0), p.take(rows, axis=0), *moved)
    result = _nothing(lanes, size, p.shape[1], k)
    exempt = np.zeros((lanes, 0), int) if limits.exempt is None else limits.exempt[:, None]
    weights = np.full(size, float(limits.multipliers))
    weights[: equations.unknowns] = equations.mass
    given = result, (limits.too_long_of(lanes), exempt), weights, limits.lengths
    longest, left, number = float(limits.longest), lanes, 0
    free = limits.iterations if limits.contraction == np.inf else limits.free
    step, ratio = _no_step(most, size), np.empty(most)
    while left > 0 and number < limits.iterations:
        if loop is None:
            step = _step(equations, work, slice(max(left, LANES)))
        else:
            rule, guard = (longest, free, limits.iterations), loop.guards[k]
            told = step, ratio, (left, number)
            left, number = loop.run(loop.tables, guard, work, *told, *given, rule)
            if left == 0 or number == limits.iterations:
                break
            unsafe = (~(ratio[:left] >= guard)).nonzero()[0]
            for column, own in zip(step, _step(equations, work, unsafe), strict=True):
                column[unsafe] = own
        number += 1
        stage = (number <= free, number >= limits.iterations, number == 1)
        left = correct_lanes(step, work, left, *given, longest, stage)
    return Newton(*result)


def _loop_of(equations: Steps, z: Lanes, p: Parameters) -> CompiledNewton | None:
    """The compiled loop, if there is one that lanes fit."""
    loop = equations.compiled_newton
    if loop is None or (z.shape[1], p.shape[1]) != loop.widths or is_awaited(loop.run):
        return None
    return loop


def _shared(
    equations: Steps, z: Lanes, p: Parameters, limits: Limits, through: Through | None, shares: int
) -> Newton:
    """The same by several threads, each of which takes its share of the lanes to the end."""
    cuts = [len(z) * k // shares for k in range(shares + 1)]
    parts = [np.arange(a, b) for a, b in pairwise(cuts)]
    moved = [None if through is None else Through(*through.take(part)) for part in parts]
    tasks = [
        partial(newton, equations, z[part], p[part], limits.take(part), along)
        for part, along in zip(parts, moved, strict=True)
    ]
    found = [tuple(vars(each).values()) for each in results_of(tasks)]
    return Newton(*(np.concatenate(each) for each in zip(*found, strict=True)))


def _no_step(lanes: int, size: int) -> tuple[np.ndarray, ...]:
    """A step, as `correct_lanes` takes it, to be written."""
    dz, tangent_z = np.empty((2, lanes, size))
    dt, tangent_t = np.empty((2, lanes))
    return dz, dt, np.empty(lanes, int), tangent_z, tangent_t


def _step(
    equations: Steps, work: tuple[np.ndarray, ...], some: Numbers | slice
) -> tuple[np.ndarray, ...]:
    """One step of some of the lanes at work."""
    z, p, dp, row, corner = (each[some] for each in work[2:])
    if dp.shape[1] == 0:
        step = equations.correction(z, p)
    else:
        step = equations.advance(z, p, dp, row, corner, np.zeros(len(z)))
    return step.dz, step.dt, step.index, step.tangent_z, step.tangent_t


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
