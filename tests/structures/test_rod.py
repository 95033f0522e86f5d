"""Equilibria, curvature, convergence and margins of the rod."""

import numpy as np
import pytest
import scipy.linalg

from equimorph.equilibria import Guards, settle
from equimorph.errors import InputError
from equimorph.model import Descriptor
from equimorph.structures import Rod, State, States
from typecheck import unchecked


def newton(rod, z, p, steps=12):
    """Plain Newton at fixed parameters."""
    still, one, none = np.zeros_like(z), np.ones(len(z)), np.zeros(len(z))
    for _ in range(steps):
        z = z + rod.advance(z, p, np.zeros_like(p), still, one, none).dz
    return z


def loaded(rod, Theta=0.9, Delta=0.3, q=1.5):
    """A loaded equilibrium near the natural state."""
    state = rod.natural_state(Theta=Theta, Delta=Delta)
    z, p = state.z[None].copy(), state.p[None].copy()
    for value in np.linspace(0, q, 7):
        p[0, 2] = value
        z = newton(rod, z, p, 8)
    return z, p


def many_equilibria(rod, guesses=300, seed=0):
    """Equilibria of all kinds with max |κ| ≤ 30, by Newton from random shapes."""
    generator = np.random.default_rng(seed)
    p = np.column_stack([generator.normal(size=(guesses, 3)), np.full(guesses, 0.8)])
    near = settle(rod, rod.sample(p, generator), p, guards=Guards(iterations=30))
    z, found = near.z, near.found
    found[found] = rod.largest_curvature(z[found], p[found])[0] < 30.0
    assert found.sum() > 20
    return z[found], p[found]


def test_natural_arch_without_skew_is_the_circular_arc():
    """Closed form: κ ≡ −2, λ = μ = 0 at Θ = 1, Δ = 0, ν = sin 1. 1e-12 required."""
    for load in ("uniform", "left-half"):
        rod = Rod(load)
        state = rod.natural_state(Theta=1.0, Delta=0.0)
        kappa = rod.fields(state.z[None], state.p[None], np.linspace(0, 1, 50))[:, :, 1]
        np.testing.assert_allclose(kappa, -2.0, atol=1e-12)
        np.testing.assert_allclose(state.multipliers, 0.0, atol=1e-12)
        assert rod.max_curvature(state) == pytest.approx(2.0, abs=1e-12)
        assert rod.height(0.5)(state) == pytest.approx(0.5 * (1 - np.cos(1)), abs=1e-12)
        assert state.energy == pytest.approx(4 / (8 * np.pi**2), abs=1e-12)
        assert state.stable


def test_descriptors_of_the_circular_arc_are_those_of_a_circle():
    """θ = 1 − 2s, x = (sin 1 − sin(1 − 2s))/2, y = (cos(1 − 2s) − cos 1)/2. 1e-12 as above."""
    rod = Rod()
    state = rod.natural_state(Theta=1.0)
    for s in (0.0, 0.1234, 1 / 3, 0.5, 0.99, 1.0):
        x, y = rod.position(s)
        angle = 1 - 2 * s
        assert rod.angle(s)(state) == pytest.approx(angle, abs=1e-12)
        assert x(state) == pytest.approx((np.sin(1) - np.sin(angle)) / 2, abs=1e-12)
        assert y(state) == pytest.approx((np.cos(angle) - np.cos(1)) / 2, abs=1e-12)
        assert rod.curvature(s)(state) == pytest.approx(-2.0, abs=1e-11)
    shape = state.shape(np.array([0.0, 1.0]))
    np.testing.assert_allclose(shape, [[0, 0], [np.sin(1), 0]], atol=1e-12)
    # κ = −2 is held by couples B κ/(4π² B) = −2/(4π²) at either end, of opposite sign
    assert rod.end_moment(0)(state) == pytest.approx(2 / (4 * np.pi**2), abs=1e-12)
    assert rod.end_moment(1)(state) == pytest.approx(-2 / (4 * np.pi**2), abs=1e-12)


