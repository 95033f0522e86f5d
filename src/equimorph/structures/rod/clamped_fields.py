"""Fields along the rod between two clamps, between its nodes as accurate as at its vertices."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.polynomial import legendre, polynomial

from equimorph.arrays import Float, Lanes, Parameters, Values
from equimorph.linalg.lanes import over_lanes
from equimorph.structures.rod.clamped_field_kernels import fields_lanes, largest_lanes
from equimorph.structures.rod.discretisation import Mesh, reference_element
from equimorph.structures.rod.profiles import LoadShape

LOAD_DEGREE = 16
"""Degree of the polynomials by which the load is represented inside an element."""
NEGLIGIBLE = 1e-13
"""Legendre coefficients of ρ that are smaller, relative to the largest |ρ|, are round-off."""
KEPT, FEW = 256, 4
"""Sets of so few arclengths whose places in the mesh are kept: descriptors ask for the same ones
many times."""


@dataclass(frozen=True, eq=False)
class ClampedFields:
    """Fields anywhere on the rod as accurate as at its vertices: errors of order 2N for degree N.

    θ and the moments are superconvergent at the vertices, λ and μ everywhere; inside an element θ
    of degree N is less accurate. So the equilibrium equation is integrated from the nearest vertex,
    as an initial value problem, by Taylor series of order 16.

    References
    ----------
    Vertices: [DouglasDupont1974]_.
    """

    mesh: Mesh
    load: LoadShape
    stiffness: Float[np.ndarray, "elements order order"]
    """Element stiffness over 4π²."""
    rho: Float[np.ndarray, "elements order"]

    def fields(
        self, z: Lanes, p: Parameters, s: Float[np.ndarray, " points"]
    ) -> Float[np.ndarray, "lanes points 4"]:
        """(θ, κ, x, y) at arclengths."""
        element, side, distance = self._nearest_vertices(s)
        out = np.empty((len(z), 4 * len(s)))
        shared = (
            self.stiffness,
            self._pressures,
            self.mesh.element_weights,
            self._nodal_rho,
            self._rises,
            element,
            side,
            distance,
        )
        over_lanes(fields_lanes, shared, [z, p], [out])
        return out.reshape(len(z), len(s), 4)

    def _nearest_vertices(self, s: Float[np.ndarray, " points"]) -> tuple[np.ndarray, ...]:
        """Elements, on which side of them the nearest vertices are, and the ways from these."""
        known, key = self._vertices, s.tobytes()
        found = known.get(key)
        if found is None:
            element, t = self.mesh.locate(s)
            side = (t > 0.5).astype(np.int64)
            found = element, side, s - self.mesh.breaks[element + side]
            if len(s) <= FEW and len(known) < KEPT:
                known[key] = found
        return found

    @cached_property
    def _vertices(self) -> dict[bytes, tuple[np.ndarray, ...]]:
        """What `_nearest_vertices` keeps."""
        return {}

    def largest_curvature(self, z: Lanes, p: Parameters) -> tuple[Values, Values]:
        """max_s |κ(s)|, ends and interior extrema included, and the first arclength where it is."""
        out, place = np.empty(len(z)), np.empty(len(z))
        over_lanes(largest_lanes, self.extremum_data, [z, p], [out, place])
        return out, place

    @cached_property
    def extremum_data(self) -> tuple[np.ndarray, ...]:
        """What the search for the largest curvature shares among lanes."""
        ref = self.mesh.reference
        return (
            self.stiffness,
            self._pressures,
            self.mesh.breaks,
            ref.nodes,
            ref.integral,
            self._nodal_rho,
            self._rises,
        )

    @cached_property
    def _pressures(self) -> Float[np.ndarray, " elements"]:
        """Quadrature weight of a vertex in each element."""
        return np.ascontiguousarray(self.mesh.element_weights[:, 0])

    @cached_property
    def _nodal_rho(self) -> Float[np.ndarray, " nodes"]:
        """ρ, which is continuous, node by node."""
        return np.append(self.rho[:, :-1].ravel(), self.rho[-1, -1])

    @cached_property
    def _rises(self) -> Float[np.ndarray, "elements 2 terms"]:
        """Taylor coefficients of ρ about the left and the right vertex of each element.

        ρ is taken as a polynomial of degree 16 in each element, less its round-off: of degree 2
        under tables.
        """
        fine = Mesh(self.mesh.breaks, reference_element(LOAD_DEGREE))
        rho = self.load.cumulate(fine)
        series = rho @ fine.reference.to_legendre.T
        large = np.abs(series).max(axis=0) > NEGLIGIBLE * max(np.abs(rho).max(), 1e-300)
        terms = int(np.flatnonzero(large).max(initial=0)) + 1
        out = np.empty((self.mesh.elements, 2, terms))
        for e, length in enumerate(self.mesh.lengths):
            powers = legendre.leg2poly(series[e, :terms])  # in x = −1 … 1
            for side, centre in enumerate((-1.0, 1.0)):
                scale = 1.0
                for k in range(terms):
                    at = polynomial.polyval(centre, polynomial.polyder(powers, k))
                    out[e, side, k] = at * scale
                    scale *= 2.0 / (length * (k + 1))
        return out
