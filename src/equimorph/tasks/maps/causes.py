"""Reasons why a map is not smooth between two settings: states at which two tests vanish."""

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from jaxtyping import Bool, Int

from equimorph.arrays import Edges, Flags, Settings, Values
from equimorph.equilibria.critical import Critical, Test
from equimorph.equilibria.first_stable import no_critical_states
from equimorph.equilibria.natural_sheet import NaturalSheet
from equimorph.equilibria.trace_options import TraceOptions
from equimorph.model import Constraint, Descriptor
from equimorph.tasks.maps.brackets import Brackets, Samples

ELSEWHERE = 0.02
"""Arclength between two extrema from which on they are different ones."""

TestsOf = Callable[[Int[np.ndarray, " some"]], tuple[Test, Test]]
"""Two tests of some lanes, by their numbers."""


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
    """Paths in a load that start at natural states, and what a map reads along them.

    Attributes
    ----------
    sheet
        Natural states.
    load
        Place of the parameter along which paths run.
    within
        Constraints that end paths.
    bound
        Largest load up to which paths are followed.
    options
        Step control.
    """

    sheet: NaturalSheet
    load: int
    within: tuple[Constraint, ...]
    bound: float
    options: TraceOptions

    @abstractmethod
    def __call__(self, settings: Settings) -> Samples:
        """Samples of the map."""

    @abstractmethod
    def causes(self, pairs: Brackets) -> list[Cause]:
        """Causes to try, from the states at both ends of the pairs, the most likely first."""

    def suspects(self, vertices: Samples, edges: Edges) -> Bool[np.ndarray, " edges"]:
        """Edges to examine although the map changes little over them; by default none."""
        del vertices
        return np.zeros(len(edges), bool)

    @abstractmethod
    def known(self, side: Samples) -> Flags:
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
