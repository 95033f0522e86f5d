"""Smooth curves p(t) in parameter space."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Int

from equimorph.arrays import Lanes, Parameters, Values
from equimorph.equilibria.curves import Metric
from equimorph.equilibria.lifting.pieces import Pieces
from equimorph.structures import Advance, Structure


@dataclass(frozen=True)
class SmoothCurve:
    """Curves p(t) given by polynomials in pieces; `weight` is the scaled length of each."""

    structure: Structure
    pieces: Pieces
    weight: Values

    @property
    def metric(self) -> Metric:
        """The structure's own."""
        return self.structure

    @property
    def folds_change_index(self) -> bool:
        """Whether the index changes where dt/ds vanishes, and only there."""
        return True

    def take(self, lanes: Int[np.ndarray, " some"]) -> "SmoothCurve":
        """Return some of the lanes."""
        return SmoothCurve(self.structure, self.pieces.take(lanes), self.weight[lanes])

    def parameters(self, t: Values) -> Parameters:
        """p(t)."""
        return self.pieces.value(t)

    def states(self, z: Lanes, t: Values) -> tuple[Lanes, Parameters]:
        """Return z and p(t)."""
        return z, self.parameters(t)

    def rate(self, t: Values) -> Parameters:
        """dp/dt."""
        return self.pieces.rate(t)

    def bend(self, t: Values) -> Parameters:
        """d²p/dt²."""
        return self.pieces.bend(t)

    def advance(self, z: Lanes, t: Values, row: Lanes, corner: Values, defect: Values) -> Advance:
        """Newton step and tangent; see `Advance`."""
        return self.structure.advance(z, self.parameters(t), self.rate(t), row, corner, defect)
