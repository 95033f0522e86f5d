"""From numbered cells to an equilibrium set: pieces, folds, boundaries and the audit."""

from collections.abc import Mapping

import numpy as np
from jaxtyping import Bool, Float, Int

from equimorph.manifold.audit import Audit
from equimorph.manifold.cells import Cells
from equimorph.manifold.equilibrium_set import (
    Boundary,
    Component,
    EquilibriumSet,
    Stratum,
)
from equimorph.manifold.pairing import Pairing, abandoned
from equimorph.manifold.topology import (
    Adjacency,
    adjacency,
    euler_characteristic,
    flags_of,
    keys_of,
    labels,
    orientation,
    pieces,
    projected_volume,
)
from equimorph.model import Box
from equimorph.structures import States


def account(
    pairing: Pairing,
    cells: Cells,
    given: tuple[Box, Mapping[str, float], tuple[int, ...]],
    bisected: int,
) -> EquilibriumSet:
    """Number the used points, find pieces, folds and boundaries, and write the audit."""
    box, fixed, intervals = given
    used = np.unique(cells.corners)
    number = np.full(pairing.points.count, -1)
    number[used] = np.arange(len(used))
    corners, store = number[cells.corners], pairing.points
    points = States(pairing.setting.structure, store.z[used].copy(), store.p[used].copy())
    whole = adjacency(corners)
    folds = flags_of(whole.facets, _kept(number[cells.folds]))
    caps = flags_of(whole.facets, _kept(number[cells.caps]))
    component = labels(len(corners), whole.links)
    stratum = labels(len(corners), whole.links[whole.manifold & ~folds[whole.across]])
    boundaries = _boundaries(whole, caps)
    strata = tuple(
        Stratum(int(cells.index[own[0]]), len(own), int(component[own[0]]))
        for own in (np.flatnonzero(stratum == k) for k in range(stratum.max(initial=-1) + 1))
    )
    coordinates = points.p[:, pairing.setting.free]
    audit = _audit(
        pairing, cells, bisected, (corners, cells.index, component, whole, coordinates), boundaries
    )
    return EquilibriumSet(
        structure=pairing.setting.structure,
        box=box,
        fixed=fixed,
        constraints=pairing.setting.constraints,
        intervals=intervals,
        points=points,
        kinds=store.kind[used].copy(),
        index=store.index[used].copy(),
        cells=corners,
        cell_index=cells.index,
        component=component,
        stratum=stratum,
        folds=tuple(pieces(whole.facets[folds])),
        boundaries=boundaries,
        components=_components(corners, cells.index, component, boundaries),
        strata=strata,
        audit=audit,
        mesh=pairing.mesh,
        grid_vertex=store.vertex[used].copy(),
    )


def _kept(facets: Int[np.ndarray, "n d"]) -> Int[np.ndarray, "m d"]:
    """Facets whose points are all in use."""
    return facets[(facets >= 0).all(axis=1)]


def _boundaries(whole: Adjacency, caps: Bool[np.ndarray, " F"]) -> tuple[Boundary, ...]:
    once = whole.counts == 1
    base = int(whole.facets.max(initial=0)) + 1
    capped = set(keys_of(whole.facets[once & caps], base).tolist())
    out = []
    for piece in pieces(whole.facets[once]):
        facets = _facets_of(piece, whole.facets.shape[1])
        on_cap = sum(key in capped for key in keys_of(facets, base).tolist())
        kind = "cap" if on_cap == len(facets) else ("box" if on_cap == 0 else "mixed")
        out.append(Boundary(piece, kind))
    return tuple(out)


def _facets_of(piece: Int[np.ndarray, "..."], d: int) -> Int[np.ndarray, "n d"]:
    """Facets of a piece of the boundary: a point, a polyline or triangles."""
    return np.stack([piece[:-1], piece[1:]], axis=1) if d == 2 else piece.reshape(-1, d)


def _components(
    corners: Int[np.ndarray, "C corners"],
    cell_index: Int[np.ndarray, " C"],
    component: Int[np.ndarray, " C"],
    boundaries: tuple[Boundary, ...],
) -> tuple[Component, ...]:
    out = []
    for k in range(component.max(initial=-1) + 1):
        own = component == k
        vertices = set(np.unique(corners[own]).tolist())
        out.append(
            Component(
                int(own.sum()),
                euler_characteristic(corners[own]),
                sum(int(b.vertices.flat[0]) in vertices for b in boundaries),
                tuple(np.unique(cell_index[own]).tolist()),
            )
        )
    return tuple(out)


def _audit(
    pairing: Pairing,
    cells: Cells,
    bisected: int,
    parts: tuple[
        Int[np.ndarray, "C corners"],
        Int[np.ndarray, " C"],
        Int[np.ndarray, " C"],
        Adjacency,
        Float[np.ndarray, "V d"],
    ],
    boundaries: tuple[Boundary, ...],
) -> Audit:
    corners, cell_index, component, whole, coordinates = parts
    signs, contradictions = orientation(corners, whole)
    demanded = np.where(cell_index % 2 == 0, 1, -1) * signs
    volume = projected_volume(coordinates, corners) * demanded
    total = np.bincount(component, weights=volume) if len(volume) else np.zeros(0)
    overturned = int((volume * np.sign(total)[component] < 0).sum()) if len(volume) else 0
    kinds = [boundary.kind for boundary in boundaries]
    points = np.unique(corners)
    store = pairing.points
    live = store.vertex[: store.count] >= 0
    residual = pairing.setting.structure.residual(store.z[: store.count], store.p[: store.count])
    lost = abandoned(pairing)
    return Audit(
        vertices=len(points),
        cells=len(corners),
        unpaired=len(lost),
        conflicts=sum(int(pairing.effort[edge]) >= 4 for _, edge in lost),
        retraced=pairing.conflicts,
        parity_violations=_parity_violations(pairing),
        undecided=cells.doubtful,
        bisected=bisected,
        non_manifold=int((whole.counts > 2).sum()),
        contradictions=contradictions,
        overturned=overturned,
        euler_characteristic=euler_characteristic(corners),
        components=int(component.max(initial=-1)) + 1,
        loops=tuple((kind, kinds.count(kind)) for kind in sorted(set(kinds))),
        largest_residual=float(np.abs(residual[live]).max(initial=0.0)),
        checked=0,
        missing=0,
        recovered=0,
    )


def _parity_violations(pairing: Pairing) -> int:
    """Curves whose ends contradict sign det F_z: equal parity across, opposite on return."""
    curves, points = pairing.curves, pairing.points
    start, end = np.array(curves.start, int), np.array(curves.end, int)
    closed = end >= 0
    start, end = start[closed], end[closed]
    returned = points.vertex[start] == points.vertex[end]
    odd = (points.index[start] - points.index[end]) % 2 == 1
    return int((odd != returned).sum())
