"""`equilibrium_set`: lift a grid, close the loops, and account for everything."""

from collections.abc import Mapping, Sequence

import numpy as np
from jaxtyping import Int

from equimorph.equilibria import find_equilibria
from equimorph.errors import InputError
from equimorph.manifold.assembly import Cells, assemble
from equimorph.manifold.audit import Audit
from equimorph.manifold.equilibrium_set import (
    Boundary,
    Component,
    EquilibriumSet,
    Stratum,
)
from equimorph.manifold.mesh import bisect, grid_mesh
from equimorph.manifold.pairing import Pairing, Setting, abandoned, flood, start_pairing
from equimorph.manifold.polygons import find_loops
from equimorph.manifold.seeds import seeds
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
from equimorph.model import (
    Box,
    Constraint,
    Progress,
    Silent,
    names_of,
    parameter_vector,
    position,
)
from equimorph.structures import States, Structure

BISECTIONS = 12


def equilibrium_set(
    structure: Structure,
    box: Box,
    *,
    fixed: Mapping[str, float] | None = None,
    within: Sequence[Constraint] = (),
    intervals: tuple[int, int] = (47, 81),
    seed: int = 0,
    checks: int = 2,
    progress: Progress | None = None,
) -> EquilibriumSet:
    """All equilibria over a box in two parameters that are connected to the seeds.

    Sheet lifting: equilibria at both ends of every grid edge are paired by lifting the edge;
    around each triangle the curves close into loops that bound discs of the set. Folds and
    constraints carry exact vertices. Seeds: natural states over a coarse grid, and random search.

    Parameters
    ----------
    box
        Ranges of the two free parameters.
    fixed
        Values of other parameters; those not named keep their defaults.
    within
        Constraints that cut the set off, like ``[arch.max_curvature <= 20]``.
    intervals
        Grid intervals along the two parameters.
    seed
        Of the random generator; the result is deterministic.
    checks
        Random points below the set at which an independent search looks for equilibria off it.
    progress
        Sink for progress reports.

    Returns
    -------
    The set with its audit; look at ``audit.clean``.

    Raises
    ------
    InputError
        For a box that is not two-dimensional, unknown names, parameters both free and fixed, or
        values without meaning.
    """
    progress = progress or Silent()
    setting = _setting(structure, box, fixed or {}, tuple(within), intervals)
    mirrored = _mirrored(setting)
    mesh = grid_mesh(box, (intervals[0], intervals[1]), mirrored)
    progress.report("seeds", 0, 1)
    pairing = start_pairing(setting, mesh)
    pairing.points.over_vertices(*seeds(setting, mesh, seed))
    pairing.fit()
    cells, bisected = _lifted(pairing, progress)
    eset = _account(pairing, cells, (box, dict(fixed or {}), intervals), bisected)
    return _checked(eset, seed, checks, progress)


def _setting(
    structure: Structure,
    box: Box,
    fixed: Mapping[str, float],
    within: tuple[Constraint, ...],
    intervals: tuple[int, int],
) -> Setting:
    if len(box.names) != 2:
        raise InputError(
            f"`box` must have two parameters; got {len(box.names)} ({', '.join(box.names)})."
        )
    if len(intervals) != 2 or any(int(n) != n or n < 2 for n in intervals):
        raise InputError(f"`intervals` must be two whole numbers >= 2; got {intervals!r}.")
    both = set(box.names) & set(fixed)
    if both:
        raise InputError(f"`fixed` must not name a parameter of the box; got {', '.join(both)}.")
    free = np.array([position(structure.parameters, name) for name in box.names])
    for corner in (box.lower, box.upper):
        values = dict(zip(box.names, corner.tolist(), strict=True))
        base = parameter_vector(structure.parameters, {**fixed, **values})
    return Setting(structure, base, free, within)


def _mirrored(setting: Setting) -> tuple[bool, bool]:
    """Whether a symmetry of the structure reverses each free parameter."""
    signs = [symmetry.signs[setting.free] for symmetry in setting.structure.symmetries()]
    first, second = (any(sign[k] < 0 for sign in signs) for k in range(2))
    return first, second


def _lifted(pairing: Pairing, progress: Progress) -> tuple[Cells, int]:
    """Flood, close, assemble; bisect what is not certain and go on."""
    bisected = 0
    for _ in range(BISECTIONS):
        flood(pairing, progress)
        progress.report("closing loops", 0, 1)
        loops = find_loops(pairing)
        cells = assemble(pairing, loops)
        doubtful = sorted({*loops.ambiguous, *loops.broken, *cells.undecided})
        if not doubtful:
            break
        bisected += len(doubtful)
        longest = _longest_sides(pairing, np.array(doubtful))
        pairing.use_mesh(bisect(pairing.mesh, longest, _mirrored(pairing.setting)))
    cells.undecided = doubtful
    return cells, bisected


def _longest_sides(
    pairing: Pairing, triangles: Int[np.ndarray, " n"]
) -> Int[np.ndarray, " m"]:
    mesh, sides = pairing.mesh, pairing.mesh.sides[triangles]
    ends = mesh.vertices[mesh.edges[sides]] / pairing.setting.scales
    length = np.linalg.norm(ends[:, :, 0] - ends[:, :, 1], axis=2)
    return np.unique(sides[np.arange(len(triangles)), length.argmax(axis=1)])


def _account(
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


def _checked(
    eset: EquilibriumSet, seed: int, checks: int, progress: Progress
) -> EquilibriumSet:
    """Look for equilibria that the set lacks, by random search at random points."""
    generator = np.random.default_rng([seed, 1])
    checks = checks if len(eset.cells) else 0
    checked = missing = 0
    names = names_of(eset.structure.parameters)
    for number in range(checks):
        progress.report("independent checks", number, checks)
        cell = eset.cells[generator.integers(len(eset.cells))]
        point = generator.dirichlet(np.ones(3)) @ eset.coordinates[cell]
        values = dict(zip(eset.names, point.tolist(), strict=True))
        p = eset.parameters_at(values)
        found = find_equilibria(
            eset.structure,
            dict(zip(names, p.tolist(), strict=True)),
            within=eset.constraints,
            starts=200,
            seed=seed + 7 * number + 1,
        )
        checked, missing = checked + len(found), missing + _lacking(found, eset.at(**values))
    audit = Audit(**{**vars(eset.audit), "checked": checked, "missing": missing})
    return EquilibriumSet(**{**_fields(eset), "audit": audit})


def _lacking(found: States, known: States) -> int:
    if len(known) == 0:
        return len(found)
    n, mass = found.structure.unknowns, found.structure.mass
    gap = ((found.z[:, None, :n] - known.z[None, :, :n]) ** 2) @ mass
    return int((np.sqrt(gap.min(axis=1)) > 1e-5).sum())


def _fields(eset: EquilibriumSet) -> dict[str, object]:
    return {name: getattr(eset, name) for name in EquilibriumSet.__dataclass_fields__}
