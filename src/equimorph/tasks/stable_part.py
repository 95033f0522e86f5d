"""The stable part of an equilibrium set: vertices, edges, pieces; computed once for each set."""

from itertools import combinations_with_replacement

import numpy as np

from equimorph.arrays import Bool, Float, Int
from equimorph.manifold import EquilibriumSet, part, restricted
from equimorph.manifold.complex.kept_tables import from_cache, kept, places_of
from equimorph.manifold.geometry.setting import embed
from equimorph.manifold.geometry.topology import faces_of
from equimorph.manifold.queries.locate import cell_of, pieces_of
from equimorph.model import Constraint, Descriptor
from equimorph.structures import State

SLACK = 1e-9
"""Relative excess over a bound that counts as none."""

PARTS = 4
"""Parts of a side of a cell between the places whose distances are compared."""


def stable_values(eset: EquilibriumSet, descriptor: Descriptor) -> Float[np.ndarray, " V"]:
    """Values of a descriptor at the vertices of stable cells; not a number at the others."""

    def compute() -> Float[np.ndarray, " V"]:
        values, some = np.full(len(eset.points), np.nan), np.flatnonzero(stable_vertices(eset))
        values[some] = descriptor.function(eset.points.z[some], eset.points.p[some])
        return values

    return np.asarray(from_cache(eset, ("values", descriptor), compute))


def stable_vertices(eset: EquilibriumSet) -> Bool[np.ndarray, " V"]:
    """Vertices of stable cells, those on folds among them."""
    stable = np.zeros(len(eset.points), bool)
    stable[eset.cells[eset.cell_index == 0]] = True
    return stable


@kept
def stable_edges(eset: EquilibriumSet) -> Int[np.ndarray, "edges 2"]:
    """Edges of stable cells."""
    return faces_of(eset.cells[eset.cell_index == 0], 2)


def feasible_vertices(
    eset: EquilibriumSet, within: tuple[Constraint, ...]
) -> Bool[np.ndarray, " V"]:
    """Stable vertices that obey constraints."""
    good = stable_vertices(eset)
    for constraint in within:
        sign = 1.0 if constraint.sense == "<=" else -1.0
        excess = sign * (stable_values(eset, constraint.descriptor) - constraint.bound)
        good &= excess <= SLACK * constraint.size
    return good


def stable_piece(
    eset: EquilibriumSet, state: State, within: tuple[Constraint, ...]
) -> EquilibriumSet | None:
    """Stable cells around a state that obey all constraints; None if it is no state of the set.

    Regions that pass between vertices, however thin, are followed as far as their sides cross edges
    of the cells; without cells if they cross none.
    """
    stratum, _ = pieces_of(eset, state)
    if stratum < 0:
        return None
    piece = from_cache(eset, ("part", stratum), lambda: part(eset, eset.stratum == stratum))
    for constraint in within:
        if len(piece.cells):
            piece = restricted(piece, constraint)
    if not within or not len(piece.cells):
        return piece
    return part(piece, piece.component == piece.component[cell_near(piece, state)])


def cell_near(eset: EquilibriumSet, state: State) -> int:
    """Cell of a state; the nearest one where a curved boundary leaves it out."""
    found = cell_of(eset, state)
    if found >= 0:
        return found
    setting = eset.setting
    corners = places_of(eset)[eset.cells]
    here = embed(setting, state.z[None], state.p[None])[0]
    count = eset.cells.shape[1]
    picks = np.array(list(combinations_with_replacement(range(count), PARTS)))
    shares = np.stack([(picks == k).sum(axis=1) for k in range(count)], axis=1) / PARTS
    gaps = [np.linalg.norm(np.einsum("k,cks->cs", w, corners) - here, axis=1) for w in shares]
    return int(np.argmin(np.min(gaps, axis=0)))
