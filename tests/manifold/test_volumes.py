"""Sets over three parameters: balls and spheres known by name, the spring, and a coarse arch."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest

from equimorph.manifold import (
    EquilibriumSet,
    VertexKind,
    equilibrium_set,
    level_set,
    refine,
    stability_distance,
)
from equimorph.manifold.complex.excerpts import fabric_of
from equimorph.manifold.geometry.exact_points import Aim, Pinned, correct_points, middles, pin
from equimorph.manifold.geometry.setting import embed
from equimorph.manifold.geometry.simplices import shares_in, squared_sides, volumes
from equimorph.manifold.geometry.topology import (
    adjacency,
    euler_characteristic,
    keys_of,
    labels,
    orientation,
)
from equimorph.manifold.lifting import cells, inner_points
from equimorph.manifold.lifting.cells import volumes_over
from equimorph.manifold.refining.quality import qualities, smallest_angles
from equimorph.model import Box, Descriptor
from equimorph.structures import Rod, Spring
from oracles.complexes import assert_faithful, assert_folds_are_singular
from oracles.polynomial import Polynomial
from oracles.surfaces import butterfly, integral, swallowtail
from typecheck import unchecked

BOX = Box(a=(-1.3, 1.2), b=(-1.5, 1.4), c=(-1.4, 1.3))


def ball() -> Polynomial:
    """x² + a² + b² + c² = 1: a three-sphere, folded along the sphere x = 0."""
    return Polynomial(lambda x, a, b, c: integral(x**2 + a**2 + b**2 + c**2 - 1.0), 1, "abc")


def ridge() -> Polynomial:
    """x³ + (a + c²/2) x + b: the graph b(x, a, c), folded along a surface with a curve of cusps."""
    return Polynomial(
        lambda x, a, b, c: integral(x**3 + a * x + 0.5 * c**2 * x + b), 1, ("a", "b", "c")
    )


def lifted(structure, box, intervals, **options) -> EquilibriumSet:
    with unchecked():
        return equilibrium_set(structure, box, intervals=intervals, checks=0, **options)


def topology(eset: EquilibriumSet) -> tuple[int, int, int]:
    return eset.audit.components, eset.audit.euler_characteristic, len(eset.boundaries)


def projected_volume(eset: EquilibriumSet, index: int) -> float:
    """Volume over the box of the cells of an index."""
    corners = eset.coordinates[eset.cells[eset.cell_index == index]]
    return float(np.abs(volumes(corners)).sum())


def folded_over(eset: EquilibriumSet, volume: np.ndarray) -> np.ndarray:
    """Cells whose signed volume over coordinates of the whole set differs from most in sign."""
    own = volume * orientation(eset.cells, adjacency(eset.cells))[0]
    return own * np.sign(own.sum()) < 0.0


def test_sheets_that_never_meet_are_balls():
    """x³ − 9x + …: three sheets over the whole box."""
    sheets = Polynomial(
        lambda x, a, b, c: integral(x**3 - 9.0 * x + 0.5 * a + 0.5 * b + 0.2 * c), 1, "abc"
    )
    eset = equilibrium_set(sheets, BOX, intervals=(2, 3, 2), checks=1)
    assert_faithful(eset)
    assert topology(eset) == (3, 3, 3)
    assert {piece.cells for piece in eset.components} == {6 * 2 * 3 * 2}
    assert projected_volume(eset, 0) == pytest.approx(2 * 2.5 * 2.9 * 2.7, rel=1e-12)


def test_three_sphere_is_closed_and_folded_along_a_sphere():
    eset = lifted(ball(), BOX, (5, 6, 5))
    assert_faithful(eset)
    assert topology(eset) == (1, 0, 0)
    assert len(eset.folds) == 1
    assert euler_characteristic(eset.folds[0]) == 2
    equator = eset.coordinates[np.unique(eset.folds[0])]
    np.testing.assert_allclose((equator**2).sum(axis=1), 1.0, rtol=1e-12)
    # chords across a fold surface of spacing 1/2 lose some of the ball's volume 4π/3
    for index in (0, 1):
        assert projected_volume(eset, index) == pytest.approx(4 * np.pi / 3, rel=0.1)


@pytest.mark.slow
def test_volume_below_a_sheet_converges_to_that_of_the_ball():
    """Second order in the spacing: halving it leaves about a quarter of the error."""
    errors = [4 * np.pi / 3 - projected_volume(lifted(ball(), BOX, (n, n, n)), 0) for n in (5, 10)]
    assert 0 < errors[1] < errors[0] / 3


@pytest.mark.parametrize("slope", [0.0, 1.0])
def test_constraint_cuts_the_three_sphere_to_a_ball(slope):
    """x ≤ 0.4 closes along a sphere; x + a ≤ 0.4 crosses the fold, which becomes a disc."""
    slant = Descriptor("x + a", "1", lambda z, p: z[:, 0] + slope * p[:, 0])
    eset = lifted(ball(), BOX, (5, 6, 5), within=[slant <= 0.4])
    assert_faithful(eset)
    assert topology(eset) == (1, 1, 1)
    assert eset.boundaries[0].kind == "cap"
    assert euler_characteristic(eset.boundaries[0].vertices) == 2
    assert [euler_characteristic(fold) for fold in eset.folds] == [1 if slope else 2]
    own = np.unique(eset.boundaries[0].vertices)
    np.testing.assert_allclose(slant(eset.points)[own], 0.4, rtol=0, atol=1e-8)


def test_a_constraint_with_a_kink_closes_balls():
    """Flat arches of index 6 have several equal extrema of curvature: the largest has a kink.

    No tetrahedron needs division: lids are drawn from their rims where no point is found inside.
    """
    arch = Rod()
    box = Box(Theta=(0.2, 0.26), Delta=(-0.13, 0.14), q=(0, 0.3))
    eset = lifted(arch, box, (2, 3, 2), within=[arch.max_curvature <= 20])
    assert_faithful(eset)
    assert eset.audit.bisected == 0
    assert "mixed" in {piece.kind for piece in eset.boundaries}
    assert {piece.euler_characteristic for piece in eset.components} == {1}


def test_curve_of_cusps_is_no_edge_of_the_fold_surface():
    """Folds a + c²/2 = −3x², b = 2x³: a disc, smooth in (x, a, b, c)."""
    eset = lifted(ridge(), Box(a=(-1.1, 0.6), b=(-0.7, 0.8), c=(-0.9, 1.0)), (4, 5, 4))
    assert_faithful(eset)
    assert topology(eset) == (1, 1, 1)
    assert [euler_characteristic(fold) for fold in eset.folds] == [1]
    x, folded = eset.points.z[:, 0], eset.kinds == 1
    a, b, c = eset.coordinates[folded].T
    np.testing.assert_allclose(a + 0.5 * c**2, -3 * x[folded] ** 2, rtol=0, atol=1e-9)
    np.testing.assert_allclose(b, 2 * x[folded] ** 3, rtol=0, atol=1e-9)


def pinned_one_by_one(setting, points, groups, kind, span, frames):
    """Points of `pin_in_cells`, each try for itself, in order."""
    z, p, _ = middles(setting, points, groups)
    found = np.zeros(len(groups), bool)
    for lane, group in enumerate(groups):
        best = -np.inf if kind == VertexKind.FOLD else inner_points.ON_FACE
        members = range(min(len(group), inner_points.TRIED))
        for share, member in [(0.0, 0), *product(inner_points.SHARES, members)]:
            tried = pin(setting, points, [group], kind, span[[lane]], np.array([member]), share)
            depth = shares_in(frames[[lane]], tried.p[:, setting.free]).min()
            if tried.found[0] and depth > best:
                z[lane], p[lane], best, found[lane] = tried.z[0], tried.p[0], depth, True
            if best > inner_points.ON_FACE:
                break
    return Pinned(z, p, found)


def test_points_that_are_tried_together_are_those_of_one_try_after_the_other(monkeypatch):
    """Around a curve of cusps, where folds bulge beyond their cells, and some are lost."""
    asked, compute = [], inner_points.pin_in_cells

    def both(*given):
        asked.append((compute(*given), pinned_one_by_one(*given)))
        return asked[-1][0]

    monkeypatch.setattr(inner_points, "pin_in_cells", both)
    lifted(ridge(), BOX, (3, 3, 3))
    assert sum(len(each.found) for each, _ in asked) > 20
    for together, alone in asked:
        np.testing.assert_array_equal(together.found, alone.found)
        np.testing.assert_allclose(together.z, alone.z, rtol=0.0, atol=1e-12)
        np.testing.assert_allclose(together.p, alone.p, rtol=0.0, atol=1e-12)


@pytest.mark.parametrize(
    "box",
    [
        Box(a=(-0.8, 0.9), b=(-0.4, 0.5), c=(-0.3, 0.3)),
        pytest.param(Box(a=(-1.1, 0.6), b=(-0.7, 0.8), c=(-0.9, 1)), marks=pytest.mark.slow),
        pytest.param(Box(a=(-1, 1), b=(-1, 1), c=(-1, 1)), marks=pytest.mark.slow),
    ],
)
def test_a_swallowtail_is_a_ball_with_one_fold(box):
    """x⁴ + a x² + b x + c, the graph of c: one smooth surface of folds, a disc, with two cusps.

    Behind the swallowtail point its tail is narrower than any cell: of four folds on the edges of a
    triangle two are joined around a cusp inside.
    """
    with unchecked():
        eset = equilibrium_set(swallowtail(), box, intervals=(6, 7, 6))
    assert eset.audit.clean, eset.audit
    assert topology(eset) == (1, 1, 1)
    assert [euler_characteristic(fold) for fold in eset.folds] == [1]


NARROW = Box(a=(-2.0, 0.5), b=(-0.3, 1.1), c=(-0.5, 0.43))
WIDE = Box(a=(-1.5, 0.7), b=(-0.4, 0.9), c=(-0.45, 0.5))
OFF = Box(a=(-0.93, 1.2), b=(-0.8, 1.1), c=(-0.7, 1.13))


@pytest.mark.parametrize(
    ("tilt", "skew", "box", "grid"),
    [
        (0.0, 0.0, NARROW, (5, 5, 4)),
        pytest.param(0.3, 0.2, WIDE, (5, 5, 4), marks=pytest.mark.slow),
        *(
            pytest.param(*form, box, grid, marks=pytest.mark.slow)
            for form in ((0.0, 0.0), (0.3, 0.2))
            for box in (NARROW, WIDE, OFF)
            for grid in ((4, 5, 5), (6, 5, 7))
        ),
    ],
)
def test_a_butterfly_has_as_many_states_as_its_polynomial_has_roots(tilt, skew, box, grid):
    """Three cusps near one point: two chords of folds never turn at the same one.

    Over the first two boxes the ways to join folds were ambiguous, and steps passed two folds in
    the tail, where the slope of the cubic along a step only comes close to zero.
    """
    with unchecked():
        eset = equilibrium_set(butterfly(tilt, skew), box, intervals=grid, checks=0)
    assert eset.audit.clean, eset.audit
    assert topology(eset) == (1, 1, 1)
    a, b, c = np.random.default_rng(5).uniform(box.lower, box.upper, (300, 3)).T
    found = np.bincount(eset.over(a=a, b=b, c=c).point, minlength=len(a))
    for count, at in zip(found, zip(a, b, c, strict=True), strict=True):
        roots = np.roots([1.0, 0.0, at[0], skew * at[1], at[1], at[2] + tilt * at[0]])
        assert count == (np.abs(roots.imag) < 1e-9).sum()


def test_spring_over_actuator_load_and_stiffness():
    """Three equilibria where |F|/k < (1 − x_l^(2/3))^(3/2): the volume of the unstable sheet.

    Over x_l > 0.5 and k from 1 to 1.2: ∫∫ 2 k (1 − x^(2/3))^(3/2) dx dk, by quadrature.
    """
    eset = lifted(Spring(), Box(x_l=(0.5, 1.2), F=(-0.3, 0.3), k=(1.0, 1.2)), (10, 9, 2))
    assert_faithful(eset)
    assert_folds_are_singular(eset, 1e-8)
    assert topology(eset) == (1, 1, 1)
    folded = np.unique(np.concatenate(eset.folds))
    delta, x = eset.points.z[folded, 0], eset.points["x_l"][folded]
    np.testing.assert_allclose(x, np.cos(delta) ** 3, rtol=0, atol=1e-9)
    x = np.linspace(0.5, 1.0, 20001)
    area = np.trapezoid(2 * (1 - np.cbrt(x) ** 2) ** 1.5, x)
    assert projected_volume(eset, 1) == pytest.approx(area * (1.2**2 - 1) / 2, rel=0.1)


@pytest.mark.slow
def test_arch_over_both_actuators_and_the_load():
    """(Θ, Δ, q) across the pitchforks on Δ = 0, along which the set is smooth.

    The boundary of a compact manifold of three dimensions has twice its Euler characteristic.
    """
    arch = Rod()
    box = Box(Theta=(0.6, 1.4), Delta=(-0.6, 0.6), q=(0, 6))
    eset = lifted(arch, box, (8, 8, 8), within=[arch.max_curvature <= 25])
    assert_faithful(eset)
    assert_folds_are_singular(eset, 1e-8)
    assert eset.components[0].indices == (0, 1, 2, 3, 4)
    assert len(eset.components) == 1
    around = np.concatenate([piece.vertices for piece in eset.boundaries])
    assert euler_characteristic(around) == 2 * eset.audit.euler_characteristic


@pytest.mark.slow
def test_every_surface_around_a_grid_cell_of_the_arch_is_a_sphere(monkeypatch):
    """The cells over each grid tetrahedron form balls: closed surfaces of characteristic two.

    Over all of (Θ, Δ, q ∈ [0, 6]), where a strip between a fold and the constraint gets as thin as
    a thirtieth of a grid cell, and balls are cut off by the constraint.
    """
    last = []

    def kept(*given):
        last.append(volumes_over(*given))
        return last[-1]

    monkeypatch.setattr(cells, "volumes_over", kept)
    arch = Rod()
    box = Box(Theta=(0.2, 2.5), Delta=(-2, 2), q=(0, 6))
    eset = lifted(arch, box, (19, 29, 10), within=[arch.max_curvature <= 20])
    assert len(eset.points) > 25_000
    assert_faithful(eset)
    balls = last[-1].balls
    count, base = len(balls.corners), int(balls.corners.max()) + 1
    links = adjacency(balls.corners).links
    ball = labels(count, links[balls.owner[links[:, 0]] == balls.owner[links[:, 1]]])
    facets = np.concatenate([np.delete(balls.corners, k, axis=1) for k in range(4)])
    owner = np.tile(ball, 4)
    order = np.lexsort([keys_of(facets, base), owner])
    facets, owner = np.sort(facets[order], axis=1), owner[order]
    same = (facets[1:] == facets[:-1]).all(axis=1) & (owner[1:] == owner[:-1])
    inner = np.concatenate([same, [False]]) | np.concatenate([[False], same])
    facets, owner = facets[~inner], owner[~inner]
    sides = np.concatenate([np.delete(facets, k, axis=1) for k in range(3)])
    faces = [owner, np.tile(owner, 3) * base**2 + keys_of(sides, base)]
    points = np.unique(np.repeat(owner, 3) * base + facets.ravel()) // base
    edges, shares = np.unique(faces[1], return_counts=True)
    assert (shares == 2).all()
    characteristic = sum(
        sign * np.bincount(each, minlength=ball.max() + 1)
        for sign, each in ((1, points), (-1, edges // base**2), (1, owner))
    )
    assert (characteristic == 2).all()


@pytest.mark.slow
def test_refined_three_sphere_is_within_the_accuracy():
    """| |x| − 1 | inside the tetrahedra; the volume below each half tends to 4π/3."""
    eset = lifted(ball(), BOX, (5, 6, 5))
    with unchecked():
        fine = refine(eset, 0.05)
    assert_faithful(fine)
    assert topology(fine) == topology(eset)
    # seen from the middle of the sphere no cell is turned over, and none is slender
    whole = np.concatenate([fine.points.z, fine.coordinates], axis=1)
    assert not folded_over(fine, np.linalg.det(whole[fine.cells])).any()
    smallest = np.degrees(smallest_angles(squared_sides(whole, fine.cells))).min()
    assert fine.audit.smallest_dihedral == pytest.approx(smallest, rel=1e-9)
    assert smallest > 5.0
    place = np.concatenate([fine.points.z, fine.coordinates], axis=1)
    inside = np.random.default_rng(0).dirichlet(np.ones(4), len(fine.cells))
    middle = np.einsum("ck,ckd->cd", inside, place[fine.cells])
    assert np.abs(np.linalg.norm(middle, axis=1) - 1.0).max() <= 0.05
    assert fine.audit.deviation <= 0.05
    for index in (0, 1):
        assert projected_volume(fine, index) == pytest.approx(4 * np.pi / 3, rel=0.04)


def test_volume_of_the_bistable_region_of_the_spring():
    """Where |F|/k < (1 − x_l^(2/3))^(3/2), by quadrature: that of the unstable sheet, refined."""
    box = Box(x_l=(0.5, 1.2), F=(-0.3, 0.3), k=(1.0, 1.2))
    with unchecked():
        eset = refine(lifted(Spring(), box, (10, 9, 2)), 0.01)
    assert_faithful(eset)
    # the set is a graph over the angle, the actuator and the stiffness
    along = np.stack([eset.points.z[:, 0], eset.points["x_l"], eset.points["k"]], axis=1)
    size = volumes(along[eset.cells])
    assert not folded_over(eset, size).any()
    # beside folds cells may project either way, however well shaped they are
    assert eset.audit.overturned < 10
    assert eset.audit.smallest_dihedral > 5.0
    x = np.linspace(0.5, 1.0, 20001)
    area = np.trapezoid(2 * (1 - np.cbrt(x) ** 2) ** 1.5, x)
    wanted = area * (1.2**2 - 1) / 2
    assert projected_volume(eset, 1) == pytest.approx(wanted, rel=5e-3)
    # stable states count twice there, and once elsewhere
    whole = 0.7 * 0.6 * 0.2
    assert projected_volume(eset, 0) == pytest.approx(whole + wanted, rel=1e-3)


@pytest.mark.slow
def test_refined_arch_over_three_parameters_has_no_slivers():
    """No dihedral angle below 1°, and random points of all cells within the accuracy.

    One edge beside a side of the box may be left; its deviation is told.

    From each the set is sought orthogonally to the tangent space at the nearest corner: what is
    found is at least as far as the nearest point.
    """
    arch = Rod()
    box = Box(Theta=(0.6, 1.4), Delta=(-0.6, 0.6), q=(0, 3))
    coarse = lifted(arch, box, (6, 9, 5), within=[arch.max_curvature <= 20])
    with unchecked():
        fine = refine(coarse, 0.05)
        assert fine.audit.smallest_dihedral > 1.0
        assert fine.audit.unrefined <= 1
        setting = replace(fine.setting, constraints=())
        fabric = replace(fabric_of(fine), setting=setting)
        generator = np.random.default_rng(5)
        cells = fabric.cells[generator.integers(len(fabric.cells), size=1000)]
        share = generator.dirichlet(np.ones(4), 1000)
        z, p = (
            np.einsum("ck,cki->ci", share, each[cells]) for each in (fine.points.z, fine.points.p)
        )
        nearest = cells[np.arange(1000), share.argmax(axis=1)]
        place, span = embed(setting, z, p), np.tile(np.eye(3), (1000, 1, 1))
        aim = Aim(setting, False, False, span, place, fabric.vertices.rows[nearest])
        found = correct_points(aim, z, p, np.full(1000, 0.5))
        assert found.found.all()
        away = np.linalg.norm(embed(setting, found.z, found.p) - place, axis=1)
    assert away.max() <= 0.05


@pytest.mark.slow
def test_distances_from_the_edge_of_stability_in_three_parameters():
    """F = k (1 − x_l^(2/3))^(3/2) ends the upper branch: nearest point by a scan."""
    box = Box(x_l=(0.5, 1.2), F=(-0.3, 0.3), k=(1.0, 1.2))
    eset = lifted(Spring(), box, (10, 9, 2))
    with unchecked():
        fine = refine(eset, 0.02)
    upper = max(eset.at(x_l=0.8, F=0.0, k=1.1).stable, key=eset.structure.angle)
    x, k = np.meshgrid(np.linspace(0.75, 0.9, 1501), np.linspace(1.0, 1.2, 401))
    limit = k * (1.0 - np.cbrt(x) ** 2) ** 1.5
    scales = eset.structure.scales[[parameter_at(eset, name) for name in ("x_l", "F", "k")]]
    moves = np.stack([x - 0.8, limit, k - 1.1]) / scales[:, None, None]
    nearest = np.sqrt((moves**2).sum(axis=0)).min()
    for each in (eset, fine):
        assert stability_distance(each, upper).in_parameters == pytest.approx(nearest, rel=1e-4)


def parameter_at(eset: EquilibriumSet, name: str) -> int:
    return [parameter.name for parameter in eset.structure.parameters].index(name)


@pytest.mark.slow
def test_slice_of_the_arch_at_a_load_is_its_set_at_that_load():
    """States over 40 random points with q = 2.5, from both sets: the same, to round-off."""
    arch = Rod()
    sides = {"Theta": (0.6, 1.4), "Delta": (-0.6, 0.6)}
    within = [arch.max_curvature <= 20]
    volume = lifted(arch, Box(**sides, q=(0, 3)), (10, 13, 8), within=within)
    plane = lifted(arch, Box(**sides), (16, 25), within=within, fixed={"q": 2.5})
    assert_faithful(volume)
    points = np.random.default_rng(3).uniform([0.6, -0.6], [1.4, 0.6], (40, 2))
    at = {"Theta": points[:, 0], "Delta": points[:, 1]}
    sliced, flat = volume.over(**at, q=np.full(40, 2.5)), plane.over(**at)
    for one, other in zip(sliced, flat, strict=True):
        assert len(one.states) == len(other.states)
        np.testing.assert_array_equal(np.sort(one.index), np.sort(other.index))
        gap = np.abs(one.states.z[:, None] - other.states.z[None]).max(axis=2)
        assert gap.min(axis=1).max() < 1e-9


@pytest.mark.parametrize("turn", [0.0, 0.4, 1.2])
def test_steep_tetrahedra_count_by_the_cosine_of_their_angle_with_the_set(turn):
    """The sheet x = 0 with tangent spaces turned out of it: the smallest angle times the cosine."""
    names = ("a", "b", "c")
    sheet = Polynomial(lambda x, a, b, c: integral(x + 0.0 * (a + b + c)), 1, names)
    fabric = fabric_of(lifted(sheet, BOX, (2, 2, 2)))
    rows = fabric.vertices.rows.copy()
    rows[:, 0] *= np.cos(turn)
    rows[:, 0, 0] += np.sin(turn)  # the coordinate x of the embedding
    vertices = replace(fabric.vertices, rows=rows)
    angles = smallest_angles(fabric.squared)
    found = qualities(vertices, fabric.cells, fabric.cell_index)
    np.testing.assert_allclose(found, np.cos(turn) * angles, rtol=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("accuracy", [0.1, 0.05])
def test_every_level_cuts_a_refined_set_that_bulges_over_the_sides_of_its_box(accuracy):
    """x³ = (a + 0.3·b − 0.2·c) x: no edge may lack a vertex on x = v, however near to a side."""
    names = ("a", "b", "c")
    pitchfork = Polynomial(
        lambda x, a, b, c: integral(x**3 - (a + 0.3 * b - 0.2 * c) * x), 1, names
    )
    x = Descriptor("x", "1", lambda z, p: z[:, 0].copy())
    box = Box(a=(-1.0, 1.1), b=(-1.0, 1.2), c=(-1.05, 1.15))
    with unchecked():
        eset = refine(lifted(pitchfork, box, (3, 4, 3)), accuracy)
        for value in np.linspace(-0.9, 0.9, 19):
            assert level_set(eset, x, value).lost == 0
