"""The stability margin: smallest eigenvalue of the constrained Hessian in the metric.

See docs/decisions.md, "The metric is diagonal".
"""

from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from typing import Any, Protocol, runtime_checkable

import numpy as np

from equimorph.arrays import Flags, Float, Int, Lanes, Parameters, Sides, Values
from equimorph.columns import Columns
from equimorph.linalg import BorderedSolution
from equimorph.linalg.lanes import in_background, threads
from equimorph.structures.equations import Shift
from equimorph.structures.margin_kernels import rotate_pairs
from equimorph.structures.metric import metric_length

RELATIVE = 1e-11
"""Relative change of an eigenvalue at which an iteration ends."""
NEAR = 1e-3
"""Distance of a shift below the eigenvalue, as a share of the second one, once that is known."""
HALVINGS = (4, 4, 8)
"""Bisections between a number below all eigenvalues and zero, before each try to go on in pairs."""
FIRST_HALVINGS, POLISHING, ALL_HALVINGS = 12, 40, 60
"""Bisections before inverse iteration begins, its most steps, and bisections where it fails."""
SWEEPS, CHUNK, SHARE = 8, 256, 1024
"""Most solves; lanes at a time; least lanes that are worth a further thread."""

Pairs = Float[np.ndarray, "lanes 2 entries"]


@runtime_checkable
class Pencil(Protocol):
    """A constrained second variation and its metric, as structures and `OutOfPlane` have them."""

    unknowns: int
    constraints: int
    mass: Float[np.ndarray, " unknowns"]

    @property
    def size(self) -> int:
        """Number of unknowns and multipliers."""

    def solve(
        self,
        z: Lanes,
        p: Parameters,
        rhs: Sides,
        border: Any = None,
        shift: Shift = None,
    ) -> BorderedSolution:
        """Solve with the second variation − shift · mass; `negative` counts its eigenvalues."""


