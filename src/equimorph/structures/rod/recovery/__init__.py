"""Fields of the rod between its vertices, recovered to the accuracy that they have there."""

from equimorph.structures.rod.recovery.recovery import Recovery

__all__ = ["Recovery"]
