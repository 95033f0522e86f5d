"""States over points close to where two sheets cross: roots of one scalar equation.

There Newton's matrix is nearly singular, and states lie close together: Newton's method at fixed
parameters leads from every guess to any of them, and its corrections do not shrink to round-off.
With a border b the equations ``F = r b``, ``b·(z − z₀) = s`` stay regular, and all states near the
crossing point z₀ are the roots of r(s) [Govaerts2000]_.

At a distance δ from a pitchfork these are √δ apart, and r between them is of the size of δ^(3/2):
10⁻⁹ from that of an arch it is 5·10⁻¹⁶, and round-off in F, 10⁻¹⁶, would move roots by a tenth of
their distance. So r is integrated from the crossing point, where it vanishes. The round-off in its
derivatives counts only times the way.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.polynomial import chebyshev, legendre

from equimorph.arrays import (
    Cells,
    Facets,
    Flags,
    Float,
    Int,
    ItemValues,
    Lanes,
    Numbers,
    Places,
    Values,
)
from equimorph.columns import Columns
from equimorph.equilibria.critical import Critical, null_border
from equimorph.equilibria.hidden_events import multiplicity
from equimorph.equilibria.newton_step import Planes
from equimorph.equilibria.settle import Guards, Settled, lower_index, settle
from equimorph.manifold.geometry.exact_points import Aim, Pinned, correct_points
from equimorph.manifold.geometry.setting import Setting, embed
from equimorph.manifold.geometry.simplices import shares_in
from equimorph.manifold.geometry.topology import Adjacency, keys_of, rows_of
from equimorph.manifold.lookup.cell_index import Hits
from equimorph.structures import States, Structure
from equimorph.structures.metric import metric_length

Parameters = Float[np.ndarray, "_ P"]
Series = Float[np.ndarray, "coefficients lanes"]

NEAR = 1e-4
"""Distance of points from a crossing, in scaled parameters, below which they are treated here."""
WIDE = 0.03
"""Amplitude, in the metric, up to which states belong to a crossing point."""
MERGED = 1e-5
"""Distance in the metric below which states of sheets that cross are one: there a residual at
round-off does not determine their number."""
DEGREE = 10
"""Of the polynomial through dr/ds: its truncation is at round-off for the amplitudes here."""
ALONG = 2
"""Gauss points from a crossing point to a point: the error is of the order of `NEAR`⁵."""
CORRECTIONS = 2
"""Of eigenvalues of the companion matrix as roots of the polynomial: they shift them by 2e-10."""
GUARDS = Guards(iterations=8, longest=np.inf, converged=1e-9)
"""Points with given amplitudes are exact after a correction below 1e-9 in the metric."""
IMAGINARY = 1e-3
"""Imaginary part, relative to `WIDE`, up to which roots are tried as real ones."""
RESIDUAL = 1e-12
"""Absolute value of r at a root."""
ROUND_OFF = 1e-14
"""Absolute value of r at a crossing point that is taken for zero, a hundred times the usual one."""


@dataclass(frozen=True)
class Branches:
    """States near crossing points: their points, and the index of each."""

    z: Lanes
    point: Numbers
    index: Numbers


@dataclass(frozen=True)
class Centres(Columns):
    """Crossing points close to points: z₀, p and r there, border, amplitude's length, index."""

    z: Lanes
    p: Parameters
    b: Lanes
    size: Values
    """Length in the metric of a unit of s."""
    r: Values
    low: Numbers
    """Number of negative eigenvalues below the one that vanishes."""
    point: Numbers


