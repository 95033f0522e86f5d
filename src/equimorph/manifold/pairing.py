"""Sheet lifting, part one: pair the equilibria at both ends of every grid edge by lifting it.

From each known equilibrium over an edge's end, the edge is lifted: the curve ends over the other
end, or turns at folds and comes back as another equilibrium over the same end, or leaves through a
constraint. New ends are new equilibria; flood until nothing new appears.
"""

from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Bool, Float, Int

from equimorph.equilibria import ParameterLine, TraceOptions
from equimorph.equilibria.outcome import Outcome, follow
from equimorph.equilibria.tracing import ARRIVAL, BRANCH, CONSTRAINT, FOLD, RETURN
from equimorph.manifold.directly import lift_directly
from equimorph.manifold.mesh import BaseMesh
from equimorph.manifold.points import BETWEEN, CAP, Points
from equimorph.manifold.points import FOLD as ON_FOLD
from equimorph.model import Constraint, Progress
from equimorph.structures import Structure

UNTRACED, ABANDONED, HARD = -1, -2, -3
"""Marks of rays without a curve; hard are those that one step cannot lift."""
EFFORTS = 4
CHUNK = 4096


@dataclass(frozen=True)
class Setting:
    """The structure and how points of the box become its parameters."""

    structure: Structure
    base: Float[np.ndarray, " parameters"]
    free: Int[np.ndarray, " d"]
    constraints: tuple[Constraint, ...]

    def parameters(self, points: Float[np.ndarray, "some d"]) -> Float[np.ndarray, "some P"]:
        """All parameters over points of the box."""
        p = np.tile(self.base, (len(points), 1))
        p[:, self.free] = points
        return p

    @property
    def scales(self) -> Float[np.ndarray, " d"]:
        """Scales of the free parameters."""
        return np.asarray(self.structure.scales[self.free])


@dataclass
class Curves:
    """Lifted edges: edge, start point, end point (−1: left through a constraint), inner points."""

    edge: list[int] = field(default_factory=list)
    start: list[int] = field(default_factory=list)
    end: list[int] = field(default_factory=list)
    inner: dict[int, list[int]] = field(default_factory=dict)

    def add(self, edge: int, start: int, end: int, inner: list[int]) -> int:
        """Add a curve; return its number."""
        self.edge.append(edge)
        self.start.append(start)
        self.end.append(end)
        if inner:
            self.inner[len(self.edge) - 1] = inner
        return len(self.edge) - 1

    def extend(
        self,
        edges: Int[np.ndarray, " n"],
        starts: Int[np.ndarray, " n"],
        ends: Int[np.ndarray, " n"],
    ) -> Int[np.ndarray, " n"]:
        """Add curves without inner points; return their numbers."""
        numbers = len(self.edge) + np.arange(len(edges))
        self.edge.extend(edges.tolist())
        self.start.extend(starts.tolist())
        self.end.extend(ends.tolist())
        return numbers


@dataclass
class Pairing:
    """Everything known while the set is being lifted."""

    setting: Setting
    mesh: BaseMesh
    points: Points
    curves: Curves
    rays: Int[np.ndarray, "capacity slots"]
    """Curve that starts or ends at a point over one of its vertex's edges; `UNTRACED` if none."""
    slots: Int[np.ndarray, "E 2"]
    """Place of an edge among those of its two vertices."""
    incident: Int[np.ndarray, "V slots"]
    """Edges of each vertex, in the order of their slots; −1 beyond."""
    effort: Int[np.ndarray, " E"]
    conflicts: int = 0

    def ray(self, point: int, edge: int) -> int:
        """Curve at a point along an edge."""
        side = int(self.mesh.edges[edge, 1] == self.points.vertex[point])
        return int(self.rays[point, self.slots[edge, side]])

    def set_ray(self, point: int, edge: int, curve: int) -> None:
        """Enter the curve at a point along an edge."""
        side = int(self.mesh.edges[edge, 1] == self.points.vertex[point])
        self.rays[point, self.slots[edge, side]] = curve

    def mark(self, rays: "Rays", mark: int) -> None:
        """Mark rays that have no curve."""
        self.rays[rays.points, self.slots[rays.edges, rays.sides]] = mark

    def fit(self) -> None:
        """Make room for rays of new points and edges."""
        shape = (len(self.points.z), self.incident.shape[1])
        if shape != self.rays.shape:
            rays = np.full(shape, UNTRACED)
            rays[: self.rays.shape[0], : self.rays.shape[1]] = self.rays
            self.rays = rays

    def use_mesh(self, mesh: BaseMesh) -> None:
        """Take over a mesh with more vertices and edges; curves on removed edges are forgotten."""
        removed = np.setdiff1d(np.unique(self.mesh.sides), np.unique(mesh.sides))
        gone = set(removed.tolist())
        for curve, edge in enumerate(self.curves.edge):
            if edge in gone:
                self.forget(curve, ABANDONED)
        for edge in removed:  # untraced rays of removed edges need no tracing any more
            for side in range(2):
                for point in self.points.over(int(self.mesh.edges[edge, side])):
                    self.rays[point, self.slots[edge, side]] = ABANDONED
        self.points.grow_vertices(len(mesh.vertices))
        self.incident, self.slots = _incidence(mesh)
        more = len(mesh.edges) - len(self.effort)
        self.effort = np.concatenate([self.effort, np.zeros(more, int)])
        self.mesh = mesh
        self.fit()

    def forget(self, curve: int, mark: int = UNTRACED) -> None:
        """Take a curve back from its ends."""
        edge = self.curves.edge[curve]
        for point in (self.curves.start[curve], self.curves.end[curve]):
            if point >= 0 and self.ray(point, edge) == curve:
                self.set_ray(point, edge, mark)


