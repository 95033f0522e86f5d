"""Equilibria over the sides of a box, where sheets enter it that lie beyond it but for a strip.

See docs/decisions.md, "Sides are searched like the box".
"""

from collections.abc import Iterator
from itertools import combinations, groupby, product

import numpy as np

from equimorph.arrays import Flags, Int, Lanes, Parameters, Place
from equimorph.equilibria.critical import Critical, null_border
from equimorph.equilibria.random_search import from_afar
from equimorph.equilibria.settle import free_directions, settle
from equimorph.manifold.complex.equilibrium_set import EquilibriumSet
from equimorph.model import Box, are_feasible
from equimorph.structures import States, join_states
from equimorph.structures.metric import metric_length
from equimorph.tolerances import SAME_SOLUTION

Face = tuple[Int[np.ndarray, " k"], Place]
"""Parameters that are constant on a side, an edge or a corner, and their values."""


def states_in_sides(eset: EquilibriumSet, count: int, generator: np.random.Generator) -> States:
    """Equilibria to which Newton leads from random guesses over sides, edges and corners of a box.

    The parameters that vary there are free as well. A piece that reaches into the box through a
    side, however little, meets the side; where it is as narrow there, an edge or a corner of it.
    """
    structure, free, box = eset.structure, eset.setting.free, eset.box
    each = -(-count // sum(1 for _ in _faces(box)))
    found = []
    for held, faces in groupby(_faces(box), lambda face: len(face[0])):
        starts = [_guesses(eset, face, each, generator) for face in faces]
        p, guess, moving = (np.concatenate(column) for column in zip(*starts, strict=True))
        directions = free_directions(structure, moving, len(p)) if held < len(free) else None
        at = settle(structure, guess, p, directions, guards=from_afar(structure), frames=False)
        good = at.found & box.holds(at.p[:, free])
        good[good] = are_feasible(eset.constraints, at.z[good], at.p[good])
        found.append(States(structure, at.z[good], at.p[good]))
    return join_states(structure, found)


def _guesses(
    eset: EquilibriumSet, face: Face, count: int, generator: np.random.Generator
) -> tuple[Parameters, Lanes, Int[np.ndarray, "lanes k"]]:
    """Random parameters on a face, guesses over them, and the parameters that vary there."""
    (held, values), box, free = face, eset.box, eset.setting.free
    place = generator.uniform(box.lower, box.upper, (count, len(free)))
    place[:, held] = values
    p = eset.setting.parameters(place)
    p = p[eset.structure.in_reach(p)]
    return p, eset.structure.sample(p, generator), np.tile(np.delete(free, held), (len(p), 1))


def _faces(box: Box) -> Iterator[Face]:
    """Sides, edges and corners of a box, those of one kind after the other."""
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
    length = metric_length(structure, critical.v)
    near = np.abs(critical.g) * length <= SAME_SOLUTION * np.abs(critical.quadratic)
    return np.asarray(near)
