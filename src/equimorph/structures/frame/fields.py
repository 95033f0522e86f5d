"""Places, turns, forces and curvatures of a frame."""

from functools import cached_property

import numpy as np
from jaxtyping import Float
from numpy.polynomial import legendre

from equimorph.arrays import Lanes, Parameters
from equimorph.linalg.dense import multiply
from equimorph.structures.frame.mechanics import FrameMechanics

FINE = 21
"""Places in each element among which an extremum of the curvature is sought."""
POLISHING = 5
"""Newton iterations from there."""


class FrameFields(FrameMechanics):
    """A frame with the fields that descriptors and figures show, in units of its model."""

    def displacements(self, z: Lanes, p: Parameters) -> Float[np.ndarray, "lanes joints 2"]:
        """Moves of the joints: what a load of size 1 on each would travel."""
        psi, stretch = self.stretches(z, p)
        y, parts = self.scalars(z, p), []
        for axis in (0, 1):
            flow, supports = self._unit_loads[axis]
            turned = np.cos(psi) * self.model.tangents[:, axis]
            across = (-1.0 if axis == 0 else 1.0) * self.model.tangents[:, 1 - axis]
            turned = turned + np.sin(psi) * across
            change = self.model.weights * (stretch * turned - self.model.tangents[:, axis])
            stiff = self.model.supports[:, axis]
            give = np.where(stiff > 0.0, 1.0 / np.maximum(stiff, 1e-300), 0.0)
            held = multiply(y, (self.model.moved[axis] - give[:, None] * self._reactions[axis]).T)
            parts.append(multiply(change, flow.T) - multiply(held, supports.T))
        return np.stack(parts, axis=2)

    @cached_property
    def _unit_loads(self) -> tuple[tuple[np.ndarray, np.ndarray], ...]:
        """Force at the points and of the supports for a load of size 1 on each joint."""
        joints = len(self.model.network.joints)
        found = [graph.carrying_forces(np.eye(joints)) for graph in self.model.graphs]
        return tuple((each.members[:, self.model.owner], each.supports) for each in found)

    @property
    def _reactions(self) -> tuple[np.ndarray, np.ndarray]:
        """Forces of the supports by scalar."""
        x, y = (forces.supports.T for forces in self.model.forces)
        return x, y

    def reactions(self, z: Lanes, p: Parameters) -> Float[np.ndarray, "lanes joints 2"]:
        """Forces of the supports on the joints."""
        y = self.scalars(z, p)
        return np.stack([multiply(y, each.T) for each in self._reactions], axis=2)

    def couples(self, z: Lanes, p: Parameters) -> Float[np.ndarray, "lanes joints"]:
        """Couples of the supports on the joints."""
        model, y = self.model, self.scalars(z, p)
        turns, moments = self.turns(z, y), self.nodal_moments(z, p)
        sprung = -model.springs * (turns - multiply(y, model.turned.T))
        found = np.where(model.place >= 0, sprung, moments)
        return np.where(model.joint_nodes >= 0, found[:, model.joint_nodes], 0.0)

    def end_forces(self, z: Lanes, p: Parameters) -> Float[np.ndarray, "lanes members 2 2"]:
        """Forces (x, y) in the cross-sections at start and end: of what lies beyond, toward end."""
        y, parts = self.scalars(z, p), []
        for forces in self.model.forces:
            start, drop = multiply(y, forces.start), multiply(y, forces.drop)
            parts.append(np.stack([start, start - drop * self.model.lengths], axis=2))
        return np.stack(parts, axis=3)

    def turns_of_ends(self, z: Lanes, p: Parameters) -> Float[np.ndarray, "lanes members 2"]:
        """Turns of the members' ends."""
        return self.turns(z, self.scalars(z, p))[:, self.model.member_nodes[:, [0, -1]]]

    def end_moments(self, z: Lanes, p: Parameters) -> Float[np.ndarray, "lanes members 2"]:
        """Bending moments at start and end, positive where the member bends to its left."""
        moments = self._moments(z, p)
        return np.stack([moments[:, :, 0, 0], moments[:, :, -1, -1]], axis=2)

    def curvatures(self, z: Lanes, p: Parameters) -> Float[np.ndarray, "lanes members e n"]:
        """Curvature at the nodes of every element, recovered from moments.

        It counts per length as the member is drawn, which an elastic or actuated strain leaves out.
        """
        model, y = self.model, self.scalars(z, p)
        bends = np.array([float(each.curvature) for each in model.network.members]) * model.length
        actuated = multiply(y, model.natural.T) + bends
        elastic = self._moments(z, p) / model.rigidity[:, None, None]
        return np.asarray(elastic + actuated[:, :, None, None])

    def _moments(self, z: Lanes, p: Parameters) -> Float[np.ndarray, "lanes members e n"]:
        """M at the nodes of every element, from the balance of each element.

        Ends of elements carry what the element's nodal forces say; inside ``M' = (1 + e) (f × t)``
        is integrated from both ends, and the remaining difference is distributed in proportion.
        """
        model, (y, turns, strain) = self.model, self._fields(z, p)
        psi = turns[:, model.nodes.ravel()]
        pulls = self._pulls(y, psi, strain)
        stretch = 1.0 + strain + model.softness * pulls.tension
        shear = (stretch * pulls.shear).reshape(len(z), *model.nodes.shape)
        local = np.einsum("eij,lej->lei", model.stiffness, turns[:, model.nodes]) - shear
        actuated = multiply(y, model.natural.T) * model.rigidity
        extra = np.repeat(actuated, model.mesh.elements, axis=1)
        first, last = -local[:, :, 0] - extra, local[:, :, -1] - extra
        density = shear / model.weights.reshape(model.nodes.shape)
        lengths = np.outer(model.lengths, model.mesh.lengths).ravel()[:, None]
        change = -np.einsum("ij,lej->lei", model.mesh.reference.integral, density) * lengths
        gap = last - first - change[:, :, -1]
        inside = first[:, :, None] + change + gap[:, :, None] * model.mesh.reference.nodes
        return np.asarray(inside.reshape(len(z), *self._elements))

    @property
    def _elements(self) -> tuple[int, int, int]:
        """Members, elements of each, and nodes of these."""
        mesh = self.model.mesh
        return len(self.model.lengths), mesh.elements, mesh.degree + 1

    def largest_curvatures(self, z: Lanes, p: Parameters) -> Float[np.ndarray, "lanes members"]:
        """max |κ| in every member: the largest value on a fine grid, polished in each element."""
        to_legendre, degree = self.model.mesh.reference.to_legendre, self.model.mesh.degree
        grid = np.linspace(-1.0, 1.0, FINE)
        series = np.einsum("ij,lmej->lmei", to_legendre, self.curvatures(z, p))
        values = np.abs(np.einsum("ij,lmej->lmei", legendre.legvander(grid, degree), series))
        start = grid[values.argmax(axis=3)]
        slope = np.pad(legendre.legder(np.eye(degree + 1)), ((0, 1), (0, 0)))
        first = np.einsum("ij,lmej->lmei", slope, series)
        second = np.einsum("ij,lmej->lmei", slope, first)
        place, step = start, grid[1] - grid[0]
        for _ in range(POLISHING):
            basis = legendre.legvander(place, degree)
            bend = (basis * second).sum(axis=3)
            move = (basis * first).sum(axis=3) / np.where(bend == 0.0, np.inf, bend)
            place = np.clip(
                place - move, np.maximum(start - step, -1.0), np.minimum(start + step, 1.0)
            )
        polished = np.abs((legendre.legvander(place, degree) * series).sum(axis=3))
        return np.asarray(np.maximum(polished, values.max(axis=3)).max(axis=2))

    def outline(
        self, z: Lanes, p: Parameters, s: Float[np.ndarray, " points"]
    ) -> Float[np.ndarray, "lanes members points 2"]:
        """Places along the members at shares of their lengths, moves of the joints included."""
        model, (psi, stretch) = self.model, self.stretches(z, p)
        matrix = model.mesh.integration(s)[:, : model.mesh.elements * model.mesh.degree + 1]
        shape = (len(z), *self._elements)
        angles = (model.directions + psi).reshape(shape)
        longer = stretch.reshape(shape)
        count = model.mesh.elements * model.mesh.degree
        parts = []
        starts = (model.network.places[None] / model.length + self.displacements(z, p))[
            :, model.network.ends[:, 0]
        ]
        for axis, function in enumerate((np.cos, np.sin)):
            field = longer * function(angles)
            whole = np.concatenate(
                [field[..., :-1].reshape(*shape[:2], count), field[:, :, -1, -1:]], axis=2
            )
            moved = np.einsum("ij,lmj->lmi", matrix, whole) * model.lengths[:, None]
            parts.append(starts[:, :, None, axis] + moved)
        return np.stack(parts, axis=3)
