"""Where two sheets approach each other inside a grid cell, and where they are nearest.

The edges of a cell do not show what happens inside. Where two sheets meet at a fold their squared
distance D is a smooth function of the parameters beyond the fold, too, where it is negative. Over
each cell it is modelled from its values and slopes at the corners; where the model has a deep
minimum, the sheets may meet inside: Newton's method finds the stationary point.

See docs/decisions.md, "Approaching sheets are followed to where they are nearest".
"""

from dataclasses import dataclass

import numpy as np

from equimorph.arrays import Flags, Float, Int, Lanes, Places, Some, Values
from equimorph.columns import Columns
from equimorph.equilibria.critical import null_border
from equimorph.linalg.dense import multiply
from equimorph.linalg.lanes import over_lanes
from equimorph.manifold.geometry.crossings import Reduction, reduction
from equimorph.manifold.geometry.points import Points
from equimorph.manifold.geometry.quadratics import least_in_simplex, monomials
from equimorph.manifold.geometry.setting import Setting, embed
from equimorph.manifold.geometry.topology import places_among
from equimorph.manifold.lifting.cells import Cells
from equimorph.manifold.lifting.kernels import slope_squares, square_gaps
from equimorph.manifold.lifting.pairing import Pairing
from equimorph.tolerances import SAME_STATE

ITERATIONS = 20
"""Of Newton's method, at most."""
LONGEST = 0.5
"""Length of a step in barycentric coordinates to which it is shortened."""
CONVERGED = 1e-7
"""Length of the last step in barycentric coordinates."""
FLAT = 1e-4
"""Curvature of the squared distance, relative to the largest one, below which a direction is a
valley, along which no stationary point is sought."""
OUTSIDE = -0.02
"""Barycentric coordinate down to which a point counts as inside its cell."""
FARTHEST = 2.0
"""Barycentric coordinate, and distance relative to that of the points around the guess, beyond
which Newton's method is given up: the point is elsewhere, or on other sheets."""


Corners = Int[np.ndarray, "n corners"]
Shares = Float[np.ndarray, "n corners"]


@dataclass(frozen=True)
class Starts(Columns):
    """Guesses in grid cells.

    cell: grid cells; corners: of these, in free parameters; shares: barycentric coordinates of the
    guesses; z: states there, between the two sheets; reach: distance to the farthest of the points
    of these sheets from which they were made.
    """

    cell: Some
    corners: Float[np.ndarray, "n corners d"]
    shares: Shares
    z: Lanes
    reach: Values

    @classmethod
    def between(
        cls, pairing: Pairing, cell: Some, shares: Shares, z: Lanes, points: Int[np.ndarray, "n k"]
    ) -> "Starts":
        """Guesses between some points each."""
        mesh, setting, store = pairing.mesh, pairing.setting, pairing.points
        corners = mesh.vertices[mesh.cells[cell]]
        place = embed(setting, z, setting.parameters(np.einsum("nc,ncd->nd", shares, corners)))
        reach = np.zeros(len(cell))
        for own in points.T:
            gap = np.linalg.norm(embed(setting, store.z[own], store.p[own]) - place, axis=1)
            np.maximum(reach, gap, out=reach)
        return cls(cell, corners, shares, z, reach)


@dataclass(frozen=True)
class Stationary:
    """Stationary points: free parameters, squared distance of the two states in the metric there.

    The squared distance is negative where there are none. inside: whether they were found, in
    their cells; lost: whether Newton's method did not end, but stayed in the cell; pointed: whether
    the squared distance is curved in all directions there, as it is not where sheets cross.
    """

    place: Places
    squared: Values
    inside: Flags
    lost: Flags
    pointed: Flags

    @property
    def touching(self) -> Flags:
        """Where the two states are one, as far as states can be told apart, in one point only."""
        small = np.abs(self.squared) <= SAME_STATE**2
        return np.asarray(self.inside & small & self.pointed)

    @property
    def parted(self) -> Flags:
        """Where there are two states."""
        return np.asarray(self.inside & (self.squared > SAME_STATE**2))

    @property
    def none(self) -> Flags:
        """Where there are no states."""
        return np.asarray(self.inside & (self.squared < -(SAME_STATE**2)))


