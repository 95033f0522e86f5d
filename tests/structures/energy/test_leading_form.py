"""Polynomial energies that grow at infinity."""

import numpy as np
import pytest

import equimorph as em
from equimorph.errors import InputError
from equimorph.structures.energy.soundness import positive_definite
from typecheck import unchecked


def growth(energy, **options):
    unknowns = [em.Unknown(name, 0.0) for name in ("x", "y")]
    parameter = em.Parameter("a", "1", 1.0, "load", 0.0)
    return em.EnergyStructure(energy, unknowns, [parameter], **options).growth(np.array([0.3]))


@pytest.mark.parametrize(
    ("energy", "grows"),
    [
        ("x**4 + y**4 - 3*x*y - a*x", True),
        ("(x**2 + y**2 - 1)**2 + a*x", True),
        ("(x - y)**4 + x**2 + y**2 - a*x", False),  # along x = y it grows, but not with power 4
        ("x**4 - y**4 + y**2 + a*x", False),
        ("x**3 + y**2 + x**2 - a*x", False),
        ("x**4 + 3*x**2*y**2 + y**4 - x**3*y*7/2 + a*x", None),
        ("cos(x) + x**2 + y**2 - a*x", False),
    ],
)
def test_growth_is_shown_by_the_leading_form(energy, grows):
    """Forms by hand; one in the middle by its values on the circle."""
    if grows is None:
        angle = np.linspace(0.0, 2.0 * np.pi, 10001)
        x, y = np.cos(angle), np.sin(angle)
        grows = bool((x**4 + 3 * x**2 * y**2 + y**4 - 3.5 * x**3 * y).min() > 0.0)
    assert growth(energy).applies == grows


@pytest.mark.parametrize("seed", range(20))
def test_quadratic_forms_are_definite_if_their_eigenvalues_are_positive(seed):
    generator = np.random.default_rng(seed)
    n = int(generator.integers(1, 5))
    matrix = generator.normal(size=(n, n))
    matrix = matrix @ matrix.T + (0.3 if seed % 2 else -0.3) * np.eye(n)
    unit = np.eye(n, dtype=int)
    form = {}
    for i in range(n):
        for j in range(n):
            powers = tuple((unit[i] + unit[j]).tolist())
            form[powers] = form.get(powers, 0.0) + matrix[i, j]
    assert positive_definite(form, n) == bool(np.linalg.eigvalsh(matrix).min() > 0.0)


def test_trusses_grow_by_green_strain_if_supported():
    joints, bars = {"A": (0, 0), "B": (1, 0.3), "C": (2, 0)}, [("A", "B"), ("B", "C")]
    held = {"A": "xy", "C": "xy"}
    p = np.zeros(1)
    green, engineering = (
        em.Truss(joints, bars, held, {"F": {"B": (0, -1)}}, strain=strain).growth(p)
        for strain in ("green", "engineering")
    )
    assert green.applies
    assert not engineering.applies
    assert "kinks" in engineering.reason


def test_promises_are_checked():
    wrong = pytest.raises(InputError, match="`coercive` must be True or False; got 1")
    with unchecked(), wrong:
        growth("x**4 + y**4 - a*x", coercive=1)
    with pytest.raises(InputError, match="`coercive` must be False for energies with constraints"):
        growth("x**4 + y**4 - a*x", coercive=True, constraints=["x - y"])
    assert growth("cosh(x) + y**2 - a*x", coercive=True).promised
