"""Whether the straight folds in grid triangles show all that the curved ones do.

A fold through a grid triangle is drawn as the chord between its points on two sides. Two things
may be hidden behind it: the fold leaves through the third side and comes back, which parts what
hangs together beyond it; and folds over one triangle, drawn apart, may belong to parts of the set
that are joined between them, by a neck that is smaller than the triangle.

See docs/decisions.md, "Folds lead into their triangles".
"""

from dataclasses import dataclass

import numpy as np

from equimorph.arrays import Bool, Flags, Float, Int, Lanes, Pairs, Parameters, Places, Some, Values
from equimorph.columns import Columns
from equimorph.manifold.geometry.exact_points import pin
from equimorph.manifold.geometry.points import VertexKind
from equimorph.manifold.geometry.simplices import shares_in
from equimorph.manifold.geometry.tangents import fold_forms
from equimorph.manifold.geometry.topology import labels, places_among
from equimorph.manifold.lifting.courses import Courses, on_sides
from equimorph.manifold.lifting.fold_walks import fold_exits, nearest_at
from equimorph.manifold.lifting.grid import NEAR_AN_END
from equimorph.manifold.lifting.pairing import Pairing
from equimorph.manifold.lifting.polygon_cuts import chord_of, planes
from equimorph.manifold.lifting.stationary_points import Starts

SHARP = 0.5
"""Cosine of the angle between the sides of a fold at both ends below which it turns sharply."""
BACK = -0.5
"""Cosine of the angle between the sides of a fold at an end and in the middle below which the
middle is not where it turns."""
BENT = 0.97
"""The same cosine below which the set may go on where the fold turns: at a neck."""
NEAR = -0.5
"""Barycentric coordinate above which a guess is tried."""
BEYOND = -0.05
"""Barycentric coordinate below which the middle of a fold lies beyond its triangle, relative to
their change from one of its ends to the other."""
FACING = 0.1
"""Distance from a side of a triangle, in lengths of its chord, up to which a fold faces others."""


@dataclass(frozen=True)
class FoldChords(Columns):
    """Chords of folds from side to side of grid triangles.

    ends (n, 2): points; triangle: below them; normals: of unit length towards the existing sheets,
    in scaled free parameters; cusped: whether there is a cusp between the ends; courses: of
    the folds in the triangles.
    """

    ends: Pairs
    triangle: Some
    normals: Float[np.ndarray, "n 2 d"]
    cusped: Flags
    courses: Courses

    @property
    def cosines(self) -> Values:
        """Cosines of the angles between the sides of the folds at both ends; 1 at cusps."""
        turn = (self.normals[:, 0] * self.normals[:, 1]).sum(axis=1)
        return np.where(self.cusped, 1.0, turn)

    @property
    def sharp(self) -> Flags:
        """Whether folds turn sharply, or lead away from their chords at an end."""
        away = self.courses.cosines.min(axis=1) < SHARP
        return np.asarray((self.cosines < SHARP) | away & ~self.cusped)


def chords_across(
    pairing: Pairing, chords: Pairs, wanted: Bool[np.ndarray, " T"]
) -> tuple[Int[np.ndarray, "chosen 2"], Some]:
    """Chords between points on two sides of one grid triangle, of the flagged ones; triangles."""
    points, mesh = pairing.points, pairing.mesh
    edge = points.edge[chords]
    own = (edge >= 0).all(axis=1) & (edge[:, 0] != edge[:, 1])
    ends, edge = chords[own], edge[own]
    owner = np.flatnonzero(wanted)
    if len(owner) == 0:
        return ends[:0], owner
    sides, base = np.sort(mesh.sides[owner], axis=1), len(mesh.edges)
    pairs = np.concatenate([sides[:, pair] for pair in ([0, 1], [1, 2], [0, 2])])
    at = places_among(edge, pairs, base)
    good = at >= 0
    return ends[good], np.tile(owner, 3)[at[good]]


def fold_chords(pairing: Pairing, folds: Pairs, wanted: Bool[np.ndarray, " T"]) -> FoldChords:
    """Chords between folds on two sides of one grid triangle, of the flagged ones."""
    ends, triangle = chords_across(pairing, folds, wanted)
    points = pairing.points
    used, place = np.unique(ends, return_inverse=True)
    forms = fold_forms(pairing.setting, points.z[used], points.p[used])
    place = place.reshape(ends.shape)
    length = np.linalg.norm(forms.existence, axis=1, keepdims=True)
    normals = (forms.existence / np.maximum(length, 1e-300))[place]
    courses = Courses.of(pairing, ends, triangle, normals)
    return FoldChords(ends, triangle, normals, forms.parted_by_cusps(*place.T), courses)


