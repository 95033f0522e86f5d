"""Strain, stress and safety of rods made from sections, as descriptors.

The outermost fibre of an inextensible rod has the strain ε = κ t/2 of bending, with the thickness t
in the plane, and the stress σ = E ε. Axial stresses are smaller by t/(6 L) and are left out.
"""

import numpy as np

from equimorph.arrays import Lanes, Parameters, Values
from equimorph.errors import InputError, MissingError
from equimorph.model import Descriptor
from equimorph.model.descriptor import Branches
from equimorph.structures.rod.sections import CrossSection, Fibre
from equimorph.structures.unit_system import UnitSystem

SAFEST = 1e6
"""Largest safety factor: that of a straight rod has no bound."""


def outermost_fibre(section: CrossSection | None, system: UnitSystem, bent: bool) -> Fibre:
    """Fibre with the largest strain.

    Raises
    ------
    MissingError
        If there is no section of a shape, or the curvature is not that of bending alone.
    """
    fibre = None if section is None else section.fibre(system)
    if fibre is None:
        raise MissingError(
            "`max_strain` must be that of a rod with a section, like Rod(section=Strip(...), "
            "length=...), Round or Tube; got a rod without the size of its section."
        )
    if bent:
        raise MissingError(
            "`max_strain` must be that of a uniform rod that is straight when free of stress; got "
            "one with its own curvature, a curvature load or a profile of stiffness. Bound its "
            "curvature instead."
        )
    return fibre


def multiple(given: Descriptor, factor: float, name: str, unit: str, symbol: str) -> Descriptor:
    """Descriptor that is a positive multiple of another one, with its places and branches."""

    def value(z: Lanes, p: Parameters) -> Values:
        return factor * given.function(z, p)

    branches: Branches | None = None
    if given.branches is not None:
        inner = given.branches

        def branches(z: Lanes, p: Parameters):  # type: ignore[no-untyped-def]  # as `inner`
            values, places = inner(z, p)
            return factor * values, places

    return Descriptor(name, unit, value, symbol, given.origin, given.place, branches)


def safety(stress: Descriptor, strength: float, written: str) -> Descriptor:
    """Descriptor of a strength over a stress, at most 1e6.

    Raises
    ------
    InputError
        If the strength is not positive.
    """
    if not strength > 0.0:
        raise InputError(f"`strength` must be positive; got {written}.")

    def value(z: Lanes, p: Parameters) -> Values:
        return strength / np.maximum(stress.function(z, p), strength / SAFEST)

    name = f"safety_factor({written})"
    return Descriptor(name, "1", value, "safety factor", stress.origin, stress.place)
