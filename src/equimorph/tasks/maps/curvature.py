"""Curvature-type maps: a descriptor of the first stable state at a given load on each path."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from enum import IntEnum
from typing import ClassVar

import numpy as np

from equimorph.argument_checks import check_arguments
from equimorph.arrays import Bool, Flags, Values
from equimorph.equilibria import TraceOptions
from equimorph.equilibria.critical import Critical
from equimorph.equilibria.critical_tests import bound, branching, gap, grazing, quadratic
from equimorph.equilibria.first_stable import FirstStable
from equimorph.errors import InputError
from equimorph.model import Constraint, Descriptor, Grid, Progress, Workers, position
from equimorph.structures import Structure
from equimorph.tasks.maps.actuator_map import ActuatorMap, natural_states_over, survey
from equimorph.tasks.maps.brackets import Brackets, Samples
from equimorph.tasks.maps.causes import Cause, Paths, Start, equal_extrema, labels

JUMP = 1e-2
"""Relative difference of values on both sides of a curve that counts as a jump."""


class PathStatus(IntEnum):
    """What a real loading does up to a setting's state, or why there is no state.

    From `LOST` on in the order of `equimorph.equilibria.first_stable`.
    """

    UNDEFINED_UNLOADED = Start.UNDEFINED_UNLOADED
    NO_NATURAL_STATE = Start.NO_NATURAL_STATE
    LOST = Start.LOST
    STABLE = 3
    SNAPS = 4
    BRANCHES_OFF = 5
    CONSTRAINT = 6
    NONE = 7


@dataclass(frozen=True, eq=False, repr=False)
class CurvatureMap(ActuatorMap):
    """A descriptor of the first stable state at a given load, over a grid of settings.

    Statuses: "stable": stable all along the path; "snaps": a real loading leaves the path at a fold
    or a subcritical branch point, and what it snaps to need not be the state of the map; "branches
    off": it leaves the path without a snap; "constraint": it met one; "none": the path leads to no
    stable state at this load.

    Kinds of curves: "fold": the state is a fold, and the map jumps; "jump": the path to it meets a
    branch point, and leads elsewhere; "snap": two folds of the path merge, the status changes and
    the value does not; "gap": there is a state on one side only, because the path meets a branch
    point, two folds of it merge, it touches a constraint, or reaches one with the load; "place":
    two extrema on the structure are equal; "edge": beyond it no unloaded state obeys the
    constraints. States of the curves are those where this happens, on the way to those of the map.
    All are exact where a cause is found: see `MapCurve.errors`.

    Attributes
    ----------
    at
        The given load.
    descriptor
        What the map shows.
    """

    kinds: ClassVar[tuple[str, ...]] = labels(PathStatus)

    at: float
    descriptor: Descriptor

    @property
    def unit(self) -> str:
        """Unit of the descriptor."""
        return self.descriptor.unit

    @property
    def snaps(self) -> Bool[np.ndarray, "rows columns"]:
        """Settings whose real loading would snap on the way."""
        return self.where("snaps")


@check_arguments
def curvature_map(  # noqa: PLR0913  # the knobs of the public face, most by keyword
    structure: Structure,
    grid: Grid,
    load: str,
    at: float,
    *,
    descriptor: Descriptor | None = None,
    within: Sequence[Constraint] = (),
    fixed: Mapping[str, float] | None = None,
    bound: float = 100.0,
    options: TraceOptions | None = None,
    progress: Progress | None = None,
    workers: Workers | None = None,
) -> CurvatureMap:
    """Largest curvature, or another descriptor, of the first stable state at a load.

    From the natural state at every setting the path in `load` is followed, through folds, branch
    points and unstable parts, until a stable state with ``load = at`` is met for the first time.

    Parameters
    ----------
    structure
        The structure; it must have natural states.
    grid
        Two parameters with their ranges and intervals.
    load
        Name of the parameter along which the paths run.
    at
        Load at which states are searched for, above its unloaded value.
    descriptor
        Descriptor of the map; by default the structure's largest curvature.
    within
        Constraints that end the paths, like ``[arch.max_curvature <= 20]``.
    fixed
        Values of other parameters; those not named keep their defaults.
    bound
        Largest load, of either sign, up to which paths are followed.
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
        If the grid does not have two parameters, the load is one of them, a name is unknown, or
        loads are out of order.

    References
    ----------
    [Feher2025]_, section 3.2.2.
    """
    sheet = natural_states_over(structure, grid, load, fixed)
    place = position(structure.parameters, load)
    lowest, bound = sheet.base[place], structure.parameters[place].check(bound)
    if not lowest < at < bound:
        raise InputError(
            f"`at` must lie between {load} = {lowest:g} and `bound` = {bound:g}; got {at!r}."
        )
    shown = structure.descriptor("max_curvature") if descriptor is None else descriptor
    options = replace(
        options or TraceOptions(), record=False, through_folds=True, through_branch_points=True
    )
    paths = FirstStablePaths(sheet, place, tuple(within), bound, options, float(at), shown)
    found = survey(paths, grid, "paths", progress, workers)
    return CurvatureMap(
        structure, grid, load, paths.within, dict(fixed or {}),
        found.value, found.status, found.states, found.curves, sheet, paths.bound, paths.at, shown,
    )  # fmt: skip


@dataclass(frozen=True)
class FirstStablePaths(Paths):
    """The first stable state with load `at` on the path that starts at each natural state."""

    at: float
    """The given load."""
    descriptor: Descriptor
    """What the map shows."""

    def follow(self, start: Samples) -> Samples:
        """Values with their states and what happens on the way."""
        z, p, kind = start.z, start.p, start.kind
        value, place = start.value, start.place
        ready = np.flatnonzero(kind == PathStatus.LOST)
        passed = start.passed[ready]
        walked = FirstStable(
            self.sheet.structure, self.load, float(self.sheet.base[self.load]), self.bound,
            self.within, self.options,
        )(z[ready], p[ready], np.full(len(ready), self.at), passed)  # fmt: skip
        z[ready], p[ready], kind[ready] = walked[0], walked[1], PathStatus.LOST + walked[2]
        start.passed[ready] = passed
        z[kind <= PathStatus.LOST] = np.nan
        met = np.flatnonzero(kind == PathStatus.CONSTRAINT)
        if len(met):
            place[met] = np.array([c.excess(z[met], p[met]) for c in self.within]).argmax(axis=0)
        some = np.flatnonzero((kind >= PathStatus.STABLE) & (kind <= PathStatus.BRANCHES_OFF))
        value[some] = self.descriptor.function(z[some], p[some])
        if self.descriptor.place is not None and len(some):
            place[some] = self.descriptor.place(z[some], p[some])
        return Samples(start.setting, value, kind, place, z, p, start.passed)

    def causes(self, pairs: Brackets) -> list[Cause]:
        """What changes where a state at the given load, or a path that leads to it, ends.

        The state is a fold, or its extremum moves elsewhere; on the way two folds merge, the path
        branches, or it touches a bound, or reaches it with the load.
        """
        structure, sides = self.sheet.structure, (pairs.a, pairs.b)
        branches = branching(structure, structure.parameters[self.load].name)
        found = [Cause.of("fold", (gap, self._level), _is_reached(side), side) for side in sides]
        both, differs = _is_reached(pairs.a) & _is_reached(pairs.b), pairs.a.kind != pairs.b.kind
        found += equal_extrema(self.descriptor, pairs, both, self._level)
        for side, there in (*_forks(pairs, 0), *_forks(pairs, 1)):
            for kind, test, may in (("snap", quadratic, differs), ("jump", branches, both)):
                found.append(Cause.of(kind, (gap, test), there & both & may, side))
                found.append(Cause.of("gap", (gap, test), there & ~both, side))
        for k, constraint in enumerate(self.within):
            limit = bound(constraint)
            touches = grazing(structure, constraint, structure.parameters[self.load].name)
            for side in sides:
                met = differs & (side.kind == PathStatus.CONSTRAINT) & (side.place == k)
                for test in (touches, self._level):
                    found.append(Cause.of("gap", (limit, test), met, side))
        return found

    def _level(self, critical: Critical) -> Values:
        """Load less the given one, in its scale."""
        scale = self.sheet.structure.scales[self.load]
        return np.asarray((critical.p[:, self.load] - self.at) / scale)

    def is_known(self, side: Samples) -> Flags:
        """Whether paths could start and were not lost."""
        return np.asarray(side.kind > PathStatus.LOST)

    def unexplained_kinds(self, pairs: Brackets) -> np.ndarray:
        """Where states end, values jump, snapping begins, or the extremum moves elsewhere."""
        a, b = pairs.a, pairs.b
        jump = np.abs(a.value - b.value) > JUMP * np.maximum(np.abs(a.value), np.abs(b.value))
        known = self.is_known(a) & self.is_known(b) & (_is_reached(a) | _is_reached(b))
        both = _is_reached(a) & _is_reached(b)
        cases = [~known, ~both, jump, a.kind != b.kind]
        return np.select(cases, ["", "gap", "jump", "snap"], "place").astype(object)


def _forks(pairs: Brackets, back: int) -> list[tuple[Samples, Bool[np.ndarray, " pairs"]]]:
    """Critical states of each side behind which its path may be another than that of the other.

    The first fold that differs in its indices, or the given number before it. Where a side has
    none, its flag is not set.
    """
    found = []
    for one, other in ((pairs.a, pairs.b), (pairs.b, pairs.a)):
        z, p, there = one.z.copy(), one.p.copy(), np.zeros(len(pairs), bool)
        for i, (mine, others) in enumerate(zip(one.passed, other.passed, strict=True)):
            alike = [a.index == b.index for a, b in zip(mine, others, strict=False)]
            first = (alike.index(False) if False in alike else len(alike)) - back
            if 0 <= first < len(mine):
                z[i], p[i], there[i] = mine[first].z, mine[first].p, True
        found.append((replace(one, z=z, p=p), there))
    return found


def _is_reached(side: Samples) -> Flags:
    return np.asarray((side.kind >= PathStatus.STABLE) & (side.kind <= PathStatus.BRANCHES_OFF))
