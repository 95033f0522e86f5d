"""Specimens of every structure with independent Lagrangians, for the tests of the contract."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from equimorph.model import Parameter
from equimorph.structures import (
    Bar,
    EnergyStructure,
    Frame,
    Member,
    Rod,
    Spring,
    Structure,
    Truss,
    Unknown,
)
from oracles import rods, spatial_rods
from oracles.frames import Twin
from oracles.spatial_frames import SpaceTwin, bend, shed


@dataclass(frozen=True)
class Specimen:
    """A structure, parameters to test it at, and L = E + λ·c (complex arguments allowed)."""

    name: str
    structure: Structure
    centre: tuple[float, ...]
    spread: float
    reach: float
    lagrangian: Callable[[np.ndarray, np.ndarray], np.ndarray]

    def states(self, lanes=5, seed=0):
        """Random states far from equilibrium, and directions (dz, dp)."""
        generator = np.random.default_rng(seed)
        shape = (lanes, len(self.centre))
        p = np.array(self.centre) + self.spread * generator.uniform(-1.0, 1.0, shape)
        z = self.reach * self.structure.sample(p, generator)
        return z, p, generator.normal(size=z.shape), generator.normal(size=p.shape)


def _rod(load, elements=4, degree=5):
    rod = Rod(load, elements=elements, degree=degree)
    assembled, loads = rod.mechanics.layout.assembled, rod.mechanics.loads

    def lagrangian(z, p):
        theta = np.concatenate([p[:, 1:2] + p[:, :1], z[:, :-2], p[:, 1:2] - p[:, :1]], axis=1)
        energy = 0.5 * np.einsum("li,ij,lj->l", theta, assembled, theta)
        energy = energy - p[:, 2] * (np.sin(theta) @ loads)
        along = np.cos(theta) @ rod.mesh.weights - p[:, 3]
        return energy + z[:, -2] * along + z[:, -1] * (np.sin(theta) @ rod.mesh.weights)

    return Specimen(f"rod, {load}", rod, (1.0, 0.2, 1.5, 0.8), 0.19, 1.0, lagrangian)


def _general(name, make, resolution):
    rod, centre, lagrangian = make(**resolution)
    return Specimen(name, rod, centre, 0.15, 1.0, lagrangian)


def _spring_energy(z, p):
    delta, (x, force, k) = z[:, 0], p.T
    return 0.5 * k * (1 - x / np.cos(delta)) ** 2 + force * x * np.tan(delta)


SPRING_PARAMETERS = (
    Parameter("x_l", "natural length", 1.0, "actuator", 1.0, 0.0),
    Parameter("F", "k", 1.0, "load", 0.0),
    Parameter("k", "force/length", 1.0, "fixed", 1.3, 0.0),
)


def written_spring():
    """The spring, from its energy."""
    return EnergyStructure(
        "k/2*(1 - x_l/cos(delta))**2 + F*x_l*tan(delta)",
        [Unknown("delta", "acos(fmin(x_l, 1))", lower=-np.pi / 2, upper=np.pi / 2)],
        SPRING_PARAMETERS,
        draw=[["x_l", 0], [0, "x_l*tan(delta)"]],
        descriptors={"height": "x_l*tan(delta)"},
    )


LINKS = 5


def closed_chain():
    """Five hinged links of length 1/5 between supports a span apart, with hinge springs.

    E = ½ k Σ (φᵢ₊₁ − φᵢ)² + ½ k a (φ₁ − φ₅)² − w Σ yᵢ, with the ends held by two constraints.
    """
    angles = [f"phi{i}" for i in range(LINKS)]
    pairs = list(zip(angles[1:], angles, strict=False))
    bends = " + ".join(f"({b} - {a})**2" for b, a in pairs)
    heights = " + ".join(f"{LINKS - i}*sin({angle})" for i, angle in enumerate(angles))
    start = np.arccos(0.9) * np.array([1.0, 0.8, 0.0, -0.8, -1.0])
    return EnergyStructure(
        "bending - w*load",
        [
            Unknown(angle, float(v), (-1.5, 1.5), mass=0.2)
            for angle, v in zip(angles, start, strict=True)
        ],
        [
            Parameter("span", "L", 1.0, "actuator", None, 0.0, 1.0),
            Parameter("a", "1", 1.0, "actuator", 0.3),
            Parameter("w", "1", 1.0, "load"),
        ],
        constraints=[
            "(" + " + ".join(f"cos({angle})" for angle in angles) + f")/{LINKS} - span",
            "(" + " + ".join(f"sin({angle})" for angle in angles) + f")/{LINKS}",
        ],
        definitions={
            "bending": f"({bends} + a*({angles[0]} - {angles[-1]})**2)/2",
            "load": f"({heights})/{LINKS}",
        },
    )


def _chain_lagrangian(z, p):
    phi, (span, a, w) = z[:, :LINKS], p.T
    bending = 0.5 * (np.diff(phi, axis=1) ** 2).sum(axis=1)
    bending = bending + 0.5 * a * (phi[:, 0] - phi[:, -1]) ** 2
    load = np.cumsum(np.sin(phi), axis=1).sum(axis=1) / LINKS
    along = np.cos(phi).mean(axis=1) - span
    return bending - w * load + z[:, -2] * along + z[:, -1] * np.sin(phi).mean(axis=1)


def arch_truss(strain):
    """Five joints in the plane, seven bars, two of them actuated together, two loads."""
    return Truss(
        {"A": (-1.0, 0.0), "B": (-0.5, 0.4), "C": (0.0, 0.1), "D": (0.5, 0.4), "E": (1.0, 0.0)},
        [
            *(("A", "B"), ("B", "D"), ("C", "E"), ("D", "E")),
            *(Bar(("A", "C"), 2.0), Bar(("B", "C"), 0.5, 1e-3), Bar(("C", "D"), 1.0, 2e-3, 0.6)),
        ],
        {"A": "xy", "E": "y"},
        {"F": {"C": (0.0, -1.0)}, "H": {"B": (1.0, 0.0), "D": (0.5, -0.2)}},
        {"a": {"B-D": 1.0, "A-B": -0.5}, "b": {"C-E": 1.0}},
        strain,
    )


def tripod():
    """Three bars in space to one joint, another joint held by three more; one bar actuated."""
    return Truss(
        {"A": (1, 0, 0), "B": (-1, 1, 0), "C": (-1, -1, 0), "D": (0, 0, 1), "E": (0, 0, 2)},
        [("A", "D"), ("B", "D"), ("C", "D"), ("D", "E"), ("A", "E"), Bar(("B", "E"), 3.0)],
        {"A": "xyz", "B": "xyz", "C": "xyz"},
        {"F": {"E": (0.1, 0.0, -1.0)}},
        {"a": {"B-D": 1.0}},
    )


def _truss_lagrangian(truss):
    bars, places = truss.network.members, truss.network.places
    joints = list(truss.network.joints)
    names = [parameter.name for parameter in truss.parameters]
    data = truss.identity()

    def lagrangian(z, p):
        x = np.repeat(places[None], len(z), axis=0).astype(np.result_type(z, p))
        for k, move in enumerate(truss.network.moves):
            joint, axis = move.split(".")
            x[:, joints.index(joint), "xyz".index(axis)] += z[:, k]
        total = np.zeros(len(z), x.dtype)
        for name, forces in data["loads"].items():
            for joint, force in forces.items():
                moved = x[:, joints.index(joint)] - places[joints.index(joint)]
                total = total - p[:, names.index(name)] * (moved @ np.array(force))
        for bar in bars:
            i, j = (joints.index(end) for end in bar.ends)
            rest = np.linalg.norm(places[j] - places[i]) if bar.rest is None else bar.rest
            for name, rates in data["actuators"].items():
                rest = rest + rates.get(bar.name, 0.0) * p[:, names.index(name)]
            square = ((x[:, j] - x[:, i]) ** 2).sum(axis=1)
            green = data["strain"] == "green"
            strain = (square / rest**2 - 1) / 2 if green else np.sqrt(square) / rest - 1
            total = total + bar.EA * rest * strain**2 / 2
        return total

    return lagrangian


def _truss(name, truss):
    centre = tuple(0.1 * np.arange(1.0, len(truss.parameters) + 1.0))
    return Specimen(name, truss, centre, 0.1, 0.08, _truss_lagrangian(truss))


def portal(axial, elements=1, degree=5):
    """Two bays with an arch, a hinge, springs, a roller, and every kind of load and actuator."""
    return Frame(
        {"A": (0, 0), "B": (0.1, 1.2), "C": (1, 1), "D": (2, 1.1), "E": (2.2, 0), "F": (1, 0.1)},
        [
            Member(("A", "B"), 2.0, axial),
            Member(("B", "C"), 1.0, 80.0, curvature=-0.7, weight=2.0),
            Member(("D", "C"), 1.5, axial, hinges=["C"], weight=0.5),
            Member(("E", "D"), 1.0, axial),
            Member(("C", "F"), 0.5, axial, hinges=["C", "F"]),
        ],
        {
            "A": "fixed",
            "E": {"x": 30.0, "y": "held", "angle": 2.0},
            "F": "xy",
            "D": {"y": 5.0},
        },
        {
            "P": {"C": (0.1, -1.0), "B": (0.3, 0.0, 0.2)},
            "q": {"B-C": (0.1, -1.0), "weight": (0.2, -1.0)},
        },
        {
            "k": {"curvature": {"A-B": 1.0, "C-D": 0.5}, "turn": {"A": 0.4, "E": 0.3}},
            "d": {"length": {"B-C": 0.2, "C-F": -0.1}, "move": {"F": (0.1, 0.2), "E": (0.3, 0.1)}},
        },
        elements=elements,
        degree=degree,
    )  # fmt: skip


def toggle(elements=2, degree=4):
    """Two inextensible members between clamps: the smallest frame with multipliers alone."""
    return Frame(
        {"A": (-1, 0), "B": (0, 0.3), "C": (1, 0)},
        [("A", "B"), ("B", "C")],
        {"A": "fixed", "C": "fixed"},
        {"P": {"B": (0, -1)}},
        {"a": {"turn": {"A": 1.0, "C": -1.0}}},
        elements=elements,
        degree=degree,
    )


def _frame(name, frame):
    centre = tuple(0.1 * np.arange(1.0, len(frame.parameters) + 1.0))
    return Specimen(name, frame, centre, 0.1, 0.3, Twin(frame).lagrangian)


def _spatial_frame(name, frame):
    centre = tuple(0.1 * np.arange(1.0, len(frame.parameters) + 1.0))
    return Specimen(name, frame, centre, 0.1, 1.0, SpaceTwin(frame).lagrangian)


def specimens(fine=False):
    """All specimens: as coarse as tests of the contract want them, or resolved as by default."""
    planar, spatial, framed, framed_in_space = (
        {"elements": elements, "degree": degree} if fine else {}
        for elements, degree in ((6, 9), (6, 6), (2, 8), (2, 6))
    )
    return (
        _rod("uniform", **planar),
        _rod("left-half", **planar),
        _general("sprung rod", rods.sprung_rod, planar),
        _general("stretchable cantilever", rods.stretchable_cantilever, planar),
        _general("sliding rod", rods.sliding_rod, planar),
        _general("rolling rod", rods.rolling_rod, planar),
        _general("stretchable arch", rods.stretchable_arch, planar),
        _general("inflated rod", rods.inflated_rod, planar),
        _general("inflated rod on a slope", rods.inflated_rod_on_a_slope, planar),
        _general("pulled rod", rods.pulled_rod, planar),
        _general("arch in space", spatial_rods.arch, spatial),
        _general("everything on a rod in space", spatial_rods.everything, spatial),
        _general("sheared cantilever in space", spatial_rods.cantilever, spatial),
        _general("guided rod in space", spatial_rods.guided, spatial),
        _general("rod with a phase condition", spatial_rods.coaxial, spatial),
        Specimen("spring", Spring(1.3), (0.9, 0.1, 1.3), 0.2, 0.7, _spring_energy),
        Specimen(
            "spring by its energy", written_spring(), (0.9, 0.1, 1.3), 0.2, 0.7, _spring_energy
        ),
        _truss("truss", arch_truss("engineering")),
        _truss("truss, Green strain", arch_truss("green")),
        _truss("truss in space", tripod()),
        _frame("frame", portal(50.0, **framed)),
        _frame("frame, inextensible in part", portal(None, **framed)),
        _frame("frame of two members", toggle(**framed)),
        _spatial_frame("everything in a frame in space", shed(**framed_in_space)),
        _spatial_frame("bend in space", bend(**framed_in_space)),
        Specimen(
            "chain by its energy", closed_chain(), (0.8, 0.3, 0.5), 0.15, 1.0, _chain_lagrangian
        ),
    )


SPECIMENS = specimens()
