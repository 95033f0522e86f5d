"""Reduction by the least energy against the roots of polynomials, on coarse sets."""

import numpy as np
import pytest

import equimorph as em
from typecheck import unchecked


def random_energy(seed):
    """E = Σ cₖ xᵏ + p Σ aₖ xᵏ + r Σ bₖ xᵏ of degree 4 or 6 as coefficients of 1, p and r."""
    generator = np.random.default_rng(seed)
    degree = int(generator.choice([4, 6]))
    c, a, b = np.zeros((3, degree + 1))
    spread = np.array([0.5, 1.0, 0.6, 0.5, 0.3])[: degree - 1]
    c[1:degree], c[degree] = generator.normal(size=degree - 1) * spread, 0.25
    a[1:4] = generator.normal(size=3) * [1.0, 0.6, 0.2]
    b[1:4] = generator.normal(size=3) * [1.0, 0.3, 0.2]
    return c, a, b


def minima(energy, point):
    """Places and values of the minima over a point, from the roots of E'."""
    polynomial = np.polynomial.Polynomial(energy[0] + point @ np.array(energy[1:]))
    x = polynomial.deriv().roots()
    x = x[np.abs(x.imag) < 1e-9].real
    x = x[polynomial.deriv(2)(x) > 0.0]
    return x, polynomial(x)


def lowest_of(energy):
    """The reduction of its set over 12 x 12 intervals."""
    text = [" + ".join(f"({v!r})*x**{k}" for k, v in enumerate(e.tolist())) for e in energy]
    x, values = minima(energy, np.zeros(2))
    structure = em.EnergyStructure(
        f"{text[0]} + p*({text[1]}) + r*({text[2]})",
        [em.Unknown("x", float(x[values.argmin()]), (-4.0, 4.0))],
        [em.Parameter("p", "1", 1.0, "actuator", 0.0), em.Parameter("r", "1", 1.0, "load", 0.0)],
    )
    box = em.Box(p=(-1.0, 1.0), r=(-1.0, 1.0))
    with unchecked():
        eset = em.equilibrium_set(structure, box, intervals=(12, 12))
        return em.reduce(eset, prefer=em.charts.lowest(structure.descriptor("energy")))


@pytest.mark.parametrize("seed", [3, 5, 30])
def test_barriers_of_least_energy_are_ties_up_to_the_cusp(seed):
    """Where a chord of the mesh passed a cusp on its wrong side, a sliver of a fold was preferred.

    Barriers named "fold" stood there, and states beside them were not those of least energy.
    """
    energy = random_energy(seed)
    chart = lowest_of(energy)
    assert [barrier.kind for barrier in chart.barriers] == ["tie"]
    assert chart.lost == 0
    (barrier,) = chart.barriers
    for point in barrier.points[barrier.jump > 0.01]:
        low, high = np.sort(minima(energy, point)[1])[:2]
        assert high - low < 1e-12
    generator = np.random.default_rng(seed)
    near = barrier.points[generator.integers(0, len(barrier.points), 300)]
    at = np.concatenate([near + step * generator.normal(size=near.shape) for step in (1e-2, 1e-4)])
    at = at[(np.abs(at) < 1.0).all(axis=1)]
    with unchecked():
        found = chart.state(at)
    for point, z in zip(at, found.states.z[:, 0], strict=True):
        x, values = minima(energy, point)
        if len(x) == 1 or np.diff(np.sort(values))[0] > 1e-10:
            assert z == pytest.approx(x[values.argmin()], abs=1e-6)
