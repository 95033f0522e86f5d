"""Newton's method for states of a set whose descriptors take given values."""

import numpy as np
from jaxtyping import Float

from equimorph.equilibria.point_conditions import Values
from equimorph.equilibria.settle import Guards, Settled, embedded_planes, free_directions, settle
from equimorph.manifold.geometry.setting import Setting
from equimorph.model import Descriptor
from equimorph.tasks.optimising.tangent_steps import SetPoints

GUARDS = Guards(iterations=30, longest=0.3, converged=1e-7)
"""Newton squares what is left after the last correction."""


def states_with_values(
    setting: Setting,
    at: SetPoints,
    descriptors: tuple[Descriptor, ...],
    wanted: Float[np.ndarray, "lanes k"],
) -> Settled:
    """Solve F(z; p) = 0 and S(z, p) = S* from guesses near a set.

    Folds are regular points. With fewer descriptors than free parameters the steps along the set
    are the shortest ones.

    Parameters
    ----------
    setting
        Structure and free parameters.
    at
        Guesses, with bases of spaces near the tangent spaces.
    wanted
        S* for each lane; at most d descriptors.
    """
    structure, free = setting.structure, setting.free
    directions = free_directions(structure, free, len(at))
    values = Values(tuple(each.function for each in descriptors), wanted)
    frame = embedded_planes(structure, free, at.rows)
    return settle(structure, at.z, at.p, directions, [values], GUARDS, frame)
