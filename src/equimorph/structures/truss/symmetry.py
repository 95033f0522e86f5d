"""Symmetries of trusses: mirror images and half turns."""

from functools import partial

import numpy as np
from jaxtyping import Float, Int

from equimorph.arrays import Lanes, Parameters
from equimorph.structures.contract import Symmetry
from equimorph.structures.images import exchanged, images, is_symmetry
from equimorph.structures.truss.mechanics import TrussMechanics


def symmetries(truss: TrussMechanics) -> tuple[Symmetry, ...]:
    """Mirror images that leave bars, supports, loads and actuators as they are, up to signs."""
    found = []
    for name, axes, joints in images(truss.network.places):
        places = _exchanged(truss, axes, joints)
        if places is None:
            continue
        apply = partial(_applied, truss, axes, joints, places)
        if is_symmetry(truss, apply):
            found.append(Symmetry(name, apply, *places))
    return tuple(found)


def _exchanged(
    truss: TrussMechanics, axes: Float[np.ndarray, " space"], joints: Int[np.ndarray, " joints"]
) -> tuple[Float[np.ndarray, " parameters"], Int[np.ndarray, " parameters"]] | None:
    """Signs and order of the parameters in the image; None if the image is another truss."""
    made = truss.network
    pairs = [frozenset(pair) for pair in made.ends.tolist()]
    turned = [frozenset(joints[list(pair)].tolist()) for pair in pairs]
    if set(pairs) != set(turned) or not np.array_equal(made.held[joints], made.held):
        return None
    there = [pairs.index(pair) for pair in turned]
    heres, mapped = [], []
    for rates, pulls in zip(truss.rates.T, truss.pulls, strict=True):
        forces = np.zeros(made.held.shape)
        forces[~made.held] = pulls
        image, moved = np.zeros_like(forces), np.zeros_like(rates)
        image[joints], moved[there] = axes * forces, rates
        heres.append(np.append(forces, rates))
        mapped.append(np.append(image, moved))
    return exchanged(heres, mapped)


def _applied(
    truss: TrussMechanics,
    axes: Float[np.ndarray, " space"],
    joints: Int[np.ndarray, " joints"],
    places: tuple[Float[np.ndarray, " parameters"], Int[np.ndarray, " parameters"]],
    z: Lanes,
    p: Parameters,
) -> tuple[Lanes, Parameters]:
    held, (signs, order) = truss.network.held, places
    moves = np.zeros((len(z), *held.shape))
    moves[:, ~held] = z
    image = np.zeros_like(moves)
    image[:, joints] = axes * moves
    return np.ascontiguousarray(image[:, ~held]), np.ascontiguousarray(signs * p[:, order])
