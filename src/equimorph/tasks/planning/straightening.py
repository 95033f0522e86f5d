"""Paths over a mesh made straight, and drawn to where they cost least."""

import numpy as np
from jaxtyping import Bool, Float, Int

from equimorph.equilibria import ParameterLine, TraceOptions, newton
from equimorph.equilibria.outcome import follow
from equimorph.equilibria.tracing import ARRIVAL
from equimorph.model import Box
from equimorph.structures import States
from equimorph.tasks.planning.links import Demands, links, shortest

MOST_SHORTCUTS = 8000
"""Number of straight lifts that are tried to shorten a path."""
MOST_MARGINS = 1000
"""The same where margins are needed all along, which cost more than the lifts."""
LEGS = 12
"""Legs longer than this part of the way in the parameters are divided before corners move."""
MOST_CORNERS = 32
SIZES = (0.12, 0.04, 0.013)
"""Moves of corners, in scaled parameters, that are tried one after the other."""
ROUNDS = 6
LEAST_GAIN = 2e-6
"""Share of the cost that a move has to gain."""
GAIN = 1e-4
"""Share of the cost that a shorter list of corners may cost more."""


def straightened(states: States, demands: Demands, same_class: bool = False) -> States:
    """Corners of the cheapest chain of straight lifts between any two states of a path.

    A path along edges of a mesh is some per cent too long; every pair of its states that a straight
    lift connects is a short cut. With `same_class` only those count that can be drawn there: all
    states between are reached, too, so that the short cut sweeps over the set.
    """
    first, second = np.triu_indices(len(states), 1)
    most = MOST_MARGINS if demands.objective.needs_margins else MOST_SHORTCUTS
    stride = 1 + len(first) // most
    keep = (second - first == 1) | ((second - first) % stride == 0)
    first, second = first[keep], second[keep]
    linked, cost = links(states[first], states[second], demands)
    if same_class:
        linked &= _swept(first, second, linked)
    pairs = np.stack([first[linked], second[linked]], axis=1)
    path = shortest(len(states), pairs, cost[linked], (0, len(states) - 1))
    return states if path is None else states[path]


def _swept(
    first: Int[np.ndarray, " pairs"],
    second: Int[np.ndarray, " pairs"],
    linked: Bool[np.ndarray, " pairs"],
) -> Bool[np.ndarray, " pairs"]:
    """Whether all shorter short cuts from the same state are linked."""
    count = int(second.max()) + 1
    first_miss = np.full(count, count)
    np.minimum.at(first_miss, first[~linked], second[~linked])
    return np.asarray(second < first_miss[first])


def relaxed(
    corners: States,
    demands: Demands,
    room: tuple[Box, Int[np.ndarray, " d"]],
    same_class: bool = False,
) -> States:
    """Corners moved to where the chain of straight lifts costs least.

    Every other corner is tried at once in several directions and the best admissible move is made;
    moves become smaller and smaller. Then corners that are of no use are left out.
    """
    corners = _divided(corners, demands)
    for size in SIZES:
        for _ in range(ROUNDS):
            before = corners
            for odd in (1, 2):
                corners = _moved(corners, odd, size, demands, room)
            if corners is before:
                break
    return _thinned(corners, demands, same_class)


def _divided(corners: States, demands: Demands) -> States:
    """Corners with others between them on long legs."""
    scales = corners.structure.scales
    gap = np.linalg.norm(np.diff(corners.p, axis=0) / scales, axis=1)
    longest = gap.sum() / LEGS
    while len(corners) < MOST_CORNERS:
        gap = np.linalg.norm(np.diff(corners.p, axis=0) / scales, axis=1)
        long = np.flatnonzero(gap > longest)[: MOST_CORNERS - len(corners)]
        if len(long) == 0:
            break
        middle = 0.5 * (corners.p[long] + corners.p[long + 1])
        z, there = _lifted(corners[long], middle, demands)
        if not there.all():
            break
        p = np.insert(corners.p, long + 1, middle, axis=0)
        corners = States(corners.structure, np.insert(corners.z, long + 1, z, axis=0), p)
    return corners


