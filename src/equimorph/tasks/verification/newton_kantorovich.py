"""Newton–Kantorovich bounds on straight segments in parameter space.

On a segment p(t) the chord z̄(t) between two equilibria is compared with Newton's operator
T(z) = z − A⁻¹F(z; p(t)), A = F_z at the middle. With ‖T(z̄) − z̄‖ ≤ Y and ‖DT‖ ≤ Z₁ + Z₂ r within
distance r of the chord, ``Y + (Z₁ + Z₂ r) r ≤ r`` proves one equilibrium within r for every t; as
‖I − A⁻¹F_z‖ < 1 there, F_z stays regular and keeps the inertia of A [DayLessardMischaikow2007]_.
All bounds are componentwise, in the maximum norm with weights s, so that they hold in z as it is.

See docs/decisions.md, "Proofs are componentwise".
"""

from dataclasses import dataclass

import numpy as np

from equimorph.array_types import Float, Int
from equimorph.arrays import Flags, Lanes, Parameters, Values
from equimorph.columns import Columns
from equimorph.structures import Direction, Majorant, States, Structure

Matrices = Float[np.ndarray, "lanes size size"]

DIFFERENCE = 1e-4
"""Step of the central differences that give F_z independently of the solver."""
SWEEPS = 5
"""Power iterations towards the best weights."""
LEAST_WEIGHT = 1e-3
"""Least weight relative to the largest: no unknown may count for nothing."""
ROOM = 4.0
"""Half width of the boxes around the chord, in units of the defect."""
ROUNDING = 1e-13
"""Relative error assumed for every entry of F, and more than it ever is."""
SHARES = (0.95, 0.9, 0.8, 0.6, 0.4, 0.2)
"""Parts of the margin at the ends of a segment that are tried as bounds on it."""

Tensor = Float[np.ndarray, "lanes size entries entries"]

MOST_ENTRIES = 80
"""Unknowns, multipliers and parameters up to which all second derivatives are formed."""
CORNERS = 4
"""Random corners of each box at which second derivatives are sampled."""
SAFETY = 2.0
"""Factor on the largest change of a second derivative seen in the box."""


@dataclass(frozen=True)
class Bounds(Columns):
    """What is known of segments.

    Parameters
    ----------
    proved
        Whether one equilibrium exists and is unique near every point of the chord.
    error
        Largest distance r of the equilibria from the chord, in multiples of the weights.
    unique
        Distance within which they are the only ones.
    at_ends
        Distance of the equilibria from the given states at both ends.
    index
        Negative eigenvalues of the constrained Hessian all along.
    weights
        s: entry by entry, z lies within r s of the chord.
    margin
        Stability margin that is kept all along, 0 if none was proved.
    """

    proved: Flags
    error: Values
    unique: Values
    at_ends: Float[np.ndarray, "lanes 2"]
    index: Int[np.ndarray, " lanes"]
    weights: Lanes
    margin: Values


