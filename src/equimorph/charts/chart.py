"""Charts: coordinates to exact states and back; by free parameters, or by descriptors."""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum
from functools import cached_property

import numpy as np

from equimorph.argument_checks import check_arguments
from equimorph.arrays import Bool, Float, Int, Points
from equimorph.charts.coordinates import Coordinates, coordinates_of, frames_anywhere
from equimorph.charts.domain import (
    Domain,
    Overlap,
    overlaps,
    sheet_labels,
    single_domain,
    single_valued,
)
from equimorph.charts.location import Cells, EdgeKind, Found
from equimorph.charts.preparation import cut_along_crossings, flip_inverted_triangles
from equimorph.charts.singular_pairs import SingularPairs, pairs_of
from equimorph.charts.twins import add_twins
from equimorph.errors import InputError
from equimorph.manifold import EquilibriumSet, Level, singular_set
from equimorph.manifold.complex.equilibrium_set import check_cells
from equimorph.manifold.complex.kept_tables import with_cells
from equimorph.manifold.geometry.setting import embed
from equimorph.manifold.geometry.topology import facets_of
from equimorph.model import Descriptor
from equimorph.structures import State, States
from equimorph.tolerances import SAME_STATE

STATUSES = ("inside", "gap", "barrier", "beyond the box", "not single-valued", "not resolved")
"""Where points lie; only those inside have a state."""

DEPENDENT = 1e-7
"""Largest Jacobian, in ranges of the coordinates, of those that depend on each other."""


class PointStatus(IntEnum):
    """Where a point lies: places in `STATUSES`."""

    INSIDE = 0
    GAP = 1
    BARRIER = 2
    BEYOND_THE_BOX = 3
    NOT_SINGLE_VALUED = 4
    NOT_RESOLVED = 5


@dataclass(frozen=True, eq=False)
class Charted:
    """States that a chart gives for coordinates, one per point.

    Parameters
    ----------
    states
        Exact states; NaN where no state exists.
    code
        Number in `STATUSES` of where each point lies.
    cell
        Cell of the set that each state lies on, −1 where no state exists.
    """

    states: States
    code: Int[np.ndarray, " points"]
    cell: Int[np.ndarray, " points"]

    def __len__(self) -> int:
        """Number of points."""
        return len(self.code)

    def __repr__(self) -> str:
        """How many points lie where."""
        names, counts = np.unique(self.status, return_counts=True)
        parts = (f"{count} {name}" for name, count in zip(names, counts, strict=True))
        return f"Charted({', '.join(parts)})"

    @property
    def status(self) -> np.ndarray:
        """Where each point lies, by name."""
        return np.asarray(np.array(STATUSES)[self.code])

    @property
    def inside(self) -> Bool[np.ndarray, " points"]:
        """Which points have a state."""
        return np.asarray(self.code == PointStatus.INSIDE)


