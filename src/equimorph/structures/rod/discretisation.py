"""Gauss–Lobatto elements along the rod: nodes, weights, stiffness, spectral integration.

See docs/decisions.md, "Six elements of degree nine".
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import pairwise
from typing import Annotated

import numpy as np
from numpy.polynomial import legendre

from equimorph.argument_vocabulary import count
from equimorph.arrays import Float, Int, Lanes, Values

REFINING = 6
"""Newton iterations on a finer mesh, started from the interpolated state."""
SOLVED = 1e-6
"""Last correction from which one more Newton step would be below round-off."""
SAFETY = 2.0
"""The change to a finer mesh is an error less a much smaller one, taken at some places only."""


ElementCount = Annotated[int, count(2, 10_000)]
"""Elements of a rod: more would need matrices beyond any memory, and no rod needs them."""


@dataclass(frozen=True, eq=False)
class Reference:
    """Gauss–Lobatto rule of one degree on [0, 1], with Lagrange polynomials in its nodes."""

    degree: int
    nodes: Float[np.ndarray, " order"]
    weights: Float[np.ndarray, " order"]
    derivative: Float[np.ndarray, "order order"]
    """Derivative of the interpolant at the nodes: ``f' = derivative @ f``."""
    to_legendre: Float[np.ndarray, "order order"]
    """Coefficients in P_k(2t − 1): ``c = to_legendre @ f``."""
    integral: Float[np.ndarray, "order order"]
    """Integral from 0 to each node: ``∫ f = integral @ f``."""


@lru_cache(maxsize=32)
def reference_element(degree: int) -> Reference:
    """Gauss–Lobatto reference element of the given degree (exact up to degree 2·degree − 1)."""
    top = np.zeros(degree + 1)
    top[-1] = 1.0
    inner = np.sort(legendre.legroots(legendre.legder(top)).real)
    x = np.concatenate([[-1.0], inner, [1.0]])
    for _ in range(3):  # Newton on (1 − x²) P'_N keeps the roots at round-off
        first, second = legendre.legder(top), legendre.legder(top, 2)
        x[1:-1] -= legendre.legval(x[1:-1], first) / legendre.legval(x[1:-1], second)
    weights = 2.0 / (degree * (degree + 1) * legendre.legval(x, top) ** 2)
    vander = legendre.legvander(x, degree)
    to_legendre = np.linalg.inv(vander)
    slopes = np.stack([legendre.legval(x, legendre.legder(row)) for row in np.eye(degree + 1)], 1)
    sums = np.stack(
        [legendre.legval(x, legendre.legint(r, lbnd=-1)) for r in np.eye(degree + 1)], 1
    )
    return Reference(
        degree,
        0.5 * (x + 1.0),
        0.5 * weights,
        2.0 * slopes @ to_legendre,
        to_legendre,
        0.5 * sums @ to_legendre,
    )


