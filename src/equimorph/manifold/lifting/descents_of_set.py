"""Descents from the unstable strata of a set, which may land on sheets that it lacks.

See docs/decisions.md, "Sets are checked by descents".
"""

from collections import Counter
from collections.abc import Container
from dataclasses import dataclass

import numpy as np

from equimorph.arrays import Float, Int, Some
from equimorph.equilibria.descents import descend
from equimorph.equilibria.gradient_flow import Ending
from equimorph.equilibria.settle import lower_index
from equimorph.manifold.complex.equilibrium_set import EquilibriumSet
from equimorph.manifold.geometry.points import VertexKind
from equimorph.model import are_feasible
from equimorph.structures import States, join_states

VERTICES = 8
"""Vertices of each stratum that is probed, far from each other."""
MOST = 50
"""Strata, the largest ones, and folds from which is probed: a set may be in shreds."""
BISECTIONS = 2
"""Rounds in which vertices between neighbours are added whose descents land on other strata."""
NOWHERE = -1
"""Instead of a stratum: the descent does not land on the set."""
FOLD = -1
"""Instead of a stratum: the vertex lies on a fold."""
INNER = (VertexKind.GRID, VertexKind.BETWEEN, VertexKind.AMID, VertexKind.REFINED)
"""Vertices that lie on nothing where a stratum ends."""
WORDS = {
    Ending.SADDLE: "ended at a saddle",
    Ending.ESCAPED: "left the box of guesses",
    Ending.STUCK: "stuck",
    Ending.SLOW: "slow",
}
"""How descents end that do not land."""


@dataclass(frozen=True)
class SetDescents:
    """Descents from vertices of a set.

    landed: stable states where they land, each over its own point, within the constraints;
    outcomes: how many ended how.
    """

    landed: States
    outcomes: tuple[tuple[str, int], ...]


@dataclass(frozen=True)
class _Tried:
    """Vertices that were tried, their strata, and those on which they land, both ways."""

    vertices: Some
    stratum: Some
    target: Int[np.ndarray, "2 some"]


def descents_of_set(eset: EquilibriumSet) -> SetDescents:
    """Descents both ways from some vertices of every stratum of index one, and of every fold.

    Between neighbours that land on different strata further vertices are tried: there a sheet may
    begin that the set lacks.
    """
    vertices, stratum = _first(eset)
    tried = _Tried(vertices[:0], stratum[:0], np.zeros((2, 0), int))
    states, outcomes = [eset.points[:0]], Counter[str]()
    for _ in range(BISECTIONS + 1):
        if len(vertices) == 0:
            break
        landed, target = _landings(eset, vertices, outcomes)
        states.append(landed)
        tried = _Tried(
            np.append(tried.vertices, vertices),
            np.append(tried.stratum, stratum),
            np.append(tried.target, target, axis=1),
        )
        vertices, stratum = _between(eset, tried)
    return SetDescents(join_states(eset.structure, states), tuple(sorted((+outcomes).items())))


