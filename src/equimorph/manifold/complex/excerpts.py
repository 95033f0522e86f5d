"""Some cells of a set as a fabric that is to be cut, and what the set becomes by the cuts."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from equimorph.arrays import (
    CellFlags,
    CellNumbers,
    Cells,
    Facets,
    Float,
    Int,
    Items,
    VertexFlags,
    VertexNumbers,
)
from equimorph.manifold.complex.description import Complex
from equimorph.manifold.complex.equilibrium_set import EquilibriumSet
from equimorph.manifold.complex.kept_tables import kept, places_of
from equimorph.manifold.complex.marked_complex import (
    TRIANGLES,
    Fabric,
    FacetMark,
    first_copies_of,
)
from equimorph.manifold.complex.vertices import (
    Vertices,
    among_unframed,
    on_constraints,
    vertices_of,
)
from equimorph.manifold.geometry.points import VertexKind, on_fold
from equimorph.manifold.geometry.simplices import squared_sides
from equimorph.manifold.geometry.tangents import best_corners
from equimorph.manifold.geometry.topology import (
    Adjacency,
    adjacency,
    count_corners,
    cut_at_crossings,
    facets_of,
    flags_of,
    senses,
)
from equimorph.structures import States
from equimorph.tolerances import ON_SIDE


@dataclass(frozen=True)
class Sheets:
    """The cells of a set, with its sheets parted where they cross, and what their facets lie on.

    Corners of triangles and tetrahedra are so ordered that all are oriented alike, as far as
    possible as the parity of their index says.

    origin: vertex of the set that each vertex of the cells is; signs: orientation of the cells;
    marks: of the facets of `whole`; see `FacetMark`.
    """

    cells: Cells
    origin: VertexNumbers
    signs: CellNumbers
    whole: Adjacency
    marks: Int[np.ndarray, " F"]
    shared: VertexNumbers


@kept
def sheets_of(eset: EquilibriumSet) -> Sheets:
    """The sheets of a set."""
    d = len(eset.names)
    crossings, folds = (facets_of(pieces, d) for pieces in (eset.crossings, eset.folds))
    cells, origin = cut_at_crossings(eset.cells, crossings, len(eset.points))
    cells = cells.copy()
    whole = adjacency(cells) if eset.crossings else eset.adjacency
    signs = senses(cells, eset.cell_index, eset.coordinates[origin], whole).signs
    place = origin[whole.facets]
    folded, crossed = (flags_of(place, each) for each in (folds, crossings))
    outer = whole.counts == 1
    marks = np.where(folded, FacetMark.FOLD, 0) | np.where(crossed, FacetMark.CROSSING, 0)
    outer_marks = _outer_marks(eset, place[outer])
    # of parts of sets folds are boundaries, too
    marks[outer] |= np.where(marks[outer] > 0, outer_marks & ~FacetMark.HOLE, outer_marks)
    if d >= TRIANGLES:
        against = signs < 0
        cells[against, -2:] = cells[against, :-3:-1]
        signs = np.where(against, 1, signs)
    shared = np.where(np.isin(origin, crossings), origin, -1)
    return Sheets(cells, origin, signs, whole, marks, shared)


def _outer_marks(eset: EquilibriumSet, facets: Facets) -> Items:
    """On what facets of the boundary lie: on a side of the box, else on the constraint."""
    places = eset.coordinates[facets]
    size = eset.box.upper - eset.box.lower
    marks = np.zeros(len(facets), int)
    for side, bound in enumerate((eset.box.lower, eset.box.upper)):
        on = (np.abs(places - bound) <= ON_SIDE * size).all(axis=1)
        for k in range(len(size)):
            marks |= np.where(on[:, k], FacetMark.SIDE << (2 * k + side), 0)
    capped = np.isin(eset.kinds, (VertexKind.CAP, VertexKind.CORNER))
    met = np.flatnonzero(eset.kinds == VertexKind.CROSSING)
    capped[met] = on_constraints(eset.setting, eset.points.z[met], eset.points.p[met])
    return np.where(
        marks > 0, marks, np.where(capped[facets].all(axis=1), FacetMark.CAP, FacetMark.HOLE)
    )


@dataclass(frozen=True, eq=False)
class Excerpt:
    """Some cells of a set as a fabric, which costs nothing for the others."""

    eset: EquilibriumSet
    """The set."""
    fabric: Fabric
    """The cells, before they are cut."""
    numbers: Int[np.ndarray, " own"]
    """Their numbers in the set."""
    used: VertexNumbers
    """Vertices of the fabric, as numbers of those of `sheets_of` the set."""

    def put_back(self, fabric: Fabric | None = None) -> "Recut":
        """The set with the cells of the excerpt replaced by what was made of them, if anything.

        The first cells of `fabric` are what is left of those of the excerpt, and its first vertices
        are those of the excerpt.
        """
        fabric = fabric or self.fabric
        sheets, count, own = sheets_of(self.eset), len(self.used), len(self.numbers)
        more = fabric.vertices.take(np.arange(count, len(fabric.vertices)))
        number = np.concatenate([self.used, len(sheets.origin) + np.arange(len(more))])
        made, cells, index = number[fabric.cells], sheets.cells.copy(), self.eset.cell_index.copy()
        fresh = np.ones(len(cells) + len(made) - own, bool)
        fresh[: len(cells)] = False
        fresh[self.numbers] = (made[:own] != cells[self.numbers]).any(axis=1)
        cells[self.numbers], index[self.numbers] = made[:own], fabric.cell_index[:own]
        known = sheets.marks > 0
        return Recut(
            self.eset,
            more,
            np.concatenate([cells, made[own:]]),
            np.concatenate([index, fabric.cell_index[own:]]),
            np.concatenate([sheets.whole.facets[known], number[fabric.facets]]),
            np.concatenate([sheets.marks[known], fabric.marks]),
            fresh,
        )


@dataclass(frozen=True, eq=False)
class Recut:
    """A set some of whose cells were cut: the vertices of its sheets, then new ones."""

    eset: EquilibriumSet
    """The set."""
    more: Vertices
    """New vertices."""
    cells: Cells
    cell_index: CellNumbers
    """All cells."""
    facets: Int[np.ndarray, "F d"]
    marks: Int[np.ndarray, " F"]
    """Marked facets, those that were cut among them."""
    fresh: CellFlags
    """Cells that the set does not have."""

    @cached_property
    def points(self) -> VertexNumbers:
        """For each vertex the first one that is the same point."""
        return first_copies_of(np.concatenate([sheets_of(self.eset).shared, self.more.shared]))

    @property
    def numbers(self) -> VertexNumbers:
        """Numbers of the vertices in the complex of all cells; −1 for those that it leaves out."""
        return self._numbers(self.cells)

    def _numbers(self, cells: Cells) -> VertexNumbers:
        held = np.zeros(len(self.points), bool)
        held[self.points[cells]] = True
        return np.asarray(np.where(held, np.cumsum(held) - 1, -1)[self.points])

    def states(self, some: VertexNumbers) -> States:
        """States of some of the vertices."""
        points = self.eset.points
        z, p = (self._column(old, name, some) for old, name in ((points.z, "z"), (points.p, "p")))
        return States(self.eset.structure, z, p)

    def _column(self, old: np.ndarray, name: str, some: VertexNumbers) -> np.ndarray:
        """What is known of some vertices, given that of the set's vertices."""
        origin, more = sheets_of(self.eset).origin, getattr(self.more, name)
        first = some < len(origin)
        out = np.empty((len(some), *old.shape[1:]), old.dtype)
        out[first], out[~first] = old[origin[some[first]]], more[some[~first] - len(origin)]
        return out

    def complex(self, chosen: CellFlags, on_level: VertexFlags) -> Complex:
        """Some of the cells; facets on a level, a boundary of theirs, lie on a constraint."""
        cells = self.cells[chosen]
        facets, marks = self._marked(cells, on_level)
        number = self._numbers(cells)
        used = np.flatnonzero((number >= 0) & (self.points == np.arange(len(number))))
        kinds, index, grid_vertex = (
            self._column(getattr(self.eset, name), name, used)
            for name in ("kinds", "index", "grid_vertex")
        )
        plain = on_level[used] & (kinds != VertexKind.CROSSING)
        kinds[plain] = np.where(on_fold(kinds[plain]), VertexKind.CORNER, VertexKind.CAP)
        lying = (
            number[facets[(marks & mark) > 0]]
            for mark in (FacetMark.FOLD, FacetMark.CAP, FacetMark.CROSSING)
        )
        folds, caps, crossings = (each[(each >= 0).all(axis=1)] for each in lying)
        return Complex(
            self.states(used),
            kinds,
            index,
            grid_vertex,
            number[cells],
            self.cell_index[chosen],
            folds,
            caps,
            crossings,
            self.fresh[chosen],
        )

    def _marked(self, cells: Cells, on_level: VertexFlags) -> tuple[Facets, Items]:
        """Marked facets, and those of some cells that lie on the level."""
        whole = (self.marks & FacetMark.HOLE) == 0
        facets, marks = self.facets[whole], self.marks[whole]
        # both cells of a facet on the level have all its corners there
        near = cells[count_corners(on_level, cells) >= facets.shape[1]]
        if len(near) == 0:
            return facets, marks
        hull = adjacency(near)
        outer = hull.facets[hull.counts == 1]
        capped = outer[on_level[outer].all(axis=1)]
        caps = np.full(len(capped), FacetMark.CAP)
        return np.concatenate([facets, capped]), np.concatenate([marks, caps])


