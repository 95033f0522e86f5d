"""Conservative pressure on a rod: the enclosed area, and a matrix that couples all angles.

See docs/decisions.md, "Pressure on rods and frames is an enclosed area".
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from equimorph.arrays import Complex, Float, Int, Nodal, Values
from equimorph.linalg.condensed import Coupling
from equimorph.linalg.dense import multiply
from equimorph.structures.rod.discretisation import Mesh

Phases = Complex[np.ndarray, "lanes nodes"]


def double_quadrature(
    weights: Float[np.ndarray, "elements order"],
    lengths: Float[np.ndarray, " elements"],
    integral: Float[np.ndarray, "order order"],
    sides: Float[np.ndarray, "elements elements"],
) -> Float[np.ndarray, "elements order elements order"]:
    """W of ``½ ∫∫ sign(s − s') cos θ(s) sin θ(s') ds' ds`` for the nodes of all elements.

    `integral` leads from the start of an element of length 1 to its nodes; `sides` is the sign of s
    − s' in different elements.
    """
    out = 0.5 * sides[:, None, :, None] * weights[:, :, None, None] * weights
    for e, (here, length) in enumerate(zip(weights, lengths, strict=True)):
        double = here[:, None] * length * integral
        out[e, :, e] = 0.5 * (double - double.T)
    return np.asarray(out)


def _whole_quadrature(mesh: Mesh) -> Float[np.ndarray, "elements order elements order"]:
    """W of a rod for the nodes of all elements."""
    at = np.arange(mesh.elements)
    sides = np.sign(at[:, None] - at).astype(float)
    return double_quadrature(mesh.element_weights, mesh.lengths, mesh.reference.integral, sides)


def coupling(mesh: Mesh, closing: Float[np.ndarray, "2 2"]) -> Coupling:
    """What couples the angles of a rod with a pressure of 1: −∂²V/∂θ∂θ but for the diagonal."""
    at, whole = np.arange(mesh.elements), _whole_quadrature(mesh)
    inside = np.ascontiguousarray(whole[at, :, at])
    closed = np.array([closing[0, 0], -closing[0, 1]])
    return Coupling(inside, np.ascontiguousarray(mesh.element_weights), closed)


def rod_quadrature(mesh: Mesh) -> Float[np.ndarray, "elements order nodes"]:
    """W of a rod before the nodes that elements share are added up in its rows."""
    whole = _whole_quadrature(mesh)
    out = np.zeros((*whole.shape[:2], len(mesh.nodes)))
    for f, there in enumerate(mesh.element_nodes):
        out[:, :, there] += whole[:, :, f]
    return out


def unit_tangents(theta: Nodal) -> Phases:
    """exp(iθ)."""
    return np.asarray(np.cos(theta) + 1j * np.sin(theta))


@dataclass(frozen=True, eq=False)
class EnclosedArea:
    """``V = ½ ∫ (y cos θ − x sin θ) ds + ½ dᵀ Q d``, whose gradient is the work of pressure.

    The integral is the area left of the chord d from the start to the end. With tangents t as
    complex numbers it is ``½ Σ Wᵢⱼ Im(t̄ᵢ tⱼ)`` with an antisymmetric W, so that it does not change
    when all turns as a whole. Tangents at the nodes are u = exp(iθ) times what their node has as
    drawn: ``V = ½ Σ (Eᵢⱼ − i Wᵢⱼ) ūᵢ uⱼ + ½ Re(q d²)`` with d = Σ m u and q = Q₀₀ − i Q₀₁.
    """

    matrix: Float[np.ndarray, "nodes nodes"]
    even: Float[np.ndarray, "nodes nodes"]
    """W, and the symmetric E, which is zero where θ is measured from one axis everywhere."""
    weights: Complex[np.ndarray, " nodes"]
    """m."""
    closing: Float[np.ndarray, "2 2"]
    """Q, which closes the area where an end moves along a line, see `closing`."""

    @classmethod
    def of_rod(cls, mesh: Mesh, closing: Float[np.ndarray, "2 2"]) -> "EnclosedArea":
        """Area of a rod with angles θ at the nodes of a mesh."""
        total = np.zeros((len(mesh.nodes), len(mesh.nodes)))
        np.add.at(total, mesh.element_nodes, rod_quadrature(mesh))
        return cls(total, np.zeros_like(total), mesh.weights.astype(complex), closing)

    def part(self, nodes: slice | Int[np.ndarray, " some"]) -> "EnclosedArea":
        """What couples some nodes."""
        matrix, even = (each[nodes][:, nodes] for each in (self.matrix, self.even))
        return EnclosedArea(matrix, even, self.weights[nodes], self.closing)

    @property
    def pole(self) -> Float[np.ndarray, "2 2"]:
        """P: the place A + P d about which pressure works on the multipliers' forces.

        The force on a cross-section at r is that without pressure, and p (r − A − P d) turned by a
        quarter; P is ½ between held ends.
        """
        (xx, xy), (yx, yy) = self.closing
        return np.array([[0.5 + yx, yy], [-xx, 0.5 - xy]])

    @cached_property
    def closed(self) -> complex:
        """q."""
        return complex(self.closing[0, 0], -self.closing[0, 1])

    @cached_property
    def _slanted(self) -> bool:
        return bool(self.even.any())

    def _coupled(self, u: Phases) -> Phases:
        """(E − i W) u."""
        x, y = u.real, u.imag
        out = multiply(y, self.matrix.T) - 1j * multiply(x, self.matrix.T)
        if self._slanted:
            out = out + multiply(x, self.even) + 1j * multiply(y, self.even)
        return np.asarray(out)

    def _chord(self, u: Phases) -> Complex[np.ndarray, "lanes 1"]:
        """d, or its change where u is that of u."""
        return np.asarray((self.weights * u).sum(axis=1)[:, None])

    def chord(self, theta: Nodal) -> Float[np.ndarray, "lanes 2"]:
        """d."""
        d = self._chord(unit_tangents(theta))
        return np.concatenate([d.real, d.imag], axis=1)

    def value(self, theta: Nodal) -> Values:
        """V."""
        u = unit_tangents(theta)
        coupled = (u.conj() * self._coupled(u)).real.sum(axis=1)
        return np.asarray(0.5 * (coupled + (self.closed * self._chord(u)[:, 0] ** 2).real))

    def gradient(self, theta: Nodal) -> Nodal:
        """∂V/∂θ."""
        u = unit_tangents(theta)
        ends = self.closed * self._chord(u) * self.weights * u
        return np.asarray((u.conj() * self._coupled(u) - ends).imag)

    def curvature(self, theta: Nodal) -> Nodal:
        """∂²V/∂θᵢ²."""
        u = unit_tangents(theta)
        own = self.even.diagonal() - u.conj() * self._coupled(u)
        arm = self.weights * u
        return np.asarray((own - self.closed * (arm + self._chord(u)) * arm).real)

    def gradient_derivative(self, theta: Nodal, v: Nodal) -> Nodal:
        """Derivative of the gradient along v."""
        u = unit_tangents(theta)
        bend = self._coupled(u * v) - v * self._coupled(u)
        ends = self._chord(u * v) + self._chord(u) * v
        return np.asarray((u.conj() * bend - self.closed * ends * self.weights * u).real)

    def second(self, theta: Nodal, v: Nodal, w: Nodal) -> Nodal:
        """Second derivative of the gradient along v and w."""
        u = unit_tangents(theta)
        bend = v * self._coupled(u * w) + w * self._coupled(u * v)
        bend = bend - v * w * self._coupled(u) - self._coupled(u * v * w)
        ends = self._chord(u * v * w) + self._chord(u) * v * w
        ends = ends + self._chord(u * v) * w + self._chord(u * w) * v
        return np.asarray((u.conj() * bend + self.closed * ends * self.weights * u).imag)


Angles = Float[np.ndarray, "lanes unknowns"]
Square = Float[np.ndarray, "unknowns unknowns"]


def pressed_rows(
    theta: Angles, pull: Float[np.ndarray, "lanes 1"], stiff: Square, area: EnclosedArea
) -> Float[np.ndarray, "entries lanes"]:
    """Rows ``K_ij − p ∂²V/∂θ_i∂θ_j`` of the angles, and K alone on the diagonal.

    Lanes come last, so that every operation runs along memory.
    """
    sine, cosine = np.ascontiguousarray(np.sin(theta).T), np.ascontiguousarray(np.cos(theta).T)
    pressed_sine, pressed_cosine = (-pull[:, 0] * field for field in (sine, cosine))
    slanted = area.even.any()
    out = np.empty((len(stiff) * (len(stiff) + 1) // 2, len(theta)))
    for i, stop in enumerate(row_ends(0, len(stiff))):
        row, before = out[stop - i : stop + 1], slice(0, i + 1)
        np.multiply(pressed_cosine[i], sine[before], out=row)
        row -= pressed_sine[i] * cosine[before]
        row *= area.matrix[i, before, None]
        row += stiff[i, before, None]
        if slanted:
            across = pressed_cosine[i] * cosine[:i] + pressed_sine[i] * sine[:i]
            row[:-1] += area.even[i, :i, None] * across
    if area.closed:
        _close(out, theta, pull, area)
    return out


def _close(
    out: Float[np.ndarray, "entries lanes"],
    theta: Angles,
    pull: Float[np.ndarray, "lanes 1"],
    area: EnclosedArea,
) -> None:
    """Add ``p Re(q ∂d/∂θ_i ∂d/∂θ_j)`` to the rows of the angles, off the diagonal."""
    arms = (area.weights * unit_tangents(theta)).T
    pressed = pull[:, 0] * area.closed * arms
    for i, stop in enumerate(row_ends(0, theta.shape[1])):
        out[stop - i : stop] += (pressed[i] * arms[:i]).real


def closing(moves: tuple[Sequence[int], Sequence[int]], slide: float) -> Float[np.ndarray, "2 2"]:
    """Q of the area that pressure works on where end A, end B or both move along a line.

    Pressure p on the left side does the work ``p ∫ n·δr ds = −p (δA − ½ [r × δr]_A^B)`` with
    ``A = ½ ∫ r × dr``. It has a potential where ``r × δr`` of both ends is exact: at an end that is
    held, or moves along a line, through the origin say, which may be chosen so for each of two
    perpendicular lines. Closing A by the triangle of the origin and the chord gives
    ``−p (V ± ½ X Y)`` with the chord's components along and across the line of the slide: plus if A
    moves along or B across, minus the other way round.

    `moves`: for A and for B the axis along which it moves, 0 along and 1 across; empty if held.
    `slide`: angle of the first axis from x, in radians. Returns zero if both are held.
    """
    first, last = moves
    sign = 0.0
    for axis in first:
        sign = 1.0 - 2.0 * axis
    for axis in last:
        sign = 2.0 * axis - 1.0
    s, c = np.sin(2.0 * slide), np.cos(2.0 * slide)
    return np.asarray(0.5 * sign * np.array([[-s, c], [c, s]]))


def row_ends(first: int, stop: int) -> Int[np.ndarray, " rows"]:
    """Entries on the diagonal of some rows of a lower triangle."""
    rows = np.arange(first, stop)
    return rows * (rows + 3) // 2
