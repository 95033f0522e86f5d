"""Where paths of a map start: natural states that obey the constraints."""

from collections.abc import Sequence

import numpy as np

from equimorph.arrays import Settings
from equimorph.equilibria.first_stable import none_passed
from equimorph.equilibria.natural_sheet import NaturalSheet
from equimorph.model import Constraint
from equimorph.tasks.maps.samples import Samples

START_KINDS = ("undefined unloaded", "no natural state", "lost")
"""Why there is no path at a setting, or that it was lost; the first statuses of every map."""
UNDEFINED, MISSING, LOST = range(len(START_KINDS))


def unloaded(sheet: NaturalSheet, within: Sequence[Constraint], settings: Settings) -> Samples:
    """Natural states: `UNDEFINED` or `MISSING` where no path can start, `LOST` elsewhere."""
    z, found = sheet.states(settings)
    p = sheet.parameters(settings)
    kind = np.where(found, LOST, MISSING)
    at = np.flatnonzero(found)
    for constraint in within:
        kind[at[constraint.excess(z[at], p[at]) > 0.0]] = UNDEFINED
    none = np.full(len(settings), np.nan)
    return Samples(settings, none, kind, np.zeros(len(p)), z, p, none_passed(len(p)))
