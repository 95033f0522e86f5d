"""Lagrangians of rods in space, written out: nothing is taken from the package but the mesh.

With quadrature weights m at the nodes of every element, one-sided values at jumps, rotation
matrices R of q/|q|, the force f on the cross-section (compressive against the tangent), and strains
from 2 conj(q) q', L = Σ m (½ (u − u₀)·K (u − u₀) + f·Re₁ − ½ fᵀ R S Rᵀ f) + supports.
"""

import numpy as np
from scipy.spatial.transform import Rotation

from equimorph.structures import Curvature, LineLoad, PointForce, SpatialEnd, SpatialRod, Tendon
from oracles.rods import Quadrature, column

UNIT = 1.0 / (4.0 * np.pi**2)


def product(a, b):
    a0, a1, a2, a3 = (a[..., k] for k in range(4))
    b0, b1, b2, b3 = (b[..., k] for k in range(4))
    return np.stack(
        [
            a0 * b0 - a1 * b1 - a2 * b2 - a3 * b3,
            a0 * b1 + a1 * b0 + a2 * b3 - a3 * b2,
            a0 * b2 - a1 * b3 + a2 * b0 + a3 * b1,
            a0 * b3 + a1 * b2 - a2 * b1 + a3 * b0,
        ],
        axis=-1,
    )


def turn(angle, axis):
    out = np.zeros((*np.shape(angle), 4), np.result_type(angle, float))
    out[..., 0], out[..., 1 + axis] = np.cos(angle / 2), np.sin(angle / 2)
    return out


def clamp(a, b, twist):
    return product(product(turn(a, 2), turn(b, 1)), turn(twist, 0))


def matrix(q):
    """Columns t, n, b of unit quaternions, after Euler and Rodrigues."""
    w, x, y, z = (q[..., k] for k in range(4))
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


class InSpace(Quadrature):
    """Rotations and strains of states."""

    def state(self, free, first, last):
        """Unit quaternions from the free ones and those of clamps, and what their lengths cost."""
        count = self.at.max() + 1
        inner = np.arange(count)[int(first is not None) : count - int(last is not None)]
        given = free.reshape(len(free), -1, 4)
        ends = [each for each in (first, last) if each is not None]
        q = np.zeros((len(free), count, 4), np.result_type(free, *ends))
        square = (given**2).sum(axis=-1)
        q[:, inner] = given / np.sqrt(square)[..., None]
        if first is not None:
            q[:, 0] = first
        if last is not None:
            q[:, -1] = last
        weights = np.zeros(count)
        np.add.at(weights, self.at, self.m)
        cost = 50.0 * ((square - 1) ** 2 @ weights[inner])
        return q, cost

    def strains(self, q):
        local = q[:, self.at]
        moved = np.einsum("eij,lejc->leic", self.slope, local)
        back = local * np.array([1.0, -1.0, -1.0, -1.0])
        return 2 * product(back, moved)[..., 1:]

    def frames(self, q):
        return matrix(q[:, self.at])


def columns(*parts):
    return np.stack(np.broadcast_arrays(*parts), axis=-1)


def arch(elements=4, degree=5):
    """Uniform arch between clamps under its default load."""
    rod = SpatialRod(torsion=0.77, lateral=1.4, elements=elements, degree=degree)
    g = InSpace(rod)

    def lagrangian(z, p):
        Theta, Delta, tilt_A, twist_A, tilt_B, twist_B, q, nu, rise, aside = p.T
        first, last = clamp(Delta + Theta, tilt_A, twist_A), clamp(Delta - Theta, tilt_B, twist_B)
        at, out = g.state(z[:, :-3], first, last)
        u, lam = g.strains(at), z[:, -3:]
        out = out + g.total(0.5 * UNIT * (u**2 * np.array([0.77, 1.4, 1.0])).sum(axis=-1))
        t = g.frames(at)[..., 0]
        out = out + g.total(-column(q) * g.s * t[..., 1]) + q * rise
        for c, goal in enumerate((nu, rise, aside)):
            out = out + lam[:, c] * (g.total(t[..., c]) - goal)
        return out

    return rod, (0.9, 0.1, 0.05, -0.1, 0.05, 0.1, 0.5, 0.85, 0.05, -0.05), lagrangian


