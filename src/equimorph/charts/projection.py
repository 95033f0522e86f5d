"""Projection to the free parameters, and descriptors as coordinates."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from equimorph.charts.chart import Chart
from equimorph.charts.coordinates import Coordinates, coordinates_of
from equimorph.charts.location import Cells
from equimorph.charts.sheets import sheet_labels, single_valued
from equimorph.charts.uncrossed import uncrossed
from equimorph.charts.untangling import untangled
from equimorph.errors import InputError
from equimorph.manifold import EquilibriumSet, Level, singular_set
from equimorph.model import Descriptor

DEPENDENT = 1e-7
"""Largest Jacobian, in ranges of the coordinates, of those that depend on each other."""


@dataclass(frozen=True, eq=False, repr=False)
class Projection(Chart):
    """The free parameters as coordinates.

    They fail where more than one sheet lies over a point: along folds, and where a stratum lies
    over itself. Of the stable part of a set: ``Projection(part(eset, eset.cell_index == 0))``.

    Parameters
    ----------
    eset
        The set, or a part of one.

    Raises
    ------
    InputError
        For an empty set.
    """

    def __post_init__(self) -> None:
        """Refuse an empty set."""
        check_cells(self.eset)

    @cached_property
    def coordinates(self) -> Coordinates:
        """The free parameters."""
        return coordinates_of(self.eset, self.eset.names)


@dataclass(frozen=True, eq=False, repr=False)
class DescriptorChart(Chart):
    """Descriptors, or some of them and some free parameters, as coordinates.

    Regular at folds of the set. They fail where the coordinates themselves fold (their Jacobian
    along the set vanishes) and where different sheets have the same coordinates.

    Parameters
    ----------
    eset
        The set, or a part of one.
    chosen
        Descriptors, or names of free parameters or descriptors; one for each free parameter.

    Raises
    ------
    InputError
        For an empty set, or coordinates that are unknown, too few or many, or depend on each other.
    """

    chosen: Sequence[Descriptor | str]

    def __post_init__(self) -> None:
        """Refuse what gives no coordinates."""
        check_cells(self.eset)
        sizes = self._jacobians()
        if not (sizes > DEPENDENT).any():
            raise InputError(
                f"`coordinates` must be independent; got {', '.join(self.names)}, whose Jacobian "
                f"along the set is at most {sizes.max():.2g} of their ranges."
            )

    @cached_property
    def coordinates(self) -> Coordinates:
        """What was chosen."""
        return coordinates_of(self.eset, self.chosen)

    @cached_property
    def cells(self) -> Cells:
        """Cells of the set; those that chords of folds have turned over are flipped."""
        eset, numbers = uncrossed(self.eset), np.arange(len(self.eset.cells))
        plain = Cells(eset, self.coordinates, numbers)
        if len(self.names) != 2:
            return plain
        folds = [np.stack([fold[:-1], fold[1:]], axis=1) for fold in eset.folds]
        fixed = np.concatenate([np.zeros((0, 2), int), *folds])
        flipped, sheet = eset.cells.copy(), sheet_labels(plain)
        for label in range(sheet.max() + 1):
            own = sheet == label
            flipped[own] = untangled(flipped[own], plain.values, fixed)
        return Cells(replace(eset, cells=flipped), self.coordinates, numbers)

    @cached_property
    def singular(self) -> Level:
        """Exact states at which the coordinates fold: their Jacobian along the set vanishes."""
        return singular_set(self.eset, self.coordinates.scalars)

    @cached_property
    def single_valued(self) -> bool:
        """Whether all states have different coordinates: these fold nowhere, and nothing overlaps.

        Folds are found exactly, where the overlap beside them may be narrower than a cell.
        """
        return len(self.singular.states) == 0 and single_valued(self.cells)

    def _jacobians(self) -> np.ndarray:
        """|det J| at some vertices, with coordinates measured in their ranges."""
        some = np.unique(np.linspace(0, len(self.eset.cells) - 1, 60).astype(int))
        cells = self.cells
        spread = np.maximum(np.ptp(cells.values, axis=0), 1e-300)
        sizes = np.abs(cells.turn[some]) / np.prod(spread)
        return np.asarray(sizes * len(cells.numbers))


def check_cells(eset: EquilibriumSet) -> None:
    """Refuse a set without cells."""
    if len(eset.cells) == 0:
        raise InputError("`eset` must have cells; got an empty set.")
