"""`retime`: a motion along a schedule with limited rates, accelerations and jerks.

A moving average over a time a₁ of a motion with rates v has accelerations of at most |Δv|/a₁, a
second one over a₂ limits the jerks, and no rate grows: on one straight leg from rest to rest this
is the motion with trapezoidal accelerations. Corners are rounded, or met exactly after a pause as
long as both averages.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product
from math import factorial

import numpy as np

from equimorph.argument_checks import check_arguments
from equimorph.arrays import Float, Int
from equimorph.errors import InputError
from equimorph.model import Constraint, Rates, Schedule
from equimorph.structures import State, Structure
from equimorph.tasks.verification.schedule_check import Verification, first_state, verify

Instants = Float[np.ndarray, " instants"]
Rows = Float[np.ndarray, "corners parameters"]

NEGLIGIBLE = 1e-12
"""Relative change of rates that is round-off."""


@dataclass(frozen=True, eq=False)
class FilteredMotion:
    """A polyline in time, averaged over windows of time."""

    corners: Rows
    """Parameters at the corners."""
    durations: Float[np.ndarray, " legs"]
    """Time of each leg, without the averages."""
    pauses: Float[np.ndarray, " corners"]
    """Time at rest at each corner, 0 at the first and last."""
    windows: tuple[float, ...]
    """Times of the moving averages: none, one (accelerations) or two (jerks)."""

    @cached_property
    def _rates(self) -> tuple[Instants, Float[np.ndarray, "changes parameters"]]:
        """When rates change, and by how much."""
        legs = len(self.durations)
        rates = np.zeros((2 * legs + 1, self.corners.shape[1]))
        rates[1::2] = np.diff(self.corners, axis=0) / self.durations[:, None]
        spans = np.zeros(2 * legs + 1)
        spans[1::2], spans[2:-1:2] = self.durations, self.pauses[1:-1]
        times = self.lead + np.concatenate([[0.0], np.cumsum(spans[1:])])
        changes = np.diff(np.concatenate([rates, np.zeros((1, rates.shape[1]))]), axis=0)
        # at the same instant changes add up; those of collinear legs vanish
        instants, number = np.unique(np.round(times / times[-1], 14), return_inverse=True)
        total = np.zeros((len(instants), rates.shape[1]))
        np.add.at(total, number, changes)
        where = np.zeros(len(instants))
        where[number] = times
        keep = np.abs(total).max(axis=1) > NEGLIGIBLE * np.abs(rates).max()
        return where[keep], total[keep]

    @property
    def lead(self) -> float:
        """Half the sum of the windows: what the averages need before the first change."""
        return 0.5 * sum(self.windows)

    @property
    def duration(self) -> float:
        """Time from rest to rest."""
        return float(self.durations.sum() + self.pauses.sum() + 2.0 * self.lead)

    @property
    def corner_times(self) -> Float[np.ndarray, " corners"]:
        """When each corner is met, or nearly so: in the middle of its pause."""
        before = np.concatenate([[0.0], np.cumsum(self.durations)])
        return np.asarray(self.lead + before + np.cumsum(self.pauses) - 0.5 * self.pauses)

    def at(self, t: Instants, order: int = 0) -> Float[np.ndarray, "instants parameters"]:
        """Parameters, or their derivatives of an order up to one more than there are windows."""
        where, changes = self._rates
        weights = _ramp(t[:, None] - where, self.windows, order)
        return np.asarray(weights @ changes + (self.corners[0] if order == 0 else 0.0))

    def largest(self, order: int) -> Float[np.ndarray, " parameters"]:
        """Largest derivative of an order, exactly: they are extreme where their pieces end."""
        where, _ = self._rates
        signs = np.array(list(product((-0.5, 0.5), repeat=len(self.windows)))).reshape(
            -1, len(self.windows)
        )
        ends = np.sort((where[:, None] + signs @ np.array(self.windows)).ravel())
        middles = 0.5 * (ends[1:] + ends[:-1])
        return np.asarray(np.abs(self.at(np.concatenate([ends, middles]), order)).max(axis=0))


def _ramp(
    t: Float[np.ndarray, "instants changes"], windows: tuple[float, ...], order: int
) -> Float[np.ndarray, "instants changes"]:
    """Derivatives of max(t, 0), averaged over windows: what a unit change of a rate adds."""
    half, power = 0.5 * sum(windows), len(windows) + 1 - order
    inside = np.zeros_like(t)
    for signs in product((1.0, -1.0), repeat=len(windows)):
        shifted = t + 0.5 * sum(s * w for s, w in zip(signs, windows, strict=True))
        term = np.maximum(shifted, 0.0) ** power if power else (shifted >= 0.0).astype(float)
        inside += np.prod(signs) * term
    inside /= factorial(power) * np.prod(windows)
    beyond = {0: t, 1: np.ones_like(t)}.get(order, np.zeros_like(t))
    return np.where(t >= half, beyond, np.where(t <= -half, 0.0, inside))


SPEEDS = (1.0, 0.85, 0.7, 0.55, 0.4, 0.3, 0.2, 0.1, 0.05)
"""Shares of the largest rates that are tried: short legs are faster with less to accelerate."""
SHARP = 0.2
"""Turn at a corner, in radians, from which on it may need a pause; curves are polylines, too."""
STRAIGHT = 1e-7
"""Turn below which legs are one: round-off of the steps of a lift."""
TINY = 1e-300
"""In place of zero in denominators."""
GROWTH = 1.15
"""Factor by which windows grow while an acceleration or jerk is too large."""
EXACT = 1e-9
"""Relative excess over a limit, or distance from a corner relative to the way, that is rounding."""
LOOKS = 25
"""Instants around a corner at which the distance from it is measured."""
HALVINGS = 24
"""Bisections for the shortest pause at a corner."""
SAMPLES = 200
"""Samples of a motion where no rate of sampling is given."""

Scales = Float[np.ndarray, " parameters"]


@check_arguments
def retime(
    schedule: Schedule | Sequence[Mapping[str, float]],
    rates: Rates,
    *,
    tolerance: float | None = None,
    sampling: float | None = None,
    start: State | None = None,
    structure: Structure | None = None,
    within: Sequence[Constraint] = (),
    margin: float = 0.0,
) -> Verification:
    """Find a motion along a schedule that its actuators can execute, lifted and verified again.

    At every instant a parameter moves at its largest rate or is limited by accelerations and jerks;
    without these the motion has constant rates between corners. Sharp corners are met exactly,
    after a stop, or rounded within a tolerance. The samples are what a controller gets; straight
    lines between them are lifted again, and their margins reported.

    Parameters
    ----------
    schedule
        A verified schedule, whose own times do not count; or way-points, which need a `start`.
    rates
        Largest rates and, if wished, accelerations and jerks. They must limit every parameter that
        moves.
    tolerance
        Largest distance of the motion from the corners and the way of the schedule, in scaled
        parameters; None: every corner is met exactly.
    sampling
        Samples per unit of time, as a controller takes them: the motion is made longer by less than
        one of them so that it ends with a sample. None: 200 samples in all.
    start
        State in which the schedule begins; as of `verify`.
    structure
        Structure of a schedule that was read from a file; as of `verify`.
    within
        Constraints to obey on the way.
    margin
        Smallest stability margin allowed.

    Returns
    -------
    Verification of the motion. Its `schedule` has times, velocities and, where accelerations are
    limited, accelerations; it is None where the motion is refused, with the reason in `why`.

    Raises
    ------
    InputError
        For limits that leave out a parameter that moves, a curve that no motion follows within the
        tolerance, or as `verify`.

    References
    ----------
    Moving averages: [BiagiottiMelchiorri2012]_.

    Examples
    --------
    ``em.retime(route.schedule, em.Rates({"Theta": 0.5}, {"Theta": 2.0}), tolerance=0.02)``
    """
    if not isinstance(schedule, Schedule):
        first = verify(schedule, start, structure=structure, within=within, margin=margin)
        if first.schedule is None:
            return first
        schedule = first.schedule
    rates.check_covers(schedule.moving)
    begin = start or first_state(schedule, structure)
    scales = begin.structure.scales
    corners, number = _corners(schedule, scales)
    motion = min(
        (
            found
            for speed in SPEEDS
            if (found := _motion(corners, rates, schedule.names, tolerance, scales, speed))
        ),
        key=lambda each: each.duration,
        default=None,
    )
    if motion is None:
        raise InputError(
            f"`tolerance` must allow the motion to round the curve of the schedule; got "
            f"{tolerance!r}. Allow more, or give larger accelerations."
        )
    times = _sample_times(motion.duration, sampling)
    stretch = times[-1] / motion.duration
    inner = times / stretch
    values = motion.at(inner)
    values[0], values[-1] = begin.p, corners[-1]
    rows = [dict(zip(schedule.names, row.tolist(), strict=True)) for row in values[1:]]
    done = verify(rows, begin, structure=structure, within=within, margin=margin)
    if done.schedule is None:
        return done
    met = np.interp(number, np.arange(len(corners)), motion.corner_times)
    met[0], met[-1] = 0.0, motion.duration
    marks = np.unique(np.abs(inner[:, None] - met).argmin(axis=0))
    timed = _schedule_in_time(done, values, times, marks)
    if motion.windows:
        timed = replace(timed, velocities=motion.at(inner, 1) / stretch)
        timed = replace(timed, accelerations=motion.at(inner, 2) / stretch**2)
    return replace(done, schedule=timed)


def _corners(schedule: Schedule, scales: Scales) -> tuple[Rows, Float[np.ndarray, " marks"]]:
    """Corners of the polyline, and the way-points as numbers of these with the fraction between."""
    moves = np.abs(np.diff(schedule.values, axis=0)).max(axis=1) > 0.0
    keep = np.concatenate([[True], moves])
    rows, place = schedule.values[keep], np.cumsum(keep) - 1
    legs = np.diff(rows / scales, axis=0)
    lengths = np.linalg.norm(legs, axis=1)
    unit = legs / lengths[:, None]
    turns = np.linalg.norm(np.diff(unit, axis=0), axis=1) > STRAIGHT
    kept = np.flatnonzero(np.concatenate([[True], turns, [True]]))
    way = np.concatenate([[0.0], np.cumsum(lengths)])
    marks = np.unique(np.concatenate([[0], place[schedule.way_points], [len(rows) - 1]]))
    return rows[kept], np.interp(way[marks], way[kept], np.arange(float(len(kept))))


def _motion(
    corners: Rows,
    rates: Rates,
    names: tuple[str, ...],
    tolerance: float | None,
    scales: Scales,
    speed: float,
) -> FilteredMotion | None:
    """Motion at a share of the largest rates; None if it leaves a curve by more than allowed."""
    durations = rates.durations(names, corners) / speed
    windows = _first_windows(corners, durations, rates, names)
    if not windows:
        return FilteredMotion(corners, durations, np.zeros(len(corners)), ())
    while True:
        motion = _with_pauses(corners, durations, windows, tolerance, scales)
        over = _too_large(motion, rates, names)
        if over is None:
            break
        grown = list(windows)
        grown[over] *= GROWTH
        windows = tuple(grown)
    if _gaps(motion, scales).max() > _largest_deviation(tolerance, corners, scales):
        return None
    return motion


def _largest_deviation(tolerance: float | None, corners: Rows, scales: Scales) -> float:
    way = float(np.abs(np.diff(corners, axis=0) / scales).sum())
    return EXACT * way if tolerance is None else tolerance


def _limits(given: object, names: tuple[str, ...]) -> Float[np.ndarray, " parameters"]:
    """Limits of all parameters, infinite where there are none."""
    table = given if isinstance(given, dict) else dict(given)  # type: ignore[call-overload]
    return np.array([float(table.get(name, np.inf)) for name in names])


def _first_windows(
    corners: Rows, durations: Float[np.ndarray, " legs"], rates: Rates, names: tuple[str, ...]
) -> tuple[float, ...]:
    """Shortest windows with which single legs from rest to rest keep the limits."""
    fastest = np.abs(np.diff(corners, axis=0) / durations[:, None]).max(axis=0)
    acceleration, jerk = (_limits(each, names) for each in (rates.accelerations, rates.jerks))
    first = float((fastest / acceleration).max())
    if first <= 0.0:
        return ()
    second = float((fastest / first / jerk).max())
    return (first, second) if second > 0.0 else (first,)


def _too_large(motion: FilteredMotion, rates: Rates, names: tuple[str, ...]) -> int | None:
    """Window that must grow: 0 for an acceleration, 1 for a jerk that is too large."""
    for k, given in enumerate((rates.accelerations, rates.jerks)[: len(motion.windows)]):
        limit = _limits(given, names)
        if (motion.largest(2 + k) > limit * (1.0 + EXACT)).any():
            return k
    return None


def _with_pauses(
    corners: Rows,
    durations: Float[np.ndarray, " legs"],
    windows: tuple[float, ...],
    tolerance: float | None,
    scales: Scales,
) -> FilteredMotion:
    """The motion with the shortest pauses at sharp corners that keep within the tolerance."""
    sharp = np.concatenate([[False], _turns(corners / scales) > SHARP, [False]])
    longest = sum(windows)
    full = FilteredMotion(corners, durations, np.where(sharp, longest, 0.0), windows)
    if tolerance is None:
        return full
    low, high = np.zeros(len(corners)), full.pauses.copy()
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        gaps = _gaps(FilteredMotion(corners, durations, middle, windows), scales)
        near = gaps <= tolerance
        high = np.where(sharp & near, middle, high)
        low = np.where(sharp & ~near, middle, low)
        if (high - low).max() <= EXACT * longest:
            break
    return FilteredMotion(corners, durations, high, windows)


def _turns(places: Rows) -> Float[np.ndarray, " inner"]:
    """Angles by which a polyline turns at its inner corners."""
    legs = np.diff(places, axis=0)
    unit = legs / np.linalg.norm(legs, axis=1, keepdims=True)
    return np.asarray(np.arccos(np.clip((unit[1:] * unit[:-1]).sum(axis=1), -1.0, 1.0)))


def _gaps(motion: FilteredMotion, scales: Scales) -> Float[np.ndarray, " corners"]:
    """How far the motion passes from each corner, in scaled parameters."""
    window = np.linspace(-1.0, 1.0, LOOKS) * (motion.lead + 0.5 * motion.pauses.max())
    times = motion.corner_times[:, None] + window
    places = motion.at(times.ravel()).reshape(*times.shape, -1)
    away = (motion.corners[:, None] - places) / scales
    legs = np.diff(places / scales, axis=1)
    square = np.maximum((legs**2).sum(axis=2), TINY)
    share = np.clip((away[:, :-1] * legs).sum(axis=2) / square, 0.0, 1.0)
    off = np.linalg.norm(away[:, :-1] - share[..., None] * legs, axis=2)
    return np.asarray(off.min(axis=1))


def _sample_times(duration: float, sampling: float | None) -> Float[np.ndarray, " samples"]:
    """Equidistant instants that end at the duration, or up to one sample later."""
    if sampling is None:
        return np.linspace(0.0, duration, SAMPLES + 1)
    return np.arange(max(1, int(np.ceil(duration * sampling - EXACT))) + 1) / sampling


def _schedule_in_time(
    done: Verification,
    values: Rows,
    times: Float[np.ndarray, " samples"],
    way_points: Int[np.ndarray, " marks"],
) -> Schedule:
    """Schedule of the samples: those of the lift that are samples, pauses repeated."""
    found = done.schedule
    assert found is not None
    moves = np.concatenate([[0.0], np.abs(np.diff(values, axis=0)).max(axis=1)]) > 0.0
    lifted = found.way_points[np.cumsum(moves)]
    return replace(
        found,
        values=values,
        progress=found.progress[lifted],
        margins=found.margins[lifted],
        descriptors={name: each[lifted] for name, each in found.descriptors.items()},
        way_points=way_points,
        times=times,
    )
