"""Forces in a network in space that balance: those of loads, and those among its members.

Forces along x, y and z balance separately, each in a graph of members and supports. A support that
is inclined ties them: forces along a direction in which it lets a joint slide must vanish. Their
basis is reduced by one force for each such condition.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from equimorph.arrays import Float, Int
from equimorph.errors import InputError
from equimorph.structures.frame.statics import Graph

NOTHING = 1e-12
"""Component of a unit vector, or share of a force, that counts as none."""


class SpaceFlows(NamedTuple):
    """Balanced forces: in each piece at its start, and of each support on its joint."""

    members: Float[np.ndarray, "flows members 3"]
    supports: Float[np.ndarray, "flows joints 3"]

    def combined(self, by: Float[np.ndarray, "others flows"]) -> "SpaceFlows":
        """Linear combinations."""
        return SpaceFlows(
            np.einsum("of,fmk->omk", by, self.members), np.einsum("of,fjk->ojk", by, self.supports)
        )


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
                    f"`frame` must be no mechanism; nothing holds it in {'xyz'[axis]}. Add a "
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

    @cached_property
    def _reduced(self) -> tuple[SpaceFlows, list[tuple[int, SpaceFlows]]]:
        """Circulations without forces along slides, and for each slide the one that removes it."""
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

    def circulations(self) -> SpaceFlows:
        """Forces of independent cycles."""
        return self._reduced[0]

    def carrying_forces(self, loads: Float[np.ndarray, "flows joints 3"]) -> SpaceFlows:
        """Forces that carry loads on the joints to the ground."""
        parts = []
        for axis, graph in enumerate(self._graphs):
            found = graph.carrying_forces(np.ascontiguousarray(loads[:, :, axis]))
            parts.append(_along(axis, found.members, found.supports))
        members = np.sum([part.members for part in parts], axis=0)
        supports = np.sum([part.supports for part in parts], axis=0)
        for k, one in self._reduced[1]:
            j, direction = self._slides[k]
            forces = (supports[:, j] @ direction)[:, None, None]
            members, supports = members - forces * one.members, supports - forces * one.supports
        for j, direction in self._slides:
            if np.abs(supports[:, j] @ direction).max(initial=0.0) > 1e-9:
                written = ", ".join(f"{x:.3g}" for x in direction + 0.0)
                raise InputError(
                    f"`frame` must be no mechanism; joint {self.joints[j]} can move along "
                    f"({written}) without force. Add a support."
                )
        return SpaceFlows(np.asarray(members), np.asarray(supports))


def _along(
    axis: int, members: Float[np.ndarray, "flows members"], supports: np.ndarray
) -> SpaceFlows:
    """Forces in one direction as vectors."""
    unit = np.eye(3)[axis]
    return SpaceFlows(members[..., None] * unit, supports[..., None] * unit)
