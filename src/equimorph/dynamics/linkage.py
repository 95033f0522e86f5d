"""Planar rods and frames as chains of rigid links with elastic joints: their statics.

The chain is what a rigid-body simulator replays. Its own equilibria are computed here by Newton's
method, so that the error of the chain and the error of the motion are known apart.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from equimorph.arrays import Bool, Float, Int
from equimorph.dynamics.mechanism import LIGHT, Mechanism, Pulls, Settings, Vector


@dataclass(frozen=True, eq=False)
class Supports:
    """How the nodes are held, along two axes each and in their turn."""

    axes: Float[np.ndarray, "nodes 2 2"]
    """Unit vectors of the two axes of each node."""
    stiffness: Float[np.ndarray, "nodes 2"]
    """Of the supports along these: ∞ where held, 0 where free."""
    places: Float[np.ndarray, "nodes 2 settings"]
    """Where they hold the nodes, as tables of the settings."""
    turning: Float[np.ndarray, " nodes"]
    turns: Float[np.ndarray, "nodes settings"]
    """The same for the turns of the nodes."""
    rigid: Bool[np.ndarray, " nodes"]
    """Which nodes turn with a member."""


@dataclass(frozen=True, eq=False)
class Bends:
    """Elastic joints: ``½ k (v[plus] − v[minus] − rest)²`` of two angles v."""

    plus: Int[np.ndarray, " bends"]
    minus: Int[np.ndarray, " bends"]
    stiffness: Float[np.ndarray, " bends"]
    rest: Float[np.ndarray, "bends settings"]


@dataclass(frozen=True, eq=False)
class Linkage(Mechanism):
    """Members of N rigid or stretching links between nodes, in non-dimensional form.

    Entries v: two coordinates of each node along its axes; its turn; angles of all links, member by
    member; their strains. ``L = ½ vᵀKv − v·s − Σ (P + λ)·l (1 + ε) t(θ) + …`` with the multipliers
    λ of the closure of each member, ``x_end − x_start − Σ l (1 + ε) t = 0``, and the dead forces P
    beyond each link. A multiplier is the force on the far end of a member, x and y in their turn.
    """

    supports: Supports
    """Of the nodes."""
    ends: Int[np.ndarray, "members 2"]
    """Nodes at start and end of each member."""
    lengths: Float[np.ndarray, "members links"]
    masses: Float[np.ndarray, "members links"]
    """Of the links of each member."""
    bends: Bends
    """Elastic joints between links, and between links and nodes."""
    axial: Float[np.ndarray, "members links"]
    """Axial stiffness EA of each link; ∞ where it does not stretch."""
    strains: Float[np.ndarray, "members links settings"]
    """Strains at rest, as tables of the settings."""
    forces: Float[np.ndarray, "members joints 2 settings"]
    """Dead forces on the joints of each member."""
    couples: Float[np.ndarray, "entries settings"]
    """Couples on all entries."""
    node_forces: Float[np.ndarray, "nodes 2 settings"]
    """Dead forces on the nodes."""
    pressure: Float[np.ndarray, "members settings"]
    """Force per length towards the left of each member."""
    poles: Int[np.ndarray, "settings 2"] | None = None
    """For each setting that is a pressure on several members, the nodes whose x and whose y is that
    of the place about which their area counts; None: the start of the first member."""

    # --- numbering ------------------------------------------------------------------------------

    @property
    def nodes(self) -> int:
        """Number of nodes."""
        return len(self.supports.rigid)

    @property
    def size(self) -> int:
        """Number of entries."""
        return 3 * self.nodes + 2 * self.lengths.size

    @property
    def closures(self) -> int:
        """Two for each member."""
        return 2 * len(self.ends)

    @cached_property
    def turn_entries(self) -> Int[np.ndarray, " nodes"]:
        """Entries of the nodes' turns."""
        return 2 * self.nodes + np.arange(self.nodes)

    @cached_property
    def angle_entries(self) -> Int[np.ndarray, "members links"]:
        """Entries of the links' angles."""
        first = 3 * self.nodes
        return first + np.arange(self.lengths.size).reshape(self.lengths.shape)

    @cached_property
    def strain_entries(self) -> Int[np.ndarray, "members links"]:
        """Entries of the links' strains."""
        return self.angle_entries + self.lengths.size

    @cached_property
    def free(self) -> Bool[np.ndarray, " entries"]:
        """Entries that are unknown; the others are prescribed."""
        held = self.supports
        return np.concatenate([
            np.isfinite(held.stiffness).ravel(), held.rigid & np.isfinite(held.turning),
            np.ones(self.lengths.size, bool), np.isfinite(self.axial).ravel(),
        ])  # fmt: skip

    @cached_property
    def targets(self) -> Float[np.ndarray, "entries settings"]:
        """Values of prescribed entries, and where springs of nodes are at rest."""
        held, count = self.supports, self.couples.shape[1]
        out = np.zeros((self.size, count))
        out[: 2 * self.nodes] = held.places.reshape(-1, count)
        out[self.turn_entries] = held.turns
        out[self.strain_entries.ravel()] = self.strains.reshape(-1, count)
        return out

    @cached_property
    def springs(self) -> Vector:
        """Stiffness of the springs that hold single entries: nodes and strains."""
        held = self.supports
        axial = np.where(np.isfinite(self.axial), self.axial * self.lengths, 0.0)
        nodes = np.concatenate([held.stiffness.ravel(), held.turning])
        return np.concatenate([
            np.where(np.isfinite(nodes), nodes, 0.0), np.zeros(self.lengths.size), axial.ravel(),
        ])  # fmt: skip

    @cached_property
    def stiffness(self) -> Float[np.ndarray, "entries entries"]:
        """K: elastic joints, springs, and the strains of the links."""
        bends, out = self.bends, np.diag(self.springs)
        for rows, columns, sign in (
            (bends.plus, bends.plus, 1.0), (bends.minus, bends.minus, 1.0),
            (bends.plus, bends.minus, -1.0), (bends.minus, bends.plus, -1.0),
        ):  # fmt: skip
            np.add.at(out, (rows, columns), sign * bends.stiffness)
        return out

    @cached_property
    def slope(self) -> Float[np.ndarray, "entries settings"]:
        """s: what rest turns, springs at rest and couples do."""
        bends, out = self.bends, self.couples + self.springs[:, None] * self.targets
        np.add.at(out, bends.plus, bends.stiffness[:, None] * bends.rest)
        np.add.at(out, bends.minus, -bends.stiffness[:, None] * bends.rest)
        return np.asarray(out)

    # --- places ---------------------------------------------------------------------------------

    def node_places(self, v: Vector) -> Float[np.ndarray, "nodes 2"]:
        """Places of the nodes."""
        along = v[: 2 * self.nodes].reshape(-1, 2)
        return np.asarray(np.einsum("na,nax->nx", along, self.supports.axes))

    def links(self, v: Vector) -> Float[np.ndarray, "members links 2"]:
        """Vectors from start to end of each link."""
        angles, strains = v[self.angle_entries], v[self.strain_entries]
        size = self.lengths * (1.0 + strains)
        return np.stack([size * np.cos(angles), size * np.sin(angles)], axis=2)

    def places(self, v: Vector) -> Float[np.ndarray, "members joints 2"]:
        """Places of the joints between links, ends included, from the start of each member."""
        start = self.node_places(v)[self.ends[:, 0], None]
        return np.concatenate([start, start + np.cumsum(self.links(v), axis=1)], axis=1)

    def closure(self, v: Vector) -> Float[np.ndarray, "members 2"]:
        """By how much members miss the nodes at their ends."""
        return np.asarray(self.node_places(v)[self.ends[:, 1]] - self.places(v)[:, -1])

    # --- equations ------------------------------------------------------------------------------

    @cached_property
    def beyond(self) -> Float[np.ndarray, "members links 2 settings"]:
        """Dead forces on the joints beyond each link, summed."""
        return np.asarray(np.cumsum(self.forces[:, :0:-1], axis=1)[:, ::-1])

    def residual(self, v: Vector, multipliers: Pulls, y: Settings) -> Float[np.ndarray, " all"]:
        """F = (∂L/∂v, closure) over all entries."""
        pull = multipliers.reshape(-1, 2)
        links = self.links(v)
        force = self.beyond @ y + pull[:, None]
        size = np.maximum(1.0 + v[self.strain_entries], 1e-12)
        out = self.stiffness @ v - self.slope @ y
        across = np.stack([-links[..., 1], links[..., 0]], axis=2)
        out[self.angle_entries] -= (force * across).sum(axis=2)
        out[self.strain_entries] -= (force * links).sum(axis=2) / size
        nodes = -(self.node_forces @ y)
        np.add.at(nodes, self.ends[:, 0], -(self.forces @ y).sum(axis=1) - pull)
        np.add.at(nodes, self.ends[:, 1], pull)
        if self.pressure.any():
            self._press(v, y, out, nodes)
        along = np.einsum("nx,nax->na", nodes, self.supports.axes)
        out[: 2 * self.nodes] += along.ravel()
        return np.concatenate([out, self.closure(v).ravel()])

    def _press(
        self, v: Vector, y: Settings, out: Vector, nodes: Float[np.ndarray, "nodes 2"]
    ) -> None:
        """Add minus the forces of pressure, normal to each link in its middle."""
        links = self.links(v)
        across = np.stack([-links[..., 1], links[..., 0]], axis=2)
        force = (self.pressure @ y)[:, None, None] * across
        after = force.sum(axis=1, keepdims=True) - np.cumsum(force, axis=1) + 0.5 * force
        out[self.angle_entries] -= (after * across).sum(axis=2)
        np.add.at(nodes, self.ends[:, 0], -force.sum(axis=1))

    def jacobian(self, v: Vector, multipliers: Pulls, y: Settings) -> Float[np.ndarray, "all all"]:
        """Derivative of the residual."""
        size, members = self.size, len(self.ends)
        out = np.zeros((size + 2 * members, size + 2 * members))
        links = self.links(v)
        across = np.stack([-links[..., 1], links[..., 0]], axis=2)
        stretch = np.maximum(1.0 + v[self.strain_entries], 1e-12)
        force = self.beyond @ y + multipliers.reshape(-1, 1, 2)
        angles, strains = self.angle_entries, self.strain_entries
        out[:size, :size] = self.stiffness
        out[angles, angles] += (force * links).sum(axis=2)
        mixed = -(force * across).sum(axis=2) / stretch
        out[angles, strains] += mixed
        out[strains, angles] += mixed
        if self.pressure.any():
            self._press_jacobian(v, y, out)
        border = np.zeros((members, 2, size))
        m = np.arange(members)[:, None]
        for x in (0, 1):
            border[m, x, angles] = -across[..., x]
            border[m, x, strains] = -links[..., x] / stretch
            for side, sign in ((0, -1.0), (1, 1.0)):
                for axis in (0, 1):
                    at = 2 * self.ends[:, side] + axis
                    border[m[:, 0], x, at] += sign * self.supports.axes[self.ends[:, side], axis, x]
        out[size:, :size] = border.reshape(2 * members, size)
        out[:size, size:] = out[size:, :size].T
        return out

    def _press_jacobian(self, v: Vector, y: Settings, out: Float[np.ndarray, "all all"]) -> None:
        links, pressure = self.links(v), self.pressure @ y
        across = np.stack([-links[..., 1], links[..., 0]], axis=2)
        count = links.shape[1]
        later = np.triu(np.ones((count, count)), 1) + 0.5 * np.eye(count)
        for m, angles in enumerate(self.angle_entries):
            force = pressure[m] * across[m]
            after = later @ force
            block = np.zeros((count, count))
            block[np.arange(count), np.arange(count)] = (after * links[m]).sum(axis=1)
            # d(force)/dθ = −p · link
            block += pressure[m] * later * (across[m] @ links[m].T)
            out[np.ix_(angles, angles)] += block
            start = self.supports.axes[self.ends[m, 0]]
            at = 2 * self.ends[m, 0] + np.arange(2)
            out[np.ix_(at, angles)] += pressure[m] * start @ links[m].T

    # --- motion ---------------------------------------------------------------------------------

    def mass(self, v: Vector) -> Float[np.ndarray, "entries entries"]:
        """Mass matrix of links with uniform density, in all entries."""
        members, count = self.lengths.shape
        links = self.links(v)
        across = np.stack([-links[..., 1], links[..., 0]], axis=2)
        stretch = np.maximum(1.0 + v[self.strain_entries], 1e-12)
        before = np.tril(np.ones((count, count)), -1) + 0.5 * np.eye(count)
        out = np.zeros((self.size, self.size))
        for m in range(members):
            moves = np.zeros((count, 2, self.size))
            for x in (0, 1):
                moves[:, x, self.angle_entries[m]] = before * across[m, :, x]
                moves[:, x, self.strain_entries[m]] = before * (links[m, :, x] / stretch[m])
                for axis in (0, 1):
                    start = self.ends[m, 0]
                    moves[:, x, 2 * start + axis] += self.supports.axes[start, axis, x]
            flat = moves.reshape(2 * count, -1)
            out += flat.T @ (np.repeat(self.masses[m], 2)[:, None] * flat)
            at = self.angle_entries[m]
            out[at, at] += self.masses[m] * self.lengths[m] ** 2 / 12.0
        nodes, turns = np.arange(2 * self.nodes), self.turn_entries
        out[nodes, nodes] += self.node_mass
        out[turns, turns] += self.node_mass * self.lengths.min() ** 2
        return out

    @cached_property
    def node_mass(self) -> float:
        """Mass of a node that moves."""
        return LIGHT * float(self.masses.min())

    def potential(self, v: Vector, y: Settings) -> float:
        """Energy of elastic joints, springs, strains and loads."""
        bends = self.bends
        turns = v[bends.plus] - v[bends.minus] - bends.rest @ y
        moved = np.where(self.free, v - self.targets @ y, 0.0)
        out = 0.5 * bends.stiffness @ turns**2 + 0.5 * self.springs @ moved**2
        places = self.places(v)
        out -= float(v @ (self.couples @ y)) + float(((self.forces @ y) * places).sum())
        out -= float(((self.node_forces @ y) * self.node_places(v)).sum())
        poles = np.tile(places[0, 0], (len(y), 1))
        if self.poles is not None:
            poles = (self.supports.places @ y)[self.poles, [0, 1]]
        arms, links = places[:, None, :-1] - poles[:, None], self.links(v)[:, None]
        areas = 0.5 * (arms[..., 0] * links[..., 1] - arms[..., 1] * links[..., 0]).sum(axis=2)
        return float(out + (self.pressure * areas).sum(axis=0) @ y)
