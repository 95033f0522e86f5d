"""Masses of general rods: places of all nodes, mass matrix and forces of inertia."""

from abc import abstractmethod
from functools import lru_cache

import numpy as np

from equimorph.arrays import Float, Lanes, Nodal, Parameters, Scalars, Velocity
from equimorph.structures.equations import JointEquations
from equimorph.structures.material_points import MaterialPoints
from equimorph.structures.rod.discretisation import Mesh
from equimorph.structures.rod.mechanics import PlanarMechanics
from equimorph.structures.rod.model import RodModel
from equimorph.tolerances import METRIC_DIFFERENCE

Turns = Float[np.ndarray, "lanes nodes 2 angles"]
Pulls = Float[np.ndarray, "lanes nodes 2 multipliers"]
Places = Float[np.ndarray, "lanes places unknowns"]
RANK = 1e-10
"""Relative size below which a compliance counts as none: such supports do not give way."""


@lru_cache(maxsize=32)
def _integration(mesh: Mesh) -> Float[np.ndarray, "nodes points"]:
    """Integrals to each node of values at the nodes of every element, which may jump between."""
    elements, order = mesh.elements, mesh.degree + 1
    out = np.zeros((elements * mesh.degree + 1, elements, order))
    for e, nodes in enumerate(mesh.element_nodes):
        out[nodes, e] = mesh.lengths[e] * mesh.reference.integral
        out[nodes[-1] + 1 :, e] = mesh.element_weights[e]
    return out.reshape(len(out), -1)


def nodal_places(model: RodModel, theta: Nodal, y: Scalars) -> Float[np.ndarray, "lanes nodes 2"]:
    """Places of all nodes, by the integrals whose derivatives `place_derivatives` gives."""
    angles = theta[:, model.mesh.element_nodes.ravel()]
    sine, cosine = np.sin(angles), np.cos(angles)
    normal = (y @ model.sine) * sine + (y @ model.cosine) * cosine + y @ model.tension
    stretch, integral = 1.0 - model.softness * normal, _integration(model.mesh)
    out = np.empty((len(theta), len(model.mesh.nodes), 2))
    for axis, turned in enumerate((cosine, sine)):
        whole = integral if model.from_start[axis] else integral - integral[-1]
        out[:, :, axis] = (stretch * turned) @ whole.T + (y @ model.origin[axis])[:, None]
    return out


def place_derivatives(model: RodModel, theta: Nodal, y: Scalars) -> tuple[Turns, Pulls]:
    """Derivatives of the places of all nodes by the nodal angles, and by the multipliers."""
    mesh, m = model.mesh, model.multipliers
    at = mesh.element_nodes.ravel()
    angles = theta[:, at]
    sine, cosine = np.sin(angles), np.cos(angles)
    across, along = y @ model.sine, y @ model.cosine
    normal = across * sine + along * cosine + y @ model.tension
    stretch = 1.0 - model.softness * normal
    turned = -model.softness * (across * cosine - along * sine)
    by_angle = (turned * cosine - stretch * sine, turned * sine + stretch * cosine)
    pulled = -model.softness * (model.sine[:m] * sine[:, None] + model.cosine[:m] * cosine[:, None])
    by_force = (pulled * cosine[:, None], pulled * sine[:, None])
    spread = np.zeros((len(at), len(mesh.nodes)))
    spread[np.arange(len(at)), at] = 1.0
    angular = np.empty((len(theta), len(mesh.nodes), 2, len(mesh.nodes)))
    forced = np.empty((len(theta), len(mesh.nodes), 2, m))
    for axis in range(2):
        integral = _integration(mesh)
        if not model.from_start[axis]:
            integral = integral - integral[-1]
        angular[:, :, axis] = (integral * by_angle[axis][:, None]) @ spread
        moved = np.einsum("ij,lcj->lic", integral, by_force[axis])
        forced[:, :, axis] = moved + model.origin[axis, :m]
    return angular, forced


