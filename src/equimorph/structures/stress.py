"""Descriptors of strain, stress and safety: what rods and frames whose sections are known share."""

from abc import abstractmethod
from typing import ClassVar

import numpy as np

from equimorph.argument_checks import check_arguments
from equimorph.arrays import Lanes, Parameters, Values
from equimorph.errors import InputError
from equimorph.model import Descriptor, remember_call
from equimorph.structures.contract import Readers, Structure, Written
from equimorph.structures.rod.units import SI
from equimorph.structures.unit_system import Quantity, UnitSystem

SAFEST = 1e6
"""Largest safety factor: that of a straight rod has no bound."""


class Stressed(Structure):
    """A structure with strains and stresses, which need the size of its sections."""

    written: ClassVar[Written] = {
        "max_strain": "max_strain",
        "max_stress": "max_stress",
        "safety_factor(strength)": "safety_factor",
    }
    readers: ClassVar[Readers] = {"strength": str}

    @property
    @abstractmethod
    def max_strain(self) -> Descriptor:
        """Largest strain in the surface."""

    @property
    @abstractmethod
    def max_stress(self) -> Descriptor:
        """Largest stress."""

    @property
    @abstractmethod
    def own_system(self) -> UnitSystem:
        """Units of its user, which may name none."""

    @check_arguments
    @remember_call
    def safety_factor(self, strength: Quantity) -> Descriptor:
        """A strength over the largest stress, at most 1e6: ``rod.safety_factor("900 MPa") >= 1.5``.

        Parameters
        ----------
        strength
            Stress that the material bears, a number in the structure's units or a text.

        Raises
        ------
        InputError
            If it is not positive or no stress, or as of `max_strain`.
        """
        number = float(self.stress_system.number(strength, "force/length²", "strength"))
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
        return self.stress_system.label("force/length²")

    @property
    def stress_system(self) -> UnitSystem:
        """Units of stresses: SI where its user names none."""
        return SI if self.own_system.plain else self.own_system
