"""Random settings pushed back into what constraints allow, by their slopes on the set."""

import numpy as np
from jaxtyping import Float

from equimorph.model import Constraint
from equimorph.structures import States

Slopes = Float[np.ndarray, "lanes constraints directions"]

STEP = 1e-5
"""Step of the central differences along the set, in the units of the directions."""
SWEEPS = 12
INSIDE = 0.02
"""How far inside a bound settings are pushed, as a share of it."""


def slopes_of(
    states: States,
    directions: Float[np.ndarray, "lanes directions parameters"],
    within: tuple[Constraint, ...],
) -> tuple[Float[np.ndarray, "lanes constraints"], Slopes]:
    """Excesses of constraints at states, and their slopes on the set along changes of p."""
    structure, lanes = states.structure, len(states)
    count = directions.shape[1]
    columns = np.stack(
        [
            structure.parameter_derivative(states.z, states.p, directions[:, k])
            for k in range(count)
        ],
        axis=1,
    )
    dz = -structure.solve(states.z, states.p, columns).x
    sides = []
    for sign in (STEP, -STEP):
        z = (states.z[:, None] + sign * dz).reshape(lanes * count, -1)
        p = (states.p[:, None] + sign * directions).reshape(lanes * count, -1)
        each = [c.excess(z, p).reshape(lanes, count) for c in within]
        sides.append(np.stack(each, axis=1))
    here = np.stack([c.excess(states.z, states.p) for c in within], axis=1)
    return here, (sides[0] - sides[1]) / (2.0 * STEP)


def pushed(
    change: Float[np.ndarray, "lanes d"],
    excess: Float[np.ndarray, "lanes constraints"],
    slopes: Float[np.ndarray, "lanes constraints d"],
    room: tuple[Float[np.ndarray, "lanes d"], Float[np.ndarray, "lanes d"]],
    inside: Float[np.ndarray, " constraints"],
) -> Float[np.ndarray, "lanes d"]:
    """Changes near the given ones after which no linearised constraint is violated.

    Projections onto one constraint after the other, with the changes kept in their room. Where
    constraints contradict each other they stay violated, and a lift will tell.
    """
    change = change.copy()
    norms = np.maximum((slopes**2).sum(axis=2), 1e-300)
    for _ in range(SWEEPS):
        for k in range(slopes.shape[1]):
            over = excess[:, k] + (slopes[:, k] * change).sum(axis=1) + inside[k]
            share = np.maximum(over, 0.0) / norms[:, k]
            change -= share[:, None] * slopes[:, k]
        change = np.clip(change, *room)
    return change


def insides(within: tuple[Constraint, ...]) -> Float[np.ndarray, " constraints"]:
    """How far inside each bound to aim."""
    return np.array([INSIDE * abs(constraint.bound) for constraint in within])
