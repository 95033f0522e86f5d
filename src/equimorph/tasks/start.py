"""Where a task begins and ends: states that it accepts, and reasons to refuse a state."""

from collections.abc import Sequence

import numpy as np

from equimorph.equilibria import check_start
from equimorph.equilibria.soft_modes import soft_modes
from equimorph.errors import InputError
from equimorph.manifold import EquilibriumSet, Location
from equimorph.model import Constraint, Schedule, names_of
from equimorph.structures import State, Structure
from equimorph.tasks.estimation import StateEstimate
from equimorph.tolerances import SAME_STATE

Start = State | Location | StateEstimate
"""A state, or what `locate` or `estimate_state` says of a measured one."""


def start_state(start: Start) -> State:
    """State from which a task begins.

    Refused if a measured one is not known: ambiguous, or on no state of the set.
    """
    if isinstance(start, StateEstimate) and not start.known:
        raise InputError(f"`start` must be known; got an estimate that is {start.status}: "
                         f"{start.why}.")  # fmt: skip
    return start if isinstance(start, State) else start.state


def check_equilibrium(name: str, state: State, within: Sequence[Constraint] = ()) -> None:
    """Raise `InputError` unless the argument `name` is an equilibrium that obeys constraints."""
    try:
        check_start(state, within)
    except InputError as error:
        raise InputError(str(error).replace("`state`", f"`{name}`")) from None


def check_stable(name: str, state: State) -> None:
    """Raise `InputError` unless the argument `name` is a stable state."""
    if not state.stable:
        raise InputError(f"`{name}` must be stable; got a state of index {state.index}.")


def check_two_parameters(eset: EquilibriumSet, name: str = "eset") -> None:
    """Raise `InputError` unless the set of the argument `name` is over two parameters."""
    if len(eset.names) != 2:
        raise InputError(f"`{name}` must have two free parameters; got {', '.join(eset.names)}.")


def check_schedule(schedule: Schedule, structure: Structure, name: str = "schedule") -> None:
    """Raise `InputError` unless the schedule `name` gives the parameters of a structure."""
    names = names_of(structure.parameters)
    if schedule.names != names:
        raise InputError(
            f"`{name}` must give the parameters {', '.join(names)}; "
            f"got {', '.join(schedule.names)}."
        )


def check_fixed_parameters(name: str, state: State, eset: EquilibriumSet) -> None:
    """Raise `InputError` unless the argument `name` has the fixed parameters of a set."""
    wanted = eset.parameters_at({free: state[free] for free in eset.names})
    if not np.allclose(wanted, state.p, rtol=0, atol=1e-9):
        raise InputError(
            f"`{name}` must have the fixed parameters of the set ({dict(eset.fixed)}); "
            f"got {state.parameters}."
        )


def inadmissible(
    name: str,
    state: State,
    within: Sequence[Constraint],
    margin: float = 0.0,
    slack: float = 0.0,
) -> str:
    """Why a motion must not begin or end in a state, in words; empty if it may.

    `name` is "start" or "goal"; `slack` is an excess over a bound that counts as none.
    """
    for constraint in within:
        if not constraint.excess(state.z[None], state.p[None])[0] <= slack:
            value = constraint.descriptor(state)
            return f"the {name} violates {constraint}: {constraint.descriptor.name} = {value:.6g}"
    if not state.stable:
        return critical(name, state) or f"the {name} is unstable (index {state.index})"
    if margin > 0.0 and state.margin < margin:
        return f"the {name} has a stability margin of {state.margin:.4g}, below {margin:g}"
    return ""


def critical(name: str, state: State) -> str:
    """Words for a start or goal on a fold or branch point, nearer than states are told apart."""
    apart = soft_modes(state.structure, state.z[None], state.p[None]).own_length[0]
    if apart > SAME_STATE:
        return ""
    return f"the {name} lies on a fold or branch point, where stability is lost"
