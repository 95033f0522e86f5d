"""The numbers of a frame in space: its Lagrangian as constant arrays.

See docs/decisions.md, "Frames in space share rotations and eliminate places".
"""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from equimorph.arrays import Bool, Float, Int
from equimorph.structures.frame.any_model import AnyFrameModel
from equimorph.structures.frame.statics import NOTHING, Pivots, SpaceFlows, SpaceStatics
from equimorph.structures.space_frame.network import SpatialNetwork, Turning
from equimorph.structures.spatial.quaternions import exponential, matrices
from equimorph.structures.spatial.windings import most_half_windings

LENGTH_STIFFNESS = 4000.0
"""Stiffness of the lengths of quaternions in the metric, in units of bending: margins are known
below it."""

ON_LINE = 1e-9
"""Distance of joints from a line, relative to its length, at which they lie on it."""


class Acting(NamedTuple):
    """Forces in each piece by the scalars that act there.

    numbers: these scalars, multipliers first, filled up with 0; ties, counts: how many multipliers
    and scalars there are; start: forces at its start; drop: load per length.
    """

    numbers: Int[np.ndarray, "pieces most"]
    ties: Int[np.ndarray, " pieces"]
    counts: Int[np.ndarray, " pieces"]
    start: Float[np.ndarray, "pieces most 3"]
    drop: Float[np.ndarray, "pieces most 3"]


