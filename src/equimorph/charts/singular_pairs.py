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

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.spatial import cKDTree

from equimorph.arrays import (
    Flags,
    Float,
    Frames,
    Int,
    Items,
    Lanes,
    Parameters,
    Place,
    Places,
    Points,
    Rows,
    Some,
    Values,
)
from equimorph.charts.coordinates import Coordinates, Square, settle_on_set, solve_on_the_set
from equimorph.charts.kernels import predicted_pairs
from equimorph.charts.location import Cells, Found
from equimorph.columns import Columns
from equimorph.manifold.geometry.points import VertexKind
from equimorph.manifold.geometry.setting import embed
from equimorph.manifold.geometry.tangents import frames_in_embedding, split_step, tangent_frames
from equimorph.manifold.lookup.cell_index import Hits
from equimorph.structures import States, join_states

NEIGHBOURS = 8
"""Nearly singular states from which the pair over a point is predicted."""
STARTS = 64
"""Vertices, the nearest ones by their coordinates, from which these states are computed."""
NEARLY = 0.3
"""Share of det J to which it falls from one cell to the next where it may vanish beside them."""
REACH = 1.0
"""Longest predicted step, in the largest sizes of cells."""
STEP = 1e-3
"""Step of the differences of the Jacobian along its null direction, in the metric."""

Numbers = Items


@dataclass(frozen=True, eq=False)
class _Bend(Columns):
    """How the coordinates bend at nearly singular states; J in ranges of the coordinates.

    z, p: the states. frames: tangent spaces. values: coordinates in their ranges. slope: J⁺ without
    v. normal: u. least: σ. null: v. curvature: H.
    """

    z: Lanes
    p: Parameters
    frames: Frames
    values: Places
    slope: Float[np.ndarray, "singular d d"]
    normal: Float[np.ndarray, "singular d"]
    least: Values
    null: Float[np.ndarray, "singular d"]
    curvature: Float[np.ndarray, "singular d d"]


@dataclass(frozen=True, eq=False)
class _Nearly:
    """Nearly singular states of coordinates."""

    coordinates: Coordinates
    ranges: Place
    """The coordinates, and their ranges over the set."""
    states: States
    """The states."""
    rows: Rows
    """Planes near the tangent spaces there."""

    @cached_property
    def frames(self) -> Frames:
        """Tangent spaces at the states."""
        return tangent_frames(self.coordinates.setting, self.states.z, self.states.p, self.rows)

    @cached_property
    def values(self) -> tuple[Square, np.ndarray, Square]:
        """Singular vectors and values of J."""
        left, size, right = np.linalg.svd(self._jacobian(self.states.z, self.states.p))
        return left, size, right

    @property
    def bend(self) -> _Bend:
        """How the coordinates bend at the states."""
        left, size, right = self.values
        z, p, inverse = self.states.z, self.states.p, np.zeros_like(size)
        inverse[:, :-1] = 1.0 / np.maximum(size[:, :-1], 1e-300)
        slope = np.einsum("nkj,nk,nik->nji", right, inverse, left, order="C")
        columns = [self._change(self.frames[:, k]) for k in range(size.shape[1])]
        first, second = (left[:, :, -1], size[:, -1]), (right[:, -1], np.stack(columns, axis=2))
        here = self.coordinates(z, p) / self.ranges
        return _Bend(z, p, self.frames, here, slope, *first, *second)

    def _change(self, tangent: Float[np.ndarray, "n full"]) -> Float[np.ndarray, "n d"]:
        """Derivative of uᵀJ along tangents."""
        dz, dp = split_step(self.coordinates.setting, STEP * tangent)
        left, size, right = self.values
        there = self._jacobian(self.states.z + dz, self.states.p + dp)
        here = size[:, -1, None] * right[:, -1]
        return np.asarray((np.einsum("ni,nij->nj", left[:, :, -1], there) - here) / STEP)

    def _jacobian(self, z: np.ndarray, p: np.ndarray) -> Square:
        """Derivatives of the coordinates, in their ranges, along tangents."""
        setting = self.coordinates.setting
        frames = tangent_frames(setting, z, p, frames_in_embedding(setting, self.frames))
        return np.asarray(self.coordinates.derivative(z, p, frames) / self.ranges[:, None])

    def nearer(self, longest: float) -> tuple["_Nearly", Some]:
        """Where short steps of Newton's method along v take the states, and which these are."""
        setting, (_, size, right) = self.coordinates.setting, self.values
        null = np.einsum("nd,ndf->nf", right[:, -1], self.frames)
        bend = np.einsum("nd,nd->n", self._change(null), right[:, -1])
        with np.errstate(divide="ignore", invalid="ignore"):
            t = -size[:, -1] / bend
        some = np.flatnonzero(np.abs(t) <= longest)
        dz, dp = split_step(setting, t[some, None] * null[some])
        states, rows = self.states[some], frames_in_embedding(setting, self.frames[some])
        moved = settle_on_set(setting, states.z + dz, states.p + dp, rows)
        found = np.flatnonzero(moved.found)
        states = States(states.structure, moved.z[found], moved.p[found])
        return replace(self, states=states, rows=rows[found]), some[found]


