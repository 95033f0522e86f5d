"""Pairs of states beside a singular curve, at which coordinates fold: found from the curve itself.

Near an exact state at which the Jacobian J of the coordinates S has the null direction v, with
uᵀJ = 0, states with the coordinates S₀ + r lie at η + ξ v, where η = J⁺ r and ξ solves

    ½ (η + ξ v)ᵀ H (η + ξ v) = u·r ,   H = u·D²S .

Cells are flat; close to the curve both states of a pair may lie outside of the images of all cells,
or one of them alone, and the other would pass for the only one.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.spatial import cKDTree

from equimorph.arrays import Float, Frames, Items, Place, Places, Points
from equimorph.charts.coordinates import Coordinates, solve_on_the_set
from equimorph.charts.location import Cells, Found
from equimorph.manifold.geometry.setting import embed
from equimorph.manifold.geometry.tangents import frames_in_embedding, split_step, tangent_frames
from equimorph.manifold.lookup.cell_index import Hits
from equimorph.structures import States, join_states

NEIGHBOURS = 4
"""Singular states from which the pair over a point is predicted."""
REACH = 1.0
"""Longest predicted step, in the largest sizes of cells."""
STEP = 1e-3
"""Step of the differences of the Jacobian along its null direction, in the metric."""

Numbers = Items


@dataclass(frozen=True, eq=False)
class _Bend:
    """How the coordinates fold at singular states; J in ranges of the coordinates.

    slope: J⁺ without the null direction. normal: u. null: v. curvature: H.
    """

    slope: Float[np.ndarray, "singular d d"]
    normal: Float[np.ndarray, "singular d"]
    null: Float[np.ndarray, "singular d"]
    curvature: Float[np.ndarray, "singular d d"]


@dataclass(frozen=True, eq=False)
class SingularPairs:
    """Search for pairs of states beside the singular states of some coordinates.

    Parameters
    ----------
    cells
        Cells of the chart.
    states
        Exact states at which its coordinates fold.
    """

    cells: Cells
    states: States

    @property
    def coordinates(self) -> Coordinates:
        """The coordinates that fold."""
        return self.cells.coordinates

    @property
    def _ranges(self) -> Place:
        return self.cells.ranges

    @cached_property
    def _frames(self) -> Frames:
        """Tangent spaces at the singular states, from the planes of the nearest cells."""
        setting = self.coordinates.setting
        cell = self.cells.nearest(self.states)
        return tangent_frames(setting, self.states.z, self.states.p, self.cells.planes(cell))

    @cached_property
    def _tree(self) -> cKDTree:
        return cKDTree(self.coordinates(self.states.z, self.states.p) / self._ranges)

    @cached_property
    def _bend(self) -> _Bend:
        left, size, right = np.linalg.svd(self._jacobian(self.states.z, self.states.p))
        normal, null = left[:, :, -1], right[:, -1]
        inverse = np.zeros_like(size)
        inverse[:, :-1] = 1.0 / np.maximum(size[:, :-1], 1e-300)
        slope = np.einsum("nkj,nk,nik->nji", right, inverse, left)
        columns = []
        for k in range(size.shape[1]):
            dz, dp = split_step(self.coordinates.setting, STEP * self._frames[:, k])
            ahead, behind = (
                np.einsum("ni,nij->nj", normal, self._jacobian(z, p))
                for z, p in (
                    (self.states.z + dz, self.states.p + dp),
                    (self.states.z - dz, self.states.p - dp),
                )
            )
            columns.append((ahead - behind) / (2.0 * STEP))
        return _Bend(slope, normal, null, np.stack(columns, axis=2))

    def _jacobian(self, z: np.ndarray, p: np.ndarray) -> Float[np.ndarray, "singular d d"]:
        """Derivatives of the coordinates, in their ranges, along tangents."""
        setting = self.coordinates.setting
        frames = tangent_frames(setting, z, p, frames_in_embedding(setting, self._frames))
        return np.asarray(self.coordinates.derivative(z, p, frames) / self._ranges[:, None])

    def add_to(self, found: Found, points: Points) -> Found:
        """States found over points, and those of pairs beside the singular states."""
        setting, structure = self.coordinates.setting, self.states.structure
        point, near, step = self._predict(points)
        tangent = np.einsum("nd,ndf->nf", step, self._frames[near])
        dz, dp = split_step(setting, tangent)
        start = self.states[near]
        rows = frames_in_embedding(setting, self._frames[near])
        own = solve_on_the_set(self.coordinates, start.z + dz, start.p + dp, points[point], rows)
        moved = embed(setting, own.z, own.p) - embed(setting, start.z, start.p)
        good = own.found & (np.linalg.norm(moved, axis=1) <= 2.0 * self._longest)
        some = np.flatnonzero(good)
        states, point = States(structure, own.z[some], own.p[some]), point[some]
        cell = self.cells.nearest(states)
        good = self.cells.hold(states, own.index[some], cell)
        new = Found(
            states[good], point[good], self.cells.numbers[cell[good]], np.zeros(good.sum(), bool)
        )
        return unite(self.cells, found, new)

    @property
    def _longest(self) -> float:
        return REACH * float(self.cells.sizes.max())

    def _predict(self, points: Points) -> tuple[Numbers, Numbers, Places]:
        """Points with a pair near by, the singular states it is predicted from, and the steps."""
        count, d = min(NEIGHBOURS, len(self.states)), points.shape[1]
        scaled, bend = points / self._ranges, self._bend
        near = self._tree.query(scaled, k=np.arange(1, count + 1))[1].ravel()
        point = np.repeat(np.arange(len(points)), count)
        rest = scaled[point] - self._tree.data[near]
        along, null = np.einsum("nji,ni->nj", bend.slope[near], rest), bend.null[near]
        curvature = bend.curvature[near]
        a, b, c = (
            np.einsum("ni,nij,nj->n", one, curvature, other)
            for one, other in ((null, null), (null, along), (along, along))
        )
        c = 0.5 * c - (bend.normal[near] * rest).sum(axis=1)
        with np.errstate(divide="ignore", invalid="ignore"):
            # the sign of the discriminant is not certain where it is small: Newton decides
            half, middle = np.sqrt(np.abs(b**2 - 2.0 * a * c)) / np.abs(a), -b / a
        steps = [along + (middle + sign * half)[:, None] * null for sign in (1.0, -1.0)]
        good = np.max([np.linalg.norm(step, axis=1) for step in steps], axis=0) <= self._longest
        both = np.concatenate([step[good] for step in steps]).reshape(-1, d)
        return np.tile(point[good], 2), np.tile(near[good], 2), both


def unite(cells: Cells, first: Found, second: Found) -> Found:
    """States of both, equal ones once, sorted by point."""
    states = join_states(first.states.structure, [first.states, second.states])
    point, cell, inside = (
        np.concatenate([getattr(first, name), getattr(second, name)])
        for name in ("point", "cell", "inside")
    )
    kept = cells.one_of_each(
        states.z, states.p, Hits(point, cell, np.zeros((len(point), 0)), inside)
    )
    kept = kept[np.argsort(point[kept], kind="stable")]
    return Found(states[kept], point[kept], cell[kept], inside[kept])
