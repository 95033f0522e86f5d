"""Paths over a mesh made straight, moved to where they cost least, and verified as routes."""

from collections.abc import Generator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from equimorph.arrays import Bool, Flags, Int, Lanes, Parameters, Some, Values
from equimorph.equilibria import Guards, ParameterLine, TraceOptions, settle
from equimorph.equilibria.trace import trace
from equimorph.equilibria.trace_options import EventCode
from equimorph.errors import InputError
from equimorph.linalg.graph_kernels import before_in_chain
from equimorph.linalg.graphs import shortest_path, walk_back
from equimorph.manifold import EquilibriumSet
from equimorph.model import Descriptor, position
from equimorph.structures import States, join_states
from equimorph.tasks.planning.corner_moves import ActuatorBox, chords, move_by_chords, move_by_lifts
from equimorph.tasks.planning.network import Demands, Ends, connect
from equimorph.tasks.planning.shortening import Shortener
from equimorph.tasks.route import Corners, Route, refusal, verify_corners, verify_route
from equimorph.tasks.start import check_equilibrium, check_fixed_parameters, inadmissible

MOST_SHORTCUTS = 8000
"""Number of straight lifts that are tried to shorten a path within its class."""
STATIONS, STATIONS_WITH_MARGINS = 28, 16
"""Otherwise, states of a path between which short cuts are tried; fewer where margins count."""
CORNER = 1e-3
"""Share of the cost that a further corner has to save."""
LEGS = 12
"""Legs longer than this part of the way in the parameters are divided before corners move."""
MOST_CORNERS = 32
"""Most corners of a path whose legs are divided."""
MERGED = 8
"""Legs that may become one."""
BETWEEN = 3e-4
"""Share of a demanded margin by which lifts may lose more of it between watched states."""
GAIN = 1e-4
"""Share of the cost that a shorter list of corners may cost more."""
FINE_GAIN, NEARLY = 5e-5, 1.0
"""The same where corners come from shortest curves, and what the best list may save, in corners."""

Lifting = Generator[tuple[States, States], tuple[Flags, Values], States]
"""A search for corners that asks for straight lifts between pairs of states, and waits for them."""


def straighten(states: States, demands: Demands, same_class: bool = False) -> States:
    """Corners of the cheapest chain of straight lifts between any two states of a path.

    A path along edges of a mesh is some per cent too long; every pair of its states that a straight
    lift connects is a short cut. With `same_class` only those count that can be drawn there: all
    states between are reached, too, so that the short cut sweeps over the set.
    """
    most = STATIONS_WITH_MARGINS if demands.objective.needs_margins else STATIONS
    first, second = pairs_on_path(len(states), None if same_class else most)
    linked, cost = connect(states[first], states[second], demands)
    if same_class:
        linked &= _swept(first, second, linked)
    pairs = np.stack([first[linked], second[linked]], axis=1)
    each = cost[linked] + CORNER * cost[second - first == 1].sum()
    path = shortest_path(len(states), pairs, each, (0, len(states) - 1))
    return states if path is None else states[path]


def pairs_on_path(
    count: int, most: int | None
) -> tuple[Int[np.ndarray, " pairs"], Int[np.ndarray, " pairs"]]:
    """Pairs of neighbours on a path, and pairs of all, or of `most`, of its states."""
    if most is None:
        first, second = np.triu_indices(count, 1)
        stride = 1 + len(first) // MOST_SHORTCUTS
        keep = (second - first == 1) | ((second - first) % stride == 0)
        return first[keep], second[keep]
    some = np.unique(np.linspace(0, count - 1, min(count, most)).round().astype(int))
    first, second = (some[each] for each in np.triu_indices(len(some), 1))
    far = second - first > 1
    at = np.arange(count - 1)
    return np.concatenate([at, first[far]]), np.concatenate([at + 1, second[far]])


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


