"""Symmetries of frames in space: mirror images and half turns about the middle of the joints."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from equimorph.array_types import Bool, Float, Int
from equimorph.arrays import Lanes, Parameters
from equimorph.linalg.dense import multiply
from equimorph.structures.any_network import edges_of_image, images, is_symmetry, parameter_exchange
from equimorph.structures.contract import Symmetry
from equimorph.structures.space_frame.fields import SpatialFrameFields
from equimorph.structures.space_frame.model import SpatialFrameModel
from equimorph.tolerances import SAME_NUMBER

NOWHERE = -1
Matrix = Float[np.ndarray, "scalars scalars"]
Exchange = tuple[Float[np.ndarray, " parameters"], Int[np.ndarray, " parameters"]]


def symmetries(frame: SpatialFrameFields) -> tuple[Symmetry, ...]:
    """Images that leave members, supports, loads and actuators as they are, up to signs."""
    found = []
    for name, axes, joints in images(frame.model.network.places):
        there = edges_of_image(frame.model.network.ends, joints)
        if there is None:
            continue
        image = _Image(frame.model, axes, joints, there)
        if image.possible and image.exchange and is_symmetry(frame, image.apply):
            found.append(Symmetry(name, image.apply, *image.exchange))
    return tuple(found)


@dataclass(frozen=True, eq=False)
class _Image:
    """What an image M = diag(±1, ±1, ±1) does to the pieces, nodes and scalars of a frame.

    Turns w from where nodes are drawn become M w M: the vector part of their quaternions is
    multiplied by det(M) M.
    """

    model: SpatialFrameModel
    axes: Float[np.ndarray, "3"]
    joints: Int[np.ndarray, " joints"]
    there: Int[np.ndarray, " pieces"]
    """The piece on which each comes to lie."""

    @property
    def turn(self) -> Float[np.ndarray, "3"]:
        """Signs of rotation vectors: det(M) M."""
        return np.asarray(self.axes.prod() * self.axes)

    @cached_property
    def reversed(self) -> Bool[np.ndarray, " pieces"]:
        """Whether its start lies on the other's end."""
        ends = self.model.network.ends
        return np.asarray(ends[self.there, 0] != self.joints[ends[:, 0]])

    @cached_property
    def nodes(self) -> Int[np.ndarray, " nodes"]:
        """The node at which each comes to be; nowhere if members do not hang together there."""
        model, rows = self.model, self.model.piece_nodes
        found = np.full(len(model.turning), NOWHERE)
        for row, at, back in zip(rows, self.there, self.reversed, strict=True):
            found[row] = rows[at][::-1] if back else rows[at]
        on = dict(zip(model.hinged.tolist(), model.parents.tolist(), strict=True))
        for child, parent in on.items():  # what no member is rigidly joined to
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

    @cached_property
    def exchange(self) -> Exchange | None:
        """Signs and order of the parameters in the image; None if the image is another frame."""
        model, given, heres, mapped = self.model, self.model.patterns, [], []
        bend = self.turn * np.where(self.reversed, -1.0, 1.0)[:, None, None]
        bodies = self.nodes[: given.turns.shape[1]]
        for k in range(given.count):
            strain = given.strains[k][model.owner]
            moment = np.einsum("eiab,eb->eia", model.moment_of_strain, strain)
            moment = moment.reshape(model.pieces, -1, 3)
            here = [given.forces[k], given.moves[k], given.lines[k], given.turns[k], moment,
                    given.length[k]]  # fmt: skip
            image = [np.zeros_like(each) for each in here]
            image[0][self.joints] = self.axes * given.forces[k]
            image[1][self.joints] = self.axes * given.moves[k]
            image[2][self.there] = self.axes * given.lines[k]
            image[3][bodies] = self.turn * given.turns[k]
            image[4] = self._along(bend * moment)
            image[5][self.there] = given.length[k]
            heres.append(np.concatenate([each.ravel() for each in here]))
            mapped.append(np.concatenate([each.ravel() for each in image]))
        return parameter_exchange(heres, mapped)

    @cached_property
    def matrix(self) -> Matrix:
        """Scalars (multipliers, p, 1) of the image are ``y @ matrix``.

        The forces of the image are those of the frame, moved and turned; the multipliers take
        the forces that the loads carry differently there.
        """
        model = self.model
        m, count = model.multipliers, model.scalars
        assert self.exchange is not None
        signs, order = self.exchange
        matrix = np.zeros((count, count))
        matrix[m + order, range(m, count - 1)] = signs
        matrix[-1, -1] = 1.0
        start = model.forces.members
        stop = start.copy()
        stop[model.own] -= model.patterns.lines * model.lengths[:, None]
        image = np.empty_like(start)
        image[:, self.there] = self.axes * np.where(self.reversed[:, None], -stop, start)
        here, image = start.reshape(count, -1).T, image.reshape(count, -1).T
        if m:
            wanted = image - here[:, m:] @ matrix[:, m:].T
            matrix[:, :m] = np.linalg.lstsq(here[:, :m], wanted, rcond=None)[0].T
        return matrix

    def apply(self, z: Lanes, p: Parameters) -> tuple[Lanes, Parameters]:
        """Unknowns, multipliers and parameters of the image."""
        model, m, rows = self.model, self.model.multipliers, 4 * len(self.model.free)
        scalars = np.concatenate([z[:, model.unknowns :], p, np.ones((len(z), 1))], axis=1)
        y = multiply(scalars, self.matrix)
        turns = z[:, :rows].reshape(len(z), len(model.free), 4)
        image, angles = np.empty_like(turns), np.empty_like(z[:, rows : model.unknowns])
        image[:, model.place[self.nodes[model.free]]] = turns * np.append(1.0, self.turn)
        angles[:, self._hinges_there] = self.hinges * z[:, rows : model.unknowns]
        parts = [image.reshape(len(z), rows), angles, y[:, :m]]
        return np.concatenate(parts, axis=1), np.ascontiguousarray(y[:, m:-1])
