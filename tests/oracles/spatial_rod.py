"""An inextensible rod in space between two clamps, dense: unit quaternions at the nodes of a mesh.

R(q) turns (e₁, e₂, e₃) to tangent, normal, binormal; strains are u_k = 2 (q e_k)·q' at the nodes,
twist first. L = Σ w (½ u·K u + f·t) − λ·(ν, 0, 0) with the dead force f = λ − (0, q ρ, 0) and
closures Σ w t = (ν, 0, 0). Nothing is taken from the package but mesh and load.
"""

import numpy as np
from scipy.linalg import eigh, null_space


def product(a, b):
    """Product of quaternions, scalar parts first."""
    a0, a1, a2, a3 = np.moveaxis(a, -1, 0)
    b0, b1, b2, b3 = np.moveaxis(b, -1, 0)
    parts = (
        a0 * b0 - a1 * b1 - a2 * b2 - a3 * b3,
        a0 * b1 + a1 * b0 + a2 * b3 - a3 * b2,
        a0 * b2 - a1 * b3 + a2 * b0 + a3 * b1,
        a0 * b3 + a1 * b2 - a2 * b1 + a3 * b0,
    )
    return np.stack(parts, axis=-1)


def exponential(w):
    """Quaternions of rotation vectors."""
    half = 0.5 * np.linalg.norm(w, axis=-1, keepdims=True)
    return np.concatenate([np.cos(half), 0.5 * np.sinc(half / np.pi) * w], axis=-1)


UNITS = np.eye(4)[1:]
RIGHT = np.array([[product(each, unit) for each in np.eye(4)] for unit in UNITS])
"""q e_k = q @ RIGHT[k]."""
TANGENT = np.zeros((3, 4, 4))
"""t_c = q·TANGENT[c]·q."""
TANGENT[0] = np.diag([1, 1, -1, -1])
TANGENT[1][[1, 2, 0, 3], [2, 1, 3, 0]] = 1
TANGENT[2][[1, 3], [3, 1]] = 1
TANGENT[2][[0, 2], [2, 0]] = -1


