"""`plan`: a stable route between two states of an equilibrium set."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from equimorph.equilibria import check_start, way_points
from equimorph.errors import InputError
from equimorph.manifold import EquilibriumSet
from equimorph.model import Constraint, Descriptor, eased, position
from equimorph.structures import State, States
from equimorph.tasks.planning.links import Demands
from equimorph.tasks.planning.network import cheapest_path, no_route
from equimorph.tasks.planning.objectives import Wish, objective_of
from equimorph.tasks.planning.straightening import relaxed, straightened
from equimorph.tasks.route import Corners, Route, refused, verified

RESERVES = (1.0, 1.02, 1.1)
"""Factors on the demanded margin: dips between the points that are watched need a reserve."""


def plan(  # noqa: PLR0913  # the knobs of the public face, all by keyword
    eset: EquilibriumSet,
    start: State,
    goal: State,
    *,
    via: Sequence[Mapping[str, float]] | None = None,
    within: Sequence[Constraint] = (),
    margin: float = 0.0,
    objective: Wish = "length",
    monitor: Sequence[Descriptor] = (),
) -> Route:
    """Plan a route from `start` to `goal` on which every state is stable.

    With `via`, the way-points are lifted as given. Without, the cheapest path over the stable cells
    of the complex is found, straightened by lifting and drawn to where it costs least; its corners
    are the way-points. Either way the route is lifted again at a finer step before it is returned.
    The network of the cells is kept with the set, so that later routes take less time.

    Parameters
    ----------
    start, goal
        Equilibria in the box of the set, with its fixed parameters.
    via
        Way-points {name: value}, each changing some of the free parameters.
    within
        Constraints to obey on the way, beside those of the set.
    margin
        Smallest stability margin allowed, in the structure's metric.
    objective
        What the route should have least of: "length" (metric), "travel" (scaled parameters), "work"
        (actuators that get nothing back), "clearance" (``∫ ds/margin``), `Rates` (time), or a sum
        ``[(1, "length"), (0.2, "work")]``; see `Objective`. A local minimum near the best path over
        the mesh.
    monitor
        Descriptors to record in the schedule, beside those of the constraints.

    Returns
    -------
    A verified route, or the reason why there is none.

    Raises
    ------
    InputError
        If `start` or `goal` is no equilibrium of the set's problem, a way-point lies outside the
        box, or `margin` is negative.
    """
    if not margin >= 0.0:
        raise InputError(f"`margin` must be a number >= 0; got {margin!r}.")
    demands = Demands(
        objective_of(objective, eset.structure),
        tuple(eased(each) for each in dict.fromkeys((*eset.constraints, *within))),
        margin,
    )
    ends = {"start": start, "goal": goal}
    for name, state in ends.items():
        _check_belongs(eset, name, state)
    corners = None if via is None else _checked_corners(eset, start, goal, via)
    faults = [_violation(name, state, demands) for name, state in ends.items()]
    why = next((fault for fault in faults if fault), None)
    if why:
        return refused(why, corners)
    if corners is not None:
        return _kept(verified(start, goal, corners, demands.constraints, monitor), demands)
    return _free(eset, (start, goal), demands, monitor)


def _free(
    eset: EquilibriumSet,
    ends: tuple[State, State],
    demands: Demands,
    monitor: Sequence[Descriptor],
) -> Route:
    """Return the cheapest route found, searched with a growing reserve of margin."""
    for reserve in RESERVES:
        tightened = replace(demands, margin=demands.margin * reserve)
        path = cheapest_path(eset, ends, tightened)
        if path is None:
            return refused(no_route(eset, ends, tightened))
        route = _kept(
            verified(*ends, corners_of(eset, path, tightened), demands.constraints, monitor),
            demands,
        )
        if route.arrived:
            break
    return route


def corners_of(
    eset: EquilibriumSet, path: States, demands: Demands, same_class: bool = False
) -> Corners:
    """Way-points of a straightened path."""
    corners = straightened(path, demands, same_class)
    free = np.array([position(eset.structure.parameters, name) for name in eset.names])
    corners = relaxed(corners, demands, eset.box, free)
    return [{name: corner[name] for name in eset.names} for corner in list(corners)[1:]]


def _kept(route: Route, demands: Demands) -> Route:
    """Return the route with its cost, refused if its margin falls below what is demanded."""
    if not route.arrived:
        return route
    if route.margin >= demands.margin:
        assert route.path is not None
        cost = demands.objective.along(route.path.states)
        return replace(route, objective=str(demands.objective), cost=cost)
    return refused(
        f"the stability margin falls to {route.margin:.4g} on the way, below {demands.margin:g}",
        route.way_points,
        route.path,
    )


def _check_belongs(eset: EquilibriumSet, name: str, state: State) -> None:
    try:
        check_start(state)
    except InputError as error:
        raise InputError(str(error).replace("`state`", f"`{name}`")) from None
    here = {free: state[free] for free in eset.names}
    wanted = eset.parameters_at(here)
    if not np.allclose(wanted, state.p, rtol=0, atol=1e-9):
        raise InputError(
            f"`{name}` must have the fixed parameters of the set ({dict(eset.fixed)}); "
            f"got {state.parameters}."
        )


def _checked_corners(
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
        if not eset.box.contains(point[free], slack=1e-12):
            raise InputError(f"`via[{number}]` must lie in {eset.box}; got {corners[number]}.")
    if not np.allclose(points[-1], goal.p, rtol=0, atol=1e-12):
        corners.append({name: goal[name] for name in eset.names})
    return corners


def _violation(name: str, state: State, demands: Demands) -> str | None:
    """Why a state is no admissible end of a route, if it is not."""
    for constraint in demands.constraints:
        if not constraint.holds(state.batch)[0]:
            value = constraint.descriptor(state)
            return f"the {name} violates {constraint}: {constraint.descriptor.name} = {value:.6g}"
    if not state.stable:
        return f"the {name} is unstable (index {state.index})"
    if state.margin < demands.margin:
        return f"the {name} has a stability margin of {state.margin:.4g}, below {demands.margin:g}"
    return None
