"""Where the lift of a grid begins: seeds, spread over a coarse grid, and no copies of pieces."""

import numpy as np

from equimorph.manifold.lifting.copies import without_copies
from equimorph.manifold.lifting.flood import flood
from equimorph.manifold.lifting.grid import Lines, coarse_grid
from equimorph.manifold.lifting.pairing import Pairing, start_pairing
from equimorph.manifold.lifting.seeds import Seeds, seeds
from equimorph.model import Progress

COARSE = {1: 12, 2: 12, 3: 7}
"""Most intervals along each parameter of the coarse grid over which seeds are spread."""


def spread_seeds(pairing: Pairing, lines: Lines, seed: int, progress: Progress) -> Seeds:
    """Seeds, spread over a coarse grid in a box somewhat larger than that of the fine grid.

    So the flood of the fine grid starts everywhere at once, with many edges at a time, and on
    pieces, too, that hang together only beyond the box.
    """
    setting = pairing.setting
    mesh, number = coarse_grid(lines, COARSE[len(lines)], setting.limits)
    coarse = start_pairing(setting, mesh, pairing.limit)
    coarse.points.over_vertices(*seeds(setting, mesh, np.flatnonzero(number >= 0), seed))
    flood(coarse, progress)
    store, found = coarse.points, without_copies(coarse)
    fine = number[store.vertex[found]]
    found, fine = found[fine >= 0], fine[fine >= 0]
    return fine, store.z[found], store.p[found], store.index[found]


def begun_without_copies(pairing: Pairing, progress: Progress) -> Pairing:
    """The pairing, or one that begins without those of its pieces that are copies of others.

    Pieces that meet over no vertex of the coarse grid may do so over the fine one, and states that
    were missing may belong to copies of what is there.
    """
    if len(pairing.setting.structure.whole_turns.free) == 0:
        return pairing
    flood(pairing, progress)
    store, kept = pairing.points, without_copies(pairing)
    if len(kept) == np.count_nonzero(store.vertex[: store.count] >= 0):
        return pairing
    again = start_pairing(pairing.setting, pairing.mesh, pairing.limit)
    again.points.over_vertices(store.vertex[kept], store.z[kept], store.p[kept], store.index[kept])
    return again
