"""Symmetries of rods in space, found by comparing their Lagrangian with its mirror images.

With a reflection M = diag(±1, ±1, ±1) a state R(s) has the image M R M, taken at s or at 1 − s: the
latter where M turns x round. Its strains are ± det(M) M u, its tangents ± M t with + at s.
"""

from dataclasses import dataclass
from functools import partial
from itertools import product

import numpy as np
from jaxtyping import Float

from equimorph.arrays import Lanes, Parameters
from equimorph.structures.contract import Symmetry
from equimorph.structures.spatial.model import SpatialModel
from equimorph.tolerances import SAME_NUMBER

Matrix = Float[np.ndarray, "scalars scalars"]


@dataclass(frozen=True, eq=False)
class Reflection:
    """A candidate: its name, and the signs of x, y and z."""

    name: str
    signs: Float[np.ndarray, "3"]

    @property
    def reverse(self) -> bool:
        """Whether the ends are exchanged."""
        return bool(self.signs[0] < 0.0)

    @property
    def step(self) -> int:
        """Step through the nodes."""
        return -1 if self.reverse else 1

    @property
    def axial(self) -> Float[np.ndarray, "3"]:
        """Signs of the vector part of quaternions, and of the angles twist, tilt, theta."""
        return np.asarray(self.signs.prod() * self.signs)


CANDIDATES = (
    Reflection("mirror", np.array([-1.0, 1.0, 1.0])),
    Reflection("sideways mirror", np.array([1.0, 1.0, -1.0])),
    Reflection("half turn about y", np.array([-1.0, 1.0, -1.0])),
    Reflection("reflection", np.array([1.0, -1.0, 1.0])),
    Reflection("half turn about z", np.array([-1.0, -1.0, 1.0])),
    Reflection("half turn about x", np.array([1.0, -1.0, -1.0])),
    Reflection("inversion", np.array([-1.0, -1.0, -1.0])),
)


def symmetries(model: SpatialModel, unknowns: int) -> tuple[Symmetry, ...]:
    """Symmetries among the `CANDIDATES` that the rod has, with their maps of the parameters."""
    found = []
    for each in CANDIDATES:
        matrix = _scalar_map(model, each)
        if matrix is not None:
            own = matrix[model.multipliers : -1, model.multipliers : -1]
            apply = partial(_apply, matrix, unknowns, each)
            found.append(Symmetry(each.name, apply, own.sum(axis=0), np.abs(own).argmax(axis=0)))
    return tuple(found)


def _apply(
    matrix: Matrix, unknowns: int, by: Reflection, z: Lanes, p: Parameters
) -> tuple[Lanes, Parameters]:
    m = z.shape[1] - unknowns
    y = np.concatenate([z[:, unknowns:], p, np.ones((len(z), 1))], axis=1)
    image = np.einsum("lj,jk->lk", y, matrix)
    q = z[:, :unknowns].reshape(len(z), unknowns // 4, 4)[:, :: by.step] * np.append(1.0, by.axial)
    return np.concatenate(
        [q.reshape(len(z), unknowns), image[:, :m]], axis=1
    ), np.ascontiguousarray(image[:, m:-1])


def _features(model: SpatialModel, by: Reflection) -> Float[np.ndarray, "scalars some"]:
    """Coefficients of all scalars, in the image of the rod."""
    rows, step = np.s_[:, :: by.step, :: by.step], by.step
    weights = model.mesh.element_weights[..., None]
    turned = by.axial[::-1, None] * model.turned[::step]
    parts = (
        (weights * model.force)[rows] * (step * by.signs),
        (weights * model.moment)[rows] * (step * by.axial),
        (weights[..., 0] * model.tension)[rows],
        (weights[..., 0] * model.torsion)[rows],
        np.moveaxis(turned, -1, 0),
    )
    return np.concatenate([each.reshape(model.scalars, -1) for each in parts], axis=1)


def _scalar_map(model: SpatialModel, by: Reflection) -> Matrix | None:
    """Matrix T that takes scalars to those of the image, ``y T``; None if no such T exists.

    Parameters change their sign, or places two by two; multipliers may take up a share of loads.
    """
    if by.reverse and not _reversible(model):
        return None
    none = Reflection("", np.ones(3))
    here, image = _features(model, none), _features(model, by)
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
            k = np.argmax(np.abs(beside))
            matrix[j, j] = matrix[k, k]
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


def _reversible(model: SpatialModel) -> bool:
    """Whether stiffnesses, supports and mesh are symmetric."""
    lengths = model.mesh.lengths
    return (
        model.held[0] == model.held[1]
        and all(model.from_start)
        and _equal(model.stiffness, model.stiffness[::-1, ::-1])
        and _equal(model.softness, model.softness[::-1, ::-1])
        and _equal(lengths, lengths[::-1])
    )


def _equal(a: np.ndarray, b: np.ndarray) -> bool:
    largest = max(np.abs(a).max(initial=0.0), np.abs(b).max(initial=0.0))
    return bool(np.abs(a - b).max(initial=0.0) <= SAME_NUMBER * largest)
