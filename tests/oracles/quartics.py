"""Random quartic energies with many wells, whose equilibria a homotopy counts."""

from dataclasses import dataclass
from itertools import combinations, combinations_with_replacement

import numpy as np

import equimorph as em


@dataclass(frozen=True)
class Quartic:
    """E = Σ x⁴/4 + ½ Σ q x_i² x_j² + T xxx/6 + A xx/2 − f x, with all coefficients symmetric."""

    q: np.ndarray
    t: np.ndarray
    a: np.ndarray
    f: np.ndarray

    @classmethod
    def random(cls, unknowns: int, generator: np.random.Generator) -> "Quartic":
        """Double wells, softly coupled, without any symmetry."""
        n = unknowns
        q = np.triu(generator.uniform(0.0, 0.3, (n, n)), 1)
        t = np.zeros((n, n, n))
        for i, j, k in combinations_with_replacement(range(n), 3):
            value = 0.3 * generator.normal()
            for place in {(i, j, k), (i, k, j), (j, i, k), (j, k, i), (k, i, j), (k, j, i)}:
                t[place] = value
        a = np.triu(0.3 * generator.normal(size=(n, n)), 1)
        a = a + a.T + np.diag(-1.0 + 0.3 * generator.normal(size=n))
        return cls(q + q.T, t, a, 0.2 * generator.normal(size=n))

    def __call__(self, x):
        """Gradient and Hessian, of complex arguments."""
        square, n = x**2, len(self.f)
        gradient = x**3 + 2 * x * (square @ self.q) - self.f + x @ self.a
        gradient = gradient + 0.5 * np.einsum("ijk,lj,lk->li", self.t, x, x)
        hessian = 4 * self.q * x[:, :, None] * x[:, None] + np.einsum("ijk,lk->lij", self.t, x)
        hessian = hessian + self.a
        hessian[:, range(n), range(n)] += 3 * square + 2 * (square @ self.q)
        return gradient, hessian

    @property
    def values(self) -> np.ndarray:
        """Coefficients in the order of the parameters of `quartic_structure`."""
        n = len(self.f)
        pairs, triples = _pairs(n), list(combinations_with_replacement(range(n), 3))
        return np.array([
            *(self.q[i, j] for i, j in combinations(range(n), 2)),
            *(self.t[place] for place in triples),
            *(self.a[place] for place in pairs),
            *self.f,
        ])  # fmt: skip


def _pairs(n: int) -> list[tuple[int, int]]:
    return list(combinations_with_replacement(range(n), 2))


def quartic_structure(unknowns: int) -> em.EnergyStructure:
    """All these energies as one structure: their coefficients are its parameters."""
    n = unknowns
    terms = [f"x{i}**4/4" for i in range(n)]
    names = []
    for i, j in combinations(range(n), 2):
        names.append(f"q{i}_{j}")
        terms.append(f"{names[-1]}*x{i}**2*x{j}**2")
    for i, j, k in combinations_with_replacement(range(n), 3):
        names.append(f"t{i}_{j}_{k}")
        terms.append(f"{names[-1]}*x{i}*x{j}*x{k}/{_orders(i, j, k)}")
    for i, j in _pairs(n):
        names.append(f"a{i}_{j}")
        terms.append(f"{names[-1]}*x{i}*x{j}/{2 if i == j else 1}")
    fixed = [em.Parameter(name, "1", 1.0, "fixed", 0.0) for name in names]
    loads = [em.Parameter(f"f{i}", "1", 1.0, "load", 0.0) for i in range(n)]
    terms += [f"-f{i}*x{i}" for i in range(n)]
    unknown = [em.Unknown(f"x{i}", 0.0, guesses=(-2.5, 2.5)) for i in range(n)]
    return em.EnergyStructure(" + ".join(terms), unknown, [*fixed, *loads])


def _orders(i: int, j: int, k: int) -> int:
    """6 over the number of orders of three numbers: T xxx/6 sums over all of them."""
    return {1: 6, 2: 2, 3: 1}[len({i, j, k})]
