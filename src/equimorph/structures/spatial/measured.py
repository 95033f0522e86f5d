"""Rods in space as structures: fields along the rod in the user's units."""

from functools import cached_property

import numpy as np
from jaxtyping import Float

from equimorph.arrays import Lanes, Parameters, Values
from equimorph.structures.places_inertia import inertia_of_places
from equimorph.structures.rod.any_rod import AnyRod, Arclengths, arclengths
from equimorph.structures.rod.centreline import Centreline
from equimorph.structures.spatial.fields import Fields, SpatialFields
from equimorph.structures.spatial.mechanics import SpatialMechanics


class MeasuredInSpace(AnyRod):
    """A rod in space with its rotations, strains and places."""

    mechanics: SpatialMechanics

    @cached_property
    def recovery(self) -> SpatialFields:
        """Fields along the rod, non-dimensional."""
        return SpatialFields(self.mechanics)

    def fields(self, z: Lanes, p: Parameters, s: Arclengths) -> Fields:
        """Rotations, places and strains at arclengths, in the user's units."""
        found = self.recovery.at(z, p, s)
        length, bend = self.units.value("length"), self.units.value("curvature")
        return Fields(found.rotations, length * found.places, bend * found.strains)

    def places(self, z: Lanes, p: Parameters, s: Arclengths) -> Float[np.ndarray, "lanes points 3"]:
        """(x, y, z) at arclengths."""
        return self.fields(z, p, s).places

    def centreline(self, z: Lanes, p: Parameters, s: Arclengths) -> Centreline:
        """Places, tangents, normals n and b, and curvature at arclengths."""
        fields, length = self.fields(z, p, s), self.units.value("length")
        tangents, n, b = np.moveaxis(fields.frames, -1, 0)
        strains = length * fields.strains
        bends = n * strains[..., 2:3] - b * strains[..., 1:2]
        return Centreline(fields.places, tangents, np.stack([n, b], axis=2), bends, length)

    def largest_curvature(self, z: Lanes, p: Parameters) -> tuple[Values, Values]:
        """Largest bending curvature along the rod, and the arclength where it occurs."""
        value, place = self.recovery.largest_curvature(z, p)
        return np.asarray(value * self.units.value("curvature")), place

    def inertia_in_lengths(
        self, z: Lanes, p: Parameters
    ) -> Float[np.ndarray, "lanes unknowns unknowns"]:
        """Mass matrix of a rod of mass 1: masses at the nodes of the elements."""

        def places(z: Lanes, p: Parameters) -> Float[np.ndarray, "lanes points 3"]:
            return self.recovery.nodal(z, p).places.reshape(len(z), -1, 3)

        weights = self.mesh.element_weights.ravel()
        return inertia_of_places(self.mechanics, places, weights, z, p)

    def frames(
        self, z: Lanes, p: Parameters, s: Arclengths | None = None
    ) -> Float[np.ndarray, "lanes points 3 3"]:
        """Axes of the cross-sections at arclengths `s`: the columns of each matrix are t, n, b."""
        return self.recovery.at(z, p, arclengths(s)).frames

    @property
    def flatness(self) -> float:
        """Width over thickness of a rectangle with the rod's mean ratio of bending stiffnesses."""
        model = self.mechanics.model
        _, aside, bend = model.stiffness.reshape(-1, 3).mean(axis=0)
        return float(np.sqrt(aside / bend))
