"""Routes over the stable cells of an equilibrium set: a graph search, straightened by lifting."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components, dijkstra

from equimorph.equilibria import ParameterLine, TraceOptions
from equimorph.equilibria.outcome import Outcome, follow
from equimorph.equilibria.tracing import ARRIVAL
from equimorph.manifold import EquilibriumSet
from equimorph.manifold.topology import faces_of
from equimorph.model import Constraint
from equimorph.structures import State, States
from equimorph.tasks.route import Corners

ON_FOLD = (1, 4)
CLOSE = 0.05
"""Largest step in the metric where the stability margin is watched along a lift."""
MATCH = 1e-5
MOST_SHORTCUTS = 8000
"""Number of straight lifts that are tried to shorten a path."""


@dataclass(frozen=True)
class _Network:
    """States that a route may visit and the links between them, with lengths."""

    states: States
    links: Int[np.ndarray, "links 2"]
    lengths: Float[np.ndarray, " links"]


def free_route(
    eset: EquilibriumSet,
    start: State,
    goal: State,
    constraints: tuple[Constraint, ...],
    margin: float,
) -> Corners | str:
    """Way-points of a short stable route from `start` to `goal`, or the reason for none."""
    allowed = _allowed(eset, constraints, margin)
    network = _network(eset, allowed, (start, goal), constraints, margin)
    path = _liftable(network, constraints, margin)
    if path is None:
        return _no_route(eset, start, goal, constraints, margin)
    corners = _straightened(network.states[path], constraints, margin)
    return [{name: corner[name] for name in eset.names} for corner in list(corners)[1:]]


def _allowed(
    eset: EquilibriumSet, constraints: tuple[Constraint, ...], margin: float
) -> Bool[np.ndarray, " V"]:
    """Vertices of stable cells, off the folds, that obey the constraints and the margin."""
    stable = np.zeros(len(eset.points), bool)
    stable[eset.cells[eset.cell_index == 0]] = True
    stable &= ~np.isin(eset.kinds, ON_FOLD)
    some = np.flatnonzero(stable)
    good = _admissible(eset.points[some], constraints, margin)
    stable[some] = good
    return stable


def _admissible(
    states: States, constraints: tuple[Constraint, ...], margin: float
) -> Bool[np.ndarray, " n"]:
    """Whether states keep the margin (by one count of inertia) and the constraints."""
    structure = states.structure
    nothing = np.zeros((len(states), 0, structure.size))
    shift = np.full(len(states), margin)
    count = structure.solve(states.z, states.p, nothing, shift=shift).negative
    good = np.asarray(count == structure.constraints)
    for constraint in constraints:
        good &= constraint.excess(states.z, states.p) <= 1e-9
    return good


def _network(
    eset: EquilibriumSet,
    allowed: Bool[np.ndarray, " V"],
    ends: tuple[State, State],
    constraints: tuple[Constraint, ...],
    margin: float,
) -> _Network:
    """Edges of stable cells between allowed vertices, and the ends linked to their neighbours."""
    cells = eset.cells[eset.cell_index == 0]
    pairs = faces_of(cells, 2)
    pairs = pairs[allowed[pairs].all(axis=1)]
    states = States(
        eset.structure,
        np.concatenate([eset.points.z, *(end.z[None] for end in ends)]),
        np.concatenate([eset.points.p, *(end.p[None] for end in ends)]),
    )
    links, lengths = [pairs], [_gaps(states, pairs)]
    for number, end in enumerate(ends):
        near, far = _neighbours(eset, allowed, end, constraints, margin)
        own = np.full(len(near), len(eset.points) + number)
        links.append(np.stack([own, near], axis=1))
        lengths.append(far)
    direct, length = _link(ends[0].batch, ends[1].batch, constraints, margin)
    if direct[0]:
        links.append(np.array([[len(eset.points), len(eset.points) + 1]]))
        lengths.append(length)
    return _Network(states, np.concatenate(links), np.concatenate(lengths))


def _gaps(states: States, pairs: Int[np.ndarray, "links 2"]) -> Float[np.ndarray, " links"]:
    structure = states.structure
    dz = (states.z[pairs[:, 0]] - states.z[pairs[:, 1]])[:, : structure.unknowns]
    dp = (states.p[pairs[:, 0]] - states.p[pairs[:, 1]]) / structure.scales
    return np.asarray(np.sqrt(dz**2 @ structure.mass + (dp**2).sum(axis=1)))


def _neighbours(
    eset: EquilibriumSet,
    allowed: Bool[np.ndarray, " V"],
    end: State,
    constraints: tuple[Constraint, ...],
    margin: float,
) -> tuple[Int[np.ndarray, " n"], Float[np.ndarray, " n"]]:
    """Allowed vertices over the grid cells around a state that a straight lift reaches."""
    cells = eset.mesh.cells
    own = eset.mesh.locate(np.array([end[name] for name in eset.names]))
    around = np.unique(cells[np.isin(cells, cells[own]).any(axis=1)])
    near = np.flatnonzero(allowed & np.isin(eset.grid_vertex, around))
    source = States(eset.structure, np.tile(end.z, (len(near), 1)), np.tile(end.p, (len(near), 1)))
    linked, length = _link(source, eset.points[near], constraints, margin)
    return near[linked], length[linked]


def _link(
    source: States, target: States, constraints: tuple[Constraint, ...], margin: float
) -> tuple[Bool[np.ndarray, " n"], Float[np.ndarray, " n"]]:
    """Whether straight lifts lead from states to states, stable all the way; their lengths."""
    structure = source.structure
    velocity = target.p - source.p
    still = np.abs(velocity).max(axis=1, initial=0.0) == 0.0
    same = _metric(structure.mass, source.z - target.z) < MATCH
    linked, length = still & same, np.zeros(len(source))
    moving = np.flatnonzero(~still)
    if len(moving):
        line = ParameterLine(structure, source.p[moving].copy(), velocity[moving])
        options = TraceOptions(largest_step=0.5 if margin == 0.0 else CLOSE)
        outcome = follow(line, source.z[moving].copy(), constraints, options)
        arrived = outcome.code == ARRIVAL
        arrived &= _metric(structure.mass, outcome.z - target.z[moving]) < MATCH
        if margin > 0.0:
            arrived &= _keeps_margin(line, outcome, margin)
        linked[moving], length[moving] = arrived, outcome.travelled
    return linked, length


def _metric(
    mass: Float[np.ndarray, " n"], dz: Float[np.ndarray, "lanes size"]
) -> Float[np.ndarray, " lanes"]:
    return np.asarray(np.sqrt(dz[:, : len(mass)] ** 2 @ mass))


def _keeps_margin(
    line: ParameterLine, outcome: Outcome, margin: float
) -> Bool[np.ndarray, " lanes"]:
    """Whether every recorded point of the lifts has at least the margin."""
    keeps = np.ones(len(outcome.code), bool)
    points = outcome.points
    p = line.take(points.lanes).parameters(points.t)
    keeps[points.lanes[~_admissible(States(line.structure, points.z, p), (), margin)]] = False
    return keeps


def _liftable(
    network: _Network, constraints: tuple[Constraint, ...], margin: float
) -> Int[np.ndarray, " n"] | None:
    """Shortest path between the last two states whose every link can be lifted.

    Links are lifted only when a shortest path uses them; those that fail are removed.
    """
    links, lengths = network.links, network.lengths
    known = np.zeros(len(links), bool)
    while True:
        count = len(network.states)
        path = _shortest(_Network(network.states, links, lengths), count - 2, count - 1)
        if path is None:
            return None
        steps = np.sort(np.stack([path[:-1], path[1:]], axis=1), axis=1)
        base = count + 1
        keys = np.sort(links, axis=1) @ np.array([base, 1])
        used = np.flatnonzero(np.isin(keys, steps @ np.array([base, 1])) & ~known)
        if len(used) == 0:
            return path
        first, second = links[used].T
        linked, _ = _link(network.states[first], network.states[second], constraints, margin)
        known[used] = True
        keep = np.ones(len(links), bool)
        keep[used[~linked]] = False
        links, lengths, known = links[keep], lengths[keep], known[keep]


def _shortest(network: _Network, start: int, goal: int) -> Int[np.ndarray, " n"] | None:
    """Shortest path by Dijkstra; None if there is none."""
    count = len(network.states)
    graph = coo_array((network.lengths, network.links.T), shape=(count, count)).tocsr()
    _, before = dijkstra(graph, directed=False, indices=start, return_predecessors=True)
    if before[goal] < 0:
        return None
    path = [goal]
    while path[-1] != start:
        path.append(int(before[path[-1]]))
    return np.array(path[::-1])


def _straightened(states: States, constraints: tuple[Constraint, ...], margin: float) -> States:
    """Corners of the shortest chain of straight lifts between any two states of a path.

    A path along edges of a mesh is some per cent too long; every pair of its states that a straight
    lift connects is a short cut.
    """
    first, second = np.triu_indices(len(states), 1)
    stride = 1 + len(first) // MOST_SHORTCUTS
    keep = (second - first == 1) | ((second - first) % stride == 0)
    first, second = first[keep], second[keep]
    linked, length = _link(states[first], states[second], constraints, margin)
    links = np.stack([first[linked], second[linked]], axis=1)
    path = _shortest(_Network(states, links, length[linked]), 0, len(states) - 1)
    return states if path is None else states[path]


def _no_route(
    eset: EquilibriumSet,
    start: State,
    goal: State,
    constraints: tuple[Constraint, ...],
    margin: float,
) -> str:
    """Tell whether instability alone or the other demands part start and goal."""
    network = _network(eset, _allowed(eset, (), 0.0), (start, goal), (), 0.0)
    count = len(network.states)
    graph = coo_array((np.ones(len(network.links)), network.links.T), shape=(count, count))
    _, label = connected_components(graph, directed=False)
    if label[-1] != label[-2]:
        return "start and goal lie on different stable components of the set"
    demands = [str(constraint) for constraint in constraints]
    demands += [f"margin >= {margin:g}"] if margin > 0 else []
    return f"start and goal are connected by stable states, but not within {' and '.join(demands)}"
