"""Where on a set descriptors take given values: predictions, corrections, fits, families."""

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from scipy.spatial import cKDTree

from equimorph.arrays import Bool, Edges, Flags, Float, Int, Items
from equimorph.charts import DescriptorChart
from equimorph.charts.location import Found
from equimorph.equilibria.point_conditions import Values
from equimorph.equilibria.settle import Guards, Settled, embedded_planes, free_directions, settle
from equimorph.errors import InputError
from equimorph.manifold import EquilibriumSet, Level, level_set
from equimorph.manifold.complex.kept_tables import from_cache, places_of
from equimorph.manifold.geometry.setting import Setting, embed
from equimorph.manifold.geometry.simplices import longest_sides, middles, volumes
from equimorph.manifold.geometry.topology import faces_of, pieces
from equimorph.manifold.lookup.cell_index import CellIndex, Hits
from equimorph.manifold.queries.nearest import SetPoints, local_minima, points_at_vertices
from equimorph.model import Constraint, Descriptor, function_of
from equimorph.model.families import values_together
from equimorph.structures import States, join_states
from equimorph.structures.metric import metric_coordinates
from equimorph.tasks.optimising.programme import Objective, Programme
from equimorph.tasks.optimising.sqp import descend
from equimorph.tasks.optimising.tangent_steps import unconstrained_setting
from equimorph.tolerances import FEASIBLE

Shares = Float[np.ndarray, "some corners"]

BESIDE = 12
"""Nearest cells on one of which a state lies; of 5900 random ones each was nearer to the middle of
one than half its longest side."""
CLOSE = 0.5
"""Distance of two predictions, in sizes of their cell, below which one of them will do."""
OVERHANG = 0.5
"""How far beyond a cell, in barycentric coordinates, its linear prediction is still tried."""

GUARDS = Guards(iterations=30, longest=0.3, converged=1e-7)
"""The last correction is 1e-7, so that Newton's method leaves an error at round-off."""


def predictor(eset: EquilibriumSet, descriptors: tuple[Descriptor, ...]) -> "Predictor":
    """Predictor of a set for some descriptors, kept with the set."""
    found = from_cache(eset, ("predictor", descriptors), lambda: Predictor(eset, descriptors))
    assert isinstance(found, Predictor)
    return found