def facing_sides(pairing: Pairing, chords: FoldChords) -> tuple[Some, dict[int, float]]:
    """Triangles on both sides of an edge that folds of one index bend to; where to split it.

    No end of the edge lies between these folds, so that they may be one beyond it.
    """
    gap, place = chords.courses.nearest()
    near = np.flatnonzero((gap < FACING) & ~chords.cusped)
    triangle, index = chords.triangle[near], pairing.points.index[chords.ends[near, 0]]
    edge, share = on_sides(pairing.mesh, triangle, chords.courses.third[near], place[near])
    shares: dict[int, float] = {}
    for each, low in np.unique(np.stack([edge, index], axis=1), axis=0).tolist():
        own = np.flatnonzero((edge == each) & (index == low))
        middle = float(share[own].mean())
        apart = len(own) > 1 and _opposite(pairing, triangle[own])
        if apart and NEAR_AN_END < middle < 1.0 - NEAR_AN_END:
            shares[each] = middle
    return triangle[np.isin(edge, list(shares))], shares


def _opposite(pairing: Pairing, triangles: Some) -> bool:
    """Whether triangles at an edge do not all hang together by grid tetrahedra between them."""
    own = np.unique(triangles)
    faces = pairing.mesh.faces
    at = np.full(len(pairing.mesh.triangles), len(own))
    at[own] = np.arange(len(own))
    numbers = np.sort(at[faces[np.isin(faces, own).sum(axis=1) > 1]], axis=1)[:, :2]
    return bool(labels(len(own), numbers).max(initial=0) > 0)


@dataclass(frozen=True)
class Turns(Columns):
    """Folds that turn sharply in triangles.

    ends (n, 2): points; triangle: below them; normals: see `FoldChords`; z, p: a point of the fold
    between its ends, if it is one; inside: whether it is one, and in the triangle.
    """

    ends: Pairs
    triangle: Some
    normals: Float[np.ndarray, "n 2 d"]
    z: Float[np.ndarray, "n size"]
    p: Float[np.ndarray, "n parameters"]
    inside: Flags


def sharp_turns(pairing: Pairing, chords: FoldChords) -> Turns | None:
    """Folds that turn sharply, with their middles; None if there are none."""
    sharp = chords.take(chords.sharp)
    parted = np.array([chord_of(*pair) in pairing.tips for pair in sharp.ends.tolist()], bool)
    sharp = sharp.take(~parted)
    if pairing.mesh.dimension == 3:  # faces are not parted at middles: chords stand for arcs
        sharp = sharp.take(~_lead_across(pairing, sharp))
    if len(sharp.ends) == 0:
        return None
    span = planes(pairing, sharp.triangle.tolist())
    middle = pin(pairing.setting, pairing.points, sharp.ends.tolist(), VertexKind.FOLD, span)
    inside = middle.found & lie_inside(pairing, sharp.triangle, sharp.ends, middle.p)
    corners = pairing.mesh.vertices[pairing.mesh.triangles[sharp.triangle]]
    inside &= sharp.courses.lead_to(shares_in(corners, middle.p[:, pairing.setting.free]))
    if pairing.mesh.dimension == 3:  # faces are not parted at middles: chords stand for arcs
        inside &= sharp.courses.cosines.min(axis=1) > 0.0
    known = np.flatnonzero(inside)
    inside[known] = _lie_between(pairing, sharp.ends[known], middle.z[known], middle.p[known])
    return Turns(sharp.ends, sharp.triangle, sharp.normals, middle.z, middle.p, inside)


def _lead_across(pairing: Pairing, chords: FoldChords) -> Flags:
    """Whether folds lead from one end of their chords to the other without leaving the triangle."""
    pairs = list(zip(chords.triangle.tolist(), chords.ends[:, 0].tolist(), strict=True))
    exits = fold_exits(pairing, pairs)
    return np.array(
        [
            exit_ is not None and nearest_at(pairing, [exit_], end)[0] >= 0
            for exit_, end in zip(exits, chords.ends[:, 1:], strict=True)
        ],
        bool,
    )


