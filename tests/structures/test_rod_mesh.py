"""Elements, quadrature and loads of the rod."""

import numpy as np
import pytest

from equimorph.errors import InputError
from equimorph.structures import Rod
from equimorph.structures.rod.discretisation import mesh_with_kinks, reference_element
from equimorph.structures.rod.profiles import load_shape

DEGREES = [3, 4, 6, 8, 12, 16]


@pytest.mark.parametrize("degree", DEGREES)
def test_quadrature_is_exact_up_to_twice_the_degree_less_one(degree):
    """Gauss–Lobatto: ∫₀¹ tᵏ = 1/(k + 1), k ≤ 2N − 1. 1e-14: weights to round-off."""
    ref = reference_element(degree)
    powers = np.arange(2 * degree)
    integrals = (ref.nodes[:, None] ** powers).T @ ref.weights
    np.testing.assert_allclose(integrals, 1.0 / (powers + 1.0), atol=2e-14)
    beyond = ref.nodes ** (2 * degree) @ ref.weights - 1.0 / (2 * degree + 1.0)
    assert beyond > 0.0 if degree < 12 else True


@pytest.mark.parametrize("degree", DEGREES)
def test_reference_matrices_are_exact_on_polynomials_of_the_degree(degree):
    """f = P_N: derivative and integral by numpy's Legendre series. 1e-11: N² growth of slopes."""
    ref, top = reference_element(degree), np.zeros(degree + 1)
    top[-1] = 1.0
    x = 2 * ref.nodes - 1
    values = np.polynomial.legendre.legval(x, top)
    slope = 2 * np.polynomial.legendre.legval(x, np.polynomial.legendre.legder(top))
    series = np.polynomial.legendre.legint(top, lbnd=-1)
    np.testing.assert_allclose(ref.derivative @ values, slope, atol=1e-11)
    np.testing.assert_allclose(
        ref.integral @ values, np.polynomial.legendre.legval(x, series) / 2, atol=1e-14
    )
    np.testing.assert_allclose(ref.to_legendre @ values, top, atol=1e-13)


def test_interpolation_and_integration_are_exact_for_piecewise_polynomials():
    """s⁵ on degree 5 at points that include element ends. 1e-14: round-off."""
    mesh = mesh_with_kinks(np.array([0.3]), 4, 5)
    s = np.concatenate([np.random.default_rng(0).uniform(0, 1, 30), mesh.breaks])
    np.testing.assert_allclose(mesh.interpolation(s) @ mesh.nodes**5, s**5, atol=1e-14)
    np.testing.assert_allclose(mesh.integration(s) @ mesh.nodes**5, s**6 / 6, atol=1e-14)


def test_stiffness_is_the_energy_of_the_slope():
    """∫ (3s²)² = 9/5 for θ = s³. 1e-13: round-off."""
    mesh = mesh_with_kinks(np.array([]), 5, 4)
    total = sum(
        mesh.nodes[at] ** 3 @ k @ mesh.nodes[at] ** 3
        for at, k in zip(mesh.element_nodes, mesh.stiffness, strict=True)
    )
    assert total == pytest.approx(9 / 5, rel=1e-13)


def test_weights_sum_to_the_length():
    assert mesh_with_kinks(np.array([0.37]), 7, 6).weights.sum() == pytest.approx(1, rel=1e-14)


@pytest.mark.parametrize("kinks", [[0.5], [0.1, 0.37], [1 / 3, 2 / 3]])
def test_element_ends_meet_every_kink(kinks):
    mesh = mesh_with_kinks(np.array(kinks), 12, 8)
    for kink in kinks:
        assert np.abs(mesh.breaks - kink).min() < 1e-14
    assert mesh.lengths.max() < 1.0001 / 12
    assert mesh.lengths.min() > 0.0


@pytest.mark.parametrize(
    ("load", "rho"),
    [
        ("uniform", lambda s: s),
        ("left-half", lambda s: np.minimum(2 * s, 1.0)),
        (
            [[0, 0.0], [0.25, 4.0], [0.25, -1.0], [1, -1.0]],
            lambda s: np.where(s < 0.25, 8 * s**2, 0.5 - (s - 0.25)),
        ),
        (lambda s: np.cos(3 * s), lambda s: np.sin(3 * s) / 3),
    ],
    ids=["uniform", "left half", "table with a jump", "callable"],
)
def test_cumulated_load_is_exact(load, rho):
    """Closed forms of ∫₀ˢ Q. 1e-14: round-off of sums."""
    rod = Rod(load)
    np.testing.assert_allclose(
        rod.mechanics.rho, rho(rod.mesh.nodes[rod.mesh.element_nodes]), atol=2e-14
    )


