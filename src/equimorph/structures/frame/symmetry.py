"""Symmetries of frames: mirror images and half turns."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from equimorph.array_types import Bool, Float, Int
from equimorph.arrays import Lanes, Parameters
from equimorph.linalg.dense import multiply
from equimorph.structures.contract import Symmetry
from equimorph.structures.frame.mechanics import FrameMechanics
from equimorph.structures.images import edges_of_image, images, is_symmetry, parameter_exchange

Matrix = Float[np.ndarray, "scalars scalars"]


def symmetries(frame: FrameMechanics) -> tuple[Symmetry, ...]:
    """Mirror images that leave members, supports, loads and actuators as they are, up to signs."""
    found = []
    for name, axes, joints in images(frame.model.network.places):
        image = _Image(frame, axes, joints)
        if not image.possible or image.exchange is None:
            continue
        if is_symmetry(frame, image.apply):
            found.append(Symmetry(name, image.apply, *image.exchange))
    return tuple(found)


@dataclass(frozen=True, eq=False)
class _Image:
    """What an image does to the members, nodes and scalars of a frame."""

    frame: FrameMechanics
    axes: Float[np.ndarray, "2"]
    joints: Int[np.ndarray, " joints"]

    @property
    def turn(self) -> float:
        """Sign of angles: −1 for a reflection."""
        return float(self.axes.prod())

    @cached_property
    def _there(self) -> Int[np.ndarray, " members"] | None:
        return edges_of_image(self.frame.model.network.ends, self.joints)

    @property
    def possible(self) -> bool:
        """Whether members come to lie on members, and supports on equal ones."""
        supports = self.frame.model.network.supports
        return self._there is not None and np.array_equal(supports[self.joints], supports)

    @property
    def there(self) -> Int[np.ndarray, " members"]:
        """The member on which each comes to lie."""
        assert self._there is not None
        return self._there

    @cached_property
    def reversed(self) -> Bool[np.ndarray, " members"]:
        """Whether its start lies on the other's end."""
        ends = self.frame.model.network.ends
        return np.asarray(ends[self.there, 0] != self.joints[ends[:, 0]])

    @cached_property
    def exchange(
        self,
    ) -> tuple[Float[np.ndarray, " parameters"], Int[np.ndarray, " parameters"]] | None:
        """Signs and order of the parameters in the image; None if the image is another frame."""
        given, heres, mapped = self.frame.model.patterns, [], []
        bend = self.turn * np.where(self.reversed, -1.0, 1.0)
        for k in range(given.count):
            vectors = (given.forces[k], given.moves[k])
            angles = (given.couples[k], given.turns[k, :, 0])
            here = [*vectors, *angles, given.lines[k], given.strains[k, :, 0], given.length[k]]
            image = [np.zeros_like(each) for each in here]
            for i, each in enumerate(vectors):
                image[i][self.joints] = self.axes * each
            for i, each in enumerate(angles, 2):
                image[i][self.joints] = self.turn * each
            image[4][self.there] = self.axes * given.lines[k]
            image[5][self.there] = bend * given.strains[k, :, 0]
            image[6][self.there] = given.length[k]
            heres.append(np.concatenate([each.ravel() for each in here]))
            mapped.append(np.concatenate([each.ravel() for each in image]))
        return parameter_exchange(heres, mapped)

    @cached_property
    def nodes(self) -> Int[np.ndarray, " nodes"]:
        """The node at which each comes to be."""
        rows = self.frame.model.member_nodes
        found = np.zeros(len(self.frame.model.place), int)
        for row, at, back in zip(rows, self.there, self.reversed, strict=True):
            found[row] = rows[at][::-1] if back else rows[at]
        return found

    @cached_property
    def matrix(self) -> Matrix:
        """Scalars (multipliers, p, 1) of the image are ``y @ matrix``.

        The forces of the image are those of the frame, moved and turned; the multipliers take
        the forces that the loads carry differently there.
        """
        model, (nx, ny) = self.frame.model, self.axes
        m, count = model.multipliers, model.scalars
        members, points = len(model.lengths), len(model.owner) // len(model.lengths)
        assert self.exchange is not None
        signs, order = self.exchange
        matrix, parts = np.zeros((count, count)), []
        matrix[m + order, range(m, count - 1)] = signs
        matrix[-1, -1] = 1.0
        for sign, forces in ((nx, model.forces[0]), (ny, model.forces[1])):
            here = model.points_of(forces).reshape(members, points, count)
            image = np.zeros_like(here)
            for at, back, rows in zip(self.there, self.reversed, here, strict=True):
                image[at] = -sign * rows[::-1] if back else sign * rows
            parts.append((here.reshape(-1, count), image.reshape(-1, count)))
        here, image = (np.concatenate([part[i] for part in parts]) for i in (0, 1))
        wanted = image - here[:, m:] @ matrix[:, m:].T
        if m:
            matrix[:, :m] = np.linalg.lstsq(here[:, :m], wanted, rcond=None)[0].T
        return matrix

    def apply(self, z: Lanes, p: Parameters) -> tuple[Lanes, Parameters]:
        """Unknowns, multipliers and parameters of the image."""
        frame, m = self.frame, self.frame.constraints
        scalars = frame.scalars(z, p)
        turns, y = frame.turns(z, scalars), multiply(scalars, self.matrix)
        image = np.empty_like(turns)
        image[:, self.nodes] = self.turn * turns
        # places of unknown nodes are numbered in the order of the nodes
        unknown = image[:, frame.model.place >= 0]
        return np.concatenate([unknown, y[:, :m]], axis=1), np.ascontiguousarray(y[:, m:-1])
