"""Limit loads at settings, many at a time: rays in the load from natural states."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool

from equimorph.arrays import Edges, Flags, Lanes, Parameters, Settings, Values
from equimorph.equilibria import ParameterLine, TraceOptions, follow
from equimorph.equilibria.conditions import bound, branching, gap, grazing, quadratic
from equimorph.equilibria.critical import Critical, null_border
from equimorph.equilibria.natural_sheet import NaturalSheet
from equimorph.equilibria.tracing import ARRIVAL, BRANCH, CONSTRAINT, FOLD
from equimorph.model import Constraint
from equimorph.tasks.maps.brackets import Brackets
from equimorph.tasks.maps.causes import Cause
from equimorph.tasks.maps.extrema import at_two_places
from equimorph.tasks.maps.samples import Samples
from equimorph.tasks.maps.unloaded import LOST, START_KINDS, unloaded

KINDS = (*START_KINDS, "fold", "branch point", "constraint", "none below the bound")
"""What ended the path at a setting, in the order of their numbers."""
END_FOLD, END_BRANCH, END_CONSTRAINT, END_NONE = range(len(START_KINDS), len(KINDS))
_OF_CODE = {FOLD: END_FOLD, BRANCH: END_BRANCH, CONSTRAINT: END_CONSTRAINT, ARRIVAL: END_NONE}


JUMP = 5e-3
"""Difference of limit loads on both sides of a curve that counts as a jump."""
ALIKE = 0.1
"""Cosine of null vectors whose signs can be compared: beside a pitchfork they turn fast."""


@dataclass(frozen=True)
class Rays:
    """Limit loads at settings: rays in the load from natural states."""

    sheet: NaturalSheet
    load: int
    within: tuple[Constraint, ...]
    bound: float
    options: TraceOptions

    def __call__(self, settings: Settings) -> Samples:
        """Limit loads at settings, with their states."""
        start = unloaded(self.sheet, self.within, settings)
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
        z[kind <= LOST] = np.nan
        return Samples(settings, value, kind, place, z, p, start.passed)

    def causes(self, pairs: Brackets) -> list[Cause]:
        """Merging folds, branch points, and bounds that take over or are touched."""
        structure, sides = self.sheet.structure, ((pairs.a, pairs.b), (pairs.b, pairs.a))
        load = structure.parameters[self.load].name
        limits = [bound(constraint) for constraint in self.within]
        found = []
        for one, other in sides:
            for k, limit in enumerate(limits):
                met = _meets(other, k)
                found.append(Cause.of("exchange", (gap, limit), _is_critical(one) & met, one))
                for j in range(k):
                    both = _meets(one, j) & met
                    found.append(Cause.of("exchange", (limits[j], limit), both, one))
        # at a pitchfork both of the following hold: the first one counts
        for kind, test in (("branch point", branching(structure, load)), ("cusp", quadratic)):
            found += [Cause.of(kind, (gap, test), _is_critical(one), one) for one, _ in sides]
        for k, constraint in enumerate(self.within):
            moved = _meets(pairs.a, k) & _meets(pairs.b, k)
            found += at_two_places(constraint.descriptor, pairs, moved, limits[k])
            touching = (limits[k], grazing(structure, constraint, load))
            found += [Cause.of("grazing", touching, _meets(one, k), one) for one, _ in sides]
        return found

    def suspects(self, vertices: Samples, edges: Edges) -> Bool[np.ndarray, " edges"]:
        """Edges between folds with vᵀF_q of different sign: paths branch somewhere between.

        The null vectors v of both ends must resemble each other, so that their signs can be
        compared.
        """
        structure = self.sheet.structure
        folds = np.flatnonzero(vertices.kind == END_FOLD)
        z, p = vertices.z[folds], vertices.p[folds]
        at = Critical(structure, z, p, null_border(structure, z, p))
        n = structure.unknowns
        v = np.zeros((len(vertices.kind), n))
        v[folds] = at.v[:, :n] / np.sqrt(at.v[:, :n] ** 2 @ structure.mass)[:, None]
        slope = np.zeros(len(v))
        slope[folds] = branching(structure, structure.parameters[self.load].name)(at)
        a, b = edges.T
        alike = np.einsum("li,li,i->l", v[a], v[b], structure.mass)
        return np.asarray((np.abs(alike) > ALIKE) & (alike * slope[a] * slope[b] < 0.0))

    def known(self, side: Samples) -> Flags:
        """Whether there is a limit load."""
        return np.asarray(np.isfinite(side.value))

    def unexplained(self, pairs: Brackets) -> np.ndarray:
        """Jumps, kinks, and other places of the extremum that meets a constraint."""
        a, b = pairs.a, pairs.b
        known = self.known(a) & self.known(b)
        moved = (a.kind == END_CONSTRAINT) & (b.kind == END_CONSTRAINT)
        kind = np.where(np.abs(a.value - b.value) > JUMP, "jump", np.where(moved, "place", "kink"))
        return np.where(known, kind, "").astype(object)


def _is_critical(side: Samples) -> Bool[np.ndarray, " pairs"]:
    """Whether paths end where stability is lost."""
    return np.asarray(np.isin(side.kind, (END_FOLD, END_BRANCH)))


def _meets(side: Samples, k: int) -> Bool[np.ndarray, " pairs"]:
    """Whether paths end at constraint number `k`."""
    return np.asarray((side.kind == END_CONSTRAINT) & (side.place // 2 == k))


def _places(
    within: tuple[Constraint, ...],
    z: Lanes,
    p: Parameters,
) -> Values:
    """Number of the constraint that was met, plus where on the structure its extremum lies."""
    excess = np.array([c.excess(z, p) / max(1.0, abs(c.bound)) for c in within])
    which = excess.argmax(axis=0)
    place: Values = 2.0 * which
    for k, constraint in enumerate(within):
        at = np.flatnonzero(which == k)
        if constraint.descriptor.place is not None and len(at):
            place[at] += constraint.descriptor.place(z[at], p[at])
    return place
