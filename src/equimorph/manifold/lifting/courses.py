"""Curves that pass grid triangles, from a point on one of their sides to a point on another.

Folds and crossings of sheets are known with their tangents there. Barycentric coordinates serve
over two parameters, and on the faces of tetrahedra; angles are those in a triangle with equal
sides, so that they do not depend on the scales of the parameters.
"""

from dataclasses import dataclass

import numpy as np

from equimorph.arrays import Flags, Float, Items, Pairs, Some, Values
from equimorph.columns import Columns
from equimorph.manifold.complex.base_mesh import BaseMesh
from equimorph.manifold.geometry.simplices import shares_in
from equimorph.manifold.lifting.grid import NEAR_AN_END
from equimorph.manifold.lifting.pairing import Pairing

STRAIGHT = 0.1
"""Least mean of one and the cosine between a curve and its chord by which slopes are divided."""
FIRST = 0.1
"""Part of a side up to which it is split at first, if it is to be split nearer to an end."""
PLACES = 9
"""Places along a curve at which its distance from a side is taken."""
EQUILATERAL = np.array([[0.0, 0.0], [1.0, 0.0], [0.5, np.sqrt(0.75)]])
"""Corners of a triangle with equal sides."""

Shares = Float[np.ndarray, "n 3"]
BothShares = Float[np.ndarray, "n 2 3"]


@dataclass(frozen=True)
class Courses(Columns):
    """Curves from one side of a triangle to another, in barycentric coordinates.

    shares: of both ends; rates: their change along the curves, into the triangles; third: number
    of the corner opposite the side on which no end lies.
    """

    shares: BothShares
    rates: BothShares
    third: Items

    @classmethod
    def of(
        cls, pairing: Pairing, ends: Pairs, triangle: Some, normals: Float[np.ndarray, "n 2 d"]
    ) -> "Courses":
        """Curves by their normals, in scaled free parameters."""
        mesh, setting = pairing.mesh, pairing.setting
        corners = mesh.vertices[mesh.triangles[triangle]] / setting.scales
        places = pairing.points.p[ends][..., setting.free] / setting.scales
        shares = np.stack([shares_in(corners, places[:, k]) for k in range(2)], axis=1)
        across = np.einsum("nkd,nsd->nsk", corners[:, 1:] - corners[:, :1], normals)
        along = np.stack([-across[..., 1], across[..., 0]], axis=-1)
        rates = np.concatenate([-along.sum(axis=-1, keepdims=True), along], axis=-1)
        own = shares.argmin(axis=-1)
        rates *= np.copysign(1.0, np.take_along_axis(rates, own[..., None], axis=-1))
        return cls(shares, rates, (3 - own.sum(axis=1)) % 3)

    @property
    def cosines(self) -> Float[np.ndarray, "n 2"]:
        """Cosines of the angles to the chords, of curves that lead in at first, and then out."""
        chord, length = self._chords
        along = self.rates @ EQUILATERAL * np.array([[1.0], [-1.0]])
        scale = np.linalg.norm(along, axis=-1) * length[:, None]
        return np.asarray(np.einsum("nsk,nk->ns", along, chord) / np.maximum(scale, 1e-300))

    @property
    def _chords(self) -> tuple[Float[np.ndarray, "n 2"], Values]:
        """Chords in a triangle with equal sides, and their lengths."""
        chord = (self.shares[:, 1] - self.shares[:, 0]) @ EQUILATERAL
        return chord, np.linalg.norm(chord, axis=1)

    def lead_to(self, places: Shares) -> Flags:
        """Whether curves set out from both ends to places rather than away from them."""
        towards = (places[:, None] - self.shares) @ EQUILATERAL
        return np.asarray(((self.rates @ EQUILATERAL * towards).sum(axis=-1) > 0.0).all(axis=1))

    def nearest(self) -> tuple[Values, Shares]:
        """How near to their third sides cubics along the curves come, in their lengths; where.

        Infinite where an end is nearest. Slopes are those of arcs of circles.
        """
        _, length = self._chords
        size = np.linalg.norm(self.rates @ EQUILATERAL, axis=-1)
        size *= np.maximum(0.5 + 0.5 * self.cosines, STRAIGHT)
        slopes = self.rates * (length[:, None] / np.maximum(size, 1e-300))[..., None]
        t = np.linspace(0.0, 1.0, PLACES)[:, None, None]
        way = self.shares[:, 0] * (1.0 + 2.0 * t) * (1.0 - t) ** 2
        way = way + self.shares[:, 1] * (3.0 - 2.0 * t) * t**2
        way = way + t * (1.0 - t) * ((1.0 - t) * slopes[:, 0] + t * slopes[:, 1])
        off = np.take_along_axis(way, self.third[None, :, None], axis=2)[..., 0]
        least, every = off.argmin(axis=0), np.arange(len(length))
        gap = off[least, every] / np.maximum(length, 1e-300)
        inside = (least > 0) & (least < PLACES - 1)
        return np.where(inside, gap, np.inf), way[least, every]


