"""Plain numpy twins of frames, for complex arguments: with and without the joints' places.

Both read what the frame was made from, and integrate with the frame's own Gauss–Lobatto rule.
"""

from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from numpy.polynomial import legendre

import equimorph as em
from equimorph.structures import Frame, Member
from typecheck import unchecked


def rule(degree):
    """Nodes, weights and derivative matrix of the rule on [0, 1]."""
    top = np.eye(degree + 1)[-1]
    inner = np.sort(legendre.legroots(legendre.legder(top)).real)
    x = np.concatenate([[-1.0], inner, [1.0]])
    weights = 2.0 / (degree * (degree + 1) * legendre.legval(x, top) ** 2)
    powers = legendre.legvander(x, degree)
    slopes = np.stack([legendre.legval(x, legendre.legder(row)) for row in np.eye(degree + 1)], 1)
    return 0.5 * (x + 1.0), 0.5 * weights, 2.0 * slopes @ np.linalg.inv(powers)


def segment(tangent, w, tables):
    """∫ ρ × dρ along a member, ρ from its start: twice the area between it and its chord."""
    nodes, weights, _ = tables
    basis = np.linalg.inv(legendre.legvander(2.0 * nodes - 1.0, len(nodes) - 1))
    integral = [
        0.5 * legendre.legval(2.0 * nodes - 1.0, legendre.legint(row, lbnd=-1)) for row in basis.T
    ]
    pieces = tangent.reshape(*tangent.shape[:2], -1, len(nodes))
    step = w.sum() / pieces.shape[2]
    inside = step * pieces @ np.array(integral)
    stops = np.cumsum(step * pieces @ weights, axis=2)
    places = inside + (stops - step * pieces @ weights)[..., None]
    cross = places[0] * pieces[1] - places[1] * pieces[0]
    return (cross * step * weights).sum(axis=(1, 2))


