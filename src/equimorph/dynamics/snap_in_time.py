"""Snaps in time: folds tested by holds on both sides, and where several dampings land."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from equimorph.argument_checks import check_arguments
from equimorph.dynamics.linkage_model import LinkageModel
from equimorph.dynamics.model import landing
from equimorph.dynamics.motion import timed_corners
from equimorph.dynamics.replay import STILL, ReplaySettings, Simulator
from equimorph.dynamics.simulators import model_of
from equimorph.equilibria import lift, snap_landing
from equimorph.errors import InputError
from equimorph.structures import State
from equimorph.tolerances import DEPARTURE

PIECES = 60
"""Steps with which the chain's equilibria are followed to their fold."""
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
    """A fold in a simulator.

    Parameters
    ----------
    fold
        Share of the way at which the library's equilibria fold.
    fold_of_chain
        The same of the chain of links.
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
    to: Mapping[str, float],
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
        Way-point beyond the fold.
    start
        Stable state before it.
    simulator
        "mujoco"; structures of rods and frames.
    apart
        Distance of the holds from the chain's fold, as a share of the way.
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
    if not isinstance(model, LinkageModel):
        raise InputError(
            f"`start` must be a state of a rod or a frame; got one of a {start.structure.kind}."
        )
    _, way = timed_corners(to, start, None, None, 1.0)
    found = model.quasistatics(start, way.at, np.linspace(0.0, 1.0, PIECES + 1))
    path = lift(start, to)
    if found.fold is None or path.end.kind != "fold":
        raise InputError(
            f"`to` must lie beyond a fold; got a way that ends with {path.end.kind}. Choose a "
            "way-point at which no equilibrium of the branch exists."
        )
    fold = found.fold
    frequency = model.lowest_frequency(start)
    below, above = way.at(fold - apart), way.at(fold + apart)
    near = _state_at(start, way.at(min(fold - apart, 0.999 * path.end.at)))
    hold = _Hold(model, near, min(LONGEST, PATIENCE / np.sqrt(apart)), used)
    stays, _, _ = hold.run(below, used.damping)
    expected = next((each.state for each in snap_landing(path.end.state) if each.landed), None)
    there = None if expected is None else lift(expected, _values(start, above)).end.state
    beyond = []
    for ratio in dampings:
        left, time, state = hold.run(above, 2.0 * ratio / frequency)
        gap = float("nan")
        if there is not None:
            own = model.reference(there.batch)[0]
            gap = float(np.linalg.norm(hold.points - own, axis=1).max())
        beyond.append(HeldLanding(ratio, left, time, state, gap))
    return SnapInTime(path.end.at, fold, apart, not stays, tuple(beyond))


def _values(start: State, row: Float[np.ndarray, " parameters"]) -> dict[str, float]:
    return dict(zip(start.parameters, row.tolist(), strict=True))


def _state_at(start: State, row: Float[np.ndarray, " parameters"]) -> State:
    return lift(start, _values(start, row)).end.state


class _Hold:
    """Holds that begin at one state."""

    def __init__(
        self, model: LinkageModel, start: State, patience: float, used: ReplaySettings
    ) -> None:
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
