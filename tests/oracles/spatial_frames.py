"""Lagrangian of frames in space, written out for complex arguments, from what they are made of.

Rotation matrices R of q/|q| and strains from 2 conj(w) w', with the frame's own Gauss–Lobatto rule;
what the multipliers mean is read from the frame's model.
"""

from dataclasses import dataclass, field

import numpy as np

from equimorph.structures import SpatialFrame, SpatialMember
from oracles.frames import rule
from oracles.spatial_rods import matrix, product


def rotation(vector):
    """Quaternion of a rotation about a fixed axis by an angle that may be complex."""
    axis, angle = vector
    out = np.zeros((*np.shape(angle), 4), np.result_type(angle, float))
    out[..., 0] = np.cos(angle / 2)
    out[..., 1:] = np.sin(angle / 2)[..., None] * np.asarray(axis)
    return out


def unit(vector):
    return np.asarray(vector, float) / np.linalg.norm(vector)


@dataclass
class SpaceTwin:
    """A frame in space in units of its mean length and bending stiffness, piece by piece."""

    frame: SpatialFrame
    data: dict = field(init=False)

    def __post_init__(self):
        self.data = self.frame.identity()
        self.names = [each.name for each in self.frame.parameters]
        self.joints = list(self.data["joints"])
        self.members = [SpatialMember(**each) for each in self.data["members"]]
        self.places = np.array(list(self.data["joints"].values()))
        self.pieces = []
        for member in self.members:
            for a, b in zip(member.joints, member.joints[1:], strict=False):
                i, j = self.joints.index(a), self.joints.index(b)
                chord = np.linalg.norm(self.places[j] - self.places[i])
                half = member.curvature * chord / 2.0
                self.pieces.append(
                    (member, i, j, chord if half == 0 else chord * np.arcsin(half) / half)
                )
        plane = [1.0 if each.EI is None else each.EI for each in self.members]
        self.unit = np.mean([each[3] for each in self.pieces]), np.mean(plane)
        self.force = self.unit[1] / self.unit[0] ** 2

    def sum_of(self, p, group, kind, names):
        """What parameters of a group do to anything with one of these names."""
        total = 0.0
        for name, given in self.data[group].items():
            table = given if kind is None else given.get(kind, {})
            for place, rate in table.items():
                if place in names:
                    total = total + np.multiply.outer(p[:, self.names.index(name)], np.array(rate))
        return total

    def held(self, p, joint):
        """Rotation of a support."""
        w = np.zeros((len(p), 4), p.dtype)
        w[:, 0] = 1.0
        for name, given in self.data["actuators"].items():
            vector = given.get("turn", {}).get(joint)
            if vector is not None:
                angle = np.linalg.norm(vector) * p[:, self.names.index(name)]
                w = product(w, rotation((unit(vector), angle)))
        return w

    def turns(self, z, p):
        """Unit quaternions at the ends of the pieces, their inner nodes, and cost of lengths."""
        model, frame = self.frame.model, self.frame
        count = len(model.free)
        q = z[:, : 4 * count].reshape(len(z), count, 4)
        square = (q * q).sum(axis=-1)
        w = np.zeros((len(z), len(model.turning), 4), np.result_type(z, p))
        w[:, model.free] = q / np.sqrt(square)[..., None]
        for k, body in enumerate(model.network.bodies):
            joint = self.joints[body.joint]
            if int(body.turning) == 1:
                w[:, k] = self.held(p, joint)
        for h, node in enumerate(model.hinged):
            angle = z[:, 4 * count + h]
            w[:, node] = product(w[:, model.parents[h]], rotation((model.hinge_axes[h], angle)))
        lengths = 4000.0 * frame.mass[: 4 * count : 4]
        return w, 0.125 * ((square - 1.0) ** 2) @ lengths

    def stiffness(self, member):
        """K and the axial compliance of a member."""
        plane = 1.0 if member.EI is None else member.EI
        aside = plane if member.EI_out is None else member.EI_out
        twist = plane / 1.3 if member.GJ is None else member.GJ
        soft = 0.0 if member.EA is None else self.force / member.EA
        return np.array([twist, aside, plane]) / self.unit[1], soft

    def free(self, p, k):
        """Strains of a piece that are free of stress: of the cross-sections, and along."""
        member, i, j, size = self.pieces[k]
        name, length = "-".join((self.joints[i], self.joints[j])), self.unit[0]
        share = sum(each[3] for each in self.pieces if each[0] is member)
        along = 0.0 if member.length is None else member.length / share - 1.0
        for of, wide in {member.name: share, name: size}.items():
            along = along + self.sum_of(p, "actuators", "length", (of,)) / wide
        turned = self.sum_of(p, "actuators", "curvature", (name, member.name)) * length
        return np.zeros((len(p), 3)) + np.array(member.strains) * length + turned, along

    def line(self, p, k):
        """Load per length of a piece."""
        member, i, j, _ = self.pieces[k]
        names = ("-".join((self.joints[i], self.joints[j])), member.name)
        heavy = (member.weight or 0.0) * self.sum_of(p, "loads", None, ("weight",))
        total = self.sum_of(p, "loads", None, names) + heavy
        return np.zeros((len(p), 3)) + total * self.unit[0] / self.force

    def lagrangian(self, z, p):
        """L in turns, angles of hinges and multipliers."""
        model, length = self.frame.model, self.unit[0]
        y = np.concatenate([z[:, self.frame.unknowns :], p, np.ones((len(z), 1))], axis=1)
        w, total = self.turns(z, p)
        x, weights, slopes = rule(self.data["degree"])
        elements = self.data["elements"]
        for k, (member, i, j, size) in enumerate(self.pieces):
            stiff, soft = self.stiffness(member)
            (strain, along), line = self.free(p, k), self.line(p, k)
            whole, step = size / length, size / length / elements
            axes = member.axes(self.places[j] - self.places[i])
            start = y @ model.forces.members[:, k]
            for e in range(elements):
                local, s = w[:, model.nodes[k * elements + e]], (e + x) * step
                moved = np.einsum("ij,lja->lia", slopes / step, local)
                v = 2.0 * product(local * np.array([1.0, -1.0, -1.0, -1.0]), moved)[..., 1:]
                bend = member.curvature * length * (s - whole / 2.0)
                drawn = np.einsum("ab,ibc->iac", axes, matrix(rotation(((0, 0, 1), bend))))
                u = np.einsum("lia,iab->lib", v, drawn) - strain[:, None]
                total = total + np.einsum("i,k,lik->l", 0.5 * step * weights, stiff, u * u)
                tangent = np.einsum("liab,ib->lia", matrix(local), drawn[..., 0])
                force = start[:, None] - line[:, None] * s[:, None]
                pull = (force * tangent).sum(axis=-1)
                stored = (1.0 + np.reshape(along, (-1, 1))) * pull + 0.5 * soft * pull**2
                total = total - (stored - (force * drawn[..., 0]).sum(axis=-1)) @ (step * weights)
        return total + self.supports(y, p)

    def supports(self, y, p):
        """Work of supports that move, and energy of springs."""
        model, length, total = self.frame.model, self.unit[0], 0.0
        for joint, given in self.data["supports"].items():
            force = y @ model.forces.supports[:, self.joints.index(joint)]
            moved = self.sum_of(p, "actuators", "move", (joint,))
            total = total + (force * moved / length).sum(axis=-1)
            for axis, name in enumerate("xyz"):
                stiff = given.get(name, "held")
                if stiff != "held":
                    total = total - 0.5 * self.force / length / stiff * force[:, axis] ** 2
        return total


