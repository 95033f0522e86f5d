"""States over points close to cusps: roots of one scalar equation.

Facets of folds are straight. One that joins both folds of a cusp cuts off a tip over which there
are two states more than over the points around: their signs cancel, so that the sum of (−1)^index
does not show them, and no cell is near the one on the other fold. With a border b of the cusp z₀
all states over a point are roots of r(s) where ``F = r b``, ``b·(z − z₀) = s`` [Govaerts2000]_.
"""

from dataclasses import dataclass

import numpy as np

from equimorph.arrays import (
    Bool,
    CellNumbers,
    Facets,
    Flags,
    Float,
    Int,
    Items,
    ItemValues,
    Lanes,
    Parameters,
    Some,
    Values,
)
from equimorph.columns import Columns
from equimorph.equilibria.critical import Critical, null_border, null_vectors
from equimorph.equilibria.locus import Locus, nearest
from equimorph.manifold.geometry.setting import Setting, embed
from equimorph.manifold.geometry.topology import Adjacency, keys_of
from equimorph.manifold.lookup.exact_states import (
    Found,
    Points,
    first_of_same,
    in_order,
)
from equimorph.manifold.lookup.near_crossings import at_amplitudes
from equimorph.structures import States, Structure

PlacesOver = Float[np.ndarray, "points d"]

SHARES = np.linspace(-1.0, 1.0, 17) ** 3
"""Amplitudes, in shares of the largest, at which r and its slope are computed. r is nearly cubic:
cubics between two of them have its roots, which are closer together the closer the cusp is."""
BISECTIONS = 40
"""Bisections of a cubic where it is monotone."""
CORRECTIONS, EXACT = 6, 1e-9
"""Newton's steps in the amplitude of a root, and the last one, in reaches, up to which it is one:
Newton's method in z itself stops above round-off here."""
REACH = 2.5
"""Amplitudes are examined up to that of the farthest corner times this number: where one of three
roots of a cubic is double, the third one is twice as far from the cusp on the other side."""
AROUND = 0.5
"""Distance from a facet and its cusp, relative to their extent, within which points are close."""
FAR = 2.0
"""Distance of a cusp from the corners of its facet, in lengths of this, from which on it is another
one's."""
AT_CUSP = 1e-6
"""Share of the larger of two values of φᵀF_zz[φ, φ] up to which the other one is zero."""


@dataclass(frozen=True, eq=False)
class NearCusps(Columns):
    """Cusps, their borders, null vectors and largest amplitudes, and the parameters around them.

    beside: cells that have the facet, −1 where there are fewer than of others.
    """

    z: Lanes
    p: Parameters
    b: Lanes
    v: Lanes
    reach: Values
    lower: Float[np.ndarray, "lanes d"]
    upper: Float[np.ndarray, "lanes d"]
    beside: Int[np.ndarray, "lanes most"]

    def states(self, structure: Structure, p: Points, x: PlacesOver, index: CellNumbers) -> Found:
        """States over points with free parameters `x`, those points, sorted, and their cells.

        `index` is that of all cells of the set.
        """
        within = (x[:, None] >= self.lower) & (x[:, None] <= self.upper)
        point, cusp = np.nonzero(within.all(axis=2))
        if len(point) == 0:
            return np.zeros_like(self.z[:0]), point, point
        own, nodes = self.take(cusp), len(SHARES)
        s = own.reach[:, None] * SHARES
        guess = own.z[:, None] + s[:, :, None] * own.v[:, None]
        many = np.repeat(np.arange(len(point)), nodes)
        guess = guess.reshape(-1, guess.shape[2])
        found, there = at_amplitudes(structure, own.b[many], p[point[many]], guess)
        shape = s.shape
        of_nodes = -found.unfolding.reshape(shape), -there.g.reshape(shape)
        lane, node, root = _roots(s, *of_nodes, found.found.reshape(shape))
        row = lane * nodes + node
        guess = found.z[row] + (root - s[lane, node])[:, None] * there.v[row]
        own, point = own.take(lane), point[lane]
        z, exact = _corrected(structure, own, p[point], root, guess)
        of_state = structure.index(z, p[point])
        beside = own.beside
        same = (index[beside] == of_state[:, None]) & (beside >= 0)
        good = exact & same.any(axis=1)
        cell = beside[np.arange(len(z)), same.argmax(axis=1)]
        return z[good], point[good], cell[good]


def _corrected(
    structure: Structure, own: NearCusps, p: Points, root: Values, guess: Lanes
) -> tuple[Lanes, Flags]:
    """States near guesses with given amplitudes, by Newton's method for r = 0; which are exact."""
    z, root, good = guess.copy(), root.copy(), np.zeros(len(guess), bool)
    left = np.arange(len(z))
    for _ in range(CORRECTIONS):
        if len(left) == 0:
            break
        at = own.take(left)
        found, there = at_amplitudes(structure, at.b, p[left], z[left])
        with np.errstate(divide="ignore", invalid="ignore"):
            step = np.nan_to_num(found.unfolding / there.g, nan=np.inf)
        good[left] = found.found & (np.abs(step) <= EXACT * at.reach)
        step = np.clip(step, -at.reach, at.reach)
        root[left] -= step
        along = found.z - step[:, None] * there.v
        afresh = at.z + root[left, None] * at.v
        z[left] = np.where(found.found[:, None], along, afresh)
        left = left[~good[left]]
    return z, good


