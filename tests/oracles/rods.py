"""Lagrangians of general rods, written out: nothing is taken from the package but the mesh.

With quadrature weights m at the nodes of every element, one-sided values at jumps, and N the
compressive force, L = Σ m (½ B (θ' − κ₀)² − T d θ' + N − N²/(2 EA)) − M θ(s) + springs.
"""

import numpy as np

from equimorph.structures import Couple, Curvature, End, LineLoad, PointForce, Pressure, Rod, Tendon


class Quadrature:
    """Points, weights and slopes of nodal fields in every element."""

    def __init__(self, rod):
        mesh = rod.mesh
        t = 1e-13 + (1 - 2e-13) * mesh.reference.nodes
        self.s = mesh.breaks[:-1, None] + mesh.lengths[:, None] * t
        self.m = mesh.lengths[:, None] * mesh.reference.weights
        self.slope = mesh.reference.derivative / mesh.lengths[:, None, None]
        self.nodes, self.at = mesh.nodes, mesh.element_nodes

    def total(self, values):
        return (self.m * values).sum(axis=(1, 2))

    def kappa(self, theta):
        return np.einsum("eij,lej->lei", self.slope, theta[:, self.at])

    def node(self, s):
        return int(np.argmin(np.abs(self.nodes - s)))


def column(values):
    return values[:, None, None]


def bending(quadrature, theta, rigidity, natural):
    return quadrature.total(0.5 * rigidity * (quadrature.kappa(theta) - natural) ** 2)


def sprung_rod(elements=4, degree=5):
    """Everything at once: springs, jumps of stiffness, five loads and actuators, coordinates."""
    rod = Rod(
        ends=(End(angle=0.02, x="held", y=2.0), End(x=1.5)),
        stiffness=[[0, 1], [0.3, 2], [0.3, 1.5], [1, 1]],
        curvature=[[0, 0], [1, 1.2]],
        actuators={"bend": Curvature(0.8, 0.2, 0.6), "pull": Tendon(0.05, 0.0, 0.5)},
        loads={
            "q": LineLoad(direction=(0.3, -1.0)),
            "P": [PointForce(0.4, (1.0, 0.5)), PointForce(1.0, (0.0, 0.2))],
            "M": Couple(0.6),
        },
        coordinates={"turn": {"theta_A": 1.0, "theta_B": -1.0}, "reach": {"nu": 2.0}},
        elements=elements,
        degree=degree,
    )
    g = Quadrature(rod)
    before, after = 1 + g.s / 0.3, 1.5 - 0.5 * (g.s - 0.3) / 0.7
    rigidity = np.where(g.s < 0.3, before, after) / (4 * np.pi**2)

    def lagrangian(z, p):
        turn, reach, bend, pull, q, P, M, rise = p.T
        theta = np.concatenate([z[:, :-2], -turn[:, None]], axis=1)
        lam, mu, s = z[:, -2], z[:, -1], g.s
        natural = 1.2 * s + column(bend) * 0.8 * ((s > 0.2) & (s < 0.6))
        out = bending(g, theta, rigidity, natural)
        out = out - pull * g.total(0.05 * (s < 0.5) * g.kappa(theta))
        across_x = column(lam) + column(q) * 0.3 * s + column(P) * (s > 0.4)
        across_y = column(mu) - column(q) * s + column(P) * 0.5 * (s > 0.4)
        angles = theta[:, g.at]
        out = out + g.total(across_x * np.cos(angles) + across_y * np.sin(angles))
        out = out - M * theta[:, g.node(0.6)] + 0.01 * (theta[:, 0] - turn) ** 2
        fx, fy = 0.3 * q + P, -q + 0.7 * P
        out = out - (lam + fx) * 2 * reach - 0.5 * (lam + fx) ** 2 / 1.5
        return out - (mu + fy) * rise - 0.5 * mu**2 / 2.0

    return rod, (0.4, 0.4, 0.5, 0.7, 0.5, 0.3, 0.05, 0.1), lagrangian


