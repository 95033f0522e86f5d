"""The equilibrium set over one to three parameters: a simplicial complex of exact states."""

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from enum import StrEnum
from functools import cached_property

import numpy as np

from equimorph.argument_checks import check_arguments
from equimorph.arrays import CellNumbers, Cells, Facets, Flags, Float, Int, Numbers, VertexNumbers
from equimorph.errors import InputError
from equimorph.manifold.complex.audit import Audit
from equimorph.manifold.complex.base_mesh import BaseMesh
from equimorph.manifold.geometry.points import VertexKind
from equimorph.manifold.geometry.setting import Setting
from equimorph.manifold.geometry.topology import Adjacency, adjacency, facets_of
from equimorph.manifold.lookup.exact_states import StatesOver
from equimorph.manifold.lookup.holding import holding
from equimorph.manifold.lookup.near_crossings import NearCrossings, of_set
from equimorph.manifold.lookup.near_cusps import cusps_near
from equimorph.manifold.lookup.over import Sheets
from equimorph.model import Box, Constraint, parameter_vector, position
from equimorph.structures import States, Structure
from equimorph.tables import Table, Tabular, html_table, units_of
from equimorph.tolerances import IN_BOX


@dataclass(frozen=True)
class Component:
    """A connected piece of the set: size, topology, the indices that occur on it."""

    cells: int
    euler_characteristic: int
    loops: int
    indices: tuple[int, ...]


@dataclass(frozen=True)
class Stratum:
    """A connected piece of constant index."""

    index: int
    cells: int
    component: int


class BoundaryKind(StrEnum):
    """What a piece of the boundary lies on."""

    BOX = "box"
    CAP = "cap"
    """A constraint that bounds the set."""
    CROSSING = "crossing"
    FOLD = "fold"
    MIXED = "mixed"
    """Several of these."""


@dataclass(frozen=True)
class Boundary:
    """A connected piece of the boundary: on the box or a constraint.

    Boundaries of parts of sets may also lie on a fold or a crossing.

    vertices: one point (d = 1), a loop with the first vertex repeated (d = 2; an arc between ends
    of crossings, where there are such), or triangles, one a row (d = 3).
    """

    vertices: Int[np.ndarray, "..."]
    kind: BoundaryKind


