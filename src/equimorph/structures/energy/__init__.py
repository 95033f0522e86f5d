"""Structures given by an energy and constraints, as formulas."""

from equimorph.structures.energy.declared import Unknown as Unknown
from equimorph.structures.energy.structure import EnergyStructure as EnergyStructure
