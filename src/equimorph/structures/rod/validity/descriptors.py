"""Validity of the planar model, as descriptors and as warnings."""

import numpy as np

from equimorph.arrays import Lanes, Parameters, Values
from equimorph.errors import InputError
from equimorph.model import Descriptor
from equimorph.structures.rod.general.ends import End
from equimorph.structures.rod.general.mechanics import GeneralMechanics
from equimorph.structures.rod.measured import Measured
from equimorph.structures.rod.validity.contact import closest_approach, stations
from equimorph.structures.rod.validity.lateral import LateralStiffness, lateral_margin


def clearance(rod: Measured, apart: float) -> Descriptor:
    """Smallest distance between points that lie `apart` or further along the rod."""
    number = float(apart) if isinstance(apart, int | float) else np.nan
    if not 0.0 < number < 1.0:
        raise InputError(
            f"`apart` must be a share of the rod's length between 0 and 1; got {apart!r}."
        )
    unit = rod.units.value("length")

    def found(z: Lanes, p: Parameters) -> tuple[Values, Values]:
        return closest_approach(rod.mechanics.fields(z, p, stations()), number)

    def value(z: Lanes, p: Parameters) -> Values:
        return unit * found(z, p)[0]

    def place(z: Lanes, p: Parameters) -> Values:
        return found(z, p)[1]

    name, label = f"clearance({number:.9g})", rod.units.label("length")
    return Descriptor(name, label, value, "clearance", rod.signature, place)


def lateral(
    rod: Measured, mechanics: GeneralMechanics, ends: tuple[End, End], stiffness: LateralStiffness
) -> Descriptor:
    """Smallest eigenvalue for movements out of the plane.

    `mechanics`: the rod's, in its parameters and any number of further ones that are zero.
    """
    unit = rod.units.value("couple")

    def value(z: Lanes, p: Parameters) -> Values:
        more = np.zeros((len(p), len(mechanics.model.names) - p.shape[1]))
        wide = np.concatenate([p, more], axis=1)
        return unit * lateral_margin(mechanics, ends, stiffness, z, wide)

    label = rod.units.label("couple")
    written = f"lateral_margin({stiffness.torsion}, {stiffness.lateral})"
    return Descriptor(written, label, value, "lateral margin", rod.signature)