def _roots(
    s: Float[np.ndarray, "lanes nodes"],
    r: Float[np.ndarray, "lanes nodes"],
    slope: Float[np.ndarray, "lanes nodes"],
    good: Bool[np.ndarray, "lanes nodes"],
) -> tuple[Items, Items, ItemValues]:
    """Lanes and amplitudes at which cubics between good nodes vanish; the nodes before them."""
    step = np.diff(s, axis=1)
    first, last, rise = slope[:, :-1] * step, slope[:, 1:] * step, np.diff(r, axis=1)
    cubic = np.stack([r[:, :-1], first, 3 * rise - 2 * first - last, first + last - 2 * rise], -1)
    _, linear, square, cube = np.moveaxis(cubic, -1, 0)
    with np.errstate(divide="ignore", invalid="ignore"):
        # between the ends and these places cubics are monotone
        half = -(square + np.copysign(np.sqrt(square**2 - 3.0 * linear * cube), square))
        turns = np.stack([half / (3.0 * cube), linear / half], axis=-1)
    turns = np.sort(np.clip(np.nan_to_num(turns, nan=0.0), 0.0, 1.0), axis=-1)
    ends = np.concatenate([np.zeros_like(turns[..., :1]), turns, np.ones_like(turns[..., :1])], -1)
    above = np.einsum("lnk,lnek->lne", cubic, ends[..., None] ** np.arange(4)) > 0.0
    passed = (above[..., :-1] != above[..., 1:]) & (good[:, :-1] & good[:, 1:])[..., None]
    lane, node, piece = np.nonzero(passed)
    low, high = ends[lane, node, piece], ends[lane, node, piece + 1]
    sign, own = np.where(above[lane, node, piece], 1.0, -1.0), cubic[lane, node]
    for _ in range(BISECTIONS):
        t = 0.5 * (low + high)
        before = sign * np.einsum("nk,nk->n", own, t[:, None] ** np.arange(4)) > 0.0
        low, high = np.where(before, t, low), np.where(before, high, t)
    return lane, node, s[lane, node] + low * step[lane, node]


def united(structure: Structure, parts: list[Found], others: list[Found]) -> list[Found]:
    """Parts with states of others, equal ones once; those over the points of others in one part."""
    also = np.unique(np.concatenate([point for _, point, _ in others]))
    asked = [np.isin(point, also) for _, point, _ in parts]
    known = in_order([_rows(part, own) for part, own in zip(parts, asked, strict=True)])
    z, point, cell = (np.concatenate(columns) for columns in zip(known, *others, strict=True))
    mine = [np.flatnonzero(point == number) for number in also]
    kept = np.concatenate([own[first_of_same(structure, z[own])] for own in mine])
    rest = [_rows(part, ~own) for part, own in zip(parts, asked, strict=True)]
    return [*rest, (z[kept], point[kept], cell[kept])]


def _rows(found: Found, some: Flags) -> Found:
    """Some of the states."""
    z, point, cell = found
    return z[some], point[some], cell[some]


def cusps_near(
    setting: Setting, points: States, whole: Adjacency, folds: Facets
) -> NearCusps | None:
    """The cusps that facets of folds pass, if there are any."""
    facets = folds[_turning(points, folds)]
    if len(facets) == 0:
        return None
    structure = points.structure
    own = points[facets.ravel()]
    place = embed(setting, own.z, own.p).reshape(*facets.shape, -1)
    middle = States(structure, *(x.reshape(*facets.shape, -1).mean(axis=1) for x in (own.z, own.p)))
    tests = (lambda at: at.g, lambda at: at.quadratic)
    locus = Locus(structure, own.p[0], setting.free, tests)
    spots, found = nearest(locus, locus.join(middle.z, middle.p))
    z, p = locus.split(spots.x)
    size = np.linalg.norm(place - place[:, :1], axis=2).max(axis=1)
    away = np.linalg.norm(embed(setting, z, p)[:, None] - place, axis=2).max(axis=1)
    found &= away <= FAR * size
    facets, z, p = facets[found], z[found], p[found]
    b = null_border(structure, z, p)
    gap = points.z[facets] - z[:, None]
    reach = REACH * np.abs(np.einsum("nki,ni->nk", gap, b)).max(axis=1)
    ends = np.concatenate([points.p[facets], p[:, None]], axis=1)[:, :, setting.free]
    lower, upper = ends.min(axis=1), ends.max(axis=1)
    margin = AROUND * ((upper - lower) / setting.scales).max(axis=1)[:, None] * setting.scales
    keys, wanted = (keys_of(each, len(points)) for each in (whole.facets, facets))
    beside = whole.beside[np.searchsorted(keys, wanted)]
    v = Critical(structure, z, p, b).v
    return NearCusps(z, p, b, v, reach, lower - margin, upper + margin, beside)


def _turning(points: States, facets: Facets) -> Some:
    """Facets of folds at whose corners φᵀF_zz[φ, φ] has different signs, or none."""
    used, at = np.unique(facets, return_inverse=True)
    at = at.reshape(facets.shape)
    null, bend = null_vectors(points.structure, points.z[used], points.p[used])
    out = np.zeros(len(facets), bool)
    for k in range(1, facets.shape[1]):
        one, other = at[:, 0], at[:, k]
        sense = np.sign(np.einsum("ni,ni->n", null[one], null[other]))
        a, b = bend[one], bend[other] * sense
        out |= a * b <= AT_CUSP * np.maximum(a**2, b**2)
    return np.flatnonzero(out)
