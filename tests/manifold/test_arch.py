"""The equilibrium set of the arch under its own weight at q = 2.5, max |κ| ≤ 20.

Topology: sheet lifting on 12×21 to 93×161 intervals in an independent prototype; there a second
component of index 4 to 6 was met by many random starts. Equilibria at (Θ, Δ) = (1, 0): computed
independently by two or three methods to the digits given.
"""

import numpy as np
import pytest

from equimorph.charts.coordinates import frames_anywhere
from equimorph.equilibria import find_equilibria
from equimorph.manifold import VertexKind
from equimorph.manifold.geometry.kernels import match_or_add
from equimorph.manifold.geometry.tangents import InPlanes, frames_in_embedding, split_step
from oracles.complexes import assert_faithful, assert_folds_are_singular


def test_main_component_has_characteristic_minus_one_and_three_loops(arch_set):
    assert arch_set.audit.clean, arch_set.audit
    main = arch_set.components[0]
    assert (main.euler_characteristic, main.loops) == (-1, 3)
    assert main.indices == (0, 1, 2, 3, 4)


def test_second_component_is_seeded_from_beyond_the_box(arch_set, even_arch_set):
    """A disc of index 4 to 6, all of it with max |κ| > 15.9: it joins the main one beyond the box.

    Together the Euler characteristic is 0, with four loops. It is there before any check.
    """
    assert (even_arch_set.audit.checked, even_arch_set.audit.components) == (0, 2)
    assert (arch_set.audit.components, arch_set.audit.euler_characteristic) == (2, 0)
    assert len(arch_set.boundaries) == 4
    second = arch_set.components[1]
    assert (second.euler_characteristic, second.loops, second.indices) == (1, 1, (4, 5, 6))
    own = np.unique(arch_set.cells[arch_set.component == 1])
    assert arch_set.structure.max_curvature(arch_set.points[own]).min() > 15.9


def test_arch_set_is_exact_and_its_cells_agree_with_the_index(arch_set):
    assert_faithful(arch_set)


def test_upright_and_inverted_arch_lie_on_one_stable_stratum(arch_set):
    """The main component has one stratum of each index 0 to 4."""
    main = [stratum for stratum in arch_set.strata if stratum.component == 0]
    assert sorted(stratum.index for stratum in main) == [0, 1, 2, 3, 4]
    assert sum(stratum.cells for stratum in main) == arch_set.components[0].cells
    assert [stratum.component for stratum in arch_set.strata if stratum.index == 0] == [0]


def test_even_grid_keeps_its_lines_off_the_symmetry_line(even_arch_set):
    """A grid line on Δ = 0 would run through pitchforks."""
    assert_faithful(even_arch_set)
    main = even_arch_set.components[0]
    assert (main.euler_characteristic, main.loops) == (-1, 3)
    assert np.abs(even_arch_set.mesh.vertices[:, 1]).min() > 0.01


def test_fold_vertices_of_the_arch_are_singular(arch_set):
    """|smallest eigenvalue| ≤ 1e-8 in the metric; the stable eigenvalues are of order one."""
    assert_folds_are_singular(arch_set, 1e-8)


def test_constraint_vertices_of_the_arch_have_curvature_20(arch_set):
    kappa = arch_set.structure.max_curvature(arch_set.points)
    capped = np.isin(arch_set.kinds, (2, 4))
    assert capped.any()
    np.testing.assert_allclose(kappa[capped], 20.0, rtol=0, atol=1e-8)
    assert kappa.max() <= 20.0 + 1e-8


def test_five_equilibria_at_theta_one_delta_zero(arch_set):
    here = arch_set.at(Theta=1, Delta=0)
    rise = arch_set.structure.height(0.5)(here)
    assert sorted(here.index.tolist()) == [0, 0, 1, 1, 2]
    assert sorted(rise[here.index == 0]) == pytest.approx([-0.1496, 0.2258], abs=5e-5)
    third = arch_set.structure.height(1 / 3)(here)
    assert third[here.index == 0].max() == pytest.approx(0.20139, abs=5e-6)
    assert here.residual.max() < 1e-13
    # mirror images have equal energies, up to round-off
    assert (np.diff(here.energy) >= -1e-12).all()


