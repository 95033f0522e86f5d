"""`plan`: a stable route between two states of an equilibrium set.

A route that has to survive errors is planned with larger and larger margins until one is shown to.

See docs/decisions.md, "Routes are judged by lifts".
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from equimorph.argument_checks import check_arguments
from equimorph.equilibria import way_points
from equimorph.errors import InputError
from equimorph.manifold import EquilibriumSet
from equimorph.model import Constraint, Descriptor
from equimorph.structures import State, margin_of
from equimorph.tasks.planning.bottlenecks import find_bottleneck
from equimorph.tasks.planning.free_routes import free_route, route_with_lowest_peak, with_extreme
from equimorph.tasks.planning.network import Demands, Ends
from equimorph.tasks.planning.objectives import Extreme, Wish, least
from equimorph.tasks.planning.refusals import free_or_over_a_pass
from equimorph.tasks.planning.snap_routes import route_with_snaps
from equimorph.tasks.planning.straightening import check_ends, verify_way_points, violation
from equimorph.tasks.robustness.error_model import Errors
from equimorph.tasks.robustness.evidence import Survival
from equimorph.tasks.robustness.survival import rest_survives, survival, trial_room
from equimorph.tasks.route import Corners, Route, refusal
from equimorph.tasks.start import Start, start_state


@check_arguments
def plan(  # noqa: PLR0913  # the knobs of the public face, most by keyword
    eset: EquilibriumSet,
    start: Start,
    goal: State,
    *,
    via: Sequence[Mapping[str, float]] | None = None,
    within: Sequence[Constraint] = (),
    margin: float = 0.0,
    objective: Wish | Extreme = "length",
    snap_price: float | None = None,
    survive: Mapping[str, float] | Errors | None = None,
    monitor: Sequence[Descriptor] = (),
) -> Route:
    """Plan a route from `start` to `goal` on which every state is stable.

    With `via`, the way-points are lifted as given. Without, the cheapest path over the stable cells
    of the complex is found, straightened by lifting, and its corners are moved to where it costs
    least; they are the way-points. Either way the route is lifted again with finer steps before it
    is returned. The network of the cells is kept with the set, so that later routes take less time.

    Parameters
    ----------
    eset
        Equilibrium set over the actuators.
    start
        Stable equilibrium in the box of the set, with its fixed parameters; or what `locate` or
        `estimate_state` says of a measured one.
    goal
        Another equilibrium of the set's problem.
    via
        Way-points {name: value}, each changing some of the free parameters.
    within
        Constraints to obey on the way, in addition to those of the set.
    margin
        Smallest stability margin allowed, in the structure's metric.
    objective
        What the route minimises: "length" (metric), "travel" (scaled parameters), "work" (of
        actuators that recover no energy), "clearance" (``∫ ds/margin``), a descriptor d like the
        energy barrier (``∫ ds/d``), `Rates` (time; the schedule then has times), or a sum
        ``[(1, "length"), (0.2, "work")]``; see `Objective`. The result is a local minimum near the
        best path over the mesh; from goal to start it is the same, backwards. Lengths do not depend
        on mirror or grid by more than 0.2 %. Along a fold a route has many way-points. With `peak`
        or `least` the largest or least value of a descriptor on the way counts first, then the
        length: `route.bottleneck` has the exact value and where the route cannot avoid it.
    snap_price
        Cost of a snap-through in units of the objective; None forbids them. With a price the route
        may leave its stable stratum over a fold and continue where the snap lands: `route.snaps`
        has the landings, with the energy released; no margin is kept before a snap. The snap
        happens where on its fold the route is cheapest; no route is dearer than one without.
    survive
        Errors that the route has to survive, by name: half widths of a box, or `Errors`. A box is
        proved or, by sampled bounds, supported, a probability shown by trials; `route.survival` is
        the answer of `survival`. Where the route does not survive, others with larger margins are
        tried. Way-points are judged as they are; snaps are not allowed.
    monitor
        Descriptors to record in the schedule, in addition to those of the constraints.

    Returns
    -------
    A verified route, or the reason why none was found.

    Raises
    ------
    InputError
        If `start` or `goal` is no equilibrium of the set's problem, a way-point lies outside the
        box, `margin` is negative, or an error means no parameter and no data of the structure.
    """
    start = start_state(start)
    extreme = objective if isinstance(objective, Extreme) else None
    wish: Wish = "length" if isinstance(objective, Extreme) else objective
    demands = Demands.of(eset.structure, wish, (*eset.constraints, *within), margin)
    ends = (start, goal)
    check_ends(eset, ends, loop=via is not None)
    corners = None if via is None else _check_corners(eset, start, goal, via)
    _check_price(snap_price, via, extreme)
    if survive is not None and snap_price is not None:
        raise InputError("`snap_price` must not be given with `survive`; got both.")
    why = violation(ends, demands)
    if why:
        return refusal(why, corners)
    if corners is not None:
        given = with_extreme(verify_way_points(ends, corners, demands, monitor), extreme)
        return given if survive is None else judged(given, ends, demands, survive)

    def planned(demands: Demands) -> Route:
        if extreme is not None:
            return route_with_lowest_peak(eset, ends, extreme, demands, monitor)
        free = free_route(eset, ends, demands, monitor)
        if snap_price is None:
            return free_or_over_a_pass(eset, ends, demands, monitor, free)
        known = free.cost if free is not None and free.arrived else np.inf
        snapping = route_with_snaps(eset, ends, demands, snap_price, monitor, known)
        arrived = [route for route in (free, snapping) if route is not None and route.arrived]
        return min(arrived, key=lambda route: route.cost, default=snapping)

    if survive is None:
        return planned(demands)
    return surviving_route(eset, ends, demands, survive, planned)


def _check_price(
    snap_price: float | None,
    via: Sequence[Mapping[str, float]] | None,
    extreme: Extreme | None,
) -> None:
    if snap_price is not None and via is not None:
        raise InputError("`via` must not be given with `snap_price`; got both.")
    if snap_price is not None and extreme is not None:
        raise InputError(
            f"`snap_price` must not be given with the objective {extreme}; got {snap_price!r}."
        )


def _check_corners(
    eset: EquilibriumSet,
    start: State,
    goal: State,
    via: Sequence[Mapping[str, float]],
) -> Corners:
    """Way-points with the goal's parameters appended if they do not end there."""
    corners: Corners = [{name: float(value) for name, value in step.items()} for step in via]
    for step in corners:
        for name in step:
            if name not in eset.names:
                raise InputError(
                    f"`via` must change free parameters ({', '.join(eset.names)}); got {name!r}."
                )
    points = way_points(start.structure, start.p, corners) if corners else [start.p]
    free = [list(start.parameters).index(name) for name in eset.names]
    for number, point in enumerate(points[1:]):
        if not eset.box.holds(point[free], slack=1e-12):
            raise InputError(f"`via[{number}]` must lie in {eset.box}; got {corners[number]}.")
    if not np.allclose(points[-1], goal.p, rtol=0, atol=1e-12):
        corners.append({name: goal[name] for name in eset.names})
    return corners


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

    Or one that was refused, which says whether there is none or none was found. `planned` plans
    routes that meet demands.
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
