"""Cusps of fold curves over two parameters: where the image of a fold curve turns back."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from equimorph.errors import InputError
from equimorph.manifold.equilibrium_set import EquilibriumSet
from equimorph.manifold.fabric import ON_FOLD, Vertices, fabric_of
from equimorph.manifold.levels import fabric_setting, roots
from equimorph.structures import States


@dataclass(frozen=True)
class Cusps:
    """Cusps as states, and the index on the lower side of each; 0 on the boundary of stability.

    lost: edges of folds that turn back at a cusp which was not found; refine the set there.
    """

    states: States
    index: Int[np.ndarray, " n"]
    lost: int


def cusps(eset: EquilibriumSet) -> Cusps:
    """Cusps on the folds of a set over two parameters, polished.

    Beyond a fold, its two sheets exist on one side. Along the fold curve the vector that points
    there is continuous, and vanishes and turns round at cusps only, where
    ``φᵀF_zz[φ, φ] = 0``.

    Raises
    ------
    InputError
        For a set over another number of parameters.
    """
    if len(eset.names) != 2:
        raise InputError(f"`eset` must be over two parameters; got {len(eset.names)}.")
    fabric = fabric_of(fabric_setting(eset), eset)
    ends = fabric.facets[(fabric.marks & ON_FOLD) > 0]
    store = fabric.vertices
    side = sides_of_existence(store.take(ends[:, 0]))
    known = np.stack(
        [np.einsum("ni,ni->n", side, sides_of_existence(store.take(ends[:, k]))) for k in range(2)],
        axis=1,
    )
    turning = np.flatnonzero(known[:, 0] * known[:, 1] < 0.0)
    lowest = store.index[ends[turning]].min(axis=1)

    def value(at: Vertices, lanes: Int[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
        return np.asarray(np.einsum("ni,ni->n", side[turning[lanes]], sides_of_existence(at)))

    if len(turning) == 0:
        return Cusps(States(eset.structure, store.z[:0], store.p[:0]), store.index[:0], 0)
    done, found = roots(fabric, ends[turning], (ON_FOLD, lowest), known[turning], value)
    lost = int((~done).sum())
    return Cusps(States(eset.structure, found.z, found.p), found.index, lost)


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
