"""Saddles between two minima: the structure is pushed from one towards the other.

See docs/decisions.md, "Minima are joined by pushing".
"""

from dataclasses import dataclass

import numpy as np

from equimorph.arrays import Lanes, Parameters, Some, Values
from equimorph.columns import Columns
from equimorph.equilibria.curves import growing_force
from equimorph.equilibria.settle import Guards, settle
from equimorph.equilibria.soft_modes import metric_length
from equimorph.equilibria.trace import trace
from equimorph.equilibria.trace_options import EventCode, TraceOptions
from equimorph.structures import Structure

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
        return metric_length(structure, (self.goal - self.start)[:, : structure.unknowns])


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
    lanes, z = np.arange(len(ways.p)), ways.start
    push = _pushes(structure, ways)
    distance = ways.distance(structure)
    options = _options(float(distance.min()))
    met, pair = [np.zeros((0, structure.size))], [np.zeros(0, int)]
    for _ in range(LEGS):
        line = growing_force(structure, ways.p[lanes], push[lanes], distance[lanes])
        led = trace(line, z, (), options)
        back = np.flatnonzero(led.code == EventCode.RETURNED)
        exact = settle(structure, led.z[back], ways.p[lanes[back]], guards=Guards(iterations=12))
        good = back[exact.found]
        met.append(exact.z[exact.found])
        pair.append(lanes[good] % len(pairs.p))
        # the push changes sign where it vanishes
        push[lanes[good]] *= -1.0
        lanes, z = lanes[good], exact.z[exact.found]
        if len(lanes) == 0:
            break
    return Met(np.concatenate(met), np.concatenate(pair))


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


def _options(distance: float) -> TraceOptions:
    """Steps that fit the distance of the minima."""
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