@dataclass
class Twin:
    """A frame in units of its mean length and bending stiffness, member by member."""

    frame: Frame
    data: dict = field(init=False)

    def __post_init__(self):
        self.data = self.frame.identity()
        self.names = [each.name for each in self.frame.parameters]
        self.joints = list(self.data["joints"])
        self.members = [Member(**each) for each in self.data["members"]]
        self.places = np.array(list(self.data["joints"].values()))
        self.ends = [[self.joints.index(end) for end in each.ends] for each in self.members]
        chords = [np.hypot(*(self.places[b] - self.places[a])) for a, b in self.ends]
        self.lengths = []
        for each, chord in zip(self.members, chords, strict=True):
            half = each.curvature * chord / 2.0
            self.lengths.append(chord if half == 0.0 else chord * np.arcsin(half) / half)
        self.unit = np.mean(self.lengths), np.mean([each.EI for each in self.members])
        self.force = self.unit[1] / self.unit[0] ** 2

    def turns(self, z, p):
        """ψ at the nodes of every member, and the prescribed ones filled in."""
        model = self.frame.model
        full = np.zeros((len(z), len(model.place)), np.result_type(z, p))
        full[:, model.place >= 0] = z[:, : self.frame.unknowns]
        for joint, given in self.data["supports"].items():
            if given.get("angle") == "held":
                node = model.joint_nodes[self.joints.index(joint)]
                full[:, node] = self.actuated(p, "turn", joint)
        return full[:, model.piece_nodes]

    def actuated(self, p, kind, name, reverse=1.0):
        """Sum over the actuators of what they do somewhere."""
        total = np.zeros((len(p), 2) if kind == "move" else len(p))
        for actuator, given in self.data["actuators"].items():
            for place, rate in given.get(kind, {}).items():
                sign = 1.0 if place == name else reverse
                if name in (place, "-".join(reversed(place.split("-")))):
                    value = np.array(rate) * sign
                    total = total + np.multiply.outer(p[:, self.names.index(actuator)], value)
        return total

    def load(self, p, name):
        """Sum over the loads of what acts on a joint or member, (x, y, couple)."""
        total = np.zeros((len(p), 3))
        weights = {each.name: each.weight or 0.0 for each in self.members}
        for load, given in self.data["loads"].items():
            for place, vector in given.items():
                if place == "pressure":
                    continue
                factor = float(place == name) + (place == "weight") * weights.get(name, 0.0)
                wide = factor * np.array([*vector, 0.0, 0.0][:3])
                total = total + np.multiply.outer(p[:, self.names.index(load)], wide)
        return total

    def fields(self, z, p):
        """For each member: bending energy, axial compliance, arclengths, weights and tangents."""
        length, bending = self.unit
        nodes, weights, slopes = rule(self.data["degree"])
        count = self.data["elements"]
        turns = self.turns(z, p)
        for m, (member, (a, b)) in enumerate(zip(self.members, self.ends, strict=True)):
            size = self.lengths[m] / length
            pieces = [turns[:, m, e * len(nodes) - e :][:, : len(nodes)] for e in range(count)]
            psi = np.concatenate(pieces, axis=1)
            step = size / count
            s = np.concatenate([(e + nodes) * step for e in range(count)])
            w = np.tile(weights * step, count)
            curved = np.concatenate([piece @ slopes.T / step for piece in pieces], axis=1)
            kappa = self.actuated(p, "curvature", member.name, -1.0) * length
            energy = 0.5 * member.EI / bending * ((curved - kappa[:, None]) ** 2 @ w)
            angle = np.arctan2(*(self.places[b] - self.places[a])[::-1])
            angle = angle + member.curvature * length * (s - size / 2.0)
            drawn = np.stack([np.cos(angle), np.sin(angle)])
            tangent = np.stack([np.cos(angle + psi), np.sin(angle + psi)])
            strain = self.actuated(p, "length", member.name) / length / size
            soft = 0.0 if member.EA is None else self.force / member.EA
            yield energy, soft, s, w, drawn, tangent, strain

    def supports(self, z, p):
        """Energy of springs against turning, and work of couples; stiffness and move of others."""
        length, bending = self.unit
        total = np.zeros(len(z))
        turns, node = self.turns(z, p), {}
        for row, member, ends in zip(
            self.frame.model.piece_nodes, self.members, self.ends, strict=True
        ):
            for side in (0, -1):
                if member.ends[side] not in member.hinges:
                    node[ends[side]] = int(row[side]), turns
        places = self.frame.model.piece_nodes
        for j, (joint, _) in enumerate(self.data["joints"].items()):
            if j not in node:
                continue
            m, side = np.argwhere(places == node[j][0])[0]
            psi = turns[:, m, side]
            total = total - self.load(p, joint)[:, 2] / (self.force * length) * psi
            spring = self.data["supports"].get(joint, {}).get("angle", 0.0)
            if spring != "held":
                given = self.actuated(p, "turn", joint)
                total = total + 0.5 * spring * length / bending * (psi - given) ** 2
        return total

    def lagrangian(self, z, p):
        """L in turns and multipliers; what the latter mean is read from the frame's model."""
        model, length = self.frame.model, self.unit[0]
        y = np.concatenate([z[:, self.frame.unknowns :], p, np.ones((len(z), 1))], axis=1)
        total = self.supports(z, p)
        for m, (energy, soft, s, w, drawn, tangent, strain) in enumerate(self.fields(z, p)):
            start = np.stack([y @ model.forces[axis].start[:, m] for axis in (0, 1)])
            line = self.load(p, self.members[m].name)[:, :2].T * length / self.force
            force = start[:, :, None] - line[:, :, None] * s
            pull = (force * tangent).sum(axis=0)
            stored = (1.0 + strain[:, None]) * pull + 0.5 * soft * pull**2
            total = total + energy - stored @ w + ((force * drawn[:, None]).sum(axis=0)) @ w
        for joint, given in self.data["supports"].items():
            moved = self.actuated(p, "move", joint) / length
            for axis in (0, 1):
                stiff = given.get("xy"[axis])
                if stiff is None:
                    continue
                force = y @ model.forces[axis].supports[:, self.joints.index(joint)]
                give = 0.0 if stiff == "held" else self.force / length / stiff
                total = total + force * moved[:, axis] - 0.5 * give * force**2
        return total

    def pressed(self, psi, moves, p):
        """Energy whose change is the work p (δA − ½ [r × δr]) of pressures, A = ½ ∫ r × dr.

        A is that of the triangles of the origin and the chords, and between chords and members; r
        at the ends of the chain is taken for constant, which the change by a complex step wants.
        """
        length, tables = self.unit[0], rule(self.data["degree"])
        fields, total = list(self.fields(psi, p)), 0.0
        places = self.places / length + moves
        for k, name in enumerate(self.names):
            chain = self.data["loads"].get(name, {}).get("pressure", [])
            size = p[:, k] * length / self.force
            for first, last in pairwise(chain):
                pair = [self.joints.index(first), self.joints.index(last)]
                m = self.ends.index(pair if pair in self.ends else pair[::-1])
                a, b = (places[:, at].T for at in self.ends[m])
                twice = a[0] * b[1] - a[1] * b[0] + segment(fields[m][5], fields[m][3], tables)
                total = total + 0.5 * size * (twice if pair in self.ends else -twice)
            for end, sign in ((chain[0], 1.0), (chain[-1], -1.0)) if chain else ():
                x, y = places[:, self.joints.index(end)].T
                total = total + 0.5 * sign * size * (x.real * y - y.real * x)
        return total

    def full(self, psi, moves, forces, reactions, p):
        """L in turns, moves of the joints, forces at the members' starts, and reactions.

        Nothing is eliminated: each member joins its joints, each joint keeps to its support. Forces
        in members under pressure are the means of those at their ends.
        """
        length = self.unit[0]
        total = self.supports(psi, p) + self.pressed(psi, moves, p)
        for m, (energy, soft, s, w, drawn, tangent, strain) in enumerate(self.fields(psi, p)):
            start, end = self.ends[m]
            line = self.load(p, self.members[m].name)[:, :2].T * length / self.force
            force = forces[:, m].T[:, :, None] - line[:, :, None] * s
            pull = (force * tangent).sum(axis=0)
            stored = (1.0 + strain[:, None]) * pull + 0.5 * soft * pull**2
            total = total + energy - stored @ w + ((force * drawn[:, None]).sum(axis=0)) @ w
            size = self.lengths[m] / length
            total = total + (forces[:, m] * (moves[:, end] - moves[:, start])).sum(axis=1)
            total = total - size * (line.T * moves[:, end]).sum(axis=1)
        for j, joint in enumerate(self.joints):
            total = total - (self.load(p, joint)[:, :2] / self.force * moves[:, j]).sum(axis=1)
            given = self.data["supports"].get(joint, {})
            goal = self.actuated(p, "move", joint) / length
            for axis in (0, 1):
                stiff = given.get("xy"[axis])
                if stiff is not None:
                    give = 0.0 if stiff == "held" else self.force / length / stiff
                    force = reactions[:, j, axis]
                    total = total - force * (moves[:, j, axis] - goal[:, axis])
                    total = total - 0.5 * give * force**2
        return total


