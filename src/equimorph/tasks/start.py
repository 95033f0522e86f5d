"""Where a task begins: a state, or one that was measured."""

from equimorph.errors import InputError
from equimorph.manifold import Location
from equimorph.structures import State
from equimorph.tasks.estimation import StateEstimate

Start = State | Location | StateEstimate
"""A state, or what `locate` or `estimate_state` says of a measured one."""


def start_state(start: Start) -> State:
    """State from which a task begins.

    Raises
    ------
    InputError
        If a measured one is not known: ambiguous, or on no state of the set.
    """
    if isinstance(start, StateEstimate) and not start.known:
        raise InputError(f"`start` must be known; got an estimate that is {start.status}: "
                         f"{start.why}.")  # fmt: skip
    return start if isinstance(start, State) else start.state
