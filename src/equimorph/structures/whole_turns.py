"""States that are the same but for whole turns, which one of them stands for.

What nothing keeps from turning may turn over and over: a rod between pins, a member hinged at both
ends, a hinge in space. Every state has copies then, which are no states that a search lacks.

See docs/decisions.md, "States that differ by whole turns are one to a search".
"""

import numpy as np

from equimorph.arrays import Lanes
from equimorph.linalg.dense import multiply
from equimorph.structures.contract import Structure

ASIDE = 0.03
"""By how much more than half a turn back is taken, in turns: symmetric states have turned by whole
quarters, and round-off is not to choose between two copies of them."""


def taken_back(structure: Structure, z: Lanes) -> Lanes:
    """The same states, turned by about half a turn at most, on an average over what turns."""
    turns = structure.whole_turns
    if len(turns) == 0:
        return z
    turned = multiply(z, (turns / (turns**2).sum(axis=1, keepdims=True)).T)
    return np.asarray(z - multiply(np.floor(turned + 0.5 + ASIDE), turns))
