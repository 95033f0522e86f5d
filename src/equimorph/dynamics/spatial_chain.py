"""A rod in space as a chain of rigid links with three elastic hinges at each joint: its statics.

All derivatives follow from those of what the chain carries: a hinge about the axis a through p
moves a point x beyond it by ``∂x/∂q = a × (x − p)``, a slide by a; an earlier hinge i turns this:
``∂²x/∂q_i∂q = a_i × ∂x/∂q``. See [Featherstone2008]_, chapter 4.

See docs/decisions.md, "A chain in space is hinges and slides, and nothing else".
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from equimorph.arrays import Bool, Float, Int
from equimorph.dynamics.mechanism import LIGHT, Mechanism, Pulls, Settings, Vector

STIFF, REST = 0, 1
"""Columns of a table of springs."""
ANCHOR = 6
"""Entries of an anchor whose rotation is prescribed: its place, and θ, tilt and twist."""
CLAMP_AXES = np.eye(3)[::-1]
"""Axes of the hinges of a clamp, exp(e₃ θ) exp(e₂ tilt) exp(e₁ twist)."""
ALIGNED = ((1, 2), (2, 0), (0, 1))
"""Axes of the last link and of its clamp that are at right angles where the rotations agree."""

_CROSS = np.cross(np.eye(3)[:, None], np.eye(3)).transpose(0, 2, 1).reshape(3, 9)
"""[e_k]× of the three axes, row by row."""

Axes = Float[np.ndarray, "bodies 3 3"]


@dataclass(frozen=True, eq=False)
class Pose:
    """Where the bodies are.

    frames: rotations of the near anchor, the links and the tip, with the columns t, n, b; axes,
    pivots: of all hinges and slides of the chain, of slides the pivot is where they start; nodes:
    places of the joints, from the near end on; clamp: rotation of the other anchor.
    """

    frames: Axes
    axes: Float[np.ndarray, "moves 3"]
    pivots: Float[np.ndarray, "moves 3"]
    nodes: Float[np.ndarray, "joints 3"]
    clamp: Float[np.ndarray, "3 3"]


@dataclass(frozen=True, eq=False)
class SpatialChain(Mechanism):
    """N links from an anchor whose rotation is prescribed, in non-dimensional form.

    Entries v: place of this anchor along x, y, z and its angles θ, tilt, twist; of each link its
    three hinges, and slides along some axes of the cross-section; three hinges of the tip, a body
    without length at the end, if the rotation there is prescribed, too; the same of the other
    anchor as of the first one, without angles where it is a ball joint; none where the end is free.
    They are the joints of the simulation, in the same order. Closures: place of the chain's end
    minus that of the anchor, and, where rotations are prescribed, three products of their axes.
    """

    way: int
    """1 if the first link is at end A, −1 if it is at end B."""
    orders: Int[np.ndarray, "joints 3"]
    """Axes of the cross-section, 0 to 2 for t, n, b, about which each joint turns, one after the
    other. With alternating orders the chain is accurate to second order."""
    slides: tuple[int, ...]
    """Axes along which links give."""
    far: int
    """Entries of the other anchor: 0, 3 or 6."""
    springs: Float[np.ndarray, "entries 2 settings"]
    """Stiffness of each entry, and where it is at rest without loads: ∞ and its value where it is
    prescribed, 0 where it is free."""
    forces: Float[np.ndarray, "nodes 3 settings"]
    """Dead forces on the joints between links, from the first anchor on."""

    # --- numbering ------------------------------------------------------------------------------

    @property
    def size(self) -> int:
        """Number of entries."""
        return len(self.springs)

    @property
    def links(self) -> int:
        """Number of links."""
        return len(self.forces) - 1

    @property
    def closures(self) -> int:
        """As many as the other anchor has entries."""
        return self.far

    @cached_property
    def moves(self) -> int:
        """Entries of the chain, without those of the other anchor."""
        return self.size - self.far

    @cached_property
    def hinges(self) -> Int[np.ndarray, "bodies 3"]:
        """Entries of the hinges of each body: near anchor, links, tip."""
        first = np.concatenate([[3], ANCHOR + (3 + len(self.slides)) * np.arange(self.links)])
        if len(self.orders) > self.links:
            first = np.append(first, self.moves - 3)
        return np.asarray(first[:, None] + np.arange(3))

    @cached_property
    def gives(self) -> Int[np.ndarray, "links slides"]:
        """Entries of the slides of each link."""
        first = self.hinges[1 : self.links + 1, -1:] + 1
        return np.asarray(first + np.arange(len(self.slides)))

    @cached_property
    def axes(self) -> Axes:
        """Axes of the hinges of each body when all are at rest at 0."""
        return np.concatenate([CLAMP_AXES[None], self.way * np.eye(3)[self.orders]])

    @cached_property
    def _body(self) -> Int[np.ndarray, " moves"]:
        """Body that each entry moves, and all beyond it; also its first joint that moves."""
        out = np.zeros(self.moves, dtype=int)
        out[self.hinges] = np.arange(len(self.hinges))[:, None]
        out[self.gives] = np.arange(1, self.links + 1)[:, None]
        return out

    @cached_property
    def _turning(self) -> Bool[np.ndarray, " moves"]:
        out = np.zeros(self.moves, dtype=bool)
        out[self.hinges] = True
        return out

    @cached_property
    def free(self) -> Bool[np.ndarray, " entries"]:
        """Entries that are unknown; the others are prescribed."""
        return np.asarray(np.isfinite(self.springs[:, STIFF, -1]))

    @cached_property
    def targets(self) -> Float[np.ndarray, "entries settings"]:
        """Values of prescribed entries, and where springs are at rest."""
        return self.springs[:, REST]

    @cached_property
    def rigidity(self) -> Float[np.ndarray, "entries settings"]:
        """Stiffness of unknown entries, which cables raise."""
        return np.where(self.free[:, None], self.springs[:, STIFF], 0.0)

    @cached_property
    def couples(self) -> Float[np.ndarray, "entries settings"]:
        """What springs exert on entries that are 0."""
        return np.asarray(self.rigidity[:, -1:] * self.targets)

    @cached_property
    def stiffness(self) -> Float[np.ndarray, "entries entries"]:
        """Of hinges, slides and springs without cables."""
        return np.diag(self.rigidity[:, -1])

    @property
    def length(self) -> float:
        """Length of a link."""
        return 1.0 / self.links

    # --- places ---------------------------------------------------------------------------------

    def pose(self, v: Vector) -> Pose:
        """Rotations and places of all bodies, axes of all joints."""
        count, local = len(self.hinges), np.empty((len(self.hinges), 3, 3))
        turn = np.tile(np.eye(3), (count, 1, 1))
        for k in range(3):
            axes = self.axes[:, k]
            local[:, k] = np.einsum("bxy,by->bx", turn, axes)
            turn = turn @ rotations(axes, v[self.hinges[:, k]])
        frames = np.empty((count, 3, 3))
        before = np.empty((count, 3, 3))
        carried = np.eye(3)
        for b, each in enumerate(turn):
            before[b] = carried
            frames[b] = carried = carried @ each
        links = frames[1 : self.links + 1]
        steps = np.zeros((self.links, 3))
        steps[:, 0] = self.length
        steps[:, self.slides] += v[self.gives]
        ways = self.way * np.einsum("bxy,by->bx", links, steps)
        nodes = np.cumsum(np.vstack([v[:3], ways]), axis=0)
        axes, pivots = np.empty((2, self.moves, 3))
        axes[:3], axes[self.hinges] = np.eye(3), np.einsum("bxy,bky->bkx", before, local)
        axes[self.gives] = self.way * links[:, :, self.slides].transpose(0, 2, 1)
        pivots[:] = nodes[np.maximum(self._body - 1, 0)]
        far = v[self.moves :]
        clamp = np.eye(3)
        if len(far) == ANCHOR:
            for turned in rotations(CLAMP_AXES, far[3:]):
                clamp = clamp @ turned
        return Pose(frames, axes, pivots, nodes, clamp)

    def places(self, v: Vector) -> Float[np.ndarray, "members joints space"]:
        """Places of the joints between links from end A on."""
        return self.pose(v).nodes[None, :: self.way]

    def closure(self, v: Vector) -> Float[np.ndarray, " closures"]:
        """Gap at the other anchor, and the products of axes."""
        return self._closure(v, self.pose(v))

    def _closure(self, v: Vector, pose: Pose) -> Float[np.ndarray, " closures"]:
        tip = pose.frames[-1]
        products = [-tip[:, a] @ pose.clamp[:, b] for a, b in ALIGNED]
        gap = v[self.moves : self.moves + 3] - (pose.nodes[-1] if self.far else ())
        return np.concatenate([gap, products])[: self.far]

    # --- equations ------------------------------------------------------------------------------

    def _loads(
        self, pose: Pose, multipliers: Pulls, y: Settings
    ) -> tuple[Float[np.ndarray, "moves 3 3"], Float[np.ndarray, "moves 3"]]:
        """S = Σ (x − p) Fᵀ and Σ F over the joints beyond each entry; couples of the end in S."""
        force = self.forces @ y
        if self.far:
            force[-1] += multipliers[:3]
        # the tip carries no joint
        beyond, moments = np.zeros((self.links + 2, 3)), np.zeros((self.links + 2, 3, 3))
        beyond[:-1] = np.cumsum(force[::-1], axis=0)[::-1]
        moments[:-1] = np.cumsum((pose.nodes[:, :, None] * force[:, None])[::-1], axis=0)[::-1]
        pull = beyond[self._body]
        out = moments[self._body] - pose.pivots[:, :, None] * pull[:, None]
        tip = pose.frames[-1]
        for (a, b), couple in zip(ALIGNED, multipliers[3:], strict=False):
            out += couple * np.outer(tip[:, a], pose.clamp[:, b])
        return out, pull

    def residual(self, v: Vector, multipliers: Pulls, y: Settings) -> Float[np.ndarray, " all"]:
        """F = (∂L/∂v, closure); rows of prescribed angles of the other anchor have no loads."""
        pose = self.pose(v)
        moments, pull = self._loads(pose, multipliers, y)
        turns = np.stack([moments[:, i, j] - moments[:, j, i] for i, j in ALIGNED], axis=1)
        out = (self.rigidity @ y) * v - self.couples @ y
        work = np.where(self._turning[:, None], turns, pull)
        out[: self.moves] -= (pose.axes * work).sum(axis=1)
        out[self.moves : self.moves + 3] += multipliers[:3]
        return np.concatenate([out, self._closure(v, pose)])

    def jacobian(self, v: Vector, multipliers: Pulls, y: Settings) -> Float[np.ndarray, "all all"]:
        """Derivative of the residual, but for prescribed angles of the other anchor."""
        pose, n, size = self.pose(v), self.moves, self.size
        moments, pull = self._loads(pose, multipliers, y)
        turned = np.einsum("mxy,my->mx", moments, pose.axes)
        turned -= np.trace(moments, axis1=1, axis2=2)[:, None] * pose.axes
        moved = np.where(self._turning[:, None], turned, cross(pose.axes, pull))
        upper = np.triu((pose.axes * self._turning[:, None]) @ moved.T)
        out = np.zeros((size + self.far, size + self.far))
        out[range(size), range(size)] = self.rigidity @ y
        out[:n, :n] -= upper + np.triu(upper, 1).T
        if self.far:
            border = out[size:, :size]
            border[:3, :n] = -self._carries(pose, pose.nodes[-1], self.links).T
            border[:3, n : n + 3] = np.eye(3)
            tip = pose.frames[-1]
            for row, (a, b) in enumerate(ALIGNED[: self.far - 3]):
                ways = cross(pose.axes, tip[:, a]) * self._turning[:, None]
                border[3 + row, :n] = -ways @ pose.clamp[:, b]
            out[:size, size:] = border.T
        return out

    def _carries(
        self, pose: Pose, point: Float[np.ndarray, "3"], body: int
    ) -> Float[np.ndarray, "moves 3"]:
        """How a point of a body moves with each entry."""
        arms = np.where(self._turning[:, None], cross(pose.axes, point - pose.pivots), pose.axes)
        return np.asarray(arms * (self._body <= body)[:, None])

    def potential(self, v: Vector, y: Settings) -> float:
        """Energy of hinges, slides, springs and loads."""
        stiff, couple = self.rigidity @ y, self.couples @ y
        rest = np.divide(couple, stiff, out=np.zeros(self.size), where=stiff > 0.0)
        work = float(((self.forces @ y) * self.pose(v).nodes).sum())
        return float(0.5 * stiff @ (v - rest) ** 2) - work

    def mass(self, v: Vector) -> Float[np.ndarray, "entries entries"]:
        """Mass matrix of links with uniform density; their rotary inertia is h²/12 about all axes.

        The chain has the mass 1; an anchor that moves has that of a node.
        """
        pose, n, each = self.pose(v), self.moves, 1.0 / self.links
        out = np.zeros((self.size, self.size))
        centres = (
            pose.nodes[1:] - 0.5 * self.length * self.way * pose.frames[1:][: self.links, :, 0]
        )
        for link, centre in enumerate(centres, start=1):
            moves = self._carries(pose, centre, link)
            turns = pose.axes * (self._turning & (self._body <= link))[:, None]
            out[:n, :n] += each * (moves @ moves.T + self.length**2 / 12.0 * turns @ turns.T)
        for first in (0, n)[: 2 if self.far else 1]:
            at = first + np.arange(3)
            out[at, at] += LIGHT * each
        return out


def rotations(axes: Float[np.ndarray, "joints 3"], angles: Float[np.ndarray, " joints"]) -> Axes:
    """Rotations about unit axes: ``cos I + sin [a]× + (1 − cos) a aᵀ``."""
    c, s = np.cos(angles)[:, None, None], np.sin(angles)[:, None, None]
    around = (1.0 - c) * (axes[:, :, None] * axes[:, None])
    return np.asarray(c * np.eye(3) + s * _across(axes) + around)


def cross(a: Float[np.ndarray, "many 3"], b: Float[np.ndarray, "... 3"]) -> np.ndarray:
    """a × b; for small arrays in a fraction of numpy's time."""
    return np.asarray((_across(a) @ b[..., None])[..., 0])


def _across(axes: Float[np.ndarray, "many 3"]) -> Axes:
    """Matrices [a]× of products with vectors."""
    return (axes @ _CROSS).reshape(-1, 3, 3)
