"""Routes between states, and the schedule that executes one."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from equimorph.arrays import Float
from equimorph.equilibria import Event, Landing, Path, lift, lift_legs
from equimorph.errors import InputError
from equimorph.model import Constraint, Descriptor, Schedule, names_of
from equimorph.structures import State, States, Structure, join_states
from equimorph.tables import html_table, units_of
from equimorph.tasks.distances import distance
from equimorph.tasks.robustness.evidence import Survival
from equimorph.tasks.straight_lines import FINE, least_margins
from equimorph.tolerances import SAME_STATE

Corners = list[dict[str, float]]


BottleneckKind = Literal["start", "goal", "saddle", "kink", "fold", "box", "constraint", "vertex"]


@dataclass(frozen=True, eq=False)
class Bottleneck:
    """Where routes cannot avoid the largest, or least, value of a descriptor.

    Parameters
    ----------
    value
        Lowest peak of all stable routes within the constraints, or highest least value. On a fold
        routes come as near to it as they like.
    state
        The state that has it.
    kind
        "start" or "goal", if one of these has it; else a pass: a smooth "saddle", a "kink" of the
        descriptor, on a "fold", a side of the "box", or a "constraint"; "vertex" where no exact
        pass was found near the vertex of the set that decides: the value errs like the mesh.
    residual
        Length of the weighted sum of the active gradients along the set; zero at ends, nan at
        vertices.
    active
        Bounds that hold with equality.
    """

    value: float
    state: State
    kind: BottleneckKind
    residual: float = 0.0
    active: tuple[str, ...] = ()

    def __repr__(self) -> str:
        """Value, kind and place."""
        return f"Bottleneck({self.value:.8g}: {self.kind} at {self.state.parameters})"


@dataclass(frozen=True, eq=False)
class Relaxation:
    """How far one demand of a refused route must be relaxed, while all others are kept.

    Parameters
    ----------
    demand
        The relaxed demand in words; at the bound itself routes come as near to it as they like.
    bound
        Its exact bound: the lowest peak, or highest least value, of what it bounds.
    attained
        What a verified route within 1 % of it attains; NaN if none was found.
    state
        Where no route is better.
    """

    demand: str
    bound: float
    attained: float
    state: State

    def __str__(self) -> str:
        """In words."""
        if np.isnan(self.attained):
            return f"{self.demand} was not verified to do"
        return f"{self.demand} would do (verified at {self.attained:.8g})"


@dataclass(frozen=True)
class Route:
    """A verified route between two states, or the reason why none was found.

    status: "arrived", or "refused" with the reason in `why`. A route that arrived was lifted
    again at a finer step: `path`, its smallest stability `margin` (also between the states of
    the path), its `length` in the structure's metric and scaled parameters, what it was planned
    for (`objective`) and its `cost`, and the `schedule` for the actuators. Where snaps were
    allowed, `snaps` has their landings, in order; where a peak was kept low, `bottleneck` has
    its exact value and place, and `cost` what the route attains; where errors are to be
    survived, `survival` has what is shown. A refused route carries the path as far as it went,
    if there is one; in `relaxations` how far each demand of the caller has to give way alone,
    where that would do; and `nearest`, the state nearest to the goal that a verified route
    reaches.
    """

    status: Literal["arrived", "refused"]
    why: str
    way_points: Corners
    path: Path | None = None
    margin: float = np.nan
    length: float = np.nan
    schedule: Schedule | None = None
    objective: str = "length"
    cost: float = np.nan
    snaps: tuple[Landing, ...] = ()
    bottleneck: Bottleneck | None = None
    survival: Survival | None = None
    relaxations: tuple[Relaxation, ...] = ()
    nearest: State | None = None

    def __repr__(self) -> str:
        """Length and margin, or why there is no route."""
        if not self.arrived:
            return f"Route(refused: {self.explanation})"
        snaps = f", snaps {len(self.snaps)}" if self.snaps else ""
        return f"Route(arrived: length {self.length:.4g}, margin {self.margin:.4g}{snaps})"

    def _repr_html_(self) -> str:
        """Table of length, margin, cost and way-points, for notebooks."""
        if not self.arrived:
            return html_table("Route: refused", [], [["reason", self.explanation]])
        rows: list[list[Any]] = [["length", self.length], ["smallest margin", self.margin]]
        if self.objective != "length":
            rows.append([self.objective, self.cost])
        if self.bottleneck is not None:
            rows.append([f"best possible: {self.bottleneck.kind}", self.bottleneck.value])
        if self.survival is not None:
            rows.append(["errors", f"{self.survival.errors}: {self.survival.status}"])
        rows += [["snaps", len(self.snaps)], ["way-points", len(self.way_points)]]
        for number, place in enumerate(self.way_points, 1):
            words = ", ".join(f"{name} = {value:.6g}" for name, value in place.items())
            rows.append([f"way-point {number}", words])
        return html_table("Route: arrived", [], rows)

    @property
    def explanation(self) -> str:
        """Reason of a refusal, and what would do."""
        return "; ".join([self.why, *map(str, self.relaxations)])

    @property
    def arrived(self) -> bool:
        """Whether there is a verified route."""
        return self.status == "arrived"

    @property
    def states(self) -> States | None:
        """States along the route; for a refused one up to its end, None if it did not begin."""
        return self.path.states if self.path else None

    def frame(self) -> Any:
        """All steps of the schedule as a `pandas.DataFrame` with units; see `Schedule.frame`.

        Raises
        ------
        InputError
            If the route was refused, or pandas is not installed.
        """
        if self.schedule is None:
            raise InputError(f"`route` must have arrived; it was refused: {self.why}")
        return self.schedule.frame()


def refusal(why: str, way_points: Corners | None = None, path: Path | None = None) -> Route:
    """Route that does not exist, and why."""
    return Route("refused", why, way_points or [], path)


def describe_place(state: State, names: Sequence[str]) -> str:
    """Parameters of a state in words: ``Theta = 1, Delta = 0.418136``."""
    return ", ".join(f"{name} = {state[name]:.6g}" for name in names)


def verify_route(
    start: State,
    goal: State,
    way_points: Corners,
    within: tuple[Constraint, ...],
    monitor: Sequence[Descriptor] = (),
) -> Route:
    """Lift the way-points once more, finely; the route if it ends in the goal, else the reason."""
    path = lift(start, way_points, within=within, options=FINE)
    return _judged([path], [goal], [way_points], within, monitor)[0]


def verify_corners(
    chains: Sequence[States],
    way_points: Sequence[Corners],
    within: tuple[Constraint, ...],
    monitor: Sequence[Descriptor] = (),
) -> list[Route]:
    """Routes over known corners, start and goal among them; see `verify_route`.

    All legs are lifted side by side; those of a route one after the other if that does not lead to
    its goal.
    """
    if not chains:
        return []
    paths = [
        path or lift(chain[0], steps, within=within, options=FINE)
        for path, chain, steps in zip(
            lift_legs(chains, within, FINE), chains, way_points, strict=True
        )
    ]
    goals = [chain[len(chain) - 1] for chain in chains]
    return _judged(paths, goals, way_points, within, monitor)


def _judged(
    paths: Sequence[Path],
    goals: Sequence[State],
    way_points: Sequence[Corners],
    within: tuple[Constraint, ...],
    monitor: Sequence[Descriptor],
) -> list[Route]:
    """Routes along paths that end in their goals and are stable, or why they do not."""
    structure, routes, led = paths[0].states.structure, list[Route](), list[int]()
    for number, (path, goal, steps) in enumerate(zip(paths, goals, way_points, strict=True)):
        why = _missed(path, goal, steps)
        routes.append(refusal(why, steps, path))
        led += [] if why else [number]
    every = join_states(structure, [paths[k].states for k in led]).margin
    cuts = np.cumsum([len(paths[k].states) for k in led])[:-1]
    margins = dict(zip(led, np.split(every, cuts), strict=True)) if led else {}
    for k in led:
        if not (margins[k] > 0.0).all():
            place = paths[k].states[int(np.argmin(margins[k]))]
            why = f"unstable at {describe_place(place, _names(way_points[k]))}"
            routes[k] = refusal(why, way_points[k], paths[k])
            del margins[k]
    least = least_margins([paths[k].states for k in margins], list(margins.values()))
    watched = (*(c.descriptor for c in within), *monitor)
    for (k, own), lowest in zip(margins.items(), least, strict=True):
        schedule, length = schedule_of(paths[k], own, watched), float(paths[k].length[-1])
        routes[k] = Route("arrived", "", way_points[k], paths[k], lowest.margin, length, schedule)
    return routes


def _names(way_points: Corners) -> list[str]:
    return list(dict.fromkeys(name for corner in way_points for name in corner))


def _missed(path: Path, goal: State, way_points: Corners) -> str:
    """Why a path does not lead to a goal; empty if it does."""
    end = path.end
    if end.kind != "arrived":
        return _reason(path, _names(way_points), len(way_points))
    if distance(end.state, goal) > SAME_STATE:
        return (
            f"the way-points lead to another equilibrium over the goal's parameters, "
            f"{distance(end.state, goal):.3g} away in the metric"
        )
    return ""


def _reason(path: Path, names: Sequence[str], segments: int) -> str:
    segment = min(int(path.end.at) + 1, segments)
    return f"segment {segment} of {segments} meets {describe_obstacle(path.end, names)}"


def describe_obstacle(end: Event, names: Sequence[str]) -> str:
    """What ended a lift, and where, in words."""
    what = {
        "fold": "a fold: stability is lost and the structure would snap",
        "branch point": f"a {end.criticality} branch point: stability is lost",
        "lateral branch point": f"a {end.criticality} lateral branch point: it leaves its plane",
        "multiple point": f"a multiple point ({end.detail})",
        "constraint": f"the constraint {end.detail}",
    }.get(end.kind, f"a numerical failure ({end.detail})")
    return f"{what}, at {describe_place(end.state, names)}"


def _identity(structure: Structure) -> dict[str, Any] | None:
    """Data of the structure; None if it lives in Python only, like one with a callable load."""
    try:
        return structure.identity()
    except InputError:
        return None


def _values_by_name(
    descriptors: Sequence[Descriptor], states: States
) -> dict[str, Float[np.ndarray, " steps"]]:
    """Values of descriptors; two that differ and have the same name are refused."""
    found: dict[str, Float[np.ndarray, " steps"]] = {}
    for each in descriptors:
        values = each(states)
        known = found.setdefault(each.name, values)
        if not np.allclose(known, values, rtol=1e-6, atol=1e-12, equal_nan=True):
            raise InputError(
                f"`monitor` and all other descriptors must have names of their own; got two that "
                f"differ, both named {each.name}."
            )
    return found


def schedule_of(
    path: Path, margins: Float[np.ndarray, " steps"], descriptors: Sequence[Descriptor]
) -> Schedule:
    """Schedule of a path, with its margins and values of descriptors at every step."""
    structure, states = path.states.structure, path.states
    parameters = structure.parameters
    corners = np.flatnonzero(np.isclose(path.at, np.round(path.at), rtol=0, atol=1e-12))
    return Schedule(
        names=names_of(parameters),
        roles=tuple(parameter.role for parameter in parameters),
        units=tuple(parameter.unit for parameter in parameters),
        values=states.p.copy(),
        progress=path.length / max(path.length[-1], 1e-300),
        margins=margins,
        descriptors=_values_by_name(descriptors, states),
        start={"structure": _identity(structure), "unknowns": states.z[0].tolist()},
        way_points=corners,
        time_unit=structure.time_unit,
        descriptor_units=units_of(descriptors),
    )
