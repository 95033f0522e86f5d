"""Patches: parts of a complex of triangles that are changed by themselves and put back.

Vertices keep their numbers, and new ones are appended, so that a part goes back as it is.
"""

from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from equimorph.arrays import Int, Some, VertexFlags
from equimorph.manifold.complex.marked_complex import TRIANGLES, Fabric, FacetMark
from equimorph.manifold.geometry.topology import count_corners

RINGS = 4
"""Rings of cells around what is to be changed, which longer edges to be cut first may lie in."""
SMALL = 2000
"""Cells up to which a fabric is not worth being divided."""
FEW = 15
"""Least number of cells for each vertex that is about to change."""
SHARE = 0.6
"""Largest part of a fabric that is worth being changed by itself."""


@dataclass(frozen=True)
class Patch:
    """Some cells of a fabric with all facets between their vertices, and the rest of it.

    inside: vertices of the patch. Edges of the rest between them are marked `FacetMark.RIM`: they
    are not bisected, keep their vertices, and flips do not make them a second time.
    """

    fabric: Fabric
    rest: Fabric
    inside: VertexFlags

    def replace_by(self, by: Fabric) -> Fabric:
        """Return the whole fabric, with another one in place of the patch."""
        kept, rest = (by.marks & FacetMark.RIM) == 0, self.rest
        return replace(
            by,
            cells=np.concatenate([rest.cells, by.cells]),
            cell_index=np.concatenate([rest.cell_index, by.cell_index]),
            squared=np.concatenate([rest.squared, by.squared]),
            facets=np.concatenate([rest.facets, by.facets[kept]]),
            marks=np.concatenate([rest.marks, by.marks[kept]]),
        )


def patch_around(fabric: Fabric, near: VertexFlags, rings: int) -> Patch:
    """Triangles around flagged vertices, and `rings` further rings, of all sheets that cross.

    Edges on crossings that other sheets hold beyond the patch belong to its rim.
    """
    for _ in range(rings + 1):
        near = _in_all_sheets(fabric, near)
        own = count_corners(near, fabric.cells) > 0
        near = np.zeros_like(near)
        near[fabric.cells[own]] = True
    rest = fabric.only(~own)
    beyond = np.zeros_like(near)
    beyond[rest.cells] = True
    within = near[fabric.facets].all(axis=1)
    # the rim of a patch that this one is a part of stays that of the larger one, too
    outer = (fabric.marks & FacetMark.RIM) > 0
    rims = [_pairs_between(rest.cells, near & beyond), fabric.facets[within & outer]]
    rim = np.unique(np.sort(np.concatenate(rims), axis=1), axis=0)
    shared = within & ~outer
    facets, marks = fabric.facets[shared], fabric.marks[shared]
    outside = _in_all_sheets(fabric, beyond & (near | (fabric.vertices.shared >= 0)))
    held = ((marks & FacetMark.CROSSING) > 0) & outside[facets].any(axis=1)
    rim = np.concatenate([rim, facets[held]])
    patch = replace(
        fabric.only(own),
        facets=np.concatenate([facets, rim]),
        marks=np.concatenate([marks, np.full(len(rim), FacetMark.RIM)]),
    )
    rest = replace(rest, facets=fabric.facets[~shared], marks=fabric.marks[~shared])
    return Patch(patch, rest, near)


def small_patch(fabric: Fabric, changing: Some) -> Patch | None:
    """Triangles around vertices that are about to change; None if it had better be all."""
    if fabric.dimension != TRIANGLES or len(fabric.cells) <= SMALL:
        return None
    near = np.zeros(len(fabric.vertices), bool)
    near[changing] = True
    if np.count_nonzero(near) * FEW > len(fabric.cells):
        return None
    patch = patch_around(fabric, near, RINGS)
    return patch if len(patch.fabric.cells) < SHARE * len(fabric.cells) else None


def _in_all_sheets(fabric: Fabric, near: VertexFlags) -> VertexFlags:
    """Some vertices, and those that are the same points of other sheets."""
    shared = fabric.vertices.shared
    met = np.zeros(int(shared.max(initial=-1)) + 2, bool)
    met[shared[near]] = True
    met[-1] = False
    return np.asarray(near | met[shared])


def _pairs_between(
    cells: Int[np.ndarray, "n corners"], chosen: VertexFlags
) -> Int[np.ndarray, "m 2"]:
    """Edges of cells, sorted, both of whose ends are chosen."""
    cells = cells[count_corners(chosen, cells) > 1]
    pairs = [cells[:, list(pair)] for pair in combinations(range(cells.shape[1]), 2)]
    edges = np.concatenate(pairs)
    return np.unique(np.sort(edges[chosen[edges].all(axis=1)], axis=1), axis=0)
