"""Fields of rods of any kind, recovered to the accuracy that they have at the ends of elements."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.polynomial import legendre

from equimorph.arrays import Float, Scalars, Values
from equimorph.linalg.lanes import over_lanes
from equimorph.structures.rod import general_field_kernels
from equimorph.structures.rod.discretisation import Reference, reference_element
from equimorph.structures.rod.general_field_kernels import KAPPA, THETA, X, Y
from equimorph.structures.rod.model import RodModel
from equimorph.structures.rod.pressure import EnclosedArea, coupling

Angles = Float[np.ndarray, "lanes nodes"]

NEAR = 0.84
"""Share of the largest nodal curvature from which on a peak may be the largest one."""
REFINING = 4
"""Newton steps from the largest nodal curvature to the extremum of its polynomial."""


@dataclass(frozen=True, eq=False)
class GeneralFields:
    """θ, κ, x, y anywhere on a rod, as accurate as at the ends of its elements.

    The moment at an element's end follows from the element's balance and is superconvergent, as
    the angle there is [DouglasDupont1974]_; inside, the rod's equations are integrated from these.
    """

    model: RodModel

    @cached_property
    def reference(self) -> Reference:
        """The finer rule."""
        return reference_element(self.model.fine.along.shape[2] - 1)

    @cached_property
    def _shared(self) -> tuple[np.ndarray, ...]:
        model, fine = self.model, self.model.fine
        coarse = model.mesh.reference
        spread = legendre.legvander(2.0 * self.reference.nodes - 1.0, coarse.degree)
        rows = (fine.across, fine.along, fine.bending, fine.tension)
        area = EnclosedArea.of_rod(model.mesh, model.closing)
        pressed = coupling(model.mesh, model.closing).inside[:, 0]
        if not model.pressure.any():
            pressed = np.zeros((0, 0))
        return (
            model.bending_stiffness,
            model.element_slope,
            model.mesh.element_weights,
            model.nodal.softness,
            model.nodal.along,
            model.nodal.across,
            model.nodal.tension,
            fine.along,
            fine.across,
            fine.bending,
            fine.tension,
            1.0 / fine.rigidity,
            fine.softness,
            *(np.flatnonzero(a.any(axis=(1, 2))) for a in rows),
            spread @ coarse.to_legendre,
            self.reference.integral,
            model.mesh.lengths,
            model.pressure,
            np.ascontiguousarray(pressed),
            area.pole,
        )

    def everywhere(
        self, angles: Angles, scalars: Scalars
    ) -> Float[np.ndarray, "lanes elements 5 fine"]:
        """θ, κ, x, y and the moment at the nodes of the finer rule in every element."""
        shape = (len(angles), self.model.mesh.elements, 5, len(self.reference.nodes))
        flat = np.empty((len(angles), int(np.prod(shape[1:]))))
        if len(angles):
            given = [np.ascontiguousarray(angles), np.ascontiguousarray(scalars)]
            over_lanes(general_field_kernels.fields_lanes, self._shared, given, [flat])
        out = flat.reshape(shape)
        for axis, row in enumerate((X, Y)):
            place = np.einsum("j,lj->l", self.model.origin[axis], scalars)
            if not self.model.from_start[axis]:
                place = place - out[:, -1, row, -1]
            out[:, :, row] += place[:, None, None]
        return out

    def at(
        self, angles: Angles, scalars: Scalars, s: Float[np.ndarray, " points"]
    ) -> Float[np.ndarray, "lanes points 4"]:
        """(θ, κ, x, y) at arclengths."""
        element, t = self.model.mesh.locate(s)
        basis = legendre.legvander(2.0 * t - 1.0, self.reference.degree)
        weights = basis @ self.reference.to_legendre
        there = self.everywhere(angles, scalars)[:, element][:, :, [THETA, KAPPA, X, Y]]
        return np.asarray(np.einsum("lpfi,pi->lpf", there, weights))

    def gap(self, angles: Angles, scalars: Scalars) -> Values:
        """Largest difference of θ integrated inside the elements from θ at their inner nodes."""
        mesh = self.model.mesh
        inner = legendre.legvander(2.0 * mesh.reference.nodes[1:-1] - 1.0, self.reference.degree)
        theta = self.everywhere(angles, scalars)[:, :, THETA]
        integrated = np.einsum("ij,lej->lei", inner @ self.reference.to_legendre, theta)
        gap = np.abs(integrated - angles[:, mesh.element_nodes[:, 1:-1]]).max(axis=(1, 2))
        return np.where(np.isfinite(gap), gap, np.inf)

    def largest_curvature(self, angles: Angles, scalars: Scalars) -> tuple[Values, Values]:
        """max_s |κ(s)|, ends and interior extrema included, and the arclength where it occurs.

        The highest peaks of the nodal values, improved by Newton on the elements' interpolants.
        """
        fields, mesh = self.everywhere(angles, scalars), self.model.mesh
        value, place = np.empty((2, len(fields)))
        nodes = 2.0 * self.reference.nodes - 1.0
        tables = nodes, self.reference.to_legendre, mesh.breaks, mesh.lengths, NEAR, REFINING
        if len(fields):
            over_lanes(general_field_kernels.peaks_lanes, tables, [fields], [value, place])
        return value, place
