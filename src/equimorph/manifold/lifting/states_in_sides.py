"""Equilibria over the sides of a box, where sheets enter it that lie beyond it but for a strip.

See docs/decisions.md, "Sides are searched like the box".
"""

from collections.abc import Iterator
from itertools import combinations, product

import numpy as np

from equimorph.arrays import Flags, Int, Place
from equimorph.equilibria.critical import Critical, null_border
from equimorph.equilibria.settle import Guards, free_directions, settle
from equimorph.manifold.complex.equilibrium_set import EquilibriumSet
from equimorph.model import Box, are_feasible
from equimorph.structures import States, join_states
from equimorph.tolerances import SAME_SOLUTION

ITERATIONS = 40
"""Of Newton's method from random guesses, at most."""


def states_in_sides(eset: EquilibriumSet, count: int, generator: np.random.Generator) -> States:
    """Equilibria to which Newton leads from random guesses over sides, edges and corners of a box.

    The parameters that vary there are free as well. A piece that reaches into the box through a
    side, however little, meets the side; where it is as narrow there, an edge or a corner of it.
    """
    structure, free, box = eset.structure, eset.setting.free, eset.box
    faces = list(_faces(box))
    each = -(-count // len(faces))
    found = []
    for held, values in faces:
        place = generator.uniform(box.lower, box.upper, (each, len(free)))
        place[:, held] = values
        p = eset.setting.parameters(place)
        moving = np.delete(free, held)
        directions = free_directions(structure, moving, each) if len(moving) else None
        guess, guards = structure.sample(p, generator), Guards(iterations=ITERATIONS)
        at = settle(structure, guess, p, directions, guards=guards, frames=False)
        good = at.found & box.holds(at.p[:, free])
        good[good] = are_feasible(eset.constraints, at.z[good], at.p[good])
        found.append(States(structure, at.z[good], at.p[good]))
    return join_states(structure, found)


def _faces(box: Box) -> Iterator[tuple[Int[np.ndarray, " k"], Place]]:
    """Sides, edges and corners of a box: parameters that are constant there, and their values."""
    sides = list(zip(box.lower, box.upper, strict=True))
    for count in range(1, len(sides) + 1):
        for held in combinations(range(len(sides)), count):
            for values in product(*(sides[k] for k in held)):
                yield np.array(held), np.array(values)


def are_grazing(states: States) -> Flags:
    """Which states are nearer to folds than states can be told apart.

    What lies over a side only so is not lifted: the sheets that meet there lie beyond it.
    """
    structure, z, p = states.structure, states.z, states.p
    critical = Critical(structure, z, p, null_border(structure, z, p))
    n = structure.unknowns
    length = np.sqrt(critical.v[:, :n] ** 2 @ structure.mass)
    near = np.abs(critical.g) * length <= SAME_SOLUTION * np.abs(critical.quadratic)
    return np.asarray(near)