def test_written_descriptors_equal_the_methods():
    rod = Rod(elements=4, degree=6)
    state = rod.natural_state(Theta=0.8, Delta=0.1)
    pairs: list[tuple[str, Descriptor]] = [
        ("height(1/3)", rod.height(1 / 3)),
        ("x(0.25)", rod.position(0.25)[0]),
        ("angle( 0.5 )", rod.angle(0.5)),
        ("curvature(0.7)", rod.curvature(0.7)),
        ("max_curvature", rod.max_curvature),
        ("energy", rod.total_energy),
        ("support_force(mu)", rod.support_force("mu")),
        ("end_moment(1)", rod.end_moment(1)),
    ]
    for text, descriptor in pairs:
        assert rod.descriptor(text)(state) == descriptor(state)


def test_curvature_of_an_equilibrium_is_the_slope_of_the_angle():
    """θ' of the interpolant on a finer rod; 1e-7: nodal slopes converge one order later."""
    rod = Rod(elements=12, degree=12)
    z, p = loaded(rod)
    theta = rod.nodal_angles(z, p)[0]
    ref, kappa = rod.mesh.reference, rod.fields(z, p, rod.mesh.nodes)[0, :, 1]
    for e, at in enumerate(rod.mesh.element_nodes):
        slope = ref.derivative @ theta[at] / rod.mesh.lengths[e]
        np.testing.assert_allclose(kappa[at], slope, atol=1e-7)


def test_slope_of_the_curvature_obeys_the_equilibrium_equation():
    """θ''/(4π²) + qρ cos θ + λ sin θ − μ cos θ = 0 (PHYSICS §3), κ differenced; 1e-6: step 1e-4."""
    rod = Rod()
    z, p = loaded(rod)
    for s in (0.11, 0.37, 0.52, 0.93):
        h = 1e-4
        above, below = (rod.curvature(s + d).function(z, p)[0] for d in (h, -h))
        theta = rod.angle(s).function(z, p)[0]
        lam, mu, q = z[0, -2], z[0, -1], p[0, 2]
        load = q * s * np.cos(theta) + lam * np.sin(theta) - mu * np.cos(theta)
        assert (above - below) / (2 * h) == pytest.approx(-4 * np.pi**2 * load, abs=1e-5)


@pytest.mark.parametrize(("elements", "degree"), [(6, 9), (12, 6), (5, 7), (24, 3)])
def test_largest_curvature_is_that_of_a_fine_sampling(elements, degree):
    """Brute force: κ at 4000 points. 1e-5: sampling of a maximum."""
    rod = Rod("left-half", elements=elements, degree=degree)
    z, p = many_equilibria(rod)
    brute = np.abs(rod.fields(z, p, np.linspace(0, 1, 4001))[:, :, 1]).max(axis=1)
    found, place = rod.largest_curvature(z, p)
    assert (found >= brute * (1 - 1e-7)).all()  # the mesh's own error, from vertex to vertex
    np.testing.assert_allclose(found, brute, rtol=1e-5)
    for lane in range(len(z)):
        there = rod.curvature(min(max(place[lane], 0.0), 1.0)).function(z, p)[lane]
        assert abs(there) == pytest.approx(found[lane], rel=1e-6)


def test_recovery_of_a_lane_does_not_depend_on_the_lanes_beside_it():
    """Same operations in the same order: bit for bit, whatever the batch."""
    rod = Rod()
    z, p = many_equilibria(rod)
    s = np.linspace(0.01, 0.98, 7)
    fields, (largest, place) = rod.fields(z, p, s), rod.largest_curvature(z, p)
    order = np.random.default_rng(1).permutation(len(z))
    for at in (order, order[:11], order[3:4]):
        np.testing.assert_array_equal(rod.fields(z[at], p[at], s), fields[at])
        np.testing.assert_array_equal(rod.largest_curvature(z[at], p[at])[0], largest[at])
        np.testing.assert_array_equal(rod.largest_curvature(z[at], p[at])[1], place[at])


