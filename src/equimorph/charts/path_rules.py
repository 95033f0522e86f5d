"""Rules that prefer the state to which a path in a load leads, and rules from their identity."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from equimorph.argument_checks import check_arguments
from equimorph.array_types import Bool, Float
from equimorph.arrays import Lanes, Parameters, Points
from equimorph.charts.location import Found
from equimorph.charts.quiet_paths import AT_END, QuietPaths, Unloaded
from equimorph.charts.rules import (
    Choice,
    Identity,
    Rule,
    first_of_each,
    highest,
    lowest,
    nearest,
)
from equimorph.charts.score_changes import shares_of_ends
from equimorph.equilibria import ParameterLine, TraceOptions
from equimorph.equilibria.first_stable import BOUND, OFF, STABLE, FirstStable
from equimorph.errors import InputError
from equimorph.manifold import EquilibriumSet
from equimorph.model import remember_call
from equimorph.structures import Structure

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
        setting, n = eset.setting, eset.structure.unknowns

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
            gap = (found.states.z - over(asked)[back])[:, :n]
            distance = np.sqrt(gap**2 @ eset.structure.mass)
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
    options = TraceOptions(record=False, through_folds=True, through_branch_points=True)
    paths = FirstStable(eset.structure, start.load, start.low, bound, eset.constraints, options)

    def ends(z: Lanes, begin: Parameters, goal: Parameters) -> Lanes:
        at = goal[:, start.load]
        found, p, way = paths(z, begin, at)
        # states on a bound: round-off decides whether their paths arrive or just fail to
        missed = np.abs(p[:, start.load] - at) / np.abs(at - begin[:, start.load])
        there = ((way >= STABLE) & (way <= OFF)) | ((way == BOUND) & (missed < AT_END))
        return np.where(there[:, None], found, np.nan)

    return ends
