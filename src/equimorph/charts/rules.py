"""Rules that prefer one of the states over a point: by a score."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np
from scipy.spatial import cKDTree

from equimorph.argument_checks import check_arguments
from equimorph.arrays import Bool, Float, Parameters, Points
from equimorph.charts.location import Found
from equimorph.errors import InputError
from equimorph.manifold import EquilibriumSet
from equimorph.manifold.complex.kept_tables import from_cache, places_of
from equimorph.manifold.geometry.setting import embed
from equimorph.model import Descriptor, Rebuilt, remember_call
from equimorph.structures import State, States
from equimorph.structures.metric import metric_length
from equimorph.tolerances import SAME_TO_ROUNDING

Scores = Float[np.ndarray, " found"]
Chooser = Callable[[Found, Points], Bool[np.ndarray, " found"]]
"""Which of the states over points are preferred: at most one over each."""
Scoring = Callable[[Found], Scores]
Changes = Callable[[Parameters, Parameters], Float[np.ndarray, "items k"]]
"""Shares of straight ways, given by their starts and what leads to their ends, at which the choice
may change, the most likely first; NaN for none. At their starts the state that is asked for is not
preferred, at their ends it is.
"""


@dataclass(frozen=True, eq=False)
class Choice:
    """A rule made ready for a set; score: what is least where a state is preferred, if anything."""

    choose: Chooser
    score: Scoring | None = None
    changes: Changes | None = None


Identity = Mapping[str, str | int | float]


class Rule(Rebuilt, ABC):
    """A way to prefer at most one of the states over each point."""

    identity: Identity | None
    """Plain data from which `rule_from` makes the rule again; None for functions and states."""

    @abstractmethod
    def on(self, eset: EquilibriumSet) -> Choice:
        """Return the rule made ready for a set."""


@dataclass(frozen=True, repr=False)
class _Least(Rule):
    """The state with the least score, as a function of states and the cells that they lie on."""

    name: str
    score: Callable[[EquilibriumSet], Callable[[Found], Scores]] = field(repr=False)
    identity: Identity | None = None

    def __repr__(self) -> str:
        """Return what is preferred."""
        return self.name

    def on(self, eset: EquilibriumSet) -> Choice:
        """Prefer the least score."""
        score = self.score(eset)

        def choose(found: Found, points: Points) -> Bool[np.ndarray, " found"]:
            return first_of_each(found, score(found), eset.structure.elevation)

        return Choice(choose, score)


def first_of_each(found: Found, score: Scores, elevation: Descriptor) -> Bool[np.ndarray, " found"]:
    """Which states have the least finite score over their points; the highest of equal ones.

    Mirror images of equal height are distinguished by a product with a fixed vector: up to
    round-off they are equal, and which is preferred must not change from point to point.
    """
    states, n = found.states, found.states.structure.unknowns
    height = elevation.function(states.z, states.p)
    turn = states.z[:, :n] @ (states.structure.mass * np.cos(1.0 + np.arange(n)))
    chosen = np.isfinite(score)
    for value in (score, -height, -turn):
        least = np.full(int(found.point.max(initial=-1)) + 1, np.inf)
        np.minimum.at(least, found.point[chosen], value[chosen])
        own = least[found.point]
        chosen[chosen] = (value <= own + SAME_TO_ROUNDING * (1.0 + np.abs(own)))[chosen]
    kept = np.flatnonzero(chosen)
    order = kept[np.argsort(found.point[kept], kind="stable")]
    out = np.zeros(len(chosen), bool)
    out[order[np.diff(found.point[order], prepend=-1) > 0]] = True
    return out


def _least(word: str, descriptor: Descriptor, sign: float) -> Rule:
    return _Least(
        f"{word} {descriptor.name}",
        lambda _: lambda found: sign * descriptor.function(found.states.z, found.states.p),
        {"rule": word, "of": descriptor.name},
    )


@remember_call
@check_arguments
def lowest(descriptor: Descriptor) -> Rule:
    """Prefer the lowest value of a descriptor, like the energy.

    Parameters
    ----------
    descriptor
        A descriptor of the set's structure.
    """
    return _least("lowest", descriptor, 1.0)


@remember_call
@check_arguments
def highest(descriptor: Descriptor) -> Rule:
    """Prefer the highest value of a descriptor.

    Parameters
    ----------
    descriptor
        A descriptor of the set's structure.
    """
    return _least("highest", descriptor, -1.0)


@remember_call
@check_arguments
def nearest(to: State | int) -> Rule:
    """Prefer the state nearest, in the metric, to a given state or stratum of the set.

    The distance from a given state compares configurations only. For a stratum, its states come
    first; elsewhere the distance in configuration and scaled parameters to the nearest of its
    vertices decides.

    Parameters
    ----------
    to
        A state, or the number of a stratum of the set.

    Raises
    ------
    InputError
        When the rule is used, if the set has no such stratum.
    """
    if isinstance(to, State):
        return _Least(
            "nearest to a state",
            lambda _: lambda found: metric_length(to.structure, found.states.z - to.z),
        )
    identity: Identity = {"rule": "nearest", "of": to}
    return _Least(f"nearest to stratum {to}", lambda eset: _distance_from(eset, to), identity)


@remember_call
def by_score(function: Callable[[States], Scores]) -> Rule:
    """Prefer the least value of a function of states."""
    return _Least("by score", lambda _: lambda found: np.asarray(function(found.states), float))


def rule_of(prefer: Rule | Callable[[States], Scores]) -> Rule:
    """Return a rule, or a function of states as one; refused for anything else."""
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
    tree = from_cache(eset, ("tree", stratum), lambda: _tree(eset, stratum))

    def score(found: Found) -> Scores:
        distance = tree.query(embed(setting, found.states.z, found.states.p))[0]
        own = (found.cell >= 0) & (eset.stratum[found.cell] == stratum)
        return np.where(own, 0.0, distance)

    return score


def _tree(eset: EquilibriumSet, stratum: int) -> cKDTree:
    """The vertices of a stratum in the metric."""
    return cKDTree(places_of(eset)[np.unique(eset.cells[eset.stratum == stratum])])
