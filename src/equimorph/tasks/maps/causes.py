"""Reasons why a map is not smooth between two settings, and the exact states where they hold.

A cause is a pair of tests that vanish at a state; the first one inside a pair of settings shows.
"""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum
from functools import partial

import numpy as np

from equimorph.arrays import Bool, Edges, Flags, Float, Int, Settings, Values
from equimorph.columns import Columns
from equimorph.equilibria.critical import Critical, Test
from equimorph.equilibria.critical_tests import TestsOf, correct_singular_states
from equimorph.equilibria.first_stable import no_critical_states
from equimorph.equilibria.natural_sheet import NaturalSheet
from equimorph.equilibria.settle import free_directions
from equimorph.equilibria.trace_options import TraceOptions
from equimorph.model import Constraint, Descriptor
from equimorph.tasks.maps.brackets import PARTS, SHRINKING, Brackets, Samples, sample_distance
from equimorph.tolerances import SAME_PLACE

ELSEWHERE = 0.02
"""Arclength between two extrema from which on they are different ones."""
PairFlags = Bool[np.ndarray, " pairs"]
BESIDE = 1.0 / PARTS**2
"""Distance from a place at which both sides are examined, as a share of the pair."""
CLOSE = 1e-8
"""Distance in units of the parameters' scales at which a map that looks smooth on both sides of a
place needs another cause: near a slightly unfolded pitchfork a cusp and a branch point of
the path lie 1e-7 to 1e-5 apart, and only one of them makes the map jump."""
SLACK = 1e-3
"""How far outside its bracket, in lengths of it, an exact place may lie."""


class Start(IntEnum):
    """Why there is no path at a setting, or that it was lost: the first statuses of every map."""

    UNDEFINED_UNLOADED = 0
    NO_NATURAL_STATE = 1
    LOST = 2


def labels(statuses: type[IntEnum]) -> tuple[str, ...]:
    """Statuses of a map in words, in the order of their numbers."""
    return tuple(each.name.lower().replace("_", " ") for each in statuses)


@dataclass(frozen=True)
class Cause:
    """A reason why a map is not smooth at a place: two tests that vanish, tried from one side.

    `tests` of some of its lanes, by their numbers in `lanes`: they may differ from lane to lane.
    """

    kind: str
    tests: TestsOf
    lanes: Int[np.ndarray, " some"]
    start: Samples

    @classmethod
    def of(
        cls,
        kind: str,
        tests: tuple[Test, Test] | TestsOf,
        where: Bool[np.ndarray, " all"],
        side: Samples,
    ) -> "Cause":
        """Cause for some of the lanes, tried from their states on one side."""
        lanes = np.flatnonzero(where)
        own = tests if callable(tests) else lambda some: tests
        return cls(kind, own, lanes, side.take(lanes))


@dataclass(frozen=True)
class Paths(ABC):
    """Paths in a load that start at natural states, and what a map reads along them."""

    sheet: NaturalSheet
    """Natural states."""
    load: int
    """Place of the parameter along which paths run."""
    within: tuple[Constraint, ...]
    """Constraints that end paths."""
    bound: float
    """Largest load up to which paths are followed."""
    options: TraceOptions
    """Step control."""

    def __call__(self, settings: Settings) -> Samples:
        """Samples of the map."""
        return self.follow(self.natural_samples(settings))

    @abstractmethod
    def follow(self, start: Samples) -> Samples:
        """Samples at the ends of the paths that begin at natural states; these are replaced."""

    @abstractmethod
    def causes(self, pairs: Brackets) -> list[Cause]:
        """Causes to try, from the states at both ends of the pairs, the most likely first."""

    def suspects(self, vertices: Samples, edges: Edges) -> Bool[np.ndarray, " edges"]:
        """Edges to examine although the map changes little over them; by default none."""
        return np.zeros(len(edges), bool)

    @abstractmethod
    def is_known(self, side: Samples) -> Flags:
        """Whether the map is defined at settings, so that they can be compared."""

    @abstractmethod
    def unexplained_kinds(self, pairs: Brackets) -> np.ndarray:
        """Kinds of places without a cause, by what the ends show; empty for none."""

    def natural_samples(self, settings: Settings) -> Samples:
        """Natural states that obey the constraints, with the status `LOST` until a path is found.

        `UNDEFINED_UNLOADED` or `NO_NATURAL_STATE` where no path can start.
        """
        z, found = self.sheet.states(settings)
        p = self.sheet.parameters(settings)
        kind = np.where(found, Start.LOST, Start.NO_NATURAL_STATE)
        at = np.flatnonzero(found)
        for constraint in self.within:
            kind[at[constraint.excess(z[at], p[at]) > 0.0]] = Start.UNDEFINED_UNLOADED
        none = np.full(len(settings), np.nan)
        return Samples(settings, none, kind, np.zeros(len(p)), z, p, no_critical_states(len(p)))


