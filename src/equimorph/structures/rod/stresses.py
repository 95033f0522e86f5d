"""Descriptors of strain, stress and safety of rods with a section.

They are those of bending and twist, see `fibres`. Axial stresses of an inextensible rod are smaller
by t/(6 L), shear of forces across it by t/L: both are left out.
"""

from abc import abstractmethod
from functools import cached_property
from typing import ClassVar

import numpy as np

from equimorph.argument_checks import check_arguments
from equimorph.arrays import Lanes, Parameters, Values
from equimorph.errors import InputError, MissingError
from equimorph.model import Descriptor, remember_call
from equimorph.structures.contract import Readers, Written
from equimorph.structures.rod.any_rod import AnyRod
from equimorph.structures.rod.fibres import Fibres
from equimorph.structures.rod.rod_description import RodDescription
from equimorph.structures.rod.terms import Curvature
from equimorph.structures.rod.units import SI
from equimorph.structures.unit_system import Quantity, UnitSystem

SAFEST = 1e6
"""Largest safety factor: that of a straight rod has no bound."""
FREE = ("stiffness", "curvature", "side_curvature", "natural_twist")
"""Profiles that have their defaults in a uniform rod that is straight when free of stress."""


class StressedRod(AnyRod):
    """A rod with descriptors of strain, stress and safety, which need the size of its section."""

    written: ClassVar[Written] = {
        **AnyRod.written,
        "max_strain": "max_strain",
        "max_stress": "max_stress",
        "safety_factor(strength)": "safety_factor",
    }
    readers: ClassVar[Readers] = {**AnyRod.readers, "strength": str}

    @property
    @abstractmethod
    def description(self) -> RodDescription:
        """The rod as its user describes it."""

    @property
    @abstractmethod
    def max_strain(self) -> Descriptor:
        """Largest strain of bending along the rod."""

    @property
    @abstractmethod
    def max_stress(self) -> Descriptor:
        """Largest stress along the rod."""

    @check_arguments
    @remember_call
    def safety_factor(self, strength: Quantity) -> Descriptor:
        """A strength over the largest stress, at most 1e6: ``rod.safety_factor("900 MPa") >= 1.5``.

        Parameters
        ----------
        strength
            Stress that the material bears, a number in the rod's units or a text.

        Raises
        ------
        InputError
            If it is not positive or no stress, or as of `max_strain`.
        """
        number = float(self._system.number(strength, "force/length²", "strength"))
        if not number > 0.0:
            raise InputError(f"`strength` must be positive; got {strength}.")
        stress = self.max_stress

        def value(z: Lanes, p: Parameters) -> Values:
            return number / np.maximum(stress.function(z, p), number / SAFEST)

        name = f"safety_factor({strength})"
        return Descriptor(name, "1", value, "safety factor", stress.origin, stress.place)

    @property
    def stress_label(self) -> str:
        """Unit of stresses."""
        return self._system.label("force/length²")

    @property
    def _system(self) -> UnitSystem:
        return SI if self.units.system.plain else self.units.system

    @cached_property
    def fibres(self) -> Fibres:
        """Fibres with the largest strains and stresses.

        Raises
        ------
        MissingError
            If there is no section of a shape, or the curvature is not that of bending alone.
        """
        section = self.space_options.section
        fibres = None if section is None else section.fibres(self._system)
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
