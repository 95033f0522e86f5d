"""Cusps of fold curves over two parameters: where the image of a fold curve turns back."""

from dataclasses import dataclass

import numpy as np

from equimorph.argument_checks import check_arguments
from equimorph.arrays import (
    CellFlags,
    Float,
    Int,
    Items,
    ItemValues,
    Pairs,
    Some,
    VertexFlags,
)
from equimorph.equilibria.critical import null_vectors
from equimorph.equilibria.locus import Locus, nearest
from equimorph.equilibria.settle import lower_index
from equimorph.errors import InputError
from equimorph.manifold.complex.cuts import roots
from equimorph.manifold.complex.equilibrium_set import EquilibriumSet
from equimorph.manifold.complex.excerpts import fabric_of
from equimorph.manifold.complex.marked_complex import Fabric, FacetMark
from equimorph.manifold.complex.vertices import Vertices
from equimorph.manifold.geometry.points import VertexKind, on_fold
from equimorph.manifold.geometry.setting import embed
from equimorph.structures import States
from equimorph.tolerances import SAME_STATE

REACH = 1.5
"""Largest distance of a cusp from the ends of the edge near which it is sought, in its lengths."""
CLOSE = 1e-3
"""Share of an edge next to its ends in which a cusp is that of the end."""


@dataclass(frozen=True)
class Cusps:
    """Cusps as states, and the index on the lower side of each; 0 on the boundary of stability.

    lost: edges of folds with a cusp which was not found; refine the set there.
    """

    states: States
    index: Items
    lost: int


@check_arguments
def cusps(eset: EquilibriumSet) -> Cusps:
    """Cusps on the folds of a set over two parameters, polished.

    There ``φᵀF_zz[φ, φ] = 0``, which changes its sign with a null vector φ that is continuous along
    the fold. Where sheets cross, these are the points at which pitchforks change their criticality:
    a fold passes the crossing there, and its image turns back.

    Raises
    ------
    InputError
        If the set has another number of free parameters.
    """
    if len(eset.names) != 2:
        raise InputError(f"`eset` must be over two parameters; got {len(eset.names)}.")
    fabric = fabric_of(eset, on_fold(eset.kinds))
    ends = fabric.facets[(fabric.marks & FacetMark.FOLD) > 0]
    hubs = _turning_hubs(fabric, ends)
    ends = ends[(fabric.vertices.kinds[ends] != VertexKind.CROSSING).all(axis=1)]
    turning = ends[_turning(fabric, ends)]
    lowest = fabric.vertices.index[turning].min(axis=1)
    states: list[tuple[np.ndarray, np.ndarray, int]] = []
    for edge, low in zip(turning, lowest.tolist(), strict=True):
        found = _between(fabric, edge, low)
        # a cusp that two edges lead to leaves another one lost
        if found and all(np.abs(found[0] - z).max() > SAME_STATE for z, _, _ in states):
            states.append((*found, low))
    lost = len(turning) - len(states)
    store = fabric.vertices
    states += [(store.z[at], store.p[at], int(store.index[at])) for at in hubs.tolist()]
    z, p = (
        np.array([each[k] for each in states]).reshape(len(states), column.shape[1])
        for k, column in enumerate((store.z, store.p))
    )
    index = np.array([low for *_, low in states], int)
    return Cusps(States(eset.structure, z, p), index, lost)


def _turning_hubs(fabric: Fabric, ends: Pairs) -> Int[np.ndarray, " m"]:
    """Vertices at which the image of a fold turns back as it passes a crossing."""
    store = fabric.vertices
    ways = _ways(ends)
    ways = ways[store.kinds[ways[:, 0]] == VertexKind.CROSSING]
    twos = _twos(ways, fabric.points[ways[:, 0]])
    place = store.place[:, -2:]
    along = place[twos[:, :, 1]] - place[twos[:, :, 0]]
    back = np.einsum("nk,nk->n", along[:, 0], along[:, 1]) > 0.0
    return np.asarray(twos[back, 0, 0])


def _ways(ends: Pairs) -> Int[np.ndarray, "ways 2"]:
    """Edges from either end to the other one."""
    return np.concatenate([ends, ends[:, ::-1]])


def _twos(
    ways: Int[np.ndarray, "ways 2"], start: Int[np.ndarray, " ways"]
) -> Int[np.ndarray, "m 2 2"]:
    """Both ways from each point from which just two lead; `start`: the point of each way."""
    order = np.argsort(start, kind="stable")
    _, first, counts = np.unique(start[order], return_index=True, return_counts=True)
    return np.asarray(ways[order[first[counts == 2, None] + np.arange(2)]])


