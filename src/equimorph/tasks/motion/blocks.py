"""Many close targets: states at whole blocks of them are corrected side by side."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from equimorph.arrays import Float, Int
from equimorph.equilibria import Event, EventKind, Leg, Path, lift
from equimorph.model import Constraint, Descriptor, are_feasible, names_of
from equimorph.structures import State, States
from equimorph.structures.metric import distances
from equimorph.tasks.distances import path_lengths, step_lengths
from equimorph.tasks.motion.course import (
    EXACT,
    Course,
    correct_onto_targets,
    linearise,
    may_graze,
    shortest_change,
)
from equimorph.tasks.straight_lines import FINE

DENSE = 12
"""Legs from which on blocks of them are cheaper than one continuation each."""

LARGEST = 0.05
"""Longest way between successive states, in the metric and scaled parameters."""
SURE = 0.25
"""First correction, relative to the predicted way, of states that are on the same branch."""
BLOCK = 64
"""Most targets of a block."""
CLOSEST = 1e-3
"""Share of a leg below which it is not halved any more."""


def path_by_blocks(course: Course, start: State, within: tuple[Constraint, ...]) -> Path:
    """Follow a course in blocks; where these end, by continuation to the next corner."""
    parts, here, time = [], start, 0.0
    end = Event(EventKind.ARRIVED, start, 0.0)
    while time < course.legs and end.kind == "arrived":
        stretch = follow_blocks(course, here, time, within)
        parts.append((stretch.states.z, stretch.states.p, stretch.times))
        here, time = stretch.states[-1], float(stretch.times[-1])
        if time < course.legs:
            corner = float(int(time) + 1)
            path = lift(here, _rest(course, time), within=within, options=FINE)
            times = time + path.at * (corner - time)
            parts.append((path.states.z, path.states.p, times))
            here, end = path.end.state, path.end
            time = float(times[-1]) if end.kind != "arrived" else corner
    kept = [parts[0], *(tuple(each[1:] for each in part) for part in parts[1:])]
    z, p, times = (np.concatenate(columns) for columns in zip(*kept, strict=True))
    last = Event(end.kind, here, float(times[-1]), end.criticality, end.detail)
    return stable_path(States(start.structure, z, p), times, last)


def stable_path(states: States, times: np.ndarray, end: Event) -> Path:
    """Path through stable states, with how it ended."""
    length = path_lengths(states)
    return Path(states, times, length, np.zeros(len(states), int), (end,))


def _rest(course: Course, time: float) -> Leg:
    """Rest of the leg in which a time lies, with the actuators unknown."""
    names = names_of(course.structure.parameters)
    unknown = dict.fromkeys(names[k] for k in course.free)
    leg, share = int(time), time - int(time)
    if leg in course.curves:
        curve = course.curves[leg]
        return lambda t: {**curve(share + (1.0 - share) * t), **unknown}
    here, there = course.at(np.array([time]))[0], course.corners[leg + 1]
    count = len(names)
    moved = {names[k]: float(there[k]) for k in range(count) if there[k] != here[k]}
    return {
        **moved,
        **dict(zip(course.descriptors, there[count:].tolist(), strict=True)),
        **unknown,
    }


def same_descriptors(legs: Sequence[Leg]) -> bool:
    """Whether all legs prescribe the same descriptors."""
    first = [leg(0.0) if callable(leg) else leg for leg in legs]
    asked = [{key for key in leg if isinstance(key, Descriptor)} for leg in first]
    return all(each == asked[0] for each in asked)


@dataclass(frozen=True)
class Stretch:
    """States along a course, from a time on, in order; the first is where it begins."""

    states: States
    times: Float[np.ndarray, " points"]


def follow_blocks(
    course: Course, start: State, time: float, within: tuple[Constraint, ...]
) -> Stretch:
    """Follow a course from a time on, as far as stable states are found without any doubt.

    States at the corners ahead are predicted along the tangents and corrected, all of a block at
    once. Those that move by less than a quarter of the predicted way count, up to the first that is
    unstable, violates a constraint, perhaps on the way, or is far from the one before, which is
    approached by halves.
    """
    structure = course.structure
    z, p, times = [start.z[None]], [start.p[None]], [np.array([time])]
    waiting = np.arange(int(time) + 1.0, course.legs + 1.0)
    size = 4
    while len(waiting):
        here = State(structure, z[-1][-1], p[-1][-1])
        ahead = waiting[:size]
        block = _block(course, here, times[-1][-1], ahead, within)
        if len(block.states):
            z.append(block.states.z)
            p.append(block.states.p)
            times.append(block.times)
            waiting = waiting[len(block.times) :]
            size = min(BLOCK, 2 * size) if len(block.times) == len(ahead) else max(2, size // 2)
            continue
        gap = waiting[0] - times[-1][-1]
        if gap < CLOSEST:
            break
        waiting = np.concatenate([[waiting[0] - 0.5 * gap], waiting])
        size = 2
    states = States(structure, np.concatenate(z), np.concatenate(p))
    return Stretch(states, np.concatenate(times))


def _block(
    course: Course,
    here: State,
    time: float,
    ahead: Float[np.ndarray, " n"],
    within: tuple[Constraint, ...],
) -> Stretch:
    """States at the first of some times, those that are beyond doubt."""
    structure, free = course.structure, course.free
    p, targets = course.split(course.at(ahead))
    p[:, free] = here.p[free]
    guess = _predict(course, here, course.at(np.array([time])), p, targets)
    begin = np.repeat(here.z[None], len(p), axis=0), np.repeat(here.p[None], len(p), axis=0)
    way = distances(structure, *guess, *begin)
    found = correct_onto_targets(structure, *guess, free, course.descriptors, targets)
    good = found.found & (found.first <= SURE * way + EXACT)
    z, p = np.concatenate([here.z[None], found.z]), np.concatenate([here.p[None], found.p])
    good &= step_lengths(States(structure, z, p)) <= LARGEST
    count = _leading(good)
    states = States(structure, found.z[:count], found.p[:count])
    if count:
        fine = states.index == 0
        fine &= are_feasible(within, states.z, states.p)
        states = states[: _leading(fine)]
    if len(states):
        z, p = z[: len(states) + 1], p[: len(states) + 1]
        states = states[: _leading(~may_graze(within, States(structure, z, p)))]
    return Stretch(states, ahead[: len(states)])


def _leading(flags: Int[np.ndarray, " n"] | np.ndarray) -> int:
    """How many of the first are true."""
    return len(flags) if flags.all() else int(np.argmin(flags))


def _predict(
    course: Course,
    here: State,
    now: Float[np.ndarray, "1 columns"],
    p: Float[np.ndarray, "n parameters"],
    targets: Float[np.ndarray, "n m"],
) -> tuple[Float[np.ndarray, "n size"], Float[np.ndarray, "n parameters"]]:
    """States ahead by the tangent space: loads as given, actuators by the targets."""
    structure, free = course.structure, course.free
    loads = np.setdiff1d(np.flatnonzero((p != here.p).any(axis=0)), free)
    both = np.concatenate([free, loads])
    tangents = linearise(structure, here.z[None], here.p[None], both, course.descriptors)
    k, count = len(free), len(p)
    moved = (p - here.p)[:, loads] / structure.scales[loads]
    wanted = targets - course.split(now)[1] - moved @ tangents.slope[0, :, k:].T
    step = shortest_change(np.repeat(tangents.slope[:, :, :k], count, axis=0), wanted)
    step = np.concatenate([step, moved], axis=1)
    return here.z + step @ tangents.dz[0], here.p + step @ tangents.dp[0]