def _first(eset: EquilibriumSet) -> tuple[Some, Some]:
    """Vertices spread over each stratum of index one, and one on each fold of a stable stratum."""
    chosen, stratum = [np.zeros(0, int)], [np.zeros(0, int)]
    for number, own in spread_over_strata(eset, {1}):
        chosen.append(own)
        stratum.append(np.full(len(own), number))
    middles = np.array([fold.flat[fold.size // 2] for fold in eset.folds[:MOST]], int)
    lower = lower_index(eset.structure, eset.points.z[middles], eset.points.p[middles])
    stable = middles[lower == 0]
    chosen.append(stable)
    stratum.append(np.full(len(stable), FOLD))
    return np.concatenate(chosen), np.concatenate(stratum)


def spread_over_strata(eset: EquilibriumSet, indices: Container[int]) -> list[tuple[int, Some]]:
    """Numbers of the largest strata of these indices, with vertices spread over each."""
    chosen = [number for number, piece in enumerate(eset.strata) if piece.index in indices]
    chosen.sort(key=lambda number: -eset.strata[number].cells)
    inside = {number: _inside(eset, number) for number in chosen[:MOST]}
    return [
        (number, own[_spread(eset.coordinates[own] / _scales(eset), VERTICES)])
        for number, own in inside.items()
    ]


def _inside(eset: EquilibriumSet, stratum: int) -> Some:
    """Vertices of a stratum off its boundary."""
    own = np.unique(eset.cells[eset.stratum == stratum])
    return np.asarray(own[np.isin(eset.kinds[own], INNER)])


def _scales(eset: EquilibriumSet) -> Float[np.ndarray, " d"]:
    return np.asarray(eset.box.upper - eset.box.lower)


def _spread(places: Float[np.ndarray, "n d"], count: int) -> Some:
    """Numbers of places far from each other: each is the farthest from those before."""
    chosen: list[int] = []
    distance = np.full(len(places), np.inf)
    for _ in range(min(count, len(places))):
        chosen.append(int(distance.argmax()))
        gap = np.linalg.norm(places - places[chosen[-1]], axis=1)
        distance = np.minimum(distance, gap)
    return np.array(chosen, int)


def _landings(
    eset: EquilibriumSet, vertices: Some, outcomes: Counter[str]
) -> tuple[States, Int[np.ndarray, "2 some"]]:
    """Stable states where descents land, and their strata; counts how the descents end."""
    structure, p = eset.structure, eset.points.p[vertices]
    led = descend(structure, eset.points.z[vertices], p)
    code, z, both = led.code.ravel(), led.z.reshape(-1, structure.size), np.tile(p, (2, 1))
    for ending, word in WORDS.items():
        outcomes[word] += int((code == ending).sum())
    at = np.flatnonzero(code == Ending.LANDED)
    resolved = structure.resolved(z[at], both[at])
    within = resolved & are_feasible(eset.constraints, z[at], both[at])
    outcomes["landed where states are not resolved"] += int((~resolved).sum())
    outcomes["landed beyond the constraints"] += int((resolved & ~within).sum())
    outcomes["landed"] += int(within.sum())
    landed = States(structure, z[at[within]], both[at[within]])
    target = np.full(len(code), NOWHERE)
    target[at[within]] = _strata(eset, landed)
    return landed, target.reshape(2, -1)


def _strata(eset: EquilibriumSet, states: States) -> Some:
    """Strata of states over their own points; `NOWHERE` for those that the set lacks."""
    known, cell = eset.holding(states)
    out = np.full(len(states), NOWHERE)
    sure = known & (cell >= 0)
    out[sure] = eset.stratum[cell[sure]]
    return out


def _between(eset: EquilibriumSet, tried: _Tried) -> tuple[Some, Some]:
    """Vertices halfway between nearest neighbours of a stratum that land on different strata."""
    found: dict[int, int] = {}
    for number in np.unique(tried.stratum[tried.stratum != FOLD]):
        mine, own = np.flatnonzero(tried.stratum == number), _inside(eset, int(number))
        places = eset.coordinates[own] / _scales(eset)
        here = eset.coordinates[tried.vertices[mine]] / _scales(eset)
        gaps = np.linalg.norm(here[:, None] - here[None], axis=2)
        np.fill_diagonal(gaps, np.inf)
        for one, other in enumerate(gaps.argmin(axis=1) if len(mine) > 1 else []):
            if (tried.target[:, mine[one]] != tried.target[:, mine[other]]).any():
                middle = 0.5 * (here[one] + here[other])
                found[int(own[np.linalg.norm(places - middle, axis=1).argmin()])] = int(number)
    new = np.setdiff1d(np.array(list(found), int), tried.vertices)
    return new, np.array([found[int(vertex)] for vertex in new], int)