def _turning(fabric: Fabric, ends: Pairs) -> Int[np.ndarray, " m"]:
    """Edges of folds at whose ends φᵀF_zz[φ, φ] has different signs."""
    folded, at = np.unique(ends, return_inverse=True)
    at = at.reshape(ends.shape)
    store = fabric.vertices
    null, bend = null_vectors(fabric.setting.structure, store.z[folded], store.p[folded])
    sense = np.einsum("ni,ni->n", null[at[:, 0]], null[at[:, 1]])
    positive = bend >= 0.0  # zero has a sign, too: a cusp at a vertex lies on one of its two edges
    return np.flatnonzero((positive[at[:, 0]] == positive[at[:, 1]]) == (sense < 0.0))


def _between(
    fabric: Fabric, edge: Int[np.ndarray, " 2"], low: int
) -> tuple[Float[np.ndarray, " size"], Float[np.ndarray, " P"]] | None:
    """Cusp near an edge of a fold, by Newton from its middle or its ends."""
    store, setting = fabric.vertices, fabric.setting
    tests = (lambda at: at.g, lambda at: at.quadratic)
    locus = Locus(setting.structure, store.p[edge[0]], setting.free, tests)
    x = locus.join(store.z[edge], store.p[edge])
    length = np.linalg.norm(store.place[edge[1]] - store.place[edge[0]])
    for start in (x.mean(axis=0, keepdims=True), x[:1], x[1:]):
        spot, found = nearest(locus, start)
        if not found[0]:
            continue
        z, p = locus.split(spot.x)
        away = np.linalg.norm(embed(setting, z, p) - store.place[edge], axis=1)
        if away.max() <= REACH * length and lower_index(setting.structure, z, p)[0] == low:
            return z[0], p[0]
    return None


def with_cusps_beside(fabric: Fabric, beside: CellFlags) -> Fabric:
    """The same with vertices at the cusps next to the flagged cells.

    A cell that cuts a cusp off is overturned: the sheet around goes all the way round the cusp.
    """
    near = np.zeros(len(fabric.vertices), bool)
    near[fabric.cells[beside]] = True
    _, ends, found = cusps_of(fabric, near)
    marks = fabric.edge_marks(np.sort(ends, axis=1))
    whole = np.flatnonzero((marks & (FacetMark.HOLE | FacetMark.RIM)) == 0)
    return fabric.bisect(ends[whole], found.take(whole)) if len(whole) else fabric


def cusps_of(fabric: Fabric, near: VertexFlags | None = None) -> tuple[Some, Pairs, Vertices]:
    """Vertices at cusps, fold edges with cusps between their ends, and these cusps.

    near: which vertices an edge must have one of, if not all edges count.
    """
    ends = fabric.facets[(fabric.marks & FacetMark.FOLD) > 0]
    if near is not None:
        ends = ends[near[ends].any(axis=1)]
    store = fabric.vertices
    folded, at = np.unique(ends, return_inverse=True)
    if len(folded) == 0:
        return folded, ends, store.take(folded)
    at, side = at.reshape(ends.shape), sides_of_existence(store.take(folded))
    size = np.linalg.norm(side, axis=1)
    met = folded[_vanishing(at, side, size)]
    known = np.einsum("nki,nki->nk", side[at[:, :1]], side[at])
    apart = size[at].min(axis=1) > CLOSE * size[at].max(axis=1)
    turning = np.flatnonzero((known[:, 1] < 0.0) & apart)
    if len(turning) == 0:
        return met, ends[:0], store.take(turning)
    ends, known, first = ends[turning], known[turning], side[at[turning, 0]]

    def value(at: Vertices, lanes: Items) -> ItemValues:
        return np.asarray(np.einsum("ni,ni->n", first[lanes], sides_of_existence(at)))

    lowest = store.index[ends].min(axis=1)
    done, found = roots(fabric, ends, FacetMark.FOLD, lowest, known, value)
    return met, ends[done], found


def _vanishing(at: Pairs, side: Float[np.ndarray, "V 2"], size: Float[np.ndarray, " V"]) -> Some:
    """Vertices of a fold at which the sides of existence vanish, to change to the opposite ones."""
    ways = _ways(at)
    twos = _twos(ways, ways[:, 0])
    own, others = twos[:, 0, 0], twos[:, :, 1]
    opposite = np.einsum("ni,ni->n", *np.swapaxes(side[others], 0, 1)) < 0.0
    sizes = size[others]
    least = (size[own] <= CLOSE * sizes.max(axis=1)) & (size[own] <= sizes.min(axis=1))
    return np.asarray(own[opposite & least])


def sides_of_existence(at: Vertices) -> Float[np.ndarray, "n 2"]:
    """Vectors, in scaled parameters, across folds: ``∇g·adj P`` with P the projection to them.

    On a fold ``adj P = φψᵀ`` with the null vectors of P, and g is the function that vanishes there:
    the vector is a multiple of ψ, which is normal to the fold's image, and vanishes with ∇g·φ.
    """
    along = at.frame[:, :, -2:]
    a, b = along[:, 0].T
    c, d = along[:, 1].T
    g = at.fold_slope
    return np.stack([g[:, 0] * d - g[:, 1] * b, g[:, 1] * a - g[:, 0] * c], axis=1)