@np.errstate(over="ignore", invalid="ignore")  # lanes that diverge are given up
def stationary_points(setting: Setting, starts: Starts, *, saddles: bool) -> Stationary:
    """Stationary points of the squared distance: its minima, or saddles as well.

    This is no corrector onto F = 0: no state need exist there, and the curvature of the distance
    tells at each step in which directions it is made stationary.
    """
    structure, count = setting.structure, len(starts.cell)
    edges = np.zeros((count, len(setting.free), len(setting.base)))
    edges[:, :, setting.free] = starts.corners[:, 1:] - starts.corners[:, :1]
    z, shares = starts.z.copy(), starts.shares.copy()
    p = setting.parameters(np.einsum("nc,ncd->nd", shares, starts.corners))
    b, start = null_border(structure, z, p), embed(setting, z, p)
    squared, lanes = np.full(count, np.nan), np.arange(count)
    ended, lost, pointed = np.zeros((3, count), bool)
    for _ in range(ITERATIONS):
        known = reduction(structure, z[lanes], p[lanes], b[lanes], edges[lanes])
        newton = _newton_step(structure.mass, known, saddles=saddles)
        squared[lanes], pointed[lanes], step = newton.squared, newton.pointed, newton.step
        # onto states of F + rb = 0, and along them; with the border of the null vector there
        z[lanes] += known.remainder + np.einsum("nk,nki->ni", step, known.along_z)
        p[lanes] += np.einsum("nk,nki->ni", step[:, 1:], edges[lanes])
        b[lanes] = known.along_z[:, 0] / np.linalg.norm(known.along_z[:, 0], axis=1, keepdims=True)
        shares[lanes, 1:] += step[:, 1:]
        shares[lanes, 0] -= step[:, 1:].sum(axis=1)
        length = np.linalg.norm(step[:, 1:], axis=1)
        away = np.linalg.norm(embed(setting, z[lanes], p[lanes]) - start[lanes], axis=1)
        near = away < FARTHEST * starts.reach[lanes]
        ended[lanes] = near & (length < CONVERGED)
        going = near & (length >= CONVERGED) & (np.abs(shares[lanes]).max(axis=1) < FARTHEST)
        lanes = lanes[going & np.isfinite(squared[lanes])]
        if len(lanes) == 0:
            break
    within = (shares >= OUTSIDE).all(axis=1)
    lost[lanes] = True
    return Stationary(p[:, setting.free], squared, ended & within, lost & within, pointed)


@dataclass(frozen=True)
class _Newton:
    """Squared distances, whether they are curved in all directions, and Newton steps (ξ, π)."""

    squared: Values
    pointed: Flags
    step: Float[np.ndarray, "lanes k1"]


