"""Symmetries of rods in space.

With a reflection M = diag(±1, ±1, ±1) a state R(s) has the image M R M, taken at s or at 1 − s: the
latter where M turns x round. Its strains are ± det(M) M u, its tangents ± M t with + at s.
"""

from functools import partial

import numpy as np

from equimorph.array_types import Float
from equimorph.arrays import Lanes
from equimorph.structures.contract import Symmetry
from equimorph.structures.rod.reflections import Images, Reflection, find_symmetries, is_equal
from equimorph.structures.spatial.model import SpatialModel

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
    """Symmetries among the `CANDIDATES` that the rod has."""
    images = Images(partial(_features, model), _is_reversible(model), _image)
    return find_symmetries(model, unknowns, CANDIDATES, images)


def _axial(by: Reflection) -> Float[np.ndarray, "3"]:
    """Signs of the vector part of quaternions, and of the angles twist, tilt, theta."""
    return np.asarray(by.signs.prod() * by.signs)


def _image(by: Reflection, unknowns: Lanes) -> Lanes:
    lanes, size = unknowns.shape
    q = unknowns.reshape(lanes, size // 4, 4)[:, :: by.step] * np.append(1.0, _axial(by))
    return np.asarray(q.reshape(lanes, size))


def _features(model: SpatialModel, by: Reflection) -> Float[np.ndarray, "scalars some"]:
    """Coefficients of all scalars, in the image of the rod."""
    rows, step = np.s_[:, :: by.step, :: by.step], by.step
    weights = model.mesh.element_weights[..., None]
    turned = _axial(by)[::-1, None] * model.turned[::step]
    parts = (
        (weights * model.force)[rows] * (step * by.signs),
        (weights * model.moment)[rows] * (step * _axial(by)),
        (weights[..., 0] * model.tension)[rows],
        (weights[..., 0] * model.torsion)[rows],
        np.moveaxis(turned, -1, 0),
    )
    return np.concatenate([each.reshape(model.scalars, -1) for each in parts], axis=1)


def _is_reversible(model: SpatialModel) -> bool:
    """Whether stiffnesses, supports and mesh are symmetric."""
    return (
        model.held[0] == model.held[1]
        and all(model.from_start)
        and is_equal(model.stiffness, model.stiffness[::-1, ::-1])
        and is_equal(model.softness, model.softness[::-1, ::-1])
        and is_equal(model.mesh.lengths, model.mesh.lengths[::-1])
    )
