"""Saddles between two minima, found by pushing from one towards the other; ways over saddles.

See docs/barriers.md, and docs/decisions.md, "Completeness is argued".
"""

from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from equimorph.arrays import Float, Int, Lanes, Numbers, Parameters, Some, Values
from equimorph.columns import Columns
from equimorph.equilibria.curves import growing_force
from equimorph.equilibria.energy_barriers import Status
from equimorph.equilibria.gradient_flow import Ending
from equimorph.equilibria.settle import Guards, settle
from equimorph.equilibria.trace import Onwards, trace
from equimorph.equilibria.trace_options import EventCode, TraceOptions
from equimorph.structures import Structure
from equimorph.structures.metric import metric_length


class Nowhere(IntEnum):
    """Instead of the number of a state: how a descent ended that met none that is known."""

    UNRESOLVED = -1
    """Where the discretisation does not represent states."""
    ESCAPED = -2
    """It left for infinity: no state stops it."""
    LOST = -3
    """A numerical failure."""
    BEYOND = -4
    """At a state that a set lacks, as one beyond its constraints."""

    @classmethod
    def of(cls, ending: Ending) -> "Nowhere":
        """Where a descent is that met no resolved state."""
        if ending in (Ending.LANDED, Ending.SADDLE):
            return cls.UNRESOLVED
        return cls.ESCAPED if ending == Ending.ESCAPED else cls.LOST

    @property
    def status(self) -> Status:
        """In words."""
        return STATUS[self]


STATUS: dict[Nowhere, Status] = {
    Nowhere.UNRESOLVED: "unresolved",
    Nowhere.ESCAPED: "escaped",
    Nowhere.LOST: "lost",
    Nowhere.BEYOND: "beyond the set",
}


def ways_over(
    saddles: Int[np.ndarray, " saddles"],
    ends: Int[np.ndarray, "saddles 2"],
    energy: Values,
) -> Int[np.ndarray, "ways 3"]:
    """Saddle, a minimum below it, and where it leads beyond, by the energy of the saddle.

    A descent that ends at another saddle, always a lower one, leads to all states below that one.
    Saddles that lead to the same state on both sides have no way over them.

    Parameters
    ----------
    saddles
        Numbers of states.
    ends
        Numbers of the states where the descents from each end, or a `Nowhere`.
    energy
        Of all states.
    """
    row = np.full(len(energy), -1)
    row[saddles] = np.arange(len(saddles))
    ways = np.column_stack([saddles, ends]).reshape(-1, 3)
    for column in (1, 2):
        while (inner := (ways[:, column] >= 0) & (row[ways[:, column]] >= 0)).any():
            below = np.repeat(ways[inner], 2, axis=0)
            below[:, column] = ends[row[ways[inner, column]]].ravel()
            ways = np.concatenate([ways[~inner], below])
    both = np.concatenate([ways, ways[:, [0, 2, 1]]])
    both = np.unique(both[(both[:, 1] >= 0) & (both[:, 1] != both[:, 2])], axis=0)
    # of several ways over a saddle those to states come first, the lowest of them at the front
    last = np.where(both[:, 2] >= 0, energy[both[:, 2]], np.inf)
    return np.asarray(both[np.lexsort((last, both[:, 1], both[:, 0], energy[both[:, 0]]))])


POINTS = 21
"""Points of the straight line between two minima at which the force against a push is measured."""
STRONGEST = 10.0
"""Largest push, relative to the largest of these forces."""
LEGS = 4
"""Equilibria that one push may meet on its way."""
FIRST_STEP, LARGEST_STEP = 0.02, 0.2
"""Of a push, relative to the smallest distance of two minima in the batch."""
STEPS = 150
"""Largest number of steps of one push."""


NEAR = Guards(iterations=12)
"""Corrections of the points where they return."""


