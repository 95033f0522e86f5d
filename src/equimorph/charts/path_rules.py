"""Rules that prefer the state to which a path in a load leads, and rules from their identity.

Paths are followed from natural states; those that meet no critical state need no tracing.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np

from equimorph.argument_checks import check_arguments
from equimorph.arrays import Bool, Flags, Float, Lanes, Parameters, Points, Some
from equimorph.charts.location import Found
from equimorph.charts.preference import shares_of_ends
from equimorph.charts.rules import Choice, Identity, Rule, first_of_each, highest, lowest, nearest
from equimorph.columns import Columns
from equimorph.equilibria import ParameterLine, TraceOptions
from equimorph.equilibria.critical import Test
from equimorph.equilibria.critical_tests import (
    bound,
    branching,
    correct_singular_states,
    gap,
    grazing,
    quadratic,
)
from equimorph.equilibria.first_stable import BOUND, OFF, STABLE, FirstStable
from equimorph.equilibria.natural_sheet import NaturalSheet, natural_sheet, stable_natural
from equimorph.equilibria.trace import Traces, trace
from equimorph.equilibria.trace_options import EventCode
from equimorph.errors import InputError
from equimorph.manifold import EquilibriumSet
from equimorph.manifold.complex.kept_tables import from_cache
from equimorph.model import (
    Box,
    Constraint,
    Grid,
    are_feasible,
    parameter_vector,
    position,
    remember_call,
)
from equimorph.structures import Structure
from equimorph.structures.metric import metric_length

INTERVALS = 24
"""Intervals of the grid over which natural states are known."""
ROUND_OFF = 1e-14
"""Load in its scale that counts as none: no path is followed over round-off."""
AT_END = 1e-7
"""Part of a path that may be left where an event lies at its end."""


@dataclass(frozen=True, eq=False)
class Unloaded:
    """Natural states over the other free parameters of a set."""

    structure: Structure
    """The structure."""
    load: int
    low: float
    """Place of the load, and its value in natural states."""
    sheet: NaturalSheet | None
    """Natural states over a grid, if there are two other parameters; else the structure computes
    each of them."""
    constraints: tuple[Constraint, ...]
    """What natural states must obey."""

    @classmethod
    def of(cls, eset: EquilibriumSet, parameter: str) -> "Unloaded":
        """Natural states of a set; refused if the parameter does not vanish in natural states."""
        return from_cache(eset, ("unloaded", parameter), lambda: cls._of(eset, parameter))

    @classmethod
    def _of(cls, eset: EquilibriumSet, parameter: str) -> "Unloaded":
        structure = eset.structure
        load, unloaded = position(structure.parameters, parameter), structure.unloaded()
        if parameter not in unloaded:
            raise InputError(
                f"`parameter` must be a load ({', '.join(unloaded) or 'the structure has none'}); "
                f"got {parameter!r}."
            )
        low = float(unloaded[parameter])
        others = [name for name in eset.names if name != parameter]
        sheet = None
        if len(others) == 2:
            ends = {
                name: (float(a), float(b))
                for name, a, b in zip(eset.names, eset.box.lower, eset.box.upper, strict=True)
                if name in others
            }
            fixed = {name: value for name, value in eset.fixed.items() if name != parameter}
            corner = Box(**ends).lower
            given = {**fixed, **unloaded, **dict(zip(ends, corner.tolist(), strict=True))}
            base = parameter_vector(structure.parameters, given)
            grid = Grid(**{name: (*pair, INTERVALS) for name, pair in ends.items()})
            sheet = natural_sheet(structure, grid, base)
        return cls(structure, load, low, sheet, eset.constraints)

    def parameters(self, p: Parameters) -> Parameters:
        """The same parameters, unloaded."""
        out = p.copy()
        out[:, self.load] = self.low
        return out

    def below(self, p: Parameters) -> Flags:
        """Which points are loaded by more than round-off."""
        away = np.abs(p[:, self.load] - self.low) / self.structure.scales[self.load]
        return np.asarray(away > ROUND_OFF)

    def states(self, p: Parameters) -> tuple[Lanes, Flags]:
        """Natural states below points, and which of them exist and obey the constraints."""
        z, found = self.natural(p)
        found[found] = are_feasible(self.constraints, z[found], self.parameters(p[found]))
        return z, found

    def natural(self, p: Parameters) -> tuple[Lanes, Flags]:
        """Natural states below points, and where there are any."""
        if self.sheet is None:
            z, good = stable_natural(self.structure, self.parameters(p))
            return z, good & self.structure.may_be_natural(p)
        return self.sheet.states(p[:, self.sheet.places])


@dataclass(frozen=True)
class _Cause(Columns):
    """Tests that vanish where other paths end differently, and states close by for some lanes."""

    tests: tuple[Test, ...]
    lane: Some
    z: Lanes
    p: Parameters


def _same(tests: tuple[Test, ...], lanes: Some) -> tuple[Test, ...]:
    """The same tests of all lanes."""
    return tests


@dataclass(frozen=True, eq=False)
class QuietPaths:
    """Paths from natural states to points, each of which ends at its first event."""

    eset: EquilibriumSet
    start: Unloaded

    def __call__(self, z: Lanes, begin: Parameters, goal: Parameters) -> Lanes:
        """States at the ends of paths without events; not numbers for others."""
        ended = self._follow(z, begin, goal)
        there = (ended.code == EventCode.ARRIVED) | (ended.t > 1.0 - AT_END)
        return np.where(there[:, None], ended.z, np.nan)

    def _follow(self, z: Lanes, begin: Parameters, goal: Parameters) -> Traces:
        line = ParameterLine(self.eset.structure, begin, goal - begin)
        return trace(line, z.copy(), self.eset.constraints, TraceOptions(record=False))

    def changes(self, p: Parameters, toward: Parameters) -> Float[np.ndarray, "items k"]:
        """Where the event that ends paths vanishes; see `Changes`.

        There two folds merge, the path branches, it touches a constraint, or its start meets one.
        """
        structure, load = self.eset.structure, self.start.load
        directions = np.zeros((len(p), 2, p.shape[1]))
        across = directions[:, 0]
        across += toward / structure.scales
        across[:, load] = 0.0
        length = np.linalg.norm(across, axis=1)
        across /= np.maximum(length, 1e-300)[:, None]
        directions[:, 1, load] = 1.0
        causes = self._causes(p)
        share = np.full((len(p), len(causes)), np.nan)
        for k, every in enumerate(causes):
            cause = every.take(length[every.lane] > 0.0)
            lanes, tests = cause.lane, partial(_same, cause.tests)
            free = directions[lanes, : len(cause.tests)] * structure.scales
            at = correct_singular_states(structure, cause.z, cause.p, free, tests)
            moved = ((at.p - p[lanes]) / structure.scales * across[lanes]).sum(axis=1)
            share[lanes, k] = np.where(at.found, moved / length[lanes], np.nan)
        return share

    def _causes(self, p: Parameters) -> list[_Cause]:
        """What may end the paths to points, the most likely first."""
        structure, load = self.eset.structure, self.start.load
        limits = [bound(constraint) for constraint in self.eset.constraints]
        z, found = self.start.natural(p)
        begin, lanes = self.start.parameters(p), np.flatnonzero(found)
        obeys = are_feasible(self.eset.constraints, z[lanes], begin[lanes])
        lanes, beyond = lanes[obeys], lanes[~obeys]
        causes = [_Cause((limit,), beyond, z[beyond], begin[beyond]) for limit in limits]
        lanes = lanes[self.start.below(p[lanes])]
        ended = self._follow(z[lanes], begin[lanes], p[lanes])
        at = begin[lanes]
        at[:, load] += ended.t * (p[lanes, load] - at[:, load])
        critical = np.isin(ended.code, (EventCode.FOLD, EventCode.BRANCH_POINT))
        name, met = structure.parameters[load].name, ended.code == EventCode.CONSTRAINT
        pairs: list[tuple[Flags, tuple[Test, ...]]]
        pairs = [(critical, (gap, test)) for test in (branching(structure, name), quadratic)]
        for constraint, limit in zip(self.eset.constraints, limits, strict=True):
            pairs.append((met, (limit, grazing(structure, constraint, name))))
        causes += [_Cause(own, lanes[some], ended.z[some], at[some]) for some, own in pairs]
        return [cause for cause in causes if len(cause.lane)]


MATCH = 1e-4
"""Distance in the metric below which a state is the end of a path."""
LARGEST = 100.0
"""Largest load up to which paths are followed, unless said."""
Ends = Callable[[Lanes, Parameters, Parameters], Lanes]
"""States at the ends of paths from unloaded states, their parameters, and those of the ends."""


@remember_call
@check_arguments
def quasi_static(parameter: str) -> Rule:
    """Prefer the state that loading from the natural state reaches without any critical point.

    Beyond the first fold, branch point or constraint there is a gap: the rule of limit-load maps.

    Parameters
    ----------
    parameter
        The load: a free or a fixed parameter of the set.
    """
    return _OnPath(
        "quasi_static", parameter, QuietPaths, {"rule": "quasi_static", "parameter": parameter}
    )


@remember_call
@check_arguments
def first_stable_on_path(parameter: str, bound: float = LARGEST) -> Rule:
    """Prefer the first stable state on the path from the natural state, through unstable parts too.

    The rule of curvature maps. A real structure may have snapped on the way.

    Parameters
    ----------
    parameter
        The load: a free or a fixed parameter of the set.
    bound
        Largest load, of either sign, up to which paths are followed.
    """
    return _OnPath(
        "first_stable_on_path",
        parameter,
        lambda eset, start: _first(eset, start, bound),
        {"rule": "first_stable_on_path", "parameter": parameter, "bound": bound},
    )


def rule_from(identity: Mapping[str, Any], structure: Structure) -> Rule:
    """Return a rule by its identity, with the descriptors of a structure.

    Parameters
    ----------
    identity
        Plain data as of `Rule.identity`.
    structure
        Structure that has the descriptors.

    Raises
    ------
    InputError
        For an unknown rule, or a descriptor that the structure does not have.
    """
    known: dict[str, Callable[[], Rule]] = {
        "lowest": lambda: lowest(structure.descriptor(identity["of"])),
        "highest": lambda: highest(structure.descriptor(identity["of"])),
        "nearest": lambda: nearest(int(identity["of"])),
        "quasi_static": lambda: quasi_static(identity["parameter"]),
        "first_stable_on_path": lambda: first_stable_on_path(
            identity["parameter"], float(identity.get("bound", LARGEST))
        ),
    }
    if identity["rule"] not in known:
        raise InputError(f"`rule` must be one of {', '.join(known)}; got {identity['rule']!r}.")
    return known[identity["rule"]]()


@dataclass(frozen=True, repr=False)
class _OnPath(Rule):
    """The state at the end of a path from the natural state."""

    name: str
    parameter: str
    ends: Callable[[EquilibriumSet, Unloaded], Ends] = field(repr=False)
    identity: Identity | None = None

    def __repr__(self) -> str:
        """Return the rule as it is written."""
        return f"{self.name}({self.parameter})"

    def on(self, eset: EquilibriumSet) -> Choice:
        """Prefer the ends of paths."""
        start = Unloaded.of(eset, self.parameter)
        ends = self.ends(eset, start)
        setting = eset.setting

        def over(points: Points) -> Lanes:
            p = np.tile(setting.base, (len(points), 1))
            p[:, setting.free] = points
            z, good = start.states(p)
            begin, moving = start.parameters(p), good & start.below(p)
            z[moving] = ends(z[moving], begin[moving], p[moving])
            z[~good] = np.nan
            return z

        def choose(found: Found, points: Points) -> Bool[np.ndarray, " found"]:
            asked, back = np.unique(points[found.point], axis=0, return_inverse=True)
            distance = metric_length(eset.structure, found.states.z - over(asked)[back])
            near = distance < MATCH  # not a number where the path ends elsewhere
            score = np.where(near, distance, np.inf)
            return first_of_each(found, score, eset.structure.elevation)

        quiet = QuietPaths(eset, start)

        def changes(p: Parameters, toward: Parameters) -> Float[np.ndarray, "items k"]:
            """Where quiet paths change, and where the states at the ends of other paths end."""
            shares = quiet.changes(p, toward)
            if isinstance(ends, QuietPaths):
                return shares
            z, ended = over(p[:, setting.free]), np.full(len(p), np.nan)
            some = np.flatnonzero(np.isfinite(z[:, 0]))
            line = ParameterLine(eset.structure, p[some], toward[some])
            ended[some] = shares_of_ends(line, z[some], eset.constraints)[0]
            return np.column_stack([ended, shares])

        return Choice(choose, changes=changes)


def _first(eset: EquilibriumSet, start: Unloaded, bound: float) -> Ends:
    """First stable states on paths."""
    # only ends count: what steps hide changes none
    options = TraceOptions(
        through_folds=True,
        through_branch_points=True,
        record=False,
        locate_folds=False,
        look_inside=False,
    )
    paths = FirstStable(eset.structure, start.load, start.low, bound, eset.constraints, options)

    def ends(z: Lanes, begin: Parameters, goal: Parameters) -> Lanes:
        at = goal[:, start.load]
        found, p, way = paths(z, begin, at)
        # states on a bound: round-off decides whether their paths arrive or just fail to
        missed = np.abs(p[:, start.load] - at) / np.abs(at - begin[:, start.load])
        there = ((way >= STABLE) & (way <= OFF)) | ((way == BOUND) & (missed < AT_END))
        return np.where(there[:, None], found, np.nan)

    return ends