def loaded(frame, **values):
    """The natural state, lifted to parameters, without the cost of checks."""
    with unchecked():
        return em.lift(frame.natural_state(), to=values).end.state


def full_state(frame, state):
    """The state with moves of joints, forces of members and reactions, as one vector."""
    model, z, p = frame.model, state.z[None], state.p[None]
    force, count = model.bending / model.length**2, len(model.network.joints)
    moves = [
        [frame.displacement(joint, axis)(state) / model.length for axis in "xy"]
        for joint in model.network.joints
    ]
    reactions = np.zeros((count, 2))
    for j, joint in enumerate(model.network.joints):
        for axis in (0, 1):
            if model.network.supports[j, axis]:
                reactions[j, axis] = frame.reaction(joint, "xy"[axis])(state) / force
    ends, pressed = frame.end_forces(z, p)[0], model.patterns.pressures.any(axis=0)
    starts = np.where(pressed[:, None], ends.mean(axis=1), ends[:, 0])
    parts = (state.z[: frame.unknowns], np.ravel(moves), starts.ravel(), reactions.ravel())
    return np.concatenate(parts)


def full_lagrangian(frame, twin, p):
    """L of such a vector, with many lanes."""
    n, members, joints = frame.unknowns, len(twin.members), len(twin.joints)
    cuts = np.cumsum([n, 2 * joints, 2 * members])

    def value(x):
        psi, moves, forces, reactions = np.split(x, cuts, axis=1)
        wide = np.concatenate([psi, np.zeros((len(x), frame.constraints))], axis=1)
        shapes = ((-1, joints, 2), (-1, members, 2), (-1, joints, 2))
        parts = (moves, forces, reactions)
        given = [part.reshape(shape) for part, shape in zip(parts, shapes, strict=True)]
        return twin.full(wide, *given, np.repeat(p[None], len(x), axis=0))

    return value


def gradients(value, points):
    """Gradients at several points by complex steps, all in one call."""
    count, size = points.shape
    moved = np.repeat(points.astype(complex), size, axis=0)
    moved += 1e-30j * np.tile(np.eye(size), (count, 1))
    return (value(moved).imag / 1e-30).reshape(count, size)
