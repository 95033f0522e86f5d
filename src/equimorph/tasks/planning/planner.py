"""`plan`: a stable route between two states of an equilibrium set.

A route that has to survive errors is planned with larger and larger margins until one is shown to.

See docs/decisions.md, "Routes are judged by lifts".

Where the network has no path, a route leads over an exact pass, or is refused with what binds.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from equimorph.argument_checks import check_arguments
from equimorph.equilibria import way_points
from equimorph.errors import InputError
from equimorph.linalg.graphs import components
from equimorph.manifold import EquilibriumSet
from equimorph.model import Constraint, Descriptor, ease
from equimorph.structures import State, margin_of
from equimorph.structures.metric import metric_length
from equimorph.tasks.planning.bottlenecks import Passing, find_bottleneck
from equimorph.tasks.planning.free_routes import (
    free_route,
    route_with_lowest_peak,
    route_with_reserve,
    with_extreme,
)
from equimorph.tasks.planning.network import (
    Demands,
    Ends,
    end_links,
    explain_no_route,
    network_of,
    nodes_with_ends,
)
from equimorph.tasks.planning.objectives import Extreme, Wish, least, peak
from equimorph.tasks.planning.snap_routes import route_with_snaps
from equimorph.tasks.planning.straightening import check_ends, verify_way_points, violation
from equimorph.tasks.robustness.error_model import Errors
from equimorph.tasks.robustness.evidence import Survival
from equimorph.tasks.robustness.survival import rest_survives, survival, trial_room
from equimorph.tasks.route import Corners, Relaxation, Route, refusal
from equimorph.tasks.start import Start, start_state

NEARLY = 0.9
"""Share of the room between a pass and a limit that routes over it use."""
SLACK = 0.01
"""Share of a bound, or of its difference to an end, within which a route verifies it."""


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
            return _free_or_over_a_pass(eset, ends, demands, monitor, free)
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


@dataclass(frozen=True)
class _Demand:
    """What a demand bounds, in words, its limit, the other demands, and the pass within these."""

    extreme: Extreme
    words: str
    limit: float
    others: Demands
    found: Passing | None

    @classmethod
    def of(
        cls, eset: EquilibriumSet, ends: Ends, extreme: Extreme, limit: float, others: Demands
    ) -> "_Demand":
        """The lowest peak of what is bounded, within the others."""
        found = find_bottleneck(eset, ends, extreme, others.beyond(eset), others.margin)
        if found is not None:
            # routes over the pass stay within the limit, if there is room
            room = extreme.sign * (found.bound.bound - found.bottleneck.value)
            left = extreme.sign * (limit - found.bottleneck.value)
            if 0.0 < left < room:
                near = replace(extreme, slack=extreme.slack * NEARLY * left / room)
                found = find_bottleneck(eset, ends, near, others.beyond(eset), others.margin)
        words = f"{extreme.descriptor.name} {'<=' if extreme.sign > 0.0 else '>='}"
        return cls(extreme, words, limit, others, found)

    @property
    def holds(self) -> bool:
        """Whether the pass obeys the limit."""
        found, sign = self.found, self.extreme.sign
        return found is not None and sign * found.bottleneck.value < sign * self.limit


def _free_or_over_a_pass(
    eset: EquilibriumSet,
    ends: Ends,
    demands: Demands,
    monitor: Sequence[Descriptor],
    given: Route | None,
) -> Route:
    """Return a given route of the network that arrived, one over an exact pass, or a refusal.

    Ways between a bound and a fold may be thinner than the cells. Where the lowest peak of what is
    bounded obeys the bound, a route leads over that pass. The refusal of a given route, the best
    one over the network, stands if there is none.

    A refusal has the least relaxation of each demand that would do by itself: the lowest peak of
    what is bounded within the other demands, verified by a route. Where start and goal lie on
    different stable components, nothing relaxes that. The refusal carries the state nearest to the
    goal that a route reaches.
    """
    if given is not None and given.arrived:
        return given
    bounded = list(_demands(eset, ends, demands))
    for each in bounded:
        route = free_route(eset, ends, demands, monitor, each.found) if each.holds else None
        if route is not None and route.arrived:
            return route
    if given is not None:
        return given
    refused = refusal(explain_no_route(eset, ends, demands))
    relaxed = tuple(_relaxations(eset, ends, bounded))
    nearest = _nearest(eset, ends, demands)
    if nearest is not None:
        stays = np.array_equal(nearest.p, ends[0].p) and np.allclose(nearest.z, ends[0].z)
        route = None if stays else free_route(eset, (ends[0], nearest), demands, monitor)
        if stays or (route is not None and route.arrived):
            refused = replace(refused, nearest=nearest)
    return replace(refused, relaxations=relaxed)


def _relaxations(
    eset: EquilibriumSet, ends: Ends, demands: Sequence[_Demand]
) -> Iterator[Relaxation]:
    """Of the demands in addition to those of the set, those that give way alone."""
    for each in demands:
        if each.found is not None:
            best = each.found.bottleneck
            bounds = (*each.others.constraints, ease(each.found.bound))
            relaxed = replace(each.others, constraints=bounds)
            route = route_with_reserve(eset, ends, (relaxed, relaxed), (), each.found)
            attained = np.nan
            if route is not None and route.arrived and route.states is not None:
                attained = each.extreme.along(route.states)
            yield Relaxation(f"{each.words} {best.value:.8g}", best.value, attained, best.state)


def _demands(eset: EquilibriumSet, ends: Ends, demands: Demands) -> Iterator[_Demand]:
    """What each demand bounds, and the others."""
    for each in demands.beyond(eset):
        rest = tuple(other for other in demands.constraints if replace(other, ease=0.0) != each)
        others = replace(demands, constraints=rest)
        if each.sense == "<=":
            yield _Demand.of(eset, ends, peak(each.descriptor, SLACK), each.bound, others)
        elif each.descriptor.branches is None:
            yield _Demand.of(eset, ends, least(each.descriptor, SLACK), each.bound, others)
    if demands.margin > 0.0:
        margin = least(margin_of(eset.structure), SLACK)
        others = replace(demands, margin=0.0)
        yield _Demand.of(eset, ends, margin, demands.margin, others)


def _nearest(eset: EquilibriumSet, ends: Ends, demands: Demands) -> State | None:
    """Vertex joined to the start within the demands that is nearest to the goal in the metric."""
    network, count = network_of(eset), len(eset.points)
    allowed = network.admissible(eset, demands)
    broken, _ = network.verdicts(demands)
    own, _ = end_links(eset, ends, demands)
    inner = network.pairs[allowed[network.pairs].all(axis=1) & ~broken]
    pairs = np.concatenate([inner, own])
    label = components(count + 2, pairs)
    some = np.flatnonzero(label[:count] == label[count])
    if len(some) == 0:
        return None
    states, structure = nodes_with_ends(eset, ends)[some], eset.structure
    gap = metric_length(structure, states.z - ends[1].z)
    gap = np.hypot(gap, np.linalg.norm((states.p - ends[1].p) / structure.scales, axis=1))
    return states[int(gap.argmin())]