def relax_corners(
    corners: States,
    demands: Demands,
    room: ActuatorBox,
    same_class: bool = False,
) -> States:
    """Corners moved to where the chain of straight lifts costs least.

    Every other corner is tried at once in several directions and the best admissible move is made;
    moves become smaller and smaller. Costs along chords suffice for that, unless the resulting path
    cannot be lifted. Then useless corners are removed.
    """
    corners = _divide_long_legs(corners, demands)
    if same_class:
        corners = move_by_lifts(corners, demands, room, quick=False)
    else:
        corners, whole = _keep_liftable(corners, move_by_chords(corners, demands, room), demands)
        if not whole:
            corners = move_by_lifts(corners, demands, room, quick=True)
    return _lift_for([_thin_out(corners, demands, same_class)], [demands])[0]


def _keep_liftable(before: States, after: States, demands: Demands) -> tuple[States, bool]:
    """Corners after their moves, but for those whose legs cannot be lifted; whether all can."""
    back = np.zeros(len(before), bool)
    while True:
        z = np.where(back[:, None], before.z, after.z)
        corners = States(before.structure, z, np.where(back[:, None], before.p, after.p))
        good, _ = connect(corners[:-1], corners[1:], demands)
        bad = np.flatnonzero(~good)
        if len(bad) == 0 or back[bad].all() & back[bad + 1].all():
            return corners, not back.any()
        back[bad], back[bad + 1] = True, True


def _divide_long_legs(corners: States, demands: Demands) -> States:
    """Corners with further ones between them on long legs."""
    scales = corners.structure.scales
    gap = np.linalg.norm(np.diff(corners.p, axis=0) / scales, axis=1)
    longest = gap.sum() / LEGS
    while len(corners) < MOST_CORNERS:
        gap = np.linalg.norm(np.diff(corners.p, axis=0) / scales, axis=1)
        long = np.flatnonzero(gap > longest)[: MOST_CORNERS - len(corners)]
        if len(long) == 0:
            break
        middle = 0.5 * (corners.p[long] + corners.p[long + 1])
        z, there = _lift_straight(corners[long], middle, demands)
        if not there.all():
            break
        p = np.insert(corners.p, long + 1, middle, axis=0)
        corners = States(corners.structure, np.insert(corners.z, long + 1, z, axis=0), p)
    return corners


def _lift_straight(states: States, p: Parameters, demands: Demands) -> tuple[Lanes, Flags]:
    """States lifted straight to parameters, and whether they arrived."""
    line = ParameterLine(states.structure, states.p.copy(), p - states.p)
    outcome = trace(line, states.z.copy(), demands.constraints, TraceOptions(record=False))
    there = settle(states.structure, outcome.z, p, guards=Guards(iterations=4))
    return there.z, (outcome.code == EventCode.ARRIVED) & there.found


def _thin_out(corners: States, demands: Demands, same_class: bool, gain: float = GAIN) -> Lifting:
    """Fewest corners whose chain costs hardly more.

    Costs along chords say which legs are lifted: those of the best chain, until all of it are.
    """
    first, second = np.triu_indices(len(corners), 1)
    near = second - first <= (3 if demands.objective.needs_margins else MERGED)
    first, second = first[near], second[near]
    legs = _Legs(first, second, *chords(corners, first, second, demands))
    legs.linked[second - first == 1] = True
    each = gain * legs.cost[second - first == 1].sum()
    while True:
        path = legs.cheapest(each, legs.linked)
        if path is None:
            return corners
        known = legs.cheapest(each, legs.linked & legs.lifted)
        if known is not None and legs.spent(known, each) <= legs.spent(path, each) + NEARLY * each:
            return corners[known]
        used = legs.along(path, same_class)
        fresh = used[~legs.lifted[used]]
        found = yield corners[first[fresh]], corners[second[fresh]]
        legs.linked[fresh], legs.cost[fresh] = found
        legs.lifted[fresh] = True
        if same_class:
            legs.linked &= _swept(first, second, legs.linked | ~legs.lifted)


def _lift_for(searches: Sequence[Lifting], demands: Sequence[Demands]) -> list[States]:
    """Results of searches: what they ask for under the same margin is lifted at once."""
    results = dict[int, States]()
    answers: dict[int, Any] = dict.fromkeys(range(len(searches)))
    while answers:
        asked = dict[int, tuple[States, States]]()
        for k, answer in answers.items():
            try:
                asked[k] = searches[k].send(answer)
            except StopIteration as end:
                results[k] = end.value
        for margin in {demands[k].margin for k in asked}:
            some = [k for k in asked if demands[k].margin == margin]
            ends = zip(*(asked[k] for k in some), strict=True)
            source, target = (join_states(each[0].structure, each) for each in ends)
            found = connect(source, target, demands[some[0]])
            cuts = np.cumsum([len(asked[k][0]) for k in some])[:-1]
            parts = zip(*(np.split(each, cuts) for each in found), strict=True)
            answers |= dict(zip(some, parts, strict=True))
        answers = {k: answers[k] for k in asked}
    return [results[k] for k in range(len(searches))]