def everything(elements=3, degree=4):
    """Springs, jumps of stiffness, intrinsic strains, gravity aslant, a tendon, stretch, shear."""
    rod = SpatialRod(
        torsion=[[0, 0.7], [0.3, 0.7], [0.3, 0.9], [1, 0.9]],
        lateral=2.0,
        stiffness=[[0, 1], [1, 2]],
        ends=(SpatialEnd(y=2.0), SpatialEnd("free", x=1.5, z=3.0)),
        curvature=0.4,
        side_curvature=[[0, 0], [1, 0.6]],
        natural_twist=1.1,
        axial=4.0,
        shear=3.0,
        actuators={
            "bend": [Curvature(0.8, 0.3, 0.7, about="n"), Curvature(0.5, about="t")],
            "pull": Tendon(0.05, 0.3, 1.0, binormal=0.08),
        },
        loads={
            "q": LineLoad(direction=(0.3, -1.0, 0.4)),
            "P": [PointForce(0.7, (1.0, 0.5, -0.3)), PointForce(1.0, (0.0, 0.2, 0.6))],
        },
        coordinates={"reach": {"nu": 2.0}},
        elements=elements,
        degree=degree,
    )
    g = InSpace(rod)

    def lagrangian(z, p):
        reach, a, b, twist, bend, pull, q, P, rise, aside = p.T
        at, out = g.state(z[:, :-3], clamp(a, b, twist), None)
        u, lam, s = g.strains(at), z[:, -3:], g.s
        plane = UNIT * (1 + s)
        stiff = columns(plane * np.where(s < 0.3, 0.7, 0.9), 2 * plane, plane)
        mid = 0.8 * ((s > 0.3) & (s < 0.7))
        natural = columns(1.1 + 0.5 * column(bend), 0.6 * s + column(bend) * mid, 0.4 + 0 * s)
        out = out + g.total((0.5 * stiff * (u - natural) ** 2).sum(axis=-1))
        cable = column(pull) * (s > 0.3)
        out = out + g.total(cable * (-0.05 * u[..., 2] + 0.08 * u[..., 1]))
        out = out + g.total(cable * 0.5 * (0.05**2 + 0.08**2) * u[..., 0] ** 2)
        x = column(lam[:, 0]) + column(q) * 0.3 * s + column(P) * (s > 0.7)
        y = column(lam[:, 1]) - column(q) * s + column(P) * 0.5 * (s > 0.7)
        w = column(lam[:, 2]) + column(q) * 0.4 * s - column(P) * 0.3 * (s > 0.7)
        force = columns(x, y, w)
        a1, a2, a3 = (np.einsum("leic,leic->lei", force, g.frames(at)[..., k]) for k in range(3))
        out = out + g.total(a1 - (a1 + cable) ** 2 / 8 - (a2**2 + a3**2) / 6)
        rest = lam + np.stack([0.3 * q + P, -q + 0.7 * P, 0.4 * q + 0.3 * P], axis=1)
        out = out - rest[:, 0] * 2 * reach - rest[:, 1] * rise - rest[:, 2] * aside
        out = out - 0.5 * lam[:, 1] ** 2 / 2.0
        return out - 0.5 * rest[:, 0] ** 2 / 1.5 - 0.5 * rest[:, 2] ** 2 / 3.0

    return rod, (0.43, 0.1, -0.1, 0.2, 0.2, 0.1, 0.5, 0.2, 0.3, -0.1), lagrangian


