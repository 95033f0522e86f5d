"""Symmetries of frames, planar or in space: mirror images and half turns about the middle.

They are proposed by geometry, and confirmed by the Lagrangian at random points.
"""

from abc import abstractmethod
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from equimorph.arrays import Bool, Float, Int, Lanes, Parameters
from equimorph.linalg.dense import multiply
from equimorph.structures.any_network import edges_of_image, images, is_symmetry, parameter_exchange
from equimorph.structures.contract import Symmetry
from equimorph.tolerances import SAME_NUMBER

NOWHERE = -1
"""In place of the number of an image, where there is none."""
Matrix = Float[np.ndarray, "scalars scalars"]
Exchange = tuple[Float[np.ndarray, " parameters"], Int[np.ndarray, " parameters"]]
Effects = list[tuple[np.ndarray, np.ndarray]]


def find_images(frame: Any, kind: "type[FrameImage]") -> tuple[Symmetry, ...]:
    """Images that leave members, supports, loads and actuators as they are, up to signs."""
    found = []
    for name, axes, joints in images(frame.model.network.places):
        there = edges_of_image(frame.model.network.ends, joints)
        if there is None:
            continue
        image = kind(frame, axes, joints, there)
        if image.possible and image.exchange and is_symmetry(frame, image.apply):
            found.append(Symmetry(name, image.apply, *image.exchange))
    return tuple(found)


@dataclass(frozen=True, eq=False)
class FrameImage:
    """What an image M = diag(±1, …) does to the pieces, nodes and scalars of a frame.

    there: the piece on which each comes to lie.
    """

    frame: Any
    axes: Float[np.ndarray, " space"]
    joints: Int[np.ndarray, " joints"]
    there: Int[np.ndarray, " pieces"]

    @property
    def model(self) -> Any:
        """Model of the frame."""
        return self.frame.model

    @cached_property
    def reversed(self) -> Bool[np.ndarray, " pieces"]:
        """Whether its start lies on the other's end."""
        ends = self.model.network.ends
        return np.asarray(ends[self.there, 0] != self.joints[ends[:, 0]])

    @cached_property
    def nodes(self) -> Int[np.ndarray, " nodes"]:
        """The node at which each comes to be; nowhere if no piece leads there."""
        rows = self.model.piece_nodes
        found = np.full(self.node_count, NOWHERE)
        for row, at, back in zip(rows, self.there, self.reversed, strict=True):
            found[row] = rows[at][::-1] if back else rows[at]
        return self.complete(found)

    def complete(self, nodes: Int[np.ndarray, " nodes"]) -> Int[np.ndarray, " nodes"]:
        """The same with nodes to which no piece leads."""
        return nodes

    @property
    @abstractmethod
    def node_count(self) -> int:
        """Number of nodes."""

    @property
    @abstractmethod
    def possible(self) -> bool:
        """Whether supports and nodes come to be at equal ones."""

    @abstractmethod
    def turning_effects(self, k: int) -> Effects:
        """What parameter k does to turns and strains, and the image of that."""

    @cached_property
    def exchange(self) -> Exchange | None:
        """Signs and order of the parameters in the image; None if the image is another frame."""
        given, heres, mapped = self.model.patterns, [], []
        for k in range(given.count):
            pairs = [
                *(
                    self.put(self.joints, self.axes * x[k], x[k])
                    for x in (given.forces, given.moves)
                ),
                self.put(self.there, self.axes * given.lines[k], given.lines[k]),
                self.put(self.there, given.length[k], given.length[k]),
                *self.turning_effects(k),
            ]
            heres.append(np.concatenate([here.ravel() for here, _ in pairs]))
            mapped.append(np.concatenate([image.ravel() for _, image in pairs]))
        return parameter_exchange(heres, mapped)

    @staticmethod
    def put(
        at: Int[np.ndarray, " n"], moved: np.ndarray, here: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Values, and the moved ones in their new places."""
        image = np.zeros_like(here)
        image[at] = moved
        return here, image

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
        start = model.starts
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
        m, scalars = self.frame.constraints, self.frame.scalars(z, p)
        y = multiply(scalars, self.matrix)
        moved = self.move(z, scalars)
        return np.concatenate([moved, y[:, :m]], axis=1), np.ascontiguousarray(y[:, m:-1])

    @abstractmethod
    def move(
        self, z: Lanes, scalars: Float[np.ndarray, "lanes scalars"]
    ) -> Float[np.ndarray, "lanes unknowns"]:
        """Unknowns of the image."""


class PlanarImage(FrameImage):
    """An image of a planar frame: a reflection reverses all turns."""

    @property
    def turn(self) -> float:
        """Sign of angles: −1 for a reflection."""
        return float(self.axes.prod())

    @property
    def node_count(self) -> int:
        """Number of nodes."""
        return len(self.model.place)

    @property
    def possible(self) -> bool:
        """Whether supports come to be at equal ones."""
        supports = self.model.network.supports
        return bool(np.array_equal(supports[self.joints], supports))

    def turning_effects(self, k: int) -> Effects:
        """Couples, turns of supports, curvatures, and pressures."""
        given = self.model.patterns
        bend = self.turn * np.where(self.reversed, -1.0, 1.0)
        strain = given.strains[k, :, 0]
        angles = (given.couples[k], given.turns[k, :, 0])
        return [
            *(self.put(self.joints, self.turn * each, each) for each in angles),
            self.put(self.there, bend * strain, strain),
            self.put(self.there, bend * given.pressures[k], given.pressures[k]),
        ]

    def move(
        self, z: Lanes, scalars: Float[np.ndarray, "lanes scalars"]
    ) -> Float[np.ndarray, "lanes unknowns"]:
        """Turns of the nodes."""
        turns = self.frame.turns(z, scalars)
        image = np.empty_like(turns)
        image[:, self.nodes] = self.turn * turns
        # places of unknown nodes are numbered in the order of the nodes
        return np.asarray(image[:, self.model.place >= 0])


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
        model, rows = self.model, 4 * len(self.model.free)
        turns = z[:, :rows].reshape(len(z), len(model.free), 4)
        image, angles = np.empty_like(turns), np.empty_like(z[:, rows : model.unknowns])
        image[:, model.place[self.nodes[model.free]]] = turns * np.append(1.0, self.turn)
        angles[:, self._hinges_there] = self.hinges * z[:, rows : model.unknowns]
        return np.concatenate([image.reshape(len(z), rows), angles], axis=1)