@dataclass(frozen=True, eq=False)
class EquilibriumSet(Tabular):
    """Equilibria over a box in d = 1, 2 or 3 free parameters, with their connections.

    Vertices are exact states: over the grid, on folds, on constraints. Cells are segments,
    triangles or tetrahedra of constant index; folds lie between cells of different index.

    Parameters
    ----------
    points
        States of the vertices.
    kinds
        What each vertex lies on, see `VertexKind`.
    index
        Negative eigenvalues at the vertices; on folds that of the lower side.
    cells, cell_index, component, stratum
        Vertices of each cell, its index, and the numbers of the pieces that it belongs to.
    folds
        Connected folds: points (d = 1), vertices along each fold curve, closed ones with the first
        repeated (d = 2), or fold surfaces as triangles, one a row (d = 3).
    crossings
        Branch points of the set, in the same form: there two smooth sheets cross, as the symmetric
        and the asymmetric states do in symmetric slices.
    """

    structure: Structure
    box: Box
    fixed: Mapping[str, float]
    constraints: tuple[Constraint, ...]
    intervals: tuple[int, ...]
    points: States
    kinds: VertexNumbers
    index: VertexNumbers
    cells: Cells
    cell_index: CellNumbers
    component: CellNumbers
    stratum: CellNumbers
    folds: tuple[Int[np.ndarray, "..."], ...]
    boundaries: tuple[Boundary, ...]
    components: tuple[Component, ...]
    strata: tuple[Stratum, ...]
    audit: Audit
    mesh: BaseMesh
    grid_vertex: VertexNumbers
    """Vertex of `mesh` below each vertex of the complex, −1 for those not over the grid."""
    crossings: tuple[Int[np.ndarray, "..."], ...] = ()

    def __getstate__(self) -> dict[str, object]:
        """Return what copies and pickles keep: no tables that were computed of the set."""
        return {each.name: getattr(self, each.name) for each in fields(self)}

    def __repr__(self) -> str:
        """Box, size and whether the audit is clean."""
        state = "clean" if self.audit.clean else "NOT clean"
        return f"EquilibriumSet({self.box}: {len(self.cells)} cells; audit {state})"

    def _repr_html_(self) -> str:
        """Table of the box, the size and the audit, for notebooks."""
        units = units_of(self.structure.parameters)
        sides = zip(self.box.names, self.box.lower, self.box.upper, strict=True)
        rows: list[list[object]] = [
            [name, f"{low:g} to {high:g} {units[name]}"] for name, low, high in sides
        ]
        rows += [["equilibria (vertices)", len(self.points)], ["cells", len(self.cells)]]
        rows += [["components", len(self.components)], ["strata", len(self.strata)]]
        rows += [["folds", len(self.folds)], ["audit", str(self.audit)]]
        return html_table(f"Equilibrium set of a {self.structure.kind}", [], rows)

    @property
    def table(self) -> Table:
        """All vertices; see `frame`.

        Its columns are all parameters, what the vertex lies on (``kind``, see `VertexKind`), the
        ``index``, which is 0 where it is stable, the ``energy``, the descriptor that distinguishes
        states of the structure, and those that are bounded.
        """
        kinds = np.array([kind.name.lower() for kind in VertexKind])[self.kinds]
        bounded = (each.descriptor for each in self.constraints)
        return self.points.table_with({"kind": kinds, "index": self.index}, bounded)

    @property
    def names(self) -> tuple[str, ...]:
        """Free parameters."""
        return self.box.names

    @cached_property
    def coordinates(self) -> Float[np.ndarray, "V d"]:
        """Free parameters of the vertices."""
        return np.stack([self.points[name] for name in self.names], axis=1)

    @cached_property
    def adjacency(self) -> Adjacency:
        """Facets of the cells, and how they hang together."""
        return adjacency(self.cells)

    @cached_property
    def setting(self) -> Setting:
        """The structure, its free parameters and the constraints that bound the set."""
        low = dict(zip(self.names, self.box.lower.tolist(), strict=True))
        base = parameter_vector(self.structure.parameters, {**self.fixed, **low})
        free = [position(self.structure.parameters, name) for name in self.names]
        return Setting(self.structure, base, np.array(free), self.constraints)

    @check_arguments
    def parameters_at(self, at: Mapping[str, float]) -> Float[np.ndarray, " P"]:
        """All parameters over a point of the box.

        Raises
        ------
        InputError
            If a name is not that of a free parameter or is missing, or the point lies outside the
            box.
        """
        return self._parameters(at)

    def _parameters(self, at: Mapping[str, float]) -> Float[np.ndarray, " P"]:
        """The same for numbers that were checked."""
        _check_names(self.names, at)
        point = np.array([float(at[name]) for name in self.names])
        if not self.box.holds(point, slack=IN_BOX):
            raise InputError(f"`at` must lie in {self.box}; got {dict(at)}.")
        return np.asarray(self.setting.parameters(point[None])[0])

    @check_arguments
    def at(self, **at: float) -> States:
        """Exact states over one point of the box, sorted by energy; see `over`."""
        states = self.sheets.over(self._parameters(at)[None])[0]
        return states[np.argsort(states.energy, kind="stable")] if len(states) > 1 else states

    @check_arguments
    def over(self, **at: Float[np.ndarray, " points"]) -> StatesOver:
        """Exact states over many points of the box, with the pieces of the set that they lie on.

        The cells above a point give guesses, which Newton corrects. Where the guesses leave a
        doubt, as near curved folds, all known equilibria nearby are lifted to the point. Near
        crossings of sheets all roots of the reduced equation are returned; states of these sheets
        that are closer together than 1e-5 in the metric are one.

        Parameters
        ----------
        at
            Values of each free parameter, one per point.

        Raises
        ------
        InputError
            If a name is not that of a free parameter or is missing, numbers of values differ, or a
            point lies outside the box.
        """
        p = self._parameters_over(at)
        states, point, cell = self.sheets.over(p)
        known = cell >= 0
        stratum, component = (
            np.where(known, label[cell], -1) if len(label) else cell
            for label in (self.stratum, self.component)
        )
        index = np.where(known, self.cell_index[cell], -1) if len(self.cells) else cell
        index[~known] = states[~known].index
        return StatesOver(states, point, cell, index, stratum, component, len(p))

    @check_arguments
    def holding(self, states: States) -> tuple[Flags, Numbers]:
        """Which of some states the set has, and the cells that they lie on, −1 if not known.

        Parameters
        ----------
        states
            Equilibria over points of the box, within the constraints of the set.
        """
        return holding(self.sheets, states)

    def _parameters_over(
        self, at: Mapping[str, Float[np.ndarray, " points"]]
    ) -> Float[np.ndarray, "points P"]:
        """All parameters over points of the box."""
        _check_names(self.names, at)
        columns = [np.asarray(at[name], float) for name in self.names]
        if any(len(column) != len(columns[0]) for column in columns):
            shapes = ", ".join(f"{name} {np.shape(at[name])}" for name in self.names)
            raise InputError(
                "`at` must give one number for each point, equally many values of each parameter; "
                f"got shapes {shapes}."
            )
        points = np.stack(columns, axis=1)
        outside = np.flatnonzero(~self.box.holds(points, slack=IN_BOX))
        if len(outside):
            worst = dict(zip(self.names, points[outside[0]].tolist(), strict=True))
            raise InputError(f"`at` must lie in {self.box}; got {worst} (point {outside[0]}).")
        return self.setting.parameters(points)

    @cached_property
    def sheets(self) -> Sheets:
        """The cells, made ready for queries."""
        caps = [piece.vertices for piece in self.boundaries if piece.kind != BoundaryKind.BOX]
        folded, capped = np.zeros((2, len(self.points)), bool)
        singular = (*self.folds, *self.crossings)
        for flags, pieces in ((folded, singular), (capped, caps)):
            for piece in pieces:
                flags[piece] = True
        return Sheets(
            self.points,
            self.setting.free,
            self.cells,
            self.cell_index,
            self.component,
            self.adjacency,
            folded,
            capped,
            self.constraints,
            self._near_crossings(),
            cusps_near(self.setting, self.points, self.adjacency, self._turning_folds()),
        )

    def _turning_folds(self) -> Facets:
        """Facets of folds, which may pass cusps, off crossings."""
        d = len(self.names)
        facets = facets_of(self.folds if d > 1 else (), d)
        off = (self.kinds[facets] != VertexKind.CROSSING).all(axis=1)
        return np.asarray(facets[off])

    def _near_crossings(self) -> NearCrossings | None:
        """Facets along which sheets cross, if they do."""
        if not self.crossings:
            return None
        facets = facets_of(self.crossings, len(self.names))
        return of_set(self.setting, self.points, self.cells, self.adjacency, facets)


def _check_names(names: tuple[str, ...], at: Mapping[str, object]) -> None:
    if set(at) != set(names):
        raise InputError(f"`at` must give {' and '.join(names)}; got {', '.join(at) or 'nothing'}.")


def with_audit(eset: EquilibriumSet, audit: Audit) -> EquilibriumSet:
    """The set with another audit, and all tables that were computed of it."""
    made = replace(eset, audit=audit)
    vars(made).update({name: each for name, each in vars(eset).items() if name != "audit"})
    return made


def check_cells(eset: EquilibriumSet) -> None:
    """Refuse a set without cells."""
    if len(eset.cells) == 0:
        raise InputError("`eset` must have cells; got an empty set.")
