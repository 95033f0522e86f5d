"""Profiles along the rod: stiffness, curvature, offsets, as a number, a table or a callable."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from jaxtyping import Float

from equimorph.errors import InputError
from equimorph.structures.rod.discretisation import Mesh
from equimorph.structures.rod.loads import LoadShape, LoadSpec, load_shape

ProfileSpec = float | LoadSpec
INWARD = 1e-13
"""Share of an element by which its ends are moved inward: at a jump each side has its own value."""


def profile(spec: Any, name: str, kinks: Sequence[float] = ()) -> LoadShape:
    """Profile f(s) of a number, a table [[s, f], ...] or a callable with its `kinks`.

    Raises
    ------
    InputError
        For a number that is not finite, or whatever `load_shape` refuses.
    """
    if isinstance(spec, str):
        raise InputError(f"`{name}` must be a number, a table or a callable; got {spec!r}.")
    if not isinstance(spec, int | float | np.integer | np.floating):
        return load_shape(spec, kinks, name, "f")
    value = float(spec)
    if not np.isfinite(value):
        raise InputError(f"`{name}` must be finite; got {spec!r}.")

    def constant(points: Float[np.ndarray, " points"]) -> Float[np.ndarray, " points"]:
        return np.full(points.shape, value)

    return LoadShape(value, constant, np.zeros(0))


def at_nodes(shape: LoadShape, mesh: Mesh) -> Float[np.ndarray, "elements order"]:
    """Values at the nodes of each element, one-sided at its ends."""
    t = INWARD + (1.0 - 2.0 * INWARD) * mesh.reference.nodes
    points = mesh.breaks[:-1, None] + mesh.lengths[:, None] * t
    return np.asarray(shape.density(points.ravel()).reshape(points.shape))


def inside(start: float, stop: float, mesh: Mesh) -> Float[np.ndarray, " elements"]:
    """1 for elements between two arclengths, 0 elsewhere; both are element ends."""
    middle = 0.5 * (mesh.breaks[1:] + mesh.breaks[:-1])
    return np.asarray(((start < middle) & (middle < stop)).astype(float))
