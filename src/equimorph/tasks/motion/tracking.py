"""`track`: actuators that lead descriptors along given targets while loads move.

See docs/decisions.md, "Motions with targets are bounded by their margin".
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Literal

import numpy as np

from equimorph.argument_checks import check_arguments
from equimorph.arrays import Float, Lanes, Parameters, Values
from equimorph.equilibria import Event, EventKind, Leg, Path, Waypoint, check_start, lift
from equimorph.equilibria.trace_options import VIOLATIONS
from equimorph.errors import InputError
from equimorph.model import Constraint, Descriptor, Schedule, position
from equimorph.structures import State, States, margin_of
from equimorph.tasks.motion.between_rows import BetweenRows
from equimorph.tasks.motion.blocks import DENSE, path_by_blocks, same_descriptors, stable_path
from equimorph.tasks.motion.course import Course, actuator_bounds, may_graze
from equimorph.tasks.motion.redundant import follow_redundant
from equimorph.tasks.optimising.moving_optimum import MovingProblem, follow_minimum
from equimorph.tasks.optimising.optimum_path import FollowedOptimum
from equimorph.tasks.optimising.programme import Objective, stability
from equimorph.tasks.route import describe_place, schedule_of
from equimorph.tasks.start import Start, check_stable, start_state
from equimorph.tasks.straight_lines import FINE, least_margin

Failure = Literal[
    "", "snap-through", "singular Jacobian", "actuator limit", "constraint", "accuracy",
    "straight lines", "lost",
]  # fmt: skip
REPEATED = 1e-8
"""Relative distance of targets that are the same."""
CRITICAL = ("critical", "branch point", "index")
"""Ends at which a stable state loses its stability."""


@dataclass(frozen=True)
class Tracking:
    """A motion that follows targets of descriptors, or where and why it ends.

    Parameters
    ----------
    status
        "arrived", or "refused" with the reason in `why` and its class in `failure`.
    failure
        "snap-through": stability is lost. "singular Jacobian": the actuators cannot move the
        descriptors on (det S_a = 0). "actuator limit", "constraint": a bound is met. "accuracy":
        the rows meet the targets, but between them these are missed by more than was allowed,
        however many rows are inserted. "straight lines": the curve is stable, but not the straight
        lines between rows, however close these are. "lost": a numerical failure.
    path
        Exact states up to the end of the motion; `path.at` counts legs, so that 1.5 is half-way
        through the second one.
    margin
        Smallest stability margin on the way.
    schedule
        Parameters along the whole motion; None if it was refused. Straight lines between its rows
        keep the motion stable: further rows are inserted where they would not, as beside a fold.
        Constraints hold on the curve, on the straight lines but for how far these leave it.
    compromise
        Beyond the failure, if requested: the stable states with the least half sum of squared
        misses of the targets.
    between
        Largest misses of the targets, by name, half-way between the rows of the schedule, where
        parameters move straight from row to row.
    """

    status: Literal["arrived", "refused"]
    failure: Failure
    why: str
    path: Path
    targets: tuple[Descriptor, ...]
    actuators: tuple[str, ...] = ()
    schedule: Schedule | None = None
    compromise: FollowedOptimum | None = None
    between: Mapping[str, float] = field(default_factory=dict)

    def __repr__(self) -> str:
        """Margin and misses, or why and where it fails."""
        if self.arrived:
            misses = "".join(f", {name} {by:.2g} off" for name, by in self.between.items())
            rows = " between rows" if misses else ""
            return f"Tracking(arrived: margin {self.margin:.4g}{misses}{rows})"
        return f"Tracking(refused at {self.last_good:.6g}: {self.why})"

    @property
    def arrived(self) -> bool:
        """Whether the whole motion can be followed on stable states."""
        return self.status == "arrived"

    @property
    def last_good(self) -> float:
        """Number of completed legs at which the motion ends."""
        return float(self.path.at[-1])

    @cached_property
    def margin(self) -> float:
        """Smallest stability margin on the way; with a schedule, between its rows, too."""
        states = self.path.states
        if self.schedule is None:
            return float(states.margin.min())
        return least_margin(states, states.margin).margin

    @property
    def states(self) -> States:
        """Exact states along the path."""
        return self.path.states

    @property
    def values(self) -> Mapping[str, Float[np.ndarray, " steps"]]:
        """Values of the targets along the path, by name."""
        return {each.name: each(self.path.states) for each in self.targets}

    @cached_property
    def holonomy(self) -> Mapping[str, float] | None:
        """Change of each actuator around the loop, if the motion comes back to earlier targets.

        Zero where the actuators return, too; None if the targets do not close.
        """
        at, states = self.path.at, self.path.states
        corners = np.flatnonzero(np.isclose(at, np.round(at), rtol=0, atol=1e-12))
        if not self.arrived or len(corners) < 2:
            return None
        parameters = self.path.states.structure.parameters
        free = [position(parameters, name) for name in self.actuators]
        columns = np.delete(states.p[corners], free, axis=1)
        values = np.stack([each(states[corners]) for each in self.targets], axis=1)
        columns = np.concatenate([columns, values], axis=1)
        size = 1.0 + np.abs(columns).max(axis=0)
        same = np.flatnonzero((np.abs(columns - columns[-1]) <= REPEATED * size).all(axis=1))
        if len(same) < 2:
            return None
        change = states.p[corners[-1]] - states.p[corners[same[0]]]
        return dict(zip(self.actuators, change[free].tolist(), strict=True))


@check_arguments
def track(  # the knobs of the public face, all by keyword
    start: Start,
    targets: Leg | Sequence[Leg],
    *,
    actuators: Sequence[str] | Mapping[str, tuple[float, float]],
    within: Sequence[Constraint] = (),
    monitor: Sequence[Descriptor] = (),
    beyond: bool = False,
    accuracy: float | None = None,
) -> Tracking:
    """Follow targets S*(t) of descriptors with at least as many actuators, while loads may move.

    ``S_a ȧ = Ṡ* − S_l l̇``, corrected onto the set at every step: an error-controlled continuation
    in pseudo-arclength. Many close targets are corrected side by side. With more actuators than
    targets the shortest motion of the actuators is taken at every moment, in their scales; one that
    meets its limit is held there as long as the remaining ones suffice.

    Parameters
    ----------
    start
        A stable equilibrium, or the answer of `locate` or `estimate_state` for a measured one.
    targets
        One leg or several: ``{descriptor: value, "q": value}``, approached at a constant rate, or
        functions of t from 0 to 1 that return such mappings and begin at the start's values.
    actuators
        Parameters to solve for, at least as many as descriptors; with limits:
        ``{"Theta": (0.2, 2.5)}``.
    within
        Constraints to obey on the way.
    monitor
        Further descriptors for the schedule.
    beyond
        Whether to follow the least-squares compromise from where the targets cannot be met; all
        legs must prescribe the same descriptors.
    accuracy
        Largest miss of each target, in its unit, half-way between the rows of the schedule: rows
        are inserted until it holds.

    Returns
    -------
    The motion with its schedule, or where and why it cannot be followed. Its rows meet the targets;
    `Tracking.between` tells how far they are missed between them. If a motion returns to its first
    targets, its actuators need not return: see `Tracking.holonomy`.

    Raises
    ------
    InputError
        If `start` is not a stable equilibrium, is not known or violates a bound, or if targets or
        actuators have no meaning.

    Examples
    --------
    >>> import equimorph as em
    >>> spring = em.Spring()
    >>> start = em.lift(spring.natural_state(x_l=0.8), {"F": 0.02}).end.state
    >>> turned = em.track(start, {spring.descriptor("angle"): 0.8}, actuators=["x_l"])
    >>> turned.arrived, float(turned.schedule.values[-1, 0].round(6))
    (True, 0.677282)
    """
    state, names = start_state(start), tuple(actuators)
    limits = dict(actuators) if isinstance(actuators, Mapping) else {}
    bounds = actuator_bounds(state.structure, limits)
    check_stable("start", state)
    legs = [targets] if isinstance(targets, Mapping) or callable(targets) else list(targets)
    asked = _descriptors([_check_values(leg(0.0) if callable(leg) else leg, names) for leg in legs])
    motion = _Motion(state, legs, names, tuple(within), limits, bounds)
    path = motion.path()
    failure = _failure(path.end, bounds)
    if failure:
        why = _why(path.end, failure, names)
        rest = motion.compromise(path) if beyond else None
        return Tracking("refused", failure, why, path, asked, names, None, rest)
    monitored = tuple(dict.fromkeys((*asked, *(c.descriptor for c in within), *monitor)))
    rows, why = BetweenRows(path, legs, asked, names, (*within, *bounds)), ""
    if accuracy is not None:
        failure = "accuracy"
        rows, why = rows.refined(accuracy)
    if not why:
        failure = "straight lines"
        rows, why = rows.held()
    path, between = rows.path, rows.largest
    if why:
        return Tracking("refused", failure, why, path, asked, names, between=between)
    schedule = schedule_of(path, path.states.margin, monitored)
    return Tracking("arrived", "", "", path, asked, names, schedule, None, between)


@dataclass(frozen=True)
class _Motion:
    """Targets, actuators and bounds of a motion."""

    start: State
    legs: Sequence[Leg]
    """State from which the targets are followed, and the targets."""
    names: tuple[str, ...]
    """The actuators."""
    within: tuple[Constraint, ...]
    """Constraints to obey."""
    limits: Mapping[str, tuple[float, float]]
    bounds: tuple[Constraint, ...]
    """Limits of the actuators by name, and as constraints."""

    @property
    def course(self) -> Course:
        """Targets as functions of time; all legs must prescribe the same descriptors."""
        return Course.of(self.start, self.legs, self.names)

    def path(self) -> Path:
        """Follow the motion by the method that suits it, as far as it is stable.

        Stability is one of the bounds, because a loss and a gain between two states leave the index
        of both as it is.
        """
        stable = margin_of(self.start.structure) >= 0.0
        path = self._path((*self.within, *self.bounds), stable)
        end = path.end
        if end.kind in VIOLATIONS and end.detail == str(stable):
            lost = replace(end, kind=EventKind.CRITICAL, detail="")
            path = replace(path, events=(*path.events[:-1], lost))
        return path

    def _path(self, bounds: tuple[Constraint, ...], stable: Constraint) -> Path:
        first = self.legs[0](0.0) if callable(self.legs[0]) else self.legs[0]
        if sum(isinstance(key, Descriptor) for key in first) < len(self.names):
            return self._redundant_path((*bounds, stable))
        if len(self.legs) >= DENSE and same_descriptors(self.legs):
            check_start(self.start, bounds)
            return path_by_blocks(self.course, self.start, (*bounds, stable))
        freed = [_free_actuators(leg, self.names) for leg in self.legs]
        path = lift(self.start, freed, within=bounds, options=FINE)
        # the margins of a whole path take a fraction of the time that they take step by step
        if not may_graze([stable], path.states).any():
            return path
        return lift(self.start, freed, within=(*bounds, stable), options=FINE)

    def _redundant_path(self, every: tuple[Constraint, ...]) -> Path:
        """The shortest motion of more actuators than targets."""
        course, parameters = self.course, self.start.structure.parameters
        check_start(self.start, every)
        places = {position(parameters, name): ends for name, ends in self.limits.items()}
        held = tuple(each for each in every if each not in self.bounds)
        found = follow_redundant(course, self.start, held, places)
        return stable_path(found.stretch.states, found.stretch.times, found.end)

    def compromise(self, path: Path) -> FollowedOptimum:
        """Follow the least sum of squares of the misses from the end of a path on."""
        structure, course = self.start.structure, self.course

        def goal(columns: Float[np.ndarray, " columns"]) -> Objective:
            wanted = columns[len(structure.parameters) :]

            def miss(z: Lanes, p: Parameters) -> Values:
                values = np.stack([each.function(z, p) for each in course.descriptors], axis=1)
                return np.asarray(0.5 * ((values - wanted) ** 2).sum(axis=1))

            return Objective(Descriptor("miss", "", miss), 1.0)

        rules = (*self.within, stability(structure, 0.0))
        problem = MovingProblem(course, goal, rules, self.bounds, held=False)
        # the end itself may lie on a fold, where the actuators are no coordinates
        begin = path.states[-2 if len(path.states) > 1 else -1]
        return follow_minimum(problem, begin, float(path.at[-1]))


def _free_actuators(leg: Leg, actuators: tuple[str, ...]) -> Leg:
    """Leg with the actuators left unknown."""
    if callable(leg):
        return lambda t: {**_check_values(leg(t), actuators), **dict.fromkeys(actuators)}
    return {**_check_values(leg, actuators), **dict.fromkeys(actuators)}


def _check_values(values: Waypoint, actuators: tuple[str, ...]) -> Waypoint:
    if not isinstance(values, Mapping):
        raise InputError(f"`targets` must give {{descriptor: value}}; got {values!r}.")
    asked = [key for key in values if isinstance(key, Descriptor)]
    if not 0 < len(asked) <= len(actuators):
        raise InputError(
            f"`targets` must prescribe as many descriptors as there are actuators "
            f"({len(actuators)}), or fewer; got {len(asked)}."
        )
    for name in actuators:
        if name in values:
            raise InputError(
                f"`targets` must leave the actuator {name} free; got {values[name]!r}."
            )
    return values


def _descriptors(first: Sequence[Waypoint]) -> tuple[Descriptor, ...]:
    keys = (key for leg in first for key in leg)
    return tuple(dict.fromkeys(key for key in keys if isinstance(key, Descriptor)))


def _failure(end: Event, bounds: Sequence[Constraint]) -> Failure:
    if end.kind == "arrived":
        return ""
    if end.kind in CRITICAL:
        return "snap-through"
    if end.kind == "fold":
        return "singular Jacobian"
    if end.kind == "limit":
        return "actuator limit"
    if end.kind in VIOLATIONS:
        limits = {str(bound) for bound in bounds}
        return "actuator limit" if end.detail in limits else "constraint"
    return "lost"


def _why(end: Event, failure: Failure, actuators: tuple[str, ...]) -> str:
    what = {
        "snap-through": "stability is lost: the structure would snap",
        "singular Jacobian": "the actuators cannot move the targets on (singular Jacobian)",
        "actuator limit": f"an actuator is at its limit ({end.detail})",
        "constraint": f"the constraint {end.detail} is met",
    }.get(failure, f"numerical failure: {end.detail}")
    return f"{what}, at {describe_place(end.state, actuators)}"
