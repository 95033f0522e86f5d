"""Kernels of sheet lifting equal their plain twins, and what they match is met by tracing."""

import numpy as np
import pytest

import equimorph as em
from equimorph.equilibria import TraceOptions, trace
from equimorph.equilibria.trace_options import EventCode
from equimorph.manifold.complex.edge_kernels import bend_edges, check_edges, lean_edges
from equimorph.manifold.geometry.setting import Setting
from equimorph.manifold.lifting import discs as disc_module
from equimorph.manifold.lifting.crossing_branches import flood_crossings
from equimorph.manifold.lifting.discs import assemble
from equimorph.manifold.lifting.grid import grid_lines, grid_mesh
from equimorph.manifold.lifting.kernels import (
    flag_first_of_alike,
    match_rays,
    slope_squares,
    square_gaps,
)
from equimorph.manifold.lifting.loops import find_loops
from equimorph.manifold.lifting.pairing import (
    NONE,
    Pairing,
    RayMark,
    Rays,
    Slopes,
    start_pairing,
)
from equimorph.manifold.lifting.patterns import Whole
from equimorph.manifold.lifting.ray_kernels import enter_rays, rays_marked
from equimorph.manifold.lifting.seeds import seeds
from equimorph.model import Silent, parameter_vector

SLICES = {
    "generic": (("Theta", "Delta"), (0.2, 2.5, -2.0, 2.0), {"q": 2.5}),
    "symmetric": (("Theta", "q"), (0.3, 2.0, 0.0, 5.0), {"Delta": 0.0}),
}


@pytest.fixture(scope="module", params=SLICES)
def lifted(request: pytest.FixtureRequest) -> Pairing:
    """All edges of a grid over a generic or a symmetric slice of the arch, lifted."""
    names, limits, fixed = SLICES[request.param]
    arch = em.Rod(load="uniform")
    box = em.Box(**{name: limits[2 * k : 2 * k + 2] for k, name in enumerate(names)})
    values = {**fixed, **dict(zip(names, box.lower.tolist(), strict=True))}
    free = np.array([[each.name for each in arch.parameters].index(name) for name in names])
    base = parameter_vector(arch.parameters, values)
    setting = Setting(arch, base, free, (arch.max_curvature <= 20,))
    mesh = grid_mesh(grid_lines(box, (13, 17)))
    pairing = start_pairing(setting, mesh, 60_000)
    pairing.points.over_vertices(*seeds(setting, mesh, np.arange(len(mesh.vertices)), 0))
    flood_crossings(pairing, Silent())
    return pairing


def test_pseudo_arclength_meets_the_ends_that_rays_were_matched_with(lifted):
    """Small steps along every edge that was not traced; tolerance: round-off of both points."""
    curves, points = lifted.curves, lifted.points
    own = [k for k in range(curves.count) if curves.plain[k] and lifted.alive(k)]
    own = [k for k in own if curves.end[k] >= 0][::5]
    start, end, edges = (each[own] for each in (curves.start, curves.end, curves.edge))
    sides = (lifted.mesh.edges[edges, 1] == points.vertex[start]).astype(int)
    line = lifted.line(Rays(start, edges, sides))
    options = TraceOptions(through_folds=True, first_step=0.01, largest_step=0.05, turning=0.05)
    outcome = trace(line, points.z[start], lifted.setting.constraints, options)
    assert (outcome.code == EventCode.ARRIVED).all()
    np.testing.assert_allclose(outcome.z, points.z[end], atol=1e-8)


def test_points_are_polished_to_round_off(lifted):
    """Newton's last step comes with the tangents."""
    own = np.flatnonzero(lifted.points.vertex[: lifted.points.count] >= 0)
    residual = lifted.setting.structure.residual(lifted.points.z[own], lifted.points.p[own])
    assert np.abs(residual).max() < 1e-11


def test_slopes_of_some_points_are_those_that_a_flood_has_found(lifted):
    """Some points first, then all.

    1e-8 of the size squared: a flood finds them one correction earlier, and where F_z is nearly
    singular a tangent changes as its square.
    """
    points, known, again = lifted.points, lifted.slopes, Slopes.empty(lifted.setting)
    own = np.flatnonzero(points.vertex[: points.count] >= 0)
    again.fit(lifted.setting, points, own[::7])
    assert (again.index[own[::7]] >= 0).all()
    assert (np.delete(again.index[own], np.s_[::7]) == NONE).all()
    again.fit(lifted.setting, points)
    known.fit(lifted.setting, points)
    np.testing.assert_array_equal(again.index[own], known.index[own])
    size = np.abs(known.tangents[own]).max(axis=(1, 2))
    error = np.abs(again.tangents[own] - known.tangents[own]).max(axis=(1, 2))
    assert (error < 1e-8 * (1.0 + size) ** 2).all()


