"""From discs and balls to the cells of a set, and from these to the set itself."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np

from equimorph.arrays import Bool, CellNumbers, Facets, Float, Int, Items, Pairs
from equimorph.manifold.complex.base_mesh import BaseMesh
from equimorph.manifold.complex.description import Complex, Frame, Lifting, describe
from equimorph.manifold.complex.equilibrium_set import EquilibriumSet
from equimorph.manifold.geometry.points import VertexKind
from equimorph.manifold.geometry.topology import PAIR, flags_of
from equimorph.manifold.lifting.balls import Balls, fill
from equimorph.manifold.lifting.crossing_branches import lonely
from equimorph.manifold.lifting.discs import Discs, assemble, sides_among, sides_of
from equimorph.manifold.lifting.edges import EFFORTS
from equimorph.manifold.lifting.grid import longest_edges
from equimorph.manifold.lifting.loops import find_loops
from equimorph.manifold.lifting.pairing import Pairing, abandoned_rays
from equimorph.structures import States


@dataclass(frozen=True)
class Seen:
    """Grid triangles with the curves and points around them: what hangs on these, is kept."""

    triangles: Int[np.ndarray, "T 3"]
    around: Float[np.ndarray, "T 6"]

    @classmethod
    def of(cls, pairing: Pairing) -> "Seen":
        """All triangles of the mesh."""
        return cls(pairing.mesh.triangles, _around(pairing))

    def same(self, known: "Seen | None") -> Bool[np.ndarray, " T"]:
        """Which triangles have not changed since then."""
        same = np.zeros(len(self.triangles), bool)
        if known is not None:
            count = len(known.triangles)
            same[:count] = (self.triangles[:count] == known.triangles).all(axis=1)
            same[:count] &= (self.around[:count] == known.around).all(axis=1)
        return same


@dataclass(frozen=True)
class Areas:
    """Discs, with what they depend on."""

    seen: Seen
    discs: Discs


@dataclass(frozen=True)
class Volumes:
    """Discs and balls, with what they depend on."""

    areas: Areas
    tetrahedra: Int[np.ndarray, "N 4"]
    faces: Int[np.ndarray, "N 4"]
    balls: Balls


def volumes_over(pairing: Pairing, known: Volumes | None) -> Volumes:
    """Balls over all grid tetrahedra; those that are known stay where nothing changed."""
    mesh = pairing.mesh
    areas, same = areas_over(pairing, None if known is None else known.areas)
    kept = np.zeros(len(mesh.tetrahedra), bool)
    if known is not None:
        count = len(known.tetrahedra)
        kept[:count] = (mesh.tetrahedra[:count] == known.tetrahedra).all(axis=1)
        kept[:count] &= (mesh.faces[:count] == known.faces).all(axis=1)
        kept &= same[mesh.faces].all(axis=1)
        kept[known.balls.doubtful] = False
    balls = fill(pairing, areas.discs, ~kept)
    balls = balls if known is None else _with_balls(balls, known.balls, kept)
    return Volumes(areas, mesh.tetrahedra, mesh.faces, balls)


def areas_over(pairing: Pairing, known: Areas | None) -> tuple[Areas, Bool[np.ndarray, " T"]]:
    """Discs over all grid triangles, and which of these are certain, and the same as before.

    Those that are known stay where nothing changed.
    """
    seen = Seen.of(pairing)
    same = seen.same(None if known is None else known.seen)
    if known is not None:
        same[known.discs.doubtful] = False
        tips = np.array(list(pairing.tips), int).reshape(-1, 2)
        same[known.discs.owner[sides_among(known.discs.corners, tips).any(axis=1)]] = False
    discs = assemble(pairing, find_loops(pairing, ~same))
    discs = discs if known is None else _with_discs(discs, known.discs, same)
    same[discs.doubtful] = False
    return Areas(seen, discs), same


def _around(pairing: Pairing) -> Float[np.ndarray, "T 6"]:
    """Curves and points of each triangle; if they change, its discs are computed again."""
    mesh, points, curves = pairing.mesh, pairing.points, pairing.curves
    rays = pairing.rays[: points.count]
    in_use = np.zeros(curves.count, bool)
    in_use[rays[rays >= 0]] = True
    live = np.flatnonzero(in_use)
    edge = curves.edge[live]
    # sums of irrational shares differ for different sets of curves
    share = np.modf((live + 1) * np.sqrt(2.0))[0]
    of_edge = np.bincount(edge, share, len(mesh.edges)).astype(float)
    for own, arcs in pairing.arcs.items():
        of_edge[own] += len(arcs) * np.sqrt(3.0)
    vertex = points.vertex[: points.count]
    of_vertex = np.bincount(vertex[vertex >= 0], minlength=len(mesh.vertices))
    return np.concatenate([of_edge[mesh.sides], of_vertex[mesh.triangles]], axis=1)


def _with_discs(new: Discs, known: Discs, same: Bool[np.ndarray, " T"]) -> Discs:
    """New discs, and known ones over triangles that are the same."""
    kept = same[known.owner]
    sides = sides_of(known.corners[kept])

    def join(name: str) -> np.ndarray:
        return np.concatenate([getattr(new, name), getattr(known, name)[kept]])

    def marked(name: str) -> Pairs:
        pairs = getattr(known, name)
        return np.concatenate([getattr(new, name), pairs[flags_of(pairs, sides)]])

    return replace(
        new,
        **{name: join(name) for name in ("corners", "index", "owner", "met", "sheet")},
        **{name: marked(name) for name in ("folds", "caps", "crossings")},
    )


def _with_balls(new: Balls, known: Balls, kept: Bool[np.ndarray, " N"]) -> Balls:
    """New balls, and known ones over tetrahedra that are the same."""

    def join(name: str, owner: str) -> Int[np.ndarray, "..."]:
        own = kept[getattr(known, owner)]
        return np.concatenate([getattr(new, name), getattr(known, name)[own]])

    return replace(
        new,
        **{name: join(name, "owner") for name in ("corners", "index", "owner")},
        **{name: join(name, "fold_owner") for name in ("folds", "fold_owner")},
        **{name: join(name, "cap_owner") for name in ("caps", "cap_owner")},
        **{name: join(name, "crossing_owner") for name in ("crossings", "crossing_owner")},
    )


def _nothing() -> Int[np.ndarray, " 0"]:
    return np.zeros(0, int)


@dataclass(frozen=True)
class Cells:
    """Segments, triangles or tetrahedra of points with their index, and facets of three kinds.

    corners (C, d + 1), index (C,); folds, caps, crossings: facets on folds, on constraints and
    where sheets cross; doubtful: grid cells over which the set is undecided; touching: free
    parameters of points at which sheets touch (see `approaches`); astray: see `Discs`.
    """

    corners: Int[np.ndarray, "C corners"]
    index: CellNumbers
    folds: Int[np.ndarray, "f d"]
    caps: Int[np.ndarray, "c d"]
    crossings: Int[np.ndarray, "x d"]
    doubtful_triangles: Int[np.ndarray, " t"] = field(default_factory=_nothing)
    doubtful_tetrahedra: Items = field(default_factory=_nothing)
    touching: Float[np.ndarray, "places axes"] = field(default_factory=lambda: np.zeros((0, 0)))
    astray: Int[np.ndarray, "a 4"] = field(default_factory=lambda: np.zeros((0, 4), int))

    @property
    def doubtful(self) -> int:
        """Number of grid cells in doubt."""
        return len(self.doubtful_triangles) + len(self.doubtful_tetrahedra)

    def longest_edges(self, mesh: BaseMesh) -> Items:
        """Longest edge of each doubtful grid cell, relative to the box."""
        around = mesh.faces[self.doubtful_tetrahedra]
        groups = mesh.sides[self.doubtful_triangles], mesh.sides[around].reshape(len(around), 12)
        return np.unique(np.concatenate([longest_edges(mesh, sides) for sides in groups]))


Close = Callable[[Pairing], tuple[Discs, Balls]]


HOPELESS = 50
"""Undecided cells from which on bisection may end before it has gone far."""
MULTIPLIED = 4
"""Undecided cells, over what there were at first, beyond which bisection ends."""
GROWN = 3
"""Equilibria, over what there were at first, that must have paid: fewer cells are undecided."""
CHEAP = 5000
"""Equilibria up to which it need not have paid: strips far narrower than cells show late."""
FOUND = 1.1
"""States over the vertices of a grid, relative to what there were, from which on it is judged anew.
"""


@dataclass(frozen=True)
class Outlook:
    """Undecided cells and equilibria of a grid before it is bisected; its vertices, states there.

    See docs/decisions.md, "Bisection ends where it does not help".
    """

    doubtful: int
    points: int
    vertices: int
    states: int

    @classmethod
    def of(cls, pairing: Pairing, cells: Cells) -> "Outlook":
        """Return that of a grid."""
        vertices = len(pairing.mesh.vertices)
        states = pairing.points.over_first(vertices)
        return cls(cells.doubtful, pairing.points.count, vertices, states)

    def renewed(self, pairing: Pairing, cells: Cells) -> "Outlook":
        """Return that of the grid as it is now if many states have been found over its vertices.

        What they bring in doubt is no fault of bisection.
        """
        found = pairing.points.over_first(self.vertices)
        return Outlook.of(pairing, cells) if found > FOUND * self.states else self

    @staticmethod
    def is_dim(cells: Cells) -> bool:
        """Whether so much is undecided that bisection may have ended."""
        return cells.doubtful > HOPELESS

    @staticmethod
    def is_crowded(pairing: Pairing, cells: Cells) -> bool:
        """Whether much is undecided, and halving these cells would lead beyond the limit.

        As many rounds of bisection as there are parameters halve cells.
        """
        share = min(cells.doubtful / max(len(pairing.mesh.cells), 1), 1.0)
        growth = (1.0 + share) ** pairing.mesh.dimension
        return Outlook.is_dim(cells) and pairing.points.count * growth > pairing.limit

    def is_hopeless(self, pairing: Pairing, cells: Cells) -> bool:
        """Whether bisection leads nowhere: doubt multiplies, persists, or there is no room.

        Along a line where the set is singular doubt only multiplies; elsewhere it vanishes.
        """
        grown = pairing.points.count > max(GROWN * self.points, CHEAP)
        persists = cells.doubtful >= self.doubtful and grown
        if pairing.is_full or not self.is_dim(cells):
            return pairing.is_full or (persists and self.doubtful > 0)
        multiplies = cells.doubtful > MULTIPLIED * self.doubtful
        return multiplies or persists or self.is_crowded(pairing, cells)


class CellFinder:
    """Finds the cells of the set over a mesh that is being bisected."""

    def __init__(self) -> None:
        self._areas: Areas | None = None
        self._volumes: Volumes | None = None

    def find(self, pairing: Pairing, close: Close | None = None) -> Cells:
        """Cells of the set over a mesh whose edges are all lifted.

        `close` finds all discs and balls; without it, those are kept that have not changed.
        """
        if pairing.mesh.dimension == 1:
            return _segments(pairing)
        if pairing.mesh.dimension == 2:
            if close and self._areas is None:
                self._areas = Areas(Seen.of(pairing), close(pairing)[0])
            else:
                self._areas, _ = areas_over(pairing, self._areas)
            discs = self._areas.discs
            marked = (discs.folds, discs.caps, discs.crossings)
            return Cells(discs.corners, discs.index, *marked, discs.doubtful, astray=discs.astray)
        if close and self._volumes is None:
            mesh, (discs, balls) = pairing.mesh, close(pairing)
            areas = Areas(Seen.of(pairing), discs)
            self._volumes = Volumes(areas, mesh.tetrahedra, mesh.faces, balls)
        else:
            self._volumes = volumes_over(pairing, self._volumes)
        discs, balls = self._volumes.areas.discs, self._volumes.balls
        marked = (balls.folds, balls.caps, balls.crossings)
        return Cells(
            balls.corners, balls.index, *marked, discs.doubtful, balls.doubtful,
            astray=discs.astray,
        )  # fmt: skip


def _segments(pairing: Pairing) -> Cells:
    """Pieces of the lifted edges between their points."""
    points, curves = pairing.points, pairing.curves
    pairs: list[tuple[int, int]] = []
    for curve, (edge, start, end) in enumerate(
        zip(curves.edge.tolist(), curves.start.tolist(), curves.end.tolist(), strict=True)
    ):
        if pairing.ray(start, edge) == curve:
            line = [start, *curves.inner.get(curve, []), *([end] if end >= 0 else [])]
            pairs.extend(pairwise(line))
    for arc in (arc for arcs in pairing.arcs.values() for arc in arcs):
        pairs.extend(pairwise(arc))
    corners = np.array(pairs, int).reshape(-1, 2)
    kind, index = points.kind[: points.count], points.index[: points.count]
    # of two neighbours on a curve at most one is singular
    regular = np.where(
        np.isin(kind[corners[:, 0]], (VertexKind.FOLD, VertexKind.CROSSING)),
        corners[:, 1],
        corners[:, 0],
    )
    used = np.unique(corners)
    marked = (
        used[kind[used] == each, None]
        for each in (VertexKind.FOLD, VertexKind.CAP, VertexKind.CROSSING)
    )
    return Cells(corners, index[regular], *marked)


def account(pairing: Pairing, cells: Cells, frame: Frame, bisected: int) -> EquilibriumSet:
    """Number the used points, find pieces, folds and boundaries, and write the audit."""
    used = np.flatnonzero(np.bincount(cells.corners.ravel(), minlength=pairing.points.count))
    number = np.full(pairing.points.count, -1)
    number[used] = np.arange(len(used))
    store = pairing.points
    whole = Complex(
        States(pairing.setting.structure, store.z.take(used, axis=0), store.p.take(used, axis=0)),
        store.kind[used],
        store.index[used],
        store.vertex[used],
        number[cells.corners],
        cells.index,
        _facets_in_use(number[cells.folds]),
        _facets_in_use(number[cells.caps]),
        _facets_in_use(number[cells.crossings]),
    )
    lost = abandoned_rays(pairing)
    lifting = Lifting(
        len(lost),
        sum(int(pairing.effort[edge]) >= EFFORTS for _, edge in lost),
        pairing.conflicts,
        _parity_violations(pairing),
        cells.doubtful if len(pairing.setting.free) > 1 else len(lonely(pairing)),
        bisected,
    )
    return describe(frame, whole, lifting)


def _facets_in_use(facets: Facets) -> Int[np.ndarray, "m d"]:
    """Facets whose points are all in use."""
    return facets[(facets >= 0).all(axis=1)]


def _parity_violations(pairing: Pairing) -> int:
    """Curves whose ends contradict sign det F_z: equal parity across, opposite on return.

    It is the other way round behind a crossing, where det [F_z F_t; tᵀ] changes its sign, but not
    where the index changes by a pair.
    """
    curves, points = pairing.curves, pairing.points
    own = np.repeat(list(curves.inner), [len(inner) for inner in curves.inner.values()])
    inner = np.array([point for inner in curves.inner.values() for point in inner], int)
    crossings = own[points.kind[inner] == VertexKind.CROSSING].astype(int)
    crossed = np.bincount(crossings, minlength=curves.count)
    for curve in np.unique(crossings).tolist():
        way = [int(curves.start[curve]), *curves.inner[curve], int(curves.end[curve])]
        at = np.flatnonzero(points.kind[way[1:-1]] == VertexKind.CROSSING)
        change = points.index[np.take(way, at)] - points.index[np.take(way, at + 2)]
        crossed[curve] -= np.count_nonzero(np.abs(change) == PAIR)
    closed = curves.end >= 0
    start, end = curves.start[closed], curves.end[closed]
    returned = (points.vertex[start] == points.vertex[end]).astype(int)
    change = points.index[start] - points.index[end] - returned - crossed[closed]
    return int((change % 2 == 1).sum())
