"""Random polynomial energies of one unknown over two parameters: states, folds and cusps."""

import numpy as np
from numpy.polynomial import Polynomial
from scipy.optimize import brentq

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


def energy_over(energy, point):
    """The polynomial in x over a point (p, r)."""
    return Polynomial(energy[0] + point @ np.array(energy[1:]))


def roots_of(polynomial):
    """Real roots in order."""
    roots = polynomial.roots()
    return np.sort(roots[np.abs(roots.imag) < 1e-10].real)


def minima(energy, point):
    """Places and values of the minima over a point, from the roots of E'."""
    polynomial = energy_over(energy, point)
    x = roots_of(polynomial.deriv())
    x = x[polynomial.deriv(2)(x) > 0.0]
    return x, polynomial(x)


def folds_at(energy, x):
    """Parameters over which x is a double root of E': E' = E'' = 0 is linear in them."""
    rows = [[Polynomial(each).deriv(k)(x) for each in energy] for k in (1, 2)]
    rows = np.array(rows)
    return np.linalg.solve(rows[:, 1:], -rows[:, 0])


def cusps_of(energy):
    """Places and parameters (x, p, r) of the cusps inside the box."""
    rows = [[Polynomial(each).deriv(k) for each in energy] for k in (1, 2, 3)]

    def bend(x):
        return np.linalg.det([[each(x) for each in row] for row in rows])

    places = np.linspace(-4.003, 3.997, 1001)
    values = np.array([bend(x) for x in places])
    found = [
        brentq(bend, *places[k : k + 2], xtol=1e-14)
        for k in np.flatnonzero(values[:-1] * values[1:] < 0.0)
    ]
    cusps = [np.array([x, *folds_at(energy, x)]) for x in found]
    return [each for each in cusps if (np.abs(each[1:]) < 0.98).all()]


def structure_of(energy):
    """The structure with an energy; p is an actuator, r a load."""
    text = [" + ".join(f"({v!r})*x**{k}" for k, v in enumerate(e.tolist())) for e in energy]
    x, values = minima(energy, np.zeros(2))
    return em.EnergyStructure(
        f"{text[0]} + p*({text[1]}) + r*({text[2]})",
        [em.Unknown("x", float(x[values.argmin()]), (-4.0, 4.0))],
        [em.Parameter("p", "1", 1.0, "actuator", 0.0), em.Parameter("r", "1", 1.0, "load", 0.0)],
    )


def set_of(energy, intervals=12):
    """Its equilibrium set over p and r from −1 to 1."""
    structure = structure_of(energy)
    with unchecked():
        box = em.Box(p=(-1.0, 1.0), r=(-1.0, 1.0))
        return em.equilibrium_set(structure, box, intervals=(intervals, intervals))
