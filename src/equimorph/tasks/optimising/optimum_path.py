"""Records of an optimum that moves with loads and targets, and predictions of where it ends."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from equimorph.arrays import Float
from equimorph.model import Schedule
from equimorph.structures import State, States
from equimorph.tasks.optimising.certificates import Certificate

INSIDE, OUTSIDE = 0.95, 3.0
"""Where the end is approached, in shares of the way to where it is expected."""
CLOSE = 0.02
"""Way to the expected end, relative to that to a known failure, at which its far side is tried."""


@dataclass(frozen=True, eq=False)
class Jump:
    """Where an optimum ceases to be one, and where the descent from there ends."""

    at: float
    """Number of the leg plus the fraction of it."""
    before: State
    after: State | None
    """States on both sides; `after` is None if there is no optimum beyond."""
    values: tuple[float, float]
    """Objective on both sides; nan where no optimum exists."""


@dataclass(frozen=True, eq=False)
class FollowedOptimum:
    """An optimum while loads and targets vary, with its jumps.

    Parameters
    ----------
    status
        "arrived", or "refused" with the reason in `why` where the optimum ends.
    states
        Optima along the way, the first for the start's parameters.
    at
        Number of the leg + share of it, of each; twice at jumps.
    values
        The objective.
    certificates
        Where each sits: interior, constraint, box or stability boundary; see `Certificate`.
    jumps
        Discontinuous moves of the optimum.
    schedule
        Parameters at every optimum, with margins and values of the objective and the constraints,
        with straight lines in between. Where the optima lie on a margin or a constraint, these
        lines may fall short of it by the square of their length: `verify` says by how much, and
        whether the schedule can be executed. None if refused or if the optimum jumps, which no
        schedule can follow.
    """

    status: Literal["arrived", "refused"]
    why: str
    states: States
    at: Float[np.ndarray, " points"]
    values: Float[np.ndarray, " points"]
    certificates: tuple[Certificate, ...]
    jumps: tuple[Jump, ...]
    schedule: Schedule | None = None

    def __repr__(self) -> str:
        """Values at both ends, and how many jumps."""
        if self.status == "refused":
            return f"FollowedOptimum(refused at {self.at[-1]:.6g}: {self.why})"
        ends = f"{self.values[0]:.6g} to {self.values[-1]:.6g}"
        return f"FollowedOptimum({ends}; {len(self.jumps)} jumps)"

    @property
    def arrived(self) -> bool:
        """Whether there is an optimum along the whole way."""
        return self.status == "arrived"

    @property
    def margin(self) -> Float[np.ndarray, " points"]:
        """Stability margin of each."""
        return self.states.margin


def expected_end(times: tuple[float, float], curvatures: tuple[float, float]) -> float:
    """Time at which a minimum merges with a saddle, from its curvatures at two times before.

    Its square falls to zero in proportion to the remaining time. NaN where it does not
    fall.
    """
    (t, later), (first, second) = times, curvatures
    if not 0.0 < second < first < np.inf:
        return np.nan
    return float(later + (later - t) * second**2 / (first**2 - second**2))


def next_trial(here: float, end: float, failure: float) -> float:
    """Time between an optimum and a failure to look at next, near the expected end."""
    gap = end - here
    if gap > CLOSE * (failure - here):
        return here + INSIDE * gap
    return here + OUTSIDE * gap


def extrapolation_factor(times: tuple[float, float], ahead: float, end: float) -> float:
    """Step of what moves like the square root of the time left, in last steps; or evenly."""
    first, second = times
    if not (second < ahead < end):
        return (ahead - second) / (second - first)
    left = np.sqrt([end - first, end - second, end - ahead])
    return float((left[1] - left[2]) / (left[0] - left[1]))
