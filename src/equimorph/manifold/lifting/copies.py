"""Pieces of a lift that are others, whole turns away: the set has one of them.

Searches take whole turns back, each at its own point: where half a turn is passed between two
points, the states found at one and at the other are on different copies of a piece.
"""

from itertools import combinations

import numpy as np

from equimorph.arrays import Items
from equimorph.linalg.graphs import components
from equimorph.manifold.lifting.pairing import Pairing
from equimorph.structures.metric import metric_length
from equimorph.tolerances import SAME_STATE


def without_copies(pairing: Pairing) -> Items:
    """Known points over vertices, but of all pieces that are copies those of the largest alone."""
    store, structure = pairing.points, pairing.setting.structure
    vertex = store.vertex[: store.count]
    over = np.flatnonzero(vertex >= 0)
    if len(structure.whole_turns.free) == 0:
        return over
    least = structure.whole_turns.taken_back(store.z[: store.count])
    turned = metric_length(structure, store.z[over] - least[over]) > SAME_STATE
    crowded = np.unique(vertex[over[turned]])  # of two copies one at least has turned
    lifted = pairing.curves.end >= 0
    ends = np.stack([pairing.curves.start, pairing.curves.end], axis=1)[lifted]
    piece = components(store.count, ends)
    pairs = np.array(
        [pair for each in crowded for pair in combinations(store.over(each), 2)],
        dtype=int,
    ).reshape(-1, 2)
    alike = metric_length(structure, least[pairs[:, 0]] - least[pairs[:, 1]]) < SAME_STATE
    family = components(store.count, np.concatenate([ends, pairs[alike]]))
    size = np.bincount(piece[over], minlength=piece.max(initial=-1) + 1)[piece]
    largest = over[np.lexsort((piece[over], -size[over], family[over]))]
    first = largest[np.unique(family[largest], return_index=True)[1]]
    return over[np.isin(piece[over], piece[first])]