def excerpt_of(
    eset: EquilibriumSet, chosen: CellFlags, framed: VertexFlags | None = None
) -> Excerpt:
    """Some cells of a set as a fabric; all of a set whose sheets cross, if any.

    A cut of one sheet continues on those that it crosses.

    framed: vertices of the set at which frames are needed; all of the cells if None. Frames take
    most of the time.
    """
    sheets = sheets_of(eset)
    if eset.crossings and chosen.any() and (framed is None or framed.any()):
        chosen, framed = np.ones(len(chosen), bool), None
    numbers = np.flatnonzero(chosen)
    held = np.zeros(len(sheets.origin), bool)
    held[sheets.cells[numbers]] = True
    used = np.flatnonzero(held)
    number = np.cumsum(held) - 1
    own = sheets.origin[used]
    some = np.ones(len(used), bool) if framed is None else framed[own]
    known = {name: getattr(eset, name)[own] for name in ("kinds", "index", "grid_vertex")}
    known |= {"z": eset.points.z[own], "p": eset.points.p[own]}
    rows = _planes(eset, used[some])
    vertices = vertices_of(eset.setting, rows=rows, **{k: each[some] for k, each in known.items()})
    if not some.all():
        vertices = among_unframed(vertices, some, places_of(eset)[own], known)
    vertices = replace(vertices, shared=sheets.shared[used])
    facets = np.zeros(len(sheets.marks), bool)
    facets[sheets.whole.cell_facets[numbers]] = True
    facets &= sheets.marks > 0
    cells = number[sheets.cells[numbers]]
    fabric = Fabric(
        eset.setting,
        np.stack([eset.box.lower, eset.box.upper]),
        vertices,
        cells,
        eset.cell_index[numbers],
        number[sheets.whole.facets[facets]],
        sheets.marks[facets],
        squared_sides(vertices.place, cells),
    )
    return Excerpt(eset, fabric, numbers, used)