@np.errstate(
    divide="ignore", over="ignore", invalid="ignore"
)  # no second derivative along the null vector
def _newton_step(
    mass: Float[np.ndarray, " unknowns"], known: Reduction, *, saddles: bool
) -> _Newton:
    """Newton steps to where the squared distance is stationary in the parameters.

    With the reduced equation r(ξ, π) = 0 of two sheets, r = ρ(π) + ½ a (ξ − ξ₀(π))² up to higher
    order, so that their amplitudes differ by 2 √(−2ρ/a).
    """
    gradient, hessian = known.gradient, known.hessian
    bend, mixed = hessian[:, 0, 0], hessian[:, 0, 1:]
    level = known.value - 0.5 * gradient[:, 0] ** 2 / bend
    null = known.along_z[:, 0, : len(mass)]
    factor = -8.0 * (multiply(null**2, mass)) / bend
    slope = factor[:, None] * (gradient[:, 1:] - mixed * (gradient[:, 0] / bend)[:, None])
    curvature = hessian[:, 1:, 1:] - mixed[:, :, None] * mixed[:, None] / bend[:, None, None]
    values, vectors = np.linalg.eigh(np.nan_to_num(factor[:, None, None] * curvature))
    curved = np.abs(values) > FLAT * np.abs(values).max(axis=1, keepdims=True)
    large = curved if saddles else curved & (values > 0.0)
    along = np.einsum("nji,nj->ni", vectors, slope)
    amount = np.where(large, -along / np.where(large, values, 1.0), 0.0)
    move = np.einsum("nij,nj->ni", vectors, amount)
    length = np.linalg.norm(move, axis=1, keepdims=True)
    move *= np.minimum(1.0, LONGEST / np.maximum(length, 1e-300))
    amplitude = -(gradient[:, 0] + (mixed * move).sum(axis=1)) / bend
    step = np.concatenate([amplitude[:, None], move], axis=1)
    return _Newton(factor * level, curved.all(axis=1), step)


DEEP = 0.25
"""Share of the least squared distance at the corners below which a minimum inside is followed."""
VARYING = 1.5
"""Ratio of the largest squared distance around a cell to the least in it below which the sheets do
not approach each other."""
MOST = 0.5
"""Share of the cells that must be looked at for their surroundings to tell."""


@dataclass(frozen=True)
class _Pairs(Columns):
    """Pairs of sheets over grid cells: their points over the corners, in the same order."""

    cell: Some
    one: Corners
    other: Corners


def approaches(pairing: Pairing, cells: Cells, wanted: Flags) -> Starts:
    """Where pairs of plain sheets may be nearest inside the flagged grid cells."""
    pairs = _pairs(pairing, cells, np.flatnonzero(wanted))
    over = _Corners.of(pairing.points, pairs)
    if wanted.mean() > MOST:  # else the cells around are not known
        pairs, over = over.varying(pairs)
    ratio, shares = _models(pairing, pairs, over)
    deep = np.flatnonzero(ratio < DEEP)
    pairs, shares = pairs.take(deep), shares[deep]
    middle = 0.5 * (pairing.points.z[pairs.one] + pairing.points.z[pairs.other])
    z = np.einsum("nc,nci->ni", shares, middle)
    both = np.concatenate([pairs.one, pairs.other], axis=1)
    return Starts.between(pairing, pairs.cell, shares, z, both)


@dataclass(frozen=True)
class _Corners:
    """Pairs of points over grid vertices, each once, with their squared distance.

    place: numbers of the pairs of points over the corners of each pair of sheets.
    """

    one: Some
    other: Some
    squared: Values
    place: Corners

    @classmethod
    def of(cls, points: Points, pairs: _Pairs) -> "_Corners":
        """Number the pairs of points."""
        keys, place = np.unique(pairs.one * points.count + pairs.other, return_inverse=True)
        one, other = np.divmod(keys, points.count)
        squared = np.empty(len(keys))
        over_lanes(square_gaps, (points.structure.mass, points.z), (one, other), (squared,))
        return cls(one, other, squared, place.reshape(pairs.one.shape))

    def varying(self, pairs: _Pairs) -> tuple[_Pairs, "_Corners"]:
        """Pairs of sheets whose distance varies enough around their cells to vanish inside."""
        corners, around = np.ascontiguousarray(self.place.T), self.squared.copy()
        squared = self.squared[corners]
        largest = squared.max(axis=0)
        for corner in corners:
            np.maximum.at(around, corner, largest)
        kept = np.flatnonzero(around[corners].max(axis=0) > VARYING * squared.min(axis=0))
        used, place = np.unique(self.place[kept], return_inverse=True)
        columns = (self.one[used], self.other[used], self.squared[used])
        return pairs.take(kept), _Corners(*columns, place.reshape(-1, self.place.shape[1]))