def equal_extrema(
    descriptor: Descriptor, pairs: Brackets, where: Bool[np.ndarray, " pairs"], second: Test
) -> list[Cause]:
    """Causes that the local extrema at the places of both ends are equal, and another test."""
    branches = descriptor.branches
    if branches is None:
        return []
    # the part after a whole number is the arclength
    places = np.stack([pairs.a.place, pairs.b.place], axis=1) % 2.0
    moved = where & (np.abs(places[:, 0] - places[:, 1]) > ELSEWHERE)

    def difference(lanes: Int[np.ndarray, " some"]) -> Test:
        def test(at: Critical) -> Values:
            values, found = branches(at.z, at.p)
            near = np.tile(here[lanes], (len(at.z) // len(lanes), 1))
            away = np.abs(found[:, None] - near[:, :, None])
            away = np.where(np.isfinite(values)[:, None], away, np.inf)
            which = away.argmin(axis=2)
            one, other = np.take_along_axis(values, which, 1).T
            gap = (one - other) / np.maximum(np.abs(one) + np.abs(other), 1.0)
            # one extremum near both places is always equal to itself
            return np.where(which[:, 0] == which[:, 1], np.nan, gap)

        return test

    here = places[moved]
    return [
        Cause.of("place", lambda lanes: (difference(lanes), second), moved, side)
        for side in (pairs.a, pairs.b)
    ]


@dataclass(frozen=True)
class Candidates(Columns):
    """Places found for causes of pairs: number of the cause (−1: none), kind, state, parameters."""

    cause: Int[np.ndarray, " pairs"]
    kind: np.ndarray
    z: Float[np.ndarray, "pairs size"]
    p: Float[np.ndarray, "pairs parameters"]

    @property
    def found(self) -> PairFlags:
        """Whether there is one."""
        return np.asarray(self.cause >= 0)

    def put(self, pairs: Int[np.ndarray, " some"], new: "Candidates") -> None:
        """Replace some."""
        for old, column in zip(vars(self).values(), vars(new).values(), strict=True):
            old[pairs] = column


def candidates(paths: Paths, pairs: Brackets) -> Candidates:
    """The first cause of each pair that leads to a place inside.

    Where the map looks smooth close to it and a later cause leads to another place at which it does
    not, that one counts.
    """
    causes, places = paths.causes(pairs), paths.sheet.places
    best = _first(paths, pairs, causes, np.zeros(len(pairs), int))
    open_ = np.flatnonzero(best.found)
    open_ = open_[_looks_smooth(paths, pairs.take(open_), best.p[open_])]
    tried = best.cause.copy()
    while len(open_):
        first = np.full(len(pairs), len(causes))
        first[open_] = tried[open_] + 1
        others = _first(paths, pairs, causes, first)
        open_ = open_[others.found[open_]]
        tried[open_] = others.cause[open_]
        apart = np.abs(others.p[open_] - best.p[open_])[:, places].max(axis=1) > SAME_PLACE
        better = apart & ~_looks_smooth(paths, pairs.take(open_), others.p[open_])
        best.put(open_[better], others.take(open_[better]))
        open_ = open_[~better]
    return best


def _first(
    paths: Paths, pairs: Brackets, causes: Sequence[Cause], first: Int[np.ndarray, " pairs"]
) -> Candidates:
    """What the first successful one among the causes from number `first` on leads to."""
    count, structure = len(pairs), paths.sheet.structure
    moving = np.argmax(np.abs(pairs.b.setting - pairs.a.setting), axis=1)
    axis, kind = paths.sheet.places[moving], np.full(count, "", dtype=object)
    out = Candidates(np.full(count, -1), kind, pairs.a.z.copy(), pairs.a.p.copy())
    for k, cause in enumerate(causes):
        some = np.flatnonzero((~out.found & (first <= k))[cause.lanes])
        at, start = cause.lanes[some], cause.start.take(some)
        if not len(at):
            continue
        free = np.stack([axis[at], np.full(len(at), paths.load)], axis=1)
        free = free_directions(structure, free, len(at))
        tests = partial(_of_some, cause.tests, some)
        exact = correct_singular_states(structure, start.z, start.p, free, tests)
        z, p, good = exact.z, exact.p, exact.found
        good &= _within(pairs.take(at), p[:, paths.sheet.places])
        many = int(good.sum())
        kinds = np.full(many, cause.kind, dtype=object)
        out.put(at[good], Candidates(np.full(many, k), kinds, z[good], p[good]))
    return out


def _of_some(
    tests: TestsOf, some: Int[np.ndarray, " some"], lanes: Int[np.ndarray, " fewer"]
) -> Sequence[Test]:
    """Tests of lanes, given by their numbers in a selection."""
    return tests(some[lanes])


def _within(brackets: Brackets, place: Float[np.ndarray, "brackets 2"]) -> PairFlags:
    """Whether places lie in their brackets."""
    a, b = brackets.a.setting, brackets.b.setting
    room = SLACK * np.abs(b - a) + 1e-9
    return np.asarray(
        ((place >= np.minimum(a, b) - room) & (place <= np.maximum(a, b) + room)).all(axis=1)
    )


def _looks_smooth(
    paths: Paths, pairs: Brackets, p: Float[np.ndarray, "pairs parameters"]
) -> PairFlags:
    """Whether a map looks smooth at places on pairs, seen from close by on both sides."""
    count, places = len(pairs), paths.sheet.places
    if count == 0:
        return np.zeros(0, bool)
    length = pairs.b.setting - pairs.a.setting
    share = CLOSE / np.linalg.norm(length / paths.sheet.structure.scales[places], axis=1)
    room = share[:, None] * length
    beside = paths(np.concatenate([p[:, places] - room, p[:, places] + room]))
    left, right = beside.take(np.arange(count)), beside.take(np.arange(count, 2 * count))
    sure = paths.is_known(left) & paths.is_known(right) & (share < BESIDE)
    return np.asarray(sure & ~is_sharp(paths, left, right, pairs, share))


def is_sharp(
    paths: Paths,
    left: Samples,
    right: Samples,
    pairs: Brackets,
    share: float | Float[np.ndarray, " pairs"],
) -> PairFlags:
    """Whether a map differs more between both sides of places than a smooth one would.

    `left`, `right`: samples at a distance of `share`, relative to the pair, on each side of the
    places. Kinds may differ, too.
    """
    structure = paths.sheet.structure
    now = sample_distance(structure, left, right)
    before = sample_distance(structure, pairs.a, pairs.b)
    usual = (2.0 * share) ** SHRINKING * before
    return np.asarray(np.isinf(now) | (np.isfinite(before) & (now > usual)))
