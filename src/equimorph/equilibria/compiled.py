"""Loops of structures that are compiled as a whole: when they apply, and their arrays."""

import numpy as np

from equimorph.arrays import Float, Int, Lanes, Parameters
from equimorph.equilibria.curves import Curve, ParameterLine
from equimorph.linalg.compiled import is_awaited
from equimorph.marching import kernels
from equimorph.model import Constraint
from equimorph.structures import Advance
from equimorph.structures.contract import CompiledSteps

Line = tuple[Parameters, Parameters]


def compiled_steps(
    curve: Curve, z: Lanes, constraints: tuple[Constraint, ...]
) -> tuple[CompiledSteps, Line] | None:
    """Loops of the structure, and starts and velocities of straight lines.

    None where the arrays do not fit, or another process still compiles the loops.
    """
    if not isinstance(curve, ParameterLine):
        return None
    structure = curve.structure
    wide = (len(curve.start), len(structure.parameters))
    fits = curve.start.shape == curve.velocity.shape == wide and z.shape[1] == structure.size
    steps = structure.compiled_steps(constraints) if fits else None
    if steps and (is_awaited(steps.march) or is_awaited(steps.search)):
        return None
    line = np.ascontiguousarray(curve.start), np.ascontiguousarray(curve.velocity)
    return None if steps is None else (steps, line)


class Workspace:
    """Arrays for Newton steps of rows of lanes, and for values of constraints there."""

    def __init__(self, rows: int, size: int, parameters: int, constraints: int) -> None:
        dz, tangent, there = np.empty((3, rows, size))
        dt, slope, residual, determinant, self._ratio = np.empty((5, rows))
        index, at = np.empty((2, rows), np.int64)
        p, dp, p_there = np.empty((3, rows, parameters))
        self.move = Advance(dz, dt, tangent, slope, residual, index, determinant)
        self.columns = (dz, dt, tangent, slope, residual, index, determinant, self._ratio)
        self.scratch = (p, dp, there, p_there, at, np.empty((constraints, rows)))

    def step_again(
        self,
        curve: Curve,
        trial: Lanes,
        row: Lanes,
        numbers: Float[np.ndarray, "numbers padded"],
        lanes: Int[np.ndarray, " active"],
        guard: float,
    ) -> None:
        """Let the structure take steps whose pivots are unsafe."""
        at = np.flatnonzero(~(self._ratio[: len(lanes)] >= guard))
        t, corner, defect = numbers[[kernels.TRIAL, kernels.CORNER, kernels.DEFECT]][:, at]
        again = curve.take(lanes[at]).advance(trial[at], t, row[at], corner, defect)
        for name, column in vars(again).items():
            getattr(self.move, name)[at] = column
