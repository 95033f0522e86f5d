"""Parts of a complex that are worked on alone: what is beyond stays, and so does the rim between.

Vertices keep their numbers, and new ones are appended, so that a part goes back as it is.
"""

from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from equimorph.array_types import Int
from equimorph.arrays import VertexFlags
from equimorph.manifold.complex.marked_complex import Fabric, FacetMark
from equimorph.manifold.geometry.topology import count_corners


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