@dataclass(frozen=True, eq=False)
class NearCrossings:
    """Facets of a set along which sheets cross.

    facets: vertices of each; of_cells: number of the facet opposite to each corner of each cell, −1
    if no other sheet crosses there.
    """

    setting: Setting
    points: States
    facets: Facets
    cells: Cells
    of_cells: Cells

    @cached_property
    def _normal(self) -> Places:
        """Unit normals of the facets in the scaled parameters."""
        place = self._places(self.points.p)[self.facets]
        sides = place[:, 1:] - place[:, :1]
        whole = np.concatenate([sides, np.zeros((len(place), 1, place.shape[2]))], axis=1)
        return np.asarray(np.linalg.svd(whole)[2][:, -1])

    @cached_property
    def _bulge(self) -> ItemValues:
        """How far crossings lie from the middles of their facets, in the scaled parameters."""
        number = np.arange(len(self.facets))
        p = self.points.p[self.facets].mean(axis=1)
        pinned = self._pin(p, number)
        away = np.linalg.norm(self._places(pinned.p - p), axis=1)
        size = np.ptp(self._places(self.points.p)[self.facets], axis=1).max(axis=1, initial=0.0)
        return np.asarray(np.where(pinned.found, away, 0.1 * size))

    def _places(self, p: Float[np.ndarray, "... P"]) -> Float[np.ndarray, "... d"]:
        return np.asarray(p[..., self.setting.free] / self.setting.scales)

    def close(self, near: Hits, p: Parameters) -> Int[np.ndarray, "m 2"]:
        """Pairs of a point and a facet that it may be close to."""
        number = self.of_cells[near.cell]
        row, corner = np.nonzero(number >= 0)
        if len(row) == 0:
            return np.zeros((0, 2), int)
        facet, point = number[row, corner], near.point[row]
        # nothing is lost if a point is a little beyond the ends: the next facet is met there
        tip = self.cells[near.cell[row], corner]
        first = self.facets[facet, 0]
        height = np.einsum(
            "nd,nd->n",
            self._places(self.points.p[tip] - self.points.p[first]),
            self._normal[facet],
        )
        away = np.abs(near.weights[row, corner] * height)
        kept = away <= NEAR + 2.0 * self._bulge[facet]
        return np.unique(np.stack([point[kept], facet[kept]], axis=1), axis=0)

    def _pin(self, p: Parameters, facet: Numbers) -> Pinned:
        """Crossing points on lines through points, normal to facets."""
        own = self.facets[facet]
        place = self._places(self.points.p[own])
        weights = _nearest_weights(place, self._places(p))
        z = np.einsum("lk,lkn->ln", weights, self.points.z[own])
        start = np.einsum("lk,lkn->ln", weights, self.points.p[own])
        span = self._normal[facet][:, None]
        # onto the line: off it by what the point has beyond the facet
        off = self._places(p - start)
        along = np.einsum("ld,lkd->lk", off, span)
        start[:, self.setting.free] += (
            off - np.einsum("lk,lkd->ld", along, span)
        ) * self.setting.scales
        middle = embed(self.setting, z, start)
        rows = middle[:, None][:, :0]
        aim = Aim(self.setting, False, False, span, middle, rows, crossing=True)
        around = np.ptp(embed_many(self.setting, self.points, own), axis=1).max(axis=1, initial=0.0)
        return correct_points(aim, z, start, around)

    def centres(self, close: Int[np.ndarray, "m 2"], p: Parameters) -> Centres:
        """Crossing points closer than `NEAR` to points, each once."""
        point, facet = close.T
        pinned = self._pin(p[point], facet)
        away = np.linalg.norm(self._places(pinned.p - p[point]), axis=1)
        kept = np.flatnonzero(pinned.found & (away <= NEAR))
        z, own, at = pinned.z[kept], pinned.p[kept], point[kept]
        # neighbouring facets lead to the same point, up to the turn of their normals
        place = embed(self.setting, z, own)
        new = np.ones(len(kept), bool)
        for k in range(1, len(kept)):
            same = (at[:k] == at[k]) & new[:k]
            new[k] = not (np.linalg.norm(place[:k][same] - place[k], axis=1) < 10 * NEAR).any()
        z, own, at = z[new], own[new], at[new]
        structure = self.setting.structure
        b = null_border(structure, z, own)
        v = Critical(structure, z, own, b).v
        size = metric_length(structure, v)
        r = np.einsum("li,li->l", v, structure.residual(z, own))
        r[np.abs(r) <= ROUND_OFF] = 0.0
        return Centres(z, own, b, size, r, lower_index(self.setting.structure, z, own), at)

    def branches(self, centres: Centres, p: Parameters) -> tuple[Branches, Centres]:
        """All states over points whose amplitude from their crossing points is at most `WIDE`.

        And the crossing points for which that is so: near others a second eigenvalue vanishes.
        """
        centres, series = self._reduce(centres, p)
        owner, start = [], []
        for lane, fit in enumerate(series.T):
            roots = chebyshev.chebroots(fit)
            real = roots[np.abs(roots.imag) <= IMAGINARY].real
            real = real[np.abs(real) <= 1.0 + IMAGINARY]
            owner.extend(len(real) * [lane])
            start.extend(real.tolist())
        own = np.array(owner, int)
        found = self._roots(centres.take(own), p, series[:, own], np.array(start, float))
        return _distinct(*found), centres

    def _reduce(self, centres: Centres, p: Parameters) -> tuple[Centres, Series]:
        """Chebyshev series of r(s), with amplitudes relative to `WIDE`, where it could be found."""
        nodes = chebyshev.chebpts1(DEGREE + 1)
        shape, many = (-1, len(nodes)), np.repeat(np.arange(len(centres.z)), len(nodes))
        widest = WIDE / centres.size
        s = (widest[:, None] * nodes).ravel()
        _, _, slope, good = self._along(centres.take(many), p[centres.point[many]], s)
        at_centre, known = self._at_centre(centres, p[centres.point])
        kept = np.flatnonzero(good.reshape(shape).all(axis=1) & known)
        slopes = (slope.reshape(shape) * widest[:, None])[kept].T
        series = chebyshev.chebint(chebyshev.chebfit(nodes, slopes, DEGREE), lbnd=0.0)
        series[0] += at_centre[kept]
        return centres.take(kept), series

    def _at_centre(self, centres: Centres, p: Parameters) -> tuple[Values, Flags]:
        """r at amplitude zero over p, where it could be found: the integral of vᵀF_p dp."""
        way, r, good = p - centres.p, centres.r.copy(), np.ones(len(p), bool)
        for node, weight in zip(*legendre.leggauss(ALONG), strict=True):
            at = centres.p + 0.5 * (1.0 + node) * way
            z, _, _, found = self._along(centres, at, np.zeros(len(p)))
            r += 0.5 * weight * Critical(self.setting.structure, z, at, centres.b).along(way)
            good &= found
        return r, good

    def _roots(
        self, own: Centres, p: Parameters, series: Series, x: Values
    ) -> tuple[Branches, Values]:
        """States at roots of series of r near x, with their amplitudes in the metric."""
        x = _improve(series, x)
        z, r, slope, good = self._along(own, p[own.point], x * WIDE / own.size)
        good &= (np.abs(r) <= RESIDUAL) & (np.abs(x) <= 1.0)
        # the slope has the sign of the eigenvalue that nearly vanishes, once or as one of a pair
        near = 2.0 * np.abs(slope) / own.size**2
        several = multiplicity(self.setting.structure, z, p[own.point], near)
        index = own.low + np.where(slope < 0.0, np.maximum(several, 1), 0)
        return Branches(z[good], own.point[good], index[good]), (x * WIDE)[good]

    def on_branches(self, centres: Centres, p: Parameters, z: Lanes, point: Numbers) -> Flags:
        """Which states, given with their points, are such that `branches` finds."""
        structure = self.setting.structure
        out = np.zeros(len(z), bool)
        for k in range(len(centres.z)):
            own = np.flatnonzero(point == centres.point[k])
            same = centres.take(np.full(len(own), k))
            s = np.einsum("ln,ln->l", z[own] - same.z, same.b)
            inner = np.abs(s) <= WIDE / same.size
            own, same, s = own[inner], same.take(inner), s[inner]
            there, _, _, good = self._along(same, p[same.point], s)
            gap = metric_length(structure, there - z[own])
            out[own[good & (gap <= MERGED)]] = True
        return out

    def _along(
        self, centres: Centres, p: Parameters, s: Values
    ) -> tuple[Lanes, Values, Values, Flags]:
        """Points with amplitudes s, r and its slope, and which were found; see `at_amplitudes`."""
        structure = self.setting.structure
        v = Critical(structure, centres.z, centres.p, centres.b).v
        found, there = at_amplitudes(structure, centres.b, p, centres.z + s[:, None] * v)
        return found.z, -found.unfolding, -there.g, found.found


