"""Random guesses, each over its own point of the box: where Newton's method leads from them.

One state may attract nearly all guesses, which then say nothing about the others. So guesses that
led to what is not asked for, or is known, are pushed on: from beside the state that they reached,
with all states that they met deflated.

See docs/decisions.md, "Guesses are pushed on".
"""

from dataclasses import dataclass

import numpy as np

from equimorph.arrays import Float, Items, Lanes, Parameters
from equimorph.columns import Columns
from equimorph.equilibria.random_search import from_afar
from equimorph.equilibria.settle import Guards, free_directions, settle
from equimorph.manifold.complex.equilibrium_set import EquilibriumSet
from equimorph.model import are_feasible
from equimorph.structures import States, Structure

PER_FREE = 4
"""Number of guesses per guess that is corrected with the parameters free as well."""
PUSHES = 3
"""Times that a guess is pushed on."""
NUDGE = 0.02
"""Part of the way from a state back to the guess, where deflated Newton begins: at the state itself
it has no direction."""
DEFLATED = 30
"""Iterations of deflated Newton, at most; with half as many a fifth arrives."""


@dataclass(frozen=True)
class Arrivals(Columns):
    """Guesses over points, states to which they led, and unknowns of the states that each met."""

    guess: Lanes
    z: Lanes
    p: Parameters
    met: Float[np.ndarray, "lanes met unknowns"]

    def pushed(self, structure: Structure) -> "Arrivals":
        """Those that deflated Newton leads to states that they have not met."""
        start = self.z + NUDGE * (self.guess - self.z)
        away = settle(structure, start, self.p, guards=Guards(iterations=DEFLATED, known=self.met))
        found = away.found
        z = away.z[found]
        met = np.concatenate([self.met[found], z[:, None, : structure.unknowns]], axis=1)
        return Arrivals(self.guess[found], z, self.p[found], met)


@dataclass(frozen=True)
class Scattered:
    """What random guesses led to.

    found: states over the box, within the constraints, some of which the discretisation may not
    resolve; arrivals: the guesses at fixed parameters that led to a state, wherever it is.
    """

    found: States
    arrivals: Arrivals


def scatter(eset: EquilibriumSet, count: int, generator: np.random.Generator) -> Scattered:
    """Newton's method from random guesses, each over its own point of the box.

    Twice: at fixed parameters, and with all free ones free as well, onto the nearest piece of the
    set. The second finds closed pieces far smaller than a cell, over which no random point lies.
    """
    structure, free, box = eset.structure, eset.setting.free, eset.box
    p = eset.setting.parameters(generator.uniform(box.lower, box.upper, (count, len(free))))
    p = p[structure.in_reach(p)]
    guess, guards = structure.sample(p, generator), from_afar(structure)
    fixed = settle(structure, guess, p, guards=guards)
    some, led = slice(0, len(p) // PER_FREE), fixed.found
    directions = free_directions(structure, free, len(p[some]))
    freed = settle(structure, guess[some], p[some], directions, guards=guards, frames=False)
    z, over = np.concatenate([fixed.z, freed.z]), np.concatenate([fixed.p, freed.p])
    found = _within(eset, z, over, np.flatnonzero(np.concatenate([led, freed.found])))
    met = fixed.z[led][:, None, : structure.unknowns]
    return Scattered(found, Arrivals(guess[led], fixed.z[led], p[led], met))


def push_on(eset: EquilibriumSet, arrivals: Arrivals, most: int) -> States:
    """States to which guesses lead that are pushed on, over the box and within the constraints.

    At most so many guesses are, first those that led to what is not asked for.
    """
    beyond = ~are_feasible(eset.constraints, arrivals.z, arrivals.p)
    here = arrivals.take(np.argsort(~beyond, kind="stable")[:most])
    found = [eset.points[:0]]
    for _ in range(PUSHES):
        here = here.pushed(eset.structure)
        found.append(_within(eset, here.z, here.p, np.arange(len(here.z))))
    z, p = (np.concatenate([getattr(each, name) for each in found]) for name in "zp")
    return States(eset.structure, z, p)


def _within(eset: EquilibriumSet, z: Lanes, p: Parameters, some: Items) -> States:
    """Those of some states that lie over the box and obey the constraints."""
    some = some[eset.box.holds(p[some][:, eset.setting.free])]
    some = some[are_feasible(eset.constraints, z[some], p[some])]
    return States(eset.structure, z[some], p[some])
