"""`plan`: a stable route between two states of an equilibrium set."""

from collections.abc import Mapping, Sequence

import numpy as np

from equimorph.equilibria import check_start, way_points
from equimorph.errors import InputError
from equimorph.manifold import EquilibriumSet
from equimorph.model import Constraint, Descriptor
from equimorph.structures import State
from equimorph.tasks.network import free_route
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
    monitor: Sequence[Descriptor] = (),
) -> Route:
    """Plan a route from `start` to `goal` on which every state is stable.

    With `via`, the way-points are lifted as given. Without, the shortest path over the stable cells
    of the complex is found, straightened by lifting, and its corners are the way-points. Either
    way the route is lifted again at a finer step before it is returned.

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
    constraints = tuple(dict.fromkeys((*eset.constraints, *within)))
    ends = {"start": start, "goal": goal}
    for name, state in ends.items():
        _check_belongs(eset, name, state)
    corners = None if via is None else _checked_corners(eset, start, goal, via)
    faults = [_violation(name, state, constraints, margin) for name, state in ends.items()]
    why = next((fault for fault in faults if fault), None)
    if why:
        return refused(why, corners)
    if corners is not None:
        return _kept(verified(start, goal, corners, constraints, monitor), margin)
    return _free(eset, (start, goal), constraints, margin, monitor)


def _free(
    eset: EquilibriumSet,
    ends: tuple[State, State],
    constraints: tuple[Constraint, ...],
    margin: float,
    monitor: Sequence[Descriptor],
) -> Route:
    """Return the shortest route found, searched with a growing reserve of margin."""
    start, goal = ends
    for reserve in RESERVES:
        found = free_route(eset, start, goal, constraints, margin * reserve)
        if isinstance(found, str):
            return refused(found)
        route = _kept(verified(start, goal, found, constraints, monitor), margin)
        if route.arrived:
            break
    return route


def _kept(route: Route, margin: float) -> Route:
    """Return the route, refused if its margin falls below what is demanded."""
    if not route.arrived or route.margin >= margin:
        return route
    return refused(
        f"the stability margin falls to {route.margin:.4g} on the way, below {margin:g}",
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


def _violation(
    name: str, state: State, constraints: tuple[Constraint, ...], margin: float
) -> str | None:
    """Why a state is no admissible end of a route, if it is not."""
    for constraint in constraints:
        if not constraint.holds(state.batch)[0]:
            value = constraint.descriptor(state)
            return f"the {name} violates {constraint}: {constraint.descriptor.name} = {value:.6g}"
    if not state.stable:
        return f"the {name} is unstable (index {state.index})"
    if state.margin < margin:
        return f"the {name} has a stability margin of {state.margin:.4g}, below {margin:g}"
    return None