def cantilever(elements=3, degree=4):
    """Free end B, shear but no stretch, a load across the plane."""
    rod = SpatialRod(
        torsion=0.5,
        lateral=3.0,
        ends=("clamped", "free"),
        shear=2.0,
        loads={"q": LineLoad("left-half", (0.5, -1.0, 0.3)), "P": PointForce(1.0, (0.1, 0.2, 1.0))},
        elements=elements,
        degree=degree,
    )
    g = InSpace(rod)

    def lagrangian(z, p):
        a, b, twist, q, P = p.T
        at, out = g.state(z, clamp(a, b, twist), None)
        u = g.strains(at)
        out = out + g.total(0.5 * UNIT * (u**2 * np.array([0.5, 3.0, 1.0])).sum(axis=-1))
        beyond = column(q) * np.where(g.s < 0.5, 1.0 - 2.0 * g.s, 0.0)
        force = -columns(
            0.5 * beyond + 0.1 * column(P), -beyond + 0.2 * column(P), 0.3 * beyond + column(P)
        )
        a1, a2, a3 = (np.einsum("leic,leic->lei", force, g.frames(at)[..., k]) for k in range(3))
        return out + g.total(a1 - (a2**2 + a3**2) / 4)

    return rod, (0.2, 0.1, 0.3, 0.4, 0.3), lagrangian


def guided(elements=4, degree=4):
    """End A slides along x, end B is clamped; no other load than in between."""
    rod = SpatialRod(
        torsion=0.8,
        lateral=1.0,
        ends=("guided", "clamped"),
        loads={"P": PointForce(0.5, (1.0, -1.0, 0.5))},
        coordinates={},
        elements=elements,
        degree=degree,
    )
    g = InSpace(rod)

    def lagrangian(z, p):
        a, b, c, d, e, f, P, rise, aside = p.T
        at, out = g.state(z[:, :-2], clamp(a, b, c), clamp(d, e, f))
        u, right = g.strains(at), column(P) * (g.s > 0.5)
        out = out + g.total(0.5 * UNIT * (u**2 * np.array([0.8, 1.0, 1.0])).sum(axis=-1))
        force = columns(right, column(z[:, -2]) - right, column(z[:, -1]) + 0.5 * right)
        out = out + g.total((force * g.frames(at)[..., 0]).sum(axis=-1))
        return out - (z[:, -2] - P) * rise - (z[:, -1] + 0.5 * P) * aside

    return rod, (0.2, 0.1, 0.3, -0.1, 0.2, 0.1, 0.4, 0.1, 0.05), lagrangian


def coaxial(elements=4, degree=4):
    """Round rod between clamps on one axis, with the phase condition ∫ g t_z = 0."""
    rod = SpatialRod(
        torsion=0.7,
        lateral=1.0,
        loads={"P": PointForce(0.5, (1.0, 0.0, 0.0))},
        axial=6.0,
        phase=True,
        elements=elements,
        degree=degree,
    )
    g = InSpace(rod)

    def lagrangian(z, p):
        twist_A, twist_B, P, nu = p.T
        at, out = g.state(z[:, :-4], clamp(0, 0, twist_A), clamp(0, 0, twist_B))
        u, lam, mu, s = g.strains(at), z[:, -4:-1], z[:, -1], g.s
        out = out + g.total(0.5 * UNIT * (u**2 * np.array([0.7, 1.0, 1.0])).sum(axis=-1))
        weight = 2.0 - s - 0.5 * s * (1.0 - s)
        along = column(lam[:, 0]) + column(P) * (s > 0.5)
        force = columns(along, column(lam[:, 1]), column(lam[:, 2]) + column(mu) * weight)
        a1 = (force * g.frames(at)[..., 0]).sum(axis=-1)
        return out + g.total(a1 - a1**2 / 12) - (lam[:, 0] + P) * nu

    return rod, (0.2, 0.5, 0.2, 0.84), lagrangian


def shot(state, stiffness, pieces=6):
    """A state as a guess of multiple shooting (`oracles.kirchhoff`), and stiffnesses in its units.

    Forces are those of the support at A: of loads along the way the caller adds what they take.
    """
    rod, s = state.structure, np.arange(pieces) / pieces
    frames = rod.frames(state.z[None], state.p[None], s)[0]
    given = UNIT * np.array(stiffness)
    strains = np.array([[float(each(state)) for each in rod.strains(at)] for at in s])
    y = np.zeros((pieces, 13))
    y[:, :3] = state.shape(s)
    y[:, 3:7] = Rotation.from_matrix(frames).as_quat(scalar_first=True)
    y[:, 7:10] = [-float(rod.support_force(each)(state)) for each in "xyz"]
    y[:, 10:13] = np.einsum("ick,ik->ic", frames, given * strains)
    return y, given
