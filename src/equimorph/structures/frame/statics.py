"""Forces in a network that balance: those of loads, and those that members keep among themselves.

Dead loads reach the ground along many ways; what differs between two of them is a circulation of
force around cycles of the network, closed through the ground. Forces in x and in y balance
separately, so that each has a graph: members, and an edge to the ground for each support.

In space, a support that is inclined ties the forces along x, y and z: those along a direction in
which it lets a joint slide must vanish. Each such condition reduces their basis by one force.
"""

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from equimorph.arrays import Bool, Float, Int
from equimorph.errors import InputError


class Flows(NamedTuple):
    """Balanced forces: in each member at its start (on it), and of each support (on its joint)."""

    members: Float[np.ndarray, "flows members"]
    supports: Float[np.ndarray, "flows joints"]


@dataclass(frozen=True, eq=False)
class Graph:
    """Members and supports in one direction; the ground is the last vertex.

    Edges are the members, from start to end, then the supports, from their joints to the ground.
    """

    joints: int
    members: Int[np.ndarray, "members 2"]
    supported: Bool[np.ndarray, " joints"]

    @property
    def edges(self) -> list[tuple[int, int]]:
        """Ends of all edges."""
        grounded = [(int(j), self.joints) for j in np.flatnonzero(self.supported)]
        return [(int(a), int(b)) for a, b in self.members] + grounded

    def _flows(self, along: Float[np.ndarray, "flows edges"]) -> Flows:
        """Forces along edges; what flows into the ground is the support's force."""
        count = len(self.members)
        supports = np.zeros((len(along), self.joints))
        supports[:, self.supported] = along[:, count:]
        return Flows(along[:, :count].copy(), supports)

    def tree(self, root: int) -> list[tuple[int, int, int]]:
        """Shortest paths from a vertex: (vertex, edge to the one before, that one), nearest first.

        Vertices that cannot be reached are left out.
        """
        joined: list[list[tuple[int, int]]] = [[] for _ in range(self.joints + 1)]
        for edge, (a, b) in enumerate(self.edges):
            joined[a].append((edge, b))
            joined[b].append((edge, a))
        found, seen, queue = [], {root}, deque([root])
        while queue:
            here = queue.popleft()
            for edge, there in joined[here]:
                if there not in seen:
                    seen.add(there)
                    found.append((there, edge, here))
                    queue.append(there)
        return found

    def carrying_forces(self, loads: Float[np.ndarray, "flows joints"]) -> Flows:
        """Forces that carry loads on the joints to the ground along shortest paths."""
        edges = self.edges
        along = np.zeros((len(loads), len(edges)))
        total = np.pad(loads, ((0, 0), (0, 1)))
        for joint, edge, before in reversed(self.tree(self.joints)):
            along[:, edge] = -total[:, joint] if edges[edge][0] == joint else total[:, joint]
            total[:, before] += total[:, joint]
        return self._flows(along)

    def circulations(self) -> Flows:
        """Forces of size 1 around independent cycles, as short as possible."""
        edges = self.edges
        cycles = [self._around(cycle) for cycle in self._shortest_cycles()]
        return self._flows(np.array(cycles).reshape(len(cycles), len(edges)))

    def _shortest_cycles(self) -> list[int]:
        """Minimum cycle basis [Horton1987]_, each cycle as a set of bits, one for each edge."""
        candidates = set()
        edges = self.edges
        for root in range(self.joints + 1):
            path = {root: 0}
            for vertex, edge, before in self.tree(root):
                path[vertex] = path[before] | (1 << edge)
            for edge, (a, b) in enumerate(edges):
                cycle = path[a] ^ path[b] ^ (1 << edge)
                candidates.add(cycle)
        chosen: list[int] = []
        reduced: dict[int, int] = {}
        for cycle in sorted(candidates, key=lambda bits: (bits.bit_count(), bits)):
            rest = cycle
            while rest and (top := rest.bit_length()) in reduced:
                rest ^= reduced[top]
            if rest:
                reduced[rest.bit_length()] = rest
                chosen.append(cycle)
        return chosen

    def _around(self, cycle: int) -> Float[np.ndarray, " edges"]:
        """Force 1 around a cycle, in the direction of its first edge."""
        edges = self.edges
        left = [edge for edge in range(len(edges)) if cycle >> edge & 1]
        along = np.zeros(len(edges))
        here = edges[left[0]][0]
        while left:
            edge = next(each for each in left if here in edges[each])
            left.remove(edge)
            forward = edges[edge][0] == here
            along[edge] = 1.0 if forward else -1.0
            here = edges[edge][1 if forward else 0]
        return along


