"""Paths in the load, through unstable parts too, to the first stable state at a given load."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

from equimorph.equilibria import ParameterLine, TraceOptions, follow
from equimorph.equilibria.conditions import gap
from equimorph.equilibria.critical import Critical
from equimorph.equilibria.normal_form import criticality
from equimorph.equilibria.outcome import Outcome
from equimorph.equilibria.tracing import ARRIVAL, BRANCH, CONSTRAINT, RETURN
from equimorph.model import Constraint, Descriptor
from equimorph.tasks.maps.brackets import Brackets, Edges
from equimorph.tasks.maps.causes import Cause
from equimorph.tasks.maps.natural import NaturalSheet
from equimorph.tasks.maps.samples import Samples, Settings
from equimorph.tasks.maps.unloaded import LOST, START_KINDS, unloaded

KINDS = (*START_KINDS, "stable", "snaps", "branches off", "constraint", "none")
"""What a real loading does, or why there is no value, in the order of their numbers."""
STABLE, SNAPS, OFF, BOUND, NONE = range(len(START_KINDS), len(KINDS))
FOLLOWED = ("supercritical", "transcritical")
"""Branch points at which a real structure goes over to another branch without a snap."""
PASSAGES = 20
"""How often a path may pass the given load, or none, before it is given up."""
JUMP = 1e-2
"""Relative difference of values on both sides of a curve that counts as a jump."""


@dataclass(frozen=True)
class _Walk:
    """Paths on their way: lane, state, what happened, the level where they are, and direction."""

    lane: Int[np.ndarray, " lanes"]
    z: Float[np.ndarray, "lanes size"]
    p: Float[np.ndarray, "lanes parameters"]
    way: Int[np.ndarray, " lanes"]
    high: Bool[np.ndarray, " lanes"]
    up: Bool[np.ndarray, " lanes"]

    def take(self, some: Bool[np.ndarray, " lanes"]) -> "_Walk":
        """Return some of the lanes."""
        return _Walk(*(column[some] for column in vars(self).values()))


@dataclass(frozen=True)
class Passages:
    """The first stable state with load `at` on the path that starts at each natural state.

    Attributes
    ----------
    sheet, load
        Natural states, and the place of the parameter along which paths run.
    at, bound
        The given load; the largest load, of either sign, up to which paths are followed.
    descriptor
        What the map shows.
    within
        Constraints that end paths.
    options
        Step control.
    """

    sheet: NaturalSheet
    load: int
    at: float
    bound: float
    descriptor: Descriptor
    within: tuple[Constraint, ...]
    options: TraceOptions

    def __call__(self, settings: Settings) -> Samples:
        """Values at settings, with their states and what happens on the way."""
        start = unloaded(self.sheet, self.within, settings)
        z, p, kind = start.z, start.p, start.kind
        value, place = start.value, start.place
        ready = np.flatnonzero(kind == LOST)
        still = np.zeros(len(ready), bool)
        walk = _Walk(ready, z[ready], p[ready], np.full(len(ready), STABLE), still, ~still)
        for _ in range(PASSAGES):
            if not len(walk.lane):
                break
            here, end = self._passed(walk)
            z[here.lane], p[here.lane], kind[here.lane] = here.z, here.p, end
            walk = here.take(end == LOST).take(np.isfinite(here.z[end == LOST, 0]))
        kind[walk.lane] = NONE
        z[kind <= LOST] = np.nan
        some = np.flatnonzero((kind >= STABLE) & (kind <= OFF))
        value[some] = self.descriptor.function(z[some], p[some])
        if self.descriptor.place is not None and len(some):
            place[some] = self.descriptor.place(z[some], p[some])
        return Samples(settings, value, kind, place, z, p)

    def _passed(self, walk: _Walk) -> tuple[_Walk, Int[np.ndarray, " lanes"]]:
        """Paths at the next level that they meet, and how they end there: `LOST` if they go on.

        The levels are the unloaded structure and the given load. Lost paths have no state.
        """
        low = self.sheet.base[self.load]
        far = np.where(walk.up, self.bound, -self.bound)
        goal = np.where(walk.up == walk.high, far, np.where(walk.high, low, self.at))
        velocity = np.zeros_like(walk.p)
        velocity[:, self.load] = goal - walk.p[:, self.load]
        line = ParameterLine(self.sheet.structure, walk.p.copy(), velocity)
        ended = follow(line, walk.z.copy(), self.within, self.options)
        arrived, returned = ended.code == ARRIVAL, ended.code == RETURN
        outside = arrived & (walk.up == walk.high)
        inside = (arrived & ~outside) | returned
        high, up = walk.high ^ (arrived & ~outside), walk.up ^ returned
        p = line.parameters(ended.t)
        p[inside, self.load] = np.where(high, self.at, low)[inside]
        z = np.where((inside | outside | (ended.code == CONSTRAINT))[:, None], ended.z, np.nan)
        way = np.where(walk.way == STABLE, _first_loss(line, ended), walk.way)
        met = inside & high & (ended.index == 0)
        kind = np.select([met, outside, ended.code == CONSTRAINT], [way, NONE, BOUND], LOST)
        return _Walk(walk.lane, z, p, way, high, up), kind

    def causes(self, pairs: Brackets) -> list[Cause]:
        """The state at the given load is a fold."""

        def level(critical: Critical) -> Float[np.ndarray, " lanes"]:
            scale = self.sheet.structure.scales[self.load]
            return np.asarray((critical.p[:, self.load] - self.at) / scale)

        sides = (pairs.a, pairs.b)
        return [Cause.of("fold", (gap, level), _reached(side), side) for side in sides]

    def suspects(self, vertices: Samples, edges: Edges) -> Bool[np.ndarray, " edges"]:
        """No others than those over which the map changes much."""
        del vertices
        return np.zeros(len(edges), bool)

    def known(self, side: Samples) -> Bool[np.ndarray, " lanes"]:
        """Whether paths could start and were not lost."""
        return np.asarray(side.kind > LOST)

    def unexplained(self, pairs: Brackets) -> np.ndarray:
        """Where states end, values jump, snapping begins, or the extremum moves elsewhere."""
        a, b = pairs.a, pairs.b
        jump = np.abs(a.value - b.value) > JUMP * np.maximum(np.abs(a.value), np.abs(b.value))
        known = self.known(a) & self.known(b) & (_reached(a) | _reached(b))
        both = _reached(a) & _reached(b)
        cases = [~known, ~both, jump, a.kind != b.kind]
        return np.select(cases, ["", "gap", "jump", "snap"], "place").astype(object)


def _reached(side: Samples) -> Bool[np.ndarray, " lanes"]:
    return np.asarray((side.kind >= STABLE) & (side.kind <= OFF))


def _first_loss(line: ParameterLine, ended: Outcome) -> Int[np.ndarray, " lanes"]:
    """What the first loss of stability on the way means for a real loading."""
    way = np.full(len(ended.code), STABLE)
    losses = ended.passed.take(ended.passed.index[:, 1] > 0)
    lanes, first = np.unique(losses.lanes, return_index=True)
    way[lanes] = SNAPS
    branch = np.flatnonzero(losses.code[first] == BRANCH)
    if len(branch):
        at, which = lanes[branch], first[branch]
        kinds = criticality(line.take(at), losses.z[which], losses.t[which])
        way[at[np.isin(kinds, FOLLOWED)]] = OFF
    return way
