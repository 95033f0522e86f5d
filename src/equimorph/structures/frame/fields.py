"""Places, turns, forces and curvatures of a frame."""

from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from equimorph.arrays import Flags, Float, Lanes, Nodal, Parameters, Scalars
from equimorph.linalg.dense import multiply
from equimorph.linalg.lanes import over_lanes
from equimorph.model import Forces, Support
from equimorph.model.drawing import supports_of_point
from equimorph.structures.frame.any_frame import AnyFrame
from equimorph.structures.frame.kernels import moments_lanes
from equimorph.structures.frame.mechanics import FrameMechanics, Points
from equimorph.structures.frame.model import FrameModel
from equimorph.structures.frame.strength import Nodal as NodalForces, NodalStrains
from equimorph.structures.material_points import SupportSpring
from equimorph.structures.rod.extrema import largest_norms

LARGEST_GAP = 1e-4
"""Radians between ψ as integrated and as solved for, under pressure."""


class FrameFields(FrameMechanics, AnyFrame):
    """A frame with the fields that descriptors and figures show, in units of its model."""

    model: FrameModel
    stations: ClassVar[int] = 9
    turn_of_unknowns: ClassVar[float] = 1.0

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
    def springs_of_joints(self) -> list[SupportSpring]:
        """Of the supports in x and in y."""
        found = []
        for axis, (_, carried) in enumerate(self._unit_loads):
            stiff = self.model.supports[:, axis]
            for j in np.flatnonzero((stiff > 0.0) & np.isfinite(stiff)):
                gaps = self._reactions[axis][j, : self.constraints]
                moves = -carried[:, j, None] * np.eye(2)[axis]
                found.append(SupportSpring(stiff[j], gaps, moves))
        return found

    @property
    def _reactions(self) -> tuple[np.ndarray, np.ndarray]:
        """Forces of the supports by scalar."""
        x, y = (forces.supports.T for forces in self.model.forces)
        return x, y

    def reactions(self, z: Lanes, p: Parameters) -> Float[np.ndarray, "lanes joints 2"]:
        """Forces of the supports on the joints."""
        y = self.scalars(z, p)
        found = np.stack([multiply(y, each.T) for each in self._reactions], axis=2)
        if self.pressure is not None:
            found += self.pressure.reactions(y, self.turns(z, y))
        return found

    def shortenings(self, z: Lanes, p: Parameters) -> Float[np.ndarray, "lanes points"]:
        """Elastic shortenings of the axis at the points of every piece."""
        own = 1.0 + self._fields(z, p)[2]
        return np.asarray(1.0 - self.stretches(z, p)[1] / own)

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
        found = np.stack(parts, axis=3)
        if self.pressure is not None:
            pressed = self.pressure.forces(y, self.turns(z, y))
            found += pressed.reshape(*found.shape[:2], -1, 2)[:, :, [0, -1]]
        return found

    def turns_of_ends(self, z: Lanes, p: Parameters) -> Float[np.ndarray, "lanes members 2"]:
        """Turns of the members' ends."""
        return self.turns(z, self.scalars(z, p))[:, self.model.piece_nodes[:, [0, -1]]]

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
        given = [np.ascontiguousarray(each) for each in (z, p)]
        pressed = np.zeros((len(z), 0))
        if self.pressure is not None:
            y, turns, _ = self._fields(z, p)
            forces = self.model.weights * self._pressed(y, turns)[1]
            pressed = np.concatenate([self.pressure.point_moments(y, turns), forces], axis=1)
        out = np.empty((len(z), self.model.nodes.size))
        if len(z):
            over_lanes(moments_lanes, self._moment_tables, [*given, pressed], [out])
        return out.reshape(len(z), *self._elements)

    @cached_property
    def _moment_tables(self) -> tuple[np.ndarray, ...]:
        """What the kernel of bending moments shares among lanes."""
        model, mesh = self.model, self.model.mesh
        arrays = (
            model.stiffness, model.natural * model.rigidity[:, None], model.weights,
            np.outer(model.lengths, mesh.lengths).ravel(), mesh.reference.integral,
            mesh.reference.nodes,
        )  # fmt: skip
        return *self.tables.of_points, *(np.ascontiguousarray(array) for array in arrays)

    def elastic(self, z: Lanes, p: Parameters) -> tuple[NodalStrains, NodalForces]:
        """Elastic curvatures about b at the nodes, nothing about other axes, and axial forces."""
        model, (y, turns, strain) = self.model, self._fields(z, p)
        forces = self._pulls(y, self._turned(turns), strain).tension / model.weights
        if self.pressure is not None:
            forces += self._pressed(y, turns)[0]
        bends = np.zeros((len(z), *model.nodes.shape, 3))
        elastic = self._moments(z, p) / model.rigidity[:, None, None]
        bends[..., 2] = elastic.reshape(bends.shape[:3])
        return bends, np.asarray(forces.reshape(bends.shape[:3]))

    def _pressed(self, y: Scalars, turns: Nodal) -> tuple[Points, Points]:
        """What pressures add to the forces along and across the members at their points."""
        assert self.pressure is not None
        x, up = np.moveaxis(self.pressure.forces(y, turns), 2, 0)
        angles = self.model.directions + turns[:, self.model.nodes.ravel()]
        cosine, sine = np.cos(angles), np.sin(angles)
        return x * cosine + up * sine, up * cosine - x * sine

    @property
    def _elements(self) -> tuple[int, int, int]:
        """Members, elements of each, and nodes of these."""
        mesh = self.model.mesh
        return len(self.model.lengths), mesh.elements, mesh.degree + 1

    def largest_curvatures(self, z: Lanes, p: Parameters) -> Float[np.ndarray, "lanes members"]:
        """max |κ| in every member."""
        found = self.curvatures(z, p)
        elements = len(self.model.nodes), found.shape[-1]
        largest = largest_norms(self.model.mesh, found.reshape(len(z), *elements, 1))
        return np.asarray(largest.reshape(found.shape[:3]).max(axis=2))

    def stretched_tangents(
        self, z: Lanes, p: Parameters
    ) -> Float[np.ndarray, "lanes members elements order 2"]:
        """Derivatives of the places by arclength as drawn."""
        psi, stretch = self.stretches(z, p)
        angles = self.model.directions + psi
        field = stretch[..., None] * np.stack([np.cos(angles), np.sin(angles)], axis=2)
        return np.asarray(field.reshape(len(z), *self._elements, 2))

    # --- soundness and supports -----------------------------------------------------------------

    def resolved(self, z: Lanes, p: Parameters) -> Flags:
        """Whether ψ is smooth in every element, and under pressure meets what its moments say.

        High pressure amplifies errors inside long elements before ψ shows any; see
        `GeneralMechanics.resolved`.
        """
        good = super().resolved(z, p)
        if self.pressure is None:
            return good
        model, y = self.model, self.scalars(z, p)
        elastic = self._moments(z, p) / model.rigidity[:, None, None]
        bends = elastic + multiply(y, model.natural.T)[:, :, None, None]
        psi = self.turns(z, y)[:, model.nodes].reshape(bends.shape)
        lengths = np.outer(model.lengths, model.mesh.lengths)[:, :, None]
        turned = np.einsum("ij,lmej->lmei", model.mesh.reference.integral, bends) * lengths
        gaps = np.abs(turned - (psi - psi[..., :1])).max(axis=(1, 2, 3))
        return np.asarray(good & (gaps < LARGEST_GAP))

    def moved_by(self, turns: Float[np.ndarray, " rows"]) -> Float[np.ndarray, " unknowns"]:
        """The turns themselves."""
        return turns

    def circulating(
        self, forces: Float[np.ndarray, " multipliers"]
    ) -> Float[np.ndarray, "members 2"]:
        """Forces in the members without loads."""
        starts = [each.start[: self.constraints] for each in self.model.forces]
        return np.stack([forces @ each for each in starts], axis=1)

    def guess_for(self, finer: Any, z: Lanes, p: Parameters) -> Float[np.ndarray, "lanes finer"]:
        """States as guesses of those of the same frame with other elements."""
        model, fine = self.model, finer.model
        matrix = model.mesh.interpolation(fine.mesh.nodes)
        turns = self.turns(z, self.scalars(z, p))[:, model.piece_nodes] @ matrix.T
        nodes = np.zeros((len(z), len(fine.place)))
        nodes[:, fine.piece_nodes] = turns
        return np.concatenate([nodes[:, fine.place >= 0], z[:, self.unknowns :]], axis=1)

    def drawn_supports(
        self, z: Lanes, p: Parameters, places: Float[np.ndarray, "lanes joints 2"]
    ) -> tuple[Support, ...]:
        """Symbols of the supports, at places of the joints; they turn with these."""
        nodes = self.model.joint_nodes
        turns = np.where(nodes >= 0, self.turns(z, self.scalars(z, p))[:, nodes], 0.0)
        found: list[Support] = []
        for joint, stiffness in enumerate(self.model.network.supports):
            if stiffness.any():
                angles = turns[:, joint] + self._inward_angle(joint)
                inward = np.stack([np.cos(angles), np.sin(angles)], axis=1)
                held = np.eye(2), stiffness[:2]
                found += supports_of_point(*held, float(stiffness[2]), places[:, joint], inward)
        return tuple(found)

    def drawn_pressures(self, z: Lanes, p: Parameters) -> list[Forces]:
        """Force per length of each pressure, normal to its members wherever they turn."""
        model, stations, found = self.model, np.linspace(0.0, 1.0, self.stations), []
        if self.pressure is None:
            return []
        matrix = model.mesh.interpolation(stations)
        y, along = self.scalars(z, p), model.length * self.outline(z, p, stations)
        nodes = self.turns(z, y)[:, model.piece_nodes]
        drawn = model.directions.reshape(len(model.lengths), -1)[:, [0, -1]]
        angles = nodes @ matrix.T + drawn[:, :1] + np.diff(drawn, axis=1) * stations
        normals = np.stack([-np.sin(angles), np.cos(angles)], axis=3)
        for chain in self.pressure.chains:
            size = chain.pull(y)[:, :, None, None] * chain.signs[:, None, None]
            vectors = size * normals[:, chain.pieces] * (model.force / model.length)
            pairs = zip(
                np.moveaxis(along[:, chain.pieces], 1, 0), np.moveaxis(vectors, 1, 0), strict=True
            )
            found += [Forces(*each, distributed=True) for each in pairs]
        return found

    def _inward_angle(self, joint: int) -> float:
        """Mean direction from a joint into its members, as drawn."""
        model = self.model
        tangents = model.tangents.reshape(len(model.lengths), -1, 2)
        total = np.zeros(2)
        for (start, end), tangent in zip(model.network.ends, tangents, strict=True):
            total += tangent[0] * (start == joint) - tangent[-1] * (end == joint)
        return float(np.arctan2(total[1], total[0]))
