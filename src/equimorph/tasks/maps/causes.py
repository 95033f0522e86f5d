"""Reasons why a map is not smooth between two settings: states at which two tests vanish."""

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Bool, Int

from equimorph.arrays import Edges, Flags, Settings
from equimorph.equilibria.locus import Test
from equimorph.equilibria.natural_sheet import NaturalSheet
from equimorph.tasks.maps.brackets import Brackets
from equimorph.tasks.maps.polish import TestsOf
from equimorph.tasks.maps.samples import Samples


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
