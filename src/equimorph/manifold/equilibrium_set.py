"""The equilibrium set over one to three parameters: a simplicial complex of exact states."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float, Int

from equimorph.equilibria import ParameterLine, TraceOptions, distinct, newton
from equimorph.equilibria.outcome import follow
from equimorph.equilibria.tracing import ARRIVAL
from equimorph.errors import InputError
from equimorph.manifold.audit import Audit
from equimorph.manifold.mesh import BaseMesh
from equimorph.manifold.simplices import barycentric
from equimorph.model import Box, Constraint, parameter_vector
from equimorph.structures import States, Structure

OVERHANG = 0.3
"""How far beyond a cell, in barycentric coordinates, a point may lie to be tried from it."""


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


@dataclass(frozen=True)
class Boundary:
    """A connected piece of the boundary on the box ("box"), a constraint ("cap") or both ("mixed").

    vertices: one point (d = 1), a loop with the first vertex repeated (d = 2), or triangles, one a
    row (d = 3).
    """

    vertices: Int[np.ndarray, "..."]
    kind: str


@dataclass(frozen=True, eq=False)
class EquilibriumSet:
    """Equilibria over a box in d = 1, 2 or 3 free parameters, with their connections.

    Vertices are exact states: over the grid, on folds, on constraints. Cells are segments,
    triangles or tetrahedra of constant index; folds lie between cells of different index.

    Parameters
    ----------
    points
        States of the vertices.
    kinds
        0 over the grid, 1 on a fold, 2 on a constraint, 3 between folds of one grid edge, 4 where a
        fold meets a constraint, 5 amid others over a grid tetrahedron.
    index
        Negative eigenvalues at the vertices; on folds that of the lower side.
    cells, cell_index, component, stratum
        Vertices of each cell, its index, and the numbers of the pieces that it belongs to.
    folds
        Connected folds: points (d = 1), vertices along each fold curve, closed ones with the first
        repeated (d = 2), or fold surfaces as triangles, one a row (d = 3).
    """

    structure: Structure
    box: Box
    fixed: Mapping[str, float]
    constraints: tuple[Constraint, ...]
    intervals: tuple[int, ...]
    points: States
    kinds: Int[np.ndarray, " V"]
    index: Int[np.ndarray, " V"]
    cells: Int[np.ndarray, "C corners"]
    cell_index: Int[np.ndarray, " C"]
    component: Int[np.ndarray, " C"]
    stratum: Int[np.ndarray, " C"]
    folds: tuple[Int[np.ndarray, "..."], ...]
    boundaries: tuple[Boundary, ...]
    components: tuple[Component, ...]
    strata: tuple[Stratum, ...]
    audit: Audit
    mesh: BaseMesh
    grid_vertex: Int[np.ndarray, " V"]
    """Vertex of `mesh` below each vertex of the complex, −1 for those not over the grid."""

    def __repr__(self) -> str:
        """Box, size and whether the audit is clean."""
        state = "clean" if self.audit.clean else "NOT clean"
        return f"EquilibriumSet({self.box}: {len(self.cells)} cells; audit {state})"

    @property
    def names(self) -> tuple[str, ...]:
        """Free parameters."""
        return self.box.names

    @cached_property
    def coordinates(self) -> Float[np.ndarray, "V d"]:
        """Free parameters of the vertices."""
        return np.stack([self.points[name] for name in self.names], axis=1)

    def parameters_at(self, at: Mapping[str, float]) -> Float[np.ndarray, " P"]:
        """All parameters over a point of the box.

        Raises
        ------
        InputError
            For names that are not free, missing ones, or a point outside the box.
        """
        unknown = [name for name in at if name not in self.names]
        if unknown or len(at) != len(self.names):
            raise InputError(
                f"`at` must give {' and '.join(self.names)}; got {', '.join(at) or 'nothing'}."
            )
        point = np.array([float(at[name]) for name in self.names])
        if not self.box.contains(point, slack=1e-12):
            raise InputError(f"`at` must lie in {self.box}; got {dict(at)}.")
        return parameter_vector(self.structure.parameters, {**self.fixed, **at})

    def at(self, **at: float) -> States:
        """Exact states over one point of the box, sorted by energy.

        Lifted from all known equilibria over the corners of the grid cell around the point,
        through folds, and corrected from the cells above it; distinct ends are the states.
        """
        p = self.parameters_at(at)
        point = np.array([float(at[name]) for name in self.names])
        around = self.mesh.cells[self.mesh.locate(point)]
        starts = np.flatnonzero(np.isin(self.grid_vertex, around))
        lifted = lift_to(self.points[starts], p, self.constraints)
        # a sheet that a constraint or a curved fold hides from the corners is still under a cell
        z = np.concatenate([lifted, self._corrected(point, p)])
        z = z[distinct(self.structure, z)]
        states = States(self.structure, z, np.tile(p, (len(z), 1)))
        return states[np.argsort(states.energy, kind="stable")]

    def _corrected(
        self, point: Float[np.ndarray, " d"], p: Float[np.ndarray, " P"]
    ) -> Float[np.ndarray, "n size"]:
        """Unknowns of equilibria over a point, by Newton from the cells above it, nearby only."""
        weights = barycentric(self.coordinates[self.cells], point)
        above = np.flatnonzero(weights.min(axis=1) > -OVERHANG)
        corners = self.points.z[self.cells[above]]
        guess = np.einsum("ck,ckn->cn", weights[above], corners)
        n, mass = self.structure.unknowns, self.structure.mass
        reach = np.sqrt((corners - guess[:, None])[:, :, :n] ** 2 @ mass).max(axis=1)
        everywhere = np.tile(p, (len(guess), 1))
        z, good = newton(self.structure, guess, everywhere)
        good &= np.sqrt((z - guess)[:, :n] ** 2 @ mass) <= 2.0 * reach
        good &= self.structure.resolved(z, everywhere)
        for constraint in self.constraints:
            good &= constraint.excess(z, everywhere) <= 0.0
        return np.asarray(z[good])


def lift_to(
    states: States, p: Float[np.ndarray, " P"], constraints: tuple[Constraint, ...]
) -> Float[np.ndarray, "n size"]:
    """Unknowns of all equilibria at p that straight lifts from `states` reach."""
    velocity = p - states.p
    still = np.abs(velocity).max(axis=1, initial=0.0) == 0.0
    moving = np.flatnonzero(~still)
    line = ParameterLine(states.structure, states.p[moving].copy(), velocity[moving])
    options = TraceOptions(
        through_folds=True, through_branch_points=True, record=False, locate_passed=False
    )
    outcome = follow(line, states.z[moving].copy(), constraints, options)
    arrived = outcome.code == ARRIVAL
    return np.concatenate([states.z[still], outcome.z[arrived]])
