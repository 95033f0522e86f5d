"""Fields of rods of any kind, recovered to the accuracy that they have at the ends of elements."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.polynomial import legendre

from equimorph.arrays import Float, Int, Scalars, Values
from equimorph.linalg.lanes import over_lanes
from equimorph.structures.rod import general_field_kernels
from equimorph.structures.rod.discretisation import Reference, reference_element
from equimorph.structures.rod.general_field_kernels import KAPPA, THETA, X, Y
from equimorph.structures.rod.model import RodModel
from equimorph.structures.rod.pressure import EnclosedArea, rod_quadrature

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
        pressed = rod_quadrature(model.mesh)[:, 0] if model.pressure.any() else np.zeros((0, 0))
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
            model.mesh.weights,
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
        kappa = self.everywhere(angles, scalars)[:, :, KAPPA]
        sizes = np.abs(kappa)
        sides = np.pad(sizes, ((0, 0), (0, 0), (1, 1)), constant_values=-np.inf)
        lower = (sizes < sides[:, :, :-2]) | (sizes <= sides[:, :, 2:])
        low = sizes < NEAR * sizes.max(axis=(1, 2), keepdims=True)
        lane, element, top = np.nonzero(~(lower | low))
        x, value = self._extrema(kappa[lane, element], top)
        order = np.lexsort((value, lane))
        last = order[np.searchsorted(lane[order], np.arange(len(kappa)), side="right") - 1]
        mesh = self.model.mesh
        place = mesh.breaks[element] + mesh.lengths[element] * 0.5 * (x + 1.0)
        return value[last], place[last]

    def _extrema(
        self, kappa: Float[np.ndarray, "some fine"], top: Int[np.ndarray, " some"]
    ) -> tuple[Float[np.ndarray, " some"], Float[np.ndarray, " some"]]:
        """Place in [−1, 1] and size of the extrema next to the nodes `top`."""
        nodes = 2.0 * self.reference.nodes - 1.0
        series = self.reference.to_legendre @ kappa.T
        slope, bend = legendre.legder(series, 1), legendre.legder(series, 2)
        x = nodes[top]
        low, high = (nodes[np.clip(top + k, 0, len(nodes) - 1)] for k in (-1, 1))
        for _ in range(REFINING):
            turn, rate = (legendre.legval(x, part, tensor=False) for part in (slope, bend))
            with np.errstate(divide="ignore", invalid="ignore"):
                moved = x - turn / rate
            x = np.where((moved >= low) & (moved <= high), moved, x)
        found = np.abs(legendre.legval(x, series, tensor=False))
        at_node = np.abs(np.take_along_axis(kappa, top[:, None], 1)[:, 0])
        better = found >= at_node
        return np.where(better, x, nodes[top]), np.where(better, found, at_node)
