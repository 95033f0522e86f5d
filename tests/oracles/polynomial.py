"""Structures with polynomial energies, whose branches are known in closed form."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from equimorph.linalg import solve_bordered
from equimorph.model import Descriptor, Parameter
from equimorph.structures import State, Structure


@dataclass(frozen=True)
class Sum:
    """Polynomial in several variables: coefficients by exponents."""

    terms: Mapping[tuple[int, ...], float]

    def __add__(self, other: "Sum | float") -> "Sum":
        terms = dict(self.terms)
        for exponents, factor in self._other(other).items():
            terms[exponents] = terms.get(exponents, 0.0) + factor
        return Sum(terms)

    def __mul__(self, other: "Sum | float") -> "Sum":
        total = Sum({})
        for a, x in self.terms.items():
            for b, y in self._other(other).items():
                total = total + Sum({tuple(i + j for i, j in zip(a, b, strict=True)): x * y})
        return total

    def _other(self, other: "Sum | float") -> Mapping[tuple[int, ...], float]:
        if isinstance(other, Sum):
            return other.terms
        size = len(next(iter(self.terms)))
        return {(0,) * size: float(other)}

    def __sub__(self, other: "Sum | float") -> "Sum":
        return self + other * -1.0

    def __pow__(self, n: int) -> "Sum":
        return self if n == 1 else self * self ** (n - 1)

    __radd__, __rmul__ = __add__, __mul__

    def slope(self, i: int) -> "Sum":
        """Derivative by variable i."""
        terms = {}
        for exponents, factor in self.terms.items():
            if exponents[i]:
                lower = tuple(e - (j == i) for j, e in enumerate(exponents))
                terms[lower] = factor * exponents[i]
        return Sum(terms)


class Table:
    """Many polynomials in the same variables, evaluated together."""

    def __init__(self, sums: list[Sum], *shape: int) -> None:
        exponents = sorted({exponents for each in sums for exponents in each.terms})
        self.exponents = np.array(exponents or [(0,) * 1])
        self.highest = int(self.exponents.max(initial=0))
        self.factors = np.zeros((len(self.exponents), len(sums)))
        for i, each in enumerate(sums):
            for term, factor in each.terms.items():
                self.factors[exponents.index(term), i] = factor
        self.shape = shape
        self.variables = np.flatnonzero(self.exponents.any(axis=0))

    def __call__(self, z: np.ndarray, p: np.ndarray) -> np.ndarray:
        x = np.concatenate([z, p], axis=1).T
        powers = np.ones((self.highest + 1, *x.shape))
        for k in range(self.highest):  # products are much cheaper than x ** exponents
            np.multiply(powers[k], x, out=powers[k + 1])
        monomials = np.ones((len(self.exponents), x.shape[1]))
        for i in self.variables:
            monomials *= powers[self.exponents[:, i], i]
        return (monomials.T @ self.factors).reshape(-1, *self.shape)


class Polynomial(Structure):
    """Structure with energy ``E(u; p)`` and perhaps a constraint ``c(u; p) = 0``.

    Both are functions of all unknowns, then all parameters. Metric: the unit matrix.
    """

    kind = "polynomial"

    def __init__(
        self,
        energy: Callable[..., Sum],
        unknowns: int,
        parameters: tuple[str, ...],
        constraint: Callable[..., Sum] | None = None,
    ) -> None:
        self.unknowns, self.constraints = unknowns, int(constraint is not None)
        self.parameters = tuple(Parameter(name, "1", 1.0, "load", 0.0) for name in parameters)
        self.mass = np.ones(unknowns)
        count = self.size + len(parameters)
        x = [Sum({tuple(int(i == j) for j in range(count)): 1.0}) for i in range(count)]
        given = (*x[:unknowns], *x[self.size :])
        self.potential = energy(*given)
        self.lagrangian = self.potential
        if constraint is not None:
            self.lagrangian = self.potential + x[unknowns] * constraint(*given)
        n = self.size
        first = [self.lagrangian.slope(i) for i in range(count)]
        second = [f.slope(j) for f in first[:n] for j in range(count)]
        third = [g.slope(k) for g in second for k in range(count)]
        self.first, self.second = Table(first, count), Table(second, n, count)
        self.third, self.value = Table(third, n, count, count), Table([self.potential])

    def identity(self) -> dict[str, Any]:
        return {"kind": self.kind}

    def energy(self, z, p):
        return self.value(z, p)

    def residual(self, z, p):
        return self.first(z, p)[:, : self.size].copy()

    def parameter_derivative(self, z, p, dp):
        return np.einsum("lij,lj->li", self.second(z, p)[:, :, self.size :], dp)

    def second_derivative(self, z, p, v, w):
        v, w = np.concatenate(v, axis=1), np.concatenate(w, axis=1)
        return np.einsum("lijk,lj,lk->li", self.third(z, p), v, w)

    def effort(self, z, p):
        return self.first(z, p)[:, self.size :].copy()

    def solve(self, z, p, rhs, border=None, shift=None):
        n = self.size
        matrix = self.second(z, p)[:, :, :n].copy()
        if shift is not None:
            at = np.arange(self.unknowns)
            matrix[:, at, at] -= shift[:, None]
        if border is None:
            none = np.zeros((len(z), 0, n))
            border = (none, none, np.zeros((len(z), 0, 0)))
        return solve_bordered(matrix, *border, rhs)

    def natural(self, p):
        return np.zeros((len(p), self.size)), np.ones(len(p), bool)

    def unloaded(self):
        return {}

    def sample(self, p, generator):
        return generator.uniform(-3.0, 3.0, size=(len(p), self.size))

    def resolved(self, z, p):
        return np.ones(len(z), bool)

    def shape(self, z, p, s=None):
        return np.zeros((len(z), 2, 2))

    def descriptor(self, text: str) -> Descriptor:
        """Unknown number `text`."""
        return Descriptor(f"u{text}", "1", lambda z, p: z[:, int(text)].copy())

    def state(self, *z: float, **p: float) -> State:
        """State at unknowns (and multiplier) z."""
        values = np.array([float(p.get(parameter.name, 0.0)) for parameter in self.parameters])
        return State(self, np.array(z, dtype=float), values)


def fold_form(c: float = 1.0) -> Polynomial:
    """x² = a: E = c (x³/3 − a x), stable at x = +√a."""
    return Polynomial(lambda x, a: c * (x**3 * (1 / 3) - a * x), 1, ("a",))


def pitchfork_form(sign: float, c: float = 1.0) -> Polynomial:
    """±x³ − a x = b: supercritical for sign = +1, x = 0 stable for a < 0 at b = 0."""
    return Polynomial(
        lambda x, a, b: c * (x**4 * (0.25 * sign) - a * x**2 * 0.5 - b * x), 1, ("a", "b")
    )


def transcritical_form(c: float = 1.0) -> Polynomial:
    """x (x − a) = 0: E = c (x³/3 − a x²/2), x = 0 stable for a < 0."""
    return Polynomial(lambda x, a: c * (x**3 * (1 / 3) - a * x**2 * 0.5), 1, ("a",))


def slaved(form: Polynomial, k: float, m: float) -> Polynomial:
    """The form with a second unknown y = m x² held by a spring k: the same branches in x."""
    names = tuple(parameter.name for parameter in form.parameters)
    potential = form.potential.terms

    def energy(x: Sum, y: Sum, *p: Sum) -> Sum:
        del p
        wide = Sum({(e[0], 0, *e[1:]): factor for e, factor in potential.items()})
        return wide + k * 0.5 * (y - m * x**2) ** 2

    return Polynomial(energy, 2, names)


def bead_on_a_circle() -> Polynomial:
    """x² + y² = 1, E = ½ x² − h x − g y: folds on the astroid [StonerWohlfarth1948]_."""
    return Polynomial(
        lambda x, y, h, g: x**2 * 0.5 - h * x - g * y,
        2,
        ("h", "g"),
        lambda x, y, h, g: (x**2 + y**2 - 1.0) * 0.5 + h * 0.0 + g * 0.0,
    )