def segment_bounds(first: States, last: States, target: float = 0.0) -> Bounds:
    """Bounds on the segments between pairs of equilibria; the `target` margin is tried as well."""
    structure = first.structure
    middle = States(structure, 0.5 * (first.z + last.z), 0.5 * (first.p + last.p))
    half = 0.5 * np.abs(last.z - first.z), 0.5 * np.abs(last.p - first.p)
    matrix = _matrix(structure, middle)
    inverse, index = _inverse(structure, middle, np.zeros(len(first)))
    near = _majorant(structure, middle, (half[0] + 1e-6, half[1]))
    weights = _weights(inverse, near, half)
    defects, bend = _defect(first, last, inverse, matrix, near, half)
    defect = _norm(defects.max(axis=1) + bend, weights)
    reach = ROOM * defect + 1e-9
    bound = _majorant(structure, middle, (half[0] + reach[:, None] * weights, half[1]))
    still = np.zeros_like(half[1])
    off = _norm(np.abs(_unity_gap(inverse, matrix)) @ weights[:, :, None], weights)
    turn = off + _norm(_apply(inverse, bound(half, (weights, still))), weights)
    grow = _norm(_apply(inverse, bound((weights, still), (weights, still))), weights)
    room = (1.0 - turn) ** 2 - 4.0 * defect * grow
    root = np.sqrt(np.maximum(room, 0.0))
    error = 2.0 * defect / np.maximum(1.0 - turn + root, 1e-300)
    with np.errstate(divide="ignore"):
        unique = np.minimum(reach, np.maximum(1.0 - turn, 0.0) / np.maximum(grow, 1e-300))
    proved = (turn < 1.0) & (room > 0.0) & (error <= reach) & np.isfinite(error)
    ends = np.stack([_norm(each, weights) for each in np.moveaxis(defects, 1, 0)], axis=1)
    at_ends = 2.0 * ends / np.maximum(1.0 - turn, 1e-300)[:, None]
    tube = half[0] + np.where(proved, error, 0.0)[:, None] * weights, half[1]
    least = np.minimum(first.margin, last.margin)
    margin = _margins(middle, matrix, bound, tube, least, target)
    return Bounds(proved, error, unique, at_ends, index, weights, np.where(proved, margin, 0.0))


def _majorant(structure: Structure, middle: States, reach: Direction) -> Majorant:
    own = structure.second_derivative_bound(middle.z, middle.p, reach)
    return own or sampled_bound(structure, middle.z, middle.p, reach)


def _matrix(structure: Structure, middle: States) -> Matrices:
    """F_z by central differences of F."""
    lanes, size = middle.z.shape
    steps = DIFFERENCE * np.eye(size)
    p = np.repeat(middle.p, size, axis=0)
    ahead, behind = (
        structure.residual((middle.z[:, None] + sign * steps).reshape(-1, size), p)
        for sign in (1.0, -1.0)
    )
    rows = ((ahead - behind) / (2.0 * DIFFERENCE)).reshape(lanes, size, size)
    return np.ascontiguousarray(rows.transpose(0, 2, 1))


def _inverse(
    structure: Structure, middle: States, shift: Values
) -> tuple[Matrices, Int[np.ndarray, " lanes"]]:
    """Approximate inverse of F_z − shift·mass, and the index by its inertia."""
    units = np.tile(np.eye(structure.size), (len(middle), 1, 1))
    solved = structure.solve(middle.z, middle.p, units, shift=shift)
    columns = np.ascontiguousarray(solved.x.transpose(0, 2, 1))
    return columns, np.asarray(solved.negative - structure.constraints)


def _unity_gap(inverse: Matrices, matrix: Matrices) -> Matrices:
    return np.asarray(np.eye(matrix.shape[1]) - inverse @ matrix)


def _apply(inverse: Matrices, rows: Lanes) -> Lanes:
    """|A⁻¹| times rows ≥ 0."""
    return np.asarray((np.abs(inverse) @ rows[:, :, None])[:, :, 0])


def _norm(rows: Float[np.ndarray, "lanes size *one"], weights: Lanes) -> Values:
    return np.asarray((rows.reshape(weights.shape) / weights).max(axis=1, initial=0.0))


def _weights(inverse: Matrices, bound: Majorant, half: Direction) -> Lanes:
    """Weights in which the change of F_z along the chord counts least: its Perron vector."""
    weights = np.ones_like(half[0])
    still = np.zeros_like(half[1])
    for _ in range(SWEEPS):
        new = _apply(inverse, bound(half, (weights, still)))
        size = new.max(axis=1, keepdims=True)
        weights = np.where(size > 0.0, new / np.maximum(size, 1e-300), 1.0)
        weights = np.maximum(weights, LEAST_WEIGHT)
    return np.asarray(weights)


