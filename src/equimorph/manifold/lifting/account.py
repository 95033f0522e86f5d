"""From lifted points and cells to an equilibrium set: numbers of used points, and failures."""

from collections.abc import Mapping

import numpy as np
from jaxtyping import Int

from equimorph.manifold.complex.description import Complex, Frame, Lifting, described
from equimorph.manifold.complex.equilibrium_set import EquilibriumSet
from equimorph.manifold.geometry.points import CROSSING
from equimorph.manifold.lifting.cells import Cells
from equimorph.manifold.lifting.crossing_branches import lonely
from equimorph.manifold.lifting.pairing import Pairing, abandoned
from equimorph.manifold.lifting.traced_edges import EFFORTS
from equimorph.model import Box
from equimorph.structures import States


def account(
    pairing: Pairing,
    cells: Cells,
    given: tuple[Box, Mapping[str, float], tuple[int, ...]],
    bisected: int,
) -> EquilibriumSet:
    """Number the used points, find pieces, folds and boundaries, and write the audit."""
    used = np.flatnonzero(np.bincount(cells.corners.ravel(), minlength=pairing.points.count))
    number = np.full(pairing.points.count, -1)
    number[used] = np.arange(len(used))
    store = pairing.points
    whole = Complex(
        States(pairing.setting.structure, store.z[used].copy(), store.p[used].copy()),
        store.kind[used].copy(),
        store.index[used].copy(),
        store.vertex[used].copy(),
        number[cells.corners],
        cells.index,
        _kept(number[cells.folds]),
        _kept(number[cells.caps]),
        _kept(number[cells.crossings]),
    )
    lost = abandoned(pairing)
    lifting = Lifting(
        len(lost),
        sum(int(pairing.effort[edge]) >= EFFORTS for _, edge in lost),
        pairing.conflicts,
        _parity_violations(pairing),
        cells.doubtful if len(pairing.setting.free) > 1 else len(lonely(pairing)),
        bisected,
    )
    return described(Frame(pairing.setting, pairing.mesh, *given), whole, lifting)


def _kept(facets: Int[np.ndarray, "n d"]) -> Int[np.ndarray, "m d"]:
    """Facets whose points are all in use."""
    return facets[(facets >= 0).all(axis=1)]


def _parity_violations(pairing: Pairing) -> int:
    """Curves whose ends contradict sign det F_z: equal parity across, opposite on return.

    It is the other way round behind a crossing, where det [F_z F_t; tᵀ] changes its sign.
    """
    curves, points = pairing.curves, pairing.points
    start, end = np.array(curves.start, int), np.array(curves.end, int)
    crossed = np.zeros(len(start), int)
    for curve, inner in curves.inner.items():
        crossed[curve] = np.count_nonzero(points.kind[inner] == CROSSING)
    closed = end >= 0
    start, end = start[closed], end[closed]
    returned = (points.vertex[start] == points.vertex[end]).astype(int)
    change = points.index[start] - points.index[end] - returned - crossed[closed]
    return int((change % 2 == 1).sum())
