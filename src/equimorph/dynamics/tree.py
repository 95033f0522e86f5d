"""A linkage as a tree of rigid bodies: which hangs on which, and what its joints are."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from equimorph.arrays import Float, Int
from equimorph.dynamics.linkage import Linkage
from equimorph.dynamics.mechanism import Vector

WORLD = -1
"""Parent of bodies that hang on nothing else."""


@dataclass(frozen=True, eq=False)
class Body:
    """One body: a link, or a node that moves."""

    parent: int
    """Number of the body that carries it; `WORLD` if none."""
    node: int = -1
    link: int = -1
    """Its node, and the number of its link among all links; −1 if it is not one."""
    base: int = -1
    """Node held in the world on which it stands; −1 where its parent carries it, and where it
    floats."""
    reversed: bool = False
    """Whether a link is built from its end to its start."""
    at_start: bool = False
    """Whether its parent, a link that floats, carries it at its start."""

    @property
    def floats(self) -> bool:
        """Whether nothing carries it."""
        return self.parent == WORLD and self.base < 0


@dataclass(frozen=True, eq=False)
class Tree:
    """Bodies of a linkage in an order in which parents come first.

    Every node with a support stands in the world; members hang on one of their ends. Where the
    other end is at a node that has its place already, the loop is closed there. Members that both
    ends hold in the world float, carried by the link in their middle and closed at both ends:
    matrices of two branches are cheaper to factorise than those of one chain.
    """

    linkage: Linkage
    bodies: tuple[Body, ...]
    closed: tuple[tuple[int, int], ...]
    """(Body at the member's far end, node) of each loop."""

    @cached_property
    def entries(self) -> Int[np.ndarray, " bodies"]:
        """Entries of the linkage that are the bodies' angles; −1 for nodes that do not turn."""
        linkage = self.linkage
        out = []
        for body in self.bodies:
            if body.link >= 0:
                out.append(3 * linkage.nodes + body.link)
            else:
                turns = linkage.free[linkage.turn_entries[body.node]]
                out.append(int(linkage.turn_entries[body.node]) if turns else -1)
        return np.array(out)

    @cached_property
    def above(self) -> Float[np.ndarray, "bodies bodies"]:
        """1 where the second body is the first one or carries it."""
        count = len(self.bodies)
        out = np.eye(count)
        for k, body in enumerate(self.bodies):
            if body.parent != WORLD:
                out[k] += out[body.parent]
        return out

    @cached_property
    def levers(self) -> Float[np.ndarray, "bodies bodies"]:
        """1 where the second body is the first one or carries it at its far end."""
        out = self.above.copy()
        for k, body in enumerate(self.bodies):
            if body.at_start:
                out[self.above[:, k] > 0.0, body.parent] = 0.0
        return out

    @cached_property
    def sizes(self) -> Float[np.ndarray, " bodies"]:
        """Lengths of the bodies: 0 of nodes."""
        flat = self.linkage.lengths.ravel()
        return np.array([flat[body.link] if body.link >= 0 else 0.0 for body in self.bodies])

    @cached_property
    def offsets(self) -> Float[np.ndarray, " bodies"]:
        """Angle of each body minus that of its link: π where it is reversed."""
        return np.array([np.pi if body.reversed else 0.0 for body in self.bodies])

    @cached_property
    def forces(self) -> Float[np.ndarray, "bodies 2 settings"]:
        """Dead forces at the far end of each body, and of all that it carries there."""
        linkage = self.linkage
        own = np.zeros((len(self.bodies), 2, linkage.couples.shape[1]))
        links = linkage.lengths.shape[1]
        for k, body in enumerate(self.bodies):
            if body.link >= 0:
                member, at = divmod(body.link, links)
                own[k] = linkage.forces[member, at if body.reversed else at + 1]
                before = self.bodies[body.parent] if body.parent != WORLD else None
                first = before is None or before.link < 0 or before.link // links != member
                if first and before is not None:
                    own[body.parent] += linkage.forces[member, at + 1 if body.reversed else at]
            else:
                own[k] += linkage.node_forces[body.node]
        return np.asarray(np.einsum("kj,kxs->jxs", self.levers, own))

    @cached_property
    def floating(self) -> dict[int, Float[np.ndarray, "2 settings"]]:
        """Dead forces on the members that float, by the body that carries all others."""
        links = self.linkage.lengths.shape[1]
        return {
            k: self.linkage.forces[body.link // links].sum(axis=0)
            for k, body in enumerate(self.bodies)
            if body.floats
        }

    def angles(self, v: Vector) -> Float[np.ndarray, " bodies"]:
        """Angles of the bodies in a configuration of the linkage."""
        entry = self.entries
        return np.asarray(np.where(entry >= 0, v[entry], 0.0) + self.offsets)


def tree_of(linkage: Linkage) -> Tree:
    """Build the tree: nodes with supports first, then members as they are reached."""
    bodies: list[Body] = []
    held = linkage.supports
    stands: dict[int, int] = {}
    for node in range(linkage.nodes):
        if held.stiffness[node].any():
            moves = np.isfinite(held.stiffness[node]).any()
            turns = held.rigid[node] and np.isfinite(held.turning[node])
            stands[node] = WORLD
            if moves or turns:
                stands[node] = len(bodies)
                bodies.append(Body(WORLD, node=node, base=node))
    closed: list[tuple[int, int]] = []
    left = set(range(len(linkage.ends)))
    while left:
        member = next(m for m in sorted(left) if set(linkage.ends[m].tolist()) & stands.keys())
        left.remove(member)
        _hang(linkage, member, bodies, stands, closed)
    return Tree(linkage, tuple(bodies), tuple(closed))


def _hang(
    linkage: Linkage,
    member: int,
    bodies: list[Body],
    stands: dict[int, int],
    closed: list[tuple[int, int]],
) -> None:
    """Add the links of a member, and the node at its other end if that has no place yet."""
    start, end = linkage.ends[member].tolist()
    joined = linkage.lengths.shape[1] > 1 and not np.isfinite(linkage.axial[member]).any()
    if joined and stands.get(start) == stands.get(end) == WORLD:
        _float(linkage, member, bodies, closed)
        return
    backward = start not in stands
    near, far = (end, start) if backward else (start, end)
    links = linkage.lengths.shape[1]
    order = range(links - 1, -1, -1) if backward else range(links)
    parent, base = stands[near], near if stands[near] == WORLD else -1
    for at in order:
        bodies.append(Body(parent, link=member * links + at, base=base, reversed=backward))
        parent, base = len(bodies) - 1, -1
    if far in stands:
        closed.append((parent, far))
        return
    if _matters(linkage, far):
        stands[far] = len(bodies)
        bodies.append(Body(parent, node=far))


def _float(
    linkage: Linkage, member: int, bodies: list[Body], closed: list[tuple[int, int]]
) -> None:
    """Add the links of a member that nothing carries: its middle one, then those on both sides."""
    links = linkage.lengths.shape[1]
    middle, root = links // 2, len(bodies)
    bodies.append(Body(WORLD, link=member * links + middle))
    for side, order in enumerate((range(middle - 1, -1, -1), range(middle + 1, links))):
        parent = root
        for at in order:
            back = side == 0
            first = back and parent == root
            bodies.append(Body(parent, link=member * links + at, reversed=back, at_start=first))
            parent = len(bodies) - 1
        closed.append((parent, int(linkage.ends[member, side])))


def _matters(linkage: Linkage, node: int) -> bool:
    """Whether a node without support turns, or joins, loads or holds what ends there."""
    turns = bool(linkage.free[linkage.turn_entries[node]])
    others = int((linkage.ends == node).sum()) > 1
    loaded = linkage.node_forces[node].any() or linkage.couples[linkage.turn_entries[node]].any()
    sprung = 0.0 < linkage.supports.turning[node] < np.inf
    return bool(turns or others or loaded or sprung)
