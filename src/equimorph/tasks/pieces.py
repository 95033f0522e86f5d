"""Stable pieces of sets around a state, cut exactly along constraints."""

from itertools import combinations_with_replacement

import numpy as np

from equimorph.manifold import EquilibriumSet, part, restricted
from equimorph.manifold.geometry.embedding import embed
from equimorph.manifold.queries.locate import cell_of, pieces_of
from equimorph.manifold.queries.nearest import setting_of
from equimorph.model import Constraint
from equimorph.structures import State

PARTS = 4
"""Parts of a side of a cell between the places whose distances are compared."""


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
    piece = part(eset, eset.stratum == stratum)
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
    setting = setting_of(eset)
    corners = embed(setting, eset.points.z, eset.points.p)[eset.cells]
    here = embed(setting, state.z[None], state.p[None])[0]
    count = eset.cells.shape[1]
    picks = np.array(list(combinations_with_replacement(range(count), PARTS)))
    shares = np.stack([(picks == k).sum(axis=1) for k in range(count)], axis=1) / PARTS
    gaps = [np.linalg.norm(np.einsum("k,cks->cs", w, corners) - here, axis=1) for w in shares]
    return int(np.argmin(np.min(gaps, axis=0)))
