"""Buckling of a planar rod out of its plane."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float
from numpy.polynomial import legendre

from equimorph.arrays import Lanes, Parameters, Values
from equimorph.errors import InputError
from equimorph.structures.rod.discretisation import Mesh
from equimorph.structures.rod.general.ends import FREE, End
from equimorph.structures.rod.general.fields.kernels import KAPPA, MOMENT
from equimorph.structures.rod.general.mechanics import GeneralMechanics
from equimorph.structures.rod.profiles import at_nodes, profile

FOUR_PI_SQUARED = 4.0 * np.pi**2
Fine = Float[np.ndarray, "lanes elements fine"]


@dataclass(frozen=True, eq=False)
class LateralStiffness:
    """Stiffness of a rod against twist and against bending out of its plane.

    Parameters
    ----------
    torsion, lateral
        GJ and EI about the axis in the plane, relative to the bending stiffness B in the plane:
        numbers, tables [[s, f], ...] or callables.
    """

    torsion: Any
    lateral: Any

    def __post_init__(self) -> None:
        """Check that both are positive."""
        for name in ("torsion", "lateral"):
            lowest = profile(getattr(self, name), name).density(np.linspace(0.0, 1.0, 201)).min()
            if not lowest > 0.0:
                raise InputError(f"`{name}` must be positive everywhere; got {lowest:g}.")


def lateral_margin(
    rod: GeneralMechanics, ends: tuple[End, End], stiffness: LateralStiffness, z: Lanes,
    p: Parameters,
) -> Values:  # fmt: skip
    """Smallest eigenvalue of the second variation for movements out of the plane.

    A small rotation φ about the tangent and ψ about the normal twists the rod by φ' − κψ and bends
    it out of the plane by ψ' + κφ; to second order it takes ½ (φ (ψ' + κφ) − ψ (φ' − κψ)) from the
    curvature in the plane and turns the tangent by −½ ψ² t + ½ φψ n. With the moment M, thrust N
    and shear force M' of the state

        ½ ∫ C (φ' − κψ)² + A (ψ' + κφ)² − M (φ (ψ' + κφ) − ψ (φ' − κψ)) − N ψ² + M' φψ ds

    relative to ∫ φ² + ψ². Ends that are held in the plane, or pinned on an axis across it, hold φ
    and ψ; where both ends are supported, ∫ ψ = 0 keeps them in the plane.

    Returns
    -------
    The eigenvalue in units of 4π²B/L: negative where the rod buckles out of its plane.
    """
    grid = _Grid(rod)
    theta, y = rod.nodal_angles(z, p), rod.scalars(z, p)
    fields = rod.recovered(theta, y)
    forces = grid.forces(y, fields)
    mesh = rod.model.mesh
    fine = Mesh(mesh.breaks, grid.reference)
    twist, bend = (
        at_nodes(profile(value, name), fine) * rod.model.fine.rigidity
        for name, value in (("torsion", stiffness.torsion), ("lateral", stiffness.lateral))
    )
    matrix = grid.assembled(twist, bend, fields, forces)
    basis = grid.admissible(ends)
    mass = np.tile(mesh.weights, 2)
    metric = basis.T @ (mass[:, None] * basis)
    half = np.linalg.inv(np.linalg.cholesky(metric))
    turned = basis @ half.T
    reduced = np.einsum("ia,lij,jb->lab", turned, matrix, turned, optimize=True)
    return np.asarray(np.linalg.eigvalsh(reduced)[:, 0])


class _Grid:
    """Values and slopes of φ and ψ at the nodes of the finer rule."""

    def __init__(self, rod: GeneralMechanics) -> None:
        model, mesh = rod.model, rod.model.mesh
        self.model, self.mesh = model, mesh
        self.reference = rod.fine_reference
        coarse = mesh.reference
        spread = legendre.legvander(2.0 * self.reference.nodes - 1.0, coarse.degree)
        self.values = spread @ coarse.to_legendre
        self.slopes = self.values @ coarse.derivative
        self.weights = mesh.lengths[:, None] * self.reference.weights

    def forces(
        self, y: Float[np.ndarray, "lanes scalars"], fields: Float[np.ndarray, "lanes e 5 fine"]
    ) -> tuple[Fine, Fine]:
        """Thrust and shear force M'."""
        along = np.einsum("lj,jei->lei", y, self.model.fine.along)
        across = np.einsum("lj,jei->lei", y, self.model.fine.across)
        pressure = np.einsum("lj,j->l", y, self.model.pressure)
        theta, x, height = fields[:, :, 0], fields[:, :, 2], fields[:, :, 3]
        if pressure.any():
            middle = [0.5 * (f[:, :1, :1] + f[:, -1:, -1:]) for f in (x, height)]
            along = along - pressure[:, None, None] * (height - middle[1])
            across = across + pressure[:, None, None] * (x - middle[0])
        c, s = np.cos(theta), np.sin(theta)
        return along * c + across * s, across * c - along * s

    def assembled(
        self, twist: Float[np.ndarray, "e fine"], bend: Float[np.ndarray, "e fine"],
        fields: Float[np.ndarray, "lanes e 5 fine"], forces: tuple[Fine, Fine],
    ) -> Float[np.ndarray, "lanes n n"]:  # fmt: skip
        """Matrix of the second variation in (φ, ψ) at the nodes."""
        kappa, moment = fields[:, :, KAPPA], fields[:, :, MOMENT]
        thrust, shear = forces
        lanes, nodes = len(kappa), len(self.mesh.nodes)
        out = np.zeros((lanes, 2, 2, nodes, nodes))
        lengths = self.mesh.lengths[:, None]
        pairs = {  # coefficients of (value, slope) pairs: φφ, φφ', φ'φ', …
            (0, 0, 0, 0): bend * kappa**2 - moment * kappa,
            (0, 1, 0, 1): twist / lengths**2 + 0.0 * kappa,
            (1, 0, 1, 0): twist * kappa**2 - moment * kappa - thrust,
            (1, 1, 1, 1): bend / lengths**2 + 0.0 * kappa,
            (0, 0, 1, 1): (bend * kappa - 0.5 * moment) / lengths,
            (0, 1, 1, 0): (0.5 * moment - twist * kappa) / lengths,
            (0, 0, 1, 0): 0.5 * shear,
        }
        tables = (self.values, self.slopes)
        for (f, df, g, dg), coefficient in pairs.items():
            local = np.einsum(
                "lei,ij,ik->lejk", coefficient * self.weights, tables[df], tables[dg],
                optimize=True,
            )  # fmt: skip
            for e, at in enumerate(self.mesh.element_nodes):
                out[:, f, g, at[:, None], at] += local[:, e]
                if (f, df) != (g, dg):
                    out[:, g, f, at[:, None], at] += local[:, e].transpose(0, 2, 1)
        return out.transpose(0, 1, 3, 2, 4).reshape(lanes, 2 * nodes, 2 * nodes)

    def admissible(self, ends: tuple[End, End]) -> Float[np.ndarray, "n m"]:
        """Orthonormal basis of the rotations that supports allow."""
        nodes = len(self.mesh.nodes)
        rows = []
        placed = [not (end.x == FREE and end.y == FREE) for end in ends]
        for end, place, node in zip(ends, placed, (0, nodes - 1), strict=True):
            if place or end.angle != FREE:
                rows += [np.eye(2 * nodes)[node], np.eye(2 * nodes)[nodes + node]]
        if all(placed):
            rows.append(np.concatenate([np.zeros(nodes), self.mesh.weights]))
        _, _, directions = np.linalg.svd(np.array(rows).reshape(-1, 2 * nodes))
        return np.ascontiguousarray(directions[len(rows) :].T)
