"""What all charts can do: coordinates to exact states and back."""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Bool, Float, Int

from equimorph.arrays import Points
from equimorph.charts.coordinates import Coordinates
from equimorph.charts.domain import Domain
from equimorph.charts.location import SAME, Cells, Found
from equimorph.charts.sheets import Overlap, alone, overlaps, single_valued
from equimorph.charts.solving import frames_anywhere
from equimorph.charts.uncrossed import uncrossed
from equimorph.errors import InputError
from equimorph.manifold import EquilibriumSet
from equimorph.manifold.geometry.embedding import embed
from equimorph.structures import State, States

STATUSES = ("inside", "gap", "barrier", "beyond the box", "not single-valued")
"""Where points lie; only those inside have a state."""
INSIDE, GAP, BARRIER, BEYOND, MANIFOLD = range(len(STATUSES))


@dataclass(frozen=True, eq=False)
class Charted:
    """Answers of a chart, one per point.

    Parameters
    ----------
    states
        Exact states; not numbers where there is none.
    code
        Number in `STATUSES` of where each point lies.
    cell
        Cell of the set that each state lies on, −1 where there is none.
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
        return np.asarray(self.code == INSIDE)


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
        return Cells(uncrossed(self.eset), self.coordinates, np.arange(len(self.eset.cells)))

    @cached_property
    def domain(self) -> Domain:
        """Coordinates that exactly one state has."""
        return alone(self.cells)

    @cached_property
    def overlaps(self) -> tuple[Overlap, ...]:
        """Coordinates that more than one state has, and why."""
        return overlaps(self.cells)

    @cached_property
    def single_valued(self) -> bool:
        """Whether all states of the set have different coordinates."""
        return single_valued(self.cells)

    def state(self, coords: Points) -> Charted:
        """Exact states with given coordinates.

        Parameters
        ----------
        coords
            One point a row.

        Returns
        -------
        States and, for each point, where it lies: "inside", in a "gap", on a "barrier", "beyond the
        box", or where the coordinates are "not single-valued".

        Raises
        ------
        InputError
            For other numbers of coordinates or values that are not finite.
        """
        points = self._checked(coords)
        found = self._found(points)
        count = np.bincount(found.point, minlength=len(points))
        code = np.where(count == 1, INSIDE, np.where(count > 1, MANIFOLD, GAP))
        empty = np.flatnonzero(count == 0)
        code[empty[self._beyond(points[empty])]] = BEYOND
        return self._answers(found.take(count[found.point] == 1), code)

    def coords(self, states: States | State) -> Points:
        """Coordinates of states, one row each."""
        batch = states.batch if isinstance(states, State) else states
        return self.coordinates(batch.z, batch.p)

    def jacobian(self, states: States | State) -> Float[np.ndarray, "points d d"]:
        """Derivatives of the free parameters (rows) by the coordinates (columns) at states.

        Singular where the set has a fold; not numbers where the coordinates fail.
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

    def contains(self, states: States | State) -> Bool[np.ndarray, " points"]:
        """Whether the chart gives just these states for their coordinates."""
        batch = states.batch if isinstance(states, State) else states
        here = self.state(self.coords(batch))
        own = np.flatnonzero(here.inside)
        setting = self.coordinates.setting
        gap = np.full(len(batch), np.inf)
        theirs = embed(setting, batch.z[own], batch.p[own])
        found = embed(setting, here.states.z[own], here.states.p[own])
        gap[own] = np.linalg.norm(found - theirs, axis=1)
        return np.asarray(gap <= 10.0 * SAME)

    def _found(self, points: Points) -> Found:
        """All states of the chart's cells over points."""
        return self.cells.find(points)

    def _checked(self, coords: Points) -> Points:
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
            beyond[rest] = self.domain.nearest_kind(points[rest]) == "box"
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
