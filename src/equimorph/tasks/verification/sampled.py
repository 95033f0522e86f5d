"""Bounds of second derivatives from samples, for structures that know none of their own."""

import numpy as np
from jaxtyping import Float

from equimorph.arrays import Lanes, Parameters
from equimorph.structures import Direction, Majorant, Structure

Tensor = Float[np.ndarray, "lanes size entries entries"]

MOST_ENTRIES = 80
"""Unknowns, multipliers and parameters up to which all second derivatives are formed."""
CORNERS = 4
SAFETY = 2.0
"""Factor on the largest change of a second derivative seen in the box."""


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


def can_be_sampled(structure: Structure) -> bool:
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
