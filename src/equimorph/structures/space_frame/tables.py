"""The arrays of a frame in space as its kernel takes them."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from equimorph.array_types import Float, Int
from equimorph.linalg.sparse import SparseLayout
from equimorph.structures.space_frame.model import SpatialFrameModel
from equimorph.structures.space_frame.network import Turning

NONE = -1
"""Coordinate of an element, or entry, that there is none of."""


@dataclass(frozen=True, eq=False)
class Tables:
    """Sparsity of F_z in rotations, and what the kernel adds to which of its entries.

    Rows are three for each free node, one for each hinge, and the multipliers. Members are
    condensed onto the joints first; joints and multipliers follow by minimum degree.
    """

    model: SpatialFrameModel

    @cached_property
    def count(self) -> int:
        """Number of rows before the multipliers."""
        return 3 * len(self.model.free) + len(self.model.hinged)

    @cached_property
    def _body_of(self) -> Int[np.ndarray, " nodes"]:
        """The node whose rotation moves each: its parent, if it is hinged."""
        found = np.arange(len(self.model.turning))
        found[self.model.hinged] = self.model.parents
        return found

    @cached_property
    def hinge_of(self) -> Int[np.ndarray, " nodes"]:
        """Number of the hinge of each node, or −1."""
        found = np.full(len(self.model.turning), NONE)
        found[self.model.hinged] = np.arange(len(self.model.hinged))
        return found

    @cached_property
    def hinges_of(self) -> Int[np.ndarray, "elements 2"]:
        """Hinges of both ends of each element, or −1."""
        return np.asarray(self.hinge_of[self.model.nodes[:, [0, -1]]])

    @cached_property
    def dofs(self) -> Int[np.ndarray, "elements coordinates"]:
        """Row of each coordinate of an element: three a node, then the angles of its ends' hinges.

        −2 − k for the component k of what supports hold, −1 for a hinge that is not there.
        """
        model = self.model
        body = self._body_of[model.nodes]
        held = np.full(len(model.turning), NONE)
        held[model.held] = np.arange(len(model.held))
        axes = np.arange(3)
        free = 3 * model.place[body][..., None] + axes
        fixed = -2 - (3 * held[body][..., None] + axes)
        rows = np.where((model.turning[body] == Turning.HELD)[..., None], fixed, free)
        angles = np.where(self.hinges_of >= 0, 3 * len(model.free) + self.hinges_of, NONE)
        return np.concatenate([rows.reshape(len(rows), -1), angles], axis=1)

    @cached_property
    def _crossing(self) -> Int[np.ndarray, "elements most"]:
        """Row of each multiplier that has a force in an element; −1 beyond them."""
        acting = self.model.acting
        most = max(int(acting.ties.max(initial=0)), 1)
        some = np.arange(acting.numbers.shape[1]) < acting.ties[:, None]
        rows = np.where(some, self.count + acting.numbers, NONE)[:, :most]
        return np.asarray(rows[self.model.owner])

    @cached_property
    def _corner_pairs(self) -> Int[np.ndarray, "pairs 2"]:
        """Pairs of multipliers that supports tie by giving way."""
        m = self.model.multipliers
        return self.count + np.argwhere(np.tril(self.model.quadratic[:m, :m]))

    @cached_property
    def layout(self) -> SparseLayout:
        """One entry for each pair in an element, in a piece and the forces that pass it."""
        size = self.count + self.model.multipliers
        elements = self._pairs(self.dofs, self.dofs)
        borders = self._pairs(self._crossing, self.dofs)
        corners = self._pairs(self._crossing[self._first], self._crossing[self._first])
        soft = self.model.compliance > 0.0
        keys = [elements[elements >= 0], borders[borders >= 0], corners[soft][corners[soft] >= 0]]
        nodes = np.arange(size) * size + np.arange(size)
        own = 3 * np.arange(len(self.model.free))[:, None] + np.arange(3)
        inner = self._pairs(own, own)
        ties = self._corner_pairs[:, 0] * size + self._corner_pairs[:, 1]
        found = np.unique(np.concatenate([*keys, nodes, inner[inner >= 0], ties]))
        multipliers = self.model.multipliers
        return SparseLayout(found // size, found % size, size, multipliers, self.ranks)

    @property
    def _first(self) -> slice:
        """The first element of each piece."""
        return slice(None, None, self.model.mesh.elements)

    def _pairs(
        self, rows: Int[np.ndarray, "some r"], columns: Int[np.ndarray, "some c"]
    ) -> Int[np.ndarray, "some r c"]:
        """Keys of the entries of pairs of rows, row ≥ column; −1 where there is none."""
        size = self.count + self.model.multipliers
        a, b = rows[:, :, None], columns[:, None, :]
        keys = np.maximum(a, b) * size + np.minimum(a, b)
        return np.where((a >= 0) & (b >= 0), keys, NONE)

    def _slots(self, keys: np.ndarray) -> np.ndarray:
        """Entries with these keys; −1 where there is none."""
        layout = self.layout
        known = layout.rows * layout.size + layout.columns
        at = np.minimum(np.searchsorted(known, keys), len(known) - 1)
        return np.where(known[at] == keys, at, NONE)

    @cached_property
    def ranks(self) -> Int[np.ndarray, " size"]:
        """Turn of each row in the elimination: inner nodes of the pieces, then joints and forces.

        Without forces, what members join rigidly turns freely as a whole, unless a support holds
        it: one body or one angle of each such part waits until the end.
        """
        model = self.model
        bodies = np.arange(len(model.turning)) < len(model.network.bodies)
        nodes, angles = np.where(bodies[model.free], 1, 0), np.ones(len(model.hinged), int)
        for part in self._rigid_parts:
            turning = model.turning[part]
            if (turning == Turning.HELD).any():
                continue
            free = part[turning == Turning.FREE]
            if len(free):
                nodes[model.place[free[0]]] = 2
            else:
                angles[self.hinge_of[part[0]]] = 2
        return np.concatenate([np.repeat(nodes, 3), angles, np.ones(model.multipliers, int)])

    @property
    def _rigid_parts(self) -> list[Int[np.ndarray, " bodies"]]:
        """Bodies that members join, part by part; hinges join nothing."""
        part = np.arange(len(self.model.network.bodies))
        for a, b in self.model.network.body_of_end.tolist():
            part[part == part[b]] = part[a]
        return [np.flatnonzero(part == each) for each in np.unique(part)]

    @cached_property
    def node_slots(self) -> Int[np.ndarray, "free 6"]:
        """Entries of the lower triangle of each free node."""
        own = 3 * np.arange(len(self.model.free))[:, None] + np.arange(3)
        row, column = np.tril_indices(3)
        return self._slots(self._pairs(own, own)[:, row, column])

    @cached_property
    def constant(self) -> Float[np.ndarray, " entries"]:
        """Entries that do not depend on the state."""
        found = np.zeros(len(self.layout.rows))
        pairs = self._corner_pairs
        slots = self._slots(pairs[:, 0] * self.layout.size + pairs[:, 1])
        quadratic = self.model.quadratic
        found[slots] = quadratic[pairs[:, 0] - self.count, pairs[:, 1] - self.count]
        return found

    @cached_property
    def shared(self) -> tuple[np.ndarray, ...]:
        """What the kernel shares among lanes."""
        model, acting = self.model, self.model.acting
        rows = model.quadratic[: model.multipliers]
        at = np.argwhere(rows)
        arrays = (
            model.nodes, model.owner, model.mesh.reference.derivative, 1.0 / model.element_lengths,
            model.weights, model.tangents, model.arclengths, model.stiff, model.moment_of_strain,
            model.compliance, acting.counts, acting.ties, acting.numbers, acting.start, acting.drop,
            model.strains, model.elongation[..., None], model.free, model.place, model.held,
            model.hinged, model.parents, model.hinge_axes, self.hinges_of, model.stiff_lengths,
            4.0 * model.node_weights[model.free], self.dofs,
            self._slots(self._pairs(self.dofs, self.dofs)),
            self._slots(self._pairs(self._crossing, self.dofs)),
            self._slots(self._pairs(self._crossing[self._first], self._crossing[self._first])),
            self.node_slots, at, rows[at[:, 0], at[:, 1]], self.constant,
        )  # fmt: skip
        return tuple(np.ascontiguousarray(array) for array in arrays)
