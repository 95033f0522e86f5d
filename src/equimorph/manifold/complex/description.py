"""From a complex to an equilibrium set: pieces, folds, boundaries and the audit."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields, replace
from functools import partial

import numpy as np

from equimorph.arrays import Bool, CellFlags, CellNumbers, Cells, Float, Int, Items, VertexNumbers
from equimorph.linalg.lanes import start
from equimorph.manifold.complex.audit import Audit
from equimorph.manifold.complex.base_mesh import BaseMesh
from equimorph.manifold.complex.equilibrium_set import (
    Boundary,
    BoundaryKind,
    Component,
    EquilibriumSet,
    Stratum,
    with_audit,
)
from equimorph.manifold.complex.pinches import count_pinched
from equimorph.manifold.geometry.points import are_singular
from equimorph.manifold.geometry.setting import Setting
from equimorph.manifold.geometry.topology import (
    Adjacency,
    Senses,
    adjacency,
    count_unbalanced,
    cut_at_crossings,
    euler_characteristic,
    facets_of,
    flags_of,
    keys_of,
    labels,
    pieces,
    senses,
)
from equimorph.model import Box, Constraint, worst_relative_excess
from equimorph.structures import States
from equimorph.structures.margin import count_below

SHEETS_AT_A_CROSSING = 4
"""Cells around a facet in which two sheets cross."""


@dataclass(frozen=True)
class Complex:
    """Vertices, cells and marked facets, from which everything else about a set follows.

    index: negative eigenvalues at the vertices, kinds and grid_vertex as in `EquilibriumSet`;
    folds, caps, crossings (n, d): facets on folds, on constraints and where sheets cross; fresh:
    cells whose vertices were not checked yet, all if None.
    """

    points: States
    kinds: VertexNumbers
    index: VertexNumbers
    grid_vertex: VertexNumbers
    cells: Cells
    cell_index: CellNumbers
    folds: Int[np.ndarray, "f d"]
    caps: Int[np.ndarray, "c d"]
    crossings: Int[np.ndarray, "x d"]
    fresh: CellFlags | None = None

    @property
    def unchecked(self) -> "Complex":
        """The fresh cells with their vertices; facets are those of all."""
        if self.fresh is None:
            return self
        cells = self.cells[self.fresh]
        held = np.bincount(cells.ravel(), minlength=len(self.points)) > 0
        number = np.cumsum(held) - 1
        vertices = {name: getattr(self, name)[held] for name in ("kinds", "index", "grid_vertex")}
        return replace(
            self,
            points=self.points[held],
            cells=number[cells],
            cell_index=self.cell_index[self.fresh],
            fresh=None,
            **vertices,
        )


@dataclass(frozen=True)
class Frame:
    """What a set is about: the problem and the grid."""

    setting: Setting
    mesh: BaseMesh
    box: Box
    fixed: Mapping[str, float]
    intervals: tuple[int, ...]


COUNTED = (
    "checked", "missing", "recovered", "descents", "left_out", "on_lines", "starts", "arrived",
    "stopped", "cell_size", "touching", "grazing", "accuracy", "deviation", "unrefined",
)  # fmt: skip
"""What was counted as a set was lifted, searched and refined; other cells do not change it."""


@dataclass(frozen=True)
class Lifting:
    """The part of the audit that describes the lifting of the grid; see `Audit`."""

    unpaired: int
    conflicts: int
    retraced: int
    parity_violations: int
    undecided: int
    bisected: int


def describe(frame: Frame, given: Complex, lifting: Lifting) -> EquilibriumSet:
    """Pieces, folds, boundaries and audit of a complex."""
    corners, points = given.cells, given.points
    checked = start(partial(_check_points, given, frame.setting.constraints))
    whole = adjacency(corners)
    folds, caps, crossed = (
        flags_of(whole.facets, each) for each in (given.folds, given.caps, given.crossings)
    )
    component = labels(len(corners), whole.links)
    parting = folds | crossed
    stratum = labels(len(corners), whole.links[whole.manifold & ~parting[whole.across]])
    boundaries = _boundaries(
        whole,
        {
            BoundaryKind.CAP: caps,
            BoundaryKind.CROSSING: crossed,
            BoundaryKind.FOLD: folds,
        },
    )
    strata = tuple(
        Stratum(int(given.cell_index[own[0]]), len(own), int(component[own[0]]))
        for own in (np.flatnonzero(stratum == k) for k in range(stratum.max(initial=-1) + 1))
    )
    audit = _audit(given, lifting, crossed, whole, component, boundaries, frame, checked)
    eset = EquilibriumSet(
        structure=frame.setting.structure,
        box=frame.box,
        fixed=frame.fixed,
        constraints=frame.setting.constraints,
        intervals=frame.intervals,
        points=points,
        kinds=given.kinds,
        index=given.index,
        cells=corners,
        cell_index=given.cell_index,
        component=component,
        stratum=stratum,
        folds=tuple(pieces(whole.facets[folds])),
        boundaries=boundaries,
        components=_components(corners, given.cell_index, component, whole, boundaries),
        strata=strata,
        audit=audit,
        mesh=frame.mesh,
        grid_vertex=given.grid_vertex,
        crossings=tuple(pieces(whole.facets[crossed])),
    )
    vars(eset)["adjacency"] = whole  # it is asked for by checks and by most tasks
    return eset


def describe_again(eset: EquilibriumSet, given: Complex, setting: Setting) -> EquilibriumSet:
    """Describe a set whose cells have changed; what was counted as it was lifted is kept."""
    audit = eset.audit
    if audit.wrong:
        given = replace(given, fresh=None)
    lifting = Lifting(**{each.name: getattr(audit, each.name) for each in fields(Lifting)})
    frame = Frame(setting, eset.mesh, eset.box, dict(eset.fixed), eset.intervals)
    out = describe(frame, given, lifting)
    kept = {name: getattr(audit, name) for name in COUNTED}
    return with_audit(out, replace(out.audit, **kept))


def _boundaries(
    whole: Adjacency, flagged: Mapping[BoundaryKind, Bool[np.ndarray, " F"]]
) -> tuple[Boundary, ...]:
    """Pieces of the boundary; of facets of several kinds the first counts."""
    once = whole.counts == 1
    base = int(whole.facets.max(initial=0)) + 1
    marked, left = {}, once
    for kind, flags in flagged.items():
        marked[kind] = keys_of(whole.facets[left & flags], base)
        left = left & ~flags
    out = []
    for piece in pieces(whole.facets[once]):
        keys = keys_of(facets_of([piece], whole.facets.shape[1]), base)
        amounts = {kind: int(np.isin(keys, own).sum()) for kind, own in marked.items()}
        amounts[BoundaryKind.BOX] = len(keys) - sum(amounts.values())
        kinds = [kind for kind, amount in amounts.items() if amount]
        out.append(Boundary(piece, kinds[0] if len(kinds) == 1 else BoundaryKind.MIXED))
    return tuple(out)


def _components(
    corners: Cells,
    cell_index: CellNumbers,
    component: CellNumbers,
    whole: Adjacency,
    boundaries: tuple[Boundary, ...],
) -> tuple[Component, ...]:
    facets = _facets_of(whole, component)
    at_loops = np.array([boundary.vertices.flat[0] for boundary in boundaries], int)
    out = []
    for k in range(component.max(initial=-1) + 1):
        own = component == k
        held = np.zeros(int(corners.max(initial=0)) + 1, bool)
        held[corners[own]] = True
        out.append(
            Component(
                int(own.sum()),
                euler_characteristic(corners[own], facets[k]),
                int(held[at_loops].sum()),
                tuple(np.flatnonzero(np.bincount(cell_index[own])).tolist()),
            )
        )
    return tuple(out)


def _facets_of(whole: Adjacency, component: CellNumbers) -> list[int]:
    """Number of facets of each component."""
    of_facet = np.zeros(len(whole.facets), int)
    of_facet[whole.cell_facets] = component[:, None]
    return list(np.bincount(of_facet, minlength=component.max(initial=-1) + 1).tolist())


@dataclass(frozen=True)
class _Checked:
    """What is computed anew at all points: cells of wrong index or beyond bounds, and numbers."""

    wrong: CellFlags
    largest_residual: float
    unresolved: int


def _check_points(given: Complex, constraints: tuple[Constraint, ...]) -> _Checked:
    """Index, constraints, residual and resolution at all points."""
    points, new = given.points, given.unchecked
    wrong = np.zeros(len(given.cells), bool)
    fresh = slice(None) if given.fresh is None else given.fresh
    wrong[fresh] = contradictions(new.points, new.kinds, new.cells, new.cell_index)
    wrong[fresh] |= beyond_bounds(new.points, new.cells, constraints)
    residual = float(points.residual.max(initial=0.0))
    return _Checked(wrong, residual, int((~points.resolved).sum()))


def _audit(
    given: Complex,
    lifting: Lifting,
    crossed: Bool[np.ndarray, " F"],
    whole: Adjacency,
    component: CellNumbers,
    boundaries: tuple[Boundary, ...],
    frame: Frame,
    checked: Callable[[], _Checked],
) -> Audit:
    corners, cell_index, points = given.cells, given.cell_index, given.points
    coordinates, scales = points.p[:, frame.setting.free], frame.setting.scales
    crossings = whole.facets[crossed]
    sense = _senses(corners, cell_index, coordinates, crossings, whole, component)
    wrong = overturned_off_folds(given.kinds, corners, sense.overturned, coordinates / scales)
    at_points = checked()
    wrong |= at_points.wrong
    whole_crossing = whole.counts == SHEETS_AT_A_CROSSING
    most = np.where(crossed, SHEETS_AT_A_CROSSING, 2)
    kinds = [boundary.kind for boundary in boundaries]
    pinches = count_pinched(frame.setting, frame.box, points, given.kinds, corners, whole)
    return Audit(
        vertices=len(points),
        cells=len(corners),
        **vars(lifting),
        non_manifold=int((whole.counts > most).sum()) + pinches,
        crossings=int(crossed.sum()),
        contradictions=sense.contradictions
        + count_unbalanced(corners, cell_index, whole, sense, crossed & whole_crossing),
        overturned=int(sense.overturned.sum()),
        wrong=int(wrong.sum()),
        euler_characteristic=euler_characteristic(corners, len(whole.facets)),
        components=int(component.max(initial=-1)) + 1,
        loops=tuple((str(kind), kinds.count(kind)) for kind in sorted(set(kinds))),
        largest_residual=at_points.largest_residual,
        checked=0,
        missing=0,
        recovered=0,
        unresolved=at_points.unresolved,
    )


def _senses(
    cells: Cells,
    cell_index: CellNumbers,
    coordinates: Float[np.ndarray, "V d"],
    crossings: Int[np.ndarray, "crossed d"],
    whole: Adjacency,
    component: CellNumbers,
) -> Senses:
    """Senses of cells, parted at crossings: there two cells may belong to different sheets."""
    if len(crossings) == 0:
        return senses(cells, cell_index, coordinates, whole, component)
    parted, origin = cut_at_crossings(cells, crossings, len(coordinates))
    return senses(parted, cell_index, coordinates[origin], adjacency(parted))


def overturned_cells(eset: EquilibriumSet) -> CellFlags:
    """Return which cells project against the orientation that their index demands."""
    return senses(eset.cells, eset.cell_index, eset.coordinates, eset.adjacency).overturned


def wrong_cells(eset: EquilibriumSet) -> CellFlags:
    """Return which cells `Audit.wrong` counts."""
    coordinates, scales = eset.coordinates, eset.setting.scales
    crossings, whole = facets_of(eset.crossings, len(eset.names)), eset.adjacency
    sense = _senses(eset.cells, eset.cell_index, coordinates, crossings, whole, eset.component)
    off = overturned_off_folds(eset.kinds, eset.cells, sense.overturned, coordinates / scales)
    of_index = contradictions(eset.points, eset.kinds, eset.cells, eset.cell_index)
    return np.asarray(of_index | off | beyond_bounds(eset.points, eset.cells, eset.constraints))


SLIVER = 0.03
"""Height of a cell over its longest edge, below which it may be overturned next to folds."""
BEYOND = 1e-5
"""Excess of a vertex over a bound, relative to that, which is not that of its location."""
VANISHING = 1e-4
"""Size of the eigenvalues that may count either way at folds and where sheets cross."""
ROUND_OFF = 1e-9
"""Size of those that may count either way anywhere: vertices may lie on cusps in corners."""


def contradictions(
    points: States, kinds: VertexNumbers, cells: Cells, cell_index: CellNumbers
) -> CellFlags:
    """Cells with a vertex whose inertia is not that of their index.

    At folds, and where sheets cross, the eigenvalues that vanish may count or not.
    """
    low, high = points.inertia[0].copy(), points.inertia[0].copy()

    def widen(some: Items, vanishing: float) -> CellFlags:
        z, p = points.z[some], points.p[some]
        for bound, shift in ((low, -vanishing), (high, vanishing)):
            bound[some] = count_below(points.structure, z, p, shift)
        index = cell_index[:, None]
        return np.asarray(((index < low[cells]) | (index > high[cells])).any(axis=1))

    singular = np.flatnonzero(are_singular(kinds))
    off = widen(singular, VANISHING)
    return widen(np.setdiff1d(cells[off], singular), ROUND_OFF) if off.any() else off


def beyond_bounds(points: States, cells: Cells, constraints: tuple[Constraint, ...]) -> CellFlags:
    """Cells with a vertex that violates a constraint, as where its descriptor jumps."""
    beyond = worst_relative_excess(constraints, points.z, points.p) > BEYOND
    return np.asarray(beyond[cells].any(axis=1))


def overturned_off_folds(
    kinds: VertexNumbers, cells: Cells, overturned: CellFlags, place: Float[np.ndarray, "V d"]
) -> CellFlags:
    """Overturned cells without a vertex on a fold that are no slivers, in scaled parameters."""
    off = np.flatnonzero(overturned & ~are_singular(kinds)[cells].any(axis=1))
    corners = place[cells[off]]
    sides = corners[:, 1:] - corners[:, :1]
    longest = np.linalg.norm(corners[:, :, None] - corners[:, None], axis=3).max(axis=(1, 2))
    turned = np.zeros(len(cells), bool)
    turned[off] = np.abs(np.linalg.det(sides)) > SLIVER * longest ** sides.shape[1]
    return turned
