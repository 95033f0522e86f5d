"""Mirror images of networks of joints, and tests for symmetric structures."""

from collections.abc import Callable, Iterator, Sequence
from itertools import product

import numpy as np

from equimorph.array_types import Float, Int
from equimorph.arrays import Lanes, Parameters
from equimorph.structures.contract import Structure
from equimorph.tolerances import SAME_NUMBER

Apply = Callable[[Lanes, Parameters], tuple[Lanes, Parameters]]
Signs = Float[np.ndarray, " space"]
Joints = Int[np.ndarray, " joints"]
Ends = Int[np.ndarray, "edges 2"]

NAMES: dict[tuple[int, ...], str] = {
    (-1, 1): "mirror",
    (1, -1): "reflection",
    (-1, -1): "half turn",
}


def images(places: Float[np.ndarray, "joints space"]) -> Iterator[tuple[str, Signs, Joints]]:
    """Reflections and half turns about the middle that take joints to joints.

    Yields
    ------
    Name, signs of the axes, and the joint in the place of whose image each joint comes to be.
    """
    middle = 0.5 * (places.min(axis=0) + places.max(axis=0))
    near = SAME_NUMBER * np.ptp(places, axis=0).max()
    for signs in product((1, -1), repeat=places.shape[1]):
        if min(signs) == 1:
            continue
        moved = middle + np.array(signs) * (places - middle)
        apart = np.abs(moved[:, None] - places).max(axis=2)
        there = apart.argmin(axis=1)
        if (apart.min(axis=1) <= near).all() and len(set(there.tolist())) == len(places):
            flipped = "".join(axis for axis, sign in zip("xyz", signs, strict=False) if sign < 0)
            yield NAMES.get(signs, f"image in {flipped}"), np.array(signs, float), there


def edges_of_image(ends: Ends, joints: Joints) -> Int[np.ndarray, " edges"] | None:
    """The edge on which each comes to lie in an image; None if one does not lie on any."""
    pairs = [frozenset(pair) for pair in ends.tolist()]
    moved = [frozenset(joints[list(pair)].tolist()) for pair in pairs]
    if set(moved) != set(pairs):
        return None
    return np.array([pairs.index(pair) for pair in moved])


def sign_between(a: np.ndarray, b: np.ndarray) -> float | None:
    """1 if two arrays are equal, −1 if one is minus the other, else None."""
    near = SAME_NUMBER * max(np.abs(a).max(initial=0.0), np.abs(b).max(initial=0.0))
    for sign in (1.0, -1.0):
        if np.abs(a - sign * b).max(initial=0.0) <= near:
            return sign
    return None


def parameter_exchange(
    here: Sequence[np.ndarray], image: Sequence[np.ndarray]
) -> tuple[Float[np.ndarray, " parameters"], Int[np.ndarray, " parameters"]] | None:
    """Signs and order (see `Symmetry`) of parameters whose effects have images among each other.

    None if an effect has no such image, or the image of the image is another one.
    """
    count = len(here)
    signs, order = np.zeros(count), np.full(count, -1)
    for k in range(count):
        for j in (k, *range(count)):  # stays where it is, if it may
            sign = sign_between(image[k], here[j])
            if sign is not None and order[j] < 0:
                signs[j], order[j] = sign, k
                break
    if (order < 0).any() or (order[order] != range(count)).any():
        return None
    return (signs, order) if (signs[order] == signs).all() else None


def is_symmetry(structure: Structure, apply: Apply) -> bool:
    """Whether an image of unknowns and parameters leaves the Lagrangian as it is.

    Tested at random points and along random directions there: with L the same, D L at the image
    along the image of a direction is that at the point along the direction.
    """
    generator = np.random.default_rng(20)
    count, n = 6, structure.unknowns
    z = 0.1 * generator.normal(size=(count, structure.size))
    z[:, :n] /= np.sqrt(structure.mass * n)
    p = 0.1 * generator.normal(size=(count, len(structure.parameters))) * structure.scales
    dz = generator.normal(size=z.shape)
    there, at = apply(z, p)
    # images are affine in (z, p): their linear part is the difference of two of them
    moved = apply(z + dz, p)[0] - there
    here = (structure.residual(z, p) * dz).sum(axis=1)
    image = (structure.residual(there, at) * moved).sum(axis=1)
    size = np.abs(structure.residual(z, p) * dz).sum(axis=1)
    return bool((np.abs(here - image) <= SAME_NUMBER * size).all())
