"""Straight moves of the parameters from states: where they arrive, or in what they turn back."""

import numpy as np
from jaxtyping import Float, Int

from equimorph.equilibria import ParameterLine, TraceOptions
from equimorph.equilibria.trace import trace
from equimorph.equilibria.trace_options import EventCode
from equimorph.model import Constraint
from equimorph.structures import States

Points = Float[np.ndarray, "points P"]
STRAIGHT_ON = TraceOptions(
    through_folds=True, through_branch_points=True, record=False, locate_passed=False
)


def turned_back(
    states: States, velocity: Points
) -> tuple[Float[np.ndarray, "some size"], Int[np.ndarray, " some"]]:
    """States in which moves of the parameters end that turn back at a fold; which moves do."""
    line = ParameterLine(states.structure, states.p.copy(), velocity)
    outcome = trace(line, states.z.copy(), (), STRAIGHT_ON)
    which = np.flatnonzero(outcome.code == EventCode.RETURNED)
    return outcome.z[which], which


def lift_to(
    states: States, p: Points, constraints: tuple[Constraint, ...]
) -> tuple[Float[np.ndarray, "arrived size"], Int[np.ndarray, " arrived"]]:
    """Equilibria that straight lifts from `states` to p, one for each, reach; which they are."""
    velocity = p - states.p
    still = np.abs(velocity).max(axis=1, initial=0.0) == 0.0
    moving = np.flatnonzero(~still)
    line = ParameterLine(states.structure, states.p[moving].copy(), velocity[moving])
    outcome = trace(line, states.z[moving].copy(), constraints, STRAIGHT_ON)
    arrived = outcome.code == EventCode.ARRIVED
    which = np.concatenate([np.flatnonzero(still), moving[arrived]])
    return np.concatenate([states.z[still], outcome.z[arrived]]), which