def _incidence(mesh: BaseMesh) -> tuple[Int[np.ndarray, "V slots"], Int[np.ndarray, "E 2"]]:
    """Edges of each vertex in the order of their numbers, and the place of each edge there.

    Removed edges keep their places, so that known rays stay where they are.
    """
    ends = mesh.edges.ravel()
    order = np.argsort(ends, kind="stable")
    degree = np.bincount(ends, minlength=len(mesh.vertices))
    first = np.concatenate([[0], np.cumsum(degree)[:-1]])
    place = np.empty(len(ends), int)
    place[order] = np.arange(len(ends)) - first[ends[order]]
    incident = np.full((len(mesh.vertices), int(degree.max())), -1)
    incident[ends, place] = np.arange(len(ends)) // 2
    return incident, place.reshape(-1, 2)


def start_pairing(setting: Setting, mesh: BaseMesh) -> Pairing:
    """Empty pairing on a mesh."""
    incident, slots = _incidence(mesh)
    pairing = Pairing(
        setting,
        mesh,
        Points.empty(setting.structure, len(mesh.vertices)),
        Curves(),
        np.full((0, incident.shape[1]), UNTRACED),
        slots,
        incident,
        np.zeros(len(mesh.edges), int),
    )
    pairing.fit()
    return pairing


def flood(pairing: Pairing, progress: Progress) -> None:
    """Lift edges from all known points until every ray is traced or given up.

    All rays that one step can lift go first; the others wait and are traced many at a time.
    """
    while True:
        pairing.fit()
        rays, tracer = _pending(pairing, {UNTRACED}), _lift_directly
        if len(rays.points) == 0:
            rays, tracer = _pending(pairing, {UNTRACED, HARD}), _trace
        if len(rays.points) == 0:
            return
        for at in range(0, len(rays.points), CHUNK):
            tracer(pairing, rays.take(slice(at, at + CHUNK)))
            pairing.fit()
        live = np.count_nonzero(pairing.points.kind[: pairing.points.count] == 0)
        progress.report("lifting edges", int(live), None)


@dataclass(frozen=True)
class Rays:
    """Edges seen from points over one of their ends: the first or the second."""

    points: Int[np.ndarray, " n"]
    edges: Int[np.ndarray, " n"]
    sides: Int[np.ndarray, " n"]

    def take(self, some: Int[np.ndarray, " m"] | Bool[np.ndarray, " n"] | slice) -> "Rays":
        """Return some of the rays."""
        return Rays(self.points[some], self.edges[some], self.sides[some])


def _pending(pairing: Pairing, marks: set[int]) -> Rays:
    """Rays with certain marks: from one end of an edge at a time, lest a curve be traced twice."""
    count = pairing.points.count
    vertex = pairing.points.vertex[:count]
    marked = np.isin(pairing.rays[:count], list(marks)) & (vertex >= 0)[:, None]
    points, slots = np.nonzero(marked)
    edges = pairing.incident[vertex[points], slots]
    points, edges = points[edges >= 0], edges[edges >= 0]
    sides = (pairing.mesh.edges[edges, 1] == vertex[points]).astype(int)
    from_first = np.zeros(len(pairing.mesh.edges), bool)
    from_first[edges[sides == 0]] = True
    return Rays(points, edges, sides).take((sides == 0) | ~from_first[edges])