@dataclass(frozen=True, eq=False)
class Chart(ABC):
    """Coordinates of states of a set, one state for each point of a domain.

    Parameters
    ----------
    eset
        The set.
    """

    eset: EquilibriumSet

    def __repr__(self) -> str:
        """Kind, coordinates, and whether they are unique."""
        unique = "single-valued" if self.single_valued else "NOT single-valued"
        return f"{type(self).__name__}({', '.join(self.names)}: {unique} on {self.eset})"

    @property
    @abstractmethod
    def coordinates(self) -> Coordinates:
        """The scalars that are the coordinates."""

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the coordinates."""
        return self.coordinates.names

    @cached_property
    def cells(self) -> Cells:
        """Cells of the set that the chart covers."""
        return Cells(
            cut_along_crossings(self.eset), self.coordinates, np.arange(len(self.eset.cells))
        )

    @cached_property
    def domain(self) -> Domain:
        """Coordinates that exactly one state has."""
        return single_domain(self.cells)

    @cached_property
    def overlaps(self) -> tuple[Overlap, ...]:
        """Coordinates that more than one state has, and why."""
        return overlaps(self.cells)

    @cached_property
    def single_valued(self) -> bool:
        """Whether all states of the set have different coordinates."""
        return single_valued(self.cells)

    @check_arguments
    def state(self, coords: Points) -> Charted:
        """Exact states with given coordinates.

        Parameters
        ----------
        coords
            One point a row.

        Returns
        -------
        States and, for each point, where it lies: "inside", in a "gap", on a "barrier", "beyond the
        box", where the coordinates are "not single-valued", or where the discretisation does "not
        resolve" any state that was found.

        Raises
        ------
        InputError
            If a point has another number of coordinates, or a value is not finite.
        """
        points = self._check_width(coords)
        found = self.find(points)
        resolved = found.states.resolved if len(found.states) else np.zeros(0, bool)
        left, found = found.point[~resolved], found.take(resolved)
        count = np.bincount(found.point, minlength=len(points))
        code = np.full(len(points), PointStatus.GAP)
        code[count == 1] = PointStatus.INSIDE
        code[count > 1] = PointStatus.NOT_SINGLE_VALUED
        empty = np.flatnonzero(count == 0)
        code[empty[self._beyond(points[empty])]] = PointStatus.BEYOND_THE_BOX
        code[left[count[left] == 0]] = PointStatus.NOT_RESOLVED
        return self._answers(found.take(count[found.point] == 1), code)

    @check_arguments
    def coords(self, states: States | State) -> Points:
        """Coordinates of states, one row each."""
        batch = states.batch if isinstance(states, State) else states
        return self.coordinates(batch.z, batch.p)

    @check_arguments
    def jacobian(self, states: States | State) -> Float[np.ndarray, "points d d"]:
        """Derivatives of the free parameters (rows) by the coordinates (columns) at states.

        The matrix is singular where the set has a fold, and NaN where the coordinates fail.
        """
        batch = states.batch if isinstance(states, State) else states
        setting = self.coordinates.setting
        d = len(setting.free)
        frames = frames_anywhere(setting, batch.z, batch.p)
        by_tangent = self.coordinates.derivative(batch.z, batch.p, frames)
        parameters = np.swapaxes(frames[:, :, -d:], 1, 2) * setting.scales[:, None]
        out = np.full(by_tangent.shape, np.nan)
        regular = np.abs(np.linalg.det(by_tangent)) > 0.0
        turned = np.swapaxes(by_tangent[regular], 1, 2)
        solved = np.linalg.solve(turned, np.swapaxes(parameters[regular], 1, 2))
        out[regular] = np.swapaxes(solved, 1, 2)
        return out

    @check_arguments
    def contains(self, states: States | State) -> Bool[np.ndarray, " points"]:
        """Whether the chart returns exactly these states for their coordinates."""
        batch = states.batch if isinstance(states, State) else states
        here = self.state(self.coords(batch))
        own = np.flatnonzero(here.inside)
        setting = self.coordinates.setting
        gap = np.full(len(batch), np.inf)
        theirs = embed(setting, batch.z[own], batch.p[own])
        found = embed(setting, here.states.z[own], here.states.p[own])
        gap[own] = np.linalg.norm(found - theirs, axis=1)
        return np.asarray(gap <= 10.0 * SAME_STATE)

    def find(self, points: Points) -> Found:
        """All states of the chart's cells over points."""
        return self.cells.find(points)

    def _check_width(self, coords: Points) -> Points:
        points = np.asarray(coords, dtype=float)
        if points.ndim != 2 or points.shape[1] != len(self.names):
            raise InputError(
                f"`coords` must be rows of {len(self.names)} numbers ({', '.join(self.names)}); "
                f"got shape {points.shape}."
            )
        if not np.isfinite(points).all():
            raise InputError(f"`coords` must be finite; got {points[~np.isfinite(points)][0]}.")
        return points

    def _beyond(self, points: Points) -> Bool[np.ndarray, " points"]:
        """Whether points without a state lie beyond the box."""
        places, box = self.coordinates.places, self.eset.box
        free = self.coordinates.setting.free.tolist()
        beyond = np.zeros(len(points), bool)
        for column, place in zip(points.T, places.tolist(), strict=True):
            if place >= 0:
                low, high = box.lower[free.index(place)], box.upper[free.index(place)]
                beyond |= (column < low) | (column > high)
        if not self.coordinates.projecting:
            rest = np.flatnonzero(~beyond)
            beyond[rest] = self.domain.nearest_kind(points[rest]) == EdgeKind.BOX
        return beyond

    def _answers(self, found: Found, code: Int[np.ndarray, " points"]) -> Charted:
        count, structure = len(code), self.eset.structure
        z = np.full((count, structure.size), np.nan)
        p = np.full((count, len(structure.parameters)), np.nan)
        cell = np.full(count, -1)
        z[found.point], p[found.point], cell[found.point] = (
            found.states.z,
            found.states.p,
            found.cell,
        )
        return Charted(States(structure, z, p), code, cell)


