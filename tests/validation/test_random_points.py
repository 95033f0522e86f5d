"""No stable state that an independent search finds with ten times the effort lacks in a set.

A stable state is one that a structure can stand in, so that one which is missing would mislead.
"""

import numpy as np
import pytest

from equimorph.equilibria import find_equilibria
from equimorph.manifold import EquilibriumSet, equilibrium_set
from equimorph.model import Box
from equimorph.structures import Spring, Truss
from sets import arch_set
from typecheck import unchecked

TEN_TIMES = 2000
"""Random starts of each search; 200 by default."""
APART = 1e-5


def missing(eset: EquilibriumSet, points: int) -> list[dict[str, float]]:
    """Random points over which the search finds stable states that the set lacks."""
    random = np.random.default_rng(11)
    at = random.uniform(eset.box.lower, eset.box.upper, (points, len(eset.names)))
    known = eset.over(**dict(zip(eset.names, at.T, strict=True)))
    structure, lacking = eset.structure, []
    for number, here in enumerate(known):
        point = dict(zip(eset.names, at[number].tolist(), strict=True))
        found = find_equilibria(
            structure, {**eset.fixed, **point}, within=eset.constraints, starts=TEN_TIMES
        ).stable
        du = (found.z[:, None] - here.states.z[None])[:, :, : structure.unknowns]
        gap = np.sqrt((du**2 @ structure.mass).min(axis=1, initial=np.inf))
        if (gap > APART).any():
            lacking.append(point)
    return lacking


@pytest.mark.slow
def test_spring_over_load_and_actuator_lacks_no_stable_state():
    with unchecked():
        eset = equilibrium_set(Spring(), Box(x_l=(0.3, 1.3), F=(-0.5, 0.5)), intervals=(12, 12))
        assert missing(eset, 100) == []


@pytest.mark.slow
def test_arch_lacks_no_stable_state():
    with unchecked():
        assert missing(arch_set((24, 41), checks=2), 40) == []


@pytest.mark.slow
def test_truss_under_two_loads_lacks_no_stable_state():
    """Two shallow pairs of bars side by side, tied at the top: each can snap by itself."""
    truss = Truss(
        {"A": (-2, 0), "B": (-1, 0.1), "C": (0, 0), "D": (1, 0.12), "E": (2, 0)},
        [("A", "B"), ("B", "C"), ("C", "D"), ("D", "E"), ("B", "D")],
        {"A": "xy", "C": "xy", "E": "xy"},
        {"F": {"B": (0, -1)}, "G": {"D": (0, -1)}},
    )
    with unchecked():
        eset = equilibrium_set(truss, Box(F=(-4e-4, 8e-4), G=(-4e-4, 8e-4)), intervals=(13, 14))
        assert missing(eset, 12) == []
