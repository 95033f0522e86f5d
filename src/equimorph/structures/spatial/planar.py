"""States of planar rods as guesses for rods in space."""

from typing import Any

import numpy as np

from equimorph.arrays import Lanes
from equimorph.errors import InputError
from equimorph.structures.rod.measured import Measured
from equimorph.structures.spatial.mechanics import SpatialMechanics
from equimorph.structures.spatial.quaternions import half_turn
from equimorph.structures.states import State


def planar_guess(mechanics: SpatialMechanics, state: Any) -> Lanes:
    """Unknowns with the angles and the support forces of a planar rod's state.

    Raises
    ------
    InputError
        For anything but the state of a planar rod.
    """
    if not (isinstance(state, State) and isinstance(state.structure, Measured)):
        raise InputError(f"`state` must be a state of a planar rod; got {state!r}.")
    rod = state.structure
    z, p = state.z[None], state.p[None]
    nodes = mechanics.mesh.nodes[mechanics.model.unknown_nodes]
    angles = rod.fields(z, p, nodes)[:, :, 0]
    q = half_turn(angles[None], 2)[0]
    along = np.append(rod.mechanics.support_forces(z, p)[0], 0.0)
    m = mechanics.constraints
    held = mechanics.model.reaction[:, :m]  # which coordinate each multiplier belongs to
    return np.concatenate([q.reshape(1, mechanics.unknowns), (along @ held)[None]], axis=1)
