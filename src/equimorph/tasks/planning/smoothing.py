"""Routes with round corners: twice continuously differentiable, near the old ones."""

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from equimorph.argument_checks import check_arguments
from equimorph.arrays import Float
from equimorph.equilibria import lift
from equimorph.errors import InputError
from equimorph.model import Constraint, Descriptor, Spline, names_of
from equimorph.tasks.distances import distance
from equimorph.tasks.route import Route, refusal, schedule_of
from equimorph.tasks.straight_lines import FINE, leads_on, least_margin
from equimorph.tolerances import SAME_STATE

Places = Float[np.ndarray, "_ parameters"]

KNOTS = 120
"""Points of a rounded polygon, through which the spline runs."""
WINDOW = 0.2
"""Largest window of the average, as a share of the length."""
HALVINGS = 6
"""How often the roundings are halved before a route is refused."""


@check_arguments
def smoothed(
    route: Route,
    tolerance: float,
    *,
    within: Sequence[Constraint] = (),
    margin: float = 0.0,
    monitor: Sequence[Descriptor] = (),
) -> Route:
    """Round the corners of a route, and verify it again.

    The polygon of the way-points is averaged twice over a window along its length, which gives a
    cubic curve with continuous second derivatives that cuts each corner; a cubic `Spline` through
    its points is lifted finely. If it is refused, the corners are rounded half as much.

    Parameters
    ----------
    route
        A route that arrived.
    tolerance
        Largest distance from the polygon, in scaled parameters.
    within
        Constraints that the smooth route has to obey.
    margin
        Smallest stability margin allowed, in the structure's metric.
    monitor
        Further descriptors for the schedule.

    Returns
    -------
    The smooth route; its schedule passes no corner between its ends, and its cost is known for
    lengths only. Refused if even small roundings are.

    Raises
    ------
    InputError
        If the route did not arrive, or the tolerance is not positive.
    """
    if route.path is None or not route.arrived or route.snaps:
        raise InputError(f"`route` must have arrived without a snap; got {route!r}.")
    states = route.path.states
    structure = states.structure
    corners = states.p[_corners(route)] / structure.scales
    why = ""
    for _ in range(HALVINGS):
        curve = _round_corners(corners, tolerance) * structure.scales
        found = _verify(route, curve, tuple(within), margin, tuple(monitor))
        if found.arrived:
            return found
        why, tolerance = found.why, 0.5 * tolerance
    return refusal(f"no rounding of the corners can be lifted: {why}", route.way_points)


def _corners(route: Route) -> list[int]:
    assert route.schedule is not None
    return list(
        dict.fromkeys([0, *route.schedule.way_points.tolist(), len(route.schedule.values) - 1])
    )


def _round_corners(corners: Places, tolerance: float) -> Places:
    """Points of the rounded polygon, as far from it as allowed."""
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(corners, axis=0), axis=1))])
    window = WINDOW * length[-1]
    while True:
        curve = _average(corners, length, window)
        if _off(curve, corners) <= tolerance or window < 1e-6 * length[-1]:
            return curve
        window *= 0.7


def _average(corners: Places, length: Float[np.ndarray, " corners"], window: float) -> Places:
    """Polygon averaged with the weights of a parabolic spline of half-width `window`."""
    at = np.linspace(0.0, length[-1], KNOTS)
    # Gauss points of the convolution of three boxes, which is a parabola in pieces
    nodes = np.linspace(-1.0, 1.0, 241)
    x = np.abs(nodes) * 1.5
    weights = np.where(x < 0.5, 0.75 - x**2, 0.5 * np.maximum(1.5 - x, 0.0) ** 2)
    weights /= weights.sum()
    places = at[:, None] + window * nodes
    out = np.empty((KNOTS, corners.shape[1]))
    for k in range(corners.shape[1]):
        inner = np.interp(np.abs(places), length, corners[:, k])
        beyond = np.interp(2.0 * length[-1] - places, length, corners[:, k])
        # reflected in its ends, the polygon keeps them
        inner = np.where(places < 0.0, 2.0 * corners[0, k] - inner, inner)
        inner = np.where(places > length[-1], 2.0 * corners[-1, k] - beyond, inner)
        out[:, k] = inner @ weights
    out[0], out[-1] = corners[0], corners[-1]
    return out


def _off(curve: Places, corners: Places) -> float:
    """Largest distance of points from a polygon."""
    gaps = []
    for a, b in pairwise(corners):
        side = b - a
        share = np.clip((curve - a) @ side / (side @ side), 0.0, 1.0)
        gaps.append(np.linalg.norm(curve - a - share[:, None] * side, axis=1))
    return float(np.min(gaps, axis=0).max())


def _verify(
    route: Route,
    curve: Places,
    within: tuple[Constraint, ...],
    margin: float,
    monitor: tuple[Descriptor, ...],
) -> Route:
    """Lift a curve finely from the start of a route; refused if it does not lead to its end."""
    assert route.path is not None
    start = route.path.states[0]
    names = names_of(start.structure.parameters)
    moving = np.ptp(curve, axis=0) > 0.0
    samples = {name: curve[:, k] for k, name in enumerate(names) if moving[k]}
    path = lift(start, Spline(**samples), within=within, options=FINE)
    if not path.arrived:
        return refusal(f"it meets a {path.end.kind}", route.way_points, path)
    if distance(path.end.state, route.path.end.state) > SAME_STATE:
        return refusal("it leads to another equilibrium", route.way_points, path)
    margins = path.states.margin
    if not leads_on(path.states).all():
        return refusal("straight lines between its rows lose stability", route.way_points, path)
    least = least_margin(path.states, margins).margin
    if least < margin or not (margins > 0.0).all():
        return refusal(f"the margin falls to {least:.4g}", route.way_points, path)
    told = dict.fromkeys((*(c.descriptor for c in within), *monitor))
    schedule = schedule_of(path, margins, tuple(told))
    length = float(path.length[-1])
    return replace(
        route, path=path, margin=least, length=length, schedule=schedule,
        cost=float("nan") if route.objective != "length" else length,
    )  # fmt: skip
