"""Checks of the states from which lifts start."""

from collections.abc import Sequence

import numpy as np

from equimorph.arrays import Flags
from equimorph.errors import InputError
from equimorph.model import Constraint
from equimorph.structures import State, States

ON_BOUND = 1e-9
"""Relative excess up to which a start counts as on a bound: an earlier lift may end there."""
EQUILIBRIUM = 1e-8
"""Residual below which a state is an equilibrium."""


def _size(constraint: Constraint) -> float:
    return max(1.0, abs(constraint.bound))


def check_start(state: State, within: Sequence[Constraint] = ()) -> None:
    """Raise `InputError` unless `state` is an equilibrium that obeys the constraints."""
    if not state.residual < EQUILIBRIUM:
        raise InputError(
            f"`state` must be an equilibrium (largest residual below {EQUILIBRIUM:g}); "
            f"got a residual of {state.residual:.2g}."
        )
    for constraint in within:
        if constraint.excess(state.z[None], state.p[None])[0] > ON_BOUND * _size(constraint):
            value = constraint.descriptor(state)
            raise InputError(
                f"`state` must obey {constraint}; got {constraint.descriptor.name} = {value:.6g}."
            )


def check_starts(states: States) -> None:
    """Raise `InputError` unless all of one or more states are equilibria."""
    if len(states) == 0:
        raise InputError("`state` must hold at least one state; got none.")
    worst = int(np.argmax(states.residual))
    if not states.residual[worst] < EQUILIBRIUM:
        raise InputError(
            f"`state` must hold equilibria (largest residual below {EQUILIBRIUM:g}); got a "
            f"residual of {states.residual[worst]:.2g} in number {worst}."
        )


def violated(states: States, within: Sequence[Constraint]) -> Flags:
    """Which states exceed a bound by more than round-off."""
    over = np.zeros(len(states), bool)
    for c in within:
        over |= c.excess(states.z, states.p) > ON_BOUND * _size(c)
    return over
