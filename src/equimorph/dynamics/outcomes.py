"""What becomes of structures that are launched or pushed: whether they come back, and where to."""

from dataclasses import dataclass, replace
from enum import IntEnum

import numpy as np

from equimorph.arrays import Flags, Int, Lanes, Parameters, Values, Velocity
from equimorph.columns import Columns
from equimorph.dynamics.own_equations import Motion
from equimorph.equilibria import EnergyBarrier, lift, snap_landing
from equimorph.equilibria.gradient_flow import Ending, gradient_flow
from equimorph.equilibria.soft_modes import extent_of_guesses, soft_modes
from equimorph.model import Descriptor
from equimorph.structures import State, States, Structure
from equimorph.structures.added_load import PUSH, Pushed
from equimorph.structures.metric import metric_length
from equimorph.tolerances import SAME_SOLUTION

LARGEST_PUSH = 20.0
"""Largest force, in units of the barrier over the change of the descriptor up to the saddle."""
SNAPS = 5
"""Most snaps under a growing force after each of which the structure comes back when let go."""
CRITICAL = ("fold", "branch point", "multiple point")


@dataclass(frozen=True, eq=False)
class Force:
    """Least force found, in units of `Structure.energy` over the descriptor's; or how far it holds.

    landing: stable state of the structure without the force.
    """

    value: float
    holds: float
    unit: str
    landing: State | None = None


def least_force(state: State, barrier: EnergyBarrier, along: Descriptor) -> Force:
    """Follow a dead load along a descriptor, both ways, and let it go where stability is lost."""
    saddle = barrier.saddle
    assert saddle is not None
    structure = state.structure
    change = float(along(saddle) - along(state))
    reach = float(np.abs(saddle.z - state.z)[: structure.unknowns].max())
    scale = barrier.energy / structure.energy_scale / max(abs(change), 1e-3 * reach)
    pushed = Pushed(structure, along, scale, reach)
    unit = pushed.parameters[-1].unit
    farthest, best = LARGEST_PUSH * scale, Force(np.nan, LARGEST_PUSH * scale, unit)
    for sign in (1.0, -1.0) if change >= 0.0 else (-1.0, 1.0):
        value, landing = _follow(state, pushed, sign * farthest)
        if landing is not None:
            best, farthest = Force(value, abs(value), unit, landing), abs(value)
    return best


def _follow(state: State, pushed: Pushed, farthest: float) -> tuple[float, State | None]:
    """Force at which the structure lands elsewhere, and where; no state if it comes back."""
    here = State(pushed, state.z, np.append(state.p, 0.0))
    for _ in range(SNAPS):
        path = lift(here, {PUSH: farthest})
        # beside the edge of stability a structure need not snap to be elsewhere when let go
        last = len(path.states) - 1 - (path.end.kind in CRITICAL)
        if _let_go(path.states[last], state) is not None:
            return _first_elsewhere(path.states, last, state)
        if path.end.kind not in CRITICAL:
            break
        ways = [way.state for way in snap_landing(path.end.state) if way.landed]
        for loaded in ways:
            landing = _let_go(loaded, state)
            if landing is not None:
                return float(path.end.state[PUSH]), landing
        if not ways:
            break
        here = ways[-1]
    return float("nan"), None


def _first_elsewhere(loaded: States, last: int, home: State) -> tuple[float, State | None]:
    """Force on a path from which on a structure lands elsewhere when let go, by bisection."""
    low, high = 0, last
    while high - low > 1:
        middle = (low + high) // 2
        elsewhere = _let_go(loaded[middle], home) is not None
        low, high = (low, middle) if elsewhere else (middle, high)
    return float(loaded[high][PUSH]), _let_go(loaded[high], home)


def _let_go(loaded: State, home: State) -> State | None:
    """Stable state where a loaded one lands without the force; None if that is home."""
    structure = home.structure
    if abs(loaded[PUSH]) > 0.0:
        [way] = snap_landing(loaded, at={PUSH: 0.0})
        if not way.landed:
            return None
        loaded = way.state
    end = State(structure, loaded.z, home.p)
    gap = metric_length(structure, end.z - home.z)
    return None if gap <= SAME_SOLUTION else end


LOOKED_AT = 0.2
"""Time after which it is seen which motions are decided, in units of the model's time T."""
NEAR_TOP = 0.9
"""Share of the height of the saddle that potential energy reaches on the edge of the basin, less
what it may change within a step."""
PATIENCE = 12.0
"""Longest time of a motion, in times in which free vibrations lose energy by the factor e."""
AT_LEAST = 40.0
"""And the shortest limit, in units of the model's time T."""
GAIN = 0.02
"""Share of its first energy, above that of its home, by which that of a passive motion may seem to
grow; a larger gain says that the step in time is too long for the vibrations that are excited."""
RESOLVED = 0.4
"""Longest step in time, over the highest frequency that a disturbance excites: with half of it the
same knocks of the arch snap."""
HALVINGS = 4
"""How often the step in time is halved for motions that are lost."""
FARTHEST = 10.0
"""Way in the metric after which a motion has left for infinity, in extents of the guesses."""


class Outcome(IntEnum):
    """What became of a motion."""

    OPEN = -1
    """It still moved with more energy than the lowest saddle when time was over."""
    HELD = 0
    LEFT = 1
    ESCAPED = 2
    LOST = 3
    """A step in time was not found, or the energy grew, with the shortest step, too."""


