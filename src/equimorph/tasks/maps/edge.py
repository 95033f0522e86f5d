"""Where a map ends: beyond it no unloaded state obeys the constraints."""

from collections.abc import Sequence

import numpy as np

from equimorph.arrays import Settings
from equimorph.equilibria.natural_sheet import NaturalSheet
from equimorph.model import Constraint
from equimorph.tasks.maps.brackets import Brackets, grid_edges, narrowed
from equimorph.tasks.maps.curves import Places, half_length
from equimorph.tasks.maps.samples import Samples
from equimorph.tasks.maps.unloaded import LOST, unloaded

DIVISIONS = 14
"""Down to round-off."""


def edge_of_definition(
    sheet: NaturalSheet,
    within: Sequence[Constraint],
    settings: Settings,
    shape: tuple[int, int],
) -> Places:
    """Places on grid edges with a natural state that obeys the constraints at one end only."""

    def sampler(where: Settings) -> Samples:
        return unloaded(sheet, within, where)

    start, edges = sampler(settings), grid_edges(shape)
    out = start.kind[edges] != LOST
    at = np.flatnonzero(out[:, 0] != out[:, 1])
    pairs = Brackets(start.take(edges[at, 0]), start.take(edges[at, 1]), at)
    found = narrowed(sheet.structure, sampler, pairs, DIVISIONS)
    middle = 0.5 * (found.a.setting + found.b.setting)
    inside = found.a.where(found.a.kind == LOST, found.b)
    kind = np.full(len(found), "edge", dtype=object)
    return Places(found, kind, half_length(found), middle, inside.z, inside.p)