def test_loops_equal_those_of_a_plain_walk(lifted):
    """Walks in Python over lists and sets, triangle by triangle."""
    loops, points = find_loops(lifted), lifted.points
    found = {tuple(sorted(own)) for own in loops.plain.tolist()}
    every = [*loops.polygons.each(np.arange(len(loops.polygons.triangle))), *loops.special]
    found |= {tuple(sorted(own.points)) for own in every}
    expected, undecided = set(), {*loops.ambiguous, *loops.broken}
    for triangle in range(len(lifted.mesh.triangles)):
        walks = list(_walks(lifted, triangle))
        if None in walks:
            assert triangle in loops.broken
        elif triangle not in undecided:
            expected |= {tuple(sorted(own)) for own in walks}
    arcs = {point for own in lifted.arcs.values() for arc in own for point in arc}
    met = {own for own in found if not arcs & set(own)}
    assert met == {own for own in expected if not arcs & set(own)}
    assert len(expected) > 100
    assert (points.count > 0) == bool(found)


def _walks(pairing: Pairing, triangle: int):
    """Points of the closed loops and open chains around a triangle; None where one is broken."""
    points, curves, mesh = pairing.points, pairing.curves, pairing.mesh
    corners, sides = mesh.triangles[triangle].tolist(), mesh.sides[triangle].tolist()
    at = {corners[k]: (sides[k], sides[(k + 2) % 3]) for k in range(3)}
    todo = {point for corner in corners for point in points.over(corner)}

    def leaves(point: int, edge: int) -> bool:
        return pairing.ray(point, edge) >= 0 and curves.end[pairing.ray(point, edge)] < 0

    exits = [(a, e) for a in sorted(todo) for e in at[int(points.vertex[a])] if leaves(a, e)]
    for point, edge in [*exits, *((a, None) for a in sorted(todo))]:
        if point not in todo:
            continue
        pair = at[int(points.vertex[point])]
        came = pair[1] if edge is None else edge
        path = [] if edge is None else [*reversed(curves.inner[pairing.ray(point, edge)])]
        first, here, whole = point, point, True
        while whole:
            path.append(here)
            todo.discard(here)
            pair = at[int(points.vertex[here])]
            came = pair[1] if pair[0] == came else pair[0]
            curve = pairing.ray(here, came)
            whole = curve >= 0 and len(path) < 200
            if not whole:
                break
            inner = curves.inner.get(curve, [])
            forward = curves.start[curve] == here
            path.extend(inner if forward else reversed(inner))
            here = int(curves.end[curve] if forward else curves.start[curve])
            if here < 0 or here == first:
                whole = (here < 0) == (edge is not None)
                break
        yield path if whole else None


def test_cutting_by_pattern_equals_cutting_one_by_one(lifted, monkeypatch):
    """The plans of `discs`, polygon by polygon."""
    loops = find_loops(lifted)
    fast = assemble(lifted, loops)

    def nothing(pairing, polygons):
        none = np.zeros(0, int)
        whole = Whole(np.zeros((0, 3), int), none, none, *np.zeros((2, 0, 2), int), none)
        return whole, np.arange(len(polygons.triangle))

    monkeypatch.setattr(disc_module, "cut_by_pattern", nothing)
    slow = assemble(lifted, loops)
    for one, other in ((fast.folds, slow.folds), (fast.caps, slow.caps)):
        np.testing.assert_array_equal(_plain_part(lifted, one), _plain_part(lifted, other))
    np.testing.assert_array_equal(fast.doubtful, slow.doubtful)
    np.testing.assert_array_equal(_triangles(lifted, fast), _triangles(lifted, slow))


def _triangles(pairing: Pairing, discs: disc_module.Discs) -> np.ndarray:
    """Triangles with index and owner, without those at points that were computed on the way."""
    rows = np.concatenate([np.sort(discs.corners, axis=1), discs.index[:, None]], axis=1)
    return _plain_part(pairing, np.concatenate([rows, discs.owner[:, None]], axis=1), 3)


def _plain_part(pairing: Pairing, rows: np.ndarray, corners: int = 2) -> np.ndarray:
    """Rows in order, without those of extra points, which have other numbers each time."""
    store = pairing.points
    extra = (store.vertex < 0) & (store.edge < 0)
    return np.unique(rows[~extra[rows[:, :corners]].any(axis=1)], axis=0)


