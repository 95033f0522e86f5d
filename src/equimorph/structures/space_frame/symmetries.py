"""Symmetries of frames in space: mirror images and half turns about the middle of the joints."""

from functools import cached_property

import numpy as np

from equimorph.arrays import Float, Int, Lanes
from equimorph.structures.frame.images import NOWHERE, Effects, FrameImage
from equimorph.tolerances import SAME_NUMBER


class SpatialImage(FrameImage):
    """An image of a frame in space.

    Turns w from where nodes are drawn become M w M: the vector part of their quaternions is
    multiplied by det(M) M.
    """

    @property
    def turn(self) -> Float[np.ndarray, "3"]:
        """Signs of rotation vectors: det(M) M."""
        return np.asarray(self.axes.prod() * self.axes)

    @property
    def node_count(self) -> int:
        """Number of nodes."""
        return len(self.model.turning)

    def complete(self, nodes: Int[np.ndarray, " nodes"]) -> Int[np.ndarray, " nodes"]:
        """The same with parents of hinges that no member is rigidly joined to."""
        model, found = self.model, nodes.copy()
        on = dict(zip(model.hinged.tolist(), model.parents.tolist(), strict=True))
        for child, parent in on.items():
            if found[parent] == NOWHERE:
                found[parent] = on.get(int(found[child]), NOWHERE)
        return found

    @cached_property
    def possible(self) -> bool:
        """Whether nodes come to be at nodes that turn alike."""
        model, nodes = self.model, self.nodes
        for row, at, back in zip(model.piece_nodes, self.there, self.reversed, strict=True):
            if (nodes[row] != model.piece_nodes[at][:: -1 if back else 1]).any():
                return False
        if not np.array_equal(np.sort(nodes), np.arange(len(nodes))):
            return False
        if not np.array_equal(model.turning[nodes], model.turning):
            return False
        leaning = np.full(len(nodes), NOWHERE)
        leaning[model.hinged] = model.parents
        alike = leaning[nodes[model.hinged]] == nodes[model.parents]
        return bool(alike.all() and (np.abs(np.abs(self.hinges) - 1.0) <= SAME_NUMBER).all())

    @cached_property
    def _hinges_there(self) -> Int[np.ndarray, " hinges"]:
        """The hinge on which each comes to lie."""
        return np.asarray(np.searchsorted(self.model.hinged, self.nodes[self.model.hinged]))

    @property
    def hinges(self) -> Float[np.ndarray, " hinges"]:
        """Signs of the angles of hinges: the axis of each, moved, along that which is there."""
        axes = self.model.hinge_axes
        return np.asarray((self.turn * axes * axes[self._hinges_there]).sum(axis=1))

    def _along(self, values: Float[np.ndarray, "pieces points k"]) -> np.ndarray:
        """Values along the pieces, at the pieces on which they come to lie."""
        out = np.empty_like(values)
        out[self.there] = np.where(self.reversed[:, None, None], values[:, ::-1], values)
        return out

    def turning_effects(self, k: int) -> Effects:
        """Turns of supports, and moments of actuated strains."""
        model, turns = self.model, self.model.patterns.turns[k]
        bend = self.turn * np.where(self.reversed, -1.0, 1.0)[:, None, None]
        strain = model.patterns.strains[k][model.owner]
        moment = np.einsum("eiab,eb->eia", model.moment_of_strain, strain)
        moment = moment.reshape(model.pieces, -1, 3)
        bodies = self.nodes[: len(turns)]
        return [self.put(bodies, self.turn * turns, turns), (moment, self._along(bend * moment))]

    def move(
        self, z: Lanes, scalars: Float[np.ndarray, "lanes scalars"]
    ) -> Float[np.ndarray, "lanes unknowns"]:
        """Quaternions of the free nodes, and angles of hinges."""
        del scalars
        model, rows = self.model, 4 * len(self.model.free)
        turns = z[:, :rows].reshape(len(z), len(model.free), 4)
        image, angles = np.empty_like(turns), np.empty_like(z[:, rows : model.unknowns])
        image[:, model.place[self.nodes[model.free]]] = turns * np.append(1.0, self.turn)
        angles[:, self._hinges_there] = self.hinges * z[:, rows : model.unknowns]
        return np.concatenate([image.reshape(len(z), rows), angles], axis=1)
