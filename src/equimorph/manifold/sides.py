"""Sides of the box: sets are lifted over sides moved outwards, and end at the sides again.

See docs/decisions.md, "Sides in which a set is singular are moved outwards" and "Points of a fold
nearer to each other than sides were moved are one".
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations

import numpy as np
from scipy.spatial import cKDTree

from equimorph.arrays import (
    CellFlags,
    Float,
    Int,
    Items,
    Pairs,
    Place,
    VertexFlags,
    VertexNumbers,
)
from equimorph.equilibria.locus import Locus, nearest
from equimorph.manifold.complex.description import Complex, describe_again
from equimorph.manifold.complex.equilibrium_set import EquilibriumSet
from equimorph.manifold.complex.excerpts import excerpt_of, sheets_of
from equimorph.manifold.complex.joins import groups_of, joined
from equimorph.manifold.complex.kept_tables import places_of
from equimorph.manifold.complex.marked_complex import TETRAHEDRA
from equimorph.manifold.complex.pinches import ON_SIDE, pinched_vertices
from equimorph.manifold.complex.vertices import Vertices
from equimorph.manifold.geometry.exact_points import Aim, Pinned, correct_points
from equimorph.manifold.geometry.points import VertexKind, are_singular
from equimorph.manifold.geometry.setting import embed
from equimorph.manifold.geometry.topology import adjacency
from equimorph.manifold.lifting.cells import Cells
from equimorph.manifold.lifting.grid import Lines
from equimorph.manifold.lifting.pairing import Pairing, abandoned_rays
from equimorph.manifold.lookup.exact_states import lift_to
from equimorph.manifold.queries.levels import cut_along, part_of
from equimorph.model import Box
from equimorph.structures import States
from equimorph.tolerances import SAME_VERTEX

OUTWARDS = 1e-4
"""Part of an interval by which sides are moved: sheets that cross in a side are as far apart."""
SHARES = np.array([1.0, 0.6180, 0.7549])
"""Of the free parameters: diagonals through corners must not pass through the moved ones."""
NEARER = 0.5
"""How far vertices may go to cusps, over the distance of the nearest one in the box."""


def is_stuck_at_sides(pairing: Pairing, cells: Cells) -> bool:
    """Whether what could not be decided or lifted touches sides of the box, more than by chance.

    Most of the cells of a coarse grid touch sides.
    """
    mesh = pairing.mesh
    if pairing.is_full:
        return False
    low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    on_side = ((mesh.vertices == low) | (mesh.vertices == high)).any(axis=1)
    lost = np.array([edge for _, edge in abandoned_rays(pairing)], int)
    groups = (
        (mesh.triangles, cells.doubtful_triangles),
        (mesh.tetrahedra, cells.doubtful_tetrahedra),
        (mesh.edges, lost),
    )
    count, touching, by_chance = 0, 0, 0.0
    for every, some in ((on_side[of].any(axis=1), own) for of, own in groups if len(own)):
        count += len(some)
        touching += int(every[some].sum())
        by_chance += len(some) * float(every.mean())
    return 2 * touching > count + by_chance


def widened(lines: Lines, limits: Float[np.ndarray, "2 d"]) -> Lines:
    """Lines of a grid with the outer ones moved outwards, within limits of the parameters."""
    out = []
    for share, line, (low, high) in zip(SHARES, lines, limits.T, strict=False):
        move = OUTWARDS * share * (line[-1] - line[0]) / (len(line) - 1)
        first = line[0] - min(move, 0.5 * (line[0] - low))
        last = line[-1] + min(move, 0.5 * (high - line[-1]))
        out.append(np.concatenate([[first], line[1:-1], [last]]))
    return tuple(out)


def box_of(names: tuple[str, ...], lines: Lines) -> Box:
    """The box that a grid fills."""
    return Box(**{n: (line[0], line[-1]) for n, line in zip(names, lines, strict=True)})


def trimmed(eset: EquilibriumSet, box: Box) -> EquilibriumSet:
    """The part of a set over a box whose sides are a little inside those of its own."""
    eset = _Trim(eset, box).with_joined_neighbours()
    trim = _Trim(_without_beyond(eset, box), box)
    eset = trim.on_sides()
    for axis in range(len(box.names)):
        for lower in (True, False):
            eset = _cut_off(eset, box, axis, lower=lower)
    # edges that could not be cut leave grid cells in doubt
    audit = eset.audit
    audit = replace(audit, undecided=audit.undecided + audit.unrefined, unrefined=0)
    mesh = replace(eset.mesh, vertices=np.clip(eset.mesh.vertices, box.lower, box.upper))
    points = States(eset.structure, eset.points.z, _without_round_off(eset, box))
    eset = replace(eset, box=box, mesh=mesh, points=points, audit=audit)
    # vertices may be singular in sides of the box alone
    return describe_again(eset, _whole(eset), eset.setting)


def _without_round_off(eset: EquilibriumSet, box: Box) -> Float[np.ndarray, "V P"]:
    """Parameters of vertices; those on sides lie on them to the last digit."""
    p, place = eset.points.p.copy(), eset.coordinates
    on_side = np.clip(place, box.lower, box.upper)
    near = np.abs(on_side - place) <= ON_SIDE * (box.upper - box.lower)
    p[:, eset.setting.free] = np.where(near, on_side, place)
    return p


def _sides(eset: EquilibriumSet, box: Box) -> Iterator[tuple[int, float, Float[np.ndarray, " V"]]]:
    """Parameters and signs of the sides of a box, and how far beyond each the vertices lie."""
    for axis in range(len(box.names)):
        for bound, sign in ((box.lower, -1.0), (box.upper, 1.0)):
            yield axis, sign, sign * (eset.coordinates[:, axis] - bound[axis])


def _only(eset: EquilibriumSet, cells: CellFlags) -> Complex:
    """Some cells of a set."""
    recut = excerpt_of(eset, np.zeros(len(eset.cells), bool)).put_back()
    return recut.complex(cells, np.zeros(len(recut.points), bool))


def _whole(eset: EquilibriumSet) -> Complex:
    """All cells of a set."""
    return _only(eset, np.ones(len(eset.cells), bool))


def _without_beyond(eset: EquilibriumSet, box: Box) -> EquilibriumSet:
    """The set without cells that lie beyond a side, or in it."""
    kept, width = np.ones(len(eset.cells), bool), box.upper - box.lower
    for axis, _, beyond in _sides(eset, box):
        kept &= (beyond < -ON_SIDE * width[axis])[eset.cells].any(axis=1)
    return eset if kept.all() else describe_again(eset, _only(eset, kept), eset.setting)


@dataclass(frozen=True, eq=False)
class _Trim:
    """A set over a box with sides that were moved outwards, and the box itself."""

    eset: EquilibriumSet
    box: Box

    def on_sides(self) -> EquilibriumSet:
        """The set with vertices beyond sides on these, as far as it goes on to there."""
        eset, kinds = self.eset, self.eset.kinds
        z, p, found = eset.points.z.copy(), eset.points.p.copy(), ~self._beyond
        curved = are_singular(kinds) | (kinds == VertexKind.CAP)
        plain = np.flatnonzero(~curved & self._beyond)
        for rows, at in ((plain, self._lifted(plain)), *self._on_curves(curved)):
            own = rows[at.found]
            z[own], p[own], found[own] = at.z[at.found], at.p[at.found], True
        swallowed = self._swallowed(States(eset.structure, z, p), found)
        # where both cannot become one vertex, both are at its place
        z[swallowed[:, 0]], p[swallowed[:, 0]] = z[swallowed[:, 1]], p[swallowed[:, 1]]
        points = States(eset.structure, z, p)
        whole = replace(_whole(eset), points=points, fresh=None)
        pairs = np.concatenate([self._coinciding(points), swallowed])
        return describe_again(eset, self._joined(whole, pairs), eset.setting)

    def with_joined_neighbours(self) -> EquilibriumSet:
        """The set with singular vertices beyond sides as one with those of their fold nearby.

        Where a fold leads through a corner of the box, it has several at the corner, closer to each
        other than sides were moved. What lies beyond sides would leave a void between these, over
        three parameters. Over two there is none to leave, and folds meet in cusps in corners.
        """
        eset = self.eset
        if len(self.box.names) < TETRAHEDRA:
            return eset
        whole, place = replace(_whole(eset), fresh=None), eset.coordinates
        ends = [
            facets[:, list(two)]
            for facets in (whole.folds, whole.caps, whole.crossings)
            for two in combinations(range(facets.shape[1]), 2)
        ]
        pairs = np.unique(np.concatenate([np.zeros((0, 2), int), *ends]), axis=0)
        apart = np.abs(place[pairs[:, 0]] - place[pairs[:, 1]])
        pairs = pairs[(apart <= self._near).all(axis=1)]
        pairs = pairs[self._beyond[pairs].any(axis=1)]
        if len(pairs):
            eset = describe_again(eset, self._joined(whole, pairs), eset.setting)
        return eset

    def _joined(self, whole: Complex, pairs: Pairs) -> Complex:
        """Cells with pairs of vertices joined, where that leaves no more flaws than there were."""
        flaws = self._flaws(whole)
        every = joined(whole, pairs, self._rank)
        if (self._flaws(every) <= flaws).all():
            return every
        same = pairs[:0]
        for own in groups_of(pairs, len(whole.points)):
            more = np.concatenate([same, own])
            same = more if (self._flaws(joined(whole, more, self._rank)) <= flaws).all() else same
        return joined(whole, same, self._rank)

    def _flaws(self, whole: Complex) -> Int[np.ndarray, " 3"]:
        """Facets with more than two cells, those with one off the sides, pinched vertices."""
        known, box = adjacency(whole.cells), self.box
        place, slack = whole.points.p[:, self.eset.setting.free], ON_SIDE * (box.upper - box.lower)
        on = [np.abs(place - bound) <= slack for bound in (box.lower, box.upper)]
        inside = ~np.concatenate(on, axis=1)[known.facets].all(axis=1).any(axis=1)
        voids = len(box.names) == TETRAHEDRA  # over fewer parameters cells enclose none
        pinched = len(pinched_vertices(whole.cells, known, len(place))) if voids else 0
        return np.array([(known.counts > 2).sum(), (inside & (known.counts == 1)).sum(), pinched])

    @cached_property
    def _beyond(self) -> VertexFlags:
        """Vertices that lie beyond sides."""
        place = self.eset.coordinates
        return np.asarray(((place < self.box.lower) | (place > self.box.upper)).any(axis=1))

    @property
    def _near(self) -> Place:
        """Twice the distance by which sides were moved."""
        box, wide = self.box, self.eset.box
        return np.asarray(2.0 * np.maximum(box.lower - wide.lower, wide.upper - box.upper))

    @cached_property
    def _rank(self) -> VertexNumbers:
        """Which vertices stand for others: singular ones, beyond as many sides as possible."""
        sides = [beyond >= 0.0 for *_, beyond in _sides(self.eset, self.box)]
        return np.asarray(
            np.sum([*sides, (len(sides) + 1) * are_singular(self.eset.kinds)], axis=0)
        )

    @cached_property
    def _clipped(self) -> Float[np.ndarray, "V P"]:
        """Parameters of the nearest points of the box."""
        p, free = self.eset.points.p.copy(), self.eset.setting.free
        p[:, free] = np.clip(p[:, free], self.box.lower, self.box.upper)
        return p

    def _lifted(self, rows: Items) -> Pinned:
        """States lifted straight to sides, with the index that they had."""
        eset, start, p = self.eset, self.eset.points[rows], self._clipped[rows]
        z, found = start.z.copy(), np.zeros(len(rows), bool)
        there, which = lift_to(start, p, eset.constraints)
        same = eset.structure.index(there, p[which]) == eset.index[rows[which]]
        z[which[same]], found[which[same]] = there[same], True
        return Pinned(z, p, found)

    def _on_curves(self, curved: VertexFlags) -> Iterator[tuple[Items, Pinned]]:
        """Vertices on folds, constraints and crossings beyond sides, and such points on sides.

        As many parameters move as there are conditions, in any way that finds a point: the nearest
        one counts.
        """
        eset, d = self.eset, len(self.box.names)
        for kind in (VertexKind.FOLD, VertexKind.CAP, VertexKind.CORNER, VertexKind.CROSSING):
            rows = np.flatnonzero(curved & self._beyond & (eset.kinds == kind))
            ways = list(combinations(range(d), 2 if kind == VertexKind.CORNER else 1))
            if len(rows) == 0 or not ways:
                continue
            found = [self._settled(rows, kind, np.eye(d)[list(way)]) for way in ways]
            place = embed(eset.setting, eset.points.z[rows], eset.points.p[rows])
            moves = [embed(eset.setting, at.z, at.p) - place for at in found]
            away = np.linalg.norm(moves, axis=2)
            away[~np.stack([at.found for at in found])] = np.inf
            best = away.argmin(axis=0)
            for k, at in enumerate(found):
                yield rows[best == k], at.take(np.flatnonzero(best == k))
            if kind == VertexKind.FOLD and d > 1:
                left = rows[np.isinf(away.min(axis=0))]
                yield left, self._cusps(left)

    def _settled(self, rows: Items, kind: VertexKind, span: Float[np.ndarray, "k d"]) -> Pinned:
        """Points on a fold, constraint or crossing in the box, where some parameters may move."""
        eset = self.eset
        z, p = eset.points.z[rows].copy(), self._clipped[rows]
        fold = kind in {VertexKind.FOLD, VertexKind.CORNER}
        cap = kind in {VertexKind.CAP, VertexKind.CORNER}
        place = embed(eset.setting, z, p)
        spans = np.tile(span, (len(rows), 1, 1))
        crossing = kind == VertexKind.CROSSING
        aim = Aim(eset.setting, fold, cap, spans, place, place[:, None][:, :0], crossing=crossing)
        return self._in_box(correct_points(aim, z, p, np.zeros(len(rows))))

    def _cusps(self, rows: Items) -> Pinned:
        """Cusps in sides, as on lines of symmetry, which folds lead to from vertices beyond."""
        eset, structure = self.eset, self.eset.structure
        tests = (lambda at: at.g, lambda at: at.quadratic)
        locus = Locus(structure, eset.setting.base, eset.setting.free, tests)
        spots, found = nearest(locus, locus.join(eset.points.z[rows], self._clipped[rows]))
        z, p = locus.split(spots.x)
        moves = embed(eset.setting, z, p) - places_of(eset)[rows]
        found &= np.linalg.norm(moves, axis=1) < [self._room(row) for row in rows.tolist()]
        return self._in_box(Pinned(z, p, found))

    def _in_box(self, at: Pinned) -> Pinned:
        """Points, found only if they are in the box; there they lie on sides to the last digit."""
        free = at.p[:, self.eset.setting.free]
        at.found[~self.box.holds(free, ON_SIDE)] = False
        at.p[:, self.eset.setting.free] = np.clip(free, self.box.lower, self.box.upper)
        return at

    def _coinciding(self, points: States) -> Pairs:
        """Vertices that have come to the same point of a side."""
        box, at = self.box, points.p[:, self.eset.setting.free]
        rows = np.flatnonzero(((at <= box.lower) | (at >= box.upper)).any(axis=1))
        place = embed(self.eset.setting, points.z[rows], points.p[rows])
        return np.asarray(rows[cKDTree(place).query_pairs(SAME_VERTEX, output_type="ndarray")])

    def _swallowed(self, points: States, found: VertexFlags) -> Pairs:
        """Vertices that cannot go to a side because it is singular there, and what is nearby.

        That is a point of a fold or crossing that lies between, or at the place itself.
        """
        eset = self.eset
        lost = np.flatnonzero(~found)
        met = np.flatnonzero(found & are_singular(eset.kinds) & self._beyond)
        there = self._clipped[lost][:, None] - points.p[met][None]
        near = (np.abs(there[:, :, eset.setting.free]) <= self._near).all(axis=2)
        place = embed(eset.setting, points.z, points.p)
        pairs = [
            (row, other)
            for row, own in zip(lost.tolist(), near, strict=True)
            for other in met[own].tolist()
            if np.linalg.norm(place[row] - place[other]) < self._room(row)
        ]
        return np.array(pairs, int).reshape(-1, 2)

    def _room(self, row: int) -> float:
        """How far a vertex may go: a share of the distance from the nearest one in the box."""
        around = np.unique(self.eset.cells[(self.eset.cells == row).any(axis=1)])
        around = around[~self._beyond[around]]
        places = places_of(self.eset)
        gaps = np.linalg.norm(places[around] - places[row], axis=1)
        return NEARER * float(gaps.min(initial=np.inf))


def _cut_off(eset: EquilibriumSet, box: Box, axis: int, *, lower: bool) -> EquilibriumSet:
    """The set without what still lies beyond a side, cut along it."""
    bound, sign = (box.lower[axis], -1.0) if lower else (box.upper[axis], 1.0)

    def excess(at: Vertices | States) -> Float[np.ndarray, " n"]:
        return np.asarray(sign * (at.p[:, eset.setting.free[axis]] - bound))

    beyond = excess(eset.points)
    beyond[np.abs(beyond) <= ON_SIDE * (box.upper - box.lower)[axis]] = 0.0
    if not (beyond > 0.0).any():
        return eset
    ranges = dict(zip(box.names, zip(box.lower, box.upper, strict=True), strict=True))
    ranges[box.names[axis]] = (eset.box.lower[axis], eset.box.upper[axis])
    own = replace(eset, box=Box(**ranges))
    cut = cut_along(own, beyond[sheets_of(own).origin], excess)
    inside = (cut.values[cut.recut.cells] < 0.0).any(axis=1)  # where none was cut, they stay whole
    out = part_of(cut.recut, inside, np.zeros(len(cut.recut.points), bool), cut.lost)
    return replace(out, box=eset.box)
