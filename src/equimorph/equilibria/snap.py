"""Snap landing: where a structure goes when it loses stability.

See docs/decisions.md, "Snap landings are gradient flows".
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from equimorph.arrays import Lanes
from equimorph.equilibria import gradient_flow as flows
from equimorph.equilibria.gradient_flow import Flow, gradient_flow, implicit_step, metric_length
from equimorph.equilibria.lift import check_start
from equimorph.errors import InputError
from equimorph.model import parameter_vector
from equimorph.structures import State, States, Structure

Mode = Float[np.ndarray, " unknowns"]

CRITICAL = 1e-6
"""Stability margin up to which a state without negative eigenvalues may be left."""
NUDGES = (1e-2, 1e-3, 1e-4)
"""Distances from the start along its eigenvector, in the metric, from which the flow is tried."""
SHORTER = (1.0, 0.1, 0.01, 0.001)
"""Lengths of steps there, relative to the longest."""
RELAXATIONS = 4
"""Steps in which stiff modes come to rest before it is asked whether a nudge grows."""
INVERSE_ITERATIONS = 4
"""Inverse iterations for the mode of the smallest eigenvalue; the shift is close to it, so that
each reduces the error by several orders of magnitude."""

STATUS = {
    flows.LANDED: "landed",
    flows.SADDLE: "saddle",
    flows.ESCAPED: "escaped",
    flows.STUCK: "lost",
    flows.SLOW: "lost",
}


@dataclass(frozen=True, eq=False)
class Landing:
    """Where a snap leads in one direction.

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
        Energy before the snap less the energy after, at the same parameters.
    way
        Configurations on the way, which are no equilibria; for shapes and energies.
    time
        Of the way; scale: square of the metric's unit over energy, for a mobility of one.
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


