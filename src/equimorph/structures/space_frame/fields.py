"""Places, rotations, forces and curvatures of a frame in space."""

from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from equimorph.arrays import Float, Lanes, Parameters
from equimorph.linalg.lanes import over_lanes
from equimorph.model import Support
from equimorph.model.drawing import supports_of_point
from equimorph.structures.frame.any_frame import AnyFrame
from equimorph.structures.frame.statics import SpaceFlows
from equimorph.structures.frame.strength import Nodal, NodalStrains
from equimorph.structures.material_points import SupportSpring
from equimorph.structures.rod.extrema import largest_norms
from equimorph.structures.space_frame.model import SpatialFrameModel
from equimorph.structures.space_frame.moment_kernels import moments_lanes
from equimorph.structures.space_frame.network import SpatialNetwork, Turning
from equimorph.structures.space_frame.orbits import OrbitFrameMechanics
from equimorph.structures.spatial.mechanics import pairs_of
from equimorph.structures.spatial.quaternions import (
    exponential,
    gather,
    matrices,
    rotation_vectors,
)


def spatial_symbols(
    made: SpatialNetwork, places: Float[np.ndarray, "lanes joints 3"]
) -> tuple[Support, ...]:
    """Symbols of the supports, at places of the joints."""
    found: list[Support] = []
    for joint, support in enumerate(made.supports):
        if support.data:
            here, turning = places[:, joint], np.inf if support.holds_rotation else 0.0
            inward = np.broadcast_to(_inward(made, joint), here.shape)
            held = support.directions, support.stiffness
            found += supports_of_point(*held, turning, here, inward)
    return tuple(found)


def _inward(made: SpatialNetwork, joint: int) -> Float[np.ndarray, "3"]:
    """Mean direction from a joint into its members, as drawn."""
    total = np.zeros(3)
    for (start, end), chord in zip(made.ends, made.chords, strict=True):
        unit = chord / np.linalg.norm(chord)
        total += unit * (start == joint) - unit * (end == joint)
    size = float(np.linalg.norm(total))
    return total / size if size > 1e-9 else np.array([1.0, 0.0, 0.0])


Vectors = Float[np.ndarray, "lanes elements order 3"]


