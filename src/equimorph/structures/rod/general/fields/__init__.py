"""Fields along general rods."""

from equimorph.structures.rod.general.fields.fields import Fields

__all__ = ["Fields"]
