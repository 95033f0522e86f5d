"""Polynomial structures whose equilibrium sets over two parameters are surfaces known by name.

Each energy is given through its force F = ∂E/∂x.
"""

import numpy as np

from equimorph.structures import Symmetry
from oracles.polynomial import Polynomial, Sum


class Mirrored(Polynomial):
    """Structure with F(−x; a, −b) = −F(x; a, b), which it declares."""

    def symmetries(self) -> tuple[Symmetry, ...]:
        signs = np.array([1.0, -1.0])
        return (Symmetry("mirror", lambda z, p: (-z, p * signs), signs),)


def integral(force: Sum) -> Sum:
    """Energy of a force, integrated over the first variable."""
    return Sum({(e[0] + 1, *e[1:]): factor / (e[0] + 1) for e, factor in force.terms.items()})


def cusp() -> Polynomial:
    """x³ + a x + b: the graph b(x, a), a disc; folds a = −3x², b = 2x³, one curve with a cusp."""
    return Mirrored(lambda x, a, b: integral(x**3 + a * x + b), 1, ("a", "b"))


def swallowtail() -> Polynomial:
    """x⁴ + a x² + b x + c: for fixed a < 0 the graph c(x, b); one fold curve with two cusps."""
    return Polynomial(lambda x, a, b, c: integral(x**4 + a * x**2 + b * x + c), 1, ("a", "b", "c"))


def butterfly(tilt: float = 0.0, skew: float = 0.0) -> Polynomial:
    """x⁵ + a x³ + skew b x² + b x + c + tilt a: pitchforks that turn subcritical, unfolded by c."""
    return Polynomial(
        lambda x, a, b, c: integral(x**5 + a * x**3 + b * (x + skew * x**2) + c + tilt * a),
        1,
        ("a", "b", "c"),
    )


def three_sheets() -> Polynomial:
    """x³ − 9x + (a + b)/2: three sheets that never meet for |a|, |b| < 10."""
    return Polynomial(lambda x, a, b: integral(x**3 - 9.0 * x + 0.5 * a + 0.5 * b), 1, ("a", "b"))


def sphere() -> Polynomial:
    """x² + a² + b² = 1: closed, folded along its equator."""
    return Polynomial(lambda x, a, b: integral(x**2 + a**2 + b**2 - 1.0), 1, ("a", "b"))


def torus(tilt: float = 0.0) -> Polynomial:
    """(r² + R² − ρ²)² = 4R²(a² + b²), R = 1, ρ = 0.4, turned about the b axis by `tilt`."""
    cosine, sine = float(np.cos(tilt)), float(np.sin(tilt))

    def energy(x: Sum, a: Sum, b: Sum) -> Sum:
        flat = (sine * x + cosine * a) ** 2 + b**2
        height = cosine * x - sine * a
        return integral((flat + height**2 + 1.0 - 0.4**2) ** 2 - 4.0 * flat)

    return Polynomial(energy, 1, ("a", "b"))


def crossing_sheets() -> Polynomial:
    """x (x² + b x + a): the sheet x = 0 crosses another along a = 0, where that folds at b = 0."""
    return Polynomial(lambda x, a, b: integral(x**3 + b * x**2 + a * x), 1, ("a", "b"))


def pitchforks(cubic: float, slant: float) -> Polynomial:
    """x (cubic·x² − a − slant·b): x = 0 crosses a parabolic cylinder along a + slant·b = 0."""
    return Polynomial(lambda x, a, b: integral(cubic * x**3 - (a + slant * b) * x), 1, ("a", "b"))


def returning(turn: float, slant: float, bend: float) -> Polynomial:
    """x (x⁴ − 2 turn x² − a − slant·b − bend·b²): side branches that fold back at x² = turn."""
    return Polynomial(
        lambda x, a, b: integral(x**5 - 2.0 * turn * x**3 - (a + slant * b + bend * b**2) * x),
        1,
        ("a", "b"),
    )


def transcriticals(skew: float, slant: float) -> Polynomial:
    """x (skew·x − a − slant·b): two planes that exchange their stability."""
    return Polynomial(lambda x, a, b: integral(skew * x**2 - (a + slant * b) * x), 1, ("a", "b"))


def tricritical(cubic: float) -> Polynomial:
    """x (x⁴ + cubic·b x² − a): pitchforks at a = 0, subcritical and folded where cubic·b < 0.

    The folds are a = −(cubic·b)²/4, x² = −cubic·b/2.
    """
    return Polynomial(lambda x, a, b: integral(x**5 + cubic * b * x**3 - a * x), 1, ("a", "b"))


def tricritical_beside_cusp(turn: float) -> Polynomial:
    """x (y³ − turn y² + b y − a) with y = x²: folds a = y³ − turn y² + b y, b = 2 turn y − 3 y².

    They leave the pitchforks a = 0 at b = 0 and turn back at the cusp y = turn/3.
    """
    return Polynomial(
        lambda x, a, b: integral(x**7 - turn * x**5 + b * x**3 - a * x), 1, ("a", "b")
    )


def hilltop(k: float, bend: float = 0.0, soft: float = 1.0) -> Polynomial:
    """s² + (k/soft) x² (1 + 3 bend s²) = a, x (s + bend s³ − b) = 0: the fold of the sheet x = 0.

    It passes its pitchforks, b = s + bend s³, a = s², at b = 0. The other sheet has no fold. The
    eigenvalue that vanishes on the fold is 2 soft s.
    """
    return Polynomial(
        lambda s, x, a, b: soft * (s**3 * (1 / 3) - a * s) + k * x**2 * (s + bend * s**3 - b),
        2,
        ("a", "b"),
    )


def hilltop_beside_tricritical(c: float) -> Polynomial:
    """y² = b on the sheet x = 0, crossed by b = y² + c x²/2 with x² = −a − c y at a = −c y.

    The fold of the first sheet passes the crossing at y = 0, where two eigenvalues vanish; that of
    the second one, y = c²/4, ends there.
    """
    return Polynomial(
        lambda y, x, a, b: y**3 * (1 / 3) - b * y + x**2 * (a + c * y) * 0.5 + x**4 * 0.25,
        2,
        ("a", "b"),
    )


def three_planes() -> Polynomial:
    """x (x − a) (x − b): three sheets that all meet in one point, with three crossings."""
    return Polynomial(lambda x, a, b: integral(x * (x - a) * (x - b)), 1, ("a", "b"))