def test_largest_curvature_at_an_end_is_found():
    """A skewed natural arch bends most at an end: compare κ(0), κ(1)."""
    rod = Rod()
    state = rod.natural_state(Theta=1.0, Delta=0.3)
    ends = max(abs(rod.curvature(s)(state)) for s in (0.0, 1.0))
    assert rod.max_curvature(state) == pytest.approx(ends, rel=1e-10)


def test_heights_converge_spectrally_with_the_degree():
    """Error of y(1/3) against degree 16 falls by more than ten for each degree, to round-off."""
    reference = Rod(elements=4, degree=16)
    exact = reference.height(1 / 3).function(*loaded(reference))[0]
    errors = []
    for degree in (3, 4, 5, 6, 7):
        rod = Rod(elements=4, degree=degree)
        errors.append(abs(rod.height(1 / 3).function(*loaded(rod))[0] - exact))
    assert errors[-1] < 1e-8
    assert (errors[-1] / errors[0]) ** (1 / 4) < 0.1


@pytest.mark.parametrize(("degree", "coarse"), [(3, 12), (4, 8)])
def test_end_forces_converge_with_twice_the_degree(degree, coarse):
    """Gauss–Lobatto elements: energy-like quantities have order 2N; observed within 0.5."""
    reference = Rod(elements=24, degree=12)
    exact = loaded(reference)[0][0, -2]
    errors = []
    for elements in (coarse, 2 * coarse):
        rod = Rod(elements=elements, degree=degree)
        errors.append(abs(loaded(rod)[0][0, -2] - exact))
    assert np.log2(errors[0] / errors[1]) > 2 * degree - 0.5


@pytest.mark.parametrize(("elements", "degree"), [(4, 5), (6, 6), (6, 9), (12, 6)])
def test_error_estimate_bounds_the_error_of_curvature_and_height(elements, degree):
    """Against 24 elements of degree 12; no more than 30 times too large."""
    rod, reference = Rod(elements=elements, degree=degree), Rod(elements=24, degree=12)
    s = np.linspace(0, 1, 40)
    (z, p), (fine, _) = loaded(rod), loaded(reference)
    error = np.abs(rod.fields(z, p, s) - reference.fields(fine, p, s))[:, :, [1, 3]].max()
    peak = np.abs(rod.largest_curvature(z, p)[0] - reference.largest_curvature(fine, p)[0])[0]
    estimate = rod.error_estimate(z, p)[0]
    assert max(error, peak) < estimate + 1e-11
    assert estimate < 30 * max(error, peak) + 1e-11


def test_mirror_maps_equilibria_to_equilibria():
    """Δ → −Δ under the symmetric load. 1e-13: the residual of the image."""
    rod = Rod()
    z, p = loaded(rod)
    image_z, image_p = rod.symmetries()[0].apply(z, p)
    assert np.abs(rod.residual(z, p)).max() < 1e-12
    assert np.abs(rod.residual(image_z, image_p)).max() < 1e-12
    for s in (0.2, 0.7):
        here = rod.height(s).function(z, p)
        there = rod.height(1 - s).function(image_z, image_p)
        np.testing.assert_allclose(there, here, atol=1e-13)
    np.testing.assert_allclose(rod.energy(image_z, image_p), rod.energy(z, p), rtol=1e-13)


def test_work_of_the_load_is_the_moment_of_the_height():
    """dE/dq at an equilibrium is ∫ Q y ds (virtual work), Q = 1. 1e-9: resolution."""
    rod = Rod()
    z, p = loaded(rod)
    s = rod.mesh.nodes
    heights = rod.fields(z, p, s)[0, :, 3]
    assert rod.effort(z, p)[0, 2] == pytest.approx(heights @ rod.mesh.weights, abs=1e-9)


