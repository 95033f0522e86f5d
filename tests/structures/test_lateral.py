"""Movements out of the plane: the compiled second variation against other methods."""

import numpy as np
import pytest

import equimorph as em
from equimorph.structures.rod.lateral import Holding, LateralStiffness, OutOfPlane
from equimorph.structures.rod.space import quartic
from oracles.spatial import dense_margin, fine_margin, rotated_energy

FREE_END = ("clamped", "free")
RODS = {
    "arch": em.Rod(torsion=0.77, lateral=1.0),
    "strip": em.Rod("left-half", torsion=1.5, lateral=40.0),
    "soft": em.Rod(torsion=0.3, lateral=0.2, elements=3, degree=4),
    "varying": em.Rod(
        torsion=[[0, 0.5], [0.3, 1.0], [0.3, 0.7], [1, 0.7]], lateral=[[0, 1], [1, 3]]
    ),
    "cantilever": em.Rod(
        ends=FREE_END, loads={"P": em.PointForce(0.7), "M": em.Couple(1.0)}, torsion=0.5,
        lateral=0.8, curvature=[[0, 1], [1, 3]], stiffness=[[0, 2], [1, 1]],
    ),
    "hung": em.Rod(ends=("free", "clamped"), torsion=0.5, lateral=0.8),
    "stretched": em.Rod(
        axial=20.0, torsion=0.7, lateral=1.3,
        actuators={"T": [em.Tendon(0.05), em.Tendon(-0.02, 0.2, 0.6)]},
    ),
    "pinned": em.Rod(ends=("pinned", em.End("free", slide=0.5)), torsion=0.7, lateral=1.3,
                     curvature=2.0),
    "sprung": em.Rod(ends=(em.End(0.1), em.End("held", 3.0, "held")), torsion=0.7, lateral=1.3),
}  # fmt: skip


def random_states(rod, count, seed=3):
    """States far from equilibrium, with any forces: the second variation is defined for all."""
    generator = np.random.default_rng(seed)
    p = generator.uniform(0.2, 1.2, (count, len(rod.parameters)))
    return rod.sample(p, generator) * 0.7, p


@pytest.mark.parametrize(
    ("name", "count"),
    [
        *((name, 60) for name in RODS),
        *(pytest.param(name, 600, marks=pytest.mark.slow) for name in ("arch", "cantilever")),
    ],
)
def test_the_index_is_the_number_of_negative_eigenvalues(name, count):
    """Random states of each rod, by dense eigenvalues; the margin is the smallest: 1e-9."""
    rod = RODS[name]
    z, p = random_states(rod, count)
    block = rod.out_of_plane()
    index, margin = block.index(z, p), block.margin(z, p)
    values = [dense_margin(block, *each) for each in zip(z, p, strict=True)]
    np.testing.assert_array_equal(index, [(each < 0.0).sum() for each in values])
    lowest = np.array([each[0] for each in values])
    np.testing.assert_allclose(margin, lowest, atol=1e-9, rtol=1e-9)
    assert len(set(index.tolist())) > 2


@pytest.mark.parametrize("name", RODS)
def test_the_kernel_solves_what_is_written_out(name):
    """Compiled elimination against dense factorisation: round-off times the condition number."""
    block, (z, p) = RODS[name].out_of_plane(), random_states(RODS[name], 11)
    rhs = np.random.default_rng(0).normal(size=(11, 2, block.size))
    shift = np.linspace(-1.0, 0.4, 11)
    rhs[:, :, : block.unknowns][:, :, ~block.free] = 0.0
    matrix = block.dense(z, p)
    at = np.flatnonzero(block.free)
    matrix[:, at, at] -= shift[:, None] * block.mass[at]
    found = block.solve(z, p, rhs, shift=shift)
    again = np.einsum("lij,lsj->lsi", matrix, found.x)
    np.testing.assert_allclose(again, rhs, atol=1e-8 * np.abs(found.x).max())
    one = block.solve(z[4:5], p[4:5], rhs[4:5, :1], shift=shift[4:5])
    np.testing.assert_array_equal(one.x[0, 0], found.x[4, 0])
    np.testing.assert_array_equal(block.index(z, p)[4], block.index(z[4:5], p[4:5])[0])


@pytest.mark.parametrize("name", ["arch", "varying", "cantilever", "stretched", "sprung"])
def test_the_second_variation_is_that_of_the_rod_in_space(name):
    """Differences of the energy after finite rotations, fourth order in h: h⁴ and round-off/h²."""
    rod = RODS[name]
    block, (z, p) = rod.out_of_plane(), random_states(rod, 3)
    generator = np.random.default_rng(5)
    smooth = np.cos(np.outer(np.arange(1, 4), np.pi * np.repeat(block.mesh.nodes, 2)))
    for lane in range(3):
        x = np.append(generator.normal(size=3) @ smooth, [0.3] * block.constraints)
        x[: block.unknowns][~block.free] = 0.0
        h = 0.02
        energy = [rotated_energy(block, z[lane], p[lane], k * h * x) for k in range(3)]
        second = (16 * energy[1] - energy[2] - 15 * energy[0]) / (6 * h**2)
        quadratic = x @ block.dense(z[lane : lane + 1], p[lane : lane + 1])[0] @ x
        held = (x[: block.unknowns][~block.free] ** 2).sum()
        assert second == pytest.approx(quadratic - held, rel=1e-5, abs=1e-7)


