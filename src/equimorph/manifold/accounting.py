"""From numbered triangles to an equilibrium set: pieces, curves, boundary loops and the audit."""

from collections.abc import Mapping

import numpy as np
from jaxtyping import Int

from equimorph.manifold.assembly import Cells
from equimorph.manifold.audit import Audit
from equimorph.manifold.equilibrium_set import (
    Boundary,
    Component,
    EquilibriumSet,
    Stratum,
)
from equimorph.manifold.pairing import Pairing, abandoned
from equimorph.manifold.topology import (
    Surface,
    chains,
    euler_characteristic,
    flags_of,
    labels,
    orientation,
    projected_area,
    surface,
)
from equimorph.model import Box
from equimorph.structures import States


def account(
    pairing: Pairing,
    cells: Cells,
    given: tuple[Box, Mapping[str, float], tuple[int, int]],
    bisected: int,
) -> EquilibriumSet:
    """Number the used points, find pieces, curves and loops, and write the audit."""
    box, fixed, intervals = given
    corners = np.array(cells.corners, int).reshape(-1, 3)
    used, renumbered = np.unique(corners, return_inverse=True)
    corners = renumbered.reshape(-1, 3)
    number = {int(old): new for new, old in enumerate(used)}
    store = pairing.points
    points = States(pairing.setting.structure, store.z[used].copy(), store.p[used].copy())
    whole = surface(corners)
    fold_edges = flags_of(whole.edges, _renumber(cells.folds, number))
    cap_edges = flags_of(whole.edges, _renumber(cells.caps, number))
    component = labels(len(corners), whole.neighbours)
    stratum = labels(len(corners), whole.neighbours, ~fold_edges[whole.shared])
    cell_index = np.array(cells.index, int)
    boundaries = _boundaries(whole, cap_edges)
    components = _components(corners, cell_index, component, boundaries)
    strata = tuple(
        Stratum(int(cell_index[own[0]]), len(own), int(component[own[0]]))
        for own in (np.flatnonzero(stratum == k) for k in range(stratum.max(initial=-1) + 1))
    )
    coordinates = points.p[:, pairing.setting.free]
    audit = _audit(
        pairing, cells, bisected, (corners, cell_index, component, whole, coordinates), boundaries
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
        cell_index=cell_index,
        component=component,
        stratum=stratum,
        folds=tuple(chains(whole.edges[fold_edges])),
        boundaries=boundaries,
        components=components,
        strata=strata,
        audit=audit,
        mesh=pairing.mesh,
        grid_vertex=store.vertex[used].copy(),
    )


def _renumber(pairs: set[tuple[int, int]], number: dict[int, int]) -> set[tuple[int, int]]:
    kept = [(number[a], number[b]) for a, b in pairs if a in number and b in number]
    return {(min(pair), max(pair)) for pair in kept}


def _boundaries(whole: Surface, cap_edges: np.ndarray) -> tuple[Boundary, ...]:
    once = np.flatnonzero(whole.counts == 1)
    capped = {tuple(pair) for pair in whole.edges[cap_edges].tolist()}
    out = []
    for line in chains(whole.edges[once]):
        sides = np.sort(np.stack([line[:-1], line[1:]], 1), axis=1).tolist()
        on_cap = sum(tuple(side) in capped for side in sides)
        kind = "cap" if on_cap == len(sides) else ("box" if on_cap == 0 else "mixed")
        out.append(Boundary(line, kind))
    return tuple(out)


def _components(
    corners: Int[np.ndarray, "C 3"],
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
                sum(int(b.vertices[0]) in vertices for b in boundaries),
                tuple(np.unique(cell_index[own]).tolist()),
            )
        )
    return tuple(out)


def _audit(
    pairing: Pairing,
    cells: Cells,
    bisected: int,
    parts: tuple[np.ndarray, np.ndarray, np.ndarray, Surface, np.ndarray],
    boundaries: tuple[Boundary, ...],
) -> Audit:
    corners, cell_index, component, whole, coordinates = parts
    signs, contradictions = orientation(corners, whole)
    demanded = np.where(cell_index % 2 == 0, 1, -1) * signs
    area = projected_area(coordinates, corners) * demanded
    total = np.bincount(component, weights=area) if len(area) else np.zeros(0)
    overturned = int((area * np.sign(total)[component] < 0).sum()) if len(area) else 0
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
        undecided=len(cells.undecided),
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
