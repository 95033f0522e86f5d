"""More actuators than targets: the shortest motion of the actuators, step by step.

``ȧ = J⁺ (Ṡ* − S_l l̇)``, J = S_a, with the pseudoinverse in the scales of the actuators
[Whitney1969]_; integrated by embedded Runge–Kutta formulas of orders five and four
[DormandPrince1980]_, every step corrected onto the set and the targets. An actuator at its limit
is held there while the remaining actuators suffice.
"""

from dataclasses import dataclass, replace

import numpy as np

from equimorph.arrays import Float, Int
from equimorph.equilibria import Event, EventKind
from equimorph.model import Constraint
from equimorph.structures import State, join_states
from equimorph.structures.metric import distances
from equimorph.tasks.motion.blocks import Stretch
from equimorph.tasks.motion.course import (
    Course,
    correct_onto_targets,
    linearise,
    may_graze,
    shortest_change,
)

TOLERANCE = 1e-8
"""Error of a step, in the metric and scaled parameters."""
LARGEST = 0.05
"""Longest step, in the metric and scaled parameters."""
FIRST = 0.05
"""Share of a leg that is tried first."""
CLOSEST = 1e-11
"""Share of a leg to which the end of a motion is located."""
FAINT = 1e-4
"""Least singular value of J, relative to its largest on the way, where it counts as singular."""
ON = 1e-10
"""Distance from a limit that counts as on it."""
SOFT = 1e-3
"""Margin, relative to the largest on the way, that counts as lost."""
STAGES = (
    (),
    (1 / 5,),
    (3 / 40, 9 / 40),
    (44 / 45, -56 / 15, 32 / 9),
    (19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729),
    (9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656),
    (35 / 384, 0.0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84),
)
"""Weights of the stages: one row for each, the last of order five."""
ERRORS = (71 / 57600, 0.0, -71 / 16695, 71 / 1920, -17253 / 339200, 22 / 525, -1 / 40)
"""Weights of the difference between orders five and four."""

Limits = dict[int, tuple[float, float]]
"""Bounds of actuators, by their places."""


@dataclass(frozen=True)
class Motion:
    """States along a course as far as it can be followed, and how it ends."""

    stretch: Stretch
    end: Event


@dataclass(frozen=True)
class _Here:
    """State on the way, its time, and the actuators that are held at their limits."""

    z: Float[np.ndarray, "1 size"]
    p: Float[np.ndarray, "1 parameters"]
    time: float
    held: frozenset[int]


def follow_redundant(
    course: Course, start: State, within: tuple[Constraint, ...], limits: Limits
) -> Motion:
    """Follow a course with more actuators than targets."""
    here = _Here(start.z[None], start.p[None], 0.0, frozenset())
    here = replace(here, held=_held_actuators(course, here, limits))
    track, step, why = [here], FIRST, ""
    while here.time < course.legs:
        corner = min(np.floor(here.time) + 1.0, course.legs)
        step = min(step, corner - here.time)
        last = step >= corner - here.time
        there, error = _step(course, here, step, corner if last else here.time + step)
        why = _fault(course, (*track[-2:], there), error, within, limits)
        if not why:
            here = replace(there, held=_held_actuators(course, there, limits))
            track.append(here)
            step *= float(np.clip(0.9 * (TOLERANCE / max(error, 1e-300)) ** 0.2, 0.5, 3.0))
            step = max(step, 4.0 * CLOSEST)
            continue
        step *= _share(here, there, why, limits)
        if step < CLOSEST * max(1.0, here.time):
            break
    return Motion(_join_track(course, track), _end(course, track, why, limits))


def _join_track(course: Course, track: list[_Here]) -> Stretch:
    states = join_states(course.structure, track)
    return Stretch(states, np.array([here.time for here in track]))


def _velocity(
    course: Course,
    z: Float[np.ndarray, "1 size"],
    p: Float[np.ndarray, "1 parameters"],
    time: float,
    held: frozenset[int],
) -> tuple[Float[np.ndarray, "1 size"], Float[np.ndarray, "1 parameters"]]:
    """Rates of z and p per leg."""
    structure = course.structure
    count = len(structure.parameters)
    rate = course.rate(time)
    own = np.array([k for k in course.free if k not in held], int)
    loads = np.setdiff1d(np.flatnonzero(rate[:count] != 0.0), course.free)
    tangents = linearise(structure, z, p, np.concatenate([own, loads]), course.descriptors)
    given = rate[loads] / structure.scales[loads]
    wanted = rate[count:] - tangents.slope[0, :, len(own) :] @ given
    moves = np.concatenate(
        [shortest_change(tangents.slope[:, :, : len(own)], wanted[None])[0], given]
    )
    return (moves @ tangents.dz[0])[None], (moves @ tangents.dp[0])[None]


