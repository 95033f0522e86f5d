"""Strides of the actuators towards targets that may move, none beyond what is safe.

Safe is what holds under all likely loads.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from equimorph.arrays import Float, Values
from equimorph.control.likely_loads import Bundles, LikelyLoads, Places, move_states
from equimorph.model import Box, Descriptor
from equimorph.structures import State, States, join_states
from equimorph.tasks.motion.course import correct_onto_targets
from equimorph.tasks.motion.tracking import Tracking
from equimorph.tolerances import SAME_TO_ROUNDING


@dataclass(frozen=True)
class MovingTarget:
    """Targets by the legs of a motion, as `track` followed them at nominal loads."""

    descriptors: tuple[Descriptor, ...]
    """What has targets."""
    at: Values
    """Legs that are done."""
    values: Float[np.ndarray, "n m"]
    """Targets there."""
    actuators: Places
    """Places of the actuators."""

    @classmethod
    def of(cls, followed: Tracking, actuators: Places) -> "MovingTarget":
        """The targets of a motion."""
        values = np.stack([each(followed.states) for each in followed.targets], axis=1)
        return cls(followed.targets, followed.path.at, values, actuators)

    @property
    def duration(self) -> float:
        """Number of legs."""
        return float(self.at[-1])

    def place(self, state: State, at: float) -> Float[np.ndarray, " d"] | None:
        """Actuators nearest to those of a state that meet the targets; None if none are found."""
        wanted = np.array([np.interp(at, self.at, column) for column in self.values.T])
        found = correct_onto_targets(
            state.structure, state.z[None], state.p[None], self.actuators, self.descriptors,
            wanted[None],
        )  # fmt: skip
        return found.p[0, self.actuators] if found.found[0] else None


WayPoints = tuple[Mapping[str, float], ...]

SHARES = (1.0, 0.5, 0.25)
"""Parts of a stride that are tried, the longest first."""


@dataclass(frozen=True)
class Stride:
    """State after a stride under the estimated loads, None if none is safe; whether it is there."""

    state: State | None
    whole: bool = False


@dataclass(frozen=True)
class Step:
    """Actuators to go to, None at the end of the way; the place after the whole stride, if any."""

    there: Values | None
    after: Bundles


@dataclass(frozen=True)
class Strides:
    """Moves of the actuators in a step."""

    box: Box
    """Limits of the actuators."""
    actuators: Places
    """Where these stand among the parameters."""
    longest: float
    """Longest move, in their scales."""

    def begin(
        self, state: State, there: Values | None, likely: LikelyLoads
    ) -> tuple[Bundles, Step]:
        """A place, and the first step from it towards another, each under all likely loads."""
        after = state.batch[:0] if there is None else self._after(state, there, 1.0)
        places = likely.under(join_states(state.structure, [state.batch, after]))
        here, ahead = np.split(np.arange(len(places)), [1])
        return places.take(here), Step(there, places.take(ahead))

    def towards(self, place: Bundles, first: Step, likely: LikelyLoads) -> Stride:
        """The longest safe stride towards the place of a step."""
        state, there = place.estimated[0], first.there
        assert there is not None
        for share in SHARES:
            whole = share == 1.0
            ahead = first.after if whole else likely.under(self._after(state, there, share))
            if len(ahead) and likely.can_move(place, ahead)[0]:
                return Stride(ahead.estimated[0], share * self._part(state, there) == 1.0)
        return Stride(None)

    def _after(self, state: State, there: Values, share: float) -> States:
        """The state after a part of a stride towards a place, where it is stable; or none."""
        here, part = state.p[self.actuators], share * self._part(state, there)
        target = there if part == 1.0 else here + part * (there - here)
        states, arrived = move_states(state.batch, self.actuators, target[None])
        return states[np.flatnonzero(arrived)]

    def _part(self, state: State, there: Values) -> float:
        """Part of the way to a place that a stride goes."""
        way = (there - state.p[self.actuators]) / state.structure.scales[self.actuators]
        return self.longest / max(float(np.linalg.norm(way)), self.longest)

    def away(self, state: State, likely: LikelyLoads) -> State | None:
        """State after the stride along one actuator to the place that bears the loads best."""
        here, scales = state.p[self.actuators], state.structure.scales[self.actuators]
        steps = self.longest * np.concatenate([np.diag(scales), -np.diag(scales)])
        places = np.array([row for row in here + steps if self.box.holds(row, slack=0.0)])
        sources = state.batch[np.zeros(len(places), int)]
        states, arrived = move_states(sources, self.actuators, places.reshape(-1, len(here)))
        bearable = replace(likely, demands=replace(likely.demands, margin=0.0))
        borne = bearable.under(states[np.flatnonzero(arrived)])
        if not borne.safe.any():
            return None
        return borne.estimated[int(np.argmax(np.where(borne.safe, borne.margins, -np.inf)))]


def ahead_of(points: WayPoints, names: tuple[str, ...], here: Values) -> WayPoints:
    """Way-points without the first ones that are where the actuators are."""
    for number, point in enumerate(points):
        if not np.allclose(setting_of(point, names, here), here, rtol=0, atol=SAME_TO_ROUNDING):
            return points[number:]
    return ()


def setting_of(point: Mapping[str, float], names: tuple[str, ...], here: Values) -> Values:
    """A way-point as an array; actuators that it does not name stay."""
    return np.array([point.get(name, value) for name, value in zip(names, here, strict=True)])
