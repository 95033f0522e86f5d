"""Sheet lifting: the pairs of equilibria over the ends of grid edges.

Tangents of the set at its points over grid vertices tell where rays end: see docs/decisions.md,
"Every point is corrected once, and rays are matched by tangents".
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from enum import IntEnum
from typing import NamedTuple

import numpy as np

from equimorph.arrays import Float, Int, Items, ItemValues
from equimorph.columns import Columns
from equimorph.equilibria import ParameterLine
from equimorph.linalg.determinants import in_units
from equimorph.manifold.complex.base_mesh import BaseMesh
from equimorph.manifold.geometry.points import Points, VertexKind
from equimorph.manifold.geometry.setting import Setting
from equimorph.manifold.lifting.curves import Curves
from equimorph.manifold.lifting.ray_kernels import enter_rays, rays_marked
from equimorph.structures.metric import metric_length
from equimorph.tolerances import SAME_STATE

NONE = -1
"""Index of points without tangents, which that of no state is."""
TOGETHER = 4096
"""Points whose slopes are computed together: their arrays stay in the processor's cache."""
LAST = 1e-13, 1e-6
"""Largest entry of corrections that are taken: less is round-off, and with more it is no point."""


@dataclass
class Slopes:
    """Of each point: tangents along the free parameters, index, determinant of F_z, excess.

    Computed once, when it is first asked for; the Newton step that comes with them is the last one
    of the point. Points that lie over no grid vertex have none.

    tangents: changes of z for unit changes of the parameters; index: `NONE` where there are none;
    excess: over each constraint, nan where nobody asked for it; unit: power of two in which
    determinants are measured, that of most of the first.
    """

    tangents: Float[np.ndarray, "capacity d size"]
    index: Int[np.ndarray, " capacity"]
    determinant: Float[np.ndarray, " capacity"]
    excess: Float[np.ndarray, "capacity constraints"]
    count: int = 0
    unit: float | None = None

    @classmethod
    def empty(cls, setting: Setting) -> "Slopes":
        """Return an empty table."""
        shape = (0, len(setting.free), setting.structure.size)
        excess = np.zeros((0, len(setting.constraints)))
        return cls(np.zeros(shape), np.zeros(0, int), np.zeros(0), excess)

    def fit(self, setting: Setting, points: Points, some: Items | None = None) -> None:
        """Compute what is missing, of all points or of some.

        This corrects nothing by itself: points are exact, and the step that comes with their
        tangents takes off what round-off is left.
        """
        self._reserve(len(points.z))
        if some is None:
            some, self.count = np.arange(self.count, points.count), points.count
        new = some[(points.vertex[some] >= 0) & (self.index[some] == NONE)]
        for at in range(0, len(new), TOGETHER):
            self._compute(setting, points, new[at : at + TOGETHER])

    def _compute(self, setting: Setting, points: Points, new: Items) -> None:
        """Compute what some points have."""
        z, p = points.z.take(new, axis=0), points.p.take(new, axis=0)
        directions = np.zeros((len(new), len(setting.free), p.shape[1]))
        directions[:, np.arange(len(setting.free)), setting.free] = 1.0
        out = setting.structure.respond(z, p, directions)
        if self.unit is None:
            self.unit = float(np.median(out.determinant[:, 1]))
        self.tangents[new], self.index[new] = out.tangents, out.index
        self.determinant[new] = in_units(out.determinant, self.unit)
        largest = np.abs(out.dz).max(axis=1)
        near = np.flatnonzero((largest > LAST[0]) & (largest < LAST[1]))
        points.z[new[near]] = z.take(near, axis=0) + out.dz.take(near, axis=0)

    def _reserve(self, capacity: int) -> None:
        """Make room for as many points as there may be."""
        known = len(self.index)
        if known < capacity:
            for name in ("tangents", "index", "determinant", "excess"):
                old = getattr(self, name)
                new = np.empty((capacity, *old.shape[1:]), old.dtype)
                new[:known] = old
                setattr(self, name, new)
            self.index[known:], self.excess[known:] = NONE, np.nan


class RayMark(IntEnum):
    """Rays without a curve."""

    UNTRACED = -1
    ABANDONED = -2
    """Tracing failed with every effort."""
    HARD = -3
    """One step cannot lift them."""


@dataclass(frozen=True)
class Rays(Columns):
    """Edges seen from points over one of their ends: the first or the second."""

    points: Items
    edges: Items
    sides: Items


class FoldExit(NamedTuple):
    """State at which a fold leaves a grid triangle, and the edge over which it lies.

    edge: −1 if it is a corner inside, where the fold meets a constraint; inside: z and p of the
    state passed on the way that lies deepest inside the triangle, if one was passed.
    """

    edge: int
    z: Float[np.ndarray, " size"]
    p: Float[np.ndarray, " parameters"]
    inside: tuple[Float[np.ndarray, " size"], Float[np.ndarray, " parameters"]] | None


