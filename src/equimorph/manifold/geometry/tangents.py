"""Tangent spaces of the set at its vertices, folds to second order, and how far edges are off."""

from dataclasses import dataclass
from functools import cached_property
from itertools import combinations

import numpy as np

from equimorph.arrays import (
    CellNumbers,
    Cells,
    Flags,
    Float,
    Frames,
    Items,
    Lanes,
    Parameters,
    Places,
    Rows,
    Values,
    VertexFlags,
)
from equimorph.columns import Columns
from equimorph.equilibria.critical import Critical, null_border
from equimorph.equilibria.newton_step import free_directions, weights_of
from equimorph.equilibria.point_conditions import second_derivatives
from equimorph.linalg import Border, orthonormal_rows
from equimorph.manifold.geometry.setting import Setting, embed
from equimorph.manifold.geometry.simplices import squared_sides
from equimorph.model import worst_excess
from equimorph.structures import LinearSystem
from equimorph.structures.metric import metric_coordinates, products_with
from equimorph.tolerances import METRIC_DIFFERENCE

CHUNK = 2048
"""Points whose tangent spaces are computed together: this bounds the memory."""
BEYOND = 1e9
"""Largest excess over a constraint that differences are taken of."""
S_SHAPE = 0.1
"""Farthest a cubic whose slopes at both ends are the same leaves its chord: √3/18, in slopes."""


def tangent_frames(setting: Setting, z: Lanes, p: Parameters, rows: Rows) -> Frames:
    """Orthonormal bases of the tangent spaces at points of the set, regular at folds, too.

    ``[F_z F_p; R] t_i = (0, e_i)`` with rows R of the embedding that span nearby spaces, whose
    orientation the bases take over.
    """
    frames = np.empty((*rows.shape[:2], z.shape[1] + rows.shape[1]))
    for at in range(0, len(z), CHUNK):
        own = slice(at, at + CHUNK)
        frames[own] = InPlanes(setting, z[own], p[own], rows[own]).frames
    return frames


@dataclass(frozen=True)
class InPlanes:
    """Points of the set, with rows of the embedding that span spaces near the tangent spaces."""

    setting: Setting
    z: Lanes
    p: Parameters
    rows: Rows

    @cached_property
    def _solver(self) -> tuple[LinearSystem, Border]:
        """F_z and F_p at the points, bordered by the rows."""
        structure, free = self.setting.structure, self.setting.free
        directions = free_directions(structure, free, len(self.z))
        system = structure.linear_system(self.z, self.p, directions)
        by_z = products_with(structure, self.rows)
        return system, (system.columns, by_z, self.rows[:, :, structure.unknowns :])

    def _solve(
        self, rhs: Float[np.ndarray, "lanes sides full"]
    ) -> Float[np.ndarray, "lanes sides full"]:
        system, border = self._solver
        return system.solve(rhs, border).x

    @property
    def frames(self) -> Frames:
        """Orthonormal bases of the tangent spaces, as `tangent_frames`."""
        (lanes, size), d = self.z.shape, len(self.setting.free)
        rhs = np.zeros((lanes, d, size + d))
        rhs[:, :, size:] = np.eye(d)
        return orthonormal_rows(self._solve(rhs), d, weights_of(self.setting.structure, size + d))

    def bend_along(self, step: Float[np.ndarray, "lanes full"]) -> Float[np.ndarray, "lanes full"]:
        """Second derivative, orthogonal to the rows, of the set along tangents.

        ``[F_z F_p; R] b = (−D²F[t, t], 0)``: to second order the set is at ``z + h t + h² b/2``.
        """
        along, rhs = split_step(self.setting, step), np.zeros((len(step), 1, step.shape[1]))
        twice = self.setting.structure.second_derivative(self.z, self.p, along, along)
        np.negative(twice, out=rhs[:, 0, : self.z.shape[1]])
        return self._solve(rhs)[:, 0]


def frames_in_embedding(setting: Setting, frames: Frames) -> Rows:
    """Bases of tangent spaces in the coordinates of the embedding."""
    u = metric_coordinates(setting.structure, frames)
    return np.concatenate([u, frames[:, :, frames.shape[2] - len(setting.free) :]], axis=2)


def split_step(setting: Setting, step: Float[np.ndarray, "lanes full"]) -> tuple[Lanes, Parameters]:
    """Changes of z and of all parameters of a step along a tangent space."""
    d = len(setting.free)
    dp = np.zeros((len(step), len(setting.base)))
    dp[:, setting.free] = step[:, step.shape[1] - d :] * setting.scales
    return np.ascontiguousarray(step[:, : step.shape[1] - d]), dp