@dataclass(frozen=True, eq=False)
class SingularPairs:
    """Search for pairs of states beside the nearly singular states of some coordinates.

    These states are computed near the points that are asked for, and kept.
    """

    cells: Cells
    """Cells of the chart."""
    vertices: Numbers
    """Vertices of the set beside which its coordinates fold."""

    @property
    def coordinates(self) -> Coordinates:
        """The coordinates that fold."""
        return self.cells.coordinates

    @cached_property
    def _rows(self) -> Rows:
        """Planes near the tangent spaces at the vertices: those of their largest cells."""
        cells, largest = self.cells, np.zeros(len(self.cells.eset.points), int)
        order = np.argsort(cells.extents, kind="stable")
        largest[cells.corners[order]] = order[:, None]
        return cells.planes(largest[self.vertices])

    @cached_property
    def _tree(self) -> cKDTree:
        return cKDTree(self.cells.values[self.vertices] / self.cells.ranges)

    @cached_property
    def _kept(self) -> list[tuple[Flags, Numbers, _Bend]]:
        """What was computed last, if anything was; other threads may work with the one before.

        Whether each vertex was asked for, the row of its state, −1 without one, and the states.
        """
        return []

    def _bend_near(self, some: Numbers) -> tuple[_Bend, Int[np.ndarray, " found"]]:
        """Nearly singular states that are found from vertices, and from which of these."""
        cells, states = self.cells, self.cells.eset.points[self.vertices[some]]
        start = _Nearly(cells.coordinates, cells.ranges, states, self._rows[some])
        found, of = start.nearer(self._longest)
        return found.bend, some[of]

    def _singular(
        self, near: Int[np.ndarray, "points starts"]
    ) -> tuple[Int[np.ndarray, "points starts"], _Bend]:
        """Rows of the nearly singular states that belong to vertices, and all known ones."""
        count, kept = len(self.vertices), self._kept[-1:]
        asked, row, *bends = kept[0] if kept else (np.zeros(count, bool), np.full(count, -1))
        new = np.unique(near[~asked[near]])
        if len(new):
            more, of = self._bend_near(new)
            asked, row = asked.copy(), row.copy()
            asked[new] = True
            row[of] = sum(len(each.least) for each in bends) + np.arange(len(of))
            bends = [_Bend.concatenate([*bends, more])]
            self._kept[:] = [(asked, row, bends[0])]
        return row[near], bends[0]

    def add_to(self, found: Found, points: Points) -> Found:
        """States found over points, and those of pairs beside the singular states."""
        if len(points) == 0:
            return found
        setting, structure = self.coordinates.setting, self.cells.eset.structure
        point, row, step, whole = self._predict(points)
        if len(point) == 0:
            return found
        near = whole.take(row)
        tangent = np.einsum("nd,ndf->nf", step, near.frames)
        dz, dp = split_step(setting, tangent)
        rows = frames_in_embedding(setting, near.frames)
        own = solve_on_the_set(self.coordinates, near.z + dz, near.p + dp, points[point], rows)
        moved = embed(setting, own.z, own.p) - embed(setting, near.z, near.p)
        good = own.found & (np.linalg.norm(moved, axis=1) <= 2.0 * self._longest)
        some = np.flatnonzero(good)
        states, point = States(structure, own.z[some], own.p[some]), point[some]
        cell = self.cells.nearest(states)
        good = self.cells.hold(states, own.index[some], cell)
        new = Found(
            states[good], point[good], self.cells.numbers[cell[good]], np.zeros(good.sum(), bool)
        )
        return unite(self.cells, found, new)

    @cached_property
    def _longest(self) -> float:
        return REACH * float(self.cells.sizes.max())

    def _predict(self, points: Points) -> tuple[Numbers, Numbers, Places, _Bend]:
        """Points with a pair near by, rows of the states it is predicted from, the steps; all."""
        scaled, starts = points / self.cells.ranges, min(STARTS, len(self.vertices))
        rows, whole = self._singular(self._tree.query(scaled, k=np.arange(1, starts + 1))[1])
        numbers = whole.values, whole.slope, whole.normal, whole.least, whole.null, whole.curvature
        point, row, steps = predicted_pairs(scaled, rows, *numbers, NEIGHBOURS, self._longest)
        return point, row, steps, whole


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
    return SingularPairs(cells, vertices) if len(vertices) else None


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
