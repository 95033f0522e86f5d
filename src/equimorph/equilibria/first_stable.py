"""Paths in a load, through unstable parts too, to the first stable state at a given load."""

from dataclasses import dataclass

import numpy as np

from equimorph.arrays import Flags, Float, Lanes, Numbers, Parameters, Shaped, Values
from equimorph.columns import Columns
from equimorph.equilibria.critical import criticality
from equimorph.equilibria.curves import ParameterLine
from equimorph.equilibria.trace import Traces, trace
from equimorph.equilibria.trace_options import EventCode, TraceOptions
from equimorph.model import Constraint
from equimorph.structures import Structure

WAYS = ("lost", "stable", "snaps", "branches off", "constraint", "none")
"""What a real loading does, or why there is no state, in the order of their numbers."""
LOST, STABLE, SNAPS, OFF, BOUND, NONE = range(len(WAYS))
FOLLOWED = ("supercritical", "transcritical")
"""Branch points at which a real structure goes over to another branch without a snap."""
PASSAGES = 20
"""How often a path may pass the given load, or none, before it is given up."""


@dataclass(frozen=True)
class Passed:
    """A critical state that a path passes: index before and behind, state and all parameters."""

    index: tuple[int, int]
    z: Float[np.ndarray, " size"]
    p: Float[np.ndarray, " parameters"]


def no_critical_states(lanes: int) -> Shaped[np.ndarray, " lanes"]:
    """No critical states on any path."""
    out = np.empty(lanes, dtype=object)
    out[:] = [()] * lanes
    return out


@dataclass(frozen=True)
class _Walk(Columns):
    """Paths on their way: lane, state, what happened, the level where they are, and direction."""

    lane: Numbers
    z: Lanes
    p: Parameters
    at: Values
    way: Numbers
    high: Flags
    up: Flags


@dataclass(frozen=True)
class FirstStable:
    """The first stable state at a given load on paths from unloaded states."""

    structure: Structure
    """The structure."""
    load: int
    low: float
    """Place of the parameter along which paths run, and its value where they start."""
    bound: float
    """Largest load, of either sign, up to which paths are followed."""
    within: tuple[Constraint, ...]
    """Constraints that end paths."""
    options: TraceOptions
    """Step control; paths must go through folds and branch points. Where they do not locate folds,
    it is not told which of them snap."""

    def __call__(
        self,
        z: Lanes,
        p: Parameters,
        at: Values,
        passed: Shaped[np.ndarray, " lanes"] | None = None,
    ) -> tuple[Lanes, Parameters, Numbers]:
        """States at loads `at` (other than the unloaded one), and numbers in `WAYS`.

        Critical states on the way are added to those `passed`, if these are requested.
        """
        z, p, way = z.copy(), p.copy(), np.full(len(z), LOST)
        still = np.zeros(len(z), bool)
        stable = np.full(len(z), STABLE)
        walk = _Walk(np.arange(len(z)), z.copy(), p.copy(), at, stable, still, ~still)
        for _ in range(PASSAGES):
            if not len(walk.lane):
                break
            here, end = self._to_next_level(walk, passed)
            z[here.lane], p[here.lane], way[here.lane] = here.z, here.p, end
            walk = here.take(end == LOST).take(np.isfinite(here.z[end == LOST, 0]))
        way[walk.lane] = NONE
        return z, p, way

    def _to_next_level(
        self, walk: _Walk, passed: Shaped[np.ndarray, " all"] | None
    ) -> tuple[_Walk, Numbers]:
        """Paths at the next level that they meet, and how they end there: `LOST` if they go on.

        The levels are the unloaded structure and the given load. Lost paths have no state.
        """
        far = np.where(walk.up == (walk.at > self.low), self.bound, -self.bound)
        goal = np.where(walk.up == walk.high, far, np.where(walk.high, self.low, walk.at))
        velocity = np.zeros_like(walk.p)
        velocity[:, self.load] = goal - walk.p[:, self.load]
        line = ParameterLine(self.structure, walk.p.copy(), velocity)
        ended = trace(line, walk.z.copy(), self.within, self.options)
        arrived, returned = ended.code == EventCode.ARRIVED, ended.code == EventCode.RETURNED
        outside = arrived & (walk.up == walk.high)
        inside = (arrived & ~outside) | returned
        high, up = walk.high ^ (arrived & ~outside), walk.up ^ returned
        p = line.parameters(ended.t)
        p[inside, self.load] = np.where(high, walk.at, self.low)[inside]
        z = np.where(
            (inside | outside | (ended.code == EventCode.CONSTRAINT))[:, None], ended.z, np.nan
        )
        way = np.where(walk.way == STABLE, _first_loss(line, ended), walk.way)
        if passed is not None:
            _note(passed, walk.lane, line, ended)
        met = inside & high & (ended.index == 0)
        kind = np.select(
            [met, outside, ended.code == EventCode.CONSTRAINT], [way, NONE, BOUND], LOST
        )
        return _Walk(walk.lane, z, p, walk.at, way, high, up), kind


def _note(
    passed: Shaped[np.ndarray, " all"], lanes: Numbers, line: ParameterLine, ended: Traces
) -> None:
    """Add the critical states that paths met to those known."""
    events = ended.passed
    p = line.take(events.lanes).parameters(events.t)
    for k, lane in enumerate(lanes[events.lanes]):
        before, behind = events.index[k].tolist()
        passed[lane] = (*passed[lane], Passed((before, behind), events.z[k], p[k]))


def _first_loss(line: ParameterLine, ended: Traces) -> Numbers:
    """What the first loss of stability on the way means for a real loading."""
    way = np.full(len(ended.code), STABLE)
    losses = ended.passed.take(ended.passed.index[:, 1] > 0)
    lanes, first = np.unique(losses.lanes, return_index=True)
    way[lanes] = SNAPS
    branch = np.flatnonzero(losses.code[first] == EventCode.BRANCH_POINT)
    if len(branch):
        at, which = lanes[branch], first[branch]
        kinds = criticality(line.take(at), losses.z[which], losses.t[which])
        way[at[np.isin(kinds, FOLLOWED)]] = OFF
    return way
