"""Tables of an equilibrium set for several tasks: computed once, and forgotten with the set."""

from collections.abc import Callable
from functools import wraps
from typing import Any, TypeVar
from weakref import WeakKeyDictionary

import numpy as np

from equimorph.manifold.complex.equilibrium_set import EquilibriumSet

_KEPT: WeakKeyDictionary[EquilibriumSet, dict[Any, Any]] = WeakKeyDictionary()

Table = TypeVar("Table")


def from_cache(eset: EquilibriumSet, key: Any, compute: Callable[[], Any]) -> Any:
    """Return what was computed before for a set, or compute it.

    It must not hold the set itself, which would then never be forgotten.
    """
    known = _KEPT.setdefault(eset, {})
    if key not in known:
        known[key] = compute()
    return known[key]


def kept(compute: Callable[[EquilibriumSet], Table]) -> Callable[[EquilibriumSet], Table]:
    """A function of a set, computed once for each set; see `from_cache`.

    An array is the same one each time, which nobody may change.
    """

    @wraps(compute)
    def table(eset: EquilibriumSet) -> Table:
        found: Table = from_cache(eset, compute, lambda: compute(eset))
        if isinstance(found, np.ndarray):
            found.flags.writeable = False
        return found

    return table
