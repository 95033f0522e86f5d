"""Both curves through every point at which curves over an edge cross.

Where only one is known, the other is started by branch switching. If the other is known but was
lifted in a step that did not notice the crossing, it is traced again in finer steps.

See docs/decisions.md, "Sheets that cross are lifted one by one".
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from equimorph.arrays import Float, Int, Items, Lanes, Parameters, Place, Values
from equimorph.equilibria import ParameterLine, TraceOptions
from equimorph.equilibria.critical import null_border
from equimorph.equilibria.steps import Front, step_along
from equimorph.equilibria.trace import trace
from equimorph.equilibria.trace_options import EventCode
from equimorph.manifold.complex.marked_complex import TRIANGLES
from equimorph.manifold.geometry.crossings import reduction
from equimorph.manifold.geometry.points import VertexKind
from equimorph.manifold.lifting.edges import EFFORTS, NOISE, Inside, points_inside
from equimorph.manifold.lifting.flood import flood
from equimorph.manifold.lifting.pairing import Pairing
from equimorph.manifold.lifting.seeds import Seeds, polish
from equimorph.model import Progress, are_feasible
from equimorph.structures.metric import metric_length

DISTANCES = (0.03, 0.003, 0.0003, 3e-5, 3e-6)
"""Lengths of the first step from a crossing, in the metric, tried one after the other: of
1852 half-branches 1346 began with the first, 290 with the second, 160 with the third. Shorter are
the arcs of crossings that a constraint nearly meets."""
TURNS = 8
"""How often a new curve is followed until it turns back: of 1796 half-branches 1438 reached a
vertex at once, 33 after one turn, and none of six after more, which are rings. Arcs over layers
have up to three folds (set 511 of the soak)."""
CURVES = 2
"""Through each crossing."""
HALVES = 2
"""Of each curve through a crossing."""


def flood_crossings(
    pairing: Pairing, progress: Progress, lift: Callable[[Pairing, Progress], None] = flood
) -> None:
    """Flood, and go on until both curves through each crossing are known, if they can be.

    `lift` lifts edges from all known points, like `flood`.
    """
    lift(pairing, progress)
    for number in range(EFFORTS - 1):
        alone = lonely(pairing)
        if len(alone) == 0:
            return
        if number == 0:
            _switch(pairing, alone)
        else:
            _trace_again(pairing, alone)
        lift(pairing, progress)


def lonely(pairing: Pairing) -> Items:
    """Crossings of edges in use through which other than two curves lead."""
    curves, used = pairing.curves, pairing.mesh.edges_in_use
    through = {point: 0 for edge, own in pairing.crossings.items() if used[edge] for point in own}
    for curve, inner in curves.inner.items():
        for point in inner:
            if point in through and pairing.alive(curve):
                through[point] += 1
    for arc in (arc for edge, own in pairing.arcs.items() if used[edge] for arc in own):
        for point in through.keys() & set(arc):
            through[point] += 1
    return np.array([point for point, count in through.items() if 0 < count != CURVES], int)


def ring_middles(pairing: Pairing) -> dict[int, float]:
    """Edges over which curves between two crossings close, with the part of the way in the middle.

    Such a ring reaches neither end: where a side branch leaves a symmetric sheet and comes back to
    it within an edge, as over strips that are narrower than the grid, a vertex must lie inside.
    """
    mesh, setting, store = pairing.mesh, pairing.setting, pairing.points
    alone = lonely(pairing)
    edges = store.edge[alone]
    ends = mesh.vertices[mesh.edges[edges]] / setting.scales
    way = ends[:, 1] - ends[:, 0]
    place = store.p[alone][:, setting.free] / setting.scales - ends[:, 0]
    shares = (place * way).sum(axis=1) / (way**2).sum(axis=1)
    middles = {}
    for edge in np.unique(edges).tolist():
        own = np.sort(shares[edges == edge])
        gaps = np.diff(own)
        apart = np.flatnonzero(gaps > NOISE)
        if len(apart):
            nearest = apart[gaps[apart].argmin()]
            middles[edge] = float(own[nearest : nearest + 2].mean())
    return middles


def _trace_again(pairing: Pairing, alone: Items) -> None:
    """Forget plain curves over the edges of crossings, and have them traced with more care."""
    edges = set(pairing.points.edge[alone].tolist())
    curves = pairing.curves
    for curve, edge in enumerate(curves.edge.tolist()):
        if edge in edges and pairing.alive(curve):
            pairing.forget(curve)
    for edge in edges:
        pairing.effort[edge] = min(pairing.effort[edge] + 1, EFFORTS - 1)


def _switch(pairing: Pairing, alone: Items) -> None:
    """Enter the equilibria over vertices that the curves through crossings lead to."""
    pairing.points.over_vertices(*_beyond(pairing, alone))
    pairing.fit()


def _beyond(pairing: Pairing, alone: Int[np.ndarray, " crossings"]) -> Seeds:
    """Equilibria over vertices that the curves through crossings lead to."""
    line = edge_lines(pairing, pairing.points.edge[alone])
    halves, front = _starts(pairing, alone, line)
    owner = halves // (CURVES * HALVES)
    led = lead_out(pairing, halves, pairing.points.edge[alone[owner]], line.take(owner), front)
    _enter_arcs(pairing, alone, led.met)
    return led.seeds


def edge_lines(pairing: Pairing, edges: Items) -> ParameterLine:
    """Grid edges in parameter space, from their first ends."""
    setting, mesh = pairing.setting, pairing.mesh
    ends = setting.parameters(mesh.vertices[mesh.edges[edges].ravel()]).reshape(len(edges), 2, -1)
    return ParameterLine(setting.structure, ends[:, 0].copy(), ends[:, 1] - ends[:, 0])


@dataclass(frozen=True)
class LedOut:
    """Where half-branches over edges lead to.

    seeds: equilibria over vertices; straight: the half-branch of each that comes there without any
    event, else −1; met: points inside edges, in order along half-branches, whose numbers are their
    lanes; rings: where those first turn back that come back to where they began.
    """

    seeds: Seeds
    straight: Items
    met: Inside
    rings: dict[int, Place]


def lead_out(
    pairing: Pairing,
    halves: Int[np.ndarray, " m"],
    edges: Int[np.ndarray, " m"],
    line: ParameterLine,
    front: Front,
) -> LedOut:
    """Follow half-branches over edges, by their numbers, from points near their beginnings."""
    mesh, setting = pairing.mesh, pairing.setting
    reached, straight, met, turns = [], [], [], dict[int, Place]()
    towards = (front.tangent_t > 0.0).astype(int)
    z, p = front.z, line.parameters(front.t)
    start, rings = z, list[int]()
    for turn in range(TURNS):
        goal = mesh.edges[edges, towards]
        way = setting.parameters(mesh.vertices[goal]) - p
        # recorded: a regular point between two singular ones begins at a state on the way
        options = TraceOptions(through_folds=True, through_branch_points=True, first_step=0.005)
        ways = ParameterLine(setting.structure, p, way)
        outcome = trace(ways, z, setting.constraints, options)
        leads_on = np.isin(outcome.code, (EventCode.RETURNED, EventCode.CONSTRAINT))
        inside = points_inside(pairing, edges, outcome, ways, leads_on)
        inside = _from_starts(z, ways, inside.take(leads_on[inside.lanes]))
        met.append(replace(inside, lanes=halves[inside.lanes]))
        passed = outcome.passed
        for lane, t in zip(
            *(each[passed.code == EventCode.FOLD] for each in (passed.lanes, passed.t)), strict=True
        ):
            turns.setdefault(int(halves[lane]), ways.start[lane] + t * ways.velocity[lane])
        there = np.flatnonzero(outcome.code == EventCode.ARRIVED)
        seeds, good = polish(setting, mesh, goal[there], outcome.z[there])
        reached.append(seeds)
        bent = np.isin(there, passed.lanes) | (turn > 0)
        straight.append(np.where(bent, -1, halves[there])[good])
        back = outcome.code == EventCode.RETURNED
        around = back & (metric_length(setting.structure, outcome.z - start) < NOISE)
        rings.extend(halves[around].tolist())
        back = np.flatnonzero(back & ~around)
        z, p, edges, towards = outcome.z[back], p[back], edges[back], 1 - towards[back]
        halves, start = halves[back], start[back]
        if len(back) == 0:
            break
    vertices, z, p, index = (np.concatenate(column) for column in zip(*reached, strict=True))
    closed = {half: turns[half] for half in (*rings, *halves.tolist()) if half in turns}
    seeds = vertices, z, p, index
    return LedOut(seeds, np.concatenate(straight), Inside.concatenate(met), closed)


def _starts(
    pairing: Pairing, alone: Items, line: ParameterLine
) -> tuple[Int[np.ndarray, " m"], Front]:
    """Numbers of the half-branches at all crossings, four each, and points on them."""
    store = pairing.points
    z, p = store.z[alone], store.p[alone]
    tangents = _tangents(pairing, line, z, p)
    owner = np.repeat(np.arange(len(alone)), CURVES * HALVES)
    return first_steps(pairing, line.take(owner), z[owner], p[owner], tangents)


def first_steps(
    pairing: Pairing, line: ParameterLine, z: Lanes, p: Parameters, tangents: tuple[Lanes, Values],
    index: Items | None = None,
) -> tuple[Int[np.ndarray, " m"], Front]:  # fmt: skip
    """Points on half-branches that begin with known tangents on lines, and which these are.

    `index`: of regular beginnings; first steps pass no fold.
    """
    t = np.einsum("li,li->l", p - line.start, line.velocity) / (line.velocity**2).sum(axis=1)
    here = Front(z, t, *tangents, np.zeros(len(z), int))
    good = np.zeros(len(z), bool)
    there = here
    for distance in DISTANCES:
        todo = np.flatnonzero(~good)
        if len(todo) == 0:
            break
        lines = line.take(todo)
        front, found = step_along(lines, here.take(todo), np.full(len(todo), distance))
        inside = found & (front.t > 0.0) & (front.t < 1.0)
        places = lines.parameters(front.t)
        inside &= are_feasible(pairing.setting.constraints, front.z, places)
        if index is not None:
            inside &= pairing.setting.structure.index(front.z, places) == index[todo]
        there, good[todo[inside]] = there.with_rows(todo[inside], front.take(inside)), True
    at = np.flatnonzero(good)
    return at, there.take(at)


def _from_starts(z: Float[np.ndarray, "m size"], ways: ParameterLine, inside: Inside) -> Inside:
    """Points inside edges in order along their lanes, with the regular ones before their folds."""
    lanes = np.unique(inside.lanes[inside.kinds == VertexKind.FOLD])
    p = ways.start[lanes]
    index = ways.structure.index(z[lanes], p)
    starts = Inside(lanes, z[lanes], p, index, np.full(len(lanes), VertexKind.BETWEEN))
    all_points = Inside.concatenate([starts, inside])
    return all_points.take(np.argsort(all_points.lanes, kind="stable"))


def _enter_arcs(pairing: Pairing, alone: Items, met: Inside) -> None:
    """Enter curves both of whose halves leave through a constraint before they reach a vertex.

    So do the side branches of pitchforks near where these leave through the constraint, at every
    scale; and those that turn back in folds before they leave, over strips along them. `met` are
    points of half-branches in order, its lanes the numbers of these.
    """
    if pairing.mesh.dimension > TRIANGLES:
        return
    store = pairing.points
    again = met.lanes[met.kinds == VertexKind.CROSSING]
    left = np.setdiff1d(met.lanes[met.kinds == VertexKind.CAP], again)
    for curve in np.unique(left[np.isin(left ^ 1, left)] // HALVES).tolist():
        crossing = int(alone[curve // CURVES])
        edge = int(store.edge[crossing])
        first, second = (
            store.add_many(own.z, own.p, own.index, own.kinds, edge).tolist()
            for own in (met.take(met.lanes == HALVES * curve + k) for k in range(HALVES))
        )
        pairing.arcs.setdefault(edge, []).append((*first[::-1], crossing, *second))
    pairing.fit()


def _tangents(
    pairing: Pairing,
    line: ParameterLine,
    z: Float[np.ndarray, "n size"],
    p: Float[np.ndarray, "n P"],
) -> tuple[Float[np.ndarray, "m size"], Float[np.ndarray, " m"]]:
    """Unit tangents of the four half-branches at crossings: isotropic vectors of the Hessian."""
    setting = pairing.setting
    structure = setting.structure
    length = np.linalg.norm(line.velocity[:, setting.free] / setting.scales, axis=1)
    directions = (line.velocity / length[:, None])[:, None]
    known = reduction(structure, z, p, null_border(structure, z, p), directions)
    values, vectors = np.linalg.eigh(known.hessian)
    low, high = np.sqrt(np.maximum(-values[:, :1], 0.0)), np.sqrt(np.maximum(values[:, 1:], 0.0))
    pair = [high * vectors[:, :, 0] + sign * low * vectors[:, :, 1] for sign in (1.0, -1.0)]
    four = np.stack([sign * each for each in pair for sign in (1.0, -1.0)], axis=1)
    dz = np.einsum("lfk,lki->lfi", four, known.along_z).reshape(-1, z.shape[1])
    dt = (four[:, :, 1] / length[:, None]).ravel()
    weight = np.repeat(line.weight, 4)
    norm = np.hypot(metric_length(structure, dz), weight * dt)
    return dz / norm[:, None], dt / norm
