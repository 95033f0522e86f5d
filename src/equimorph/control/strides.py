"""Strides of the actuators, none beyond what is safe under all likely loads."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from equimorph.arrays import Values
from equimorph.control.likely import Bundles, LikelyLoads, Places, moved
from equimorph.model import Box
from equimorph.structures import State

SHARES = (1.0, 0.5, 0.25)
"""Parts of a stride that are tried, the longest first."""


@dataclass(frozen=True)
class Stride:
    """State after a stride under the estimated loads, None if none is safe; whether it is there."""

    state: State | None
    whole: bool = False


@dataclass(frozen=True)
class Strides:
    """Moves of the actuators in a step.

    Parameters
    ----------
    box
        Limits of the actuators.
    actuators
        Where these stand among the parameters.
    longest
        Longest move, in their scales.
    """

    box: Box
    actuators: Places
    longest: float

    def towards(self, state: State, likely: LikelyLoads, place: Bundles, there: Values) -> Stride:
        """The longest safe stride towards a place."""
        here, scales = state.p[self.actuators], state.structure.scales[self.actuators]
        length = float(np.linalg.norm((there - here) / scales))
        part = 1.0 if length <= self.longest else self.longest / length
        for share in SHARES:
            whole = share * part == 1.0
            target = there if whole else here + share * part * (there - here)
            after = likely.onward(place, self.actuators, target[None])
            if after.safe[0]:
                return Stride(after.estimated[0], whole)
        return Stride(None)

    def away(self, state: State, likely: LikelyLoads) -> State | None:
        """State after the stride along one actuator to the place that bears the loads best."""
        here, scales = state.p[self.actuators], state.structure.scales[self.actuators]
        steps = self.longest * np.concatenate([np.diag(scales), -np.diag(scales)])
        places = np.array([row for row in here + steps if self.box.holds(row, slack=0.0)])
        sources = state.batch[np.zeros(len(places), int)]
        states, arrived = moved(sources, self.actuators, places.reshape(-1, len(here)))
        bearable = replace(likely, demands=replace(likely.demands, margin=0.0))
        borne = bearable.under(states[np.flatnonzero(arrived)])
        if not borne.safe.any():
            return None
        return borne.estimated[int(np.argmax(np.where(borne.safe, borne.margins, -np.inf)))]


def setting_of(point: Mapping[str, float], names: tuple[str, ...], here: Values) -> Values:
    """A way-point as an array; actuators that it does not name stay."""
    return np.array([point.get(name, value) for name, value in zip(names, here, strict=True)])
