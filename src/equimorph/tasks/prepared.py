"""What tasks compute once for each set: values at vertices, stable edges."""

from collections.abc import Callable
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from equimorph.manifold import EquilibriumSet
from equimorph.manifold.geometry.topology import faces_of
from equimorph.model import Constraint, Descriptor

_KEPT: WeakKeyDictionary[EquilibriumSet, dict[Any, Any]] = WeakKeyDictionary()

CRITICAL = (1, 4, 7)
"""Kinds of vertices at which stability ends: on folds, and where sheets cross."""
SLACK = 1e-9
"""Relative excess over a bound that counts as none."""


def kept(eset: EquilibriumSet, key: Any, compute: Callable[[], Any]) -> Any:
    """Return what was computed before for a set, or compute it; forgotten with the set."""
    known = _KEPT.setdefault(eset, {})
    if key not in known:
        known[key] = compute()
    return known[key]


def vertex_values(eset: EquilibriumSet, descriptor: Descriptor) -> Float[np.ndarray, " V"]:
    """Values of a descriptor at the vertices of a set."""
    found = kept(
        eset, ("values", descriptor), lambda: descriptor.function(eset.points.z, eset.points.p)
    )
    return np.asarray(found)


def stable_vertices(eset: EquilibriumSet) -> Bool[np.ndarray, " V"]:
    """Vertices of stable cells, those on folds among them."""
    stable = np.zeros(len(eset.points), bool)
    stable[eset.cells[eset.cell_index == 0]] = True
    return stable


def stable_edges(eset: EquilibriumSet) -> Int[np.ndarray, "edges 2"]:
    """Edges of stable cells."""
    found = kept(eset, "edges", lambda: faces_of(eset.cells[eset.cell_index == 0], 2))
    return np.asarray(found)


def feasible_vertices(
    eset: EquilibriumSet, within: tuple[Constraint, ...]
) -> Bool[np.ndarray, " V"]:
    """Stable vertices that obey constraints."""
    good = stable_vertices(eset)
    for constraint in within:
        sign = 1.0 if constraint.sense == "<=" else -1.0
        excess = sign * (vertex_values(eset, constraint.descriptor) - constraint.bound)
        good &= excess <= SLACK * max(1.0, abs(constraint.bound))
    return good


def pieces_of_vertices(
    eset: EquilibriumSet, allowed: Bool[np.ndarray, " V"]
) -> Int[np.ndarray, " V"]:
    """Numbers of the connected pieces of allowed vertices, along stable edges off the folds."""
    edges = stable_edges(eset)
    inner = allowed & ~np.isin(eset.kinds, CRITICAL)
    edges = edges[allowed[edges].all(axis=1) & inner[edges].any(axis=1)]
    count = len(eset.points)
    graph = coo_array((np.ones(len(edges)), edges.T), shape=(count, count))
    return np.asarray(connected_components(graph, directed=False)[1])
