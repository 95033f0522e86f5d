"""Routes that survive errors: planned with larger and larger margins until one is shown to."""

from collections.abc import Callable, Mapping
from dataclasses import replace

from equimorph.manifold import EquilibriumSet
from equimorph.structures import margin_of
from equimorph.tasks.planning.bottlenecks import find_bottleneck
from equimorph.tasks.planning.free_routes import route_with_lowest_peak
from equimorph.tasks.planning.network import Demands, Ends
from equimorph.tasks.planning.objectives import least
from equimorph.tasks.robustness.erring import Errors
from equimorph.tasks.robustness.evidence import Survival
from equimorph.tasks.robustness.survival import rest_survives, survival, trial_room
from equimorph.tasks.route import Route

FLOORS = (0.3, 0.6, 0.85)
"""Shares of the largest possible margin that are demanded in turn, before the largest itself."""

Given = Mapping[str, float] | Errors


def surviving_route(
    eset: EquilibriumSet,
    ends: Ends,
    demands: Demands,
    errors: Given,
    planned: Callable[[Demands], Route],
) -> Route:
    """Return the first route that survives errors, of those with growing least margins.

    Parameters
    ----------
    eset, ends, demands
        The set, start and goal, and what the route has to obey.
    errors
        What it has to survive.
    planned
        How routes are planned that meet demands.

    Returns
    -------
    The route; or one that was refused, which says whether there is none or none was found.
    """
    for name, end in zip(("start", "goal"), ends, strict=True):
        found = rest_survives(end, errors, demands.constraints)
        if not found.survives:
            why = f"no route can survive: `{name}` itself does not. {found.why}"
            return Route("refused", why, [], survival=found)
    best = judged(planned(demands), ends, demands, errors)
    if best.arrived or best.survival is None:
        return best
    within = demands.beyond(eset)
    widest = least(margin_of(eset.structure))
    bottleneck = find_bottleneck(eset, ends, widest, within, demands.margin)
    if bottleneck is not None:
        top = bottleneck.bottleneck.value
        floors = [share * top for share in FLOORS if share * top > demands.margin]
        tries: list[Callable[[], Route]] = [
            lambda floor=floor: planned(replace(demands, margin=floor))  # type: ignore[misc]
            for floor in floors
        ]
        tries.append(lambda: route_with_lowest_peak(eset, ends, widest, demands, ()))
        for attempt in tries:
            route = judged(attempt(), ends, demands, errors)
            if route.arrived:
                return route
            best = route if route.survival is not None else best
    assert best.survival is not None
    return replace(best, why=_explain(best, ends, demands, best.survival))


def judged(route: Route, ends: Ends, demands: Demands, errors: Given) -> Route:
    """Return a route with what is shown of its survival, refused if it does not survive."""
    if not route.arrived or route.schedule is None:
        return route
    found = survival(ends[0], route.schedule, errors, within=demands.constraints)
    if found.survives:
        return replace(route, survival=found)
    why = f"it is not shown to survive errors {found.errors}: {found.why}"
    return replace(route, status="refused", why=why, survival=found)


def _explain(route: Route, ends: Ends, demands: Demands, found: Survival) -> str:
    """Reason of a refusal, and how large errors the best route survives."""
    assert route.schedule is not None
    words = f"no route that survives was found, up to the largest margin {route.margin:.4g}"
    room = ""
    if found.errors.probability is None:
        scale = trial_room(ends[0], route.schedule, found.errors, within=demands.constraints)
        room = f"; trials survive {scale:.3g} times these errors"
    return f"{words}: {found.why}{room}"
