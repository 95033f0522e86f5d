"""Paths of motions: many close targets by blocks, doubtful stretches by continuation."""

from collections.abc import Sequence

import numpy as np

from equimorph.equilibria import Event, Leg, Path, TraceOptions, lift
from equimorph.model import Constraint, Descriptor, names_of
from equimorph.structures import State, States
from equimorph.tasks.motion.course import Course
from equimorph.tasks.motion.dense import march
from equimorph.tasks.motion.local import distances

DENSE = 12
"""Legs from which on blocks of them are cheaper than one continuation each."""


def dense_path(
    course: Course, start: State, within: tuple[Constraint, ...], options: TraceOptions
) -> Path:
    """Follow a course in blocks; where these end, by continuation to the next corner."""
    parts, here, time = [], start, 0.0
    end = Event("arrived", start, 0.0)
    while time < course.legs and end.kind == "arrived":
        stretch = march(course, here, time, within)
        parts.append((stretch.states.z, stretch.states.p, stretch.times))
        here, time = stretch.states[-1], float(stretch.times[-1])
        if time < course.legs:
            corner = float(int(time) + 1)
            path = lift(here, _rest(course, time), within=within, options=options)
            times = time + path.at * (corner - time)
            parts.append((path.states.z, path.states.p, times))
            here, end = path.end.state, path.end
            time = float(times[-1]) if end.kind != "arrived" else corner
    kept = [parts[0], *(tuple(each[1:] for each in part) for part in parts[1:])]
    z, p, times = (np.concatenate(columns) for columns in zip(*kept, strict=True))
    last = Event(end.kind, here, float(times[-1]), end.criticality, end.detail)
    return path_of(States(start.structure, z, p), times, last)


def path_of(states: States, times: np.ndarray, end: Event) -> Path:
    """Path through stable states, with how it ended."""
    steps = distances(states.structure, states.z, states.p)
    length = np.concatenate([[0.0], np.cumsum(steps)])
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


def uniform(legs: Sequence[Leg]) -> bool:
    """Whether all legs prescribe the same descriptors."""
    first = [leg(0.0) if callable(leg) else leg for leg in legs]
    asked = [{key for key in leg if isinstance(key, Descriptor)} for leg in first]
    return all(each == asked[0] for each in asked)
