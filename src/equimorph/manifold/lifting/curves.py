"""Lifted grid edges, as a growing table of curves."""

import numpy as np

from equimorph.arrays import ItemFlags, Items


class Curves:
    """Lifted edges: edge, start point, end point (−1: left through a constraint), inner points."""

    def __init__(self) -> None:
        self.count, self._columns = 0, np.zeros((4, 0), int)
        self.inner: dict[int, list[int]] = {}

    @property
    def edge(self) -> Items:
        """Edge of each curve."""
        return self._columns[0, : self.count]

    @property
    def start(self) -> Items:
        """Point at which each curve starts."""
        return self._columns[1, : self.count]

    @property
    def end(self) -> Items:
        """Point at which each curve ends; −1 where it left through a constraint."""
        return self._columns[2, : self.count]

    @property
    def amount(self) -> Items:
        """How many points inside each curve has."""
        return self._columns[3, : self.count]

    @property
    def plain(self) -> ItemFlags:
        """Which curves have no inner points."""
        return np.asarray(self.amount == 0)

    def add(self, edge: int, start: int, end: int, inner: list[int]) -> int:
        """Add a curve; return its number."""
        self._make_room(self.count + 1)
        number, self.count = self.count, self.count + 1
        self._columns[:, number] = edge, start, end, 0
        self.put_inside(number, inner)
        return number

    def extend(self, edges: Items, starts: Items, ends: Items) -> None:
        """Add curves without inner points."""
        known, self.count = self.count, self.count + len(edges)
        self._make_room(self.count)
        for own, column in zip(self._columns, (edges, starts, ends, 0), strict=True):
            own[known : self.count] = column

    def put_inside(self, curve: int, inner: list[int]) -> None:
        """Enter the inner points of a curve, if it has any."""
        if inner:
            self.inner[curve] = inner
            self._columns[3, curve] = len(inner)

    def _make_room(self, count: int) -> None:
        if count > self._columns.shape[1]:
            grown = np.empty((4, max(2 * self._columns.shape[1], count, 64)), int)
            grown[:, : self._columns.shape[1]] = self._columns
            self._columns = grown
