"""Newton–Kantorovich bounds on straight segments in parameter space.

On a segment p(t) the chord z̄(t) between two equilibria is compared with Newton's operator
T(z) = z − A F(z; p(t)), A about the inverse of F_z at the middle. With ‖T(z̄) − z̄‖ ≤ Y on the chord
and ‖I − A F_z‖ ≤ Z < 1 in a tube around it, one equilibrium lies within r = Y/(1 − Z) of the chord
for every t, if the tube is wider, and none else in the tube; as no F_z in it is singular, F_z keeps
its inertia [DayLessardMischaikow2007]_.
With errors the chord becomes a box of chords z̄(t) + Z(t) ε, p(t) + P ε, |ε| ≤ 1, with the linear
responses Z at the ends: every chord is straight for itself, so that the same bounds hold for all.
All bounds are componentwise, in the maximum norm with weights s, so that they hold in z as it is.

F, F_z and F_p are enclosed over boxes with outward rounding, and so is all that follows from them,
where the structure has an `enclosure`; else they are sampled, which proves nothing.
See docs/decisions.md, "Proofs are componentwise, and round outward".
"""

from dataclasses import dataclass

import numpy as np

from equimorph.arrays import Flags, Float, Int, Lanes, Parameters, Values
from equimorph.columns import Columns
from equimorph.linalg.intervals import MORE, Interval, product
from equimorph.structures import Enclosed, States, Structure
from equimorph.tasks.verification.error_box import ErrorBox, Responses, enclose

Matrices = Float[np.ndarray, "lanes size size"]

SWEEPS = 5
"""Power iterations towards the best weights."""
LEAST_WEIGHT = 1e-3
"""Least weight relative to the largest: no unknown may count for nothing."""
ROOM = 4.0
"""Half width of the tubes around the chord, in units of the defect."""
LEAST_REACH = 1e-9
"""Least half width of a tube."""
SHARES = (0.95, 0.9, 0.8, 0.6, 0.4, 0.2)
"""Parts of the margin at the ends of a segment that are tried as bounds on it."""


@dataclass(frozen=True)
class Bounds(Columns):
    """What is known of segments."""

    proved: Flags
    """Whether one equilibrium exists and is unique near every point of the chord."""
    error: Values
    """Largest distance r of the equilibria from the chord, in multiples of the weights."""
    unique: Values
    """Distance within which they are the only ones."""
    at_ends: Float[np.ndarray, "lanes 2"]
    """Distance of the equilibria from the given states at both ends."""
    stable: Flags
    """Whether the index is 0 all along."""
    weights: Lanes
    """s: entry by entry, z lies within r s of the chord."""
    margin: Values
    """Stability margin that is kept all along, 0 if none was proved."""


def segment_bounds(
    first: States, last: States, target: float | None = 0.0, errors: ErrorBox | None = None
) -> Bounds:
    """Bounds on the segments between pairs of equilibria, for all errors in a box around them.

    The `target` margin is tried as well; None: no margin is sought, beyond the index 0. With the
    same states first and last the bounds are those of boxes of parameters.
    """
    structure = first.structure
    box = errors or ErrorBox.none(first)
    with np.errstate(invalid="ignore", over="ignore", divide="ignore"):
        amid = (Interval.at(0.5 * (one + other)) for one, other in _pairs(first, last))
        inverse = spectral_inverse(box.enclose(structure, *amid).matrix.middle)[0]
        turns = [box.responses(each) for each in (first, last)]
        boxes = [_around(each, turn, box) for each, turn in zip((first, last), turns, strict=True)]
        chord, way = (Interval.union(*each) for each in zip(*boxes, strict=True))
        near = box.enclose(structure, chord, way)
        weights = _weights(inverse, near.matrix.radius)
        given = zip((first, last), boxes, turns, strict=True)
        ends = [_defect(inverse, box, *each) for each in given]
        dz = (Interval.at(last.z) - first.z).size + MORE * np.abs(turns[1] - turns[0]).sum(axis=1)
        sag = _sag(inverse, near, dz, (Interval.at(last.p) - first.p).size)
        defect = _norm(np.maximum(*ends) + sag, weights)
        reach = ROOM * defect + LEAST_REACH
        tube = reach[:, None] * weights
        matrix = box.enclose(structure, chord + Interval(-tube, tube), way).matrix
        left = 1.0 - contraction(inverse, matrix, weights)
        error = MORE * defect / left
        proved = (left > 0.0) & (error <= reach) & np.isfinite(error)
        at_ends = np.stack([MORE * _norm(each, weights) / left for each in ends], axis=1)
        stable, margin = _margins(structure, matrix, first, last, proved, target)
    unique = np.where(left > 0.0, reach, 0.0)
    return Bounds(proved, error, unique, at_ends, stable, weights, margin)


def _pairs(first: States, last: States) -> tuple[tuple[Lanes, Lanes], ...]:
    return (first.z, last.z), (first.p, last.p)


def _around(states: States, turns: Responses, box: ErrorBox) -> tuple[Interval, Interval]:
    """Boxes of the states and parameters that errors lead to."""
    reach = np.abs(turns).sum(axis=1) * MORE
    return Interval.around(states.z, reach), Interval.around(states.p, box.widths * MORE)