@check_arguments
@dataclass(frozen=True, eq=False, repr=False)
class Projection(Chart):
    """The free parameters as coordinates.

    They fail where more than one sheet lies over a point: along folds, and where a stratum overlaps
    itself. For the stable part of a set, use ``Projection(part(eset, eset.cell_index == 0))``.

    Parameters
    ----------
    eset
        The set, or a part of one.

    Raises
    ------
    InputError
        If the set is empty.
    """

    def __post_init__(self) -> None:
        """Refuse an empty set."""
        check_cells(self.eset)

    @cached_property
    def coordinates(self) -> Coordinates:
        """The free parameters."""
        return coordinates_of(self.eset, self.eset.names)


@check_arguments
@dataclass(frozen=True, eq=False, repr=False)
class DescriptorChart(Chart):
    """Descriptors and free parameters as coordinates.

    They are regular at folds of the set. They fail where the coordinates themselves fold (their
    Jacobian along the set vanishes) and where different sheets have the same coordinates. Beside
    the curve on which they fold, pairs of states are searched from this curve, too: cells are flat,
    and may hold one state of a pair alone.

    Parameters
    ----------
    eset
        The set, or a part of one.
    chosen
        Descriptors, or names of free parameters or descriptors; one for each free parameter.

    Raises
    ------
    InputError
        If the set is empty, or coordinates are unknown, too few, too many, or depend on each other.
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
        """The chosen descriptors and parameters."""
        return coordinates_of(self.eset, self.chosen)

    @cached_property
    def cells(self) -> Cells:
        """Cells of the set; those that chords of folds have turned over are flipped."""
        eset, numbers = cut_along_crossings(self.eset), np.arange(len(self.eset.cells))
        plain = Cells(eset, self.coordinates, numbers)
        if len(self.names) != 2:
            return plain
        fixed, sheet = facets_of(eset.folds, 2), sheet_labels(plain)
        flipped = flip_inverted_triangles(eset.cells, plain.values, fixed, sheet, plain.whole)
        return Cells(with_cells(eset, flipped), self.coordinates, numbers)

    @cached_property
    def singular(self) -> Level:
        """Exact states at which the coordinates fold: their Jacobian along the set vanishes."""
        return singular_set(self.eset, self.coordinates.scalars)

    @cached_property
    def _pairs(self) -> SingularPairs | None:
        return pairs_of(self.cells)

    def find(self, points: Points) -> Found:
        """All states of the chart's cells over points, and of pairs that lie beside these cells.

        A second state is found from where the coordinates nearly fold, or from the first one.
        """
        found = super().find(points)
        if self._pairs is not None:
            found = self._pairs.add_to(found, points)
        return add_twins(self.cells, found, points)

    @cached_property
    def single_valued(self) -> bool:
        """Whether all states have different coordinates: these fold nowhere, and nothing overlaps.

        Folds are located exactly, because the overlap along them may be narrower than a cell.
        """
        return len(self.singular.states) == 0 and single_valued(self.cells)

    def _jacobians(self) -> np.ndarray:
        """|det J| at some vertices, with coordinates measured in their ranges."""
        some = np.unique(np.linspace(0, len(self.eset.cells) - 1, 60).astype(int))
        cells = self.cells
        spread = np.maximum(np.ptp(cells.values, axis=0), 1e-300)
        sizes = np.abs(cells.turn[some]) / np.prod(spread)
        return np.asarray(sizes * len(cells.numbers))