def fold_slopes(
    setting: Setting, z: Lanes, p: Parameters, frames: Frames, border: Lanes | None = None
) -> Float[np.ndarray, "lanes d"]:
    """Slope along the frame of the function that vanishes on folds.

    border: null vectors, if they are known.
    """
    border = null_border(setting.structure, z, p) if border is None else border
    critical = Critical(setting.structure, z, p, border)
    steps = [split_step(setting, frames[:, k]) for k in range(frames.shape[1])]
    return second_derivatives(critical, [(critical.v, np.zeros_like(p))], steps)[:, 0]


def cap_slopes(
    setting: Setting, z: Lanes, p: Parameters, frames: Frames
) -> Float[np.ndarray, "lanes d"]:
    """Slope along the frame of the largest excess over the constraints."""

    def worst(sign: float, k: int) -> Values:
        dz, dp = split_step(setting, sign * METRIC_DIFFERENCE * frames[:, k])
        # beyond a barrier of a reduction the excess is infinite
        return np.asarray(
            np.clip(worst_excess(setting.constraints, z + dz, p + dp), -BEYOND, BEYOND)
        )

    slopes = [worst(1.0, k) - worst(-1.0, k) for k in range(frames.shape[1])]
    return np.stack(slopes, axis=1) / (2.0 * METRIC_DIFFERENCE)


def cap_normals(setting: Setting, z: Lanes, p: Parameters) -> Places:
    """Slopes of the largest excess over the constraints along the scaled free parameters."""
    n, d = setting.structure.unknowns, len(setting.free)
    rows = np.zeros((len(z), d, n + d))
    rows[:, :, n:] = np.eye(d)
    frames = tangent_frames(setting, z, p, rows)
    slopes = cap_slopes(setting, z, p, frames)
    return np.asarray(np.linalg.solve(frames[:, :, -d:], slopes[:, :, None])[:, :, 0])


@dataclass(frozen=True)
class Ends(Columns):
    """One end of edges: its point, tangent space, and the slopes of what must stay zero on them."""

    place: Float[np.ndarray, "edges coordinates"]
    rows: Rows
    slopes: Float[np.ndarray, "edges m d"]

    def along(self, chord: Float[np.ndarray, "edges coordinates"]) -> Float[np.ndarray, "edges d"]:
        """Coordinates, in the frame, of the tangent vector that a chord is nearest to.

        As long as the chord.
        """
        flat = self.nearest(chord)
        length = np.linalg.norm(flat, axis=1)
        share = np.linalg.norm(chord, axis=1) / np.maximum(length, 1e-300)
        # where chord and tangent space are far apart, the vector stays short
        return np.asarray(flat * np.minimum(share, 2.0)[:, None])

    def nearest(
        self, chord: Float[np.ndarray, "edges coordinates"]
    ) -> Float[np.ndarray, "edges d"]:
        """Orthogonal projections of chords, in the frame."""
        flat = np.einsum("edc,ec->ed", self.rows, chord)
        if self.slopes.shape[1]:
            basis = self.allowed
            flat = np.einsum("edk,ek->ed", basis, np.einsum("edk,ed->ek", basis, flat))
        return np.asarray(flat)

    @property
    def allowed(self) -> Float[np.ndarray, "edges d k"]:
        """Orthonormal directions in the frame along which the conditions stay zero."""
        m = self.slopes.shape[1]
        columns = np.swapaxes(self.slopes, 1, 2)
        return np.asarray(np.linalg.qr(columns, mode="complete")[0][:, :, m:])


@dataclass(frozen=True)
class Cubics:
    """Curves over edges that touch the tangent spaces at both ends.

    They leave the chord c by ``t(1 − t)² n₀ − t²(1 − t) n₁`` with nᵢ = tᵢ − c: in the middle by
    (n₀ − n₁)/8.
    """

    first: Ends
    second: Ends

    @property
    def error(self) -> Float[np.ndarray, " edges"]:
        """How far the curves are from their chords."""
        chord = self.second.place - self.first.place
        off_a, off_b = (
            np.einsum("ed,edc->ec", end.along(chord), end.rows) - chord
            for end in (self.first, self.second)
        )
        middle = np.linalg.norm(off_a - off_b, axis=1) / 8.0
        slope = np.maximum(np.linalg.norm(off_a, axis=1), np.linalg.norm(off_b, axis=1))
        return np.asarray(np.maximum(middle, S_SHAPE * slope))