@pytest.mark.parametrize("q", [0.0, 1.5])
def test_margin_is_the_smallest_constrained_eigenvalue(q):
    """Oracle: scipy's eigh on a basis of the constraints' null space, mass matrix. 1e-8."""
    rod = Rod(elements=6, degree=5)
    z, p = loaded(rod, q=q)
    full = rod.mechanics.layout.dense(*rod.mechanics.kkt(z, p))[0]
    null = scipy.linalg.null_space(full[-2:, :-2])
    hessian, mass = null.T @ full[:-2, :-2] @ null, null.T @ np.diag(rod.mass) @ null
    values = scipy.linalg.eigh(hessian, mass, eigvals_only=True)
    state = State(rod, z[0], p[0])
    assert state.margin == pytest.approx(values[0], rel=1e-8)
    assert state.index == (values < 0).sum()


def test_margin_of_an_unstable_state_is_negative():
    """An upright arch under twice the load of its pitchfork at q = 4.244 (PHYSICS §5)."""
    rod = Rod()
    z, p = loaded(rod, Delta=0.0, q=5.5)
    states = States(rod, z, p)
    assert states.index[0] == 1
    assert states.margin[0] < 0.0


def test_a_shape_beyond_the_mesh_is_not_resolved():
    rod = Rod(elements=6, degree=6)
    z, p = loaded(rod)
    assert rod.resolved(z, p)[0]
    rough = z.copy()
    rough[:, :-2] += 0.1 * (-1.0) ** np.arange(rod.unknowns)
    assert not rod.resolved(rough, p)[0]


def test_states_are_read_by_name_number_and_mask():
    rod = Rod(elements=4, degree=4)
    states, found = rod.natural_states(np.array([[0.9, d, 0.0, 0.84] for d in (0.0, 0.1, 0.2)]))
    assert found.all()
    np.testing.assert_array_equal(states["Delta"], [0.0, 0.1, 0.2])
    assert states[1]["Delta"] == 0.1
    assert len(states[states["Delta"] > 0.05]) == 2
    assert len(states.stable) == 3
    assert [round(state["Delta"], 6) for state in states] == [0.0, 0.1, 0.2]


def test_states_of_another_resolution_are_refused():
    """Kernels read what they are told to: widths are checked wherever they are given."""
    rod, other = Rod(elements=4, degree=4), Rod(elements=6, degree=5)
    state = other.natural_state(Theta=0.9)
    z, p = state.z[None], state.p[None]
    one, none = np.ones(1), np.zeros(1)
    calls = [
        lambda: rod.advance(z, p, p, z, one, none),
        lambda: rod.residual(z, p),
        lambda: rod.solve(z, p, np.zeros((1, 1, rod.size))),
        lambda: rod.parameter_derivative(z, p, p),
        lambda: rod.second_derivative(z, p, (z, p), (z, p)),
        lambda: rod.largest_curvature(z, p),
        lambda: rod.fields(z, p, np.array([0.5])),
        lambda: rod.effort(z, p),
        lambda: rod.energy(z, p),
        lambda: rod.max_curvature.function(z, p),
        lambda: rod.resolved(z, p),
    ]
    for call in calls:
        with pytest.raises(InputError, match=r"`z` must have shape \(1, 17\); got \(1, 31\)"):
            call()
    good = rod.natural_state(Theta=0.9).z[None]
    with pytest.raises(InputError, match=r"`p` must have shape \(1, 4\); got \(1, 3\)"):
        rod.residual(good, p[:, :3])
    with unchecked(), pytest.raises(InputError, match=r"shape \(1, 4\); got \(2, 4\)"):
        rod.residual(good, np.tile(p, (2, 1)))
    with pytest.raises(InputError, match="`rhs` must have"):
        rod.solve(good, p, np.zeros((1, 1, 30)))