def stability_margin(
    structure: Pencil,
    z: Lanes,
    p: Parameters,
    error: float = RELATIVE,
    floor: Values | None = None,
) -> Values:
    """Smallest σ of ``L_uu v + c_uᵀ μ = σ M v``, ``c_u v = 0``, per lane.

    Inverse iteration on pairs of vectors finds it for stable states in four or five solves, the
    last of them so near below it that their inertia, which counts the eigenvalues below a shift,
    proves that it is the smallest. Other states begin at `floor`, numbers below all eigenvalues;
    without it, the count gives one by doubling. Bisection isolates what no pairs prove.
    A larger relative `error` than that of round-off saves a solve or two.
    Scale: energy over the metric's unit squared.
    """
    value, proved = np.empty(len(z)), np.zeros(len(z), bool)
    start = np.zeros(len(z))

    def run(begin: int, end: int) -> None:
        for first in range(begin, end, CHUNK):
            part = slice(first, min(first + CHUNK, end))
            value[part], proved[part] = _by_pairs(structure, z[part], p[part], error, start[part])

    shares = max(1, min(threads(), len(z) // SHARE)) if len(z) >= 2 * SHARE else 1
    cuts = [len(z) * k // shares for k in range(shares + 1)]
    jobs = in_background([partial(run, *cut) for cut in pairwise(cuts[1:])])
    run(0, cuts[1])
    for job in jobs:
        job.result()
    rest = np.flatnonzero(~proved)
    if len(rest):
        least = _bracket(structure, z[rest], p[rest])[0] if floor is None else floor[rest]
        value[rest], proved[rest] = _above(structure, z[rest], p[rest], error, least)
        rest = rest[~proved[rest]]
    if len(rest):
        value[rest] = _by_bisection(structure, z[rest], p[rest])
    return value


def _by_pairs(
    structure: Pencil,
    z: Lanes,
    p: Parameters,
    error: float,
    start: Values,
) -> tuple[Values, Flags]:
    """Margins of states without eigenvalues below `start`, and which of them are proved."""
    value, proved = np.empty(len(z)), np.zeros(len(z), bool)
    todo, vectors = np.arange(len(z)), first_pairs(structure, len(z))
    shift, known = start.copy(), np.full(len(z), np.nan)
    for sweep in range(SWEEPS):
        swept = _swept(structure, z[todo], p[todo], shift, vectors)
        vectors, first, second, stable = swept.pairs, swept.first, swept.second, swept.above
        change = np.abs(known - first)
        # one more sweep would shrink the error by this factor
        left = ((first - shift) / np.maximum(second - shift, NEAR * np.abs(second))) ** 2
        tolerance = error * np.maximum(np.abs(first), 1e-3)
        settled = stable & (change * left <= tolerance)  # not in the first sweep: NaN
        value[todo[settled]], proved[todo[settled]] = first[settled], True
        more = stable & ~settled
        if not more.any():
            break
        arrays = (todo, vectors, first, second, change)
        todo, vectors, known, second, change = (each[more] for each in arrays)
        gap = np.maximum(change, NEAR * np.abs(second))
        shift = known - gap if sweep > 0 else shift[more]
    return value, proved


def _above(
    structure: Pencil, z: Lanes, p: Parameters, error: float, floor: Values
) -> tuple[Values, Flags]:
    """Negative margins, and which of them are proved: pairs from a number not far below each.

    A few bisections on the count of eigenvalues find it; more of them where two are too close.
    """
    value, proved = np.empty(len(z)), np.zeros(len(z), bool)
    low, high = floor.copy(), np.zeros(len(z))
    for halvings in HALVINGS:
        at = np.flatnonzero(~proved)
        if len(at) == 0:
            break
        bounds = low[at], high[at]
        low[at], high[at] = _bisect(structure, z[at], p[at], *bounds, halvings)
        value[at], proved[at] = _by_pairs(structure, z[at], p[at], error, low[at])
    return value, proved


def generic_vectors(structure: Pencil, lanes: int) -> Float[np.ndarray, "lanes unknowns"]:
    """Vectors that are orthogonal to no mode."""
    wave = np.cos(1.7 * np.arange(structure.unknowns)) + 1.3
    return np.asarray(wave[None].repeat(lanes, axis=0))


def inverse_step(
    structure: Pencil,
    z: Lanes,
    p: Parameters,
    vector: Float[np.ndarray, "lanes unknowns"],
    shift: Shift = None,
) -> Float[np.ndarray, "lanes entries"]:
    """Solve (F_z − shift·mass) x = mass·vector: a step of inverse iteration."""
    rhs = np.zeros((len(z), 1, structure.size))
    rhs[:, 0, : structure.unknowns] = structure.mass * vector
    return np.asarray(structure.solve(z, p, rhs, shift=shift).x[:, 0])


def first_pairs(structure: Pencil, lanes: int) -> Pairs:
    """Vectors that are smooth along a chain, and orthogonal to no mode, for each lane."""
    n = structure.unknowns
    at, count = np.arange(n), np.array([[2.0], [3.0]])
    pair = np.sin(np.pi * count * (at + 1) / (n + 1)) + 0.1 * np.cos((count - 0.7) * at)
    pairs = np.zeros((lanes, 2, structure.size))
    pairs[:, :, :n] = pair / metric_length(structure, pair)[:, None]
    return pairs


@dataclass(frozen=True)
class Softest(Columns):
    """Rayleigh quotients of pairs of vectors."""

    pairs: Pairs
    """Vectors (v, μ), orthonormal in the metric; of these the first is the mode."""
    first: Values
    """Rayleigh quotient of the first."""
    second: Values
    """Ritz value of the second."""
    above: Flags
    """Whether no eigenvalue lies below the shift."""
    off: Values
    """Square of the residual of the mode, in the inverse of the metric."""


def softest_modes(
    structure: Pencil, z: Lanes, p: Parameters, floor: Values, pairs: Pairs, error: float
) -> Softest:
    """Margins of states without an eigenvalue below `floor`, and their modes, from given pairs.

    Modes of states nearby take one solve. `error` is relative to the distance from `floor`; the
    bound of Kato and Temple estimates it: the square of the residual over the gap.
    """
    found = _swept(structure, z, p, floor, pairs)
    for _ in range(SWEEPS - 1):
        allowed = error * (found.first - floor) * (found.second - found.first)
        more = np.flatnonzero(found.above & (found.off > allowed))
        if len(more) == 0:
            break
        again = _swept(structure, z[more], p[more], floor[more], found.pairs[more])
        found = found.with_rows(more, again)
    return found


def _swept(
    structure: Pencil,
    z: Lanes,
    p: Parameters,
    shift: Values,
    vectors: Pairs,
) -> Softest:
    """One solve for pairs of vectors, and their rotation to Ritz vectors."""
    n, mass = structure.unknowns, structure.mass
    rhs = np.zeros((len(shift), 2, structure.size))
    np.multiply(vectors[:, :, :n], mass, out=rhs[:, :, :n])
    solution = structure.solve(z, p, rhs, shift=shift)
    pairs, (first, second, off) = np.empty(rhs.shape), np.empty((3, len(shift)))
    given = (np.ascontiguousarray(each) for each in (solution.x, mass, shift))
    rotate_pairs(rhs, *given, NEAR, pairs, first, second, off)
    # a singular solve is not good
    good = (solution.negative == structure.constraints) & np.isfinite(first + second)
    first[~good], second[~good] = 1.0, 1.0
    if n - structure.constraints < 2:  # a single vector is the mode itself
        off[:] = 0.0
    return Softest(pairs, first, second, good, off)


def _by_bisection(
    structure: Pencil,
    z: Lanes,
    p: Parameters,
) -> Values:
    """Margins of any states: bisection, then inverse iteration with the Rayleigh quotient.

    Where that does not converge, bisection goes on to round-off; not a number where no bounds hold.
    """
    low, high = _bracket(structure, z, p)
    low, high = _bisect(structure, z, p, low, high, FIRST_HALVINGS)
    value, good = _polish(structure, z, p, low, high)
    rest = np.flatnonzero(~good)
    if len(rest):
        low, high = (each[rest] for each in (low, high))
        low, high = _bisect(structure, z[rest], p[rest], low, high, ALL_HALVINGS)
        below, above = (count_below(structure, z[rest], p[rest], each) for each in (low, high))
        value[rest] = np.where((below == 0) & (above > 0), 0.5 * (low + high), np.nan)
    return value


def _bisect(
    structure: Pencil, z: Lanes, p: Parameters, low: Values, high: Values, times: int
) -> tuple[Values, Values]:
    """Bounds of the smallest eigenvalue after bisections on the count of those below."""
    for _ in range(times):
        middle = 0.5 * (low + high)
        below = count_below(structure, z, p, middle) > 0
        high, low = np.where(below, middle, high), np.where(below, low, middle)
    return low, high


def count_below(
    structure: Pencil, z: Lanes, p: Parameters, shift: float | Values
) -> Int[np.ndarray, " lanes"]:
    """Number of eigenvalues of the constrained Hessian, in the metric, below a shift."""
    nothing, shift = np.zeros((len(z), 0, structure.size)), np.full(len(z), shift)
    return structure.solve(z, p, nothing, shift=shift).negative - structure.constraints


def _bracket(
    structure: Pencil,
    z: Lanes,
    p: Parameters,
) -> tuple[Values, Values]:
    """Numbers below and above the smallest eigenvalue, by doubling from zero."""
    some = count_below(structure, z, p, 0.0) > 0
    low, high = np.where(some, -1.0, 0.0), np.where(some, 0.0, 1.0)
    for _ in range(60):
        wrong_low = count_below(structure, z, p, low) > 0
        wrong_high = count_below(structure, z, p, high) == 0
        if not (wrong_low.any() or wrong_high.any()):
            break
        high = np.where(wrong_low, low, high)
        low = np.where(wrong_high, np.maximum(high, low), low)
        low = np.where(wrong_low, 2.0 * low, low)
        high = np.where(wrong_high, 2.0 * high, high)
    return low, high


def _polish(
    structure: Pencil,
    z: Lanes,
    p: Parameters,
    low: Values,
    high: Values,
) -> tuple[Values, Flags]:
    """Inverse iteration from a shift just below the smallest eigenvalue; where it converged."""
    n, mass = structure.unknowns, structure.mass
    vector = generic_vectors(structure, len(z))
    # an eigenvalue of zero lies on the bracket's end, where the matrix is singular
    bottom = low - 0.5 * (high - low)
    value, shift = 0.5 * (low + high), bottom.copy()
    good = np.zeros(len(z), bool)
    for sweep in range(POLISHING):
        solved = inverse_step(structure, z, p, vector, shift)[:, :n]
        norm = np.sqrt(np.einsum("li,i,li->l", solved, mass, solved))
        # Rayleigh quotient of the new vector: (F_z − shift M) solved = M vector
        quotient = shift + np.einsum("li,i,li->l", solved, mass, vector) / norm**2
        previous, value = value, np.where(norm > 0, quotient, value)
        vector = solved / norm[:, None]
        if sweep > 1:
            inside = (value >= low) & (value <= high) & np.isfinite(norm)
            good = (np.abs(value - previous) <= RELATIVE * np.maximum(np.abs(value), 1e-3)) & inside
            if good.all():
                break
        # a shift equal to the eigenvalue would be singular: stay a little below
        near = (value > bottom) & (value < high + 0.5 * (high - low))
        closer = value - 1e-3 * (high - low)
        shift = np.where(near & (sweep > 2), np.maximum(closer, bottom), bottom)
    return np.asarray(value), good
