"""Vertices at the cusps of folds, where sheets part."""

import numpy as np
from jaxtyping import Int

from equimorph.manifold import EquilibriumSet
from equimorph.manifold.complex.marked_complex import Fabric, fabric_of
from equimorph.manifold.queries.cusps import cusps_on_edges
from equimorph.manifold.queries.levels import fabric_setting, part_of


def with_cusps(fabric: Fabric) -> tuple[Fabric, Int[np.ndarray, " cusps"]]:
    """A fabric over two parameters with vertices at its cusps, and which of them these are."""
    count = len(fabric.vertices)
    ends, found = cusps_on_edges(fabric)
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
