"""Structures given by an energy and constraints, as formulas."""

from equimorph.structures.energy.declarations import Unknown as Unknown
from equimorph.structures.energy.structure import EnergyStructure as EnergyStructure
