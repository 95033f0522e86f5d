"""Whether a structure can take values of descriptors from where it is: decided by lifting."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from equimorph.arrays import Int, Lanes, Parameters, Values
from equimorph.equilibria.sensitivity import steering
from equimorph.errors import InputError
from equimorph.manifold import EquilibriumSet
from equimorph.manifold.queries.locate import cell_of
from equimorph.model import Constraint, Descriptor, Schedule, position, remember_call
from equimorph.structures import State, States, Structure
from equimorph.tasks.motion.tracking import Tracking, track
from equimorph.tasks.planning.planner import plan
from equimorph.tasks.reach.regions import Region
from equimorph.tasks.route import Route
from equimorph.tasks.shapes.solutions import solve_shape


@dataclass(frozen=True, eq=False)
class Answer:
    """Whether target values can be reached from a state; if not, what prevents it."""

    status: Literal["reachable", "refused"]
    """One of these. "reachable": a verified motion leads there through the start's region.
    "refused": none does; `why` says what stops it, or where else such states are."""
    why: str
    states: States
    """All stable states of the start's piece of the set that show the values."""
    region: Int[np.ndarray, " lanes"]
    """Number of the region that each lies in, −1 if not known."""
    straight: Tracking
    """Motion along the straight line in descriptor space, or where and why it ends."""
    route: Route | None
    """Motion inside the region where the straight one fails; None if it is not needed."""
    closest: State
    """Vertex of the start's region whose descriptors come nearest, each measured by its range."""

    def __repr__(self) -> str:
        """Whether it can, and why not."""
        return f"Answer({self.status}{': ' if self.why else ''}{self.why})"

    @property
    def can(self) -> bool:
        """Whether a verified motion leads there."""
        return self.status == "reachable"

    @property
    def margin(self) -> float:
        """Smallest stability margin of the motion; nan without a motion."""
        if not self.can:
            return float("nan")
        return self.straight.margin if self.route is None else self.route.margin

    @property
    def schedule(self) -> Schedule | None:
        """Parameters along the motion; None without a motion."""
        return self.straight.schedule if self.route is None else self.route.schedule


def query_region(
    start: State,
    regions: tuple[Region, ...],
    whole: EquilibriumSet,
    targets: Mapping[Descriptor, float],
    within: Sequence[Constraint],
) -> Answer:
    """See `Reach.query`; `whole` is the stable piece of the set that the regions are cut from."""
    home = regions[0]
    _check(home, targets)
    found = solve_shape(whole, targets, within=within).stable
    region = np.array([_region_of(regions, start, state) for state in found], int)
    straight = _straight(start, whole, targets, (*whole.constraints, *within))
    closest = _closest(home, targets)
    if straight.arrived:
        return Answer("reachable", "", found, region, straight, None, closest)
    mine = found[np.flatnonzero(region == 0)]
    routes = [_inside(start, home, state, within) for state in mine]
    best = min((r for r in routes if r.arrived), key=lambda r: r.length, default=None)
    if best is not None:
        return Answer("reachable", "", found, region, straight, best, closest)
    why = _why(home, straight, routes, region, _misses(closest, targets))
    return Answer("refused", why, found, region, straight, None, closest)


def _check(home: Region, targets: Mapping[Descriptor, float]) -> None:
    if set(targets) != set(home.descriptors) or len(targets) != len(home.eset.names):
        names = ", ".join(each.name for each in home.descriptors)
        raise InputError(
            f"`targets` must give as many descriptors as there are free parameters "
            f"({len(home.eset.names)}), those of the set: {names or 'none'}; got "
            f"{', '.join(each.name for each in targets) or 'nothing'}."
        )


@remember_call
def jacobian_of(
    structure: Structure, names: Sequence[str], descriptors: Sequence[Descriptor]
) -> Descriptor:
    """det ∂S/∂p along the set, per scales of the parameters: zero where control is lost."""
    free = np.array([position(structure.parameters, name) for name in names])

    def value(z: Lanes, p: Parameters) -> Values:
        with np.errstate(invalid="ignore", over="ignore"):  # slopes are infinite on a fold
            return np.asarray(np.linalg.det(steering(structure, z, p, free, descriptors)))

    return Descriptor("jacobian", "", value, "det J_S")


def _region_of(regions: tuple[Region, ...], start: State, state: State) -> int:
    """Number of the region of a stable state of the same piece, −1 if not known."""
    home = regions[0]
    if home.side:
        det = jacobian_of(state.structure, home.eset.names, home.descriptors)
        same = det(state) * det(start) > 0.0
    for number, region in enumerate(regions):
        if home.side and (region.side == home.side) != same:
            continue
        if cell_of(region.eset, state) >= 0:
            return number
    return -1


def _straight(
    start: State,
    whole: EquilibriumSet,
    targets: Mapping[Descriptor, float],
    within: tuple[Constraint, ...],
) -> Tracking:
    """Motion along the straight line in descriptor space."""
    sides = zip(whole.names, whole.box.lower.tolist(), whole.box.upper.tolist(), strict=True)
    limits = {name: (low, high) for name, low, high in sides}
    return track(start, dict(targets), actuators=limits, within=tuple(dict.fromkeys(within)))


def _inside(start: State, home: Region, goal: State, within: Sequence[Constraint]) -> Route:
    """Route inside the start's region."""
    bounds = list(within)
    if home.side:
        det = jacobian_of(start.structure, home.eset.names, home.descriptors)
        bounds.append(det >= 0.0 if det(start) > 0.0 else det <= 0.0)
    return plan(home.eset, start, goal, within=bounds)


def _closest(home: Region, targets: Mapping[Descriptor, float]) -> State:
    wanted = np.array([float(targets[each]) for each in home.descriptors])
    spread = np.maximum(np.ptp(home.values, axis=0), 1e-300)
    gap = (((home.values - wanted) / spread) ** 2).sum(axis=1)
    return home.eset.points[int(np.argmin(gap))]


def _misses(state: State, targets: Mapping[Descriptor, float]) -> str:
    return ", ".join(f"{each.name} by {each(state) - v:.3g}" for each, v in targets.items())


def _why(
    home: Region,
    straight: Tracking,
    routes: Sequence[Route],
    region: Int[np.ndarray, " lanes"],
    misses: str,
) -> str:
    stops = f"on the straight way {straight.why}"
    if len(routes):
        return f"{stops}; inside the region {routes[0].why}"
    if len(region) == 0:
        return (
            f"no stable state around the start shows these values (the nearest vertex of its "
            f"region misses {misses}); {stops}"
        )
    others = len(np.unique(region))
    beyond = "beyond a singular Jacobian" if home.side else "elsewhere"
    return f"such states lie in {others} other region(s), {beyond}, only; {stops}"