@dataclass
class _Legs:
    """Pairs of corners, whether they seem or are known to be linked, and at what cost."""

    first: Some
    second: Some
    linked: Flags
    cost: Values

    def __post_init__(self) -> None:
        """Nothing is lifted yet."""
        self.lifted, count = np.zeros(len(self.first), bool), int(self.second.max()) + 1
        self.number = np.zeros((count, count), int)
        self.number[self.first, self.second] = np.arange(len(self.first))

    def cheapest(self, each: float, some: Flags) -> Some | None:
        """Corners of the cheapest chain of some legs, of which each costs more; None without."""
        count, links = len(self.number), (self.first[some], self.second[some])
        return walk_back(before_in_chain(count, *links, self.cost[some] + each), 0, count - 1)

    def along(self, path: Some, same_class: bool) -> Int[np.ndarray, " legs"]:
        """Legs of a chain; within a class all shorter ones from the same corners, too."""
        used = np.asarray(self.number[path[:-1], path[1:]])
        if not same_class:
            return used
        begun = self.number[path[:-1], path[:-1] + 1]
        return np.concatenate([np.arange(*ends) for ends in zip(begun, used + 1, strict=True)])

    def spent(self, path: Some, each: float) -> float:
        """Cost of a chain."""
        return float(self.cost[self.number[path[:-1], path[1:]]].sum() + each * (len(path) - 1))


def order_ends(ends: Ends) -> Ends:
    """Both ends in an order that does not depend on which of them is the start.

    No objective depends on the direction of a route; searched from the same end, a question and its
    reverse have the same answer.
    """
    first, second = (np.concatenate([end.p, end.z]).tolist() for end in ends)
    return ends if first <= second else ends[::-1]


def follow_direction(corners: States, ends: Ends) -> States:
    """Corners between ordered ends, as they follow each other from start to goal."""
    if order_ends(ends) is ends:
        return corners
    return States(corners.structure, corners.z[::-1].copy(), corners.p[::-1].copy())


def check_ends(eset: EquilibriumSet, ends: Ends, *, loop: bool = False) -> None:
    """Raise `InputError` unless start and goal are equilibria of the set's problem.

    They must be different, but for a loop.
    """
    for name, state in zip(("start", "goal"), ends, strict=True):
        check_equilibrium(name, state)
        check_fixed_parameters(name, state, eset)
    same = all(np.array_equal(getattr(ends[0], part), getattr(ends[1], part)) for part in "zp")
    if same and not loop:
        raise InputError("`goal` must differ from `start` without `via`; got the same state.")


def violation(ends: Ends, demands: Demands) -> str:
    """Why start or goal is no admissible end of a route; empty if both are."""
    faults = (
        inadmissible(name, state, demands.constraints, demands.margin)
        for name, state in zip(("start", "goal"), ends, strict=True)
    )
    return next((fault for fault in faults if fault), "")


def verify_way_points(
    ends: Ends, corners: Corners, demands: Demands, monitor: Sequence[Descriptor]
) -> Route:
    """Return the route over way-points, verified, with its cost."""
    return check_margin(verify_route(*ends, corners, demands.constraints, monitor), demands)


def routes_over_corners(
    eset: EquilibriumSet, chains: Sequence[States], demands: Demands, monitor: Sequence[Descriptor]
) -> list[Route]:
    """Return the routes over corners from start to goal, verified, with their costs."""
    steps = [way_points_of(eset, corners) for corners in chains]
    found = verify_corners(chains, steps, demands.constraints, monitor)
    return [check_margin(route, demands) for route in found]


def way_points_of(eset: EquilibriumSet, corners: States) -> Corners:
    """Way-points of a polygon from its first corner."""
    columns = zip(*(corners[name][1:].tolist() for name in eset.names), strict=True)
    return [dict(zip(eset.names, values, strict=True)) for values in columns]