def _lifted(
    states: States, p: Float[np.ndarray, "lanes parameters"], demands: Demands
) -> tuple[Float[np.ndarray, "lanes size"], Bool[np.ndarray, " lanes"]]:
    """States lifted straight to parameters, and whether they arrived."""
    line = ParameterLine(states.structure, states.p.copy(), p - states.p)
    outcome = follow(line, states.z.copy(), demands.constraints, TraceOptions(record=False))
    z, found = newton(states.structure, outcome.z, p, iterations=4)
    return z, (outcome.code == ARRIVAL) & found


def _moved(
    corners: States,
    odd: int,
    size: float,
    demands: Demands,
    room: tuple[Box, Int[np.ndarray, " d"]],
) -> States:
    """Corners with every other one moved, if that makes its two legs cheaper."""
    box, free = room
    at = np.arange(odd, len(corners) - 1, 2)
    if len(at) == 0:
        return corners
    structure = corners.structure
    steps = size * structure.scales[free] * _directions(len(free))
    tried, step = np.repeat(at, len(steps)), np.tile(steps, (len(at), 1))
    p = corners.p[tried]
    p[:, free] = np.clip(p[:, free] + step, box.lower, box.upper)
    some = np.flatnonzero(np.abs(p - corners.p[tried]).max(axis=1) > 0.0)
    tried, p = tried[some], p[some]
    # whether these lie on the branch of the corner is what the lifts from its neighbours show
    z, there = newton(structure, corners.z[tried], p, iterations=8)
    tried, p, z = tried[there], p[there], z[there]
    if len(tried) == 0:
        return corners
    new = States(structure, z, p)
    sources = States(
        structure,
        np.concatenate([corners.z[tried - 1], z, corners.z[:-1]]),
        np.concatenate([corners.p[tried - 1], p, corners.p[:-1]]),
    )
    targets = States(
        structure,
        np.concatenate([z, corners.z[tried + 1], corners.z[1:]]),
        np.concatenate([p, corners.p[tried + 1], corners.p[1:]]),
    )
    good, cost = links(sources, targets, demands)
    count = len(tried)
    to_it, from_it, old = cost[:count], cost[count : 2 * count], cost[2 * count :]
    both = good[:count] & good[count : 2 * count]
    gain = np.where(both, old[tried - 1] + old[tried] - to_it - from_it, -np.inf)
    worth = np.where(gain > LEAST_GAIN * old.sum(), gain, 0.0)
    return _taken(corners, tried, new, worth)


def _directions(d: int) -> Float[np.ndarray, "directions d"]:
    """Both ways along every parameter, and amid each two of them."""
    units = np.eye(d)
    first, second = np.triu_indices(d, 1)
    amid = [units[first] + sign * units[second] for sign in (1.0, -1.0)]
    half = np.concatenate([units, *(0.5**0.5 * each for each in amid)])
    return np.concatenate([half, -half])


def _taken(
    corners: States, tried: Int[np.ndarray, " n"], new: States, gain: Float[np.ndarray, " n"]
) -> States:
    """Corners with the best of the moves that gain something."""
    best = np.full(len(corners), 0.0)
    np.maximum.at(best, tried, gain)
    chosen = np.flatnonzero((gain > 0.0) & (gain == best[tried]))
    if len(chosen) == 0:
        return corners
    z, p = corners.z.copy(), corners.p.copy()
    z[tried[chosen]], p[tried[chosen]] = new.z[chosen], new.p[chosen]
    return States(corners.structure, z, p)


def _thinned(corners: States, demands: Demands, same_class: bool) -> States:
    """Fewest corners whose chain costs hardly more."""
    first, second = np.triu_indices(len(corners), 1)
    near = second - first <= (3 if demands.objective.needs_margins else len(corners))
    first, second = first[near], second[near]
    linked, cost = links(corners[first], corners[second], demands)
    if same_class:
        linked &= _swept(first, second, linked)
    consecutive = cost[second - first == 1].sum()
    pairs = np.stack([first[linked], second[linked]], axis=1)
    each = cost[linked] + GAIN * consecutive
    path = shortest(len(corners), pairs, each, (0, len(corners) - 1))
    return corners if path is None else corners[path]
