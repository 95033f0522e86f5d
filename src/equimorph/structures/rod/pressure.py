"""Conservative pressure on a rod: the enclosed area, and a matrix that couples all angles."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from equimorph.arrays import Entries, Float, Int, Nodal, Values
from equimorph.linalg.dense import multiply
from equimorph.structures.rod.discretisation import Mesh


@dataclass(frozen=True, eq=False)
class EnclosedArea:
    """``V = ½ ∫ (y cos θ − x sin θ) ds + ½ dᵀ Q d``, whose gradient is the work of pressure.

    The integral is the area left of the chord d from end A to end B. Double quadrature at the
    nodes: ``Σ cos θᵢ Wᵢⱼ sin θⱼ`` with an antisymmetric W, so that it does not change when the rod
    turns as a whole. Q closes the area where an end moves along a line, see `closing`.
    """

    mesh: Mesh
    closing: Float[np.ndarray, "2 2"]

    @property
    def pole(self) -> Float[np.ndarray, "2 2"]:
        """P: the place A + P d about which pressure works on the multipliers' forces.

        The force on a cross-section at r is that without pressure, and p (r − A − P d) turned by a
        quarter; P is ½ between held ends.
        """
        (xx, xy), (yx, yy) = self.closing
        return np.array([[0.5 + yx, yy], [-xx, 0.5 - xy]])

    @cached_property
    def rows(self) -> Float[np.ndarray, "elements order nodes"]:
        """W before the nodes that elements share are added up."""
        mesh, weights = self.mesh, self.mesh.element_weights
        out = np.zeros((mesh.elements, mesh.degree + 1, len(mesh.nodes)))
        for e, here in enumerate(mesh.element_nodes):
            double = weights[e][:, None] * mesh.lengths[e] * mesh.reference.integral
            out[e][:, here] += 0.5 * (double - double.T)
            for f, there in enumerate(mesh.element_nodes):
                side = 0.5 * np.sign(e - f)
                np.add.at(out[e].T, there, side * np.outer(weights[f], weights[e]))
        return out

    @cached_property
    def matrix(self) -> Float[np.ndarray, "nodes nodes"]:
        """W."""
        total = np.zeros((len(self.mesh.nodes), len(self.mesh.nodes)))
        np.add.at(total, self.mesh.element_nodes, self.rows)
        return total

    def chord(self, theta: Nodal) -> Float[np.ndarray, "lanes 2"]:
        """d."""
        both = np.stack([np.cos(theta), np.sin(theta)], axis=2)
        return np.asarray(np.einsum("lnk,n->lk", both, self.mesh.weights))

    def _closed(self, theta: Nodal) -> Float[np.ndarray, "2 lanes 1"]:
        """Q d."""
        return np.asarray((self.chord(theta) @ self.closing).T[:, :, None])

    def value(self, theta: Nodal) -> Values:
        """V."""
        chorded = (np.cos(theta) * multiply(np.sin(theta), self.matrix.T)).sum(axis=1)
        d = self.chord(theta)
        return np.asarray(chorded + 0.5 * np.einsum("li,ij,lj->l", d, self.closing, d))

    def gradient(self, theta: Nodal) -> Nodal:
        """∂V/∂θ: −sin θ (W sin θ) − cos θ (W cos θ) + (Q d)·∂d/∂θ."""
        s, c = np.sin(theta), np.cos(theta)
        x, y = self._closed(theta)
        chorded = -s * multiply(s, self.matrix.T) - c * multiply(c, self.matrix.T)
        return np.asarray(chorded + self.mesh.weights * (y * c - x * s))

    def curvature(self, theta: Nodal) -> Nodal:
        """∂²V/∂θᵢ²."""
        s, c = np.sin(theta), np.cos(theta)
        chorded = s * multiply(c, self.matrix.T) - c * multiply(s, self.matrix.T)
        slope = self.mesh.weights * np.stack([-s, c])
        both = np.einsum("aln,ab,bln->ln", slope, self.closing, slope)
        return np.asarray(chorded + self._bend(theta) + both)

    def _bend(self, theta: Nodal) -> Nodal:
        """(Q d)·∂²d/∂θ²."""
        x, y = self._closed(theta)
        return np.asarray(-self.mesh.weights * (x * np.cos(theta) + y * np.sin(theta)))

    def gradient_derivative(self, theta: Nodal, v: Nodal) -> Nodal:
        """Derivative of the gradient along v."""
        s, c = np.sin(theta), np.cos(theta)
        own = s * multiply(c, self.matrix.T) - c * multiply(s, self.matrix.T)
        others = c * multiply(s * v, self.matrix.T) - s * multiply(c * v, self.matrix.T)
        slope = self.mesh.weights * np.stack([-s, c])
        turned = np.einsum("aln,ab,bl->ln", slope, self.closing, (slope * v).sum(axis=2))
        return np.asarray((own + self._bend(theta)) * v + others + turned)

    def second(self, theta: Nodal, v: Nodal, w: Nodal) -> Nodal:
        """Second derivative of the gradient along v and w."""
        s, c = np.sin(theta), np.cos(theta)

        def both(x: Nodal) -> Nodal:
            turned = s * multiply(s * x, self.matrix.T) + c * multiply(c * x, self.matrix.T)
            return np.asarray(turned)

        whole = both(np.ones_like(theta))
        chorded = v * w * whole - v * both(w) - w * both(v) + both(v * w)
        return np.asarray(chorded + self._closed_second(theta, v, w))

    def _closed_second(self, theta: Nodal, v: Nodal, w: Nodal) -> Nodal:
        """Second derivative of ``(Q d)·∂d/∂θ`` along v and w, by the product rule."""
        s, c = np.sin(theta), np.cos(theta)
        slope, bend, third = (
            self.mesh.weights * np.stack(pair) for pair in ((-s, c), (-c, -s), (s, -c))
        )

        def along(row: Float[np.ndarray, "2 lanes nodes"]) -> Float[np.ndarray, "2 lanes 1"]:
            return np.asarray(np.einsum("ab,bl->al", self.closing, row.sum(axis=2))[:, :, None])

        total = third * v * w * self._closed(theta) + bend * v * along(slope * w)
        total = total + bend * w * along(slope * v) + slope * along(bend * v * w)
        return np.asarray(total.sum(axis=0))


Angles = Float[np.ndarray, "lanes unknowns"]
Square = Float[np.ndarray, "unknowns unknowns"]

BLOCK = 128
"""Matrices that are assembled together: the cost of a call is small against theirs."""


def lower_triangle(
    theta: Angles,
    pull: Float[np.ndarray, "lanes 1"],
    stiffness: Square,
    area: EnclosedArea,
    inner: slice,
    diagonal: Angles,
    border: Float[np.ndarray, "lanes m unknowns"],
    trailing: Float[np.ndarray, "lanes m m"],
) -> Entries:
    """Entries of F_z, row by row: ``K_ij − p ∂²V/∂θ_i∂θ_j``, then the multipliers' rows.

    Parameters
    ----------
    theta
        Unknown angles.
    pull
        Pressure p.
    stiffness
        K.
    area, inner
        V, and the nodes of the unknown angles.
    diagonal
        Further terms of the diagonal.
    border, trailing
        Gradients of the multipliers' constraints, and the block of the multipliers.
    """
    (lanes, n), m = theta.shape, border.shape[1]
    entries = np.empty((lanes, (n + m) * (n + m + 1) // 2))
    for start in range(0, lanes, BLOCK):
        some = slice(start, start + BLOCK)
        angles = _angles(theta[some], pull[some], stiffness, area.matrix[inner, inner])
        if area.closing.any():
            _close(angles, theta[some], pull[some], area.closing, area.mesh.weights[inner])
        entries[some, : n * (n + 1) // 2] = angles.T
    entries[:, _row_ends(0, n)] += diagonal
    for k, stop in enumerate(_row_ends(n, n + m)):
        first = stop - n - k
        entries[:, first : first + n] = border[:, k]
        entries[:, first + n : stop + 1] = trailing[:, k, : k + 1]
    return entries


def _angles(
    theta: Angles, pull: Float[np.ndarray, "lanes 1"], stiff: Square, area: Square
) -> Float[np.ndarray, "entries lanes"]:
    """Rows of the angles, lanes last, so that every operation runs along memory."""
    sine, cosine = np.ascontiguousarray(np.sin(theta).T), np.ascontiguousarray(np.cos(theta).T)
    pressed_sine, pressed_cosine = (-pull[:, 0] * field for field in (sine, cosine))
    out = np.empty((len(stiff) * (len(stiff) + 1) // 2, len(theta)))
    for i, stop in enumerate(_row_ends(0, len(stiff))):
        row, before = out[stop - i : stop + 1], slice(0, i + 1)
        np.multiply(pressed_cosine[i], sine[before], out=row)
        row -= pressed_sine[i] * cosine[before]
        row *= area[i, before, None]
        row += stiff[i, before, None]
    return out


def _close(
    out: Float[np.ndarray, "entries lanes"],
    theta: Angles,
    pull: Float[np.ndarray, "lanes 1"],
    closing: Float[np.ndarray, "2 2"],
    weights: Float[np.ndarray, " unknowns"],
) -> None:
    """Subtract ``p (∂d/∂θ_i)ᵀ Q ∂d/∂θ_j`` off the diagonal of the rows of the angles."""
    slope = weights[:, None] * np.stack([-np.sin(theta).T, np.cos(theta).T])
    pressed = pull[:, 0] * np.einsum("ab,bnl->anl", closing, slope)
    for i, stop in enumerate(_row_ends(0, theta.shape[1])):
        out[stop - i : stop] -= (pressed[:, i : i + 1] * slope[:, :i]).sum(axis=0)


def closing(moves: tuple[Sequence[int], Sequence[int]], slide: float) -> Float[np.ndarray, "2 2"]:
    """Q of the area that pressure works on where end A, end B or both move along a line.

    Pressure p on the left side does the work ``p ∫ n·δr ds = −p (δA − ½ [r × δr]_A^B)`` with
    ``A = ½ ∫ r × dr``. It has a potential where ``r × δr`` of both ends is exact: at an end that is
    held, or moves along a line, through the origin say, which may be chosen so for each of two
    perpendicular lines. Closing A by the triangle of the origin and the chord gives
    ``−p (V ± ½ X Y)`` with the chord's components along and across the line of the slide: plus if A
    moves along or B across, minus the other way round.

    Parameters
    ----------
    moves
        For A and for B the axis along which it moves, 0 along and 1 across; empty if held.
    slide
        Angle of the first axis from x, in radians.

    Returns
    -------
    Zero if both are held.
    """
    first, last = moves
    sign = 0.0
    for axis in first:
        sign = 1.0 - 2.0 * axis
    for axis in last:
        sign = 2.0 * axis - 1.0
    s, c = np.sin(2.0 * slide), np.cos(2.0 * slide)
    return np.asarray(0.5 * sign * np.array([[-s, c], [c, s]]))


def _row_ends(first: int, stop: int) -> Int[np.ndarray, " rows"]:
    """Entries on the diagonal of some rows of a lower triangle."""
    rows = np.arange(first, stop)
    return rows * (rows + 3) // 2
