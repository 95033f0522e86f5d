"""Routes that are safe under all likely loads, over the stable cells of an equilibrium set."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from equimorph.arrays import Int, Values
from equimorph.control.likely_loads import REACH, Bundles, LikelyLoads, move_states, positions
from equimorph.equilibria import TraceOptions
from equimorph.linalg.graphs import shortest_path
from equimorph.manifold import EquilibriumSet, equilibrium_set
from equimorph.manifold.complex.kept_tables import from_cache
from equimorph.manifold.geometry.topology import flags_of, labels
from equimorph.model import names_of
from equimorph.structures import States, join_states
from equimorph.tasks.planning.network import (
    Pairs,
    connect,
    network_of,
    vertices_around,
)
from equimorph.tasks.planning.objectives import objective_of
from equimorph.tasks.planning.straightening import CORNER, STATIONS_WITH_MARGINS, pairs_on_path
from equimorph.tasks.verification.schedule_check import follow_polyline

MOST_INTERVALS = 20
"""Grid intervals of a set that is lifted anew under estimated loads: a second for an arch."""
DIGITS = 2
"""Digits of the loads of such sets, so that the next step finds the one of the step before."""


def safe_route(
    eset: EquilibriumSet, start: Bundles, goal: Bundles, likely: LikelyLoads
) -> States | None:
    """States of a route from one place to another, under the estimated loads; None for none.

    The set is moved to the estimated loads, and where that does not lead to the goal it is lifted
    anew there, on a coarse grid: sheets that other loads do not have can be used, too. Of vertices
    next to each other only one counts at first, all of them where that leads nowhere.
    """
    ends = start, goal
    found = _over(eset, ends, likely)
    if found is None and not np.allclose(likely.values[0], _loads_of(eset, likely)):
        found = _over(_lift_anew(eset, likely), ends, likely)
    return _over(eset, ends, likely, width=0.0) if found is None else found


def route_is_safe(
    start: Bundles, way_points: Sequence[Mapping[str, float]], goal: States, likely: LikelyLoads
) -> bool:
    """Whether straight moves over way-points lead to the goal safely under all likely loads."""
    here, ahead = start.estimated[0], goal
    rows = [here.p]
    for point in way_points:
        row = rows[-1].copy()
        row[positions(here.structure, point)] = list(point.values())
        if (row != rows[-1]).any():
            rows.append(row)
    if len(rows) > 1:
        way = follow_polyline(here, np.array(rows[1:]), (), TraceOptions())
        if way.end.kind != "arrived":
            return False
        ahead = join_states(here.structure, [way.states[way.corners[1:]], goal])
    path, legs = start.follow(likely.under(ahead)), np.arange(len(ahead))
    return bool(likely.can_move(path.take(legs), path.take(legs + 1)).all())


def _loads_of(eset: EquilibriumSet, likely: LikelyLoads) -> Values:
    names = names_of(eset.structure.parameters)
    return np.array([eset.fixed[names[k]] for k in likely.at])


def _lift_anew(eset: EquilibriumSet, likely: LikelyLoads) -> EquilibriumSet:
    """The set under the estimated loads, rounded; kept with the set."""
    scales = eset.structure.scales[likely.at]
    loads = np.round(likely.values[0] / scales, DIGITS) * scales
    names = names_of(eset.structure.parameters)
    rounded = {names[k]: float(load) for k, load in zip(likely.at, loads, strict=True)}
    intervals = tuple(min(each, MOST_INTERVALS) for each in eset.intervals)

    def lift() -> EquilibriumSet:
        return equilibrium_set(
            eset.structure,
            eset.box,
            fixed={**eset.fixed, **rounded},
            within=eset.constraints,
            intervals=intervals,
            checks=0,
        )

    return from_cache(eset, ("under", *loads.tolist()), lift)


def _over(
    eset: EquilibriumSet, ends: tuple[Bundles, Bundles], likely: LikelyLoads, width: float = REACH
) -> States | None:
    """A route over the places of a set, moved to the estimated loads.

    A link costs its length in the scaled actuators over the least margin of its ends under any of
    the likely loads; links are lifted under all of these only where a path uses them.
    """
    places = from_cache(eset, ("places", width), lambda: _Places.within(eset, width))
    here, arrived = move_states(
        eset.points[places.vertices], likely.at, likely.values[:1].repeat(len(places.vertices), 0)
    )
    nodes = likely.under(here[np.flatnonzero(arrived)])
    number = np.full(len(places.vertices) + 1, -1)
    number[np.flatnonzero(arrived)[nodes.safe]] = np.arange(nodes.safe.sum())
    nodes = nodes.take(np.flatnonzero(nodes.safe)).follow(ends[0]).follow(ends[1])
    count, pairs = len(nodes), number[places.pairs]
    pairs = np.concatenate([
        pairs[(pairs >= 0).all(axis=1)],
        _around(eset, number[places.around], ends[0], count - 2),
        _around(eset, number[places.around], ends[1], count - 1),
        [[count - 2, count - 1]],
    ])  # fmt: skip
    path = _cheapest(nodes, pairs, likely)
    return None if path is None else _straighten(nodes.take(path), likely)


def _straighten(path: Bundles, likely: LikelyLoads) -> States:
    """Corners of the chain of safe straight moves between places of a path with most clearance."""
    first, second = pairs_on_path(len(path), STATIONS_WITH_MARGINS)
    good = likely.can_move(path.take(first), path.take(second))
    first, second, estimated = first[good], second[good], path.estimated
    clear = replace(likely.demands, objective=objective_of("clearance", estimated.structure))
    _, costs = connect(estimated[first], estimated[second], clear)
    costs += CORNER * costs[second - first == 1].sum()
    pairs = np.stack([first, second], axis=1)
    chain = shortest_path(len(path), pairs, costs, (0, len(path) - 1))
    return estimated if chain is None else estimated[chain]


@dataclass(frozen=True)
class _Places:
    """The network of a set, with one place for vertices that are linked and close to each other."""

    vertices: Int[np.ndarray, " places"]
    """Stable vertices, one for each place."""
    around: Int[np.ndarray, " vertices"]
    """The place of each vertex, −1 for unstable ones."""
    pairs: Pairs
    """Places that are linked."""

    @classmethod
    def within(cls, eset: EquilibriumSet, width: float) -> "_Places":
        """Places in boxes of a width in the scaled actuators; of a width of zero: all vertices."""
        network, at = network_of(eset), positions(eset.structure, eset.names)
        stable, linked = np.flatnonzero(network.stable), network.pairs
        linked = linked[network.stable[linked].all(axis=1)]
        near = linked[:0]
        if width > 0.0:
            box = np.floor(eset.points.p[:, at] / eset.structure.scales[at] / width)
            near = linked[(box[linked[:, 0]] == box[linked[:, 1]]).all(axis=1)]
        label, around = labels(len(eset.points), near), np.full(len(eset.points), -1)
        _, first, around[stable] = np.unique(label[stable], return_index=True, return_inverse=True)
        pairs = np.unique(np.sort(around[linked], axis=1), axis=0)
        return cls(stable[first], around, pairs[pairs[:, 0] < pairs[:, 1]])


def _around(
    eset: EquilibriumSet, number: Int[np.ndarray, " vertices"], place: Bundles, node: int
) -> Pairs:
    """Links from a place to the nodes of the vertices over its grid cell and those around."""
    near = np.unique(number[vertices_around(eset, place.estimated[0])])
    near = near[near >= 0]
    return np.stack([np.full(len(near), node), near], axis=1)


def _cheapest(nodes: Bundles, pairs: Pairs, likely: LikelyLoads) -> Int[np.ndarray, " path"] | None:
    """The cheapest path from the last node but one to the last whose links are all safe."""
    weights = _costs(nodes, pairs)
    lifted = np.zeros(len(pairs), bool)
    count = len(nodes)
    while True:
        path = shortest_path(count, pairs, weights, (count - 2, count - 1))
        if path is None:
            return None
        steps = np.stack([path[:-1], path[1:]], axis=1)
        used = np.flatnonzero(flags_of(pairs, steps))
        fresh = used[~lifted[used]]
        good = likely.can_move(*(nodes.take(side) for side in pairs[fresh].T))
        lifted[fresh] = True
        if good.all():
            return path
        keep = np.ones(len(pairs), bool)
        keep[fresh[~good]] = False
        pairs, weights, lifted = pairs[keep], weights[keep], lifted[keep]


def _costs(nodes: Bundles, pairs: Pairs) -> Values:
    estimated = nodes.estimated
    first, second = (estimated.p[side] / estimated.structure.scales for side in pairs.T)
    least = nodes.margins[pairs].min(axis=1)
    return np.asarray(np.linalg.norm(second - first, axis=1) / least)
