"""F_z of any structure as a dense matrix."""

import numpy as np

from equimorph.array_types import Float
from equimorph.arrays import Lanes, Parameters
from equimorph.structures.equations import Equations

SHIFT = -1.0
"""Of the spectrum in units of the metric: F_z itself is singular at folds."""


def dense_matrices(
    equations: Equations, z: Lanes, p: Parameters
) -> Float[np.ndarray, "lanes size size"]:
    """F_z, from solves with it and a shift."""
    lanes, size = len(z), equations.size
    units = np.repeat(np.eye(size)[None], lanes, axis=0)
    inverse = equations.solve(z, p, units, None, np.full(lanes, SHIFT)).x
    out = np.linalg.inv(inverse.transpose(0, 2, 1))
    at = np.arange(equations.unknowns)
    out[:, at, at] += SHIFT * equations.mass
    return np.asarray(out)
