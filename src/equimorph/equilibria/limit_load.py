"""Limit loads: the first critical point on a path of growing load."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import overload

import numpy as np

from equimorph.argument_checks import check_arguments
from equimorph.arrays import Shaped, Values
from equimorph.equilibria.legs import check_start, check_starts, violations
from equimorph.equilibria.lift import UNRECORDED, Path, lift_many
from equimorph.equilibria.paths import lift_one
from equimorph.equilibria.trace_options import TraceOptions
from equimorph.errors import InputError
from equimorph.model import Constraint, Progress, position
from equimorph.structures import State, States


@dataclass(frozen=True)
class LimitLoad:
    """The largest load met up to the first critical point.

    kind: "fold", "branch point", "multiple point", "constraint", "lateral branch point" (of the
    constraint `stable_in_space` of a rod), "none below the bound", "undefined unloaded" (a
    constraint fails at the start) or "lost"; `state`: where the path ended; `criticality` of branch
    points.
    """

    value: float
    kind: str
    state: State
    path: Path | None
    criticality: str | None = None
    detail: str = ""

    def __repr__(self) -> str:
        """Kind, value and state."""
        kind = f"{self.criticality} {self.kind}" if self.criticality else self.kind
        return f"LimitLoad({kind} at {self.value:.10g}: {self.state})"


@dataclass(frozen=True, eq=False)
class LimitLoads:
    """Limit loads of many states, in their order: arrays (lanes).

    Parameters
    ----------
    value
        Largest load met; not a number where it is undefined, lost or cancelled.
    kind
        A kind of `LimitLoad`, or "cancelled".
    states
        Where each path ended.
    criticality
        Criticality of branch points; "" otherwise.
    detail
        One line for lanes that need it: the constraint that was met, why a lane was lost.
    """

    value: Values
    kind: Shaped[np.ndarray, " lanes"]
    states: States
    criticality: Shaped[np.ndarray, " lanes"]
    detail: dict[int, str]

    def __len__(self) -> int:
        """Number of states."""
        return len(self.value)

    def __repr__(self) -> str:
        """How many of each kind."""
        kinds, counts = np.unique(self.kind, return_counts=True)
        ends = ", ".join(f"{n} {kind}" for kind, n in zip(kinds, counts, strict=True))
        return f"LimitLoads({len(self)}: {ends})"

    def __getitem__(self, lane: int) -> LimitLoad:
        """The limit load of one state, without its path."""
        words = str(self.criticality[lane]) or None, self.detail.get(lane, "")
        state = self.states[lane]
        return LimitLoad(float(self.value[lane]), str(self.kind[lane]), state, None, *words)


@overload
def limit_load(
    state: State,
    load: str,
    *,
    within: Sequence[Constraint] = (),
    bound: float | None = None,
    options: TraceOptions | None = None,
    progress: Progress | None = None,
) -> LimitLoad: ...
@overload
def limit_load(
    state: States,
    load: str,
    *,
    within: Sequence[Constraint] = (),
    bound: float | None = None,
    options: TraceOptions | None = None,
    progress: Progress | None = None,
) -> LimitLoads: ...
@check_arguments
def limit_load(
    state: State | States,
    load: str,
    *,
    within: Sequence[Constraint] = (),
    bound: float | None = None,
    options: TraceOptions | None = None,
    progress: Progress | None = None,
) -> LimitLoad | LimitLoads:
    """Follow the path in `load` from each state to the first critical point or constraint.

    Parameters
    ----------
    state
        Stable equilibrium, usually the natural state; or `States` (lanes).
    load
        Name of the parameter that grows.
    within
        Constraints that end the path, like ``[arch.max_curvature <= 10]``.
    bound
        Largest load tried, in the parameter's unit; greater than its value in every state. By
        default 100 times the parameter's scale.
    options, progress
        As for `lift`.

    Returns
    -------
    `LimitLoad` of one state, with its path; `LimitLoads` of many.

    Raises
    ------
    InputError
        If a state is not a stable equilibrium, or `bound` does not exceed its load.

    References
    ----------
    [Feher2025]_, section 3.2.1, conditions C1 and C2.
    """
    parameters = state.structure.parameters
    steered = parameters[position(parameters, load)]
    bound = 100.0 * steered.scale if bound is None else steered.check(bound)
    rise, within = {load: bound}, tuple(within)
    options = (options or UNRECORDED).following(one=isinstance(state, State))
    if isinstance(state, States):
        return _many(state, rise, within, options, progress)
    if not bound > state[load]:
        raise InputError(f"`bound` must exceed {load} = {state[load]:g}; got {bound!r}.")
    if not state.stable:
        raise InputError(f"`state` must be stable; got index {state.index}.")
    for constraint in within:
        if not constraint.excess(state.batch.z, state.batch.p)[0] <= 0.0:
            return LimitLoad(np.nan, "undefined unloaded", state, None, None, str(constraint))
    check_start(state)
    path = lift_one(state, rise, within, options, progress)
    end = path.end
    kind = "none below the bound" if end.kind == "arrived" else end.kind
    value = float(path.states[load].max()) if kind != "lost" else np.nan
    return LimitLoad(value, kind, end.state, path, end.criticality, end.detail)


def _many(
    states: States,
    rise: dict[str, float],
    within: tuple[Constraint, ...],
    options: TraceOptions,
    progress: Progress | None,
) -> LimitLoads:
    [(load, bound)] = rise.items()
    check_starts(states)
    highest = float(states[load].max())
    if not bound > highest:
        raise InputError(f"`bound` must exceed {load} = {highest:g}; got {bound!r}.")
    unstable = np.flatnonzero(states.index != 0)
    if len(unstable):
        index = int(states.index[unstable[0]])
        raise InputError(f"`state` must be stable; got index {index} in number {unstable[0]}.")
    undefined = violations(states, within)
    ended = lift_many(states, rise, within, options, progress)
    kind = np.where(ended.arrived, "none below the bound", ended.kind)
    kind = np.where(undefined, "undefined unloaded", kind)
    unknown = np.isin(kind, ("undefined unloaded", "lost", "cancelled"))
    value = np.where(unknown, np.nan, ended.states[load])
    return LimitLoads(value, kind, ended.states, ended.criticality, ended.detail)
