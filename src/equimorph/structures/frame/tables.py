"""The arrays of a frame as its kernel takes them."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from equimorph.array_types import Bool, Float, Int
from equimorph.linalg.sparse import SparseLayout
from equimorph.structures.frame.model import FrameModel


@dataclass(frozen=True, eq=False)
class Tables:
    """Sparsity of F_z, and what the kernel adds to which of its entries.

    Members are condensed onto their ends first, then the multipliers are eliminated, then the
    joints: what remains for these is the network's stiffness.
    """

    model: FrameModel

    @cached_property
    def layout(self) -> SparseLayout:
        """One entry for each pair in an element, in a member and the forces that pass it."""
        model, n = self.model, self.model.unknowns
        found = {(i, i) for i in range(n + model.multipliers)}
        for row in model.place[model.nodes].tolist():
            found |= {(i, j) for i in row for j in row if i >= j >= 0}
        forces = self.which
        for m, row in enumerate(model.place[model.member_nodes].tolist()):
            through = [n + c for c in forces[m, : self.ties[m, 0]].tolist()]
            found |= {(c, i) for c in through for i in row if i >= 0}
            if model.network.members[m].EA is not None:
                found |= {(c, d) for c in through for d in through if c >= d}
        corner = model.quadratic[: model.multipliers, : model.multipliers]
        found |= {(n + c, n + d) for c, d in zip(*np.nonzero(np.tril(corner)), strict=True)}
        rows, columns = np.array(sorted(found)).T
        return SparseLayout(rows, columns, n + model.multipliers, model.multipliers, self.ranks)

    @cached_property
    def ranks(self) -> Int[np.ndarray, " size"]:
        """Turn of each variable in the elimination.

        Without its forces, a member that is hinged at both ends turns freely: its start waits.
        """
        model = self.model
        late = np.zeros(len(model.place), bool)
        late[model.joint_nodes[model.network.rigid]] = True
        late[model.member_nodes[model.network.hinged.all(axis=1), 0]] = True
        of_nodes = np.where(late, 2, 0)[model.place >= 0]
        return np.concatenate([of_nodes, np.ones(model.multipliers, int)])

    @cached_property
    def _slots(self) -> dict[tuple[int, int], int]:
        pairs = zip(self.layout.rows.tolist(), self.layout.columns.tolist(), strict=True)
        return {pair: slot for slot, pair in enumerate(pairs)}

    @cached_property
    def ties(self) -> Int[np.ndarray, "members 2"]:
        """Number of multipliers, and of scalars, that have a force in each member."""
        acting, m = self.model.acting, self.model.multipliers
        return np.stack([acting[:, :m].sum(axis=1), acting.sum(axis=1)], axis=1)

    @cached_property
    def which(self) -> Int[np.ndarray, "members most"]:
        """These scalars, multipliers first; rows are filled up with 0."""
        acting = self.model.acting
        found = np.zeros((len(acting), max(int(self.ties[:, 1].max()), 1)), int)
        for m, row in enumerate(acting):
            found[m, : row.sum()] = np.flatnonzero(row)
        return found

    def _compact(self, table: Float[np.ndarray, "points scalars"]) -> Float[np.ndarray, "points n"]:
        """Columns of the scalars that have a force in the member of each point."""
        columns = self.which[self.model.owner]
        some = np.arange(columns.shape[1]) < self.ties[self.model.owner, 1:]
        return np.where(some, np.take_along_axis(table, columns, axis=1), 0.0)

    @cached_property
    def diagonal(self) -> Int[np.ndarray, " nodes"]:
        """Entry on the diagonal of each node; −1 for prescribed ones."""
        place = self.model.place
        return np.where(place >= 0, self.layout.diagonal[place], -1)

    @cached_property
    def edges(self) -> Int[np.ndarray, "points most"]:
        """Entry of each multiplier in `which` and the node at each point, or −1."""
        model, n = self.model, self.model.unknowns
        places = model.place[model.nodes].ravel().tolist()
        rows = self.which[model.owner].tolist()
        slots = [
            [self._slots.get((n + c, i), -1) for c in row]
            for row, i in zip(rows, places, strict=True)
        ]
        return np.array(slots)

    @cached_property
    def corners(self) -> Int[np.ndarray, "members most most"]:
        """Entry of each pair of multipliers in `which`, or −1."""
        n = self.model.unknowns
        rows = self.which.tolist()
        return np.array(
            [[[self._slots.get((n + c, n + d), -1) for d in row] for c in row] for row in rows]
        )

    @cached_property
    def constant(self) -> Float[np.ndarray, " entries"]:
        """Entries that do not depend on the state."""
        model, m = self.model, self.model.multipliers
        total = np.zeros((model.unknowns + m, model.unknowns + m))
        for element, nodes in zip(model.stiffness, model.nodes, strict=True):
            places = model.place[nodes]
            some = places >= 0
            total[np.ix_(places[some], places[some])] += element[np.ix_(some, some)]
        free = model.place >= 0
        total[model.place[free], model.place[free]] += model.springs[free]
        total[model.unknowns :, model.unknowns :] = model.quadratic[:m, :m]
        return np.asarray(total[self.layout.rows, self.layout.columns])

    @cached_property
    def held(self) -> Bool[np.ndarray, " elements"]:
        """Elements with a prescribed node."""
        return np.asarray((self.model.place[self.model.nodes] < 0).any(axis=1))

    @cached_property
    def shared(self) -> tuple[np.ndarray, ...]:
        """What the kernel shares among lanes."""
        model = self.model
        slope = np.argwhere(model.slope)
        arrays = (
            model.nodes, self.held, model.place, model.stiffness, model.springs, model.softness,
            self._compact(model.sine), self._compact(model.cosine), self.which, self.ties,
            self.diagonal, self.edges, self.corners, model.stretch, model.turned, slope,
            model.slope[slope[:, 0], slope[:, 1]], model.quadratic[: model.multipliers],
            self.constant,
        )  # fmt: skip
        return tuple(np.ascontiguousarray(array) for array in arrays)