@dataclass(frozen=True, eq=False)
class SpatialFrameModel(AnyFrameModel):
    """The Lagrangian of a frame in turns w of its nodes and *scalars* y = (multipliers, p, 1).

    ``L = Σ m (½ v·Sv − v·b − (1 + e) N − ½ c N²) + ½ yᵀ Q y`` with the sum over the nodes of every
    element ("points"), whose quadrature weight is m. Unit quaternions w turn cross-sections from
    where they are drawn, where they have axes R₀: v are the strains of w on fixed axes, with
    S = R₀ K R₀ᵀ, so that the frame as drawn is free of stress; b are moments of actuated strains,
    e is the actuated elongation, N = f·R(w)t₀ the tension, c the compliance against it. Forces f
    are those of the scalars and balance for any y, so that places of joints are eliminated; the
    derivative by a multiplier says that a cycle of members closes.

    Bodies at the joints, which rigidly joined members share, are the first nodes. One that is
    hinged turns by an angle φ about its axis a on its parent: w = w_parent exp(a φ/2).
    """

    network: SpatialNetwork

    @cached_property
    def line(self) -> Float[np.ndarray, "3"] | None:
        """Direction of the line on which all joints lie; None where they do not."""
        away = self.network.places - self.network.places[0]
        line = away[np.argmax((away**2).sum(axis=1))]
        line = line / np.linalg.norm(line)
        across = away - (away @ line)[:, None] * line
        return line if np.abs(across).max() <= ON_LINE * np.abs(away).max() else None

    @cached_property
    def normals(self) -> Float[np.ndarray, "planes 3"]:
        """Normals of planes in which all joints lie: none, one, or two of those around a line."""
        away = self.network.places - self.network.places[0]
        # three more rows: as many axes, however few joints
        _, sizes, axes = np.linalg.svd(np.append(away, np.zeros((3, 3)), 0), full_matrices=False)
        return np.asarray(axes[sizes <= ON_LINE * sizes[0]])

    @cached_property
    def most_half_windings(self) -> int:
        """Turns by 2π along each piece of a member that states may have."""
        return most_half_windings(self.mesh.elements, self.mesh.degree)

    # --- numbering ------------------------------------------------------------------------------

    @property
    def starts(self) -> Float[np.ndarray, "scalars pieces 3"]:
        """Forces at the starts of the pieces by scalar."""
        return self.forces.members

    @property
    def pieces(self) -> int:
        """Number of pieces of members."""
        return len(self.network.owner)

    @cached_property
    def piece_nodes(self) -> Int[np.ndarray, "pieces nodes"]:
        """Nodes along each piece, from start to end."""
        bodies, inner = len(self.network.bodies), self.mesh.elements * self.mesh.degree - 1
        rows = bodies + np.arange(self.pieces * inner).reshape(self.pieces, inner)
        ends = self.network.body_of_end
        return np.concatenate([ends[:, :1], rows, ends[:, 1:]], axis=1)

    @cached_property
    def turning(self) -> Int[np.ndarray, " nodes"]:
        """How each node turns; see `Turning`."""
        bodies = [int(body.turning) for body in self.network.bodies]
        inner = self.pieces * (self.mesh.elements * self.mesh.degree - 1)
        return np.array(bodies + [int(Turning.FREE)] * inner)

    @cached_property
    def free(self) -> Int[np.ndarray, " free"]:
        """Nodes with an unknown quaternion, in the order of the unknowns."""
        return np.flatnonzero(self.turning == Turning.FREE)

    @cached_property
    def place(self) -> Int[np.ndarray, " nodes"]:
        """Number of each node among the free ones, or −1."""
        found = np.full(len(self.turning), -1)
        found[self.free] = np.arange(len(self.free))
        return found

    @cached_property
    def held(self) -> Int[np.ndarray, " held"]:
        """Nodes whose turn is prescribed."""
        return np.flatnonzero(self.turning == Turning.HELD)

    @cached_property
    def hinged(self) -> Int[np.ndarray, " hinges"]:
        """Nodes that turn on another one, in the order of the angles."""
        return np.flatnonzero(self.turning == Turning.HINGED)

    @cached_property
    def parents(self) -> Int[np.ndarray, " hinges"]:
        """Nodes on which the hinged ones turn."""
        return np.array([self.network.bodies[k].parent for k in self.hinged], dtype=int)

    @cached_property
    def hinge_axes(self) -> Float[np.ndarray, "hinges 3"]:
        """Axes of the hinges as drawn."""
        return np.array([self.network.bodies[k].axis for k in self.hinged]).reshape(-1, 3)

    @property
    def unknowns(self) -> int:
        """Four numbers for each free node, one for each hinge."""
        return 4 * len(self.free) + len(self.hinged)

    @cached_property
    def multipliers(self) -> int:
        """Number of forces that balance without loads."""
        return len(self.forces.members) - len(self.loads) - 1

    # --- forces ---------------------------------------------------------------------------------

    @cached_property
    def statics(self) -> SpaceStatics:
        """Forces that balance."""
        made = self.network
        return SpaceStatics(made.joints, made.ends, [each.directions for each in made.supports])

    @property
    def forces(self) -> SpaceFlows:
        """Forces at the starts of the pieces, and of the supports, by scalar."""
        return self._balanced[0]

    def carrying_forces(self, loads: Float[np.ndarray, "flows joints 3"]) -> SpaceFlows:
        """Forces that carry loads on the joints to the ground."""
        return self.statics.carrying_forces(loads, self._balanced[1])

    @cached_property
    def _balanced(self) -> tuple[SpaceFlows, Pivots]:
        around, pivots = self.statics.circulations()
        carried = self.statics.carrying_forces(self.loads, pivots)
        none = SpaceFlows(np.zeros((1, self.pieces, 3)), np.zeros((1, len(self.network.joints), 3)))
        parts = zip(around, carried, none, strict=True)
        members, supports = (np.concatenate(each) for each in parts)
        return SpaceFlows(members, supports), pivots

    @cached_property
    def acting(self) -> Acting:
        """Forces in each piece by the scalars that act there."""
        start = self.forces.members
        drop = np.zeros_like(start)
        drop[self.own] = self.patterns.lines
        some = (np.abs(start) > NOTHING).any(axis=2) | drop.any(axis=2)
        counts = some.sum(axis=0)
        most = max(int(counts.max()), 1)
        numbers, (starts, drops) = (
            np.zeros((self.pieces, most), int),
            np.zeros((2, self.pieces, most, 3)),
        )
        for k in range(self.pieces):
            here = np.flatnonzero(some[:, k])
            numbers[k, : len(here)] = here
            starts[k, : len(here)], drops[k, : len(here)] = start[here, k], drop[here, k]
        return Acting(numbers, some[: self.multipliers].sum(axis=0), counts, starts, drops)

    # --- points ---------------------------------------------------------------------------------

    @cached_property
    def owner(self) -> Int[np.ndarray, " elements"]:
        """Piece of each element."""
        return np.repeat(np.arange(self.pieces), self.mesh.elements)

    @cached_property
    def element_lengths(self) -> Float[np.ndarray, " elements"]:
        """Lengths of the elements."""
        return np.outer(self.lengths, self.mesh.lengths).ravel()

    @cached_property
    def arclengths(self) -> Float[np.ndarray, "elements order"]:
        """Arclength of each point from the start of its piece."""
        mesh = self.mesh
        unit = mesh.breaks[:-1, None] + mesh.lengths[:, None] * mesh.reference.nodes
        return np.asarray(np.multiply.outer(self.lengths, unit).reshape(-1, mesh.degree + 1))

    @cached_property
    def weights(self) -> Float[np.ndarray, "elements order"]:
        """Quadrature weights."""
        return np.outer(self.element_lengths, self.mesh.reference.weights)

    @cached_property
    def drawn(self) -> Float[np.ndarray, "elements order 3 3"]:
        """Axes t, n, b of the cross-sections as drawn, in the columns."""
        middle = self.arclengths - 0.5 * self.lengths[self.owner][:, None]
        bends = [float(member.curvature) * self.length for member in self.network.members]
        turn = np.array(bends)[self.network.owner][self.owner][:, None] * middle
        about = matrices(exponential(turn[..., None] * np.array([0.0, 0.0, 1.0])))
        return np.asarray(np.einsum("eab,eibc->eiac", self.network.axes[self.owner], about))

    @cached_property
    def tangents(self) -> Float[np.ndarray, "elements order 3"]:
        """t₀."""
        return np.ascontiguousarray(self.drawn[..., 0])

    @cached_property
    def rigidity(self) -> Float[np.ndarray, "pieces 3"]:
        """K of each piece: against twist and bending about n and b."""
        made = np.array([each.strain for each in self.network.made]) / self.bending
        return np.asarray(made[self.network.owner])

    @cached_property
    def stiff(self) -> Float[np.ndarray, "elements order 3 3"]:
        """S: stiffness on fixed axes."""
        return np.asarray(np.einsum("eiak,eibk->eiab", self.moment_of_strain, self.drawn))

    @cached_property
    def moment_of_strain(self) -> Float[np.ndarray, "elements order 3 3"]:
        """R₀ K: moments on fixed axes by strains of the cross-section."""
        return np.asarray(self.drawn * self.rigidity[self.owner][:, None, None, :])

    @cached_property
    def compliance(self) -> Float[np.ndarray, " pieces"]:
        """c: strain by unit tension."""
        made = [0.0 if each.EA is None else self.force / each.EA for each in self.network.made]
        return np.asarray(np.array(made)[self.network.owner])

    # --- what scalars do ------------------------------------------------------------------------

    @cached_property
    def strains(self) -> Float[np.ndarray, "pieces scalars 3"]:
        """Actuated strains of the cross-sections by parameter, and those from the beginning."""
        found = np.zeros((self.pieces, self.patterns.count + 1, 3))
        found[:, :-1] = self.patterns.strains.transpose(1, 0, 2)
        own = np.array([each.strains for each in self.network.members], dtype=float)
        found[:, -1] = own[self.network.owner] * self.length
        return found

    @cached_property
    def elongation(self) -> Float[np.ndarray, "pieces scalars"]:
        """Actuated strain along the pieces by parameter, and that from the beginning."""
        found = np.zeros((self.pieces, self.patterns.count + 1))
        found[:, :-1] = (self.patterns.length / self.lengths).T
        found[:, -1] = self.network.stretched
        return found

    @property
    def stressed(self) -> bool:
        """Whether members are under stress from the beginning."""
        return bool(self.strains[:, -1].any() or self.elongation[:, -1].any())

    @cached_property
    def moved(self) -> Float[np.ndarray, "scalars joints 3"]:
        """Moves of the supports."""
        found = np.zeros((self.scalars, len(self.network.joints), 3))
        found[self.own] = self.patterns.moves
        return found

    @cached_property
    def yielding(self) -> Float[np.ndarray, "joints 3 3"]:
        """Compliance of each support."""
        cube = self.length**3 / self.bending
        found = np.zeros((len(self.network.joints), 3, 3))
        for j, support in enumerate(self.network.supports):
            soft = np.isfinite(support.stiffness)
            unit = support.directions[soft]
            found[j] = unit.T @ (unit / (support.stiffness[soft] * cube)[:, None])
        return found

    @cached_property
    def quadratic(self) -> Float[np.ndarray, "scalars scalars"]:
        """Q: actuated strains, supports that move or give way, the frame as drawn."""
        m, supports = self.multipliers, self.forces.supports
        total = np.zeros((self.scalars, self.scalars))
        bends = self.strains
        energy = (self.rigidity * self.lengths[:, None])[:, None] * bends
        total[m:, m:] = np.einsum("kpa,kqa->pq", energy, bends)
        work = np.einsum("sja,tja->st", supports, self.moved)
        total += work + work.T
        given = np.einsum("sja,jab->sjb", supports, self.yielding)
        total -= np.einsum("sjb,tjb->st", given, supports)
        drawn = self.work_as_drawn
        total[:, -1] += drawn
        total[-1] += drawn
        return total

    @cached_property
    def work_as_drawn(self) -> Float[np.ndarray, " scalars"]:
        """Σ m f·t₀ by scalar."""
        total = np.zeros(self.scalars)
        pull = self.weights[..., None] * self.tangents
        at = self.owner
        first = np.zeros((self.pieces, 3))
        second = np.zeros((self.pieces, 3))
        np.add.at(first, at, pull.sum(axis=1))
        np.add.at(second, at, (self.arclengths[..., None] * pull).sum(axis=1))
        acting = self.acting
        value = np.einsum("kra,ka->kr", acting.start, first)
        value -= np.einsum("kra,ka->kr", acting.drop, second)
        some = np.arange(value.shape[1]) < acting.counts[:, None]
        np.add.at(total, acting.numbers[some], value[some])
        return total

    # --- metric ---------------------------------------------------------------------------------

    @cached_property
    def node_weights(self) -> Float[np.ndarray, " nodes"]:
        """Quadrature weights summed at the nodes; a parent turns what is hinged on it, too."""
        total = np.zeros(len(self.turning))
        np.add.at(total, self.nodes.ravel(), self.weights.ravel())
        np.add.at(total, self.parents, total[self.hinged])
        return total

    @cached_property
    def mass(self) -> Float[np.ndarray, " unknowns"]:
        """L2 norm of the rotation: 4 m for quaternions, m for angles of hinges."""
        weights = self.node_weights
        return np.concatenate([np.repeat(4.0 * weights[self.free], 4), weights[self.hinged]])

    @cached_property
    def stiff_lengths(self) -> Float[np.ndarray, " free"]:
        """Stiffness of the lengths of quaternions."""
        return np.asarray(LENGTH_STIFFNESS * 4.0 * self.node_weights[self.free])

    @cached_property
    def used(self) -> Bool[np.ndarray, " scalars"]:
        """Parameters and the constant with actuated strains."""
        return np.asarray(self.strains.any(axis=(0, 2)))