def snap_landing(state: State, *, at: Mapping[str, float] | None = None) -> tuple[Landing, ...]:
    """Stable states that a structure reaches from a state that it cannot keep.

    Gradient flow ``M u̇ = −∂L/∂u`` in the structure's metric, on the constraints, at constant
    parameters: implicit Euler steps, as long as their error allows, along which the energy falls;
    the end is polished by Newton, and its index verified. This is the landing of an overdamped
    structure; with little damping others may be reached.

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
    soft = _Softest.of(state)
    starts = {direction: _start(state, soft, direction) for direction in (1, -1)}
    leaving = {direction: z for direction, (z, _) in starts.items() if z is not None}
    landings = {way: _still(state, way, told=told) for way, (_, told) in starts.items()}
    if leaving:
        p = np.tile(state.p, (len(leaving), 1))
        rate = np.full(len(leaving), soft.rate)
        flow = gradient_flow(structure, np.concatenate(list(leaving.values())), p, rate)
        for lane, direction in enumerate(leaving):
            landings[direction] = _landing(flow.lane(lane), state, direction)
    return tuple(landings.values())


@dataclass(frozen=True)
class _Softest:
    """Smallest eigenvalue of the constrained Hessian, its mode of length one, and the next.

    stiffness: about the size of the other eigenvalues.
    """

    eigenvalue: float
    mode: Mode
    stiffness: float

    @classmethod
    def of(cls, state: State) -> "_Softest":
        """By inverse iteration just below the eigenvalue; the sign of the mode is fixed."""
        structure, n = state.structure, state.structure.unknowns
        generic = np.cos(1.7 * np.arange(n)) + 1.3
        eigenvalue = state.margin
        # a shift equal to the eigenvalue would be singular
        shift = eigenvalue - 1e-4 * max(abs(eigenvalue), 1e-3)
        mode = generic
        for _ in range(INVERSE_ITERATIONS):
            mode = _unit(structure, _applied(state, mode, shift))
        mode = mode * np.copysign(1.0, generic @ (structure.mass * mode))
        rest = generic - (generic @ (structure.mass * mode)) * mode
        response = _applied(state, rest, shift)
        response -= (response @ (structure.mass * mode)) * mode
        size, answer = (metric_length(structure, v[None])[0] for v in (rest, response))
        # nothing is left beside the mode if it is the only way to move
        stiffness = size / answer if answer > 1e-6 * size else 0.0
        return cls(eigenvalue, mode, float(max(stiffness, abs(eigenvalue))))

    @property
    def rate(self) -> float:
        """Scale of the inverse of time."""
        return self.stiffness if self.stiffness > CRITICAL else 1.0


def _applied(state: State, vector: Mode, shift: float) -> Mode:
    """Solve (F_z − shift·M) x = M·vector for the unknowns."""
    structure, n = state.structure, state.structure.unknowns
    rhs = np.zeros((1, 1, structure.size))
    rhs[0, 0, :n] = structure.mass * vector
    solution = structure.solve(state.z[None], state.p[None], rhs, shift=np.array([shift]))
    return np.asarray(solution.x[0, 0, :n])


def _unit(structure: Structure, vector: Mode) -> Mode:
    return np.asarray(vector / metric_length(structure, vector[None])[0])


def _start(state: State, soft: _Softest, direction: int) -> tuple[Lanes | None, bool]:
    """Configuration from which the flow leaves along, or against, the softest mode, if it does.

    Also whether a flow beside the state could be followed at all. Steps that cannot be solved,
    because the energy bends down within them, are tried again shorter.
    """
    # stiff modes relax, the soft one is not amplified much
    longest = min(10.0 / soft.rate, 0.3 / max(abs(soft.eigenvalue), 1e-300))
    told = False
    for size in NUDGES:
        moved = (_nudged(state, soft, direction * size, longest * each) for each in SHORTER)
        z, away = next((found for found in moved if found is not None), (None, 0.0))
        if away > 0.0:
            return z, True
        told = told or z is not None
    return None, told


def _still(state: State, direction: int, *, told: bool) -> Landing:
    """Nothing moves, as far as can be told."""
    status, detail = (
        ("held", "the energy rises in this direction")
        if told
        else ("lost", "no step beside the state, however short, could be solved")
    )
    return Landing(status, direction, state, 0.0, state.batch, np.zeros(1), detail)


def _nudged(state: State, soft: _Softest, size: float, h: float) -> tuple[Lanes, float] | None:
    """Configuration beside the state on the constraints, and how fast the flow leads away there.

    None if a step of length h cannot be solved.
    """
    structure, n, p = state.structure, state.structure.unknowns, state.p[None]
    z = state.z[None].copy()
    z[0, :n] += size * soft.mode
    for _ in range(RELAXATIONS):
        before = z
        z, solved = implicit_step(structure, z, p, np.array([h]))
        if not solved[0]:
            return None
    away = (z - before)[0, :n] @ (structure.mass * soft.mode)
    return z, float(np.sign(size) * away)


def _after_change(state: State, p: Float[np.ndarray, " parameters"]) -> Landing:
    """Landing of the shape of a state at other parameters."""
    structure, rate = state.structure, np.array([_Softest.of(state).rate])
    z, found = implicit_step(structure, state.z[None], p[None], 1e-4 / rate)
    start = State(structure, z[0] if found[0] else state.z, p)
    if not found[0]:
        detail = "the shape could not be moved onto the constraints"
        return Landing("lost", 0, start, 0.0, start.batch, np.zeros(1), detail)
    return _landing(gradient_flow(structure, z, p[None], rate), start, 0)


def _landing(flow: Flow, start: State, direction: int) -> Landing:
    """Put together what the flow of a single lane brought."""
    structure, p = start.structure, start.p
    end = State(structure, flow.z[0], p)
    code = int(flow.code[0])
    status, detail = STATUS[code], flows.WHY[code]
    if status in {"landed", "saddle"} and not structure.resolved(end.z[None], end.p[None])[0]:
        status, detail = "unresolved", "the discretisation does not represent the state"
    way = States(structure, flow.points, np.tile(p, (len(flow.points), 1)))
    released = start.energy - end.energy
    return Landing(status, direction, end, released, way, flow.time, detail)