def stretchable_cantilever(elements=4, degree=5):
    """Free end B, axial stiffness that varies, load inside and at the end."""
    rod = Rod(
        ends=("clamped", "free"),
        axial=[[0, 3.0], [1, 5.0]],
        loads={"q": LineLoad("left-half", (0.5, -1.0)), "P": PointForce(1.0, (-1.0, 0.3))},
        elements=elements,
        degree=degree,
    )
    g = Quadrature(rod)

    def lagrangian(z, p):
        start, q, P = p.T
        theta, s = np.concatenate([start[:, None], z], axis=1), g.s
        beyond = np.where(s < 0.5, 1.0 - 2.0 * s, 0.0)  # load between s and the free end
        x = -column(q) * 0.5 * beyond + column(P)
        y = column(q) * beyond - 0.3 * column(P)
        angles = theta[:, g.at]
        normal = x * np.cos(angles) + y * np.sin(angles)
        axial = 3.0 + 2.0 * s
        out = bending(g, theta, 1 / (4 * np.pi**2), 0.0)
        return out + g.total(normal - normal**2 / (2 * axial))

    return rod, (0.2, 0.4, 0.3), lagrangian


def sliding_rod(elements=4, degree=5):
    """End A free in x, pinned to a line; end B clamped: one multiplier, positions from B."""
    rod = Rod(
        ends=(End(angle="free", x="free", y="held"), "clamped"),
        loads={"P": PointForce(0.5, (1.0, -1.0)), "M": Couple(0.0)},
        elements=elements,
        degree=degree,
    )
    g = Quadrature(rod)

    def lagrangian(z, p):
        stop, P, M, rise = p.T
        theta, mu = np.concatenate([z[:, :-1], stop[:, None]], axis=1), z[:, -1]
        angles, right = theta[:, g.at], g.s > 0.5
        x, y = column(P) * right, column(mu) - column(P) * right
        out = bending(g, theta, 1 / (4 * np.pi**2), 0.0)
        out = out + g.total(x * np.cos(angles) + y * np.sin(angles))
        return out - M * theta[:, 0] - (mu - P) * rise

    return rod, (0.3, 0.4, 0.1, 0.1), lagrangian


def rolling_rod(elements=4, degree=5):
    """End B rolls along an inclined line: one multiplier, across it."""
    slide, force = 0.7, (1.0, -1.0)
    rod = Rod(
        ends=("clamped", End(angle="free", slide=slide)),
        loads={"P": PointForce(0.5, force)},
        axial=4.0,
        elements=elements,
        degree=degree,
    )
    g = Quadrature(rod)
    t, n = np.array([[np.cos(slide), np.sin(slide)], [-np.sin(slide), np.cos(slide)]])

    def lagrangian(z, p):
        start, P, offset = p.T
        theta, mu = np.concatenate([start[:, None], z[:, :-1]], axis=1), z[:, -1]
        angles, right = theta[:, g.at], g.s > 0.5
        x, y = (
            column(P) * (right * force[i] - (t @ force) * t[i]) + column(mu) * n[i] for i in (0, 1)
        )
        normal = x * np.cos(angles) + y * np.sin(angles)
        out = bending(g, theta, 1 / (4 * np.pi**2), 0.0) + g.total(normal - normal**2 / 8.0)
        return out - (mu + P * (n @ force)) * offset

    return rod, (0.3, 0.4, 0.1), lagrangian


def stretchable_arch(elements=4, degree=5):
    """Clamped, extensible: the multipliers have a trailing block."""
    rod = Rod(axial=4.0, load="left-half", elements=elements, degree=degree)
    g = Quadrature(rod)

    def lagrangian(z, p):
        Theta, Delta, q, nu, rise = p.T
        ends = (Delta + Theta)[:, None], (Delta - Theta)[:, None]
        theta = np.concatenate([ends[0], z[:, :-2], ends[1]], axis=1)
        lam, mu, s = z[:, -2], z[:, -1], g.s
        angles, rho = theta[:, g.at], np.minimum(2 * s, 1.0)
        normal = column(lam) * np.cos(angles) + (column(mu) - column(q) * rho) * np.sin(angles)
        out = bending(g, theta, 1 / (4 * np.pi**2), 0.0) + g.total(normal - normal**2 / 8.0)
        return out - lam * nu - (mu - q) * rise

    return rod, (1.0, 0.2, 1.5, 0.8, 0.05), lagrangian