def test_rays_are_matched_as_their_definition_says():
    """A loop over rays and points in numpy; random data near a plane, so that all cases occur."""
    generator = np.random.default_rng(0)
    n, size, d, count, vertices = 3, 4, 2, 300, 20
    weights, scales = generator.uniform(0.5, 1.0, size), generator.uniform(0.5, 2.0, d)
    place, vertex = generator.uniform(0, 0.3, (vertices, d)), generator.integers(0, vertices, count)
    tangents = np.tile(generator.normal(size=(d, size)), (count, 1, 1))
    tangents += 0.15 * generator.normal(size=tangents.shape)
    z = place[vertex] @ tangents[0] + 0.02 * generator.normal(size=(count, size))
    index, counted = generator.integers(0, 2, count), generator.integers(0, 2, count)
    counted = np.where(generator.uniform(size=count) < 0.9, index, counted)
    head, following = np.full(vertices, -1), np.full(count, -1)
    for point in range(count):
        following[point], head[vertex[point]] = head[vertex[point]], point
    rays, targets = np.arange(count), generator.integers(0, vertices, count)
    spans = place[targets] - place[vertex]
    guesses, lengths, partners = np.empty((count, size)), np.empty(count), np.empty(count, int)
    longest, reach, cosine = 0.4, 0.3, 0.95
    match_rays(
        n, weights, scales, head, following, z, index, tangents, counted, longest, reach, cosine,
        rays, targets, spans, guesses, lengths, partners,
    )  # fmt: skip
    expected = [
        _partner(k, targets[k], spans[k], (z, vertex, index, counted, tangents), weights, scales)
        for k in range(count)
    ]
    np.testing.assert_array_equal(partners, expected)
    assert {-2, -1} < set(expected)
    np.testing.assert_allclose(guesses, z + np.einsum("nkj,nk->nj", tangents, spans), atol=1e-15)
    first = np.zeros(count, bool)
    order = np.argsort(targets, kind="stable")
    flag_first_of_alike(weights[:n], order, targets, index, guesses, lengths, reach, first)
    kept: list[int] = []
    for k in order.tolist():
        alike = [
            other
            for other in kept
            if targets[other] == targets[k]
            and index[other] == index[k]
            and (guesses[other] - guesses[k])[:n] ** 2 @ weights[:n] < (reach * lengths[k]) ** 2
        ]
        kept += [] if alike else [k]
    assert np.flatnonzero(first).tolist() == sorted(kept)


def _partner(ray, target, span, known, weights, scales):
    """Partner of one ray with n = 3, longest 0.4, reach 0.3 and cosine 0.95."""
    z, vertex, index, counted, tangents = known
    metric, weight = weights[:3], ((span / scales) ** 2).sum()
    step = span @ tangents[ray]
    length = np.sqrt(weight + step[:3] ** 2 @ metric)
    if length >= 0.4 or counted[ray] != index[ray]:
        return -2
    there = np.flatnonzero(vertex == target)
    gaps = (z[there] - z[ray] - step) ** 2 @ weights
    if len(there) == 0 or gaps.min() >= (0.3 * length) ** 2:
        return -1
    best = there[gaps.argmin()]
    back = span @ tangents[best]
    other = np.sqrt(weight + back[:3] ** 2 @ metric)
    as_well = (z[best] - back - z[ray]) ** 2 @ weights < (0.3 * other) ** 2
    along = weight + (step * back)[:3] @ metric >= 0.95 * length * other
    same = index[best] == index[ray] == counted[best]
    return best if as_well and along and same else -1


def test_distances_between_points_have_the_slopes_of_their_tangents():
    """Closed form for straight sheets; twin: products of whole arrays."""
    generator = np.random.default_rng(1)
    mass, z = generator.uniform(0.5, 1.0, 3), generator.normal(size=(10, 4))
    tangents = generator.normal(size=(10, 2, 4))
    one, other = generator.integers(0, 10, (2, 12))
    squared, slopes = np.empty(12), np.empty((12, 2))
    square_gaps(mass, z, one, other, squared)
    slope_squares(mass, z, tangents, one, other, slopes)
    gap, turn = (z[one] - z[other])[:, :3], (tangents[one] - tangents[other])[:, :, :3]
    np.testing.assert_allclose(squared, gap**2 @ mass, rtol=1e-14)
    np.testing.assert_allclose(slopes, 2.0 * np.einsum("ni,nki->nk", gap * mass, turn), atol=1e-13)


