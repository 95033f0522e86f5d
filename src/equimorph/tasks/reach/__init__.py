"""What a structure can do from where it is: reachable and attainable sets."""

from equimorph.tasks.reach.query import Answer
from equimorph.tasks.reach.reachable_sets import Reach, attainable, reachable
from equimorph.tasks.reach.regions import BoundaryPiece, Region

__all__ = ["Answer", "BoundaryPiece", "Reach", "Region", "attainable", "reachable"]