def following(
    gradients: Float[np.ndarray, "lanes m unknowns"], trailing: Float[np.ndarray, "lanes m m"]
) -> Float[np.ndarray, "lanes m unknowns"]:
    """Rates of the multipliers by those of the angles: ``C δθ + D δλ = 0``.

    C are the `gradients` and D the `trailing` block of F_z; only where supports or the rod give
    way, D and the rates are not zero.
    """
    return np.asarray(-np.linalg.pinv(trailing, rcond=RANK, hermitian=True) @ gradients)


def moved_places(
    angular: Turns, forced: Pulls, follow: Float[np.ndarray, "lanes m unknowns"], unknown: slice
) -> Places:
    """Derivatives of all places, one after the other, by the unknown angles."""
    moved = angular[:, :, :, unknown]
    if follow.any():
        moved = moved + np.einsum("lnac,lcu->lnau", forced, follow)
    return moved.reshape(len(moved), -1, moved.shape[3])


class GeneralInertia(JointEquations, PlanarMechanics):
    """Mechanics of a rod whose Lagrangian is a `RodModel`: how its masses move."""

    model: RodModel

    @abstractmethod
    def scalars(self, z: Lanes, p: Parameters) -> Scalars:
        """(Multipliers, parameters, 1)."""

    def nodal_places(self, z: Lanes, p: Parameters) -> Float[np.ndarray, "lanes nodes 2"]:
        """Places of all nodes by integrals from the end that holds them."""
        return nodal_places(self.model, self.nodal_angles(z, p), self.scalars(z, p))

    @property
    def sprung(self) -> MaterialPoints | None:
        """Its nodes on springs at both ends, or at one where the other end is free."""
        springs = self.model.springs_along
        points = MaterialPoints(self, self.nodal_places, self.mesh.weights, springs)
        return None if springs.follow else points

    def inertia(self, z: Lanes, p: Parameters) -> Float[np.ndarray, "lanes unknowns unknowns"]:
        """JᵀWJ of the unknown angles."""
        moved = self._moved_places(z, p, self._following(z, p))
        return np.asarray(moved.transpose(0, 2, 1) @ (self._place_weights[:, None] * moved))

    def inertial_force(self, z: Lanes, p: Parameters, velocity: Velocity) -> Velocity:
        """JᵀW D²x[u̇, u̇] of the unknown angles, by central differences of J.

        Where supports or the rod give way, the multipliers change to second order, too.
        """
        _, gradients, trailing = self.parts(z, p)
        follow = following(gradients[:, :, self.unknown_nodes], trailing)
        along = np.concatenate([velocity, np.einsum("lcu,lu->lc", follow, velocity)], axis=1)
        step = METRIC_DIFFERENCE * along
        ahead, behind = (self._moved_places(z + way, p, follow) for way in (step, -step))
        bend = np.einsum("lpu,lu->lp", ahead - behind, velocity) / (2.0 * METRIC_DIFFERENCE)
        if follow.any():
            way = along, np.zeros_like(p)
            gaps = self.second_derivative(z, p, way, way)[:, self.unknowns :]
            forced = place_derivatives(self.model, self.nodal_angles(z, p), self.scalars(z, p))[1]
            pulled = following(gaps[:, :, None], trailing)[:, :, 0]
            bend += np.einsum("lnac,lc->lna", forced, pulled).reshape(bend.shape)
        moved = self._moved_places(z, p, follow)
        return np.asarray(np.einsum("lpu,lp->lu", moved, self._place_weights * bend))

    @property
    def _place_weights(self) -> Float[np.ndarray, " places"]:
        return np.repeat(self.mesh.weights, 2)

    def _following(self, z: Lanes, p: Parameters) -> Float[np.ndarray, "lanes m unknowns"]:
        _, gradients, trailing = self.parts(z, p)
        return following(gradients[:, :, self.unknown_nodes], trailing)

    def _moved_places(
        self, z: Lanes, p: Parameters, follow: Float[np.ndarray, "lanes m unknowns"]
    ) -> Float[np.ndarray, "lanes places unknowns"]:
        columns = place_derivatives(self.model, self.nodal_angles(z, p), self.scalars(z, p))
        return moved_places(*columns, follow, self.unknown_nodes)