@dataclass(frozen=True)
class Predictor:
    """A set with the values of some descriptors at its vertices."""

    eset: EquilibriumSet
    descriptors: tuple[Descriptor, ...]

    @cached_property
    def setting(self) -> Setting:
        """Structure and free parameters of the set."""
        return unconstrained_setting(self.eset)

    @cached_property
    def values(self) -> Float[np.ndarray, "V k"]:
        """Values at the vertices."""
        points = self.eset.points
        functions = [each.function for each in self.descriptors]
        return values_together(functions, points.z, points.p)

    @cached_property
    def spread(self) -> Float[np.ndarray, " k"]:
        """Ranges of the descriptors over the set: units of misfits."""
        return np.asarray(np.maximum(np.ptp(self.values, axis=0), 1e-300))

    @cached_property
    def edges(self) -> Int[np.ndarray, "edges 2"]:
        """Edges of all cells."""
        return faces_of(self.eset.cells, 2)

    @cached_property
    def _index(self) -> CellIndex:
        """The cells in the space of values, in ranges over the set."""
        corners = (self.values / self.spread)[self.eset.cells]
        return CellIndex.of(corners, np.full(len(corners), OVERHANG))

    @cached_property
    def _middles(self) -> cKDTree:
        """The middles of the cells in the metric; those of the chart, if there is one."""
        if self.chart is not None:
            return self.chart.cells.tree
        return cKDTree(middles(places_of(self.eset), self.eset.cells))

    def holds(self, states: States) -> Flags:
        """Whether states lie on the cells: next to one with their index.

        Newton's method may lead from a part of a set to another one.
        """
        count = np.arange(1, 1 + min(BESIDE, len(self.eset.cells)))
        gap, cell = self._middles.query(embed(self.setting, states.z, states.p), k=count)
        near = gap <= self._sizes[cell]
        return np.asarray(
            (near & (self.eset.cell_index[cell] == states.index[:, None])).any(axis=1)
        )

    @cached_property
    def _tree(self) -> cKDTree:
        """The vertices in the space of values."""
        return cKDTree(self.values / self.spread)

    def closest(self, targets: Float[np.ndarray, "many k"]) -> Int[np.ndarray, " many"]:
        """Vertices with the least misfits."""
        return np.asarray(self._tree.query(targets / self.spread)[1], int)

    def cells(
        self, targets: Float[np.ndarray, "many k"], known: Found | None = None
    ) -> tuple[Shares, Items, Items]:
        """Barycentric coordinates at which cells take values, in or near them; cells, targets.

        Those of each target one after the other, the most central first; none close to states that
        are known already.
        """
        hits = self._index.near(targets / self.spread)
        hits = hits.take(np.lexsort((-hits.weights.min(axis=1), hits.point)))
        chosen = self._different(hits, known)
        return hits.weights[chosen], hits.cell[chosen], hits.point[chosen]

    @cached_property
    def _sizes(self) -> Float[np.ndarray, " C"]:
        """Longest side of each cell from its first corner."""
        return longest_sides(places_of(self.eset), self.eset.cells)

    @cached_property
    def _sides(self) -> Int[np.ndarray, " C"]:
        """On which side of folds each cell lies.

        Cells of one index on which the descriptors move with the parameters in the same sense.
        """
        eset = self.eset
        moves = [np.sign(volumes(each[eset.cells])) for each in (self.values, eset.coordinates)]
        return np.asarray(2 * eset.cell_index + (moves[0] * moves[1] > 0), int)

    def _different(self, hits: Hits, known: Found | None) -> Items:
        """Predictions that are not close to an earlier one from the same side of folds.

        Nor to a known state from this side.
        """
        corners, structure = self.eset.cells[hits.cell], self.setting.structure
        free = self.setting.free
        z = np.einsum("ck,cki->ci", hits.weights, self.eset.points.z[corners])
        p = np.einsum("ck,cki->ci", hits.weights, self.eset.points.p[corners][:, :, free])
        u = metric_coordinates(structure, z)
        place = np.concatenate([u, p / self.setting.scales], axis=1)
        reach, side = CLOSE * self._sizes[hits.cell], self._sides[hits.cell]
        rows = np.arange(hits.point.max(initial=-1) + 2)
        before, there, beside = np.zeros(len(rows), int), place[:0], side[:0]
        if known is not None:
            before = np.searchsorted(known.point, rows)
            there = embed(self.setting, known.states.z, known.states.p)
            beside = self._sides[known.cell]
        kept: list[int] = []
        bounds = pairwise(np.searchsorted(hits.point, rows).tolist())
        for (first, last), held in zip(bounds, pairwise(before.tolist()), strict=True):
            own, these = slice(first, last), slice(*held)
            every = np.concatenate([there[these], place[own]])
            gap = np.linalg.norm(place[own, None] - every, axis=2)
            close = gap < reach[own, None]
            close &= side[own, None] == np.concatenate([beside[these], side[own]])
            chosen = list(range(count := held[1] - held[0]))
            for k in range(last - first):
                if not close[k, chosen].any():
                    chosen.append(count + k)
            kept += [first + k - count for k in chosen[count:]]
        return np.array(kept, int)

    def guesses(self, share: Shares, cells: Items) -> SetPoints:
        """Points of cells, with their planes, inside the box."""
        eset = self.eset
        corners = eset.cells[cells]
        z = np.einsum("ck,cki->ci", share, eset.points.z[corners])
        p = np.einsum("ck,cki->ci", share, eset.points.p[corners])
        free = self.setting.free
        p[:, free] = np.clip(p[:, free], eset.box.lower, eset.box.upper)
        return SetPoints(z, p, self.planes(cells))

    def planes(self, cells: Int[np.ndarray, " some"]) -> Float[np.ndarray, "some d coordinates"]:
        """Orthonormal bases of the planes of cells."""
        corners = self.eset.cells[cells]
        at = places_of(self.eset)[corners]
        sides = at[:, 1:] - at[:, :1]
        sides /= np.maximum(np.linalg.norm(sides, axis=2, keepdims=True), 1e-300)
        return np.ascontiguousarray(np.swapaxes(np.linalg.qr(np.swapaxes(sides, 1, 2))[0], 1, 2))

    @cached_property
    def chart(self) -> DescriptorChart | None:
        """Chart by as many descriptors as free parameters; None if they depend on each other."""
        try:
            return DescriptorChart(self.eset, self.descriptors)
        except InputError:
            return None

    def misfits(self, targets: Float[np.ndarray, " k"]) -> Float[np.ndarray, " V"]:
        """Root of the sum of squares of what vertices miss, in ranges over the set."""
        return np.asarray(np.sqrt((((self.values - targets) / self.spread) ** 2).sum(axis=1)))


def states_with_values(
    setting: Setting,
    at: SetPoints,
    descriptors: tuple[Descriptor, ...],
    targets: Float[np.ndarray, "lanes k"],
) -> Settled:
    """Solve F(z; p) = 0 and S(z, p) = S* from guesses near a set.

    The guesses come with bases of spaces near the tangent spaces. Folds are regular points. With
    fewer descriptors than free parameters the steps along the set are the shortest ones.
    """
    structure, free = setting.structure, setting.free
    directions = free_directions(structure, free, len(at))
    values = Values(tuple(each.function for each in descriptors), targets)
    frame = embedded_planes(structure, free, at.rows)
    return settle(structure, at.z, at.p, directions, [values], GUARDS, frame)


STARTS = 12
"""Local minima over the vertices from which fits and members of families are searched."""

NEAR = 1.0
"""Farthest way from the prediction, in lengths of the edge, of a state that belongs to it."""