def _models(pairing: Pairing, pairs: _Pairs, over: _Corners) -> tuple[Values, Shares]:
    """Least value of the model of D in each cell over that at the corners, and where it is."""
    mesh, d = pairing.mesh, pairing.mesh.dimension
    slope = _slopes(pairing, over)
    corners = mesh.vertices[mesh.cells[pairs.cell]]
    along = np.einsum("ncd,nkd->nck", slope[over.place], corners[:, 1:] - corners[:, :1])
    squared = over.squared[over.place]
    data = np.concatenate([squared, along.reshape(len(along), (d + 1) * d)], axis=1)
    least, shares = least_in_simplex(data @ np.linalg.pinv(_data(d)).T, d)
    return least / np.maximum(squared.min(axis=1), 1e-300), shares


def _slopes(pairing: Pairing, over: _Corners) -> Places:
    """Derivatives of the squared distances with respect to the free parameters."""
    setting, points, slopes = pairing.setting, pairing.points, pairing.slopes
    slopes.fit(setting, points, np.union1d(over.one, over.other))
    out = np.empty((len(over.one), len(setting.free)))
    over_lanes(
        slope_squares,
        (setting.structure.mass, points.z, slopes.tangents),
        (over.one, over.other),
        (out,),
    )
    return out


def _pairs(pairing: Pairing, cells: Cells, wanted: Some) -> _Pairs:
    """Pairs of plain sheets over the same grid cell whose indices differ by one."""
    mesh, points = pairing.mesh, pairing.points
    grid, base = np.sort(mesh.cells[wanted], axis=1), len(mesh.vertices)
    below = np.zeros(base + 1, bool)
    below[grid] = True  # −1, where a corner lies over no vertex, stays false
    vertex = points.vertex[cells.corners]
    plain = np.flatnonzero(below[vertex].all(axis=1))
    vertex = vertex.take(plain, axis=0)
    order = np.argsort(vertex, axis=1)
    owner = places_among(np.take_along_axis(vertex, order, axis=1), grid, base)
    good = np.flatnonzero(owner >= 0)
    good = good[np.argsort(owner[good], kind="stable")]
    rows, owner, order = plain[good], owner[good], order.take(good, axis=0)
    corners = np.take_along_axis(cells.corners.take(rows, axis=0), order, axis=1)
    index, sheets = cells.index[rows], np.bincount(owner, minlength=len(grid))
    ones, others = [np.zeros(0, int)], [np.zeros(0, int)]
    for shift in range(1, int(sheets.max(initial=0))):
        same = owner[:-shift] == owner[shift:]
        first = np.flatnonzero(same & (np.abs(index[:-shift] - index[shift:]) == 1))
        ones.append(first)
        others.append(first + shift)
    one, other = np.concatenate(ones), np.concatenate(others)
    # corners in the order of the grid cell, in which shares are counted
    cell = wanted[owner[one]]
    order = np.argsort(mesh.cells.take(cell, axis=0), axis=1)
    pairs = np.empty((2, *order.shape), int)
    for own, rows in zip(pairs, (one, other), strict=True):
        np.put_along_axis(own, order, corners.take(rows, axis=0), axis=1)
    return _Pairs(cell, *pairs)


def _data(d: int) -> Float[np.ndarray, "data terms"]:
    """What quadratic polynomials have at the corners of a simplex, by their terms.

    Their values there, then their slopes at each corner along the edges from the first one.
    """
    corners = np.concatenate([np.zeros((1, d)), np.eye(d)])
    # central differences of quadratic polynomials are exact
    ahead, behind = (
        [monomials(corner + sign * np.eye(d)) for corner in corners] for sign in (1.0, -1.0)
    )
    slopes = 0.5 * (np.concatenate(ahead) - np.concatenate(behind))
    return np.concatenate([monomials(corners), slopes])