def shed(elements=1, degree=5):
    """A hinge, a ball joint, arcs, inclined supports, springs, every load and actuator."""
    members = [
        SpatialMember(("A", "B", "C"), GJ=0.5, EI_out=2.0, EA=50.0, curvature=0.3,
                      hinges={"B": (0.0, 0.1, 1.0)}),
        SpatialMember(("D", "B"), EI=1.3, normal=(1, 1, 0.3)),
        SpatialMember(("D", "C"), EA=80.0, hinges=["C"], strains=(0.1, 0.2, 0.3), weight=1.0),
        ("C", "E"),
        SpatialMember(("B", "E"), EA=40.0, length=1.15),
    ]  # fmt: skip
    return SpatialFrame(
        {"A": (0, 0, 0), "B": (1, 0, 0.2), "C": (1.2, 1, 0.1), "D": (0, 1, 0.5), "E": (2, 0.4, 0)},
        members,
        {
            "A": "fixed",
            "D": {"plane": (1, 1, 2.0), "rotation": (0, 0, 1.0)},
            "E": {"x": "held", "y": 30.0, "z": "held", "rotation": "held"},
        },
        {"P": {"B": (0.3, 0, -1)}, "q": {"D-B": (0, 0.2, -1), "weight": (0, 0.1, -1)}},
        {
            "a": {"move": {"A": (1, 0.2, 0)}, "turn": {"A": (0.3, 0.4, 1), "D": (0, 1, 0)}},
            "b": {
                "turn": {"A": (1, 0, 0)},
                "curvature": {"A-B": (1, 2, 3)},
                "length": {"A-B-C": 0.3},
            },
        },
        elements=elements,
        degree=degree,
    )  # fmt: skip


def bend(elements=2, degree=4):
    """A right-angle bend between clamps: the smallest frame with multipliers alone."""
    return SpatialFrame(
        {"A": (0, 0, 0), "B": (1, 0, 0), "C": (1, 1, 0)},
        [("A", "B", "C")],
        {"A": "fixed", "C": "fixed"},
        {"P": {"B": (0, 0, -1)}},
        {"a": {"turn": {"A": (0, 0, 1.0)}}},
        elements=elements,
        degree=degree,
    )