def spectral_inverse(matrix: Matrices) -> tuple[Matrices, Matrices]:
    """About the inverse of symmetric matrices; and eigenvectors over the roots of |eigenvalues|."""
    values, vectors = np.linalg.eigh(np.nan_to_num(matrix, posinf=0.0, neginf=0.0))
    scaled = vectors / np.sqrt(np.abs(values))[:, None]
    return np.asarray((scaled * np.sign(values)[:, None]) @ scaled.transpose(0, 2, 1)), scaled


def contraction(inverse: Matrices, matrix: Interval, weights: Lanes) -> Values:
    """Bound of ‖I − A M‖ for all matrices M within bounds."""
    gap = (np.eye(inverse.shape[1]) - product(inverse, matrix)).size
    return _norm(apply(gap, weights), weights)


def apply(
    matrix: Float[np.ndarray, "lanes size any"], rows: Float[np.ndarray, "lanes any"]
) -> Lanes:
    """Upper bound of the product of matrices and columns that are not negative."""
    return np.asarray((matrix @ rows[:, :, None])[:, :, 0] * MORE)


def _norm(rows: Lanes, weights: Lanes) -> Values:
    return np.asarray((rows / weights).max(axis=1, initial=0.0) * MORE)


def _weights(inverse: Matrices, radius: Matrices) -> Lanes:
    """Weights in which a change of F_z counts least: the Perron vector of |A| times it."""
    weights = np.ones(radius.shape[:2])
    for _ in range(SWEEPS):
        new = apply(np.abs(inverse), apply(radius, weights))
        size = new.max(axis=1, keepdims=True)
        weights = np.where((size > 0.0) & (size < np.inf), new / size, 1.0)
        weights = np.maximum(weights, LEAST_WEIGHT)
    return np.asarray(weights)


def _defect(
    inverse: Matrices,
    box: ErrorBox,
    end: States,
    around: tuple[Interval, Interval],
    turns: Responses,
) -> Lanes:
    """|A F| at given states, with what their linear responses to the errors leave."""
    structure = end.structure
    found = enclose(structure, Interval.at(end.z), Interval.at(end.p)).residual
    defect = product(inverse, found[:, :, None])[:, :, 0].size
    if turns.shape[1]:
        rest = box.remainder(box.enclose(structure, *around), turns).transpose(0, 2, 1)
        defect = defect + product(inverse, rest).size.sum(axis=2)
    return defect * MORE


def _sag(inverse: Matrices, near: Enclosed, dz: Lanes, dp: Parameters) -> Lanes:
    """Largest departure of A F from its chord between the ends, dz and dp apart.

    Its slope along the chord stays within ρ of a constant, so that it leaves its own chord by no
    more than ρ/2.
    """
    moved = near.columns.radius[:, :, : dp.shape[1]]
    change = apply(near.matrix.radius, dz) + apply(moved, dp)
    return 0.5 * MORE * apply(np.abs(inverse), change)


def _margins(
    structure: Structure,
    matrix: Interval,
    first: States,
    last: States,
    proved: Flags,
    target: float | None,
) -> tuple[Flags, Values]:
    """Whether F_z keeps index 0 in the tubes; the largest tried σ for which F_z − σ·mass does.

    Fractions of the smaller margin of the ends are tried; where the demanded margin lies between
    the best fraction and the smaller margin, also the demanded one.
    """
    kept = np.zeros(len(proved))
    if target is None:
        stable = proved.copy()
        stable[proved] = keeps_margin(structure, matrix[proved], kept[proved])
        return stable, kept
    least = np.where(proved, np.minimum(first.margin, last.margin), 0.0)
    for share in SHARES:
        todo = np.flatnonzero((kept == 0.0) & (least > 0.0))
        shift = share * least[todo]
        kept[todo] = np.where(keeps_margin(structure, matrix[todo], shift), shift, 0.0)
    near = np.flatnonzero((kept < target) & (least > target))
    good = keeps_margin(structure, matrix[near], np.full(len(near), target))
    kept[near[good]] = target
    return kept > 0.0, kept


def keeps_margin(structure: Structure, matrix: Interval, margin: Values) -> Flags:
    """Whether all F_z within bounds have index 0 and more than a margin.

    F_z − σ·mass is regular for all of them, and the inertia of one of them is known.
    """
    size, mass = structure.size, np.zeros(structure.size)
    mass[: structure.unknowns] = structure.mass
    shift = (Interval.at(margin)[:, None] * mass)[:, :, None] * np.eye(size)
    moved = matrix - shift
    centre = moved.middle
    inverse, scaled = spectral_inverse(centre)
    good = contraction(inverse, moved, _weights(inverse, moved.radius)) < 1.0
    good[good] = negatives(centre[good], scaled[good]) == structure.constraints
    return np.asarray(good)


def negatives(matrix: Matrices, scaled: Matrices) -> Int[np.ndarray, " lanes"]:
    """Number of negative eigenvalues of symmetric matrices; −1 where it is not certain.

    By Sylvester's law of inertia it is that of VᵀMV, with V the given eigenvectors, whose
    Gershgorin discs avoid zero.
    """
    turned = product(scaled.transpose(0, 2, 1), product(matrix, Interval.at(scaled)))
    diagonal = np.einsum("lii->li", turned.low), np.einsum("lii->li", turned.high)
    discs = turned.size.sum(axis=2) * MORE - turned.size.diagonal(axis1=1, axis2=2)
    below, above = diagonal[1] < -discs, diagonal[0] > discs
    return np.where((below | above).all(axis=1), below.sum(axis=1), -1)
