"""Curved rods."""

from equimorph.structures.rod.rod import Rod

__all__ = ["Rod"]
