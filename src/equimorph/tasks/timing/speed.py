"""How fast a schedule may be: an a-priori bound of the deviation from the equilibria."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from equimorph.argument_checks import check_arguments
from equimorph.arrays import Float, Int
from equimorph.equilibria import check_start
from equimorph.errors import InputError
from equimorph.model import Rates, Schedule, names_of
from equimorph.structures import State, States, Structure
from equimorph.structures.vibration import vibrations
from equimorph.tasks.route import describe_place
from equimorph.tasks.verification.schedule_check import verify

STATIONS = 120
"""States along a schedule at which frequencies are computed, at most."""
SLOWEST = 1e-3
"""Lowest frequency relative to that of the first state below which a fold counts as met."""
SOFTENING = 0.25
"""Largest relative change of the lowest frequency while the phase advances by one radian."""
DAMPING = 0.27
"""Damping of a material over its stiffness, η, times the lowest frequency, where none is given."""
DIFFERENCE = 1e-4
"""Largest change of an unknown in differences of forces."""
HALVINGS = 60
"""Bisections for the largest rate."""

Steps = Float[np.ndarray, " steps"]


@dataclass(frozen=True, eq=False)
class SpeedLimit:
    """Rate up to which a structure follows a schedule within a tolerance; see `speed_limit`.

    Parameters
    ----------
    rate
        Largest rate of the scaled parameters, per unit of time.
    duration
        Of the schedule at this rate.
    rates
        The same by parameter, in their units per unit of time.
    schedule
        The schedule at this rate: its steps are the states that were computed.
    bound
        Largest deviation to be expected at each of its steps, in the unit of length.
    frequencies
        Lowest angular frequency at each step, per unit of time.
    limited_by
        "deviation", or "softening": where the frequency changes too fast for the bound to hold.
    """

    rate: float
    duration: float
    rates: Rates
    schedule: Schedule
    bound: Steps
    frequencies: Steps
    limited_by: Literal["deviation", "softening"]

    def __repr__(self) -> str:
        """Rate, duration and lowest frequency."""
        return (
            f"SpeedLimit({self.rate:.4g}/{self.schedule.time_unit}: {self.duration:.4g} "
            f"{self.schedule.time_unit}, by {self.limited_by}; lowest frequency "
            f"{self.frequencies.min():.4g})"
        )


@check_arguments
def speed_limit(
    schedule: Schedule,
    tolerance: float,
    *,
    damping: float | None = None,
    start: State | None = None,
    structure: Structure | None = None,
) -> SpeedLimit:
    """Find the largest rate at which a structure stays near the equilibria of a schedule.

    Parameters
    ----------
    schedule
        A schedule; its times do not count. The fastest scaled parameter then moves at one rate.
    tolerance
        Largest distance of a point from its equilibrium place, in the structure's unit of length.
    damping
        Damping of the material over its stiffness, η = c/k, in units of time. By default 0.27/ω₁
        with the lowest frequency ω₁ at the start: 14 % of critical damping, or more.
    start
        State in which the schedule begins; as of `verify`.
    structure
        Structure of a schedule that was read from a file; as of `verify`.

    Returns
    -------
    The rate with the schedule at this rate.

    Raises
    ------
    InputError
        If the schedule is not safe, passes so near to a fold that the lowest frequency vanishes
        (with the place), or the structure has no mass.

    Notes
    -----
    The equations of motion are linearised about the equilibria x(p(t)) and split into modes. Every
    change Δv of the equilibrium's velocity sets a mode vibrating with the amplitude Δv/ω, which
    decays like exp(−∫ζω dt) and changes like 1/√ω while ω changes slowly; damping adds the lag
    2ζv/ω with 2ζω = η k, k the material's part of ω², and ηv of grips that are as soft as the
    material. At one rate from rest the sum is ``rate · max|∂x/∂p| · (1 + 2ζ)/ω₁``. All movement
    counts as if it were in the slowest mode, and all amplitudes add: the bound is careful.

    It holds if (a) deviations stay small against the distance to other equilibria and folds,
    (b) the material has the damping given, (c) the parts of a movement in faster modes, which
    count as slow ones, do not cancel each other at the start of a vibration, and (d) ω changes by
    a quarter at most per radian of its phase: where this would fail the rate is lower, and
    `limited_by` says "softening". It is no proof that nothing snaps.

    Examples
    --------
    ``em.speed_limit(route.schedule, tolerance=0.01).duration``
    """
    course = Course.of(schedule, start, structure)
    unit = course.times_at_one()
    bent = course.softening(unit)
    fastest = SOFTENING / bent if bent > 0.0 else np.inf
    low, high = 0.0, 1.0
    while course.bound(unit / high, damping).max() < tolerance and high < fastest:
        low, high = high, 2.0 * high
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        within = course.bound(unit / middle, damping).max() <= tolerance
        low, high = (middle, high) if within else (low, middle)
    rate, cause = (fastest, "softening") if fastest < low else (low, "deviation")
    return SpeedLimit(
        float(rate),
        float(unit[-1] / rate),
        Rates({name: float(rate * scale) for name, scale in course.moving().items()}),
        replace(course.schedule, times=unit / rate),
        course.bound(unit / rate, damping),
        course.frequencies,
        "softening" if cause == "softening" else "deviation",
    )


@check_arguments
def deviation_bound(
    schedule: Schedule,
    *,
    damping: float | None = None,
    start: State | None = None,
    structure: Structure | None = None,
) -> tuple[Steps, Steps]:
    """Times of a schedule, and the deviation from equilibrium to be expected at each.

    The bound of `speed_limit`, with its assumptions, in the unit of length.

    Parameters
    ----------
    schedule
        Schedule with times.
    damping
        Time by which the damping of a joint exceeds its stiffness; as in `speed_limit`.
    start
        State in which the schedule begins, where its structure has several.
    structure
        Structure of a schedule that was read from a file without one.

    Raises
    ------
    InputError
        As `speed_limit`, or if the schedule has no times.
    """
    schedule.at(0.0)  # refuses a schedule without times
    course = Course.of(schedule, start, structure)
    assert schedule.times is not None
    times = np.interp(course.at, np.arange(len(schedule.times)), schedule.times)
    return times, course.bound(times, damping)


@dataclass(frozen=True, eq=False)
class Course:
    """Equilibria along a schedule: where points are, and how slowly they vibrate.

    schedule: with one step for each state; at: the step of the original, with its fraction;
    elastic: the material's part of the lowest frequency's square.
    """

    states: States
    schedule: Schedule
    at: Steps
    places: Float[np.ndarray, "steps points space"]
    frequencies: Steps
    elastic: Steps

    @classmethod
    def of(cls, schedule: Schedule, start: State | None, structure: Structure | None) -> "Course":
        """Lift the schedule, and compute frequencies at some of its states.

        Refused if it is not safe, or comes to a fold.
        """
        done = verify(schedule, start, structure=structure)
        if done.schedule is None:
            raise InputError(f"`schedule` must be safe at rest; {done.why}.")
        check_start(done.states[0])
        keep = _stations(len(done.states), done.schedule.way_points, done.margins)
        states = done.states[keep]
        slowest = vibrations(states.structure, states.z, states.p, 1)
        found = slowest.frequencies[:, 0]
        slow = int(np.argmin(found))
        if not found[slow] > SLOWEST * found[0]:
            where = describe_place(states[slow], done.schedule.moving)
            raise InputError(
                f"`schedule` must stay away from folds; the lowest frequency falls to "
                f"{found[slow]:.3g} from {found[0]:.3g} at {where}."
            )
        every = np.arange(len(done.states))
        return cls(
            done.states,
            done.schedule,
            _in_steps(done.at, schedule),
            done.states.shape(),
            np.interp(every, keep, found),
            np.interp(every, keep, _elastic(states, slowest.modes[:, 0])),
        )

    def moving(self) -> Mapping[str, float]:
        """Scales of the parameters that move."""
        structure = self.states.structure
        scales = dict(zip(names_of(structure.parameters), structure.scales, strict=True))
        return {name: scales[name] for name in self.schedule.moving}

    def times_at_one(self) -> Steps:
        """Times of the steps at the rate 1."""
        change = np.abs(np.diff(self.states.p, axis=0)) / self.states.structure.scales
        return np.concatenate([[0.0], np.cumsum(change.max(axis=1))])

    def softening(self, times: Steps) -> float:
        """Largest relative change of the lowest frequency per radian of its phase."""
        spans = np.diff(times)
        change = np.abs(np.diff(np.log(self.frequencies)))
        slower = np.minimum(self.frequencies[1:], self.frequencies[:-1])
        moved = spans > 0.0
        return float((change[moved] / (spans[moved] * slower[moved])).max(initial=0.0))

    def bound(self, times: Steps, damping: float | None) -> Steps:
        """Largest deviation to be expected at each state, if they are passed at these times."""
        spans, omega = np.diff(times), self.frequencies
        moved = np.flatnonzero(spans > 0.0)
        steps = np.diff(self.places, axis=0)[moved] / spans[moved, None, None]
        still = np.zeros((1, *steps.shape[1:]))
        jumps = _largest(np.diff(np.concatenate([still, steps, still]), axis=0))
        speeds = _largest(steps)
        eta = DAMPING / omega[0] if damping is None else damping
        decay = 0.5 * eta * self.elastic
        out, amplitude = np.zeros(len(times)), 0.0
        for k, piece in enumerate(moved):
            amplitude += jumps[k] / np.sqrt(omega[piece])
            ends = slice(piece, piece + 2)
            lag = eta * speeds[k] * (1.0 + self.elastic[ends] / omega[ends] ** 2)
            faded = amplitude * np.exp(-spans[piece] * decay[ends].min())
            here = np.array([amplitude, faded]) / np.sqrt(omega[ends]) + lag
            out[ends] = np.maximum(out[ends], here)
            amplitude = faded
        last = (amplitude + jumps[-1] / np.sqrt(omega[-1])) / np.sqrt(omega[-1])
        out[-1] = max(out[-1], last)
        return out


def _elastic(states: States, modes: Float[np.ndarray, "stations unknowns"]) -> Steps:
    """vᵀKv of modes v with the Hessian K of the energy without loads and multipliers."""
    structure, n = states.structure, states.structure.unknowns
    z, p, h = states.z.copy(), states.p.copy(), DIFFERENCE / np.abs(modes).max(axis=1)[:, None]
    z[:, n:] = 0.0
    for k, parameter in enumerate(structure.parameters):
        if parameter.role == "load":
            p[:, k] = 0.0
    move = np.zeros_like(z)
    move[:, :n] = h * modes
    change = structure.residual(z + move, p) - structure.residual(z - move, p)
    stiff = (change[:, :n] * modes).sum(axis=1) / (2.0 * h[:, 0])
    return np.asarray(np.maximum(stiff, 0.0))


def _stations(
    count: int, corners: Int[np.ndarray, " corners"], margins: Steps
) -> Int[np.ndarray, " stations"]:
    """Some of the states: evenly spread, with the corners and the least stable one."""
    even = np.linspace(0, count - 1, min(count, STATIONS)).round().astype(int)
    return np.asarray(np.unique(np.concatenate([even, corners[:STATIONS], [margins.argmin()]])))


def _in_steps(at: Steps, schedule: Schedule) -> Steps:
    """Numbers of the moves of a schedule as numbers of its steps, which may include pauses."""
    moves = np.abs(np.diff(schedule.values, axis=0)).max(axis=1) > 0.0
    ends = np.concatenate([[0], np.flatnonzero(moves) + 1])
    return np.asarray(np.interp(at, np.arange(len(ends)), ends.astype(float)))


def _largest(vectors: Float[np.ndarray, "steps points space"]) -> Steps:
    """Length of the largest vector of each step."""
    return np.asarray(np.linalg.norm(vectors, axis=2).max(axis=1))