class SpatialFrameFields(OrbitFrameMechanics, AnyFrame):
    """A frame in space with the fields that descriptors and figures show, in units of its model."""

    model: SpatialFrameModel
    stations: ClassVar[int] = 3
    turn_of_unknowns: ClassVar[float] = 2.0

    # --- joints ---------------------------------------------------------------------------------

    @cached_property
    def _unit_loads(self) -> SpaceFlows:
        """Forces for a load of size 1 on each joint along x, y and z."""
        joints = len(self.model.network.joints)
        loads = np.zeros((3 * joints, joints, 3))
        loads[np.arange(3 * joints), np.arange(3 * joints) // 3, np.arange(3 * joints) % 3] = 1.0
        return self.model.carrying_forces(loads)

    @cached_property
    def _drawn_chords(self) -> Float[np.ndarray, "pieces 3"]:
        """Vectors from start to end of the pieces as drawn, by the quadrature of the model."""
        pull = (self.model.weights[..., None] * self.model.tangents).sum(axis=1)
        return gather(pull, self.model.owner, self.model.pieces)

    def displacements(self, z: Lanes, p: Parameters) -> Float[np.ndarray, "lanes joints 3"]:
        """Moves of the joints: what a load of size 1 on each would travel."""
        model = self.model
        _, w, _, y = self.jets(z, p)
        chords = gather(self.chords(w, y)[0].sum(axis=2), model.owner, model.pieces)
        flow, supports = self._unit_loads
        moves = np.einsum("fka,lka->lf", flow, chords - self._drawn_chords)
        given = np.einsum("ls,sja->lja", y[0], model.moved)
        given -= np.einsum("jab,ljb->lja", model.yielding, self.reactions(z, p))
        moves -= np.einsum("fja,lja->lf", supports, given)
        return np.asarray(moves.reshape(len(z), len(model.network.joints), 3))

    @property
    def springs_of_joints(self) -> list[SupportSpring]:
        """Of the supports along their directions."""
        model, found = self.model, []
        carried, cube = self._unit_loads.supports, model.length**3 / model.bending
        for j, support in enumerate(model.network.supports):
            for unit, stiff in zip(support.directions, support.stiffness, strict=True):
                if np.isfinite(stiff):
                    gaps = model.forces.supports[: self.constraints, j] @ unit
                    moves = -(carried[:, j] @ unit).reshape(-1, 3)
                    found.append(SupportSpring(stiff * cube, gaps, moves))
        return found

    def reactions(self, z: Lanes, p: Parameters) -> Float[np.ndarray, "lanes joints 3"]:
        """Forces of the supports on the joints."""
        return np.asarray(np.einsum("ls,sja->lja", self.scalars(z, p), self.model.forces.supports))

    def shortenings(self, z: Lanes, p: Parameters) -> Float[np.ndarray, "lanes points"]:
        """Elastic shortenings of the axis at the points of every piece."""
        _, w, _, y = self.jets(z, p)
        own = 1.0 + self.actuated_strains(y)[1][0][:, self.model.owner, None]
        shorter = 1.0 - self.tensions(w, y)[2][0] / own
        return np.asarray(shorter.reshape(len(z), self.model.nodes.size))

    def couples(self, z: Lanes, p: Parameters) -> Float[np.ndarray, "lanes joints 3"]:
        """Couples of the supports on the joints; 0 where rotations are free."""
        made, found = self.model.network, self.body_couples(z, p)
        out = np.zeros((len(z), len(made.joints), 3))
        for k, body in enumerate(made.bodies):
            if body.turning is Turning.HELD:
                out[:, body.joint] = found[:, k]
        return out

    def turns_of_joints(self, z: Lanes, p: Parameters) -> Float[np.ndarray, "lanes joints 3"]:
        """Rotation vectors of the joints; 0 where all members are hinged."""
        bodies = self.model.network.body_of_joint
        found = rotation_vectors(self.turns(z, p)[:, bodies])
        return np.where(bodies[:, None] >= 0, found, 0.0)

    def turns_of_ends(self, z: Lanes, p: Parameters) -> Float[np.ndarray, "lanes pieces 2 3"]:
        """Rotation vectors of the ends of the pieces."""
        ends = self.model.piece_nodes[:, [0, -1]]
        return rotation_vectors(self.turns(z, p)[:, ends])

    # --- along the members ----------------------------------------------------------------------

    def cross_sections(self, z: Lanes, p: Parameters) -> Float[np.ndarray, "lanes e n 3 3"]:
        """Axes t, n, b at the points, in the columns."""
        turned = matrices(self.turns(z, p)[:, self.model.nodes])
        return np.asarray(np.einsum("leiab,eibc->leiac", turned, self.model.drawn))

    def end_forces(self, z: Lanes, p: Parameters) -> Float[np.ndarray, "lanes pieces 2 3"]:
        """Forces in the cross-sections at start and end, of what lies beyond, toward the end."""
        y = self.jets(z, p)[3]
        found = self.forces(y)[0].reshape(len(z), *self._elements, 3)
        return np.stack([found[:, :, 0, 0], found[:, :, -1, -1]], axis=2)

    @property
    def _elements(self) -> tuple[int, int, int]:
        """Pieces, elements of each, and nodes of these."""
        mesh = self.model.mesh
        return self.model.pieces, mesh.elements, mesh.degree + 1

    def moments(self, z: Lanes, p: Parameters) -> Vectors:
        """Moments (x, y, z) in the cross-sections at the points, from the balance of each element.

        Ends of elements carry what the element's gradient says; inside ``m' = f × r'`` is
        integrated, and the remaining difference is distributed in proportion.
        """
        sections = self.cross_sections(z, p)
        return np.asarray(np.einsum("leica,leia->leic", sections, self.section_moments(z, p)))

    def section_moments(self, z: Lanes, p: Parameters) -> Vectors:
        """Moments on the axes t, n, b of the cross-sections at the points."""
        self.scalars(z, p)
        out = np.empty((len(z), 3 * self.model.nodes.size))
        given = [np.ascontiguousarray(each) for each in (z, p)]
        over_lanes(moments_lanes, (*pairs_of(1), *self.tables.of_moments), given, [out])
        return out.reshape(len(z), *self.model.nodes.shape, 3)

    def elastic_strains(self, z: Lanes, p: Parameters) -> Vectors:
        """Elastic twist and curvatures about n and b at the points, per length as drawn."""
        model = self.model
        return np.asarray(self.section_moments(z, p) / model.rigidity[model.owner][:, None])

    def elastic(self, z: Lanes, p: Parameters) -> tuple[NodalStrains, Nodal]:
        """Elastic twist and curvatures about n and b at the nodes, and axial forces."""
        _, w, _, y = self.jets(z, p)
        return self.elastic_strains(z, p), self.tensions(w, y)[1][0]

    def section_strains(self, z: Lanes, p: Parameters) -> Vectors:
        """Twist and curvatures about n and b at the points, per length as drawn."""
        model = self.model
        elastic = self.elastic_strains(z, p)
        own = self.scalars(z, p)[None]
        free = self.actuated_strains(own)[0][0][:, model.owner]
        bends = np.array([float(each.curvature) for each in model.network.members]) * model.length
        drawn = bends[model.network.owner][model.owner][:, None] * np.array([0.0, 0.0, 1.0])
        return np.asarray(elastic + (free + drawn)[:, :, None])

    def largest_curvatures(self, z: Lanes, p: Parameters) -> Float[np.ndarray, "lanes pieces"]:
        """Largest bending curvature √(κ_n² + κ_b²) in every piece."""
        largest = largest_norms(self.model.mesh, self.section_strains(z, p)[..., 1:])
        return np.asarray(largest.reshape(len(z), *self._elements[:2]).max(axis=2))

    def stretched_tangents(
        self, z: Lanes, p: Parameters
    ) -> Float[np.ndarray, "lanes pieces elements order 3"]:
        """Derivatives of the places by arclength as drawn."""
        _, w, _, y = self.jets(z, p)
        field = self.chords(w, y)[0] / self.model.weights[..., None]
        return np.asarray(field.reshape(len(z), *self._elements, 3))

    def axes_along(
        self, z: Lanes, p: Parameters, s: Float[np.ndarray, " points"]
    ) -> Float[np.ndarray, "lanes pieces points 3 3"]:
        """Axes t, n, b of the cross-sections, in the columns, at shares of the pieces' lengths."""
        model = self.model
        w = np.einsum(
            "ij,lkja->lkia", model.mesh.interpolation(s), self.turns(z, p)[:, model.piece_nodes]
        )
        w = w / np.linalg.norm(w, axis=-1, keepdims=True)
        bends = [float(each.curvature) * model.length for each in model.network.members]
        turn = np.outer(np.array(bends)[model.network.owner] * model.lengths, s - 0.5)
        about = matrices(exponential(turn[..., None] * np.array([0.0, 0.0, 1.0])))
        drawn = np.einsum("kab,kibc->kiac", model.network.axes, about)
        return np.asarray(np.einsum("lkiab,kibc->lkiac", matrices(w), drawn))

    # --- soundness and supports -----------------------------------------------------------------

    def moved_by(self, turns: Float[np.ndarray, " rows"]) -> Float[np.ndarray, " unknowns"]:
        """Quaternions turned by half of the rotation vectors; angles of hinges."""
        free = len(self.model.free)
        quaternions = np.zeros((free, 4))
        quaternions[:, 1:] = 0.5 * turns[: 3 * free].reshape(free, 3)
        return np.concatenate([quaternions.ravel(), turns[3 * free :]])

    def circulating(
        self, forces: Float[np.ndarray, " multipliers"]
    ) -> Float[np.ndarray, "pieces 3"]:
        """Forces in the pieces without loads."""
        starts = self.model.forces.members[: self.constraints]
        return np.asarray(np.einsum("s,ska->ka", forces, starts))

    def guess_for(self, finer: Any, z: Lanes, p: Parameters) -> Float[np.ndarray, "lanes finer"]:
        """States as guesses of those of the same frame with other elements."""
        model, fine = self.model, finer.model
        matrix = model.mesh.interpolation(fine.mesh.nodes)
        turns, bodies = self.turns(z, p), len(model.network.bodies)
        nodes = np.zeros((len(z), len(fine.turning), 4))
        nodes[:, :bodies] = turns[:, :bodies]
        along = np.einsum("ij,lkja->lkia", matrix, turns[:, model.piece_nodes])
        along /= np.linalg.norm(along, axis=-1, keepdims=True)
        nodes[:, fine.piece_nodes[:, 1:-1]] = along[:, :, 1:-1]
        q = nodes[:, fine.free].reshape(len(z), 4 * len(fine.free))
        return np.concatenate([q, z[:, 4 * len(model.free) :]], axis=1)

    def drawn_supports(
        self, z: Lanes, p: Parameters, places: Float[np.ndarray, "lanes joints 3"]
    ) -> tuple[Support, ...]:
        """Symbols of the supports, at places of the joints."""
        return spatial_symbols(self.model.network, places)
