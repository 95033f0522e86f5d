"""Fields along planar rods in the user's units; strain, stress and safety of rods with a section.

Stresses are those of bending and twist, see `fibres`. Axial stresses of an inextensible rod are
smaller by t/(6 L), shear of forces across it by t/L: both are left out.
"""

from abc import abstractmethod
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from equimorph.arrays import Float, Lanes, Parameters, Values, Velocity
from equimorph.errors import MissingError
from equimorph.structures.contract import Readers, Written
from equimorph.structures.material_points import MaterialPoints
from equimorph.structures.rod.any_description import RodDescription
from equimorph.structures.rod.any_rod import AnyRod
from equimorph.structures.rod.arclengths import Arclengths
from equimorph.structures.rod.centreline import Centreline
from equimorph.structures.rod.fibres import Fibres, Stressed
from equimorph.structures.rod.mechanics import PlanarMechanics
from equimorph.structures.rod.terms import Curvature
from equimorph.structures.unit_system import UnitSystem

FREE = ("stiffness", "curvature", "side_curvature", "natural_twist")
"""Profiles that have their defaults in a uniform rod that is straight when free of stress."""


class StressedRod(Stressed, AnyRod):
    """A rod with descriptors of strain, stress and safety, which need the size of its section."""

    written: ClassVar[Written] = {**AnyRod.written, **Stressed.written}
    readers: ClassVar[Readers] = {**AnyRod.readers, **Stressed.readers}

    @property
    @abstractmethod
    def description(self) -> RodDescription[Any, Any]:
        """The rod as its user describes it."""

    @property
    def own_system(self) -> UnitSystem:
        """Units of the rod."""
        return self.units.system

    @cached_property
    def fibres(self) -> Fibres:
        """Fibres with the largest strains and stresses.

        Raises
        ------
        MissingError
            If there is no section of a shape, or the curvature is not that of bending alone.
        """
        section = self.space_options.section
        fibres = None if section is None else section.fibres(self.stress_system)
        if fibres is None:
            raise MissingError(
                "`max_strain` must be that of a rod with a section, like Rod(section=Strip(...), "
                "length=...), Round or Tube; got a rod without the size of its section."
            )
        if not self.is_straight_when_free:
            raise MissingError(
                "`max_strain` must be that of a uniform rod that is straight when free of stress; "
                "got one with its own curvature, a curvature load or a profile of stiffness. Bound "
                "its curvature instead."
            )
        return fibres

    @property
    def is_straight_when_free(self) -> bool:
        """Whether the rod is uniform, and straight where it is free of stress."""
        own, usual = self.description.profiles, self.description.defaults
        same = all(own[name] == usual[name] for name in FREE if name in usual)
        loads = (one for terms in self.terms.values() for one in terms)
        return same and not any(isinstance(one, Curvature) for one in loads)


class Measured(StressedRod):
    """A planar rod with its angles, curvature and places."""

    mechanics: PlanarMechanics

    def nodal_angles(self, z: Lanes, p: Parameters) -> Float[np.ndarray, "lanes nodes"]:
        """Angles θ at all nodes, the prescribed ends included."""
        return self.mechanics.nodal_angles(z, p)

    def fields(self, z: Lanes, p: Parameters, s: Arclengths) -> Float[np.ndarray, "lanes points 4"]:
        """(θ, κ, x, y) at arclengths, recovered from the vertices."""
        return np.asarray(self.mechanics.fields(z, p, s) * self._field_units)

    @cached_property
    def _field_units(self) -> Float[np.ndarray, "4"]:
        length = self.units.value("length")
        return np.array([1.0, self.units.value("curvature"), length, length])

    def places(self, z: Lanes, p: Parameters, s: Arclengths) -> Float[np.ndarray, "lanes points 2"]:
        """(x, y) at arclengths."""
        return self.fields(z, p, s)[:, :, 2:]

    def centreline(self, z: Lanes, p: Parameters, s: Arclengths) -> Centreline:
        """Places, tangents, and normals to the left at arclengths."""
        fields = self.fields(z, p, s)
        angles = fields[:, :, 0]
        tangents = np.stack([np.cos(angles), np.sin(angles)], axis=2)
        left = np.stack([-tangents[:, :, 1], tangents[:, :, 0]], axis=2)
        return Centreline(fields[:, :, 2:], tangents, left[:, :, None])

    @property
    def material_in_lengths(self) -> MaterialPoints:
        """Points of a rod of mass 1: the nodes of the elements."""
        rod = self.mechanics
        return MaterialPoints(rod, rod.nodal_places, rod.mesh.weights)

    @property
    def sprung_in_lengths(self) -> MaterialPoints | None:
        """Points of a rod of mass 1 on springs that the unknowns leave free."""
        return self.mechanics.sprung

    def inertia_in_lengths(
        self, z: Lanes, p: Parameters
    ) -> Float[np.ndarray, "lanes unknowns unknowns"]:
        """Mass matrix of a rod of mass 1."""
        return self.mechanics.inertia(z, p)

    def inertial_force_in_lengths(self, z: Lanes, p: Parameters, velocity: Velocity) -> Velocity:
        """Γ of a rod of mass 1."""
        return self.mechanics.inertial_force(z, p, velocity)

    def largest_curvature(self, z: Lanes, p: Parameters) -> tuple[Values, Values]:
        """max_s |κ(s)|, ends and interior extrema included, and the arclength where it occurs."""
        value, place = self.mechanics.largest_curvature(z, p)
        return value * self.units.value("curvature"), place
