"""Monte Carlo: a schedule executed by structures that are not quite what they should be."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np

from equimorph.argument_checks import check_arguments
from equimorph.arrays import Bool, Float, Int, Lanes, Parameters, Shaped, Values
from equimorph.columns import Columns
from equimorph.equilibria import lift, way_points
from equimorph.errors import InputError
from equimorph.model import (
    Constraint,
    Progress,
    Schedule,
    Silent,
    Workers,
    cut_rows,
    map_rows,
    names_of,
    position,
)
from equimorph.structures import State, States
from equimorph.tasks.start import check_schedule

CONFIDENT = 1.96
"""Standard deviations of the interval around the share of successes: 95 %."""


@dataclass(frozen=True, eq=False)
class Trials:
    """Outcomes of a schedule under random imperfections.

    Parameters
    ----------
    names, offsets
        Parameters with errors, and the errors in each trial.
    kind
        How each trial ended: "arrived", or what it met (see `Event`); "start" if the imperfection
        alone was too much.
    at
        Number of the step plus the fraction of it at which the trial ended.
    states
        Last states.
    """

    names: tuple[str, ...]
    offsets: Float[np.ndarray, "trials names"]
    kind: Shaped[np.ndarray, " trials"]
    at: Float[np.ndarray, " trials"]
    states: States

    def __repr__(self) -> str:
        """Share of successes with its interval, and the reasons of the failures."""
        low, high = self.interval
        others = f", {self.why}" if self.why else ""
        return f"Trials({self.share:.4g} ({low:.3g} … {high:.3g}) of {len(self.kind)}{others})"

    @property
    def status(self) -> Literal["arrived", "failed"]:
        """Whether all trials came to the end without a snap."""
        return "arrived" if self.arrived.all() else "failed"

    @property
    def why(self) -> str:
        """How many did not, and what they met."""
        kinds, counts = np.unique(self.kind[~self.arrived], return_counts=True)
        return ", ".join(f"{n} {kind}" for kind, n in zip(kinds, counts, strict=True))

    @cached_property
    def margin(self) -> Float[np.ndarray, " trials"]:
        """Stability margins of the last states; 0, but for rounding, where stability was lost."""
        return self.states.margin

    @property
    def arrived(self) -> Bool[np.ndarray, " trials"]:
        """Which trials came to the end without a snap."""
        return np.asarray(self.kind == "arrived")

    @property
    def share(self) -> float:
        """Share of the trials that arrived."""
        return float(self.arrived.mean())

    @property
    def interval(self) -> tuple[float, float]:
        """Interval of 95 % confidence for the probability to arrive [Wilson1927]_."""
        n, p, q = len(self.kind), self.share, CONFIDENT**2
        middle = (p + q / (2 * n)) / (1 + q / n)
        half = CONFIDENT * np.sqrt(p * (1 - p) / n + q / (4 * n * n)) / (1 + q / n)
        return float(middle - half), float(middle + half)


@check_arguments
def random_trials(  # all but three by keyword
    start: State,
    schedule: Schedule | Sequence[Mapping[str, float]],
    spreads: Mapping[str, float],
    *,
    trials: int = 200,
    within: Sequence[Constraint] = (),
    seed: int = 0,
    progress: Progress | None = None,
    workers: Workers | None = None,
) -> Trials:
    """Execute a schedule with normally distributed errors of parameters.

    The error of an actuator stays constant during a trial. Imperfect loads and shapes are
    parameters, too: a rod with a further `LineLoad` or `Curvature` pattern of amplitude 0 becomes
    imperfect by an amplitude that is not. All trials are lifted side by side.

    Parameters
    ----------
    start
        State of the perfect structure in which the schedule begins.
    schedule
        A schedule of the structure, or way-points.
    spreads
        Standard deviations by parameter.
    trials
        Number of trials.
    within
        Constraints to obey.
    seed
        Seed of the random numbers.
    progress
        Receives reports on the progress.
    workers
        Who lifts the trials; see `Workers`.

    Returns
    -------
    How each trial ended.

    Raises
    ------
    InputError
        If a name is unknown, a spread is not positive, or there are no trials.
    """
    structure = start.structure
    names = tuple(spreads)
    places = np.array([position(structure.parameters, name) for name in names], dtype=int)
    widths = np.array([float(value) for value in spreads.values()])
    if len(widths) == 0:
        raise InputError("`spreads` must name at least one parameter; got none.")
    offsets = np.random.default_rng(seed).normal(size=(trials, len(names))) * widths
    shift = np.zeros((trials, len(start.p)))
    shift[:, places] = offsets
    execution = Execution(start, corner_rows(start, schedule), tuple(within))
    ends = execution.of_all(shift, progress, workers)
    return Trials(names, offsets, ends.kind, ends.at, States(structure, ends.z, ends.p))


@dataclass(frozen=True)
class _Errors(Columns):
    """Errors of all parameters, one row for each trial."""

    shift: Parameters


@dataclass(frozen=True)
class TrialEnds(Columns):
    """How each trial ended, where, and in which state; see `Trials`."""

    kind: Shaped[np.ndarray, " trials"]
    at: Float[np.ndarray, " trials"]
    z: Lanes
    p: Parameters


@dataclass(frozen=True)
class Execution:
    """Executes a schedule, given by all parameters at its corners, with errors."""

    start: State
    rows: Parameters
    within: tuple[Constraint, ...]

    def of_all(
        self,
        shift: Parameters,
        progress: Progress | None = None,
        workers: Workers | None = None,
    ) -> TrialEnds:
        """Ends of the trials with some errors of all parameters, which workers may share."""
        cuts, sink = cut_rows(len(shift), workers), progress or Silent()
        sink.report("trials", 0, len(cuts))
        return map_rows(
            self, _Errors(shift), cuts, workers,
            lambda done: sink.report("trials", done, len(cuts)),
        )  # fmt: skip

    def __call__(self, errors: _Errors) -> TrialEnds:
        """Lift one trial beside the other; the first leg brings in the errors."""
        structure, shift = self.start.structure, errors.shift
        z, p = (np.tile(each, (len(shift), 1)) for each in (self.start.z, self.start.p))
        every = names_of(structure.parameters)
        legs = [_leg(every, row + shift) for row in (self.start.p, *self.rows)]
        lifts = lift(States(structure, z, p), legs, within=self.within)
        kind = np.where((lifts.kind != "arrived") & (lifts.at < 1.0), "start", lifts.kind)
        return TrialEnds(kind, np.maximum(lifts.at - 1.0, 0.0), lifts.states.z, lifts.states.p)


def _leg(names: tuple[str, ...], p: Parameters) -> dict[str, Values]:
    return {name: p[:, k].copy() for k, name in enumerate(names)}


def corner_rows(
    start: State, schedule: Schedule | Sequence[Mapping[str, float]]
) -> Float[np.ndarray, "rows parameters"]:
    """All parameters at the corners after the start."""
    if not isinstance(schedule, Schedule):
        return np.array(way_points(start.structure, start.p, list(schedule)))[1:]
    check_schedule(schedule, start.structure)
    corners: Int[np.ndarray, " n"] = schedule.way_points
    steps = corners[corners > 0] if len(corners) > 1 else np.arange(1, len(schedule.values))
    return np.asarray(schedule.values[steps])