def _lie_between(pairing: Pairing, ends: Pairs, z: Lanes, p: Parameters) -> Flags:
    """Whether folds turn from each of two ends to a third point by part of a half turn only.

    Else, or if a cusp lies between, the point is on another part of the fold.
    """
    points, lanes = pairing.points, np.arange(len(ends))
    both = ends.T.ravel()
    known = (np.concatenate(each) for each in ((points.z[both], z), (points.p[both], p)))
    forms = fold_forms(pairing.setting, *known)
    normals = forms.existence / np.linalg.norm(forms.existence, axis=1, keepdims=True)
    good, middle = np.ones(len(ends), bool), 2 * len(ends) + lanes
    for end in (lanes, len(ends) + lanes):
        good &= ~forms.parted_by_cusps(end, middle)
        good &= (normals[end] * normals[middle]).sum(axis=1) > BACK
    return good


def lie_inside(pairing: Pairing, triangle: Some, ends: Pairs, p: Parameters) -> Flags:
    """Whether middles of curves between points on two sides of grid triangles lie inside these.

    Beyond the third side none does; a middle beyond one of the two others, and only a little
    relative to its ends, is one of a curve that leads along this side.
    """
    free, corners = pairing.setting.free, pairing.mesh.vertices[pairing.mesh.triangles[triangle]]
    one, other = (shares_in(corners, pairing.points.p[each][:, free]) for each in ends.T)
    reach = np.minimum(np.abs(other - one).max(axis=1, keepdims=True), 1.0)
    third = np.ones_like(one)
    for each in (one, other):
        np.put_along_axis(third, each.argmin(axis=1)[:, None], 0.0, axis=1)
    least = np.where(third > 0.0, 0.0, BEYOND * reach)
    return np.asarray((shares_in(corners, p[:, free]) > least).all(axis=1))


@dataclass(frozen=True)
class Facing:
    """Folds over one triangle between which the set may hang together: one that turns, or two.

    one, other: numbers of the chords, the same if there is one; starts: where they face each other.
    """

    one: Some
    other: Some
    starts: Starts


def facing_folds(pairing: Pairing, chords: FoldChords) -> Facing:
    """Folds that turn in their triangle, and pairs of folds with the same lower index."""
    points, mesh, free = pairing.points, pairing.mesh, pairing.setting.free
    bent = np.flatnonzero(chords.cosines < BENT)
    ones, others = [bent], [bent]
    order = np.argsort(chords.triangle, kind="stable")
    triangle, index = chords.triangle[order], points.index[chords.ends[order, 0]]
    for shift in range(1, int(np.bincount(triangle, minlength=1).max())):
        same = triangle[shift:] == triangle[:-shift]
        same &= index[shift:] == index[:-shift]
        ones.append(order[:-shift][same])
        others.append(order[shift:][same])
    one, other = np.concatenate(ones), np.concatenate(others)
    ends = np.concatenate([chords.ends[one], chords.ends[other]], axis=1)
    corners = mesh.vertices[mesh.triangles[chords.triangle[one]]]
    place = points.p[ends][:, :, free].mean(axis=1)
    place[: len(bent)] = _meetings(pairing, chords.take(bent))
    shares = shares_in(corners, place)
    z = points.z[ends].mean(axis=1)
    starts = Starts.between(pairing, chords.triangle[one], shares, z, ends)
    near = np.asarray((shares > NEAR).all(axis=1))
    return Facing(one[near], other[near], starts.take(near))


def beyond_folds(pairing: Pairing, chords: FoldChords, facing: Facing, place: Places) -> Flags:
    """Whether places lie on those sides of the chords on which the set has no sheets."""
    scales, points = pairing.setting.scales, pairing.points
    pairs = np.stack([facing.one, facing.other], axis=1)
    ends = points.p[chords.ends[pairs]][..., pairing.setting.free] / scales
    along = ends[:, :, 1] - ends[:, :, 0]
    across = np.stack([-along[..., 1], along[..., 0]], axis=-1)
    normals = chords.normals[pairs].sum(axis=2)
    across *= np.sign((across * normals).sum(axis=-1, keepdims=True))
    off = ((place / scales)[:, None] - ends.mean(axis=2)) * across
    return np.asarray((off.sum(axis=-1) < 0.0).all(axis=1))


def _meetings(pairing: Pairing, chords: FoldChords) -> Places:
    """Free parameters where the tangents of folds at both ends meet."""
    scales = pairing.setting.scales
    ends = pairing.points.p[chords.ends][:, :, pairing.setting.free] / scales
    level = (chords.normals * ends).sum(axis=2)
    return np.asarray((np.linalg.pinv(chords.normals) @ level[:, :, None])[:, :, 0] * scales)