@pytest.mark.parametrize("name", ["cantilever", "stretched", "sprung"])
def test_the_margin_converges_to_that_of_recovered_fields(name):
    """Equilibria, coefficients recovered on a finer rule, plain dense algebra: 1e-8."""
    rod = RODS[name]
    load = {"cantilever": {"P": 0.05, "M": 0.01}, "stretched": {"q": 0.6}, "sprung": {"q": 0.2}}
    turned = {} if name == "cantilever" else {"theta_A" if name == "sprung" else "Theta": 0.6}
    state = em.lift(rod.natural_state(**turned), load[name]).end.state
    stiffness = {"cantilever": (0.5, 0.8)}.get(name, (0.7, 1.3))
    if name == "stretched":  # the oracle knows no stretch
        rod = em.Rod(loads={"q": em.LineLoad()}, torsion=0.7, lateral=1.3)
        state = em.lift(rod.natural_state(Theta=0.6), {"q": 0.6}).end.state
    exact = fine_margin(rod, *stiffness, state.z, state.p)
    assert rod.lateral_margin()(state) == pytest.approx(exact, rel=1e-8)


def test_the_quartic_coefficient_is_that_of_the_energy_in_space():
    """Fit of the energy along the mode with the planar unknowns following: 1e-5."""
    rod = RODS["arch"]
    end = em.limit_load(rod.natural_state(Theta=0.9), "q", within=[rod.stable_in_space]).state
    block, z, p = rod.out_of_plane(), end.z[None], end.p[None]
    x = block.mode(z, p)[0]
    a = np.array([0.05, 0.1, 0.15])
    alone = [rotated_energy(block, end.z, end.p, k * x) for k in a]
    rest = rotated_energy(block, end.z, end.p, 0.0 * x)
    fit = np.linalg.solve(np.stack([a**2, a**4, a**6], axis=1), np.array(alone) - rest)
    value, size = quartic(block, z, p)
    assert abs(fit[0]) < 1e-8
    h = 1e-4

    def quadratic(moved):  # second-order energy of the mode after a change of planar unknowns
        return 0.5 * x @ block.dense(moved[None], p)[0] @ x

    force = np.array([(quadratic(end.z + h * e) - quadratic(end.z - h * e)) / (2 * h)
                      for e in np.eye(rod.size)])  # fmt: skip
    balanced = 0.5 * force @ rod.solve(z, p, force[None, None]).x[0, 0]
    assert value[0] == pytest.approx(fit[1] - balanced, rel=1e-5)
    assert size[0] >= value[0] > 0.0


@pytest.mark.parametrize(
    ("alpha", "lateral", "torsion", "exact"),
    [
        (1.0, 0.3, 0.2, -0.52115256),
        (2.0, 0.3, 0.2, -0.27600017),
        (np.pi / 2, 0.1, 0.15, -0.19041420),
        (3 * np.pi / 4, 1.0, 0.77, -0.68478881),
    ],
)
def test_a_circular_arch_in_pure_bending_buckles_at_timoshenkos_moment(
    alpha, lateral, torsion, exact
):
    """M R = (A + C)/2 − √(((A − C)/2)² + A C π²/α²) [TimoshenkoGere1961]_.

    Given is M L/B, to half the last digit; the closed form holds to round-off.
    """

    def margin(moment):
        rod = em.Rod(ends=FREE_END, curvature=alpha - moment, EI=1.0, length=1.0,
                     loads={"M": em.Couple(1.0)})  # fmt: skip
        block = OutOfPlane(
            rod.mechanics, rod.mechanics.model,
            Holding((False, True, False, True), closed=False), LateralStiffness(torsion, lateral),
        )  # fmt: skip
        theta = alpha * rod.mesh.nodes[rod.mechanics.unknown_nodes]
        p = np.array([[0.0, moment]])
        assert np.abs(rod.residual(theta[None], p)).max() < 1e-12
        return block.margin(theta[None], p)[0]

    half = 0.5 * (lateral - torsion)
    root = np.hypot(half, np.sqrt(lateral * torsion) * np.pi / alpha)
    closed = alpha * (0.5 * (lateral + torsion) - root)
    assert closed == pytest.approx(exact, abs=5e-9)
    assert margin(exact - 5e-9) * margin(exact + 5e-9) < 0.0
    assert np.abs(margin(closed)) < 1e-11


def test_the_lateral_load_converges_with_twice_the_degree():
    """(0.9, 0), uniform, 6 elements: degree 3 to 5 gain a factor above 50 each, 9 is exact."""
    exact = 1.601471549048
    errors = []
    for degree in (3, 4, 5, 9):
        rod = em.Rod(torsion=0.77, lateral=1.0, degree=degree)
        found = em.limit_load(rod.natural_state(Theta=0.9), "q", within=[rod.stable_in_space])
        errors.append(abs(found.value - exact))
    assert errors[0] > 50 * errors[1] > 2500 * errors[2]
    assert errors[3] < 2e-11
