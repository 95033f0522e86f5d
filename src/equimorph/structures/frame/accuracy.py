"""What a finer frame says of the discretisation error."""

import numpy as np

from equimorph.arrays import Lanes, Parameters, Values
from equimorph.structures.frame.fields import FrameFields

REFINING = 6
"""Newton iterations on the finer frame, started from the interpolated state."""
SOLVED = 1e-6
"""Last correction from which one more Newton step would be below round-off."""
SAFETY = 2.0
"""The change to a finer frame is an error less a much smaller one."""


def discretisation_error(frame: FrameFields, finer: FrameFields, z: Lanes, p: Parameters) -> Values:
    """Twice the largest change of displacements, turns of ends and max |κ| on a finer frame.

    Displacements and curvature are relative to the mean length of the members. Infinite where the
    finer frame has no equilibrium beside the state, as may happen at a fold.
    """
    model, fine = frame.model, finer.model
    matrix = model.mesh.interpolation(fine.mesh.nodes)
    turns = frame.turns(z, frame.scalars(z, p))[:, model.member_nodes] @ matrix.T
    nodes = np.zeros((len(z), len(fine.place)))
    nodes[:, fine.member_nodes] = turns
    start = np.concatenate([nodes[:, fine.place >= 0], z[:, frame.unknowns :]], axis=1)
    last = np.full_like(start, np.inf)
    for _ in range(REFINING):
        last = finer.solve(start, p, -finer.residual(start, p)[:, None]).x[:, 0]
        start = start + last
    change = np.zeros(len(z))
    for name in ("displacements", "turns_of_ends", "largest_curvatures"):
        difference = getattr(finer, name)(start, p) - getattr(frame, name)(z, p)
        change = np.maximum(change, np.abs(difference).max(axis=tuple(range(1, difference.ndim))))
    solved = np.abs(last).max(axis=1) < SOLVED
    return np.asarray(np.where(solved, SAFETY * change, np.inf))
