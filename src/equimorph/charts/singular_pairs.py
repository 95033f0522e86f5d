"""Pairs of states beside a singular curve, at which coordinates fold: found from states near it.

Let u, v be the singular vectors of the least singular value σ of the Jacobian J of the coordinates
S at a state near the curve. States with the coordinates S₀ + r lie at η + ξ v, where η = J⁺ r
without σ and ξ solves

    σ ξ + ½ (η + ξ v)ᵀ H (η + ξ v) = u·r ,   H = u·D²S .

Cells are flat; close to the curve both states of a pair may lie outside of the images of all cells,
or one of them alone, and the other would pass for the only one.

See docs/decisions.md, "Pairs of states near singular curves are found from states near these, and
from each other".
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.spatial import cKDTree

from equimorph.arrays import Float, Frames, Items, Place, Places, Points, Rows, Values
from equimorph.charts.coordinates import Coordinates, Square, settle_on_set, solve_on_the_set
from equimorph.charts.location import Cells, Found
from equimorph.manifold.geometry.points import VertexKind
from equimorph.manifold.geometry.setting import embed
from equimorph.manifold.geometry.tangents import frames_in_embedding, split_step, tangent_frames
from equimorph.manifold.lookup.cell_index import Hits
from equimorph.structures import States, join_states

NEIGHBOURS = 8
"""Nearly singular states from which the pair over a point is predicted."""
NEARLY = 0.3
"""Share of det J to which it falls from one cell to the next where it may vanish beside them."""
REACH = 1.0
"""Longest predicted step, in the largest sizes of cells."""
STEP = 1e-3
"""Step of the differences of the Jacobian along its null direction, in the metric."""

Numbers = Items


@dataclass(frozen=True, eq=False)
class _Bend:
    """How the coordinates bend at nearly singular states; J in ranges of the coordinates.

    slope: J⁺ without v. normal: u. least: σ. null: v. curvature: H.
    """

    slope: Float[np.ndarray, "singular d d"]
    normal: Float[np.ndarray, "singular d"]
    least: Values
    null: Float[np.ndarray, "singular d"]
    curvature: Float[np.ndarray, "singular d d"]


@dataclass(frozen=True, eq=False)
class SingularPairs:
    """Search for pairs of states beside the nearly singular states of some coordinates.

    Parameters
    ----------
    cells
        Cells of the chart.
    states
        States near which its coordinates fold.
    rows
        Planes near the tangent spaces there.
    """

    cells: Cells
    states: States
    rows: Rows

    @property
    def coordinates(self) -> Coordinates:
        """The coordinates that fold."""
        return self.cells.coordinates

    @property
    def _ranges(self) -> Place:
        return self.cells.ranges

    @cached_property
    def _frames(self) -> Frames:
        """Tangent spaces at the states."""
        return tangent_frames(self.coordinates.setting, self.states.z, self.states.p, self.rows)

    @cached_property
    def _tree(self) -> cKDTree:
        return cKDTree(self.coordinates(self.states.z, self.states.p) / self._ranges)

    @cached_property
    def _values(self) -> tuple[Square, np.ndarray, Square]:
        """Singular vectors and values of J."""
        left, size, right = np.linalg.svd(self._jacobian(self.states.z, self.states.p))
        return left, size, right

    @cached_property
    def _bend(self) -> _Bend:
        left, size, right = self._values
        inverse = np.zeros_like(size)
        inverse[:, :-1] = 1.0 / np.maximum(size[:, :-1], 1e-300)
        slope = np.einsum("nkj,nk,nik->nji", right, inverse, left)
        columns = [self._change(self._frames[:, k]) for k in range(size.shape[1])]
        return _Bend(slope, left[:, :, -1], size[:, -1], right[:, -1], np.stack(columns, axis=2))

    def _change(self, tangent: Float[np.ndarray, "n full"]) -> Float[np.ndarray, "n d"]:
        """Derivative of uᵀJ along tangents."""
        dz, dp = split_step(self.coordinates.setting, STEP * tangent)
        left, size, right = self._values
        there = self._jacobian(self.states.z + dz, self.states.p + dp)
        here = size[:, -1, None] * right[:, -1]
        return np.asarray((np.einsum("ni,nij->nj", left[:, :, -1], there) - here) / STEP)

    def _jacobian(self, z: np.ndarray, p: np.ndarray) -> Square:
        """Derivatives of the coordinates, in their ranges, along tangents."""
        setting = self.coordinates.setting
        frames = tangent_frames(setting, z, p, frames_in_embedding(setting, self._frames))
        return np.asarray(self.coordinates.derivative(z, p, frames) / self._ranges[:, None])

    def nearer(self) -> "SingularPairs":
        """Search from where short steps of Newton's method along v take the states."""
        setting, (_, size, right) = self.coordinates.setting, self._values
        null = np.einsum("nd,ndf->nf", right[:, -1], self._frames)
        bend = np.einsum("nd,nd->n", self._change(null), right[:, -1])
        with np.errstate(divide="ignore", invalid="ignore"):
            t = -size[:, -1] / bend
        some = np.flatnonzero(np.abs(t) <= self._longest)
        dz, dp = split_step(setting, t[some, None] * null[some])
        states, rows = self.states[some], frames_in_embedding(setting, self._frames[some])
        moved = settle_on_set(setting, states.z + dz, states.p + dp, rows)
        found = np.flatnonzero(moved.found)
        states = States(states.structure, moved.z[found], moved.p[found])
        return SingularPairs(self.cells, states, rows[found])

    def add_to(self, found: Found, points: Points) -> Found:
        """States found over points, and those of pairs beside the singular states."""
        setting, structure = self.coordinates.setting, self.states.structure
        point, near, step = self._predict(points)
        if len(point) == 0:
            return found
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
        b, c = b + bend.least[near], 0.5 * c - (bend.normal[near] * rest).sum(axis=1)
        with np.errstate(divide="ignore", invalid="ignore"):
            # the sign of the discriminant is not certain where it is small: Newton decides
            half, middle = np.sqrt(np.abs(b**2 - 2.0 * a * c)) / np.abs(a), -b / a
        steps = [along + (middle + sign * half)[:, None] * null for sign in (1.0, -1.0)]
        good = np.max([np.linalg.norm(step, axis=1) for step in steps], axis=0) <= self._longest
        both = np.concatenate([step[good] for step in steps]).reshape(-1, d)
        return np.tile(point[good], 2), np.tile(near[good], 2), both


def pairs_of(cells: Cells) -> SingularPairs | None:
    """Search for pairs where the coordinates of cells fold, if they do.

    It begins at vertices of facets across which det J changes its sign, or nearly falls to zero.
    """
    density = np.abs(cells.turn) / np.maximum(cells.extents, 1e-300)
    a, b = density[cells.whole.links].T
    near = cells.turning.copy()
    near[cells.whole.across[np.minimum(a, b) < NEARLY * np.maximum(a, b)]] = True
    vertices = np.unique(cells.whole.facets[near])
    vertices = vertices[cells.eset.kinds[vertices] != VertexKind.CROSSING]
    largest, order = np.zeros(len(cells.eset.points), int), np.argsort(cells.extents, kind="stable")
    largest[cells.corners[order]] = order[:, None]
    rows = cells.planes(largest[vertices])
    found = SingularPairs(cells, cells.eset.points[vertices], rows).nearer()
    return found if len(found.states) else None


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