def at_amplitudes(
    structure: Structure, b: Lanes, p: Parameters, guess: Lanes
) -> tuple[Settled, Critical]:
    """Points z over p with the amplitudes ``b·z`` of guesses and r, which is minus `unfolding`.

    Beside them their null vectors v, with b·v = 1, and g, which is minus dr/ds.
    """
    still = np.zeros((len(b), 1, p.shape[1]))
    frame = Planes(b[:, None], still, np.zeros((len(b), 1)), b)
    found = settle(structure, guess, p, None, (), GUARDS, frame, frames=False)
    return found, Critical(structure, found.z, p, b)


def of_set(
    setting: Setting, points: States, cells: Cells, whole: Adjacency, crossings: Facets
) -> NearCrossings:
    """Facets on crossings, given by their vertices, with the adjacent cells."""
    base = len(points)
    keys, own = keys_of(whole.facets, base), np.unique(keys_of(crossings, base))
    at = np.minimum(np.searchsorted(own, keys), len(own) - 1)
    number = np.where(own[at] == keys, at, -1)
    facets = rows_of(own, base, crossings.shape[1])
    return NearCrossings(setting, points, facets, cells, number[whole.cell_facets])


def _improve(series: Series, x: Values) -> Values:
    """Roots of series by Newton's method, without steps that only follow round-off.

    Numbers are corrected here, no points: states at these amplitudes come from `settle`.
    """
    slopes, r = chebyshev.chebder(series), chebyshev.chebval(x, series, tensor=False)
    for _ in range(CORRECTIONS):
        with np.errstate(divide="ignore", invalid="ignore"):
            step = np.nan_to_num(r / chebyshev.chebval(x, slopes, tensor=False), posinf=0, neginf=0)
        there = x - np.clip(step, -IMAGINARY, IMAGINARY)
        closer = np.abs(left := chebyshev.chebval(there, series, tensor=False)) < np.abs(r)
        x, r = np.where(closer, there, x), np.where(closer, left, r)
    return np.asarray(x)


