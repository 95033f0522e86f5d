"""Rules that prefer one of the states over a point: by a score, or by a path that leads to it."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from jaxtyping import Bool, Float
from scipy.spatial import cKDTree

from equimorph.arrays import Flags, Lanes, Parameters, Points
from equimorph.charts.location import Found
from equimorph.equilibria import ParameterLine, TraceOptions
from equimorph.equilibria.first_stable import OFF, STABLE, FirstStable
from equimorph.equilibria.natural_sheet import NaturalSheet, natural_sheet
from equimorph.equilibria.trace import trace
from equimorph.equilibria.trace_options import EventCode
from equimorph.errors import InputError
from equimorph.manifold import EquilibriumSet
from equimorph.manifold.geometry.setting import embed
from equimorph.model import Box, Descriptor, Grid, parameter_vector, position
from equimorph.structures import State, States, Structure

Scores = Float[np.ndarray, " found"]
Chooser = Callable[[Found, Points], Bool[np.ndarray, " found"]]
"""Which of the states over points are preferred: at most one over each."""
Scoring = Callable[[Found], Scores]


EQUAL = 1e-12
"""Difference, relative to one and to their size, up to which scores are equal."""
Identity = Mapping[str, str | int | float]

Ends = Callable[[Lanes, Parameters, Parameters], Lanes]
"""States at the ends of paths from unloaded states, their parameters, and those of the ends."""

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


class Rule(ABC):
    """A way to prefer at most one of the states over each point."""

    identity: Identity | None
    """Plain data from which `rule_from` makes the rule again; None for functions and states."""

    @abstractmethod
    def on(self, eset: EquilibriumSet) -> Chooser:
        """Return the rule made ready for a set."""

    def scores(self, eset: EquilibriumSet) -> "Scoring | None":
        """Return the score whose least value is preferred, if the rule has one."""
        del eset
        return None


@dataclass(frozen=True, repr=False)
class _Least(Rule):
    """The state with the least score, as a function of states and the cells that they lie on."""

    name: str
    score: Callable[[EquilibriumSet], Callable[[Found], Scores]] = field(repr=False)
    identity: Identity | None = None

    def __repr__(self) -> str:
        """Return what is preferred."""
        return self.name

    def scores(self, eset: EquilibriumSet) -> Scoring:
        """Return the score."""
        return self.score(eset)

    def on(self, eset: EquilibriumSet) -> Chooser:
        """Prefer the least score."""
        score = self.score(eset)

        def choose(found: Found, points: Points) -> Bool[np.ndarray, " found"]:
            del points
            return first_of_each(found, score(found), eset.structure.elevation)

        return choose


def first_of_each(found: Found, score: Scores, elevation: Descriptor) -> Bool[np.ndarray, " found"]:
    """Which states have the least finite score over their points; the highest of equal ones.

    Mirror images of equal height are told apart by a product with a fixed vector: up to round-off
    they are equal, and which is preferred must not change from point to point.
    """
    states, n = found.states, found.states.structure.unknowns
    height = elevation.function(states.z, states.p)
    turn = states.z[:, :n] @ (states.structure.mass * np.cos(1.0 + np.arange(n)))
    chosen = np.isfinite(score)
    for value in (score, -height, -turn):
        least = np.full(int(found.point.max(initial=-1)) + 1, np.inf)
        np.minimum.at(least, found.point[chosen], value[chosen])
        own = least[found.point]
        chosen[chosen] = (value <= own + EQUAL * (1.0 + np.abs(own)))[chosen]
    kept = np.flatnonzero(chosen)
    order = kept[np.argsort(found.point[kept], kind="stable")]
    out = np.zeros(len(chosen), bool)
    out[order[np.diff(found.point[order], prepend=-1) > 0]] = True
    return out


def lowest(descriptor: Descriptor) -> Rule:
    """Prefer the lowest value of a descriptor, like the energy.

    Parameters
    ----------
    descriptor
        A descriptor of the set's structure.
    """
    return _Least(
        f"lowest {descriptor.name}",
        lambda _: lambda found: descriptor.function(found.states.z, found.states.p),
        {"rule": "lowest", "of": descriptor.name},
    )


def highest(descriptor: Descriptor) -> Rule:
    """Prefer the highest value of a descriptor.

    Parameters
    ----------
    descriptor
        A descriptor of the set's structure.
    """
    return _Least(
        f"highest {descriptor.name}",
        lambda _: lambda found: -descriptor.function(found.states.z, found.states.p),
        {"rule": "highest", "of": descriptor.name},
    )


def nearest(to: State | int) -> Rule:
    """Prefer what is nearest, in the metric, to a state or to a stratum of the set.

    Of a state its configuration counts. States on the stratum come first; elsewhere the distance in
    configuration and scaled parameters to the nearest of its vertices counts.

    Parameters
    ----------
    to
        A state, or the number of a stratum of the set.

    Raises
    ------
    InputError
        Later, for a stratum that the set does not have.
    """
    if isinstance(to, State):
        n, mass, u = to.structure.unknowns, to.structure.mass, to.z[: to.structure.unknowns]
        return _Least(
            "nearest to a state",
            lambda _: lambda found: np.asarray((found.states.z[:, :n] - u) ** 2 @ mass),
        )
    identity: Identity = {"rule": "nearest", "of": to}
    return _Least(f"nearest to stratum {to}", lambda eset: _distance_from(eset, to), identity)


def by_score(function: Callable[[States], Scores]) -> Rule:
    """Prefer the least value of a function of states."""
    return _Least("by score", lambda _: lambda found: np.asarray(function(found.states), float))


def rule_of(prefer: Rule | Callable[[States], Scores]) -> Rule:
    """Return a rule, or a function of states as one.

    Raises
    ------
    InputError
        For anything else.
    """
    if isinstance(prefer, Rule):
        return prefer
    if callable(prefer):
        return by_score(prefer)
    raise InputError(
        "`prefer` must be a rule (quasi_static, first_stable_on_path, lowest, highest, nearest) or "
        f"a function of states; got {prefer!r}."
    )


def _distance_from(eset: EquilibriumSet, stratum: int) -> Callable[[Found], Scores]:
    if not 0 <= stratum < len(eset.strata):
        raise InputError(
            f"`nearest` must name one of {len(eset.strata)} strata, from 0 on; got {stratum!r}."
        )
    setting = eset.setting
    used = np.unique(eset.cells[eset.stratum == stratum])
    tree = cKDTree(embed(setting, eset.points.z[used], eset.points.p[used]))

    def score(found: Found) -> Scores:
        distance = tree.query(embed(setting, found.states.z, found.states.p))[0]
        own = (found.cell >= 0) & (eset.stratum[found.cell] == stratum)
        return np.where(own, 0.0, distance)

    return score


def quasi_static(parameter: str) -> Rule:
    """Prefer the state that loading from the natural state reaches without any critical point.

    Beyond the first fold, branch point or constraint there is a gap: the rule of limit-load maps.

    Parameters
    ----------
    parameter
        The load: a free or a fixed parameter of the set.
    """
    return _OnPath(
        "quasi_static", parameter, _loaded, {"rule": "quasi_static", "parameter": parameter}
    )


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


def _loaded(eset: EquilibriumSet, load: int, low: float) -> Ends:
    """Ends of paths on which nothing happens."""
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
        Natural states over a grid, where there are two other parameters; else the structure is
        asked for each.
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
                f"`parameter` must be a load ({', '.join(unloaded) or 'there is none'}); "
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