@dataclass(frozen=True, eq=False)
class Mesh:
    """Elements between `breaks` on [0, 1], all of one degree."""

    breaks: Float[np.ndarray, " vertices"]
    reference: Reference

    @property
    def degree(self) -> int:
        """Polynomial degree of θ in an element."""
        return self.reference.degree

    @property
    def elements(self) -> int:
        """Number of elements."""
        return len(self.breaks) - 1

    @cached_property
    def lengths(self) -> Float[np.ndarray, " elements"]:
        """Element lengths."""
        return np.diff(self.breaks)

    @cached_property
    def nodes(self) -> Float[np.ndarray, " nodes"]:
        """Arclength of all nodes."""
        inside = self.breaks[:-1, None] + self.lengths[:, None] * self.reference.nodes[:-1]
        return np.append(inside.ravel(), self.breaks[-1])

    @cached_property
    def element_nodes(self) -> Int[np.ndarray, "elements order"]:
        """Node numbers of each element."""
        return np.arange(self.elements)[:, None] * self.degree + np.arange(self.degree + 1)

    @cached_property
    def highest(self) -> Float[np.ndarray, "coefficients nodes"]:
        """What the two highest Legendre coefficients of all elements are of the nodal values."""
        rows = np.zeros((self.elements, 2, self.elements * self.degree + 1))
        for element, nodes in enumerate(self.element_nodes):
            rows[element][:, nodes] = self.reference.to_legendre[-2:]
        return rows.reshape(2 * self.elements, -1)

    @cached_property
    def highest_by_node(self) -> Float[np.ndarray, "nodes coefficients"]:
        """`highest`, a row for each node, as its kernel takes it."""
        return np.ascontiguousarray(self.highest.T)

    @cached_property
    def element_weights(self) -> Float[np.ndarray, "elements order"]:
        """Quadrature weights of each element."""
        return np.asarray(self.lengths[:, None] * self.reference.weights)

    @cached_property
    def weights(self) -> Float[np.ndarray, " nodes"]:
        """Quadrature weights summed at the nodes: the lumped L2 mass."""
        return self.assemble(np.ones((self.elements, self.degree + 1)))

    @cached_property
    def stiffness(self) -> Float[np.ndarray, "elements order order"]:
        """∫ φᵢ' φⱼ' ds on each element; the rule integrates it exactly."""
        ref = self.reference
        unit = ref.derivative.T @ (ref.weights[:, None] * ref.derivative)
        unit = 0.5 * (unit + unit.T)
        return np.asarray(unit / self.lengths[:, None, None])

    def assemble(self, values: Float[np.ndarray, "elements order"]) -> Float[np.ndarray, " nodes"]:
        """Sum quadrature weight times `values`, given element by element, at the nodes."""
        total = np.zeros(self.elements * self.degree + 1)
        np.add.at(total, self.element_nodes, self.element_weights * values)
        return total

    def locate(
        self, s: Float[np.ndarray, " points"]
    ) -> tuple[Int[np.ndarray, " points"], Float[np.ndarray, " points"]]:
        """Element and local coordinate in [0, 1] of arclengths."""
        element = np.clip(np.searchsorted(self.breaks, s, side="right") - 1, 0, self.elements - 1)
        return element, (s - self.breaks[element]) / self.lengths[element]

    def interpolation(self, s: Float[np.ndarray, " points"]) -> Float[np.ndarray, "points nodes"]:
        """Matrix that evaluates a nodal field at arclengths."""
        element, t = self.locate(s)
        local = legendre.legvander(2.0 * t - 1.0, self.degree) @ self.reference.to_legendre
        return self._spread(element, local)

    def integration(self, s: Float[np.ndarray, " points"]) -> Float[np.ndarray, "points nodes"]:
        """Matrix that integrates a nodal field from 0 to arclengths."""
        element, t = self.locate(s)
        x = 2.0 * t - 1.0
        basis = [legendre.legint(row, lbnd=-1) for row in np.eye(self.degree + 1)]
        sums = np.stack([0.5 * legendre.legval(x, row) for row in basis], axis=1)
        local = (sums @ self.reference.to_legendre) * self.lengths[element][:, None]
        matrix = self._spread(element, local)
        before = np.arange(self.elements)[None] < element[:, None]
        full = np.zeros((self.elements, self.elements * self.degree + 1))
        for e in range(self.elements):
            full[e, self.element_nodes[e]] += self.element_weights[e]
        return matrix + before @ full

    def _spread(
        self, element: Int[np.ndarray, " points"], local: Float[np.ndarray, "points order"]
    ) -> Float[np.ndarray, "points nodes"]:
        matrix = np.zeros((len(element), self.elements * self.degree + 1))
        np.put_along_axis(matrix, self.element_nodes[element], local, axis=1)
        return matrix


def mesh_with_kinks(kinks: Float[np.ndarray, " kinks"], elements: int, degree: int) -> Mesh:
    """Mesh of about `elements` nearly equal elements whose ends meet every kink in (0, 1)."""
    equal = np.linspace(0.0, 1.0, elements + 1)
    pieces = np.concatenate([[0.0], kinks, [1.0]])
    if all(np.abs(equal - kink).min() < 1e-14 for kink in kinks):
        return Mesh(equal, reference_element(degree))
    breaks = [np.zeros(1)]
    for start, stop in pairwise(pieces):
        count = max(1, int(np.ceil((stop - start) * elements - 1e-9)))
        breaks.append(np.linspace(start, stop, count + 1)[1:])
    return Mesh(np.concatenate(breaks), reference_element(degree))


def error_by_refinement(
    start: Lanes, correction: Callable[[Lanes], Lanes], change: Callable[[Lanes], Values]
) -> Values:
    """Estimate discretisation errors by solving again on a finer mesh: twice the largest change.

    States are interpolated to the finer mesh and corrected there. Infinite where the finer mesh has
    no equilibrium near the state, as may happen at a fold.
    """
    last = np.full_like(start, np.inf)
    for _ in range(REFINING):
        last = correction(start)
        start = start + last
    solved = np.abs(last).max(axis=1) < SOLVED
    return np.asarray(np.where(solved, SAFETY * change(start), np.inf))