def _step(course: Course, here: _Here, step: float, time: float) -> tuple[_Here, float]:
    """One step, corrected, and an estimate of its error."""
    rates: list[tuple[np.ndarray, np.ndarray]] = []
    inner = np.nextafter(here.time + step, here.time)
    for stage in STAGES:
        z = here.z + step * sum(
            (w * r[0] for w, r in zip(stage, rates, strict=True)), np.zeros_like(here.z)
        )
        p = here.p + step * sum(
            (w * r[1] for w, r in zip(stage, rates, strict=True)), np.zeros_like(here.p)
        )
        at = min(here.time + step * sum(stage), inner)
        if not (np.isfinite(z).all() and np.isfinite(p).all()):
            return here, np.inf
        rates.append(_velocity(course, z, p, at, here.held))
    weighted = list(zip(ERRORS, rates, strict=True))
    off_z = step * sum((w * r[0] for w, r in weighted), np.zeros_like(z))
    off_p = step * sum((w * r[1] for w, r in weighted), np.zeros_like(p))
    given, targets = course.split(course.at(np.array([time])))
    given[:, course.free] = p[:, course.free]
    own = np.array([k for k in course.free if k not in here.held], int)
    found = correct_onto_targets(course.structure, z, given, own, course.descriptors, targets)
    still = np.zeros_like(off_z), np.zeros_like(off_p)
    error = float(distances(course.structure, off_z, off_p, *still)[0])
    good = bool(found.found[0]) and np.isfinite(error)
    return _Here(found.z, found.p, time, here.held), error if good else np.inf


def _fault(
    course: Course,
    last: tuple[_Here, ...],
    error: float,
    within: tuple[Constraint, ...],
    limits: Limits,
) -> str:
    """Why a step cannot be taken, or nothing; `last`: up to two states before it, and its end."""
    (here, there), structure = last[-2:], course.structure
    far = distances(structure, there.z, there.p, here.z, here.p)[0] > LARGEST
    if far or not error <= TOLERANCE:
        return "long"
    if structure.index(there.z, there.p)[0] != 0:
        return "unstable"
    for constraint in within:
        if constraint.excess(there.z, there.p)[0] > 0.0:
            return str(constraint)
    if may_graze(within, join_states(structure, last))[-1]:
        return "grazing"
    for place, (low, high) in limits.items():
        if place not in there.held and not low - ON <= there.p[0, place] <= high + ON:
            return f"limit {place}"
    return ""


def _held_actuators(course: Course, here: _Here, limits: Limits) -> frozenset[int]:
    """Actuators at their limits that the shortest motion would carry beyond."""
    at = {
        place: float(np.sign(here.p[0, place] - 0.5 * (low + high)))
        for place, (low, high) in limits.items()
        if min(abs(here.p[0, place] - low), abs(here.p[0, place] - high)) <= 10.0 * ON
    }
    if not at or here.time >= course.legs:
        return frozenset()
    held: frozenset[int] = frozenset()
    for _ in range(len(at)):
        rates = _velocity(course, here.z, here.p, here.time, held)[1][0]
        out = {place for place, side in at.items() if place not in held and rates[place] * side > 0}
        if not out or len(course.free) - len(held | out) < len(course.descriptors):
            break
        held = held | out
    return held


def _share(here: _Here, there: _Here, why: str, limits: Limits) -> float:
    """Part of a step to try next: a half, or as far as a limit by interpolation."""
    if not why.startswith("limit "):
        return 0.5
    place = int(why.split()[1])
    before, after = here.p[0, place], there.p[0, place]
    bound = limits[place][int(after > before)]
    return float(np.clip((bound - before) / (after - before), 0.0, 0.9999))


def _end(course: Course, track: list[_Here], why: str, limits: Limits) -> Event:
    here = track[-1]
    state = State(course.structure, here.z[0], here.p[0])
    if here.time >= course.legs:
        return Event(EventKind.ARRIVED, state, here.time)
    if why.startswith("limit "):
        place = int(why.split()[1])
        name = course.structure.parameters[place].name
        low, high = limits[place]
        upper = abs(here.p[0, place] - high) < abs(here.p[0, place] - low)
        return Event(EventKind.LIMIT, state, here.time, None, f"{name} {'<=' if upper else '>='} "
                     f"{high if upper else low:g}")  # fmt: skip
    if why not in ("long", "unstable", "grazing"):
        return Event(EventKind.CONSTRAINT, state, here.time, None, why)
    middle = track[len(track) // 2 if len(track) > 2 else 0]
    margins = join_states(course.structure, (here, track[0], middle)).margin
    if margins[0] <= SOFT * margins.max():
        return Event(EventKind.CRITICAL, state, here.time)
    sizes = [_singular(course, each) for each in (here, track[0], middle)]
    if sizes[0] <= FAINT * max(sizes) or sizes[0] <= SOFT**0.5 * max(sizes):
        return Event(EventKind.FOLD, state, here.time)
    return Event(EventKind.LOST, state, here.time, None, "the step became too small")


def _singular(course: Course, here: _Here) -> float:
    """Least singular value of the Jacobian by the actuators that are not held."""
    own: Int[np.ndarray, " k"] = np.array([k for k in course.free if k not in here.held], int)
    slope = linearise(course.structure, here.z, here.p, own, course.descriptors).slope
    return float(np.linalg.svd(slope[0], compute_uv=False)[-1])
