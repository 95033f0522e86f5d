"""Conservative pressure on a rod: the enclosed area, and a matrix that couples all angles."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float, Int

from equimorph.arrays import Entries, Nodal, Values
from equimorph.linalg.dense import multiply
from equimorph.structures.rod.discretisation import Mesh


@dataclass(frozen=True, eq=False)
class EnclosedArea:
    """``V = ½ ∫ (y cos θ − x sin θ) ds``, the area left of the chord from end A to end B.

    Double quadrature at the nodes: ``V = Σ cos θᵢ Wᵢⱼ sin θⱼ`` with an antisymmetric W, so that V
    does not change when the rod turns as a whole.
    """

    mesh: Mesh

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

    def value(self, theta: Nodal) -> Values:
        """V."""
        return np.asarray((np.cos(theta) * multiply(np.sin(theta), self.matrix.T)).sum(axis=1))

    def gradient(self, theta: Nodal) -> Nodal:
        """∂V/∂θ: −sin θ (W sin θ) − cos θ (W cos θ)."""
        s, c = np.sin(theta), np.cos(theta)
        return np.asarray(-s * multiply(s, self.matrix.T) - c * multiply(c, self.matrix.T))

    def hessian(self, theta: Nodal) -> Float[np.ndarray, "lanes nodes nodes"]:
        """∂²V/∂θᵢ∂θⱼ: ``Wᵢⱼ sin(θⱼ − θᵢ)`` off the diagonal."""
        s, c = np.sin(theta), np.cos(theta)
        out = self.matrix * (c[:, :, None] * s[:, None, :] - s[:, :, None] * c[:, None, :])
        at = np.arange(theta.shape[1])
        out[:, at, at] = self.curvature(theta)
        return np.asarray(out)

    def curvature(self, theta: Nodal) -> Nodal:
        """∂²V/∂θᵢ²."""
        s, c = np.sin(theta), np.cos(theta)
        return np.asarray(s * multiply(c, self.matrix.T) - c * multiply(s, self.matrix.T))

    def gradient_derivative(self, theta: Nodal, v: Nodal) -> Nodal:
        """Derivative of the gradient along v."""
        s, c = np.sin(theta), np.cos(theta)
        own = s * multiply(c, self.matrix.T) - c * multiply(s, self.matrix.T)
        others = c * multiply(s * v, self.matrix.T) - s * multiply(c * v, self.matrix.T)
        return np.asarray(own * v + others)

    def second(self, theta: Nodal, v: Nodal, w: Nodal) -> Nodal:
        """Second derivative of the gradient along v and w."""
        s, c = np.sin(theta), np.cos(theta)

        def both(x: Nodal) -> Nodal:
            turned = s * multiply(s * x, self.matrix.T) + c * multiply(c * x, self.matrix.T)
            return np.asarray(turned)

        whole = both(np.ones_like(theta))
        return np.asarray(v * w * whole - v * both(w) - w * both(v) + both(v * w))


Angles = Float[np.ndarray, "lanes unknowns"]
Square = Float[np.ndarray, "unknowns unknowns"]

BLOCK = 128
"""Matrices that are assembled together: the cost of a call is small against theirs."""


def lower_triangle(
    theta: Angles,
    pull: Float[np.ndarray, "lanes 1"],
    stiffness: Square,
    area: Square,
    diagonal: Angles,
    border: Float[np.ndarray, "lanes m unknowns"],
    trailing: Float[np.ndarray, "lanes m m"],
) -> Entries:
    """Entries of F_z, row by row: ``K_ij − p W_ij sin(θ_j − θ_i)``, then the multipliers' rows.

    Parameters
    ----------
    theta
        Unknown angles.
    pull
        Pressure p.
    stiffness, area
        K, and W of the enclosed area.
    diagonal
        Further terms of the diagonal.
    border, trailing
        Gradients of the multipliers' constraints, and the block of the multipliers.
    """
    (lanes, n), m = theta.shape, border.shape[1]
    entries = np.empty((lanes, (n + m) * (n + m + 1) // 2))
    for start in range(0, lanes, BLOCK):
        some = slice(start, start + BLOCK)
        entries[some, : n * (n + 1) // 2] = _angles(theta[some], pull[some], stiffness, area).T
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


def _row_ends(first: int, stop: int) -> Int[np.ndarray, " rows"]:
    """Entries on the diagonal of some rows of a lower triangle."""
    rows = np.arange(first, stop)
    return rows * (rows + 3) // 2