def straight_corners(
    eset: EquilibriumSet, paths: Sequence[States], demands: Demands, best: int | None = None
) -> list[States]:
    """Corners of straightened paths, both ends of each among them.

    `best`: only those of so many paths, the cheapest first, each straightened within its class.
    """
    shortener = Shortener(eset, _closely(paths, demands))
    curves = shortener.curves_near(paths)
    if best is not None and demands.objective.is_length:
        some = shortener.shortest(curves, best)
        paths, curves = [paths[k] for k in some], [curves[k] for k in some]
    corners = _cheapest_corners(eset, paths, curves, demands, same_class=best is not None)
    if best is None:
        return corners
    return sorted(corners, key=lambda each: chain_cost(each, demands))[:best]


def best_corners(eset: EquilibriumSet, paths: Sequence[States], demands: Demands) -> States:
    """Corners of the path, of those given, whose shortest curve is the shortest, straightened."""
    if len(paths) == 1:
        return straight_corners(eset, paths, demands)[0]
    best, curve = Shortener(eset, _closely(paths, demands)).shortest_near(paths)
    return _cheapest_corners(eset, [paths[best]], [curve], demands, same_class=False)[0]


def _closely(paths: Sequence[States], demands: Demands) -> Demands:
    """Demands on lifts as fine as the final ones, which meet other states between the same ends."""
    if demands.margin == 0.0 or not paths:
        return replace(demands, closely=True)
    least = min(float(path[[0, -1]].margin.min()) for path in paths)
    more = min((1.0 + BETWEEN) * demands.margin, least)
    return replace(demands, closely=True, margin=max(more, demands.margin))


def _cheapest_corners(
    eset: EquilibriumSet,
    paths: Sequence[States],
    curves: Sequence[States | None],
    demands: Demands,
    same_class: bool,
) -> list[States]:
    """Corners of the shortest curves near paths, or cheaper ones where other than lengths count."""
    near = {k: curve for k, curve in enumerate(curves) if curve is not None}
    closely = [_closely([paths[k]], demands) for k in near]
    searches = [
        _thin_out(curve, own, same_class, FINE_GAIN)
        for curve, own in zip(near.values(), closely, strict=True)
    ]
    shortest = dict(zip(near, _lift_for(searches, closely), strict=True))
    return [
        shortest[k]
        if k in shortest and demands.objective.is_length
        else _cheaper(eset, path, shortest.get(k), demands, same_class)
        for k, path in enumerate(paths)
    ]


def _cheaper(
    eset: EquilibriumSet, path: States, shortest: States | None, demands: Demands, same_class: bool
) -> States:
    """Corners of a path, or those of the shortest curve near it, moved to where they cost least."""
    free = np.array([position(eset.structure.parameters, name) for name in eset.names])
    room = ActuatorBox(eset.box, free)
    ways = [
        relax_corners(each, demands, room, same_class)
        for each in (straighten(path, demands, same_class), shortest)
        if each is not None
    ]
    return min(ways, key=lambda way: _total(way, demands))


def chain_cost(corners: States, demands: Demands) -> float:
    """Cost along the chords from corner to corner."""
    at = np.arange(len(corners) - 1)
    return float(chords(corners, at, at + 1, demands)[1].sum())


def _total(way: States, demands: Demands) -> float:
    """Cost of straight lifts from corner to corner; infinite if one of them fails."""
    linked, cost = connect(way[:-1], way[1:], demands)
    return float(cost.sum()) if linked.all() else np.inf


def check_margin(route: Route, demands: Demands) -> Route:
    """Return the route with its cost, refused if its margin falls below what is demanded."""
    if not route.arrived:
        return route
    if route.margin >= demands.margin:
        assert route.path is not None
        assert route.schedule is not None
        aim = demands.objective
        cost, schedule = aim.along(route.path.states), aim.with_times(route.schedule)
        return replace(route, objective=str(aim), cost=cost, schedule=schedule)
    return refusal(
        f"the stability margin falls to {route.margin:.4g} on the way, below {demands.margin:g}",
        route.way_points,
        route.path,
    )
