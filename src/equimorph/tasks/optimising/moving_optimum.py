"""`follow_optimum`: a local optimum while loads and targets vary, and where it jumps.

See docs/decisions.md, "Steps of a moving optimum do not pass its expected end".
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from equimorph.argument_checks import check_arguments
from equimorph.arrays import Float
from equimorph.equilibria import Event, EventKind, Leg
from equimorph.errors import InputError
from equimorph.manifold.geometry.setting import Setting, embed
from equimorph.manifold.queries.nearest import SetPoints
from equimorph.model import Constraint, Descriptor
from equimorph.structures import State, join_states
from equimorph.tasks.motion.blocks import stable_path
from equimorph.tasks.motion.course import Course, actuator_bounds
from equimorph.tasks.optimising.certificates import Certificate, certificate
from equimorph.tasks.optimising.optimum_path import (
    FollowedOptimum,
    Jump,
    expected_end,
    extrapolation_factor,
    next_trial,
)
from equimorph.tasks.optimising.programme import Objective, Programme, is_stability, stability
from equimorph.tasks.optimising.sqp import ITERATIONS, CriticalPoint, descend
from equimorph.tasks.optimising.tangent_steps import project_onto_set, step_along, tangent_planes
from equimorph.tasks.route import schedule_of
from equimorph.tasks.start import Start, check_stable, start_state
from equimorph.tolerances import FEASIBLE

FIRST, LARGEST = 0.02, 0.1
"""Share of a leg of the first step, and of the longest."""
CLOSEST = 1e-9
"""Share of a leg to which a jump is located."""
SURE = 0.5
"""Way from its prediction, relative to that of the prediction, of an optimum that goes on."""
NEAR = 4e-3
"""Way, in the metric and scaled parameters, that no jump is as short as."""
FAR = 0.15
"""Longest way between successive optima."""
SHORTER = 0.4
"""Share of a step in vain that is tried next."""
LATER = (0.0, 1e-4, 1e-3, 1e-2)
"""Shares of a leg after which a first optimum is tried: it is flat where targets get lost."""
SHORT = 10
"""Steps of a descent from a prediction."""
FLAT = -1e-6
"""Least curvature of a minimum."""
NUDGE = 1e-3
"""Steps aside, in the metric and scaled actuators, from which optima beyond a jump are searched."""

Goal = Callable[[Float[np.ndarray, " columns"]], Objective]
"""Objective at given parameters and targets."""


@check_arguments
def follow_optimum(
    start: Start,
    objective: Descriptor,
    to: Leg | Sequence[Leg],
    *,
    actuators: Sequence[str] | Mapping[str, tuple[float, float]],
    within: Sequence[Constraint] = (),
    sense: Literal["min", "max"] = "min",
    margin: float = 0.0,
) -> FollowedOptimum:
    """Follow the optimum of an objective while loads and targets of descriptors vary.

    At every step, sequential quadratic programming on the set finds the optimum near the previous
    one, while constraints become active or inactive. Steps are shortened until the optimum moves as
    predicted; where it does not, however short the step, it jumps: a descent from there leads to
    the other side. With targets among `to`, the optimum determines the redundant actuators.

    Parameters
    ----------
    start
        Stable state, in the basin of the optimum to follow.
    objective
        A descriptor of the structure.
    to
        Legs of loads, by name, and targets, by descriptor, as for `track`; none prescribes an
        actuator.
    actuators
        Parameters to choose, more than targets; with limits if given as a mapping.
    within
        Constraints.
    sense
        "min" or "max".
    margin
        Smallest stability margin allowed.

    Returns
    -------
    The optima along the way with their certificates, and all jumps with both sides.

    Raises
    ------
    InputError
        If `start` is not stable or not known, the sense is unknown, the margin negative, or legs or
        actuators have no meaning.

    Examples
    --------
    >>> import equimorph as em
    >>> spring = em.Spring()
    >>> start = em.lift(spring.natural_state(x_l=0.8), {"F": 0.01}).end.state
    >>> angle = spring.angle
    >>> flattest = em.follow_optimum(
    ...     start, angle, {"F": 0.02}, actuators=["x_l"], within=[angle >= 0.1]
    ... )
    >>> flattest.certificates[-1].kind, round(float(flattest.values[-1] ** 3), 3)
    ('stability boundary', 0.021)
    """
    state, names = start_state(start), tuple(actuators)
    check_stable("start", state)
    legs = [to] if isinstance(to, Mapping) or callable(to) else list(to)
    course = Course.of(state, legs, names)
    if len(course.descriptors) >= len(names):
        raise InputError(
            f"`to` must prescribe fewer descriptors than there are actuators ({len(names)}), so "
            f"that there is a choice; got {len(course.descriptors)}."
        )
    limits = dict(actuators) if isinstance(actuators, Mapping) else {}
    goal = Objective(objective, 1.0 if sense == "min" else -1.0)
    rules = (*within, stability(state.structure, margin))
    problem = MovingProblem(
        course, lambda _: goal, rules, actuator_bounds(state.structure, limits), True
    )
    return follow_minimum(problem, state, 0.0)


@dataclass(frozen=True)
class MovingProblem:
    """Optima along a course."""

    course: Course
    """Loads and targets."""
    goal: Goal
    """Objective at the columns of a time."""
    rules: tuple[Constraint, ...]
    """Constraints, stability among them."""
    bounds: tuple[Constraint, ...]
    """Limits of the actuators."""
    held: bool
    """Whether the targets hold exactly; else the objective deals with them."""

    def programme(self, time: float) -> Programme:
        """Programme at a time."""
        course = self.course
        columns = course.at(np.array([time]))[0]
        targets = course.split(columns[None])[1][0] if self.held else np.zeros(0)
        equal: list[Constraint] = []
        for each, value in zip(course.descriptors, targets.tolist(), strict=False):
            equal += [each <= value, each >= value]
        setting = Setting(course.structure, columns[: len(course.structure.parameters)],
                          course.free, ())  # fmt: skip
        return Programme(setting, self.bounds, self.goal(columns), (*self.rules, *equal))


@dataclass(frozen=True)
class _Found:
    """An optimum at a time."""

    time: float
    programme: Programme
    end: CriticalPoint
    certificate: Certificate

    @property
    def place(self) -> Float[np.ndarray, " coordinates"]:
        """Where it is, in the metric and scaled actuators."""
        return np.asarray(embed(self.programme.setting, self.end.point.z, self.end.point.p)[0])


@dataclass
class _Track:
    """Optima followed so far, and where the next one is looked for."""

    problem: MovingProblem
    """What is followed."""
    optima: list[_Found]
    """Optima in order of time; the last is where the search stands."""
    jumps: list[Jump] = field(default_factory=list)
    """Jumps met so far."""
    step: float = FIRST
    """Time step to try next."""
    failure: float = np.inf
    """Earliest time at which no optimum continued the last one; ∞ if none is known."""

    @property
    def last(self) -> _Found:
        """The last optimum."""
        return self.optima[-1]

    @property
    def at_jump(self) -> bool:
        """Whether the failure ahead is so close that the optimum jumps there."""
        return bool(self.failure - self.last.time <= CLOSEST * (1.0 + self.last.time))

    def smooth_pair(self) -> tuple[_Found, _Found] | None:
        """Last two optima, if the optimum moves smoothly between them."""
        if len(self.optima) < 2 or (self.jumps and self.jumps[-1].at >= self.optima[-2].time):
            return None
        first, second = self.optima[-2:]
        apart = second.time - first.time > CLOSEST * (1.0 + first.time)
        return (first, second) if apart and first.time >= np.floor(second.time - 1e-12) else None

    def expected_end(self) -> float:
        """Time at which the optimum is expected to end; not a number if unknown."""
        pair = self.smooth_pair()
        if pair is None:
            return np.nan
        bends = (pair[0].certificate.curvature, pair[1].certificate.curvature)
        return expected_end((pair[0].time, pair[1].time), bends)

    def predict(self, ahead: float, end: float) -> SetPoints | None:
        """State of the set at a time ahead, extrapolated from the last two optima."""
        course, here = self.problem.course, self.last.end.point
        z, p = here.z.copy(), here.p.copy()
        pair = self.smooth_pair()
        if pair is not None:
            share = extrapolation_factor((pair[0].time, pair[1].time), ahead, end)
            z += share * (z - pair[0].end.point.z)
            p += share * (p - pair[0].end.point.p)
        given = course.split(course.at(np.array([ahead])))[0]
        given[:, course.free] = p[:, course.free]
        found, good = project_onto_set(self.problem.programme(ahead).setting, z, given, here.rows)
        return found if good[0] else None


def follow_minimum(problem: MovingProblem, start: State, time: float) -> FollowedOptimum:
    """Follow the optimum near a state from a time on.

    Steps are tried and shortened until the optimum continues; where no step is short enough it
    jumps, and the search goes on from the optimum beyond.
    """
    legs = problem.course.legs
    plane = tangent_planes(problem.programme(time).setting, start.batch)
    begin = SetPoints(start.z[None], start.p[None], plane)
    first = None
    for later in LATER:
        first = first or _solve(problem, begin, min(time + later, legs))
    if first is None:
        why = "the descent from the start ends at no optimum"
        return _result(_Track(problem, []), why, start)
    track = _Track(problem, [first])
    while track.last.time < legs:
        if not track.at_jump:
            _advance(track)
        elif not _jump_over(track):
            return _result(track, "the optimum ends", start)
    return _result(track, "", start)


def _advance(track: _Track) -> None:
    """Try one step: go on to the next optimum, or remember that it failed, and shorten."""
    here, end = track.last, track.expected_end()
    ahead = here.time + track.step
    if here.time < end < track.failure < np.inf:
        ahead = next_trial(here.time, end, track.failure)
    ahead = min(ahead, np.floor(here.time) + 1.0, track.problem.course.legs)
    guess = track.predict(ahead, end)
    there = None if guess is None else _solve(track.problem, guess, ahead, SHORT)
    if there is None or guess is None or not _goes_on(here, there, guess, end):
        track.failure, track.step = ahead, SHORTER * (ahead - here.time)
        return
    track.step = min(1.5 * (ahead - here.time), LARGEST)
    track.optima.append(there)
    if there.time >= track.failure:
        track.failure = np.inf


def _jump_over(track: _Track) -> bool:
    """Go on at the optimum beyond a failure; false if none exists there."""
    here = track.last
    after = _beyond(track.problem, here, track.failure)
    if after is None or np.linalg.norm(after.place - here.place) > NEAR:
        track.jumps.append(_jump(here, after))
    if after is None:
        return False
    track.optima.append(after)
    track.step, track.failure = FIRST, np.inf
    return True


def _solve(
    problem: MovingProblem, guess: SetPoints, time: float, rounds: int = ITERATIONS
) -> _Found | None:
    """Optimum near a guess; None where the descent does not end at one."""
    programme = problem.programme(time)
    ends = descend(programme, guess, rounds)
    if not ends or not ends[0].converged or ends[0].expansion.g.max() > FEASIBLE:
        return None
    end = ends[0]
    found = certificate(programme, end)
    index = programme.setting.structure.index(end.point.z, end.point.p)[0]
    if found.curvature < FLAT or (index != 0 and found.kind != "stability boundary"):
        return None
    return _Found(time, programme, end, found)


def _goes_on(here: _Found, there: _Found, guess: SetPoints, end: float) -> bool:
    """Whether an optimum is where the one before leads to, which is expected to end at a time."""
    aim = embed(there.programme.setting, guess.z, guess.p)[0]
    way = float(np.linalg.norm(there.place - here.place))
    off = float(np.linalg.norm(there.place - aim))
    near = way <= FAR and off <= SURE * float(np.linalg.norm(aim - here.place))
    return way <= NEAR or (near and not here.time < end < there.time)


def _beyond(problem: MovingProblem, here: _Found, ahead: float) -> _Found | None:
    """Optimum beyond a jump, found by descents from points next to the last one."""
    frames, d = here.end.frames, len(problem.course.free)
    setting = problem.programme(ahead).setting
    given = problem.course.split(problem.course.at(np.array([ahead])))[0]
    for step in NUDGE * np.concatenate([np.eye(d), -np.eye(d)]):
        z, p = step_along(setting, here.end.point, frames, step[None])
        free = problem.course.free
        at = given.copy()
        at[:, free] = p[:, free]
        guess, good = project_onto_set(setting, z, at, here.end.point.rows)
        found = _solve(problem, guess, ahead) if good[0] else None
        if found is not None:
            return found
    return None


def _jump(here: _Found, after: _Found | None) -> Jump:
    structure = here.programme.setting.structure
    sides = [
        None if each is None else State(structure, each.end.point.z[0], each.end.point.p[0])
        for each in (here, after)
    ]
    values = [
        np.nan if side is None or each is None else each.programme.objective.descriptor(side)
        for side, each in zip(sides, (here, after), strict=True)
    ]
    assert sides[0] is not None
    return Jump(here.time, sides[0], sides[1], (float(values[0]), float(values[1])))


def _result(track: _Track, why: str, start: State) -> FollowedOptimum:
    problem, optima = track.problem, track.optima
    states = join_states(problem.course.structure, [each.end.point for each in optima])
    values = [
        float(each.programme.objective.descriptor.function(each.end.point.z, each.end.point.p)[0])
        for each in optima
    ]
    times = np.array([each.time for each in optima])
    found = FollowedOptimum(
        "refused" if why else "arrived",
        why,
        states,
        times,
        np.array(values),
        tuple(each.certificate for each in optima),
        tuple(track.jumps),
    )
    if why or track.jumps or len(optima) < 2:
        return found
    path = stable_path(states, times, Event(EventKind.ARRIVED, states[-1], times[-1]))
    if not path.length[-1] > 0.0:
        return found
    rules = [each.descriptor for each in problem.rules if not is_stability(each)]
    goal = optima[0].programme.objective.descriptor
    return replace(found, schedule=schedule_of(path, found.margin, (goal, *rules)))