def test_vertices_on_edges_are_looked_for_near_the_surface():
    """On a paraboloid in the plane of two scaled parameters; halved edges err a tenth, or less."""
    generator, scales = np.random.default_rng(2), np.array([0.5, 3.0])
    metric = np.array([0, 2]), scales, np.array([2.0])  # one unknown of mass 4
    slope, curvature = np.array([0.3, -0.2]), np.array([[0.8, 0.5], [0.5, -0.6]])
    at, way, errors = generator.normal(size=(40, 2)), generator.normal(size=(40, 2)), []
    for length in (0.1, 0.05):
        there = np.concatenate([at, at + length * way])
        z = (there @ slope + 0.5 * np.einsum("ni,ij,nj->n", there, curvature, there))[:, None]
        p = np.insert(there * scales, 1, 7.0, axis=1)
        tangents = 2.0 * (slope + there @ curvature)  # of the height in the metric
        basis = np.concatenate([tangents[:, :, None], np.tile(np.eye(2), (80, 1, 1))], axis=2)
        rows = np.swapaxes(np.linalg.qr(np.swapaxes(basis, 1, 2))[0], 1, 2).copy()
        frame = rows.copy()
        frame[:, :, 0] /= 2.0
        ends = np.stack([np.arange(40), 40 + np.arange(40)], axis=1)
        flat, t = np.empty((40, 2, 2)), np.full(40, 0.5)
        place = np.column_stack([2.0 * z, there])
        lean_edges(place, rows, ends, flat)
        out = np.empty((40, 1)), np.empty((40, 3)), np.empty((40, 3)), np.empty((40, 2, 3))
        out = *out, np.empty(40)
        vertices = z, p, place, frame, rows
        bend_edges(vertices, metric, ends, t, np.zeros(2, bool), flat, out)
        own = out[1][:, [0, 2]] / scales
        height = own @ slope + 0.5 * np.einsum("ni,ij,nj->n", own, curvature, own)
        errors.append(np.abs(out[0][:, 0] - height).max())
        assert np.all(out[1][:, 1] == 7.0)
        assert np.allclose(out[2], np.column_stack([2.0 * out[0], own]), atol=1e-14)
        found, told = np.ones(40, bool), (out[0], out[1], frame[:40])
        check_edges(place, metric, ends, t, (out[2], out[4]), (0.3, 0.35, 0.5), told, found)
        assert found.all()
        across = np.cross(rows[:40, 0], rows[:40, 1])[:, None] / np.array([2.0, 1.0, 1.0])
        steep = np.concatenate([across, across], axis=1)  # a plane across the edge
        check_edges(
            place, metric, ends, t, (out[2], out[4]), (0.3, 0.35, 0.5), (*told[:2], steep), found
        )
        assert not found.any()
    assert errors[1] < 0.1 * errors[0] < 1e-4


def marked(pairing: Pairing) -> np.ndarray:
    """Rays of a pairing, a third of them with marks instead of curves."""
    generator, rays = np.random.default_rng(3), pairing.rays.copy()
    some = generator.random(rays.shape) < 1 / 3
    rays[some] = generator.choice(np.array(list(RayMark)), int(some.sum()))
    return rays


def test_rays_with_a_mark_are_those_of_a_plain_search(lifted):
    """In order, each edge from its first end if any ray there has the mark."""
    rays, (points, mesh) = marked(lifted), (lifted.points, lifted.mesh)
    plain = []
    for point in np.flatnonzero(points.vertex[: points.count] >= 0).tolist():
        for slot, edge in enumerate(lifted.incident[points.vertex[point]].tolist()):
            if edge >= 0 and rays[point, slot] == RayMark.HARD:
                plain.append((point, edge, int(mesh.edges[edge, 1] == points.vertex[point])))
    first = {edge for _, edge, side in plain if side == 0}
    plain = [each for each in plain if each[2] == 0 or each[1] not in first]
    given = int(RayMark.HARD), points.count, points.vertex, rays, lifted.incident, mesh.edges
    assert list(zip(*(each.tolist() for each in rays_marked(*given)), strict=True)) == plain
    assert len(plain) > 100


def test_curves_are_entered_where_nothing_is_known_and_nothing_else_claims(lifted):
    """As counting says how often each ray is claimed; other rays keep what they had."""
    curves, mesh, vertex = lifted.curves, lifted.mesh, lifted.points.vertex
    generator, before = np.random.default_rng(4), marked(lifted)
    own = generator.choice(np.flatnonzero(curves.plain), 400)  # some of them twice
    start, end, edges = (each[own] for each in (curves.start, curves.end, curves.edge))
    sides = (mesh.edges[edges, 1] == vertex[start]).astype(int)

    def claims(k: int) -> list[tuple[int, int]]:
        ends = [int(each[k]) for each in (start, end) if each[k] >= 0]
        return [
            (at, int(lifted.slots[edges[k], int(mesh.edges[edges[k], 1] == vertex[at])]))
            for at in ends
        ]

    every = [claim for k in range(len(own)) for claim in claims(k)]
    rays, number, plain, expected = before.copy(), 10_000, [], before.copy()
    for k in range(len(own)):
        free = all(before[claim] < 0 and every.count(claim) == 1 for claim in claims(k))
        plain.append(number + sum(each >= 0 for each in plain) if free else -1)
        for claim in claims(k) if free else ():
            expected[claim] = plain[-1]
    given = start, edges, sides, end, vertex, mesh.edges, lifted.slots, rays, number
    assert enter_rays(*given).tolist() == plain
    np.testing.assert_array_equal(rays, expected)
    assert 20 < sum(each >= 0 for each in plain) < len(own)