def _line(pairing: Pairing, rays: Rays) -> ParameterLine:
    setting, mesh = pairing.setting, pairing.mesh
    start = setting.parameters(mesh.vertices[mesh.edges[rays.edges, rays.sides]])
    end = setting.parameters(mesh.vertices[mesh.edges[rays.edges, 1 - rays.sides]])
    return ParameterLine(setting.structure, start, end - start)


def _lift_directly(pairing: Pairing, rays: Rays) -> None:
    """Enter the curves of rays that one step lifts; mark the others as hard."""
    store = pairing.points
    pairing.mark(rays, HARD)
    rays = rays.take(pairing.effort[rays.edges] == 0)
    line = _line(pairing, rays)
    direct = lift_directly(
        line, store.z[rays.points], store.index[rays.points], pairing.setting.constraints
    )
    done = rays.take(direct.good)
    ids, _ = store.over_vertices(
        pairing.mesh.edges[done.edges, 1 - done.sides],
        direct.z[direct.good],
        (line.start + line.velocity)[direct.good],
        direct.index[direct.good],
    )
    pairing.fit()
    _enter_many(pairing, done, ids)


def _trace(pairing: Pairing, rays: Rays) -> None:
    """Lift rays by pseudo-arclength, in ever finer steps where that is needed."""
    line = _line(pairing, rays)
    left = np.ones(len(rays.points), bool)
    for effort in range(EFFORTS):
        lanes = np.flatnonzero(left & (pairing.effort[rays.edges] == effort))
        if len(lanes):
            left[lanes] = False
            _trace_rays(pairing, rays.take(lanes), line.take(lanes), effort)
    pairing.mark(rays.take(left & (pairing.effort[rays.edges] >= EFFORTS)), ABANDONED)


def _trace_rays(
    pairing: Pairing,
    rays: Rays,
    line: ParameterLine,
    effort: int,
) -> None:
    """Lift rays by pseudo-arclength; failures ask for a higher effort."""
    points, edges, sides = rays.points, rays.edges, rays.sides
    finer = 0.35**effort
    options = TraceOptions(
        through_folds=True,
        through_branch_points=True,
        first_step=0.05 * finer,
        largest_step=0.5 * finer,
        turning=0.25 * finer,
    )
    setting, store = pairing.setting, pairing.points
    outcome = follow(line, store.z[points], setting.constraints, options)
    branched = np.unique(outcome.passed.lanes[outcome.passed.code == BRANCH])
    inner = _inner_points(outcome, line)
    for lane, (point, edge) in enumerate(zip(points.tolist(), edges.tolist(), strict=True)):
        code = int(outcome.code[lane])
        if code not in {ARRIVAL, RETURN, CONSTRAINT} or lane in branched:
            pairing.effort[edge] += 1
            continue
        if pairing.ray(point, edge) >= 0 and code == CONSTRAINT:
            continue
        rows = inner.get(lane, [])
        end = -1
        if code != CONSTRAINT:
            side = sides[lane] if code == RETURN else 1 - sides[lane]
            vertex = pairing.mesh.edges[edge, side]
            p = setting.parameters(pairing.mesh.vertices[[vertex]])
            ids, _ = store.over_vertices(
                np.array([vertex]), outcome.z[[lane]], p, _arrival_index(outcome, lane)
            )
            end = int(ids[0])
            pairing.fit()
        known = pairing.ray(point, edge)
        if known >= 0 and _other_end(pairing, known, point) == end:
            continue  # the same curve, traced from its other end in the same batch
        numbers = [store.add(z, p, index, kind, edge) for z, p, index, kind in rows]
        if code == CONSTRAINT:
            z, p = outcome.z[lane], line.parameters(outcome.t)[lane]
            # counted anew: a fold may lie between the last step and the constraint
            index = int(setting.structure.index(z[None], p[None])[0])
            numbers.append(store.add(z, p, index, CAP, edge))
        pairing.fit()
        _enter(pairing, point, edge, end, numbers)


def _arrival_index(outcome: Outcome, lane: int) -> Int[np.ndarray, " 1"]:
    return outcome.index[[lane]]


