"""Limit loads at settings, many at a time: rays in the load from natural states."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from equimorph.equilibria import ParameterLine, TraceOptions, follow
from equimorph.equilibria.tracing import ARRIVAL, BRANCH, CONSTRAINT, FOLD
from equimorph.model import Constraint
from equimorph.tasks.maps.natural import NaturalSheet
from equimorph.tasks.maps.samples import Samples

KINDS = (
    "fold",
    "branch point",
    "constraint",
    "none below the bound",
    "undefined unloaded",
    "no natural state",
    "lost",
)
"""What ended the path at a setting, in the order of their numbers."""
END_FOLD, END_BRANCH, END_CONSTRAINT, END_NONE, UNDEFINED, MISSING, LOST = range(len(KINDS))
_OF_CODE = {FOLD: END_FOLD, BRANCH: END_BRANCH, CONSTRAINT: END_CONSTRAINT, ARRIVAL: END_NONE}


@dataclass(frozen=True)
class Rays:
    """Limit loads at settings: rays in the load from natural states."""

    sheet: NaturalSheet
    load: int
    within: tuple[Constraint, ...]
    bound: float
    options: TraceOptions

    def __call__(self, settings: Float[np.ndarray, "lanes 2"]) -> Samples:
        """Limit loads at settings, with their states."""
        start = self.unloaded(settings)
        z, p, kind = start.z, start.p, start.kind
        value, place = start.value, start.place
        ready = np.flatnonzero(kind == LOST)
        velocity = np.zeros((len(ready), p.shape[1]))
        velocity[:, self.load] = self.bound - p[ready, self.load]
        if len(ready):
            line = ParameterLine(self.sheet.structure, p[ready].copy(), velocity)
            ended = follow(line, z[ready].copy(), self.within, self.options)
            kind[ready] = [_OF_CODE.get(int(code), LOST) for code in ended.code]
            z[ready], p[ready] = ended.z, line.parameters(ended.t)
            value[ready] = np.where(kind[ready] == LOST, np.nan, p[ready, self.load])
            met = ready[kind[ready] == END_CONSTRAINT]
            if len(met):
                place[met] = _places(self.within, z[met], p[met])
        z[np.isin(kind, (UNDEFINED, MISSING, LOST))] = np.nan
        return Samples(settings, value, kind, place, z, p)

    def unloaded(self, settings: Float[np.ndarray, "lanes 2"]) -> Samples:
        """Natural states: `UNDEFINED` or `MISSING` where no ray can start, `LOST` elsewhere."""
        z, found = self.sheet.states(settings)
        p = self.sheet.parameters(settings)
        kind = np.where(found, LOST, MISSING)
        at = np.flatnonzero(found)
        for constraint in self.within:
            kind[at[constraint.excess(z[at], p[at]) > 0.0]] = UNDEFINED
        none = np.full(len(settings), np.nan)
        return Samples(settings, none, kind, np.zeros(len(settings)), z, p)


def _places(
    within: tuple[Constraint, ...],
    z: Float[np.ndarray, "lanes size"],
    p: Float[np.ndarray, "lanes parameters"],
) -> Float[np.ndarray, " lanes"]:
    """Number of the constraint that was met, plus where on the structure its extremum lies."""
    excess = np.array([c.excess(z, p) / max(1.0, abs(c.bound)) for c in within])
    which = excess.argmax(axis=0)
    place: Float[np.ndarray, " lanes"] = 2.0 * which
    for k, constraint in enumerate(within):
        at = np.flatnonzero(which == k)
        if constraint.descriptor.place is not None and len(at):
            place[at] += constraint.descriptor.place(z[at], p[at])
    return place