class CapExit(NamedTuple):
    """State at which a constraint leaves a grid triangle, and the edge over which it lies.

    way: z, p and index of the states that were passed, with the first and the last one.
    """

    edge: int
    z: Float[np.ndarray, " size"]
    p: Float[np.ndarray, " parameters"]
    way: list[tuple[Float[np.ndarray, " size"], Float[np.ndarray, " parameters"], int]]


@dataclass
class Pairing:
    """Everything known while the set is being lifted."""

    setting: Setting
    mesh: BaseMesh
    points: Points
    curves: Curves
    rays: Int[np.ndarray, "capacity slots"]
    """Curve that starts or ends at a point over one of its vertex's edges; a `RayMark` if none."""
    slots: Int[np.ndarray, "E 2"]
    """Place of an edge among those of its two vertices."""
    incident: Int[np.ndarray, "V slots"]
    """Edges of each vertex, in the order of their slots; −1 beyond."""
    effort: Int[np.ndarray, " E"]
    limit: int
    """Most points; see `is_full`."""
    slopes: Slopes
    conflicts: int = 0
    crossings: dict[int, list[int]] = field(default_factory=dict)
    """Points of each edge at which two curves cross."""
    arcs: dict[int, list[tuple[int, ...]]] = field(default_factory=dict)
    """Curves over each edge that come from a constraint, pass a crossing, and on both sides of it
    maybe folds, or a fold alone, and leave through a constraint: their points."""
    exits: dict[tuple[int, ...], FoldExit | None] = field(default_factory=dict)
    """Where folds leave triangles, by the corners of these and the fold, as far as that was asked
    for."""
    cap_exits: dict[tuple[int, ...], CapExit | None] = field(default_factory=dict)
    """Where constraints leave triangles, likewise."""
    hubs: dict[tuple[int, int], int] = field(default_factory=dict)
    """Points between two of these at which a fold of one of the sheets crosses, too."""
    tips: dict[tuple[int, int], int] = field(default_factory=dict)
    """Points of folds, by the points on both sides between which they turn sharply."""
    rings: dict[int, float] = field(default_factory=dict)
    """Edges over which a curve between two folds closes, with the part of the way between these."""
    looked_at: int = 0
    """Curves that were looked at for zeros that they hide; see `take_back_hiding`."""

    @property
    def is_full(self) -> bool:
        """Whether there are more points than allowed: nothing further is lifted."""
        return self.points.count > self.limit

    def ray(self, point: int, edge: int) -> int:
        """Curve at a point along an edge."""
        side = int(self.mesh.edges[edge, 1] == self.points.vertex[point])
        return int(self.rays[point, self.slots[edge, side]])

    def set_ray(self, point: int, edge: int, curve: int) -> None:
        """Enter the curve at a point along an edge."""
        side = int(self.mesh.edges[edge, 1] == self.points.vertex[point])
        self.rays[point, self.slots[edge, side]] = curve

    def mark(self, rays: Rays, mark: RayMark) -> None:
        """Mark rays that have no curve."""
        self.rays[rays.points, self.slots[rays.edges, rays.sides]] = mark

    def line(self, rays: Rays) -> ParameterLine:
        """Edges in parameter space, from the ends from which rays see them."""
        setting, mesh = self.setting, self.mesh
        start = setting.parameters(mesh.vertices[mesh.edges[rays.edges, rays.sides]])
        end = setting.parameters(mesh.vertices[mesh.edges[rays.edges, 1 - rays.sides]])
        return ParameterLine(setting.structure, start, end - start)

    def excess(self, points: Items, constraint: int) -> ItemValues:
        """Excess of points over one of the constraints."""
        self.slopes.fit(self.setting, self.points)
        known = self.slopes.excess[:, constraint]
        new = points[np.isnan(known[points])]
        z, p = self.points.z[new], self.points.p[new]
        known[new] = self.setting.constraints[constraint].excess(z, p)
        return np.asarray(known[points])

    def crossing(
        self, z: Float[np.ndarray, " size"], p: Float[np.ndarray, " P"], index: int, edge: int
    ) -> int:
        """Number of a polished crossing point on an edge, known or added."""
        known = self.crossings.setdefault(edge, [])
        for point in known:
            if metric_length(self.setting.structure, self.points.z[point] - z) < SAME_STATE:
                return point
        known.append(self.points.add(z, p, index, VertexKind.CROSSING, edge))
        return known[-1]

    def alive(self, curve: int) -> bool:
        """Whether a curve has not been taken back."""
        return self.ray(int(self.curves.start[curve]), int(self.curves.edge[curve])) == curve

    def live_curves(self) -> Items:
        """Curves that have not been taken back, in order."""
        start, edge = self.curves.start, self.curves.edge
        side = (self.mesh.edges[edge, 1] == self.points.vertex[start]).astype(int)
        return np.flatnonzero(self.rays[start, self.slots[edge, side]] == np.arange(len(edge)))

    def rays_with(self, mark: RayMark) -> Rays:
        """Rays with a certain mark: each edge from one end, so that no curve is traced twice."""
        found = rays_marked(
            int(mark), self.points.count, self.points.vertex, self.rays, self.incident,
            self.mesh.edges,
        )  # fmt: skip
        return Rays(*found)

    def enter(
        self, point: int, edge: int, end: int, inner: Sequence[int] = (), tried: int = 0
    ) -> int:
        """Register a curve; return its number, −1 if it is known or contradicts another one.

        Contradictions take back what they contradict. `tried` is the effort with which the curve
        was lifted.
        """
        known = self.ray(point, edge)
        if known >= 0 and self.other_end(known, point) == end:
            return -1
        taken = end >= 0 and self.ray(end, edge) >= 0
        if known >= 0 or taken or end == point:
            self.contradict(edge, tried)
            for curve in {known, self.ray(end, edge) if end >= 0 else -1}:
                if curve >= 0:
                    self.forget(curve)
            return -1
        curve = self.curves.add(edge, point, end, list(inner))
        self.set_ray(point, edge, curve)
        if end >= 0:
            self.set_ray(end, edge, curve)
        return curve

    def contradict(self, edge: int, tried: int) -> None:
        """Count a contradiction; the next effort on its edge is the one after that tried.

        Curves that were lifted together may contradict each other many times. All of them have had
        one attempt: each further one is to have its turn.
        """
        self.conflicts += 1
        self.effort[edge] = max(self.effort[edge], tried + 1)

    def enter_at_once(self, rays: Rays, ends: Items) -> Items:
        """Register curves where nothing is known; return their numbers, −1 for those left over.

        Left over are those that start or end with rays that have curves, or that others start or
        end with, too. Curves that leave through a constraint have −1 as their ends.
        """
        numbers = enter_rays(
            rays.points, rays.edges, rays.sides, ends, self.points.vertex, self.mesh.edges,
            self.slots, self.rays, self.curves.count,
        )  # fmt: skip
        new = np.flatnonzero(numbers >= 0)
        self.curves.extend(rays.edges[new], rays.points[new], ends[new])
        return np.asarray(numbers)

    def enter_many(self, rays: Rays, ends: Items) -> None:
        """Register curves without inner points: at once where nothing is known, else singly."""
        left = np.flatnonzero(self.enter_at_once(rays, ends) < 0)
        if len(left) == 0:
            return
        rest = rays.take(left)
        for point, edge, end in zip(
            rest.points.tolist(), rest.edges.tolist(), ends[left].tolist(), strict=True
        ):
            self.enter(point, edge, end)

    def other_end(self, curve: int, point: int) -> int:
        """Point at the other end of a curve."""
        start, end = int(self.curves.start[curve]), int(self.curves.end[curve])
        return end if start == point else start

    def fit(self) -> None:
        """Make room for rays of new points and edges."""
        shape = (len(self.points.z), self.incident.shape[1])
        if shape != self.rays.shape:
            rays = np.full(shape, RayMark.UNTRACED)
            rays[: self.rays.shape[0], : self.rays.shape[1]] = self.rays
            self.rays = rays

    def use_mesh(self, mesh: BaseMesh) -> None:
        """Take over a mesh with more vertices and edges; curves on removed edges are forgotten."""
        gone = self.mesh.edges_in_use & ~mesh.edges_in_use[: len(self.mesh.edges)]
        for curve in np.flatnonzero(gone[self.curves.edge]).tolist():
            self.forget(curve, RayMark.ABANDONED)
        for edge in np.flatnonzero(gone):  # untraced rays of removed edges need no tracing any more
            for side in range(2):
                for point in self.points.over(int(self.mesh.edges[edge, side])):
                    self.rays[point, self.slots[edge, side]] = RayMark.ABANDONED
        self.points.grow_vertices(len(mesh.vertices))
        self.incident, self.slots = _incidence(mesh)
        more = len(mesh.edges) - len(self.effort)
        self.effort = np.concatenate([self.effort, np.zeros(more, int)])
        self.mesh = mesh
        self.fit()

    def forget(self, curve: int, mark: RayMark = RayMark.UNTRACED) -> None:
        """Take a curve back from its ends."""
        edge = int(self.curves.edge[curve])
        for point in (int(self.curves.start[curve]), int(self.curves.end[curve])):
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


def start_pairing(setting: Setting, mesh: BaseMesh, limit: int) -> Pairing:
    """Empty pairing on a mesh, for at most `limit` points."""
    incident, slots = _incidence(mesh)
    pairing = Pairing(
        setting,
        mesh,
        Points.empty(setting.structure, len(mesh.vertices)),
        Curves(),
        np.full((0, incident.shape[1]), RayMark.UNTRACED),
        slots,
        incident,
        np.zeros(len(mesh.edges), int),
        limit,
        Slopes.empty(setting),
    )
    pairing.fit()
    return pairing


def abandoned_rays(pairing: Pairing) -> list[tuple[int, int]]:
    """Rays that could not be traced: (point, edge) on edges that are in use."""
    pairing.fit()
    used = np.append(pairing.mesh.edges_in_use, False)
    count = pairing.points.count
    vertex = pairing.points.vertex[:count]
    points, slots = np.nonzero((pairing.rays[:count] < 0) & (vertex >= 0)[:, None])
    edges = pairing.incident[vertex[points], slots]
    return [(int(a), int(b)) for a, b in zip(points, edges, strict=True) if used[b]]
