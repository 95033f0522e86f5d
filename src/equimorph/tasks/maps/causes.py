"""Reasons why a map is not smooth between two settings: states at which two tests vanish."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Bool, Int

from equimorph.arrays import Edges, Flags, Settings, Values
from equimorph.equilibria.critical import Critical
from equimorph.equilibria.first_stable import none_passed
from equimorph.equilibria.locus import Test
from equimorph.equilibria.natural_sheet import NaturalSheet
from equimorph.model import Constraint, Descriptor
from equimorph.tasks.maps.brackets import Brackets, Samples
from equimorph.tasks.maps.singular_states import TestsOf

START_KINDS = ("undefined unloaded", "no natural state", "lost")
"""Why there is no path at a setting, or that it was lost; the first statuses of every map."""
UNDEFINED, MISSING, LOST = range(len(START_KINDS))

ELSEWHERE = 0.02
"""Distance along a structure of two extrema that are not one that moves."""


def unloaded_samples(
    sheet: NaturalSheet, within: Sequence[Constraint], settings: Settings
) -> Samples:
    """Natural states: `UNDEFINED` or `MISSING` where no path can start, `LOST` elsewhere."""
    z, found = sheet.states(settings)
    p = sheet.parameters(settings)
    kind = np.where(found, LOST, MISSING)
    at = np.flatnonzero(found)
    for constraint in within:
        kind[at[constraint.excess(z[at], p[at]) > 0.0]] = UNDEFINED
    none = np.full(len(settings), np.nan)
    return Samples(settings, none, kind, np.zeros(len(p)), z, p, none_passed(len(p)))


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


@runtime_checkable
class Paths(Protocol):
    """What a map reads at settings, along paths that start at natural states."""

    @property
    def sheet(self) -> NaturalSheet:
        """Natural states."""

    @property
    def load(self) -> int:
        """Place of the parameter along which paths run."""

    def __call__(self, settings: Settings) -> Samples:
        """Samples of the map."""

    def causes(self, pairs: Brackets) -> list[Cause]:
        """Causes to try, from the states at both ends of the pairs, the most likely first."""

    def suspects(self, vertices: Samples, edges: Edges) -> Bool[np.ndarray, " edges"]:
        """Edges to look at, besides those over which the map changes much."""

    def known(self, side: Samples) -> Flags:
        """Whether the map says something at settings, so that they can be compared."""

    def unexplained(self, pairs: Brackets) -> np.ndarray:
        """Kinds of places without a cause, by what the ends show; empty for none."""


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
            one, other = np.take_along_axis(values, away.argmin(axis=2), 1).T
            return np.asarray((one - other) / np.maximum(np.abs(one) + np.abs(other), 1.0))

        return test

    here = places[moved]
    return [
        Cause.of("place", lambda lanes: (difference(lanes), second), moved, side)
        for side in (pairs.a, pairs.b)
    ]
