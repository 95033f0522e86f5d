"""What is safe under the loads that are likely: places of the actuators, each under all of them."""

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from equimorph.arrays import Flags, Float, Int, Parameters, Some, Values
from equimorph.manifold.geometry.topology import runs
from equimorph.model import position
from equimorph.structures import States, Structure, join_states
from equimorph.structures.metric import metric_length
from equimorph.tasks.planning.network import MATCH, Demands, lift_straight
from equimorph.tolerances import SAME_TO_ROUNDING

Loads = Float[np.ndarray, " k"]
Places = Int[np.ndarray, " d"]

REACH = 0.1
"""Distance of places on a move, in the scaled parameters, at which it is asked for jumps."""


def positions(structure: Structure, names: Iterable[str]) -> Places:
    """Where parameters stand among those of a structure."""
    return np.array([position(structure.parameters, name) for name in names])


@dataclass(frozen=True)
class Bundles:
    """Places of the actuators under each of several loads."""

    states: States
    """The states, place by place; those under the estimated loads first."""
    safe: Flags
    """Whether a place is safe under all loads."""
    loads: int
    """Number of loads."""

    def __len__(self) -> int:
        """Return the number of places."""
        return len(self.safe)

    @property
    def estimated(self) -> States:
        """The states under the estimated loads."""
        return self.states[np.arange(0, len(self.states), self.loads)]

    @property
    def margins(self) -> Values:
        """Smallest stability margin of each place under its loads."""
        return np.asarray(self.states.margin.reshape(-1, self.loads).min(axis=1))

    def take(self, some: Some) -> "Bundles":
        """Some of the places."""
        lanes = (some[:, None] * self.loads + np.arange(self.loads)).ravel()
        return Bundles(self.states[lanes], self.safe[some], self.loads)

    def follow(self, other: "Bundles") -> "Bundles":
        """These places, then others."""
        states = join_states(self.states.structure, [self.states, other.states])
        return Bundles(states, np.concatenate([self.safe, other.safe]), self.loads)


@dataclass(frozen=True)
class LikelyLoads:
    """Loads that a structure has to bear, and what it has to keep under all of them."""

    at: Places
    """Where the loads stand among the parameters."""
    values: Float[np.ndarray, "m k"]
    """The loads: the estimated ones first, those after jumps last."""
    usual: int
    """Number of loads without those after jumps."""
    demands: Demands
    """Margin and constraints."""

    @classmethod
    def around(
        cls, at: Places, loads: Loads, spread: Loads, jumps: Loads, demands: Demands
    ) -> "LikelyLoads":
        """The estimated loads, with one larger or smaller by its spread, and by a jump more."""
        beyond = [spread, spread + jumps] if jumps.any() else [spread]
        changes = [sign * np.diag(each) for each in beyond for sign in (1.0, -1.0)]
        values = np.concatenate([loads[None], *(loads + each for each in changes)])
        return cls(at, values, 1 + 2 * len(loads), demands)

    def under(self, states: States) -> Bundles:
        """States under each of the loads, lifted from where they are."""
        count = len(self.values)
        source = states[np.arange(len(states)).repeat(count)]
        to = source.p.copy()
        to[:, self.at] = np.tile(self.values, (len(states), 1))
        return self._bundles(source, to)

    def can_move(self, source: Bundles, target: Bundles) -> Flags:
        """Whether straight moves lead from places to places safely under each of the loads.

        After a jump the structure may come elsewhere, as long as it does not snap; it may happen
        anywhere on the way.
        """
        after, structure = self._bundles(source.states, target.states.p), target.states.structure
        gaps = (after.states.z - target.states.z)[:, : structure.unknowns]
        apart = metric_length(structure, gaps).reshape(-1, source.loads)[:, : self.usual]
        good = after.safe & source.safe & target.safe & (apart < MATCH).all(axis=1)
        if len(self.values) > self.usual and good.any():
            some = np.flatnonzero(good)
            good[some] = self._bear_jumps(source.take(some).estimated, target.take(some).estimated)
        return np.asarray(good)

    def _bear_jumps(self, source: States, target: States) -> Flags:
        """Whether places on straight moves, not far from each other, bear the jumps."""
        change = target.p - source.p
        apart = np.linalg.norm(change / source.structure.scales, axis=1)
        between = np.maximum(np.ceil(apart / REACH - SAME_TO_ROUNDING).astype(int) - 1, 0)
        bears = np.ones(len(source), bool)
        if not between.any():
            return bears
        move, number = runs(np.ones_like(between), between)
        share = number / (between[move] + 1)
        moving = np.flatnonzero((change != 0.0).any(axis=0))
        to = (source.p[move] + share[:, None] * change[move])[:, moving]
        states, good = move_states(source[move], moving, to)
        jumps = replace(self, values=self.values[self.usual :])
        good[good] = jumps.under(states[np.flatnonzero(good)]).safe
        bears[move[~good]] = False
        return bears

    def _bundles(self, source: States, to: Parameters) -> Bundles:
        z, there, _ = lift_straight(source, to, self.demands)
        states = States(source.structure, z, to)
        there[there] = self.demands.admissible(states[np.flatnonzero(there)])
        count = len(self.values)
        return Bundles(states, np.asarray(there.reshape(-1, count).all(axis=1)), count)


def move_states(states: States, at: Places, to: Float[np.ndarray, "n k"]) -> tuple[States, Flags]:
    """Stable states after straight changes of some parameters, and which of them arrived."""
    p = states.p.copy()
    p[:, at] = to
    free = Demands.of(states.structure, "length", (), 0.0)
    z, there, _ = lift_straight(states, p, free)
    return States(states.structure, z, p), there
