"""States of an equilibrium set over points, with the pieces that they lie on."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from equimorph.arrays import Numbers
from equimorph.structures import States


@dataclass(frozen=True, eq=False)
class StatesOver:
    """States of a set over points, sorted by point: the sheets over each.

    Parameters
    ----------
    states
        All states.
    point
        Number of the point that each lies over.
    cell
        Cell of the set that each lies on, −1 where only a lift found it.
    index
        Negative eigenvalues; 0 is stable.
    stratum, component
        Numbers of the pieces of the set that each lies on, −1 if not known.
    count
        Number of points.
    """

    states: States
    point: Numbers
    cell: Numbers
    index: Numbers
    stratum: Numbers
    component: Numbers
    count: int

    def __len__(self) -> int:
        """Number of points."""
        return self.count

    def __getitem__(self, number: int) -> "StatesOver":
        """States over one of the points."""
        if not 0 <= number < self.count:
            raise IndexError(f"there are {self.count} points; got number {number}")
        mine = slice(*np.searchsorted(self.point, (number, number + 1)))
        cell, index, stratum, component = (
            column[mine] for column in (self.cell, self.index, self.stratum, self.component)
        )
        alone = np.zeros_like(cell)
        return StatesOver(self.states[mine], alone, cell, index, stratum, component, 1)

    def __iter__(self) -> Iterator["StatesOver"]:
        """Go through the points one by one."""
        return (self[number] for number in range(self.count))

    def __repr__(self) -> str:
        """How many states over how many points."""
        return f"StatesOver({len(self.states)} states over {self.count} points)"