@dataclass(frozen=True)
class Launches(Columns):
    """Structures that begin to move.

    z, p, velocity: at the start; home: unknowns of the stable state that counts as held; level:
    energy of the lowest saddle on the edge of its basin, in units of `Structure.energy`.
    """

    z: Lanes
    p: Parameters
    velocity: Velocity
    home: Lanes
    level: Values


@dataclass(frozen=True)
class Clock:
    """Step in time and damping: C = `rate` M; `unit` is the model's time T."""

    step: float
    rate: float
    unit: float

    @classmethod
    def resolving(cls, frequencies: Values, step: float, rate: float, unit: float) -> "Clock":
        """Steps that resolve vibrations of some frequencies, and are no longer than one."""
        highest = float(frequencies[np.isfinite(frequencies)].max(initial=0.0))
        return cls(RESOLVED / max(highest, RESOLVED / step), rate, unit)

    @property
    def steps(self) -> int:
        """Most steps of one motion."""
        longest = max(AT_LEAST * self.unit, PATIENCE / self.rate)
        return int(np.ceil(longest / self.step))

    @property
    def looks(self) -> int:
        """Steps after which it is seen which motions are decided."""
        return max(1, round(LOOKED_AT * self.unit / self.step))


@dataclass(frozen=True)
class Outcomes(Columns):
    """`Outcome` of each launch, and where each was when it was decided."""

    code: Int[np.ndarray, " lanes"]
    z: Lanes
    velocity: Velocity


def play(structure: Structure, launches: Launches, clock: Clock, *, watch: bool) -> Outcomes:
    """Let structures move until their energy is below that of the lowest saddle around their home.

    From then on each motion stays in the piece of the configurations below that energy in which it
    is, at home or elsewhere, and the gradient flow tells which. With `watch` a motion has left as
    soon as the flow leads elsewhere from where it is, even if it would come back later. Motions
    that are lost are played again with half the step.
    """
    found = _play(structure, launches, clock, watch=watch)
    for _ in range(HALVINGS):
        lost = np.flatnonzero(found.code == Outcome.LOST)
        if len(lost) == 0:
            break
        clock = replace(clock, step=0.5 * clock.step)
        again = _play(structure, launches.take(lost), clock, watch=watch)
        found = found.with_rows(lost, again)
    return found


def _play(structure: Structure, launches: Launches, clock: Clock, *, watch: bool) -> Outcomes:
    """Let structures move with one length of steps."""
    count = len(launches.z)
    code, todo = np.full(count, int(Outcome.OPEN)), np.arange(count)
    motion = Motion.of(launches.z, launches.velocity)
    last, speed = launches.z.copy(), launches.velocity.copy()
    bottom = structure.energy(launches.home, launches.p)
    edge = bottom + NEAR_TOP * (launches.level - bottom)
    highest, every = structure.energy(launches.z, launches.p), clock.looks
    first = motion.energy(structure, launches.p)
    most = first + GAIN * np.abs(first - bottom)
    far = FARTHEST * extent_of_guesses(structure, launches.p)
    for number in range(clock.steps):
        p = launches.p[todo]
        highest[todo] = np.maximum(highest[todo], structure.energy(motion.z, p))
        if number % every == 0:
            energy = motion.energy(structure, p)
            low = energy < launches.level[todo]
            seen = np.flatnonzero(low | (watch & (highest[todo] >= edge[todo])))
            highest[todo] = -np.inf
            now = np.where(low, int(Outcome.HELD), int(Outcome.OPEN))
            away, lost = _away(structure, motion.z[seen], launches.take(todo[seen]))
            now[seen[away]] = Outcome.LEFT
            now[seen[lost & low[seen]]] = Outcome.LOST
            way = (motion.z - launches.z[todo])[:, : structure.unknowns]
            now[metric_length(structure, way) > far] = Outcome.ESCAPED
            now[~(energy <= most[todo])] = Outcome.LOST
            code[todo], last[todo], speed[todo] = now, motion.z, motion.velocity
            keep = np.flatnonzero(now == Outcome.OPEN)
            motion, todo = motion.take(keep), todo[keep]
            if len(todo) == 0:
                break
        motion, found = motion.step(structure, launches.p[todo], clock.step, clock.rate)
        code[todo[~found]] = Outcome.LOST
        keep = np.flatnonzero(found)
        motion, todo = motion.take(keep), todo[keep]
    return Outcomes(code, last, speed)


def _away(structure: Structure, z: Lanes, launches: Launches) -> tuple[Flags, Flags]:
    """Whether the flow leads elsewhere from configurations, and whether it fails."""
    ends, landed = relax(structure, z, launches.p)
    gap = metric_length(structure, ends - launches.home)
    return landed & (gap > SAME_SOLUTION), ~landed


def relax(structure: Structure, z: Lanes, p: Parameters) -> tuple[Lanes, Flags]:
    """Where the gradient flow leads from configurations, and whether that is a stable state."""
    if len(z) == 0:
        return z, np.zeros(0, bool)
    soft = soft_modes(structure, z, p)
    flow = gradient_flow(structure, z, p, soft.stiffness, soft.length)
    return flow.z, flow.code == Ending.LANDED
