"""Limit loads: the first critical point on a path of growing load."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from equimorph.equilibria.lift import Path, lift
from equimorph.equilibria.tracing import TraceOptions
from equimorph.errors import InputError
from equimorph.model import Constraint, position
from equimorph.structures import State


@dataclass(frozen=True)
class LimitLoad:
    """The largest load met up to the first critical point.

    kind: "fold", "branch point", "constraint", "none below the bound", "undefined unloaded" (a
    constraint fails at the start) or "lost"; `state`: where the path ended.
    """

    value: float
    kind: str
    state: State
    path: Path | None
    criticality: str | None = None
    detail: str = ""


def limit_load(
    state: State,
    load: str,
    *,
    within: Sequence[Constraint] = (),
    bound: float | None = None,
    options: TraceOptions | None = None,
) -> LimitLoad:
    """Follow the path in `load` from `state` to the first loss of stability or constraint.

    Parameters
    ----------
    state
        Stable equilibrium, usually the natural state.
    load
        Name of the parameter that grows.
    within
        Constraints that end the path, like ``[arch.max_curvature <= 10]``.
    bound
        Largest load tried, in the parameter's unit; greater than its value in `state`. None: a
        hundred of the parameter's scales.

    Raises
    ------
    InputError
        If `state` is no stable equilibrium, or `bound` does not exceed its load.

    References
    ----------
    [Feher2025]_, section 3.2.1, conditions C1 and C2.
    """
    parameters = state.structure.parameters
    if bound is None:
        bound = 100.0 * parameters[position(parameters, load)].scale
    if not bound > state[load]:
        raise InputError(f"`bound` must exceed {load} = {state[load]:g}; got {bound!r}.")
    if not state.stable:
        raise InputError(f"`state` must be stable; got index {state.index}.")
    for constraint in within:
        if not constraint.holds(state.batch)[0]:
            return LimitLoad(np.nan, "undefined unloaded", state, None, None, str(constraint))
    path = lift(state, {load: bound}, within=within, options=options)
    end = path.end
    kind = "none below the bound" if end.kind == "arrived" else end.kind
    value = float(path.states[load].max()) if kind != "lost" else np.nan
    return LimitLoad(value, kind, end.state, path, end.criticality, end.detail)
