"""Polygons: the boundaries of discs over grid triangles, alone and as arrays."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from equimorph.arrays import Int, ItemFlags, Items, Some


@dataclass(frozen=True)
class Polygon:
    """Boundary of a disc over one triangle: points in order; `open` if closed along a constraint.

    An open polygon runs from its first to its last point; the closing side lies on the constraint.
    So do, if it consists of several chains, the sides that end at the places `gaps` among its
    points.
    """

    triangle: int
    points: tuple[int, ...]
    open: bool
    gaps: tuple[int, ...] = ()


@dataclass(frozen=True)
class Polygons:
    """Polygons as arrays, see `Polygon`: points of the k-th from ``starts[k]`` to its next."""

    points: Int[np.ndarray, " all"]
    starts: Int[np.ndarray, " n1"]
    triangle: Items
    open: ItemFlags

    @classmethod
    def of(cls, polygons: Sequence[Polygon]) -> "Polygons":
        """Arrays of some polygons."""
        lengths = [len(each.points) for each in polygons]
        return cls(
            np.array([point for each in polygons for point in each.points], int),
            np.concatenate([[0], np.cumsum(np.array(lengths, int))]),
            np.array([each.triangle for each in polygons], int),
            np.array([each.open for each in polygons], bool),
        )

    def each(self, rows: Some) -> list[Polygon]:
        """Some of the polygons as records."""
        return [
            Polygon(triangle, tuple(self.points[first:last].tolist()), is_open)
            for triangle, first, last, is_open in zip(
                self.triangle[rows].tolist(), self.starts[rows].tolist(),
                self.starts[rows + 1].tolist(), self.open[rows].tolist(), strict=True,
            )
        ]  # fmt: skip

    def of_length(self, length: int) -> tuple[Some, Int[np.ndarray, "some length"]]:
        """Polygons with so many points, and these."""
        rows = np.flatnonzero(np.diff(self.starts) == length)
        return rows, self.points[self.starts[rows, None] + np.arange(length)]
