"""Which ends a route may have, and what becomes of a path once it is found."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from equimorph.equilibria import check_start
from equimorph.errors import InputError
from equimorph.manifold import EquilibriumSet
from equimorph.model import Descriptor, position
from equimorph.structures import State, States
from equimorph.tasks.planning.links import Demands
from equimorph.tasks.planning.network import Ends
from equimorph.tasks.planning.straightening import relaxed, straightened
from equimorph.tasks.route import Corners, Route, refused, verified


def check_ends(eset: EquilibriumSet, ends: Ends) -> None:
    """Raise `InputError` unless start and goal are equilibria of the set's problem."""
    for name, state in zip(("start", "goal"), ends, strict=True):
        _check_belongs(eset, name, state)


def violation(ends: Ends, demands: Demands) -> str | None:
    """Why start or goal is no admissible end of a route, if one is not."""
    faults = (_fault(name, end, demands) for name, end in zip(("start", "goal"), ends, strict=True))
    return next((fault for fault in faults if fault), None)


def checked_route(
    ends: Ends, corners: Corners, demands: Demands, monitor: Sequence[Descriptor]
) -> Route:
    """Return the route over way-points, verified, with its cost."""
    return kept_margin(verified(*ends, corners, demands.constraints, monitor), demands)


def route_along(
    eset: EquilibriumSet, corners: States, demands: Demands, monitor: Sequence[Descriptor]
) -> Route:
    """Return the route over corners from start to goal, verified, with its cost."""
    ends, steps = (corners[0], corners[len(corners) - 1]), way_points_of(eset, corners)
    found = verified(*ends, steps, demands.constraints, monitor, corners)
    return kept_margin(found, demands)


def way_points_of(eset: EquilibriumSet, corners: States) -> Corners:
    """Way-points from the first of some corners over all others."""
    return [{name: corner[name] for name in eset.names} for corner in list(corners)[1:]]


def corners_of(
    eset: EquilibriumSet, path: States, demands: Demands, same_class: bool = False
) -> States:
    """Corners of a straightened path, both ends among them."""
    corners = straightened(path, demands, same_class)
    free = np.array([position(eset.structure.parameters, name) for name in eset.names])
    return relaxed(corners, demands, (eset.box, free), same_class)


def kept_margin(route: Route, demands: Demands) -> Route:
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


def _fault(name: str, state: State, demands: Demands) -> str | None:
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
