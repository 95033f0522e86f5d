"""Forces in a network that balance: those of loads, and those that members keep among themselves.

Dead loads reach the ground along many ways; what differs between two of them is a circulation of
force around cycles of the network, closed through the ground. Forces in x and in y balance
separately, so that each has a graph: members, and an edge to the ground for each support.
"""

from collections import deque
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from equimorph.arrays import Bool, Float, Int


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