class SpatialRod:
    """Equilibria of the arch of `rod` in space."""

    def __init__(self, rod, torsion, lateral):
        mesh = rod.mesh
        self.nodes, self.weights = mesh.element_nodes, mesh.element_weights
        self.slopes = mesh.reference.derivative / mesh.lengths[:, None, None]
        self.stiffness = np.array([torsion, lateral, 1.0]) / (4 * np.pi**2)
        self.rho, self.count = rod.mechanics.rho, len(mesh.nodes)
        self.middle, self.mass = mesh.integration(np.array([0.5]))[0], mesh.weights

    def linearised(self, q, force, load):
        """Gradients of L by rotations, λ and load, Hessians, and the sideways place ½ and slope."""
        f = np.zeros((*self.rho.shape, 3))
        f += force
        f[..., 1] -= load * self.rho
        at, w = q[self.nodes], self.weights[..., None]
        moved = np.einsum("eij,ejc->eic", self.slopes, at)
        turned = np.einsum("eia,kab->eikb", at, RIGHT)
        strain = 2.0 * np.einsum("eikb,eib->eik", turned, moved)
        moment = w * self.stiffness * strain
        order = at.shape[1]
        jacobian = 2.0 * np.einsum("eij,eikb->eikjb", self.slopes, turned)
        own = 2.0 * np.einsum("kab,eib->eika", RIGHT, moved)
        for i in range(order):
            jacobian[:, i, :, i] += own[:, i]
        pull = w[..., None] * np.einsum("eic,cab->eiab", f, TANGENT)
        gradient = np.einsum("eik,eikjb->ejb", moment, jacobian)
        gradient += 2.0 * np.einsum("eiab,eib->eia", pull, at)
        stiff = w * self.stiffness
        hessian = np.einsum("eik,eikjb,eikla->ejbla", stiff, jacobian, jacobian, optimize=True)
        twisted = 2.0 * np.einsum("eik,kab->eiab", moment, RIGHT)
        mixed = np.einsum("eij,eiab->eiajb", self.slopes, twisted)
        hessian += mixed + mixed.transpose(0, 3, 4, 1, 2)
        for i in range(order):
            hessian[:, i, :, i] += 2.0 * pull[:, i]
        whole, full = np.zeros((self.count, 4)), np.zeros((self.count, 4, self.count, 4))
        by_load, close = np.zeros((self.count, 4)), np.zeros((3, self.count, 4))
        for e, n in enumerate(self.nodes):
            whole[n] += gradient[e]
            full[np.ix_(n, range(4), n, range(4))] += hessian[e]
            slope = 2.0 * np.einsum("i,cab,ib->cia", self.weights[e], TANGENT, at[e])
            close[:, n] += slope
            by_load[n] -= self.rho[e][:, None] * slope[1]
        radial, i = np.einsum("ia,ia->i", q, whole), np.arange(self.count)
        full[i, :, i] -= radial[:, None, None] * np.eye(4)
        tangents = 0.5 * np.einsum("ia,kab->ibk", q, RIGHT)[1:-1]
        full = np.einsum(
            "iak,iajb,jbl->ikjl", tangents, full[1:-1, :, 1:-1], tangents, optimize=True
        )
        size = 3 * (self.count - 2)
        sideways = 2.0 * self.middle[:, None] * (q @ TANGENT[2])

        def along(g):
            return np.einsum("...ia,iak->...ik", g[..., 1:-1, :], tangents).reshape(-1, size)

        tangent = np.einsum("cab,ia,ib->ic", TANGENT, q, q)
        total = np.zeros(3)
        for e, n in enumerate(self.nodes):
            total += self.weights[e] @ tangent[n]
        return (
            along(whole)[0], full.reshape(size, size), along(close), total, along(by_load)[0],
            self.middle @ tangent[:, 2], along(sideways)[0],
        )  # fmt: skip

    def aside(self, q, force, load, place):
        """Newton's method to the equilibrium whose middle is at z = `place`; its load and spectrum.

        Returns the rotations, λ, the load, and all eigenvalues on the closed rotations.
        """
        span = np.sin(1.0)
        for _ in range(12):
            g, hessian, close, total, by_load, z, row = self.linearised(q, force, load)
            size = len(g)
            matrix = np.zeros((size + 4, size + 4))
            matrix[:size, :size], matrix[size : size + 3, :size] = hessian, close
            matrix[:size, size : size + 3] = close.T
            matrix[:size, -1], matrix[-1, :size] = by_load, row
            rest = np.concatenate([g, total - [span, 0.0, 0.0], [z - place]])
            step = np.linalg.solve(matrix, -rest)
            turn = np.zeros((self.count, 3))
            turn[1:-1] = step[:size].reshape(-1, 3)
            q, force, load = product(q, exponential(turn)), force + step[size:-1], load + step[-1]
        assert np.abs(rest).max() < 1e-11
        _, hessian, close, *_ = self.linearised(q, force, load)
        basis = null_space(close)
        mass = basis.T @ (np.repeat(self.mass[1:-1], 3)[:, None] * basis)
        return q, force, load, eigh(basis.T @ hessian @ basis, mass, eigvals_only=True)

    def place(self, q):
        """Coordinates of the middle."""
        return self.middle @ np.einsum("cab,ia,ib->ic", TANGENT, q, q)


def sideways_from(rod, state, torsion, lateral):
    """Equilibria beside a lateral branch point: a function of z(½), goes on from its last."""
    spatial, mode = SpatialRod(rod, torsion, lateral), rod.lateral_mode(state, 3)
    block = rod.out_of_plane()
    x, n = block.mode(state.z[None], state.p[None])[0], block.unknowns
    theta = 0.5 * rod.nodal_angles(state.z[None], state.p[None])[0]
    planar = np.stack([np.cos(theta), 0.0 * theta, 0.0 * theta, np.sin(theta)], axis=-1)
    turn = np.stack([x[0:n:2], x[1:n:2], np.zeros(n // 2)], axis=-1) / mode.z[1]
    here = [None, np.append(state.multipliers, 0.0), state["q"]]

    def at(place):
        q = product(planar, exponential(place * turn)) if here[0] is None else here[0]
        *here[:], spectrum = spatial.aside(q, here[1], here[2], place)
        return here[2], spectrum, spatial.place(here[0])

    return at
