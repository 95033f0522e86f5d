"""Rules that prefer the state to which a path in a load leads, and rules from their identity."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from equimorph.argument_checks import check_arguments
from equimorph.array_types import Bool
from equimorph.arrays import Flags, Lanes, Parameters, Points
from equimorph.charts.location import Found
from equimorph.charts.rules import Chooser, Identity, Rule, first_of_each, highest, lowest, nearest
from equimorph.equilibria import ParameterLine, TraceOptions
from equimorph.equilibria.first_stable import OFF, STABLE, FirstStable
from equimorph.equilibria.natural_sheet import NaturalSheet, natural_sheet
from equimorph.equilibria.trace import trace
from equimorph.equilibria.trace_options import EventCode
from equimorph.errors import InputError
from equimorph.manifold import EquilibriumSet
from equimorph.model import Box, Grid, parameter_vector, position, remember_call
from equimorph.structures import Structure

MATCH = 1e-4
"""Distance in the metric below which a state is the end of a path."""
INTERVALS = 24
"""Intervals of the grid over which natural states are known."""
BOUND = 100.0
"""Largest load up to which paths are followed, unless said."""
ROUND_OFF = 1e-14
"""Load in its scale that counts as none: no path is followed over round-off."""
AT_END = 1e-7
"""Part of a path that may be left where an event lies at its end."""
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
        "quasi_static", parameter, _quiet_ends, {"rule": "quasi_static", "parameter": parameter}
    )


@remember_call
@check_arguments
def first_stable_on_path(parameter: str, bound: float = BOUND) -> Rule:
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
        lambda eset, load, low: _first(eset, load, low, bound),
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
            identity["parameter"], float(identity.get("bound", BOUND))
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
    ends: Callable[[EquilibriumSet, int, float], Ends] = field(repr=False)
    identity: Identity | None = None

    def __repr__(self) -> str:
        """Return the rule as it is written."""
        return f"{self.name}({self.parameter})"

    def on(self, eset: EquilibriumSet) -> Chooser:
        """Prefer the ends of paths."""
        start = Unloaded.of(eset, self.parameter)
        ends = self.ends(eset, start.load, start.low)
        setting, n = eset.setting, eset.structure.unknowns

        def over(points: Points) -> Lanes:
            p = np.tile(setting.base, (len(points), 1))
            p[:, setting.free] = points
            z, good = start.states(p)
            begin = start.parameters(p)
            away = np.abs(p[:, start.load] - start.low) / eset.structure.scales[start.load]
            moving = good & (away > ROUND_OFF)
            z[moving] = ends(z[moving], begin[moving], p[moving])
            z[~good] = np.nan
            return z

        def choose(found: Found, points: Points) -> Bool[np.ndarray, " found"]:
            asked, back = np.unique(found.point, return_inverse=True)
            gap = (found.states.z - over(points[asked])[back])[:, :n]
            distance = np.sqrt(gap**2 @ eset.structure.mass)
            near = distance < MATCH  # not a number where the path ends elsewhere
            score = np.where(near, distance, np.inf)
            return first_of_each(found, score, eset.structure.elevation)

        return choose


def _quiet_ends(eset: EquilibriumSet, load: int, low: float) -> Ends:
    """Ends of paths without events."""
    del load, low

    def ends(z: Lanes, begin: Parameters, goal: Parameters) -> Lanes:
        line = ParameterLine(eset.structure, begin, goal - begin)
        ended = trace(line, z.copy(), eset.constraints, TraceOptions(record=False))
        there = (ended.code == EventCode.ARRIVED) | (ended.t > 1.0 - AT_END)
        return np.where(there[:, None], ended.z, np.nan)

    return ends


def _first(eset: EquilibriumSet, load: int, low: float, bound: float) -> Ends:
    """First stable states on paths."""
    options = TraceOptions(record=False, through_folds=True, through_branch_points=True)
    paths = FirstStable(eset.structure, load, low, bound, eset.constraints, options)

    def ends(z: Lanes, begin: Parameters, goal: Parameters) -> Lanes:
        found, _, way = paths(z, begin, goal[:, load])
        return np.where(((way >= STABLE) & (way <= OFF))[:, None], found, np.nan)

    return ends


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
    """

    structure: Structure
    load: int
    low: float
    sheet: NaturalSheet | None

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
        return cls(structure, load, low, sheet)

    def parameters(self, p: Parameters) -> Parameters:
        """The same parameters, unloaded."""
        out = p.copy()
        out[:, self.load] = self.low
        return out

    def states(self, p: Parameters) -> tuple[Lanes, Flags]:
        """Natural states below points, and where there are any."""
        if self.sheet is None:
            z, good = self.structure.natural(self.parameters(p))
            return z, good & self.structure.may_be_natural(p)
        return self.sheet.states(p[:, self.sheet.places])
