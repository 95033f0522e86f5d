"""Points on an equilibrium set, its folds, sides of its box and its caps, and moves on these."""

from dataclasses import dataclass

import numpy as np

from equimorph.arrays import Flags, Float, Int, Items, Lanes, Pairs, Parameters, Rows, Some
from equimorph.columns import Columns
from equimorph.manifold.complex.equilibrium_set import EquilibriumSet
from equimorph.manifold.complex.kept_tables import kept
from equimorph.manifold.geometry.exact_points import Aim, correct_points
from equimorph.manifold.geometry.setting import Setting, embed
from equimorph.manifold.geometry.tangents import (
    best_corners,
    cap_slopes,
    fold_slopes,
    frames_in_embedding,
    split_step,
    tangent_frames,
)

Frames = Float[np.ndarray, "lanes k full"]

FAR = 1e3
"""Distance from its guess within which any corrected point will do."""


@dataclass(frozen=True)
class SetPoints(Columns):
    """Points of a set, with bases of spaces near their tangent spaces."""

    z: Lanes
    p: Parameters
    rows: Rows

    def __len__(self) -> int:
        """Number of points."""
        return len(self.z)


@kept
def _corners(
    eset: EquilibriumSet,
) -> tuple[Int[np.ndarray, " corners"], Int[np.ndarray, " starts"]]:
    """Corners of all cells by vertex, and where those of each vertex begin."""
    flat = eset.cells.ravel()
    order = np.argsort(flat, kind="stable")
    return order, np.searchsorted(flat[order], np.arange(len(eset.points) + 1))


def cells_around(eset: EquilibriumSet, vertices: Items) -> Some:
    """Numbers of the cells with one of a few vertices."""
    order, begin = _corners(eset)
    parts = [order[begin[each] : begin[each + 1]] for each in vertices.tolist()]
    return np.unique(np.concatenate([np.zeros(0, int), *parts]) // eset.cells.shape[1])


def points_at_vertices(eset: EquilibriumSet, vertices: Items) -> SetPoints:
    """Vertices of a set, with the planes of cells around them."""
    around = eset.cells[cells_around(eset, vertices)]
    used, corners = np.unique(around, return_inverse=True)
    near = eset.points[used]
    rows = best_corners(eset.setting, near.z, near.p, corners.reshape(around.shape))
    place = np.searchsorted(used, vertices)
    return SetPoints(near.z[place], near.p[place], rows[place])


def local_minima(pairs: Pairs, value: Float[np.ndarray, " V"]) -> Some:
    """Vertices of some edges that no neighbour beats, the least first."""
    least = np.full(len(value), np.inf)
    for one, other in (pairs.T, pairs.T[::-1]):
        np.minimum.at(least, one, value[other])
    minima = np.flatnonzero(np.isfinite(least) & (value <= least))
    return np.asarray(minima[np.argsort(value[minima], kind="stable")])


@dataclass(frozen=True)
class Ground:
    """A set, or its part on folds, on sides of its box and on its constraints."""

    setting: Setting
    """Of the set."""
    eset: EquilibriumSet
    """The set; its box bounds the search."""
    fold: bool = False
    """Whether only folds count."""
    sides: tuple[int, ...] = ()
    """Places, among the free parameters, of those that keep their values: sides of the box."""
    cap: bool = False
    """Whether only states at which a constraint is active count."""

    def frames(self, spot: SetPoints) -> tuple[Frames, Rows]:
        """Orthonormal directions along which points may move, and bases of the tangent spaces."""
        frames = tangent_frames(self.setting, spot.z, spot.p, spot.rows)
        rows = frames_in_embedding(self.setting, frames)
        slopes = [
            *([fold_slopes(self.setting, spot.z, spot.p, frames)] if self.fold else []),
            *(free_steps(self.setting, frames)[:, :, side] for side in self.sides),
            *([cap_slopes(self.setting, spot.z, spot.p, frames)] if self.cap else []),
        ]
        if slopes:
            basis = np.linalg.qr(np.stack(slopes, axis=2), mode="complete")[0][:, :, len(slopes) :]
            frames = np.einsum("ldk,ldf->lkf", basis, frames)
        return frames, rows

    def move(
        self, spot: SetPoints, frames: Frames, step: Float[np.ndarray, "lanes k"]
    ) -> tuple[SetPoints, Flags]:
        """Points of the set orthogonally above steps, and whether there are any in the box."""
        dz, dp = split_step(self.setting, np.einsum("lk,lkf->lf", step, frames))
        rows = frames_in_embedding(self.setting, frames)
        there, good = self.project(SetPoints(spot.z + dz, spot.p + dp, rows))
        return SetPoints(there.z, there.p, spot.rows), good

    def project(self, spot: SetPoints) -> tuple[SetPoints, Flags]:
        """Points of the set orthogonally above points, and whether there are any in the box."""
        lanes, d = len(spot.z), len(self.setting.free)
        span = np.tile(np.delete(np.eye(d), self.sides, axis=0), (lanes, 1, 1))
        middle = embed(self.setting, spot.z, spot.p)
        aim = Aim(self.setting, self.fold, self.cap, span, middle, spot.rows)
        pinned = correct_points(aim, spot.z, spot.p, np.full(lanes, FAR))
        good = pinned.found & self.eset.box.holds(pinned.p[:, self.setting.free], slack=1e-9)
        return SetPoints(pinned.z, pinned.p, spot.rows), good


def free_steps(setting: Setting, frames: Frames) -> Float[np.ndarray, "lanes k d"]:
    """Steps of the free parameters along frames, in their scales."""
    return frames[:, :, frames.shape[2] - len(setting.free) :]
