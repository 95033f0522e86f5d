"""The numbers of a frame: its Lagrangian as constant arrays."""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from equimorph.arrays import Bool, Float, Int
from equimorph.structures.frame.any_model import AnyFrameModel
from equimorph.structures.frame.network import FrameNetwork
from equimorph.structures.frame.pressure import PressedChain
from equimorph.structures.frame.statics import Graph

Scalars = Float[np.ndarray, "scalars scalars"]


class Forces(NamedTuple):
    """Forces in one direction by scalar, those of the multipliers of this direction first.

    start: in each member at its start; drop: the load per length of each member, by which its force
    decreases along it; supports: of the supports on their joints.
    """

    start: Float[np.ndarray, "scalars members"]
    drop: Float[np.ndarray, "scalars members"]
    supports: Float[np.ndarray, "scalars joints"]


@dataclass(frozen=True, eq=False)
class FrameModel(AnyFrameModel):
    """The Lagrangian of a frame in turns ψ of its nodes and *scalars* y = (multipliers, p, 1).

    ``L = ½ ψᵀKψ − ψ·(slope y) − Σ ((1 + e) P + ½ γ P²) + ½ yᵀ Q y − Σ p V`` with the sum over the
    nodes of every element ("points"), ``P = A sin ψ + B cos ψ`` the tension times the quadrature
    weight, ``A = sine y``, ``B = cosine y``, e = stretch y the actuated and γP the elastic strain,
    and V of `pressure.PressedChain`. ψ is measured from the frame as drawn. It is what remains of
    the energy of bending, of stretching, of supports and loads when the joints' positions are
    eliminated: the forces f in the members balance for any y, without p, and with unit tangents t
    and T as drawn, ``L = bending − ∫ f·(t − T) ds − …``.
    The derivative by a multiplier says that a cycle of members closes.
    """

    network: FrameNetwork

    # --- numbering ------------------------------------------------------------------------------

    @cached_property
    def _numbered(self) -> tuple[Int[np.ndarray, "members nodes"], Int[np.ndarray, " joints"]]:
        """Nodes along each member, and the node that turns with each joint (−1: none)."""
        made = self.network
        joint_nodes = np.where(made.rigid, np.cumsum(made.rigid) - 1, -1)
        count = int(made.rigid.sum())
        inner = self.mesh.elements * self.mesh.degree - 1
        rows = []
        for ends, hinged in zip(made.ends, made.hinged, strict=True):
            row = np.empty(inner + 2, int)
            row[1:-1] = np.arange(count, count + inner)
            count += inner
            for side in (0, 1):
                row[-side] = count if hinged[side] else joint_nodes[ends[side]]
                count += int(hinged[side])
            rows.append(row)
        return np.array(rows), joint_nodes

    @property
    def piece_nodes(self) -> Int[np.ndarray, "members nodes"]:
        """Nodes along each member, from start to end."""
        return self._numbered[0]

    @property
    def joint_nodes(self) -> Int[np.ndarray, " joints"]:
        """Node that turns with each joint; −1 where all members are hinged."""
        return self._numbered[1]

    @cached_property
    def place(self) -> Int[np.ndarray, " nodes"]:
        """Unknown of each node; −1 where its turn is prescribed: ``turned y``."""
        held = np.zeros(int(self.piece_nodes.max()) + 1, bool)
        held[self.joint_nodes[np.isinf(self.network.supports[:, 2])]] = True
        return np.where(held, -1, np.cumsum(~held) - 1)

    @property
    def unknowns(self) -> int:
        """Number of turns that are not prescribed."""
        return int(self.place.max()) + 1

    @property
    def multipliers(self) -> int:
        """Number of forces that balance without loads."""
        return sum(self._circulating)

    @cached_property
    def _circulating(self) -> tuple[int, int]:
        x, y = (len(graph.circulations().members) for graph in self.graphs)
        return x, y

    # --- forces ---------------------------------------------------------------------------------

    @cached_property
    def graphs(self) -> tuple[Graph, Graph]:
        """Ways of forces in x and in y."""
        made = self.network
        x, y = (Graph(len(made.joints), made.ends, made.supports[:, axis] > 0.0) for axis in (0, 1))
        return x, y

    @cached_property
    def forces(self) -> tuple[Forces, Forces]:
        """Forces in x and in y by scalar."""
        first = (0, self._circulating[0])
        x, y = (self._forces(axis, first[axis]) for axis in (0, 1))
        return x, y

    @property
    def starts(self) -> Float[np.ndarray, "scalars members 2"]:
        """Forces at the starts of the members by scalar."""
        return np.stack([each.start for each in self.forces], axis=2)

    def _forces(self, axis: int, first: int) -> Forces:
        graph, made = self.graphs[axis], self.network
        start, drop = np.zeros((2, self.scalars, len(self.lengths)))
        supports = np.zeros((self.scalars, len(made.joints)))
        around, carried = graph.circulations(), graph.carrying_forces(self.loads[:, :, axis])
        last = first + len(around.members)
        start[first:last], supports[first:last] = around
        start[self.own], supports[self.own] = carried
        drop[self.own] = self.patterns.lines[:, :, axis]
        return Forces(start, drop, supports)

    def points_of(self, forces: Forces) -> Float[np.ndarray, "points scalars"]:
        """Forces at the points."""
        owner = self.owner
        along = np.asarray(forces.start[:, owner] - forces.drop[:, owner] * self.arclengths)
        return along.T

    @cached_property
    def chains(self) -> tuple[PressedChain, ...]:
        """Members under pressure."""
        given = self.patterns.pressures
        return tuple(
            PressedChain.of(self, int(k), given[k]) for k in np.flatnonzero(given.any(axis=1))
        )

    # --- points ---------------------------------------------------------------------------------

    @cached_property
    def owner(self) -> Int[np.ndarray, " points"]:
        """Member of each point."""
        return np.repeat(np.arange(len(self.lengths)), self.mesh.element_nodes.size)

    @cached_property
    def arclengths(self) -> Float[np.ndarray, " points"]:
        """Arclength of each point from the start of its member."""
        unit = self.mesh.breaks[:-1, None] + self.mesh.lengths[:, None] * self.mesh.reference.nodes
        return np.asarray(np.outer(self.lengths, unit).ravel())

    @cached_property
    def weights(self) -> Float[np.ndarray, " points"]:
        """Quadrature weights."""
        return np.asarray(np.outer(self.lengths, self.mesh.element_weights).ravel())

    @cached_property
    def directions(self) -> Float[np.ndarray, " points"]:
        """Tangent angles as drawn."""
        chords = np.arctan2(*self.network.chords.T[::-1])
        bends = np.array([float(each.curvature) for each in self.network.members]) * self.length
        middle = self.arclengths - 0.5 * self.lengths[self.owner]
        return np.asarray(chords[self.owner] + bends[self.owner] * middle)

    @cached_property
    def tangents(self) -> Float[np.ndarray, "points 2"]:
        """Unit tangents as drawn."""
        return np.stack([np.cos(self.directions), np.sin(self.directions)], axis=1)

    @cached_property
    def cosine(self) -> Float[np.ndarray, "points scalars"]:
        """Coefficients of cos ψ: forces along the members as drawn, times the weights."""
        x, y = (self.points_of(forces) for forces in self.forces)
        along = x * self.tangents[:, :1] + y * self.tangents[:, 1:]
        return np.asarray(_clean(along, x, y) * self.weights[:, None])

    @cached_property
    def sine(self) -> Float[np.ndarray, "points scalars"]:
        """Coefficients of sin ψ: forces across the members, to their left."""
        x, y = (self.points_of(forces) for forces in self.forces)
        across = y * self.tangents[:, :1] - x * self.tangents[:, 1:]
        return np.asarray(_clean(across, x, y) * self.weights[:, None])

    @cached_property
    def acting(self) -> Bool[np.ndarray, "members scalars"]:
        """Which scalars have a force in each member."""
        some = (self.sine != 0.0) | (self.cosine != 0.0)
        return np.asarray(some.reshape(len(self.lengths), -1, self.scalars).any(axis=1))

    @cached_property
    def softness(self) -> Float[np.ndarray, " points"]:
        """γ: axial compliance over the quadrature weight."""
        axial = [np.inf if each.EA is None else each.EA for each in self.network.made]
        return np.asarray((self.force / np.array(axial))[self.owner] / self.weights)

    # --- members and joints ---------------------------------------------------------------------

    @cached_property
    def rigidity(self) -> Float[np.ndarray, " members"]:
        """Bending stiffness of the members."""
        return np.array([each.strain[0] for each in self.network.made]) / self.bending

    @cached_property
    def supports(self) -> Float[np.ndarray, "joints 3"]:
        """Stiffness of the supports; ∞ where held, 0 where free."""
        cube = self.length**3
        return np.asarray(
            self.network.supports * np.array([cube, cube, self.length]) / self.bending
        )

    @cached_property
    def stiffness(self) -> Float[np.ndarray, "elements order order"]:
        """Element matrices of bending."""
        unit = self.mesh.stiffness
        whole = (self.rigidity / self.lengths)[:, None, None, None] * unit
        return np.asarray(whole.reshape(-1, *unit.shape[1:]))

    @cached_property
    def springs(self) -> Float[np.ndarray, " nodes"]:
        """Stiffness of springs against turning."""
        total = np.zeros(len(self.place))
        for node, stiff in zip(self.joint_nodes.tolist(), self.supports[:, 2], strict=True):
            if 0.0 < stiff < np.inf:
                total[node] = stiff
        return total

    @cached_property
    def turned(self) -> Float[np.ndarray, "nodes scalars"]:
        """Turns of the supports at their nodes."""
        total = np.zeros((len(self.place), self.scalars))
        for j, node in enumerate(self.joint_nodes.tolist()):
            if self.supports[j, 2] > 0.0:
                total[node, self.own] = self.patterns.turns[:, j, 0]
        return total

    @cached_property
    def moved(self) -> Float[np.ndarray, "2 joints scalars"]:
        """Moves of the supports in x and in y."""
        total = np.zeros((2, len(self.network.joints), self.scalars))
        total[:, :, self.own] = self.patterns.moves.transpose(2, 1, 0)
        return total

    @cached_property
    def natural(self) -> Float[np.ndarray, "members scalars"]:
        """Actuated curvature of the members."""
        total = np.zeros((len(self.lengths), self.scalars))
        total[:, self.own] = self.patterns.strains[..., 0].T
        return total

    @cached_property
    def stretch(self) -> Float[np.ndarray, "members scalars"]:
        """Actuated strain of the members."""
        total = np.zeros((len(self.lengths), self.scalars))
        total[:, self.own] = (self.patterns.length / self.lengths).T
        return total

    @cached_property
    def slope(self) -> Float[np.ndarray, "nodes scalars"]:
        """Coefficients of ψ: couples, actuated curvatures and turned springs."""
        total = self.springs[:, None] * self.turned
        for m, row in enumerate(self.piece_nodes):
            total[row[-1]] += self.rigidity[m] * self.natural[m]
            total[row[0]] -= self.rigidity[m] * self.natural[m]
        for j, node in enumerate(self.joint_nodes.tolist()):
            if node >= 0:
                total[node, self.own] += self.patterns.couples[:, j]
        return np.asarray(total)

    @cached_property
    def quadratic(self) -> Scalars:
        """Q: bending of straight members, supports that move or give way, the frame as drawn."""
        bends, turns = self.natural, self.turned
        total = bends.T @ ((self.rigidity * self.lengths)[:, None] * bends)
        total += turns.T @ (self.springs[:, None] * turns)
        for axis, forces in enumerate(self.forces):
            work = forces.supports @ self.moved[axis]
            total += work + work.T
            stiff = self.supports[:, axis]
            give = np.where((stiff > 0.0) & np.isfinite(stiff), 1.0 / np.maximum(stiff, 1e-300), 0)
            total -= (forces.supports * give) @ forces.supports.T
        drawn = self.cosine.sum(axis=0)
        total[:, -1] += drawn
        total[-1] += drawn
        return np.asarray(total)

    @cached_property
    def mass(self) -> Float[np.ndarray, " unknowns"]:
        """Quadrature weights summed at the unknown nodes."""
        total = np.zeros(len(self.place))
        np.add.at(total, self.nodes.ravel(), self.weights)
        return np.asarray(total[self.place >= 0])


def _clean(
    part: Float[np.ndarray, "points scalars"],
    x: Float[np.ndarray, "points scalars"],
    y: Float[np.ndarray, "points scalars"],
) -> Float[np.ndarray, "points scalars"]:
    """A component of forces (x, y) without what is round-off of their size."""
    return np.where(np.abs(part) <= 1e-15 * (np.abs(x) + np.abs(y)), 0.0, part)
