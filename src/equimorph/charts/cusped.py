"""Vertices at the cusps of folds, where sheets part."""

import numpy as np
from jaxtyping import Float, Int

from equimorph.manifold import EquilibriumSet
from equimorph.manifold.cusp_points import sides_of_existence
from equimorph.manifold.fabric import ON_FOLD, Fabric, Vertices, fabric_of
from equimorph.manifold.levels import fabric_setting, part_of, roots


def with_cusps(fabric: Fabric) -> tuple[Fabric, Int[np.ndarray, " cusps"]]:
    """A fabric over two parameters with vertices at its cusps, and which of them these are."""
    count = len(fabric.vertices)
    ends, found = _cusps(fabric)
    if len(ends):
        fabric = fabric.bisected(ends, found)
    return fabric, np.arange(count, len(fabric.vertices))


def cusped(eset: EquilibriumSet) -> EquilibriumSet:
    """A set with vertices at its cusps; the set itself if it has none."""
    if len(eset.names) != 2:
        return eset
    fabric, cusps = with_cusps(fabric_of(fabric_setting(eset), eset))
    if len(cusps) == 0:
        return eset
    nothing = np.zeros(len(fabric.vertices), bool)
    return part_of(eset, fabric, np.ones(len(fabric.cells), bool), (nothing, 0))


def _cusps(fabric: Fabric) -> tuple[Int[np.ndarray, "n 2"], Vertices]:
    """Fold edges with cusps, and the cusps."""
    ends = fabric.facets[(fabric.marks & ON_FOLD) > 0]
    store = fabric.vertices
    if len(ends) == 0:
        return ends, store.take(np.zeros(0, int))
    side = sides_of_existence(store.take(ends[:, 0]))
    other = sides_of_existence(store.take(ends[:, 1]))
    known = np.stack(
        [np.einsum("ni,ni->n", side, side), np.einsum("ni,ni->n", side, other)], axis=1
    )
    turning = np.flatnonzero(known[:, 1] < 0.0)
    if len(turning) == 0:
        return ends[:0], store.take(turning)
    lowest = store.index[ends[turning]].min(axis=1)

    def value(at: Vertices, lanes: Int[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
        return np.asarray(np.einsum("ni,ni->n", side[turning[lanes]], sides_of_existence(at)))

    done, found = roots(fabric, ends[turning], (ON_FOLD, lowest), known[turning], value)
    return ends[turning[done]], found
