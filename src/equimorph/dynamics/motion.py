"""Motions of all parameters in time, from schedules and way-points."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from equimorph.arrays import Float
from equimorph.dynamics.model import Model, Row
from equimorph.equilibria import check_start, way_points
from equimorph.errors import InputError
from equimorph.model import Schedule
from equimorph.structures import State, Structure
from equimorph.tasks.straight_lines import FINE
from equimorph.tasks.verification.schedule_check import first_state, follow_polyline


@dataclass(frozen=True, eq=False)
class Along:
    """Points of the equilibria at the samples, nan where they have ended.

    end, kind, at: the state at which they end, what it is, and the sample with the share of the
    way to the next one; None where they do not end.
    """

    points: Float[np.ndarray, "times points space"]
    end: State | None = None
    kind: str = "arrived"
    at: float = float("nan")


def equilibria_along(
    model: Model, begin: State, rows: Float[np.ndarray, "times parameters"]
) -> Along:
    """Follow the library's equilibria from sample to sample."""
    moves = np.abs(np.diff(rows, axis=0)).max(axis=1) > 0.0
    if not moves.any():
        return Along(np.repeat(model.reference(begin.batch), len(rows), axis=0))
    leg = np.concatenate([[0], np.cumsum(moves)])
    followed = follow_polyline(begin, rows[1:][moves], (), FINE)
    corners, ended = followed.corners, followed.end.kind != "arrived"
    if ended:
        corners = corners[followed.at[corners] < followed.end.at]
    known = model.reference(followed.states[corners])
    out = np.full((len(rows), *known.shape[1:]), np.nan)
    there = leg < len(known)
    out[there] = known[leg[there]]
    if not ended:
        return Along(out)
    whole = int(followed.end.at)
    at = np.flatnonzero(moves)[min(whole, int(moves.sum()) - 1)] + followed.end.at - whole
    return Along(out, followed.end.state, followed.end.kind, float(at))


SMOOTH = 8
"""Straight pieces for each step of a schedule that is smooth in time."""


@dataclass(frozen=True, eq=False)
class TimedCorners:
    """Parameters at times, between which they change at constant rates."""

    times: Float[np.ndarray, " corners"]
    rows: Float[np.ndarray, "corners parameters"]

    def at(self, time: float | Float[np.ndarray, " n"]) -> Row | Float[np.ndarray, "n parameters"]:
        """All parameters at times; at rest before the first and after the last one."""
        return np.stack([np.interp(time, self.times, each) for each in self.rows.T], axis=-1)

    @property
    def duration(self) -> float:
        """Time of the last corner."""
        return float(self.times[-1])

    def slower(self, factor: float) -> "TimedCorners":
        """The same way in a longer time."""
        return TimedCorners(self.times * factor, self.rows)


def timed_corners(
    schedule: Schedule | Sequence[Mapping[str, float]] | Mapping[str, float],
    start: State | None,
    structure: Structure | None,
    rate: float | None,
    duration: float | None,
) -> tuple[State, TimedCorners]:
    """Start and motion of a schedule, or of way-points, with the times that are asked for.

    Refused are motions without a start, without times, or with two kinds of them.
    """
    if isinstance(schedule, Schedule):
        begin = start or first_state(schedule, structure)
        rows, times = np.concatenate([begin.p[None], schedule.values[1:]]), schedule.times
        if times is not None and schedule.velocities is not None:
            times = np.interp(np.arange(SMOOTH * (len(times) - 1) + 1) / SMOOTH,
                np.arange(len(times)), times)  # fmt: skip
            rows = np.asarray(schedule.at(times))
    else:
        if start is None:
            raise InputError("`start` must be given with way-points; got none.")
        check_start(start)
        begin, times = start, None
        rows = np.array(way_points(start.structure, start.p, schedule))
    if rate is not None and duration is not None:
        raise InputError(f"`rate` or `duration` must be given; got both, {rate} and {duration}.")
    if rate is None and duration is None:
        if times is None:
            raise InputError(
                "`schedule` must have times; got one without. Give the replay a rate, like "
                "rate=0.02, or a duration, or the schedule times, like "
                "schedule.in_time(duration=100.0)."
            )
        return begin, TimedCorners(times - times[0], rows)
    moves = np.diff(rows, axis=0) / begin.structure.scales
    way = np.concatenate([[0.0], np.cumsum(np.linalg.norm(moves, axis=1))])
    if way[-1] == 0.0:
        raise InputError("`schedule` must change at least one parameter; got one that rests.")
    keep = np.concatenate([[True], np.diff(way) > 0.0])
    length = way[-1] / rate if rate is not None else float(duration or 0.0)
    return begin, TimedCorners(way[keep] * (length / way[-1]), rows[keep])
