"""Symmetries of general rods, found by comparing their Lagrangian with its mirror images."""

from collections.abc import Callable
from itertools import product

import numpy as np
from jaxtyping import Float

from equimorph.arrays import Lanes, Parameters
from equimorph.structures.contract import Symmetry
from equimorph.structures.rod.model import RodModel
from equimorph.tolerances import SAME_NUMBER

Matrix = Float[np.ndarray, "scalars scalars"]

CANDIDATES = (("mirror", True, -1.0), ("reflection", False, -1.0), ("half turn", True, 1.0))
"""θ(s) → −θ(1 − s): left and right; θ → −θ: up and down; θ(s) → θ(1 − s): both."""


def mirrors(model: RodModel, unknowns: int) -> tuple[Symmetry, ...]:
    """Symmetries among the `CANDIDATES` that the rod has, with their maps of the parameters."""
    found = []
    for name, reverse, sign in CANDIDATES:
        matrix = _scalar_map(model, reverse=reverse, sign=sign)
        if matrix is not None:
            own = matrix[model.multipliers : -1, model.multipliers : -1]
            apply = _symmetry_map(matrix, unknowns, reverse=reverse, sign=sign)
            found.append(Symmetry(name, apply, own.sum(axis=0), np.abs(own).argmax(axis=0)))
    return tuple(found)


def _symmetry_map(
    matrix: Matrix, unknowns: int, *, reverse: bool, sign: float
) -> Callable[[Lanes, Parameters], tuple[Lanes, Parameters]]:
    def apply(z: Lanes, p: Parameters) -> tuple[Lanes, Parameters]:
        m = z.shape[1] - unknowns
        y = np.concatenate([z[:, unknowns:], p, np.ones((len(z), 1))], axis=1)
        image = np.einsum("lj,jk->lk", y, matrix)
        theta = sign * (z[:, :unknowns][:, ::-1] if reverse else z[:, :unknowns])
        return np.concatenate([theta, image[:, :m]], axis=1), np.ascontiguousarray(image[:, m:-1])

    return apply


def _features(model: RodModel, *, reverse: bool, sign: float) -> Float[np.ndarray, "scalars some"]:
    """Coefficients of all scalars, in the image of the rod."""
    step, mirrored = -1 if reverse else 1, np.diag([1.0, sign])
    parts = (
        sign * model.sine[:, ::step],
        model.cosine[:, ::step],
        model.tension[:, ::step],
        sign * model.slope[:, ::step],
        sign * model.turned.T[:, ::step],
        sign * step * model.pressure[:, None],
        model.pressure[:, None] * (mirrored @ model.closing @ mirrored).ravel(),
    )
    return np.concatenate(parts, axis=1)


def _equal(a: np.ndarray, b: np.ndarray) -> bool:
    largest = max(np.abs(a).max(initial=0.0), np.abs(b).max(initial=0.0))
    return bool(np.abs(a - b).max(initial=0.0) <= SAME_NUMBER * largest)


def _scalar_map(model: RodModel, *, reverse: bool, sign: float) -> Matrix | None:
    """Matrix T that takes scalars to those of the image, ``y T``; None if no such T exists.

    Parameters change their sign, or places two by two; multipliers may take up a share of loads.
    """
    if reverse and not _reversible(model):
        return None
    here = _features(model, reverse=False, sign=1.0)
    image = _features(model, reverse=reverse, sign=sign)
    m, count = model.multipliers, model.scalars
    matrix = np.zeros((count, count))
    for j in range(count):
        row = _row_of_map(j, here, image, m, last=j == count - 1)
        if row is None:
            return None
        matrix[j] = row
    # a scalar without coefficients changes its sign with the multiplier that it belongs to
    for j in range(m, count - 1):
        beside = model.quadratic[:m, j]
        if not here[j].any() and beside.any():
            matrix[j, j] = matrix[np.argmax(np.abs(beside)), np.argmax(np.abs(beside))]
    own = matrix[m:, m:]
    if not np.array_equal(own @ own, np.eye(count - m)):
        return None
    moved = matrix[:m] @ model.quadratic @ matrix.T
    return matrix if _equal(moved, model.quadratic[:m]) else None


def _row_of_map(
    j: int, here: np.ndarray, image: np.ndarray, m: int, *, last: bool
) -> Float[np.ndarray, " scalars"] | None:
    """Row j of the map: ± itself or another parameter, plus shares of the multipliers."""
    count = len(here)
    others = range(m, count - 1) if m <= j < count - 1 and here[j].any() else ()
    for k, own in product((j, *others), (1.0,) if last else (1.0, -1.0)):
        row = np.zeros(count)
        row[k] = own
        rest = here[j] - own * image[k]
        if j >= m > 0:
            row[:m] = np.linalg.lstsq(image[:m].T, rest, rcond=None)[0]
            row[:m][np.abs(row[:m]) < SAME_NUMBER] = 0.0
        if _equal(here[j], row @ image):
            return row
    return None


def _reversible(model: RodModel) -> bool:
    """Whether stiffness, supports and mesh are symmetric."""
    flipped = model.stiffness[::-1, ::-1, ::-1]
    return (
        model.held[0] == model.held[1]
        and all(model.from_start)
        and _equal(model.stiffness, flipped)
        and _equal(model.softness, model.softness[::-1])
        and _equal(model.mesh.lengths, model.mesh.lengths[::-1])
    )
