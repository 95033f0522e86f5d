"""Slivers among tetrahedra taken away: by other connections, by fewer and by moved vertices."""

import numpy as np
from jaxtyping import Bool, Int

from equimorph.manifold.complex.marked_complex import Fabric
from equimorph.manifold.geometry.topology import among
from equimorph.manifold.refining.collapsing import collapse_edges
from equimorph.manifold.refining.deviations import Memory
from equimorph.manifold.refining.reconnection import reconnect
from equimorph.manifold.refining.relaxing import SHARP, relax
from equimorph.manifold.refining.tetrahedra import Judge

ROUNDS = {False: 6, True: 12}
"""How often all is done in turn, around what changed before; for coarse and for fine cells."""
COLLAPSES, FEWER = 3, 0.99
"""How often vertices are taken out in a round, as long as cells get fewer."""


def bettered(fabric: Fabric, memory: Memory, limit: float = np.inf, fine: bool = False) -> Fabric:
    """Tetrahedra with larger angles; no edge comes that deviates by more than a limit.

    Vertices are moved where cells are `fine` already.
    """
    judge, near = Judge(fabric), np.ones(len(fabric.vertices), bool)
    for _ in range(ROUNDS[fine]):
        before = fabric.cells
        fabric = reconnect(fabric, judge, near, memory.barred(fabric)[0], limit)
        for _ in range(COLLAPSES):
            count = len(fabric.cells)
            fabric = collapse_edges(fabric, judge, near, memory.barred(fabric), limit)
            if len(fabric.cells) > FEWER * count:
                break
        if fine:
            fabric, judge = relax(fabric, judge, near, limit)
        near = _changed(before, fabric.cells, len(fabric.vertices))
        if not near.any():
            break
    # edges that have come to lie on a fold deviate otherwise than before
    memory.keys, memory.error = np.zeros(0, int), np.zeros(0)
    return fabric


def sharp(fabric: Fabric) -> int:
    """Number of tetrahedra that are sharp, overturned or backward."""
    quality = Judge(fabric).qualities(fabric.cells, fabric.cell_index)
    return int((quality < SHARP).sum())


def _changed(
    old: Int[np.ndarray, "C 4"], new: Int[np.ndarray, "D 4"], base: int
) -> Bool[np.ndarray, " V"]:
    """Corners of cells that went or came."""
    # sums of irrational shares differ for different cells
    share = np.modf(np.arange(1, base + 1) * np.sqrt(2.0))[0]
    keys = [np.round(2**48 * np.sort(share[cells], axis=1).sum(axis=1)) for cells in (old, new)]
    out = np.zeros(base, bool)
    for cells, own, other in ((old, *keys), (new, *keys[::-1])):
        out[cells[~among(own.astype(np.int64), np.sort(other.astype(np.int64)))]] = True
    return out
