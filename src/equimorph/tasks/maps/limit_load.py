"""Limit-load maps: the largest load before the first critical point, over a grid of settings."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from enum import IntEnum
from typing import ClassVar

import numpy as np

from equimorph.argument_checks import check_arguments
from equimorph.arrays import Bool, Edges, Flags, Lanes, Parameters, Settings, Values
from equimorph.equilibria import LimitLoad, ParameterLine, TraceOptions, limit_load, trace
from equimorph.equilibria.critical import Critical, null_border
from equimorph.equilibria.critical_tests import bound, branching, gap, grazing, quadratic
from equimorph.equilibria.trace_options import EventCode, EventKind
from equimorph.errors import InputError
from equimorph.model import Constraint, Grid, Progress, Workers, position
from equimorph.structures import Structure
from equimorph.structures.metric import metric_length
from equimorph.tasks.maps.actuator_map import ActuatorMap, natural_states_over, survey
from equimorph.tasks.maps.brackets import Brackets, Samples
from equimorph.tasks.maps.causes import Cause, Paths, Start, equal_extrema, labels

JUMP = 5e-3
"""Difference of limit loads on both sides of a curve that counts as a jump."""
ALIKE = 0.1
"""Cosine of null vectors whose signs can be compared: near a pitchfork they turn fast."""


class RayStatus(IntEnum):
    """What ended the path at a setting."""

    UNDEFINED_UNLOADED = Start.UNDEFINED_UNLOADED
    NO_NATURAL_STATE = Start.NO_NATURAL_STATE
    LOST = Start.LOST
    FOLD = 3
    BRANCH_POINT = 4
    CONSTRAINT = 5
    NONE_BELOW_THE_BOUND = 6
    LATERAL_BRANCH_POINT = 7


MET = (RayStatus.CONSTRAINT, RayStatus.LATERAL_BRANCH_POINT)
"""Statuses of paths that violate a constraint."""


STATUS_OF_EVENT = {
    EventCode.FOLD: RayStatus.FOLD,
    EventCode.BRANCH_POINT: RayStatus.BRANCH_POINT,
    EventCode.CONSTRAINT: RayStatus.CONSTRAINT,
    EventCode.ARRIVED: RayStatus.NONE_BELOW_THE_BOUND,
}


@dataclass(frozen=True, eq=False, repr=False)
class LimitLoadMap(ActuatorMap):
    """Limit loads over a grid of settings, and the curves on which they jump or bend.

    Kinds of curves: "cusp": two folds of the path merge, and the limit load jumps; "branch point":
    the path meets one; "grazing": the path touches a constraint, and the limit load jumps;
    "exchange": loss of stability and a constraint, or two constraints, exchange their roles;
    "place": two extrema on the structure meet a constraint together; "edge": beyond it no unloaded
    state obeys the constraints; "jump" and "kink": none of these was found to be the reason. All
    but these two are exact: see `MapCurve.errors`.
    """

    kinds: ClassVar[tuple[str, ...]] = labels(RayStatus)

    @property
    def unit(self) -> str:
        """Unit of the load."""
        return self.structure.parameters[position(self.structure.parameters, self.load)].unit

    @check_arguments
    def at(self, **setting: float) -> LimitLoad:
        """Limit load at one setting of the box, with its path.

        Raises
        ------
        InputError
            If names are not those of the grid, or the setting lies outside or has no natural state.
        """
        return limit_load(self.rest(setting), self.load, within=self.within, bound=self.bound)

    @check_arguments
    def rays(self, settings: Settings) -> Values:
        """Limit loads at many settings; NaN where no limit load exists."""
        place = position(self.structure.parameters, self.load)
        options = TraceOptions(record=False)
        return LimitLoadRays(self.sheet, place, self.within, self.bound, options)(settings).value


@check_arguments
def limit_load_map(  # noqa: PLR0913  # the knobs of the public face, most by keyword
    structure: Structure,
    grid: Grid,
    load: str,
    *,
    within: Sequence[Constraint] = (),
    fixed: Mapping[str, float] | None = None,
    bound: float = 100.0,
    options: TraceOptions | None = None,
    progress: Progress | None = None,
    workers: Workers | None = None,
) -> LimitLoadMap:
    """Limit loads over a grid of settings, with the curves on which they jump or bend.

    From the natural state at every setting a ray in `load` is followed to the first loss of
    stability or constraint. On grid edges whose ends differ in status, or more than those of their
    neighbours, the cause is searched for: a state at which two tests vanish, found by Newton's
    method and confirmed by limit loads on both sides. Edges without a cause are divided repeatedly.
    Places of one kind are connected to curves across the cells.

    Parameters
    ----------
    structure
        The structure; it must have natural states.
    grid
        Two parameters with their ranges and intervals.
    load
        Name of the parameter that grows from its unloaded value.
    within
        Constraints that end the paths, like ``[arch.max_curvature <= 10]``.
    fixed
        Values of other parameters; those not named keep their defaults.
    bound
        Largest load tried.
    options
        Step control.
    progress
        Receives reports on the progress.
    workers
        Who follows the paths from the vertices of the grid; see `Workers`.

    Returns
    -------
    The map.

    Raises
    ------
    InputError
        If the grid does not have two parameters, the load is one of them, a name is unknown, or the
        unloaded structure exceeds the bound.

    References
    ----------
    [Feher2025]_, section 3.2.1.
    """
    sheet = natural_states_over(structure, grid, load, fixed)
    place = position(structure.parameters, load)
    lowest, bound = sheet.base[place], structure.parameters[place].check(bound)
    if not bound > lowest:
        raise InputError(f"`bound` must exceed {load} = {lowest:g}; got {bound!r}.")
    options = replace(options or TraceOptions(), record=False)
    rays = LimitLoadRays(sheet, place, tuple(within), bound, options)
    # close to a cusp the two folds are close together: shorter steps separate them
    careful = replace(rays, options=options.finer())
    found = survey(rays, grid, "limit loads", progress, workers, near_curves=careful)
    return LimitLoadMap(
        structure, grid, load, rays.within, dict(fixed or {}),
        found.value, found.status, found.states, found.curves, sheet, rays.bound,
    )  # fmt: skip


@dataclass(frozen=True)
class LimitLoadRays(Paths):
    """Limit loads at settings: rays in the load from natural states."""

    def follow(self, start: Samples) -> Samples:
        """Limit loads with their states."""
        z, p, kind = start.z, start.p, start.kind
        value, place = start.value, start.place
        ready = np.flatnonzero(kind == RayStatus.LOST)
        velocity = np.zeros((len(ready), p.shape[1]))
        velocity[:, self.load] = self.bound - p[ready, self.load]
        if len(ready):
            line = ParameterLine(self.sheet.structure, p[ready].copy(), velocity)
            ended = trace(line, z[ready].copy(), self.within, self.options)
            kind[ready] = [
                STATUS_OF_EVENT.get(code, RayStatus.LOST) for code in ended.code.tolist()
            ]
            z[ready], p[ready] = ended.z, line.parameters(ended.t)
            value[ready] = np.where(kind[ready] == RayStatus.LOST, np.nan, p[ready, self.load])
            met = ready[kind[ready] == RayStatus.CONSTRAINT]
            if len(met):
                place[met] = _extrema_met(self.within, z[met], p[met])
                events = np.array([each.event for each in self.within])[place[met].astype(int) // 2]
                lateral = events == EventKind.LATERAL_BRANCH_POINT
                kind[met[lateral]] = RayStatus.LATERAL_BRANCH_POINT
        z[kind <= RayStatus.LOST] = np.nan
        return Samples(start.setting, value, kind, place, z, p, start.passed)

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
            found += equal_extrema(constraint.descriptor, pairs, moved, limits[k])
            touching = (limits[k], grazing(structure, constraint, load))
            found += [Cause.of("grazing", touching, _meets(one, k), one) for one, _ in sides]
        return found

    def suspects(self, vertices: Samples, edges: Edges) -> Bool[np.ndarray, " edges"]:
        """Edges between folds with vᵀF_q of different sign: paths branch somewhere between.

        The null vectors v of both ends must resemble each other, so that their signs can be
        compared.
        """
        structure = self.sheet.structure
        folds = np.flatnonzero(vertices.kind == RayStatus.FOLD)
        z, p = vertices.z[folds], vertices.p[folds]
        at = Critical(structure, z, p, null_border(structure, z, p))
        n = structure.unknowns
        v = np.zeros((len(vertices.kind), n))
        v[folds] = at.v[:, :n] / metric_length(structure, at.v)[:, None]
        slope = np.zeros(len(v))
        slope[folds] = branching(structure, structure.parameters[self.load].name)(at)
        a, b = edges.T
        alike = np.einsum("li,li,i->l", v[a], v[b], structure.mass)
        return np.asarray((np.abs(alike) > ALIKE) & (alike * slope[a] * slope[b] < 0.0))

    def is_known(self, side: Samples) -> Flags:
        """Whether there is a limit load."""
        return np.asarray(np.isfinite(side.value))

    def unexplained_kinds(self, pairs: Brackets) -> np.ndarray:
        """Jumps, kinks, and other places of the extremum that meets a constraint."""
        a, b = pairs.a, pairs.b
        known = self.is_known(a) & self.is_known(b)
        moved = np.isin(a.kind, MET) & np.isin(b.kind, MET)
        kind = np.where(np.abs(a.value - b.value) > JUMP, "jump", np.where(moved, "place", "kink"))
        return np.where(known, kind, "").astype(object)


def _is_critical(side: Samples) -> Bool[np.ndarray, " pairs"]:
    """Whether paths end where stability is lost."""
    return np.asarray(np.isin(side.kind, (RayStatus.FOLD, RayStatus.BRANCH_POINT)))


def _meets(side: Samples, k: int) -> Bool[np.ndarray, " pairs"]:
    """Whether paths end at constraint number `k`."""
    return np.asarray(np.isin(side.kind, MET) & (side.place // 2 == k))


def _extrema_met(
    within: tuple[Constraint, ...],
    z: Lanes,
    p: Parameters,
) -> Values:
    """Number of the constraint that was met, plus where on the structure its extremum lies."""
    excess = np.array([c.excess(z, p) / c.size for c in within])
    which = excess.argmax(axis=0)
    place: Values = 2.0 * which
    for k, constraint in enumerate(within):
        at = np.flatnonzero(which == k)
        if constraint.descriptor.place is not None and len(at):
            place[at] += constraint.descriptor.place(z[at], p[at])
    return place