NOTHING = 1e-12
"""Component of a unit vector, or share of a force, that counts as none."""


class SpaceFlows(NamedTuple):
    """Balanced forces: in each piece at its start, and of each support on its joint."""

    members: Float[np.ndarray, "flows members 3"]
    supports: Float[np.ndarray, "flows joints 3"]


Pivots = list[tuple[int, SpaceFlows]]
"""Numbers of slides, and for each the circulation that removes forces along it."""


@dataclass(frozen=True, eq=False)
class SpaceStatics:
    """Forces in pieces between joints, some of which are held along given directions."""

    joints: Sequence[str]
    ends: Int[np.ndarray, "members 2"]
    held: Sequence[Float[np.ndarray, "_ 3"]]

    @cached_property
    def _graphs(self) -> list[Graph]:
        """Ways of forces along x, y and z; equal graphs are one object."""
        found: list[Graph] = []
        for axis in range(3):
            supported = np.array([bool((np.abs(d[:, axis]) > NOTHING).any()) for d in self.held])
            if not supported.any():
                raise InputError(
                    f"`frame` must not be a mechanism; nothing holds it in {'xyz'[axis]}. Add a "
                    "support."
                )
            same = [each for each in found if np.array_equal(each.supported, supported)]
            found.append(same[0] if same else Graph(len(self.joints), self.ends, supported))
        return found

    @cached_property
    def _slides(self) -> list[tuple[int, Float[np.ndarray, "3"]]]:
        """Joints, and directions along which their supports bear no force though graphs do."""
        found = []
        for j, directions in enumerate(self.held):
            some = [graph.supported[j] for graph in self._graphs]
            span = np.eye(3)[some]
            inside = span - span @ directions.T @ directions
            _, sizes, rows = np.linalg.svd(inside)
            free = len(span) - len(directions)
            found += [(j, row) for row in rows[:free] if free > 0 and sizes[0] > NOTHING]
        return found

    def circulations(self) -> tuple[SpaceFlows, Pivots]:
        """Forces of independent cycles without any along slides, and what removes these."""
        flows, made = [], {}
        for axis, graph in enumerate(self._graphs):
            if id(graph) not in made:
                made[id(graph)] = graph.circulations()
            around = made[id(graph)]
            flows.append(_along(axis, around.members, around.supports))
        members, supports = (np.concatenate(each) for each in zip(*flows, strict=True))
        pivots = []
        for k, (j, direction) in enumerate(self._slides):
            forces = supports[:, j] @ direction
            if np.abs(forces).max(initial=0.0) <= NOTHING:
                continue
            size = (np.abs(members).max(axis=2) > NOTHING).sum(axis=1)
            best = int(np.argmax(np.abs(forces) * 1e3 - size))
            one = SpaceFlows(
                members[best : best + 1] / forces[best], supports[best : best + 1] / forces[best]
            )
            rest = np.arange(len(forces)) != best
            shares = forces[rest, None, None]
            members = members[rest] - shares * one.members
            supports = supports[rest] - shares * one.supports
            pivots.append((k, one))
        return SpaceFlows(members, supports), pivots

    def carrying_forces(
        self, loads: Float[np.ndarray, "flows joints 3"], pivots: Pivots
    ) -> SpaceFlows:
        """Forces that carry loads on the joints to the ground; `pivots`: see `circulations`."""
        parts = []
        for axis, graph in enumerate(self._graphs):
            found = graph.carrying_forces(np.ascontiguousarray(loads[:, :, axis]))
            parts.append(_along(axis, found.members, found.supports))
        members = np.sum([part.members for part in parts], axis=0)
        supports = np.sum([part.supports for part in parts], axis=0)
        for k, one in pivots:
            j, direction = self._slides[k]
            forces = (supports[:, j] @ direction)[:, None, None]
            members, supports = members - forces * one.members, supports - forces * one.supports
        for j, direction in self._slides:
            if np.abs(supports[:, j] @ direction).max(initial=0.0) > 1e-9:
                written = ", ".join(f"{x:.3g}" for x in direction + 0.0)
                raise InputError(
                    f"`frame` must not be a mechanism; joint {self.joints[j]} can move along "
                    f"({written}) without force. Add a support."
                )
        return SpaceFlows(np.asarray(members), np.asarray(supports))


def _along(
    axis: int, members: Float[np.ndarray, "flows members"], supports: np.ndarray
) -> SpaceFlows:
    """Forces in one direction as vectors."""
    unit = np.eye(3)[axis]
    return SpaceFlows(members[..., None] * unit, supports[..., None] * unit)