@dataclass(frozen=True)
class WaysOut(Columns):
    """Where the tangents at both ends of chords lead out of their triangles.

    apexes (n, 2): number, in the triangle, of the corner opposite the side; starts, places
    (n, 2, 3): barycentric coordinates of both ends, and where they lead to.
    """

    apexes: Pairs
    starts: BothShares
    places: BothShares

    @property
    def together(self) -> Flags:
        """Whether both ways lead through one side."""
        return np.asarray(self.apexes[:, 0] == self.apexes[:, 1])

    @property
    def middle(self) -> Shares:
        """Barycentric coordinates of the middle between both places."""
        return np.asarray(self.places.mean(axis=1))

    @property
    def cross(self) -> Flags:
        """Whether both ways cross before they leave, if they do so through one side."""
        way = (self.places - self.starts) @ EQUILATERAL
        gaps = [(each[:, 1] - each[:, 0]) @ EQUILATERAL for each in (self.starts, self.places)]
        before, after = (way[:, 0, 0] * gap[:, 1] - way[:, 0, 1] * gap[:, 0] for gap in gaps)
        return np.asarray(before * after < 0.0)


def ways_out(
    pairing: Pairing,
    ends: Pairs,
    triangle: Some,
    normals: Float[np.ndarray, "n 2 d"],
) -> WaysOut:
    """Follow curves in the parameters straight from both their ends out of grid triangles.

    `normals` are those to the curves, in scaled free parameters.
    """
    courses = Courses.of(pairing, ends, triangle, normals)
    apexes, places = [], []
    for k in range(2):
        shares, rates = courses.shares[:, k], courses.rates[:, k]
        way = np.where(rates < 0.0, shares / np.where(rates < 0.0, -rates, 1.0), np.inf)
        # off the side on which the end lies
        np.put_along_axis(way, shares.argmin(axis=1)[:, None], np.inf, axis=1)
        apexes.append(way.argmin(axis=1))
        places.append(shares + way.min(axis=1, keepdims=True) * rates)
    return WaysOut(np.stack(apexes, axis=1), courses.shares, np.stack(places, axis=1))


def on_sides(mesh: BaseMesh, triangle: Some, apexes: Items, places: Shares) -> tuple[Items, Values]:
    """Sides of triangles opposite corners, and shares of the ways along them to places."""
    every = np.arange(len(triangle))
    first, last = (apexes + 1) % 3, (apexes + 2) % 3
    sides = mesh.sides[triangle, first]  # they are ab, bc, ca
    along = mesh.triangles[triangle, first] == mesh.edges[sides, 0]
    start, end = places[every, first], places[every, last]
    return sides, np.where(along, end, start) / (start + end)


def split_sides(mesh: BaseMesh, triangle: Some, ways: WaysOut) -> dict[int, float]:
    """Sides through which two ways lead together, with the part of the side in their middle.

    Where that is very near an end of the side, it is split farther away from it at first.
    """
    sides, shares = on_sides(mesh, triangle, ways.apexes[:, 0], ways.middle)
    inner = (shares > NEAR_AN_END) & (shares < 1.0 - NEAR_AN_END)
    shares = np.where(inner, shares, np.clip(shares, FIRST, 1.0 - FIRST))
    return dict(zip(sides.tolist(), shares.tolist(), strict=True))
