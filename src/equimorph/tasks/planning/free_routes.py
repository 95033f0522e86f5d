"""Routes without a snap: searched on the network, straightened, verified; with a peak kept low."""

from collections.abc import Sequence
from dataclasses import replace
from itertools import islice

import numpy as np

from equimorph.arrays import Lanes, Parameters, Values
from equimorph.manifold import EquilibriumSet
from equimorph.model import Constraint, Descriptor, ease
from equimorph.structures import States, join_states, stability_margin
from equimorph.structures.metric import metric_length
from equimorph.tasks.optimising.programme import Objective
from equimorph.tasks.planning.bottlenecks import Passing, find_bottleneck
from equimorph.tasks.planning.filtration import Filtration
from equimorph.tasks.planning.mesh_paths import cheap_paths, cheapest_path
from equimorph.tasks.planning.network import (
    Demands,
    Ends,
    connect,
    explain_no_route,
)
from equimorph.tasks.planning.objectives import ROUGH, Extreme
from equimorph.tasks.planning.straightening import (
    best_corners,
    follow_direction,
    order_ends,
    routes_over_corners,
)
from equimorph.tasks.route import Route, describe_place, refusal
from equimorph.tasks.stable_part import cell_near

SHORTEST = 2
"""Steps of a way over a pass, at least."""
MOST_PATHS = 4
"""Paths over the mesh, apart from each other, of which the shortest curves are compared."""
KEPT = (0.9, 0.5)
"""Shares of the largest possible margin that a route with a low peak tries to keep."""


def free_route(
    eset: EquilibriumSet,
    ends: Ends,
    demands: Demands,
    monitor: Sequence[Descriptor],
    passing: Passing | None = None,
) -> Route | None:
    """Return the cheapest route that was found, else the last one refused; None if no path exists.

    With `passing` it leads over that pass, if there is such a path. It is searched with a growing
    reserve of margin; what leaves no room for a reserve is searched without one before it is
    refused.
    """
    route = _with_reserves(eset, ends, demands, monitor, passing)
    if route is not None and not route.arrived and demands.constraints:
        # coarse lifts step over corners of what is forbidden
        closely = replace(demands, closely=True)
        return _with_reserves(eset, ends, closely, monitor, passing) or route
    return route


def _with_reserves(
    eset: EquilibriumSet,
    ends: Ends,
    demands: Demands,
    monitor: Sequence[Descriptor],
    passing: Passing | None,
) -> Route | None:
    route, least = None, _least_margin(ends, passing)
    for tightened in demands.with_reserves(least):
        found = route_with_reserve(eset, ends, (demands, tightened), monitor, passing)
        route = found or route
        if route is not None and route.arrived:
            return route
    return route


def route_with_reserve(
    eset: EquilibriumSet,
    ends: Ends,
    given: tuple[Demands, Demands],
    monitor: Sequence[Descriptor] = (),
    passing: Passing | None = None,
) -> Route | None:
    """Return a route, arrived or refused, for demands and tightened ones; None without a path."""
    demands, tightened = given
    paths = _paths(eset, ends, tightened, passing)
    if not paths:
        return None
    corners = best_corners(eset, paths, tightened)
    return routes_over_corners(eset, [follow_direction(corners, ends)], demands, monitor)[0]


def _least_margin(ends: Ends, passing: Passing | None) -> float:
    over = None if passing is None else passing.over
    margins = [end.margin for end in ends] + ([] if over is None else over.margin.tolist())
    return float(min(margins))


def _paths(
    eset: EquilibriumSet, ends: Ends, demands: Demands, passing: Passing | None
) -> list[States]:
    """Cheapest path between the ordered ends over the network, and a pass; else the lowest way.

    Where the length counts, and there is no pass, other cheap paths apart from it, too: over the
    mesh paths are up to a tenth too long, each by another part.
    """
    first, last = order_ends(ends)
    over = None if passing is None else _link_over(passing, demands)
    for way in () if over is None else (over, over[::-1]):
        parts = (cheapest_path(eset, (first, way[0]), demands), way[1:-1],
                 cheapest_path(eset, (way[-1], last), demands))  # fmt: skip
        if parts[0] is not None and parts[2] is not None:
            return [join_states(eset.structure, [each for each in parts if each is not None])]
    most = MOST_PATHS if demands.objective.is_length else 1
    paths = list(islice(cheap_paths(eset, (first, last), demands), most))
    if paths or passing is None:
        return paths
    return [passing.way if order_ends(ends) is ends else passing.way[::-1]]


def _link_over(passing: Passing, demands: Demands) -> States | None:
    """Of the states over a pass those around it that straight lifts join.

    Farther off, where the network is wide, they may lie close along a bound that bends.
    """
    over = passing.over
    if over is None or len(over) <= SHORTEST:
        return over
    linked, _ = connect(over[:-1], over[1:], demands)
    gap = metric_length(over.structure, over.z - passing.bottleneck.state.z)
    middle, broken = int(gap.argmin()), np.flatnonzero(~linked)
    start = int(broken[broken < middle].max(initial=-1)) + 1
    end = int(broken[broken >= middle].min(initial=len(linked)))
    return over if end - start < SHORTEST else over[start : end + 1]


def with_extreme(route: Route, extreme: Extreme | None) -> Route:
    """Return a route with its largest or least value as its cost."""
    if extreme is None or route.states is None or not route.arrived:
        return route
    return replace(route, objective=str(extreme), cost=extreme.along(route.states))


def route_with_lowest_peak(
    eset: EquilibriumSet,
    ends: Ends,
    extreme: Extreme,
    demands: Demands,
    monitor: Sequence[Descriptor],
) -> Route:
    """Return the shortest route found of those with the lowest peak, which keeps a margin.

    A margin counts before the length: along the edge of stability routes are short.
    """
    bounds = demands.beyond(eset)
    found = find_bottleneck(eset, ends, extreme, bounds, demands.margin)
    if found is None:
        return refusal(explain_no_route(eset, ends, demands))
    bottleneck, bound = found.bottleneck, found.bound
    within = replace(demands, constraints=(*demands.constraints, ease(bound)))
    largest = min(_least_margin(ends, found), _margin_of_ways(eset, ends, (*bounds, bound)))
    for share in (*KEPT, 0.0):
        safe = replace(within, margin=max(within.margin, share * largest))
        route = free_route(eset, ends, safe, (*monitor, extreme.descriptor), found)
        if route is not None and route.arrived:
            return replace(with_extreme(route, extreme), bottleneck=bottleneck)
    where = describe_place(bottleneck.state, eset.names)
    best = f"the {extreme} is {bottleneck.value:.8g} at {where} ({bottleneck.kind})"
    why = f"{best}, but no route was verified within {bound}"
    return replace(refusal(why), bottleneck=bottleneck)


def _margin_of_ways(eset: EquilibriumSet, ends: Ends, bounds: Sequence[Constraint]) -> float:
    """Largest margin that a way over the mesh can keep; ∞ if the mesh has no way."""
    structure = eset.structure

    def rough(z: Lanes, p: Parameters) -> Values:
        return stability_margin(structure, z, p, ROUGH)

    margin = Descriptor("rough margin", "1", rough, "", structure.signature)
    filtration = Filtration.of(eset, Objective(margin, -1.0), tuple(bounds))
    way = filtration.way(*(cell_near(eset, end) for end in ends))
    return np.inf if way is None else -float(filtration.level[way].max(initial=-np.inf))