def _defect(
    first: States,
    last: States,
    inverse: Matrices,
    matrix: Matrices,
    bound: Majorant,
    half: Direction,
) -> tuple[Float[np.ndarray, "lanes 2 size"], Lanes]:
    """|A⁻¹F| at both ends with an allowance for rounding, and its largest increase between."""
    rows = []
    for end in (first, last):
        residual = end.structure.residual(end.z, end.p)
        rounding = ROUNDING * (np.abs(matrix) @ np.abs(end.z)[:, :, None])[:, :, 0]
        moved = (inverse @ residual[:, :, None])[:, :, 0]
        rows.append(np.abs(moved) + _apply(inverse, rounding))
    # a function with second derivative f″ leaves its chord by max|f″|/8; the whole step is 2 half
    bend = 0.5 * _apply(inverse, bound(half, half))
    return np.stack(rows, axis=1), bend


def _margins(
    middle: States,
    matrix: Matrices,
    bound: Majorant,
    tube: Direction,
    least: Values,
    target: float,
) -> Values:
    """Largest tried σ for which F_z − σ·mass keeps index 0 in the tubes.

    Fractions of the smaller margin of the ends are tried; where the demanded margin lies between
    the best fraction and the smaller margin, also the demanded one.
    """
    kept = np.zeros(len(middle))
    for share in SHARES:
        shift = np.where(least > 0.0, share * least, 0.0)
        good = _keeps(middle, matrix, bound, tube, shift) & (kept == 0.0)
        kept = np.where(good, shift, kept)
        if (kept > 0.0).all():
            break
    near = (kept < target) & (least > target)
    if near.any():
        good = _keeps(middle, matrix, bound, tube, np.where(near, target, 0.0)) & near
        kept = np.where(good, target, kept)
    return kept


def _keeps(
    middle: States, matrix: Matrices, bound: Majorant, tube: Direction, shift: Values
) -> Flags:
    """Whether segments keep more than a margin in their tubes."""
    structure = middle.structure
    still, mass = np.zeros_like(tube[1]), np.zeros(structure.size)
    mass[: structure.unknowns] = structure.mass
    inverse, index = _inverse(structure, middle, shift)
    weights = _weights(inverse, bound, tube)
    moved = matrix - np.eye(structure.size) * mass * shift[:, None, None]
    off = np.abs(_unity_gap(inverse, moved)) @ weights[:, :, None]
    change = _apply(inverse, bound(tube, (weights, still)))
    return np.asarray((_norm(off, weights) + _norm(change, weights) < 1.0) & (index == 0))


def sampled_bound(structure: Structure, z: Lanes, p: Parameters, reach: Direction) -> Majorant:
    """Bound of D²F from its values at the centres of boxes and at random corners.

    |D²F| at the centre and twice its largest change to a corner: an estimate, not a proof.
    """
    generator = np.random.default_rng(7)
    centre = _tensor(structure, z, p)
    change = np.zeros_like(centre)
    for _ in range(CORNERS):
        sides = [generator.choice([-1.0, 1.0], each.shape) * each for each in reach]
        there = _tensor(structure, z + sides[0], p + sides[1])
        change = np.maximum(change, np.abs(there - centre))
    table = np.abs(centre) + SAFETY * change

    def bound(v: Direction, w: Direction) -> Lanes:
        first, second = (np.concatenate(each, axis=1) for each in (v, w))
        return np.asarray(np.einsum("lijk,lj,lk->li", table, first, second, optimize=True))

    return bound


def allows_sampling(structure: Structure) -> bool:
    """Whether the second derivatives are few enough."""
    return structure.size + len(structure.parameters) <= MOST_ENTRIES


def _tensor(structure: Structure, z: Lanes, p: Parameters) -> Tensor:
    """All second derivatives of F by unknowns, multipliers and parameters."""
    lanes, size, count = len(z), structure.size, structure.size + len(structure.parameters)
    first, second = np.triu_indices(count)
    units = np.eye(count)
    table = np.empty((lanes, size, count, count))
    for lane in range(lanes):
        v, w = ((units[at, :size], units[at, size:]) for at in (first, second))
        here, there = (np.tile(each[lane], (len(first), 1)) for each in (z, p))
        values = structure.second_derivative(here, there, v, w).T
        table[lane][:, first, second] = values
        table[lane][:, second, first] = values
    return table