def _planes(
    eset: EquilibriumSet, vertices: VertexNumbers
) -> Float[np.ndarray, "some d coordinates"]:
    """Planes of cells around some vertices of the sheets of a set; see `best_corners`."""
    sheets = sheets_of(eset)
    some = np.zeros(len(sheets.origin), bool)
    some[vertices] = True
    around = np.flatnonzero(count_corners(some, sheets.cells) > 0)
    near, corners = np.unique(sheets.cells[around], return_inverse=True)
    corners = corners.reshape(-1, sheets.cells.shape[1])
    own = sheets.origin[near]
    z, p = eset.points.z[own], eset.points.p[own]
    return best_corners(eset.setting, z, p, corners, sheets.signs[around], some[near])


def fabric_of(eset: EquilibriumSet, framed: VertexFlags | None = None) -> Fabric:
    """Return a whole set as a fabric: its sheets are parted where they cross.

    framed: vertices at which frames are needed; all if None.
    """
    return excerpt_of(eset, np.ones(len(eset.cells), bool), framed).fabric


def changing_cells(cells: Cells, values: Float[np.ndarray, " V"]) -> CellFlags:
    """Cells in which values at vertices have different signs."""
    own = values[cells]
    return np.asarray((own.min(axis=1) < 0.0) & (own.max(axis=1) > 0.0))