def best_corners(
    setting: Setting,
    z: Lanes,
    p: Parameters,
    cells: Cells,
    signs: CellNumbers | None = None,
    some: VertexFlags | None = None,
) -> Float[np.ndarray, "some d coordinates"]:
    """Orthonormal bases of the planes of the cell around each vertex that is the least slender.

    Oriented as the cells are with the given signs, if these matter. `some`: vertices for which they
    are needed; all of the cells if None.
    """
    place = embed(setting, z, p)
    if some is not None:
        around = some[cells].any(axis=1)
        cells, signs = cells[around], None if signs is None else signs[around]
    corners, count = cells.shape[1], len(cells)
    owner = cells.T.ravel()
    breadth = _breadths(place, cells).T.ravel()
    order = np.lexsort((-breadth, owner))
    first = order[np.diff(owner[order], prepend=-1) > 0]
    first = first if some is None else first[some[owner[first]]]
    corner, cell = np.divmod(first, count)
    others = np.stack([np.delete(np.arange(corners), k) for k in range(corners)])[corner]
    sides = place[cells[cell[:, None], others]] - place[cells[cell, corner]][:, None]
    sides /= np.maximum(np.linalg.norm(sides, axis=2, keepdims=True), 1e-300)
    basis, share = np.linalg.qr(np.swapaxes(sides, 1, 2))
    if signs is None:
        return np.ascontiguousarray(np.swapaxes(basis, 1, 2))
    turned = np.linalg.det(share) * signs[cell] * (-1) ** corner < 0
    basis[turned, :, 0] *= -1.0
    return np.ascontiguousarray(np.swapaxes(basis, 1, 2))


def _breadths(
    place: Float[np.ndarray, "V coordinates"], cells: Cells
) -> Float[np.ndarray, "C corners"]:
    """How far the sides from each corner are from dependent: the determinant of their cosines."""
    corners = cells.shape[1]
    pairs = list(combinations(range(corners), 2))
    squared = squared_sides(place, cells)
    length = np.zeros((len(cells), corners, corners))
    for (i, j), own in zip(pairs, squared.T, strict=True):
        length[:, i, j] = length[:, j, i] = own
    out = np.empty((len(cells), corners))
    for k in range(corners):
        rest = np.delete(np.arange(corners), k)
        own = np.maximum(length[:, k, rest], 1e-150)
        inner = length[:, rest[:, None], rest]
        cosines = 0.5 * (own[:, :, None] + own[:, None, :] - inner)
        cosines /= np.sqrt(own[:, :, None] * own[:, None, :])
        out[:, k] = np.linalg.det(cosines)
    return out


@dataclass(frozen=True)
class FoldForms:
    """Coefficients of ``φᵀF_p δp + ½ φᵀF_zz[φ, φ] ξ² = 0``, the set near folds.

    null: φ, of either sign; slope: φᵀF_p along the scaled free parameters; bend: φᵀF_zz[φ, φ].
    """

    null: Lanes
    slope: Places
    bend: Values

    @property
    def existence(self) -> Places:
        """Vectors, in scaled free parameters, towards the side of a fold where sheets exist.

        They are continuous along a fold and turn round only at a cusp.
        """
        return np.asarray(-self.slope * np.sign(self.bend)[:, None])

    def parted_by_cusps(self, one: Items, other: Items) -> Flags:
        """Whether an odd number of cusps lies between points of a fold, given by number."""
        sense = (self.null[one] * self.null[other]).sum(axis=1) * self.bend[one] * self.bend[other]
        return np.asarray(sense < 0.0)


def fold_forms(setting: Setting, z: Lanes, p: Parameters) -> FoldForms:
    """Coefficients at points on folds."""
    structure, free = setting.structure, setting.free
    phi = null_border(structure, z, p)
    none = np.zeros_like(p)
    bend = np.einsum("li,li->l", phi, structure.second_derivative(z, p, (phi, none), (phi, none)))
    slope = np.empty((len(z), len(free)))
    for k in range(len(free)):
        dp = np.zeros_like(p)
        dp[:, free[k]] = setting.scales[k]
        slope[:, k] = np.einsum("li,li->l", phi, structure.parameter_derivative(z, p, dp))
    return FoldForms(phi, slope, bend)


def fold_rows(setting: Setting, forms: FoldForms) -> Rows:
    """Tangent spaces at points on folds: along null vectors, and along folds in the parameters."""
    (lanes, d), n = forms.slope.shape, setting.structure.unknowns
    rows = np.zeros((lanes, d, n + d))
    rows[:, 0, :n] = metric_coordinates(setting.structure, forms.null)
    rows[:, 1:, n:] = np.linalg.svd(forms.slope[:, None])[2][:, 1:]
    rows[:, 0] /= np.linalg.norm(rows[:, 0], axis=1, keepdims=True)
    return rows
