"""Rods in space, written out: the energy of a planar state after finite rotations, a finer rule.

Nothing is taken from the package but meshes, tables of loads, and planar fields.
"""

import numpy as np
from numpy.polynomial import legendre
from scipy.linalg import eigh, null_space

from equimorph.structures.rod.ends import FREE
from equimorph.structures.rod.general_field_kernels import KAPPA, MOMENT
from equimorph.structures.rod.general_fields import GeneralFields
from equimorph.structures.rod.profiles import at_nodes, profile

E1, E3 = np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.0, 1.0])


def rotated_energy(block, z, p, x):
    """Lagrangian of one state turned by R → R exp[φ t + ψ n], by Rodrigues' formula; x as of block.

    Strains are exp(−w) κ b + J(w) w' with the right Jacobian J of the rotation group.
    """
    at, n = block.coefficients(z[None], p[None]), block.unknowns
    w = np.zeros((*at.kappa[0].shape, 3))
    w[..., 0], w[..., 1] = x[0:n:2][block.mesh.element_nodes], x[1:n:2][block.mesh.element_nodes]
    dw = np.einsum("eij,ejk->eik", block.slopes, w)
    r = np.linalg.norm(w, axis=-1)[..., None]
    with np.errstate(invalid="ignore", divide="ignore"):
        one, two, three = (
            np.where(r > 1e-8, value, limit)
            for value, limit in (
                (np.sin(r) / r, 1.0),
                ((1.0 - np.cos(r)) / r**2, 0.5),
                ((r - np.sin(r)) / r**3, 1.0 / 6.0),
            )
        )

    def back(v):
        return v - one * np.cross(w, v) + two * np.cross(w, np.cross(w, v))

    def ahead(v):
        return v + one * np.cross(w, v) + two * np.cross(w, np.cross(w, v))

    kappa = at.kappa[0][..., None] * E3
    strain = back(kappa) + dw - two * np.cross(w, dw) + three * np.cross(w, np.cross(w, dw))
    tangent = ahead(np.broadcast_to(E1, w.shape))
    rigidity, soft = block.model.nodal.rigidity, block.model.nodal.softness
    bending = rigidity * at.kappa[0] - at.moment[0]
    density = 0.5 * at.torsion[0] * strain[..., 0] ** 2 + 0.5 * at.lateral * strain[..., 1] ** 2
    density += 0.5 * rigidity * strain[..., 2] ** 2 - bending * strain[..., 2]
    pull = at.thrust[0] * tangent[..., 0] + at.shear[0] * tangent[..., 1]
    pull = pull - x[n:].sum() * tangent[..., 2]  # the closure's force holds ∫ψ, and t·b = −ψ + …
    tension = np.where(soft > 0.0, (1.0 - at.stretch[0]) / np.maximum(soft, 1e-300), 0.0)
    tension = tension - at.thrust[0] * (soft > 0.0)  # of cables
    density += pull - 0.5 * soft * (pull + tension) ** 2
    return float((block.mesh.element_weights * density).sum())


def dense_margin(block, z, p):
    """All eigenvalues out of the plane of one state, by dense algebra on the closed movements."""
    full = block.dense(z[None], p[None])[0]
    free, n = np.flatnonzero(block.free), block.unknowns
    basis = null_space(full[free, n:].T) if block.constraints else np.eye(len(free))
    reduced, mass = full[np.ix_(free, free)], np.diag(block.mass[free])
    return eigh(basis.T @ reduced @ basis, basis.T @ mass @ basis, eigvals_only=True)


def fine_margin(rod, torsion, lateral, z, p):
    """Smallest eigenvalue of one state of a general rod by recovered fields on a finer rule.

    ½ ∫ C (φ' − κψ)² + A (ψ' + κφ)² − M (φ (ψ' + κφ) − ψ (φ' − κψ)) − N ψ² + M' φψ ds.
    """
    mechanics, mesh = rod.mechanics, rod.mesh
    model, everywhere = mechanics.model, GeneralFields(mechanics.model)
    reference = everywhere.reference
    y = mechanics.scalars(z[None], p[None])
    fields = everywhere.everywhere(mechanics.nodal_angles(z[None], p[None]), y)[0]
    along, across = (
        np.einsum("j,jei->ei", y[0], rows) for rows in (model.fine.along, model.fine.across)
    )
    theta, kappa, moment = fields[:, 0], fields[:, KAPPA], fields[:, MOMENT]
    thrust = along * np.cos(theta) + across * np.sin(theta)
    shear = across * np.cos(theta) - along * np.sin(theta)
    fine = type(mesh)(mesh.breaks, reference)
    twist, bend = (
        at_nodes(profile(value, "stiffness"), fine) * model.fine.rigidity
        for value in (torsion, lateral)
    )
    values = (
        legendre.legvander(2.0 * reference.nodes - 1.0, mesh.degree) @ mesh.reference.to_legendre
    )
    slopes = values @ mesh.reference.derivative
    nodes = len(mesh.nodes)
    matrix = np.zeros((2, 2, nodes, nodes))
    for e, (at, length) in enumerate(zip(mesh.element_nodes, mesh.lengths, strict=True)):
        weights, slope = length * reference.weights, slopes / length
        k, m, tables = kappa[e], moment[e], (values, slope)
        pairs = {
            (0, 0, 0, 0): bend[e] * k**2 - m * k,
            (0, 1, 0, 1): twist[e],
            (1, 0, 1, 0): twist[e] * k**2 - m * k - thrust[e],
            (1, 1, 1, 1): bend[e],
            (0, 0, 1, 1): bend[e] * k - 0.5 * m,
            (0, 1, 1, 0): 0.5 * m - twist[e] * k,
            (0, 0, 1, 0): 0.5 * shear[e],
        }
        for (f, df, g, dg), c in pairs.items():
            local = np.einsum("i,ij,ik->jk", c * weights, tables[df], tables[dg])
            matrix[f, g][np.ix_(at, at)] += local
            if f != g:
                matrix[g, f][np.ix_(at, at)] += local.T
    full = matrix.transpose(0, 2, 1, 3).reshape(2 * nodes, 2 * nodes)
    rows, placed = [], [not (end.x == FREE and end.y == FREE) for end in rod.ends]
    for end, place, node in zip(rod.ends, placed, (0, nodes - 1), strict=True):
        if place or end.angle != FREE:
            rows += [np.eye(2 * nodes)[node], np.eye(2 * nodes)[nodes + node]]
    if all(placed):
        rows.append(np.concatenate([np.zeros(nodes), mesh.weights]))
    basis = null_space(np.array(rows))
    mass = basis.T @ (np.tile(mesh.weights, 2)[:, None] * basis)
    return eigh(basis.T @ full @ basis, mass, eigvals_only=True)[0]
