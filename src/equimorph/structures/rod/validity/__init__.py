"""Where the planar model of a rod ends: contact with itself, and buckling out of the plane."""

from equimorph.structures.rod.validity.descriptors import clearance, lateral
from equimorph.structures.rod.validity.lateral import LateralStiffness

__all__ = ["LateralStiffness", "clearance", "lateral"]
