"""Snaps in time: folds tested by holds on both sides, and where several dampings land.

See docs/decisions.md, "A snap in time is a distance from the static branch after a hold".
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from equimorph.argument_checks import check_arguments
from equimorph.arrays import Float
from equimorph.dynamics.model import Model, landing
from equimorph.dynamics.motion import TimedCorners, timed_corners
from equimorph.dynamics.replay import STILL, ReplaySettings, Simulator
from equimorph.dynamics.simulators import model_of
from equimorph.equilibria import Event, lift, snap_landing
from equimorph.errors import InputError
from equimorph.structures import State
from equimorph.tasks.straight_lines import FINE
from equimorph.tasks.verification.schedule_check import follow_polyline
from equimorph.tolerances import DEPARTURE

PIECES = 60
"""Steps with which the plant's equilibria are followed to where they end."""
CRITICAL = ("fold", "branch point")
"""Ends of a branch at which a structure may snap."""
PATIENCE = 40.0
"""Time for which a setting is held, in units of T over the root of the relative distance from the
fold: a motion passes a fold at distance δ in a time ∝ 1/√δ."""
LONGEST = 4000.0
"""Longest hold, in units of T."""


@dataclass(frozen=True, eq=False)
class HeldLanding:
    """A hold beyond the fold with one damping.

    ratio: damping ratio of the lowest mode at the start; left: whether the structure left; time:
    when, from the beginning of the hold on; state: where it came to rest; gap: largest distance of
    a point from the landing of the gradient flow there.
    """

    ratio: float
    left: bool
    time: float
    state: State | None
    gap: float


@dataclass(frozen=True, eq=False)
class SnapInTime:
    """What a simulator does at a fold or a branch point.

    Parameters
    ----------
    fold
        Share of the way at which the library's stable equilibria end.
    fold_of_chain
        The same of the simulator's own: of the chain of links for rods and frames.
    apart
        Distance from the chain's fold at which it was held, as a share of the way.
    held_below
        Whether the structure stays where it is held before the chain's fold.
    beyond
        Holds beyond it, one for each damping.
    """

    fold: float
    fold_of_chain: float
    apart: float
    held_below: bool
    beyond: tuple[HeldLanding, ...]

    def __repr__(self) -> str:
        """Fold, and whether it is where it should be."""
        below = "holds below" if self.held_below else "does not hold below"
        left = sum(each.left for each in self.beyond)
        return (
            f"SnapInTime(fold at {self.fold:.6g}, of the chain at {self.fold_of_chain:.6g}: "
            f"{below}, snaps above with {left} of {len(self.beyond)} dampings)"
        )


@check_arguments
def snap_in_time(
    to: Sequence[Mapping[str, float]] | Mapping[str, float],
    start: State,
    *,
    simulator: Simulator = "mujoco",
    apart: float = 0.01,
    dampings: Sequence[float] = (0.01, 0.1, 1.0),
    settings: ReplaySettings | None = None,
) -> SnapInTime:
    """Hold a structure on both sides of a fold, and let it snap with several dampings.

    Ramps pass a fold before they leave; holds do not. How far the fold of the chain is from that of
    the structure tells how many links are needed, and is no matter of the motion.

    Parameters
    ----------
    to
        Way-points, the last one beyond the fold or branch point at which stable states end.
    start
        Stable state before it.
    simulator
        "mujoco", "pyelastica" or "own".
    apart
        Distance of the holds from the simulator's own fold, as a share of the way.
    dampings
        Damping ratios of the lowest mode at the start.
    settings
        Links and step.

    Raises
    ------
    InputError
        If there is no fold on the way, or the simulator does not cover the structure.
    """
    used = settings or ReplaySettings()
    model = model_of(start, simulator, used.links)
    _, way = timed_corners(to, start, None, None, 1.0)
    end = follow_polyline(start, way.rows[1:], (), FINE).end
    if end.kind not in CRITICAL:
        raise InputError(
            f"`to` must lie beyond a fold; got a way that ends with {end.kind}. Choose a "
            "way-point at which no stable equilibrium of the branch exists."
        )
    ends_at = float(np.interp(end.at, np.arange(len(way.times)), way.times))
    times = np.union1d(np.linspace(0.0, 1.0, PIECES + 1), way.times)
    fold = model.statics(start, way.at, times, used.damping).fold
    if fold is None or not np.isfinite(fold):
        raise InputError(
            f"`settings` must resolve the fold at {ends_at:.6g} of the way; got {used.links} "
            "links, whose equilibria have none. Take more links."
        )
    near = _state_at(start, way, min(fold - apart, 0.999 * ends_at))
    below, above = way.at(fold - apart), way.at(fold + apart)
    hold = _Hold(model, near, min(LONGEST, PATIENCE / np.sqrt(apart)), used)
    stays, _, _ = hold.run(below, used.damping)
    there = _expected_landing(end, start.parameters, above)
    beyond = []
    frequency = float(start.batch.natural_frequencies(1)[0, 0]) * model.unit
    for ratio in dampings:
        left, time, state = hold.run(above, 2.0 * ratio / frequency)
        gap = float("nan")
        if there is not None:
            own = model.reference(there.batch)[0]
            gap = float(np.linalg.norm(hold.points - own, axis=1).max())
        beyond.append(HeldLanding(ratio, left, time, state, gap))
    return SnapInTime(ends_at, fold, apart, not stays, tuple(beyond))


def _state_at(start: State, way: TimedCorners, time: float) -> State:
    passed = way.rows[1:][way.times[1:] < time]
    rows = np.concatenate([passed, way.at(time)[None]])
    return follow_polyline(start, rows, (), FINE).end.state


def _expected_landing(
    end: Event, names: Mapping[str, float], row: Float[np.ndarray, " parameters"]
) -> State | None:
    """Where the gradient flow lands at the end of a branch, followed to the parameters of a row."""
    landed = next((each.state for each in snap_landing(end.state) if each.landed), None)
    if landed is None:
        return None
    return lift(landed, dict(zip(names, row.tolist(), strict=True))).end.state


class _Hold:
    """Holds that begin at one state."""

    def __init__(self, model: Model, start: State, patience: float, used: ReplaySettings) -> None:
        self._model, self._start, self._patience, self._used = model, start, patience, used
        self.points = np.zeros((0, 2))

    def run(
        self, row: Float[np.ndarray, " parameters"], damping: float
    ) -> tuple[bool, float, State | None]:
        """Whether it leaves, when, and where it comes to rest."""
        model, used = self._model, self._used
        plant = model.plant(self._start, used.step, damping)
        first = plant.points
        size = float(np.ptp(first, axis=0).max())
        plant.set(row)
        steps, every = int(self._patience / used.step), max(1, round(1.0 / used.step))
        left = float("nan")
        for k in range(1, 10 * steps + 1):
            plant.step()
            if k % every:
                continue
            away = np.linalg.norm(plant.points - first, axis=1).max()
            if np.isnan(left) and away > DEPARTURE * size:
                left = k * used.step * model.unit
            # without a snap the hold ends when its time is over, else when it rests
            if (np.isnan(left) and k > steps) or (not np.isnan(left) and plant.speed < STILL):
                break
        self.points = plant.points
        gone = not np.isnan(left)
        rest = landing(self._start.structure, plant.guess(), row) if gone else None
        return gone, left, rest
