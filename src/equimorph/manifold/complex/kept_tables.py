"""Tables of sets: what several tasks need of a set is computed once, and forgotten with the set.

They are kept in the set itself, because a table of weak keys could not hold what refers to the set.
"""

from collections.abc import Callable
from dataclasses import replace
from functools import wraps
from typing import Any, TypeVar

import numpy as np

from equimorph.arrays import Cells, Float
from equimorph.manifold.complex.equilibrium_set import EquilibriumSet
from equimorph.manifold.geometry.setting import embed

Table = TypeVar("Table")

TABLES = "_kept_tables"
"""Attribute of a set that holds its tables; neither pickles nor copies of a set have them."""
PLACES = "places"
"""Key of the places of vertices."""


def from_cache(eset: EquilibriumSet, key: Any, compute: Callable[[], Table]) -> Table:
    """Return what was computed before for a set, or compute it."""
    known: dict[Any, Table] = vars(eset).setdefault(TABLES, {})
    if key not in known:
        known[key] = compute()
    return known[key]


def kept(compute: Callable[[EquilibriumSet], Table]) -> Callable[[EquilibriumSet], Table]:
    """A function of a set, computed once for each set; see `from_cache`.

    An array is the same one each time, which nobody may change.
    """

    @wraps(compute)
    def table(eset: EquilibriumSet) -> Table:
        found = from_cache(eset, compute, lambda: compute(eset))
        if isinstance(found, np.ndarray):
            found.flags.writeable = False
        return found

    return table


def places_of(eset: EquilibriumSet) -> Float[np.ndarray, "V coordinates"]:
    """Vertices of a set in its metric, see `embed`; kept."""
    return from_cache(eset, PLACES, lambda: _places(eset))


def _places(eset: EquilibriumSet) -> Float[np.ndarray, "V coordinates"]:
    found = embed(eset.setting, eset.points.z, eset.points.p)
    found.flags.writeable = False
    return found


def with_cells(eset: EquilibriumSet, cells: Cells) -> EquilibriumSet:
    """A set with other cells on the same vertices, whose tables it shares."""
    made = replace(eset, cells=cells)
    from_cache(made, PLACES, lambda: places_of(eset))
    return made
