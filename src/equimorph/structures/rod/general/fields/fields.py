"""Fields along general rods, from the ends of their elements."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float
from numpy.polynomial import legendre

from equimorph.linalg.lanes import over_lanes
from equimorph.structures.rod.discretisation import Reference, reference_element
from equimorph.structures.rod.general.fields.kernels import (
    KAPPA,
    THETA,
    X,
    Y,
    fields_lanes,
)
from equimorph.structures.rod.general.model import RodModel

Angles = Float[np.ndarray, "lanes nodes"]
Scalars = Float[np.ndarray, "lanes scalars"]
Values = Float[np.ndarray, " lanes"]

REFINING = 4
"""Newton steps from the largest nodal curvature to the extremum of its polynomial."""


@dataclass(frozen=True, eq=False)
class Fields:
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
        return (
            model.bending_stiffness,
            model.element_slope,
            model.mesh.element_weights,
            model.nodal.softness,
            model.nodal.along,
            model.nodal.across,
            fine.along,
            fine.across,
            fine.bending,
            fine.rigidity,
            fine.softness,
            spread @ coarse.to_legendre,
            self.reference.integral,
            model.mesh.lengths,
        )

    def everywhere(
        self, angles: Angles, scalars: Scalars
    ) -> Float[np.ndarray, "lanes elements 5 fine"]:
        """θ, κ, x, y and the moment at the nodes of the finer rule in every element."""
        shape = (len(angles), self.model.mesh.elements, 5, len(self.reference.nodes))
        out = np.empty(shape)
        if len(angles):
            over_lanes(fields_lanes, self._shared, [np.ascontiguousarray(angles), scalars], [out])
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

    def largest_curvature(self, angles: Angles, scalars: Scalars) -> tuple[Values, Values]:
        """max_s |κ(s)|, ends and interior extrema included, and the arclength where it occurs.

        In every element the largest nodal value, improved by Newton on its interpolant.
        """
        kappa = self.everywhere(angles, scalars)[:, :, KAPPA]
        nodes = self.reference.nodes
        top = np.abs(kappa).argmax(axis=2)
        series = np.einsum("lei,ki->kle", kappa, self.reference.to_legendre)
        slope, bend = legendre.legder(series, 1), legendre.legder(series, 2)
        x = 2.0 * nodes[top] - 1.0
        low, high = (2.0 * nodes[np.clip(top + k, 0, len(nodes) - 1)] - 1.0 for k in (-1, 1))
        for _ in range(REFINING):
            turn, rate = (_evaluated(x, part) for part in (slope, bend))
            with np.errstate(divide="ignore", invalid="ignore"):
                moved = x - turn / rate
            x = np.where((moved >= low) & (moved <= high), moved, x)
        best = np.abs(
            np.stack([_evaluated(x, series), np.take_along_axis(kappa, top[..., None], 2)[..., 0]])
        )
        places = np.stack([x, 2.0 * nodes[top] - 1.0])
        which = best.argmax(axis=0)[None]
        value = np.take_along_axis(best, which, 0)[0]
        place = np.take_along_axis(places, which, 0)[0]
        element = value.argmax(axis=1)
        lanes = np.arange(len(value))
        share = 0.5 * (place[lanes, element] + 1.0)
        mesh = self.model.mesh
        return value[lanes, element], mesh.breaks[element] + mesh.lengths[element] * share


def _evaluated(
    x: Float[np.ndarray, "lanes elements"], series: Float[np.ndarray, "terms lanes elements"]
) -> Float[np.ndarray, "lanes elements"]:
    """Legendre series at a point of its own for each lane and element."""
    return np.asarray(legendre.legval(x, series, tensor=False))