def _distinct(found: Branches, s: Values) -> Branches:
    """One of those that are closer together than `MERGED`: the middle one.

    Where two are, a third one at a similar distance goes with them: side branches come in pairs.
    """
    order = np.lexsort((s, found.point))
    point, gap = found.point[order], np.diff(s[order], prepend=-np.inf)
    new = np.diff(point, prepend=-1) != 0
    merging = np.isin(point, point[~new & (gap <= MERGED)])
    starts = np.flatnonzero(new | (gap > np.where(merging, 2.0 * MERGED, MERGED)))
    sizes = np.diff(np.append(starts, len(order)))
    chosen = order[starts + sizes // 2]
    return Branches(found.z[chosen], found.point[chosen], found.index[chosen])


def embed_many(
    setting: Setting, points: States, rows: Int[np.ndarray, "lanes k"]
) -> Float[np.ndarray, "lanes k coordinates"]:
    """Places of several vertices for each lane."""
    columns = [embed(setting, points.z[column], points.p[column]) for column in rows.T]
    return np.stack(columns, axis=1)


def _nearest_weights(
    place: Float[np.ndarray, "lanes k d"], at: Float[np.ndarray, "lanes d"]
) -> Float[np.ndarray, "lanes k"]:
    """Barycentric coordinates, in facets, of the points of their planes next to given ones."""
    weights = np.clip(shares_in(place, at), 0.0, 1.0)
    return np.asarray(weights / weights.sum(axis=1, keepdims=True))
