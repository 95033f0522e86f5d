"""Straight lifts between states: whether they lead there, and what they cost."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra

from equimorph.arrays import Flags, Lanes, Parameters, Values
from equimorph.equilibria import ParameterLine, TraceOptions
from equimorph.equilibria.outcome import Outcome, follow
from equimorph.equilibria.tracing import ARRIVAL
from equimorph.model import Constraint
from equimorph.structures import States
from equimorph.tasks.planning.objectives import Objective
from equimorph.tasks.route import FINE

CLOSE = 0.05
"""Largest step in the metric where the stability margin is watched along a lift."""
BROAD = 0.1
"""The same where the cost is summed up from step to step."""
MATCH = 1e-5


@dataclass(frozen=True)
class Demands:
    """What a route has to obey, and what it should have least of.

    `closely`: whether every lift is as fine as the final one; else it may step over the corner of a
    keep-out region.
    """

    objective: Objective
    constraints: tuple[Constraint, ...] = ()
    margin: float = 0.0
    closely: bool = False

    @property
    def options(self) -> TraceOptions:
        """Step control of the lifts."""
        if self.closely:
            return FINE
        if self.margin > 0.0:
            return TraceOptions(largest_step=CLOSE)
        step = 0.5 if self.objective.is_length else BROAD
        return TraceOptions(first_step=0.1, largest_step=step)

    def admissible(self, states: States) -> Flags:
        """Whether states keep the margin (by one count of inertia) and the constraints."""
        structure = states.structure
        nothing = np.zeros((len(states), 0, structure.size))
        shift = np.full(len(states), self.margin)
        count = structure.solve(states.z, states.p, nothing, shift=shift).negative
        good = np.asarray(count == structure.constraints)
        for constraint in self.constraints:
            good[good] = constraint.excess(states.z[good], states.p[good]) <= 0.0
        return good


def links(source: States, target: States, demands: Demands) -> tuple[Flags, Values]:
    """Whether straight lifts lead from states to states, admissible all the way; their costs."""
    z, linked, cost = straight_lifts(source, target.p, demands)
    linked &= distances(source.structure.mass, z - target.z) < MATCH
    return linked, cost


def straight_lifts(source: States, p: Parameters, demands: Demands) -> tuple[Lanes, Flags, Values]:
    """Where straight lifts to parameters end; whether they got there admissibly; their costs."""
    structure, z = source.structure, source.z.copy()
    velocity = p - source.p
    there, cost = np.ones(len(source), bool), np.zeros(len(source))
    moving = np.flatnonzero(np.abs(velocity).max(axis=1, initial=0.0) > 0.0)
    if len(moving):
        line = ParameterLine(structure, source.p[moving].copy(), velocity[moving])
        outcome = follow(line, z[moving], demands.constraints, demands.options)
        arrived = outcome.code == ARRIVAL
        if demands.margin > 0.0:
            arrived &= _keeps_margin(line, outcome, demands)
        z[moving], there[moving] = outcome.z, arrived
        cost[moving] = _costs(source[moving], line, outcome, demands.objective)
    return z, there, cost


def distances(mass: Float[np.ndarray, " n"], dz: Lanes) -> Values:
    """Length of changes of the unknowns in the metric."""
    return np.asarray(np.sqrt(dz[:, : len(mass)] ** 2 @ mass))


def _keeps_margin(line: ParameterLine, outcome: Outcome, demands: Demands) -> Flags:
    """Whether every recorded point of the lifts has at least the margin."""
    keeps = np.ones(len(outcome.code), bool)
    points = outcome.points
    p = line.take(points.lanes).parameters(points.t)
    margin_alone = Demands(demands.objective, (), demands.margin)
    good = margin_alone.admissible(States(line.structure, points.z, p))
    keeps[points.lanes[~good]] = False
    return keeps


def _costs(source: States, line: ParameterLine, outcome: Outcome, objective: Objective) -> Values:
    """Cost of each lift, summed up over its recorded points."""
    if objective.is_length:
        return np.asarray(outcome.travelled * sum(weight for weight, _ in objective.terms))
    points, lanes = outcome.points, np.arange(len(source))
    lane = np.concatenate([lanes, points.lanes, lanes])
    t = np.concatenate([np.zeros(len(lanes)), points.t, outcome.t])
    order = np.lexsort((t, lane))
    z = np.concatenate([source.z, points.z, outcome.z])[order]
    lane, t = lane[order], t[order]
    states = States(line.structure, z, line.take(lane).parameters(t))
    pairs = np.flatnonzero(lane[1:] == lane[:-1])
    costs = objective.costs(states, pairs, pairs + 1)
    return np.bincount(lane[pairs], costs, len(lanes))


def shortest(
    count: int, pairs: Int[np.ndarray, "links 2"], costs: Values, ends: tuple[int, int]
) -> Int[np.ndarray, " n"] | None:
    """Cheapest path from one node to another by Dijkstra; None if there is none."""
    # a cost of zero would be no link in a sparse matrix
    weights = np.maximum(costs, 1e-300)
    graph = coo_array((weights, pairs.T), shape=(count, count)).tocsr()
    start, goal = ends
    _, before = dijkstra(graph, directed=False, indices=start, return_predecessors=True)
    if before[goal] < 0:
        return None
    path = [goal]
    while path[-1] != start:
        path.append(int(before[path[-1]]))
    return np.array(path[::-1])