def states_predicted(
    known: Predictor, targets: Float[np.ndarray, "many k"], charted: Found | None
) -> tuple[States, Int[np.ndarray, " states"]]:
    """States to which Newton's method leads from predictions, and the questions of each.

    From none close to what the chart found.
    """
    if targets.shape[1] < len(known.eset.names):
        starts = [local_minima(known.edges, known.misfits(each))[:STARTS] for each in targets]
        owner = np.repeat(np.arange(len(targets)), [len(each) for each in starts])
        used, place = np.unique(np.concatenate(starts), return_inverse=True)
        at = points_at_vertices(known.eset, used).take(place)
    else:
        shares, cells, owner = known.cells(targets, charted)
        if len(owner) == 0:
            return known.eset.points[owner], owner
        at = known.guesses(shares, cells)
    exact = states_with_values(known.setting, at, known.descriptors, targets[owner])
    some = exact.found.nonzero()[0]
    return States(known.eset.structure, exact.z[some], exact.p[some]), owner[some]


def best_fits(
    known: Predictor,
    targets: Float[np.ndarray, " k"],
    within: tuple[Constraint, ...],
    allowed: Bool[np.ndarray, " V"] | None = None,
) -> tuple[States, Float[np.ndarray, " fits"]]:
    """Local minima of ``Σ ((S − S*)/range)²``, the best first, and the roots of these sums.

    Minima at the sides of the box and on constraints, those of the set among them, count, too. The
    search starts from the vertices that are allowed, by default from all.
    """
    eset, spread = known.eset, known.spread
    squares = function_of(
        "misfit",
        lambda *each: sum(
            ((value - target) / unit) ** 2
            for value, target, unit in zip(each, targets, spread, strict=True)
        ),
        *known.descriptors,
    )
    edges, value = known.edges, known.misfits(targets)
    if allowed is not None:
        edges = edges[allowed[edges].all(axis=1)]
    starts = local_minima(edges, value)[:STARTS]
    programme = Programme.over(eset, Objective(squares, 1.0), within)
    ends = [
        end
        for end in descend(programme, points_at_vertices(eset, starts))
        if end.expansion.g.max(initial=-1.0) <= FEASIBLE
    ]
    ends.sort(key=lambda end: float(end.expansion.f.max()))
    misfit = np.sqrt(np.maximum([float(end.expansion.f.max()) for end in ends], 0.0))
    return join_states(eset.structure, [end.point for end in ends]), misfit


def solution_family(known: Predictor, targets: Float[np.ndarray, " k"]) -> Level:
    """Level set of one descriptor, or of two over three parameters: curves.

    Of two, curves run on the surface on which the first has its value, through the edges at whose
    ends the second lies on both sides of its own. `lost` counts edges without such a state, and
    triangles that curves do not just pass.
    """
    level = level_set(known.eset, known.descriptors[0], float(targets[0]))
    if len(targets) == 1 or not level.pieces:
        return level
    triangles = np.sort(np.concatenate(level.pieces), axis=1)
    sides = np.concatenate([triangles[:, [0, 1]], triangles[:, [0, 2]], triangles[:, [1, 2]]])
    edges, number = np.unique(sides, axis=0, return_inverse=True)
    rest = known.descriptors[1](level.states) - targets[1]
    crossed = np.flatnonzero(rest[edges[:, 0]] * rest[edges[:, 1]] < 0.0)
    if len(crossed) == 0:
        return Level(level.states[:0], (), level.lost)
    states, found = _exact(known, level.states, edges[crossed], rest, targets)
    place = np.full(len(edges), -1)
    place[crossed[found]] = np.flatnonzero(found)
    ends = place[number.reshape(3, -1).T]
    hits = (ends >= 0).sum(axis=1)
    links = np.array([row[row >= 0] for row in ends[hits == 2]], int).reshape(-1, 2)
    lost = level.lost + int((~found).sum()) + int(np.isin(hits, (1, 3)).sum())
    return Level(states, tuple(pieces(links)) if len(links) else (), lost)


def _exact(
    known: Predictor,
    surface: States,
    edges: Edges,
    rest: Float[np.ndarray, " states"],
    targets: Float[np.ndarray, " k"],
) -> tuple[States, Bool[np.ndarray, " edges"]]:
    """Exact states near linear predictions on edges, and which of them were found."""
    structure, setting = known.eset.structure, known.setting
    first, last = edges.T
    share = (rest[first] / (rest[first] - rest[last]))[:, None]
    z = (1.0 - share) * surface.z[first] + share * surface.z[last]
    p = (1.0 - share) * surface.p[first] + share * surface.p[last]
    points = known.eset.points
    vertex = cKDTree(embed(setting, points.z, points.p)).query(embed(setting, z, p))[1]
    used, own = np.unique(vertex, return_inverse=True)
    rows = points_at_vertices(known.eset, used).rows[own]
    many = np.tile(targets, (len(edges), 1))
    exact = states_with_values(setting, SetPoints(z, p, rows), known.descriptors, many)
    z_end, p_end, found = exact.z, exact.p, exact.found
    gaps = (
        np.linalg.norm(embed(setting, *one) - embed(setting, *other), axis=1)
        for one, other in (
            ((z_end, p_end), (z, p)),
            ((surface.z[first], surface.p[first]), (surface.z[last], surface.p[last])),
        )
    )
    found &= next(gaps) <= NEAR * next(gaps) + 1e-6
    return States(structure, z_end, p_end), found
