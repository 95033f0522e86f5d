"""The area between a rod and its chord, by which conservative pressure does its work."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float

from equimorph.arrays import Nodal, Values
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
        """∂²V/∂θᵢ∂θⱼ: ``Wᵢⱼ sin(θⱼ − θᵢ)`` beside the diagonal."""
        s, c = np.sin(theta), np.cos(theta)
        out = self.matrix * (c[:, :, None] * s[:, None, :] - s[:, :, None] * c[:, None, :])
        at = np.arange(theta.shape[1])
        out[:, at, at] = self.curvature(theta)
        return np.asarray(out)

    def curvature(self, theta: Nodal) -> Nodal:
        """∂²V/∂θᵢ²."""
        s, c = np.sin(theta), np.cos(theta)
        return np.asarray(s * multiply(c, self.matrix.T) - c * multiply(s, self.matrix.T))

    def turned(self, theta: Nodal, v: Nodal) -> Nodal:
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
