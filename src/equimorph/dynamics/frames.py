"""Planar frames as linkages: a chain for each member, elastic joints at their corners."""

from itertools import pairwise

import numpy as np
from scipy.interpolate import CubicSpline

from equimorph.arrays import Float, Int
from equimorph.dynamics.linkage import Bends, Linkage, Supports
from equimorph.dynamics.mechanism import Vector
from equimorph.dynamics.plant import PlanarChained
from equimorph.errors import MissingError
from equimorph.structures import Frame, State, States
from equimorph.structures.frame.model import FrameModel
from equimorph.structures.rod.units import FOUR_PI_SQUARED


def frame_linkage(frame: Frame, links: int, masses: Float[np.ndarray, " members"]) -> Linkage:
    """A frame of members of N links each, in the units of its model.

    Masses are in units that make T that of a rod of the mean length, density and stiffness.
    """
    model = frame.model
    made, count = model.network, len(frame.parameters) + 1
    nodes, members = len(made.joints), len(made.members)
    sizes = np.repeat(model.lengths[:, None] / links, links, axis=1)
    size = 3 * nodes + 2 * members * links
    patterns = model.patterns
    couples, node_forces = np.zeros((size, count)), np.zeros((nodes, 2, count))
    couples[2 * nodes : 3 * nodes, :-1] = patterns.couples.T
    node_forces[:, :, :-1] = patterns.forces.transpose(1, 2, 0)
    forces = np.zeros((members, links + 1, 2, count))
    hats = np.full(links + 1, 1.0)
    hats[[0, -1]] = 0.5
    lines = patterns.lines.transpose(1, 2, 0) * (model.lengths / links)[:, None, None]
    forces[..., :-1] = hats[:, None, None] * lines[:, None]
    unit = model.bending / model.length**2
    axial = [np.inf if each.EA is None else float(each.EA) / unit for each in made.members]
    strains = np.zeros((members, links, count))
    strains[..., :-1] = (patterns.length / model.lengths).T[:, None]
    pressure = np.zeros((members, count))
    pressure[:, :-1] = patterns.pressures.T
    return Linkage(
        _supports(model),
        made.ends,
        sizes,
        np.repeat(masses[:, None] / links, links, axis=1),
        _bends(model, links),
        np.repeat(np.array(axial)[:, None], links, axis=1),
        strains,
        forces,
        couples,
        node_forces,
        pressure,
        _poles(model),
    )


def _poles(model: FrameModel) -> Int[np.ndarray, "settings 2"]:
    """Nodes in whose x and y the end of a chain stays that moves along the other axis."""
    found = np.zeros((model.patterns.count + 1, 2), int)
    for chain in model.chains:
        row = found[chain.scalar - model.multipliers]
        row[:] = chain.ends[0]
        for end in chain.ends:
            held = np.isinf(model.supports[end, :2])
            if held.any():
                row[held] = end
    return found


def _supports(model: FrameModel) -> Supports:
    made, patterns = model.network, model.patterns
    nodes, count = len(made.joints), patterns.count + 1
    places = np.zeros((nodes, 2, count))
    places[..., :-1] = patterns.moves.transpose(1, 2, 0)
    places[..., -1] = made.places / model.length
    turns = np.zeros((nodes, count))
    turns[:, :-1] = patterns.turns[..., 0].T
    stiff = model.supports
    return Supports(
        np.tile(np.eye(2), (nodes, 1, 1)), stiff[:, :2], places, stiff[:, 2], turns, made.rigid
    )


def drawn_angles(model: FrameModel, s: Float[np.ndarray, " shares"]) -> np.ndarray:
    """Tangent angles of the members as drawn, at shares of their lengths."""
    chords = np.arctan2(*model.network.chords.T[::-1])
    bends = np.array([float(each.curvature) for each in model.network.members]) * model.length
    return np.asarray(chords[:, None] + np.outer(bends * model.lengths, s - 0.5))