def test_a_callable_with_declared_kinks_is_integrated_exactly():
    """Q = |s − 0.3|: ρ quadratic on either side. 1e-14: round-off."""
    rod = Rod(lambda s: np.abs(s - 0.3), kinks=[0.3])
    s = rod.mesh.nodes[rod.mesh.element_nodes]
    exact = np.where(s < 0.3, 0.3 * s - s**2 / 2, 0.045 + (s - 0.3) ** 2 / 2)
    np.testing.assert_allclose(rod.mechanics.rho, exact, atol=2e-14)


def test_built_in_shapes_integrate_to_one():
    for name in ("uniform", "left-half"):
        assert Rod(name).mechanics.rho[-1, -1] == pytest.approx(1.0, rel=1e-14)


def test_a_table_written_as_the_uniform_load_is_the_uniform_load():
    s = np.linspace(0, 1, 50)
    table = load_shape([[0.0, 1.0], [0.4, 1.0], [1.0, 1.0]])
    np.testing.assert_allclose(table.density(s), 1.0, rtol=1e-15)


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        ({"load": "triangle"}, "`load` must be 'uniform', 'left-half', a table"),
        ({"load": [[0, 1], [0.5, 2]]}, "`load` must be a table with s rising from 0 to 1"),
        ({"load": [[0, 1], [0.7, 1], [0.5, 1], [1, 1]]}, "rising from 0 to 1"),
        ({"load": [[0, 1], [1, np.nan]]}, "`load` must be .* of finite numbers"),
        ({"load": [[0, 1], [1, np.inf]]}, "`load` must be .* of finite numbers"),
        ({"load": [[0, "a"], [1, 2]]}, "`load` must be .* of finite numbers"),
        ({"load": [[0, 1, 2], [1, 2, 3]]}, r"`load` must be a table of rows \[s, Q\]"),
        ({"load": lambda s: np.where(s > 0.9, np.nan, 1.0)}, "`load` must be finite"),
        (
            {"load": lambda s: s, "kinks": [1.5]},
            "`kinks` must be a list of numbers between 0 and 1",
        ),
        ({"span": 1.0}, "`span` must lie between 0 and 1"),
        ({"span": 0.0}, "`span` must lie between 0 and 1"),
        ({"span": np.nan}, "`span` must be a finite number"),
        ({"elements": 1}, "`elements` must be a whole number from 2 to 10000; got 1"),
        ({"degree": 2}, "`degree` must be a whole number from 3 to 16; got 2"),
        ({"degree": 17}, "`degree` must be a whole number from 3 to 16; got 17"),
    ],
)
def test_bad_input_is_refused(arguments, text):
    with pytest.raises(InputError, match=text):
        Rod(**arguments)


@pytest.mark.parametrize(
    ("call", "text"),
    [
        (lambda rod: rod.height(1.2), "`s` must be a share of the length, from 0 to 1; got 1.2"),
        (
            lambda rod: rod.curvature(np.nan),
            "`s` must be a share of the length, from 0 to 1; got nan",
        ),
        (lambda rod: rod.support_force("nu"), "`component` must be 'x', 'y', 'lambda' or 'mu'"),
        (lambda rod: rod.end_moment(2), "`end` must be 0 or 1; got 2"),
        (lambda rod: rod.descriptor("colour(1)"), "`descriptor` must be one of height"),
        (lambda rod: rod.descriptor("height"), "`descriptor` must be one of height"),
        (lambda rod: rod.descriptor("height(1/0)"), "`s` must be a number or a fraction"),
        (lambda rod: rod.natural_state(Theta=1.0, q=2.0), "`q` must be 0 in the natural state"),
        (lambda rod: rod.natural_state(Theta=-1.0), "Choose Theta > 0"),
        (lambda rod: rod.natural_state(), "`Theta` must be given"),
        (lambda rod: rod.natural_state(Teta=1.0), "`Teta` must be a parameter"),
        (lambda rod: Rod(np.cos).identity(), "`load` must be a name or a table"),
    ],
)
def test_meaningless_questions_are_refused(call, text):
    with pytest.raises(InputError, match=text):
        call(Rod(elements=4, degree=4))
