"""Paths in the load, through unstable parts too, to the first stable state at a given load."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

from equimorph.equilibria import TraceOptions
from equimorph.equilibria.conditions import gap
from equimorph.equilibria.critical import Critical
from equimorph.equilibria.first_stable import WAYS, FirstStable
from equimorph.equilibria.natural_sheet import NaturalSheet
from equimorph.model import Constraint, Descriptor
from equimorph.tasks.maps.brackets import Brackets, Edges
from equimorph.tasks.maps.causes import Cause
from equimorph.tasks.maps.samples import Samples, Settings
from equimorph.tasks.maps.unloaded import LOST, START_KINDS, unloaded

KINDS = (*START_KINDS, *WAYS[1:])
"""What a real loading does, or why there is no value, in the order of their numbers."""
STABLE, SNAPS, OFF, BOUND, NONE = range(len(START_KINDS), len(KINDS))
JUMP = 1e-2
"""Relative difference of values on both sides of a curve that counts as a jump."""


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
        walked = FirstStable(
            self.sheet.structure, self.load, float(self.sheet.base[self.load]), self.bound,
            self.within, self.options,
        )(z[ready], p[ready], np.full(len(ready), self.at))  # fmt: skip
        z[ready], p[ready], kind[ready] = walked[0], walked[1], LOST + walked[2]
        z[kind <= LOST] = np.nan
        some = np.flatnonzero((kind >= STABLE) & (kind <= OFF))
        value[some] = self.descriptor.function(z[some], p[some])
        if self.descriptor.place is not None and len(some):
            place[some] = self.descriptor.place(z[some], p[some])
        return Samples(settings, value, kind, place, z, p)

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