def test_arch_over_delta_is_the_mirror_image_of_that_over_minus_delta(arch_set):
    """Over every vertex of the regular grid, states are the images of those over its mirror image.

    Vertices of the shared grid only: subdivision need not be symmetric.
    """
    structure, mesh = arch_set.structure, arch_set.mesh
    n, m = arch_set.intervals
    count = (n + 1) * (m + 1)
    number = np.arange(count).reshape(n + 1, m + 1)
    if m % 2 == 0:  # the line beside Δ = 0 has no mirror image
        number = np.delete(number, m // 2, axis=1)
    image_of = np.full(count, -1)
    image_of[number.ravel()] = number[:, ::-1].ravel()
    own = np.flatnonzero((arch_set.grid_vertex >= 0) & (arch_set.grid_vertex < count))
    own = own[image_of[arch_set.grid_vertex[own]] >= 0]
    z, p = structure.symmetries()[0].apply(arch_set.points.z[own], arch_set.points.p[own])
    vertex = image_of[arch_set.grid_vertex[own]]
    assert np.abs(p[:, :2] - mesh.vertices[vertex]).max() < 1e-12
    gap = _gaps(structure, (vertex, z), (arch_set.grid_vertex[own], arch_set.points.z[own]))
    assert gap.max() < 1e-8
    assert np.array_equal(
        np.bincount(vertex, minlength=count),
        np.bincount(arch_set.grid_vertex[own], minlength=count),
    )


def _gaps(structure, images, known):
    """Distance of each image to the nearest known state over the same vertex."""
    vertex, z = images
    order = np.argsort(known[0], kind="stable")
    begin = np.searchsorted(known[0][order], vertex)
    end = np.searchsorted(known[0][order], vertex, side="right")
    root = np.sqrt(structure.mass)
    n = structure.unknowns
    gap = np.full(len(z), np.inf)
    for k in range(int((end - begin).max())):
        some = begin + k < end
        other = known[1][order[begin[some] + k]]
        distance = np.linalg.norm((z[some] - other)[:, :n] * root, axis=1)
        gap[some] = np.minimum(gap[some], distance)
    return gap


@pytest.mark.parametrize(("theta", "delta"), [(1.1, 0.2), (0.7, -0.5)])
def test_independent_search_finds_no_other_equilibria_of_low_index(arch_set, theta, delta):
    """Random starts; states of index 4 and more may lie on the other component."""
    arch = arch_set.structure
    within = [arch.max_curvature <= 20]
    at = {"Theta": theta, "Delta": delta}
    found = find_equilibria(arch, {**at, "q": 2.5}, within=within, starts=60)
    known = arch_set.at(**at)
    gap = (found.z[:, None] - known.z)[:, :, : arch.unknowns] ** 2 @ arch.mass
    assert gap.min(axis=1)[found.index < 4].max() < 1e-12


def test_states_over_random_points_are_exact(arch_set):
    generator = np.random.default_rng(5)
    found = 0
    for theta, delta in generator.uniform((0.5, -1), (2.5, 1), size=(4, 2)):
        here = arch_set.at(Theta=theta, Delta=delta)
        found += len(here)
        assert here.residual.max(initial=0.0) < 1e-12
        assert (here.p == arch_set.parameters_at({"Theta": theta, "Delta": delta})).all()
    assert found > 0


def test_match_or_add_equals_its_plain_twin():
    """Points closer than `same` in the metric over one vertex are one point."""
    generator = np.random.default_rng(1)
    mass = generator.uniform(0.5, 2.0, 3)
    pool = generator.normal(size=(20, 4))
    vertices = generator.integers(0, 4, 200)
    z = pool[generator.integers(0, 20, 200)] + 1e-9 * generator.normal(size=(200, 4))
    head, following = np.full(4, -1), np.full(200, -1)
    stored, ids, new = np.zeros((200, 4)), np.empty(200, int), np.empty(200, bool)
    count = match_or_add(vertices, z, mass, 1e-6, head, following, stored, 0, ids, new)
    known: list[tuple[int, np.ndarray]] = []
    for vertex, point, number, added in zip(vertices, z, ids, new, strict=True):
        same = [
            k
            for k, (v, other) in enumerate(known)
            if v == vertex and ((point - other)[:3] ** 2 @ mass) < 1e-12
        ]
        assert added == (not same)
        assert number == (same[0] if same else len(known))
        if not same:
            known.append((vertex, point))
    assert count == len(known)


@pytest.mark.parametrize("fold", [False, True])
def test_sets_bend_as_their_second_derivative_says(arch_set, fold):
    """The residual at z + h t + h² b/2 is of third order in h: an eighth for half of it."""
    some = np.flatnonzero((arch_set.kinds == VertexKind.FOLD) == fold)[::9]
    at, setting = arch_set.points[some], arch_set.setting
    frames = frames_anywhere(setting, at.z, at.p)
    rows = frames_in_embedding(setting, frames)
    step = np.einsum("k,lkf->lf", [0.8, 0.6], frames)
    bend = InPlanes(setting, at.z, at.p, rows).bend_along(step)
    sizes = []
    for h in (2e-2, 1e-2):
        dz, dp = split_step(setting, h * step + 0.5 * h**2 * bend)
        sizes.append(np.abs(at.structure.residual(at.z + dz, at.p + dp)).max())
    assert 7.0 < sizes[0] / sizes[1] < 9.0
