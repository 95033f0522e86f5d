"""Symmetries of rods, found by comparing their Lagrangian with its mirror images.

A Lagrangian is linear in its *scalars* (multipliers, parameters and 1) with coefficients along the
rod, plus a quadratic form of the scalars; see `RodModel` and `SpatialModel`.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import product

import numpy as np

from equimorph.arrays import Float, Lanes, Parameters
from equimorph.structures.contract import Symmetry
from equimorph.structures.rod.lagrangian import RodLagrangian
from equimorph.structures.rod.model import RodModel
from equimorph.tolerances import SAME_NUMBER

Matrix = Float[np.ndarray, "scalars scalars"]
Features = Float[np.ndarray, "scalars some"]


@dataclass(frozen=True, eq=False)
class Reflection:
    """A candidate: its name, and the signs of the coordinates; x is reversed with the ends."""

    name: str
    signs: Float[np.ndarray, " axes"]

    @property
    def reverse(self) -> bool:
        """Whether the ends are exchanged."""
        return bool(self.signs[0] < 0.0)

    @property
    def step(self) -> int:
        """Step through the nodes."""
        return -1 if self.reverse else 1

    @property
    def none(self) -> "Reflection":
        """The identity."""
        return Reflection("", np.ones_like(self.signs))


def find_symmetries(
    model: RodLagrangian,
    unknowns: int,
    candidates: Sequence[Reflection],
    features: Callable[[Reflection], Features],
    image: Callable[[Reflection, Lanes], Lanes],
    tables: Sequence[tuple[np.ndarray, np.ndarray]],
) -> tuple[Symmetry, ...]:
    """Symmetries among the candidates that a rod has, with their maps of the parameters.

    `features`: coefficients of all scalars in the image of the rod; `image`: that of the unknowns;
    `tables`: stiffnesses as seen from either end.
    """
    found, here, lengths = [], features(candidates[0].none), model.mesh.lengths
    reversible = model.held[0] == model.held[1] and all(model.from_start)
    reversible &= all(is_equal(*each) for each in (*tables, (lengths, lengths[::-1])))
    for each in candidates:
        if each.reverse and not reversible:
            continue
        matrix = _scalar_map(model, here, features(each))
        if matrix is not None:
            own = matrix[model.multipliers : -1, model.multipliers : -1]
            apply = partial(_apply, matrix, unknowns, partial(image, each))
            found.append(Symmetry(each.name, apply, own.sum(axis=0), np.abs(own).argmax(axis=0)))
    return tuple(found)


def _apply(
    matrix: Matrix, unknowns: int, reflect: Callable[[Lanes], Lanes], z: Lanes, p: Parameters
) -> tuple[Lanes, Parameters]:
    m = z.shape[1] - unknowns
    y = np.concatenate([z[:, unknowns:], p, np.ones((len(z), 1))], axis=1)
    image = np.einsum("lj,jk->lk", y, matrix)
    moved = np.concatenate([reflect(z[:, :unknowns]), image[:, :m]], axis=1)
    return moved, np.ascontiguousarray(image[:, m:-1])


def _scalar_map(model: RodLagrangian, here: Features, image: Features) -> Matrix | None:
    """Matrix T that takes scalars to those of the image, ``y T``; None if no such T exists.

    Parameters change their sign, or places two by two; multipliers may take up a share of loads.
    """
    m, count = model.multipliers, len(here)
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
            k = np.argmax(np.abs(beside))
            matrix[j, j] = matrix[k, k]
    own = matrix[m:, m:]
    if not np.array_equal(own @ own, np.eye(count - m)):
        return None
    moved = matrix[:m] @ model.quadratic @ matrix.T
    return matrix if is_equal(moved, model.quadratic[:m]) else None


def _row_of_map(
    j: int, here: Features, image: Features, m: int, *, last: bool
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
        if is_equal(here[j], row @ image):
            return row
    return None


def is_equal(a: np.ndarray, b: np.ndarray) -> bool:
    """Whether all entries agree, relative to the largest of them."""
    largest = max(np.abs(a).max(initial=0.0), np.abs(b).max(initial=0.0))
    return bool(np.abs(a - b).max(initial=0.0) <= SAME_NUMBER * largest)


CANDIDATES = (
    Reflection("mirror", np.array([-1.0, 1.0])),
    Reflection("reflection", np.array([1.0, -1.0])),
    Reflection("half turn", np.array([-1.0, -1.0])),
)
"""θ(s) → −θ(1 − s): left and right; θ → −θ: up and down; θ(s) → θ(1 − s): both."""


def symmetries(model: RodModel, unknowns: int) -> tuple[Symmetry, ...]:
    """Symmetries among the `CANDIDATES` that the rod has."""
    stiff, soft = model.stiffness, model.softness
    tables = (stiff, stiff[::-1, ::-1, ::-1]), (soft, soft[::-1])
    features = partial(_features, model)
    return find_symmetries(model, unknowns, CANDIDATES, features, _image, tables)


def _image(by: Reflection, theta: Lanes) -> Lanes:
    return np.asarray(by.signs.prod() * theta[:, :: by.step])


def _features(model: RodModel, by: Reflection) -> Float[np.ndarray, "scalars some"]:
    """Coefficients of all scalars, in the image of the rod."""
    step, sign = by.step, by.signs.prod()
    mirrored = np.diag([1.0, sign])
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
