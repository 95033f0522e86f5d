"""What a structure can do from where it is: reachable and attainable sets."""

from equimorph.tasks.reach.regions import BoundaryPiece, Region
from equimorph.tasks.reach.sets import Reach, attainable, reachable
from equimorph.tasks.reach.towards import Answer

__all__ = ["Answer", "BoundaryPiece", "Reach", "Region", "attainable", "reachable"]
