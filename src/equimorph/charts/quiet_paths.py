"""Paths in a load from natural states that meet no critical state, and where they change."""

from dataclasses import dataclass
from functools import partial

import numpy as np

from equimorph.array_types import Float
from equimorph.arrays import Flags, Lanes, Parameters, Some
from equimorph.columns import Columns
from equimorph.equilibria import ParameterLine, TraceOptions
from equimorph.equilibria.critical import Test
from equimorph.equilibria.critical_tests import bound, branching, gap, grazing, quadratic
from equimorph.equilibria.natural_sheet import NaturalSheet, natural_sheet
from equimorph.equilibria.singular_states import correct_singular_states
from equimorph.equilibria.trace import Traces, trace
from equimorph.equilibria.trace_options import EventCode
from equimorph.errors import InputError
from equimorph.manifold import EquilibriumSet
from equimorph.model import Box, Constraint, Grid, are_feasible, parameter_vector, position
from equimorph.structures import Structure

INTERVALS = 24
"""Intervals of the grid over which natural states are known."""
ROUND_OFF = 1e-14
"""Load in its scale that counts as none: no path is followed over round-off."""
AT_END = 1e-7
"""Part of a path that may be left where an event lies at its end."""


@dataclass(frozen=True, eq=False)
class Unloaded:
    """Natural states over the other free parameters of a set.

    Parameters
    ----------
    structure
        The structure.
    load, low
        Place of the load, and its value in natural states.
    sheet
        Natural states over a grid, if there are two other parameters; else the structure computes
        each of them.
    constraints
        What natural states must obey.
    """

    structure: Structure
    load: int
    low: float
    sheet: NaturalSheet | None
    constraints: tuple[Constraint, ...]

    @classmethod
    def of(cls, eset: EquilibriumSet, parameter: str) -> "Unloaded":
        """Natural states of a set.

        Raises
        ------
        InputError
            If the parameter does not vanish in natural states.
        """
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
            z, good = self.structure.natural(self.parameters(p))
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
    del lanes
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