def places(mesh, slopes):
    """∫ of nodal fields from end A, at the nodes of every element."""
    inside = np.einsum("ij,lej->lei", mesh.reference.integral, slopes) * column(mesh.lengths)[:, 0]
    whole = (mesh.lengths[:, None] * mesh.reference.weights * slopes).sum(axis=2)
    return inside + (np.cumsum(whole, axis=1) - whole)[:, :, None]


def inflated_rod(elements=4, degree=5):
    """Pressure on a curved rod whose ends are clamped and pinned at different heights."""
    rod = Rod(
        ends=("clamped", "pinned"),
        curvature=-1.5,
        actuators={"p": Pressure()},
        loads={"q": LineLoad()},
        elements=elements,
        degree=degree,
    )
    g = Quadrature(rod)

    def lagrangian(z, p):
        start, pressure, q, nu, rise = p.T
        theta = np.concatenate([start[:, None], z[:, :-2]], axis=1)
        lam, mu, angles = z[:, -2], z[:, -1], theta[:, g.at]
        out = bending(g, theta, 1 / (4 * np.pi**2), -1.5)
        across = column(mu) - column(q) * g.s
        out = out + g.total(column(lam) * np.cos(angles) + across * np.sin(angles))
        x, y = places(rod.mesh, np.cos(angles)), places(rod.mesh, np.sin(angles))
        area = 0.5 * g.total(y * np.cos(angles) - x * np.sin(angles))
        return out - lam * nu - (mu - q) * rise - pressure * area

    return rod, (0.8, 1.2, 0.5, 0.85, 0.05), lagrangian


def inflated_rod_on_a_slope(elements=4, degree=5):
    """Pressure on a rod that rolls along a line: −p (V − ½ X Y) along and across this line."""
    slope = 0.4
    rod = Rod(
        ends=("clamped", End(angle="free", slide=slope)),
        curvature=-1.5,
        loads={"p": Pressure()},
        elements=elements,
        degree=degree,
    )
    g = Quadrature(rod)

    def lagrangian(z, p):
        start, pressure, offset = p.T
        theta = np.concatenate([start[:, None], z[:, :-1]], axis=1)
        lam, angles = z[:, -1], theta[:, g.at]
        out = bending(g, theta, 1 / (4 * np.pi**2), -1.5)
        along, across = g.total(np.cos(angles - slope)), g.total(np.sin(angles - slope))
        x, y = places(rod.mesh, np.cos(angles)), places(rod.mesh, np.sin(angles))
        area = 0.5 * g.total(y * np.cos(angles) - x * np.sin(angles)) - 0.5 * along * across
        return out + lam * (across - offset) - pressure * area

    return rod, (0.8, 1.2, 0.05), lagrangian


def pulled_rod(elements=4, degree=5):
    """Cables along a part of a stretchable rod: they bend and compress it."""
    rod = Rod(
        ends=("clamped", End(angle="free", y="free")),
        axial=[[0, 4.0], [1, 6.0]],
        actuators={"T": [Tendon(0.1, 0.2, 0.8), Tendon([[0, -0.05], [1, 0.05]])]},
        loads={"q": LineLoad()},
        elements=elements,
        degree=degree,
    )
    g = Quadrature(rod)

    def lagrangian(z, p):
        start, pull, q, nu = p.T
        theta = np.concatenate([start[:, None], z[:, :-1]], axis=1)
        angles, inside = theta[:, g.at], (g.s > 0.2) & (g.s < 0.8)
        normal = column(z[:, -1]) * np.cos(angles) + column(q) * (1 - g.s) * np.sin(angles)
        compressed = normal + column(pull) * (1.0 + inside)
        out = bending(g, theta, 1 / (4 * np.pi**2), 0.0)
        offset = 0.1 * inside + 0.1 * g.s - 0.05
        out = out - pull * g.total(offset * g.kappa(theta)) - z[:, -1] * nu
        return out + g.total(normal - compressed**2 / (2 * (4.0 + 2.0 * g.s)))

    return rod, (0.3, 0.6, 0.4, 0.85), lagrangian
