"""Symmetries of general planar rods."""

from functools import partial

import numpy as np

from equimorph.array_types import Float
from equimorph.arrays import Lanes
from equimorph.structures.contract import Symmetry
from equimorph.structures.rod.model import RodModel
from equimorph.structures.rod.reflections import Images, Reflection, find_symmetries, is_equal

CANDIDATES = (
    Reflection("mirror", np.array([-1.0, 1.0])),
    Reflection("reflection", np.array([1.0, -1.0])),
    Reflection("half turn", np.array([-1.0, -1.0])),
)
"""θ(s) → −θ(1 − s): left and right; θ → −θ: up and down; θ(s) → θ(1 − s): both."""


def symmetries(model: RodModel, unknowns: int) -> tuple[Symmetry, ...]:
    """Symmetries among the `CANDIDATES` that the rod has."""
    images = Images(partial(_features, model), _is_reversible(model), _image)
    return find_symmetries(model, unknowns, CANDIDATES, images)


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


def _is_reversible(model: RodModel) -> bool:
    """Whether stiffness, supports and mesh are symmetric."""
    return (
        model.held[0] == model.held[1]
        and all(model.from_start)
        and is_equal(model.stiffness, model.stiffness[::-1, ::-1, ::-1])
        and is_equal(model.softness, model.softness[::-1])
        and is_equal(model.mesh.lengths, model.mesh.lengths[::-1])
    )