def _bends(model: FrameModel, links: int) -> Bends:
    """Joints between links, and half a link with twice the stiffness at rigid corners."""
    made, count = model.network, model.patterns.count + 1
    nodes = len(made.joints)
    drawn = drawn_angles(model, np.array([0.0, 1.0]))
    plus, minus, stiffness, rest = [], [], [], []
    for m, ends in enumerate(made.ends.tolist()):
        angles = 3 * nodes + m * links + np.arange(links)
        size = model.lengths[m] / links
        natural = np.zeros(count)
        natural[:-1] = model.patterns.strains[:, m, 0]
        natural[-1] = float(made.members[m].curvature) * model.length
        rigid = model.rigidity[m] / size
        for left, right in pairwise(angles.tolist()):
            plus.append(right)
            minus.append(left)
            stiffness.append(rigid)
            rest.append(size * natural)
        for side, sign in ((0, 1.0), (1, -1.0)):
            if made.hinged[m][side]:
                continue
            pair = [angles[-side], 2 * nodes + ends[side]]
            plus.append(pair[side])
            minus.append(pair[1 - side])
            stiffness.append(2.0 * rigid)
            turn = 0.5 * size * natural
            turn[-1] += sign * drawn[m, side]
            rest.append(turn)
    return Bends(np.array(plus), np.array(minus), np.array(stiffness), np.array(rest))


class ChainedFrame(PlanarChained):
    """A frame and the chains of its members."""

    def __init__(self, frame: Frame, links: int) -> None:
        self.structure, self._frame, self.links = frame, frame, links
        self.length, self.energy = frame.model.length, frame.energy_scale
        known = frame.model.masses
        if known is None:
            raise MissingError(
                f"`structure` must have a mass; the frame has none. {frame.massless}"
            )
        own = known * self.length**2 / self.energy
        density = own.sum() / frame.model.lengths.sum()
        self.time = float(np.sqrt(density / FOUR_PI_SQUARED))
        self.linkage = frame_linkage(frame, links, own / self.time**2)
        self._middles = (np.arange(links) + 0.5) / links
        self._joints = np.linspace(0.0, 1.0, links + 1)

    def angles(self, state: State) -> Float[np.ndarray, "members links"]:
        """Angles at the middles of the links."""
        frame, z, p = self._frame, state.z[None], state.p[None]
        turns = frame.turns(z, frame.scalars(z, p))[0][frame.model.piece_nodes]
        inner = turns @ frame.model.mesh.interpolation(self._middles).T
        return np.asarray(inner + drawn_angles(frame.model, self._middles))

    def turns(self, state: State) -> Float[np.ndarray, " nodes"]:
        """Turns of the joints."""
        frame, z, p = self._frame, state.z[None], state.p[None]
        nodes = frame.model.joint_nodes
        turns = frame.turns(z, frame.scalars(z, p))[0]
        return np.asarray(np.where(nodes >= 0, turns[nodes], 0.0))

    def node_places(self, state: State) -> Float[np.ndarray, "nodes 2"]:
        """Places of the joints."""
        drawn = self._frame.model.network.places / self.length
        return np.asarray(drawn + self._frame.displacements(state.z[None], state.p[None])[0])

    def places(self, states: States) -> Float[np.ndarray, "lanes members joints 2"]:
        """Places at the ends of links, in the structure's unit of length."""
        return np.asarray(self._frame.outline(states.z, states.p, self._joints) * self.length)

    def unknowns(self, v: Vector) -> Float[np.ndarray, " size"]:
        """Turns of the nodes, by splines through those of the links."""
        frame, model = self._frame, self._frame.model
        theta = v[self.linkage.angle_entries] - drawn_angles(model, self._middles)
        at = CubicSpline(self._middles, theta.T)(model.mesh.nodes).T
        nodes = np.zeros(len(model.place))
        nodes[model.piece_nodes] = at
        turning = model.joint_nodes >= 0
        nodes[model.joint_nodes[turning]] = v[self.linkage.turn_entries][turning]
        out = np.zeros(frame.size)
        out[: frame.unknowns] = nodes[model.place >= 0]
        return out
