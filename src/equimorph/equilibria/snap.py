"""Snap landing: where a structure goes when it loses stability.

See docs/decisions.md, "Descents measure lengths by the soft mode".
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from equimorph.argument_checks import check_arguments
from equimorph.arrays import Float
from equimorph.equilibria.descents import Descents, descend
from equimorph.equilibria.gradient_flow import FAITHFUL, Ending, Flow, gradient_flow, implicit_step
from equimorph.equilibria.lift import check_start
from equimorph.equilibria.soft_modes import soft_modes
from equimorph.errors import InputError
from equimorph.model import parameter_vector
from equimorph.structures import State, States

CRITICAL = 1e-6
"""Stability margin up to which a state without negative eigenvalues may be left."""

STATUS = {
    Ending.LANDED: "landed",
    Ending.SADDLE: "saddle",
    Ending.ESCAPED: "escaped",
    Ending.STUCK: "lost",
    Ending.SLOW: "lost",
}


@dataclass(frozen=True, eq=False)
class Landing:
    """Where a snap-through in one direction ends.

    Parameters
    ----------
    status
        "landed" at a stable state; "held": the energy rises in this direction, nothing moves;
        "saddle": the flow ends at an unstable state, as by symmetry, from where `snap_landing` can
        go on; "escaped": no state stops it; "unresolved": the discretisation does not represent the
        state; "lost": a numerical failure.
    direction
        +1 or −1 along the unstable eigenvector; 0 where the parameters were changed instead.
    state
        Where it ended.
    released
        Energy before the snap minus the energy after it, at the same parameters.
    way
        Configurations along the way, which are not equilibria; for shapes and energies.
    time
        Times of these configurations. Scale: the metric's unit squared over energy, for unit
        mobility.
    detail
        One line.
    """

    status: str
    direction: int
    state: State
    released: float
    way: States
    time: Float[np.ndarray, " points"]
    detail: str = ""

    @property
    def landed(self) -> bool:
        """Whether a stable state was reached."""
        return self.status == "landed"

    def __repr__(self) -> str:
        """Status, state and energy released."""
        return f"Landing({self.status}: {self.state}; released {self.released:.6g})"


@check_arguments
def snap_landing(state: State, *, at: Mapping[str, float] | None = None) -> tuple[Landing, ...]:
    """Stable states that a structure reaches from a state that it cannot keep.

    Gradient flow ``M u̇ = −∂L/∂u`` in the structure's metric, on the constraints, at constant
    parameters: implicit Euler steps, as long as their error allows, along which the energy falls;
    the end is polished by Newton, and its index verified. This is the landing of an overdamped
    structure; with little damping other states may be reached.

    Parameters
    ----------
    state
        An unstable equilibrium, or a critical one like the fold or branch point that ended a lift.
        It is left both ways along the eigenvector of its smallest eigenvalue. At a fold one way
        leads to where the structure snaps just beyond, the other is "held".
    at
        Parameters that change at once, before the structure moves: the flow starts from the shape
        of `state`, moved onto the constraints if need be. `state` may then be stable.

    Returns
    -------
    Two landings, first along the eigenvector, then against it; with `at` one.

    Raises
    ------
    InputError
        If `state` is no equilibrium, or is stable and `at` changes nothing.
    """
    check_start(state)
    structure = state.structure
    if at is not None:
        p = parameter_vector(structure.parameters, at, state.p)
        if not np.array_equal(p, state.p):
            return (_after_change(state, p),)
    if state.index == 0 and state.margin > CRITICAL:
        raise InputError(
            f"`state` must be unstable or critical; got index 0 with a margin of "
            f"{state.margin:.3g}. Change parameters by `at` to leave a stable state."
        )
    return _both_ways(descend(structure, state.z[None], state.p[None], FAITHFUL), 0, state)


def snap_landings(states: States) -> list[tuple[Landing, ...]]:
    """Both landings of each of some unstable or critical states, followed at once as one batch."""
    led = descend(states.structure, states.z, states.p, FAITHFUL)
    return [_both_ways(led, lane, states[lane]) for lane in range(len(states))]


def _both_ways(led: Descents, lane: int, state: State) -> tuple[Landing, ...]:
    """Landings of one of the states that were left."""
    ways = zip((1, -1), led.code[:, lane].tolist(), led.lane[:, lane].tolist(), strict=True)
    return tuple(
        _still(state, direction, code)
        if flow < 0
        else _landing(led.flow.lane(flow), state, direction)
        for direction, code, flow in ways
    )


def _still(state: State, direction: int, code: int) -> Landing:
    """Landing where the state was not left."""
    if code == Ending.HELD:
        status, detail = "held", Ending.HELD.reason
    else:
        status, detail = "lost", "no step near the state, however short, could be solved"
    return Landing(status, direction, state, 0.0, state.batch, np.zeros(1), detail)


def _after_change(state: State, p: Float[np.ndarray, " parameters"]) -> Landing:
    """Landing of the shape of a state at other parameters."""
    structure = state.structure
    soft = soft_modes(structure, state.z[None], state.p[None])
    z, found = implicit_step(structure, state.z[None], p[None], 1e-4 / soft.stiffness)
    start = State(structure, z[0] if found[0] else state.z, p)
    if not found[0]:
        detail = "the shape could not be moved onto the constraints"
        return Landing("lost", 0, start, 0.0, start.batch, np.zeros(1), detail)
    return _landing(gradient_flow(structure, z, p[None], soft.stiffness, soft.length), start, 0)


def _landing(flow: Flow, start: State, direction: int) -> Landing:
    """Put together what the flow of a single lane brought."""
    structure, p = start.structure, start.p
    end = State(structure, flow.z[0], p)
    code = Ending(int(flow.code[0]))
    status, detail = STATUS[code], code.reason
    if status in {"landed", "saddle"} and not structure.resolved(end.z[None], end.p[None])[0]:
        status, detail = "unresolved", "the discretisation does not represent the state"
    way = States(structure, flow.points, np.tile(p, (len(flow.points), 1)))
    released = start.energy - end.energy
    return Landing(status, direction, end, released, way, flow.time, detail)
