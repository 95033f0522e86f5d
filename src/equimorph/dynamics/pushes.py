"""The least force that, applied slowly and let go, leaves a structure in another state."""

from dataclasses import dataclass

import numpy as np

from equimorph.equilibria import EnergyBarrier, lift, snap_landing
from equimorph.equilibria.soft_modes import metric_length
from equimorph.model import Descriptor
from equimorph.structures import State, States
from equimorph.structures.pushed import PUSH, Pushed
from equimorph.tolerances import SAME_SOLUTION

FARTHEST = 20.0
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
    farthest, best = FARTHEST * scale, Force(np.nan, FARTHEST * scale, unit)
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
    gap = metric_length(structure, (end.z - home.z)[None, : structure.unknowns])[0]
    return None if gap <= SAME_SOLUTION else end