def _other_end(pairing: Pairing, curve: int, point: int) -> int:
    start, end = pairing.curves.start[curve], pairing.curves.end[curve]
    return end if start == point else start


def _enter(pairing: Pairing, point: int, edge: int, end: int, inner: list[int]) -> None:
    """Register a curve; contradictions take back what they contradict and raise the effort."""
    known = pairing.ray(point, edge)
    if known >= 0 and _other_end(pairing, known, point) == end:
        return
    taken = end >= 0 and pairing.ray(end, edge) >= 0
    if known >= 0 or taken or end == point:
        pairing.conflicts += 1
        pairing.effort[edge] += 1
        for curve in {known, pairing.ray(end, edge) if end >= 0 else -1}:
            if curve >= 0:
                pairing.forget(curve)
        return
    curve = pairing.curves.add(edge, point, end, inner)
    pairing.set_ray(point, edge, curve)
    if end >= 0:
        pairing.set_ray(end, edge, curve)


def _enter_many(pairing: Pairing, rays: Rays, ends: Int[np.ndarray, " n"]) -> None:
    """Register curves that cross their edges: at once where nothing is known, else one by one."""
    near, far = (pairing.slots[rays.edges, side] for side in (rays.sides, 1 - rays.sides))
    _, first, shared = np.unique(
        ends * pairing.rays.shape[1] + far, return_index=True, return_counts=True
    )
    new = np.zeros(len(ends), bool)
    new[first] = shared == 1
    new &= (pairing.rays[rays.points, near] < 0) & (pairing.rays[ends, far] < 0)
    numbers = pairing.curves.extend(rays.edges[new], rays.points[new], ends[new])
    pairing.rays[rays.points[new], near[new]] = numbers
    pairing.rays[ends[new], far[new]] = numbers
    rest = rays.take(~new)
    for point, edge, end in zip(
        rest.points.tolist(), rest.edges.tolist(), ends[~new].tolist(), strict=True
    ):
        _enter(pairing, point, edge, end, [])


def _inner_points(
    outcome: Outcome, line: ParameterLine
) -> dict[int, list[tuple[Float[np.ndarray, " size"], Float[np.ndarray, " P"], int, int]]]:
    """Folds of each lane in order, with one regular point between neighbours."""
    passed = outcome.passed
    p = line.start[passed.lanes] + passed.t[:, None] * line.velocity[passed.lanes]
    rows: dict[int, list[tuple[np.ndarray, np.ndarray, int, int]]] = {}
    places: dict[int, list[float]] = {}
    for i in np.flatnonzero(passed.code == FOLD):
        lane = int(passed.lanes[i])
        row = (passed.z[i], p[i], int(passed.index[i].min()), ON_FOLD)
        before = places.setdefault(lane, [])
        if before:
            rows[lane].append(_between(outcome, line, lane, (before[-1], passed.travelled[i])))
        rows.setdefault(lane, []).append(row)
        before.append(float(passed.travelled[i]))
    return rows


def _between(
    outcome: Outcome, line: ParameterLine, lane: int, span: tuple[float, float]
) -> tuple[Float[np.ndarray, " size"], Float[np.ndarray, " P"], int, int]:
    """Recorded point of a lane nearest to the middle of an interval of its length."""
    points = outcome.points
    own = slice(*np.searchsorted(points.lanes, [lane, lane + 1]))
    inside = (points.travelled[own] >= span[0]) & (points.travelled[own] <= span[1])
    assert inside.any(), "two folds in one step are refused by the tracer"
    off = np.abs(points.travelled[own] - 0.5 * (span[0] + span[1]))
    at = own.start + int(np.argmin(np.where(inside, off, np.inf)))
    p = line.start[lane] + points.t[at] * line.velocity[lane]
    return points.z[at], p, int(points.index[at]), BETWEEN


def abandoned(pairing: Pairing) -> list[tuple[int, int]]:
    """Rays that could not be traced: (point, edge) on edges that are in use."""
    used = np.append(pairing.mesh.edges_in_use, False)
    count = pairing.points.count
    vertex = pairing.points.vertex[:count]
    points, slots = np.nonzero((pairing.rays[:count] < 0) & (vertex >= 0)[:, None])
    edges = pairing.incident[vertex[points], slots]
    return [(int(a), int(b)) for a, b in zip(points, edges, strict=True) if used[b]]