@dataclass(frozen=True)
class Pairs(Columns):
    """Pairs of minima, each over one point of the parameter space, a pair per lane."""

    start: Lanes
    goal: Lanes
    p: Parameters

    def both_ways(self) -> "Pairs":
        """All pairs, then all of them from goal to start."""
        ends = (self.start, self.goal), (self.goal, self.start)
        start, goal = (np.concatenate(each) for each in ends)
        return Pairs(start, goal, np.tile(self.p, (2, 1)))

    def distance(self, structure: Structure) -> Values:
        """Distances in the metric."""
        return metric_length(structure, self.goal - self.start)


@dataclass(frozen=True)
class Met:
    """Equilibria that pushes meet, and the pair from which each comes."""

    z: Lanes
    pair: Some


def states_between(structure: Structure, pairs: Pairs) -> Met:
    """Equilibria on the Newton trajectories from both minima of each pair towards the other.

    The force of the push, ``F(z) = t M (u_goal − u_start)``, is followed by arclength from t = 0
    through folds; wherever it vanishes there is an equilibrium [QuappBofill2014]_. Between two
    minima that are joined by a valley this is a saddle as a rule.
    """
    ways = pairs.both_ways()
    count, push, distance = len(ways.p), _pushes(structure, ways), ways.distance(structure)
    # the push changes sign where it vanishes
    owner, leg = np.tile(np.arange(count), LEGS), np.arange(LEGS).repeat(count)
    force = np.where(leg % 2, -1.0, 1.0)[:, None] * push[owner]
    line = growing_force(structure, ways.p[owner], force, distance[owner])
    met = [(np.zeros(0, int), np.zeros((0, structure.size)))]  # lanes, and where they returned

    def follow(
        ended: Numbers, code: Numbers, z: Lanes
    ) -> tuple[Some, Float[np.ndarray, "some size"]]:
        back = code == EventCode.RETURNED
        exact = settle(structure, z[back], ways.p[owner[ended[back]]], guards=NEAR)
        good, z = ended[back][exact.found], exact.z[exact.found]
        met.append((good, z))
        more = good < (LEGS - 1) * count
        return good[more] + count, z[more]

    starts = np.tile(ways.start, (LEGS, 1))
    options = steps_for(float(distance.min()))
    trace(line, starts, (), options, onwards=Onwards(count, follow))
    lane, z = (np.concatenate(each) for each in zip(*met, strict=True))
    order = np.argsort(lane)
    return Met(z[order], owner[lane[order]] % len(pairs.p))


def _pushes(structure: Structure, pairs: Pairs) -> Lanes:
    """Forces towards the goal, strong enough for the straight line between the minima."""
    n = structure.unknowns
    ahead = (pairs.goal - pairs.start)[:, :n] / pairs.distance(structure)[:, None]
    push = np.zeros_like(pairs.start)
    push[:, :n] = strongest_pushes(structure, pairs)[:, None] * structure.mass * ahead
    return push


def strongest_pushes(structure: Structure, pairs: Pairs) -> Values:
    """`STRONGEST` times the largest force against a push along the line from start to goal."""
    n, count = structure.unknowns, len(pairs.p)
    ahead = (pairs.goal - pairs.start)[:, :n] / pairs.distance(structure)[:, None]
    share = np.linspace(0.0, 1.0, POINTS)[1:-1]
    line = pairs.start[:, None] + (pairs.goal - pairs.start)[:, None] * share[:, None]
    residual = structure.residual(
        line.reshape(-1, structure.size), np.repeat(pairs.p, len(share), axis=0)
    )
    against = np.abs((residual[:, :n].reshape(count, -1, n) * ahead[:, None]).sum(axis=2))
    return np.asarray(STRONGEST * np.where(np.isfinite(against), against, 0.0).max(axis=1))


def steps_for(distance: float) -> TraceOptions:
    """Steps of pushes that fit the distance of the states that they may meet."""
    return TraceOptions(
        through_folds=True,
        through_branch_points=True,
        first_step=FIRST_STEP * distance,
        largest_step=LARGEST_STEP * distance,
        smallest_step=1e-7 * distance,
        turning=0.5,
        steps=STEPS,
        record=False,
        locate_passed=False,
        retries=0,
    )
