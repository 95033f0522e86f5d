"""Descents: where the energy leads from unstable states, both ways along the softest mode.

See docs/decisions.md, "Descents measure lengths by the soft mode".
"""

from dataclasses import dataclass

import numpy as np

from equimorph.arrays import Flags, Float, Int, Lanes, Parameters, Values
from equimorph.equilibria.gradient_flow import (
    QUICK,
    Ending,
    Flow,
    Pace,
    gradient_flow,
    implicit_step,
)
from equimorph.equilibria.soft_modes import Modes, SoftModes, soft_modes
from equimorph.linalg import multiply
from equimorph.structures import Structure
from equimorph.structures.metric import metric_length

NUDGES = (0.002, 0.02, 0.2)
"""Distances from the start along its mode, in lengths of the mode, from which the flow is tried.

The largest one counts that leads away as all smaller ones do: beyond a fold, where the energy
rises at first, a larger one may step over a low barrier.
"""
SHORTER = (1.0, 0.1, 0.01, 0.001)
"""Lengths of steps there, relative to the longest."""
ASIDE = 4.0
"""Distance from the state at which stiff modes are at rest, in nudges, at most."""
RELAXATIONS = 4
"""Steps in which stiff modes come to rest before the growth of a nudge is judged."""


@dataclass(frozen=True)
class Descents:
    """Where flows from states ended: in the first row along the softest mode, then against it."""

    code: Int[np.ndarray, "2 lanes"]
    """`Ending` of each flow."""
    z: Float[np.ndarray, "2 lanes size"]
    """Where it ended; the state itself where nothing moves."""
    soft: SoftModes
    """Softest modes of the states."""
    flow: Flow
    """The way of the flows that left, each in a separate lane."""
    lane: Int[np.ndarray, "2 lanes"]
    """Lane in `flow` of each descent; −1 where nothing left."""


def descend(
    structure: Structure,
    z: Lanes,
    p: Parameters,
    pace: Pace = QUICK,
    nudges: tuple[float, ...] = NUDGES,
) -> Descents:
    """Follow the energy downwards from equilibria, both ways along their softest modes.

    The first steps are shares of the length of the mode, so that wells are found however narrow
    they are. All flows advance in one batch.
    """
    soft = soft_modes(structure, z, p)
    twice = np.tile(np.arange(len(z)), 2)
    modes = np.concatenate([soft.mode, -soft.mode])
    start = _starts(structure, z[twice], p[twice], soft.take(twice), modes, nudges)
    left = np.flatnonzero(start.leaves)
    rate, moved = soft.rate[twice[left]], start.moved[left]
    flow = gradient_flow(structure, start.z[left], p[twice[left]], rate, moved, pace)
    code = np.where(start.solved, Ending.HELD.value, Ending.STUCK.value)
    ends, lane = z[twice], np.full(len(twice), -1)
    code[left], ends[left], lane[left] = flow.code, flow.z, np.arange(len(left))
    shape = (2, len(z))
    return Descents(code.reshape(shape), ends.reshape(*shape, -1), soft, flow, lane.reshape(shape))


@dataclass(frozen=True)
class _Starts:
    """Starting points of flows, their distances, whether they leave, and whether that is known."""

    z: Lanes
    moved: Values
    leaves: Flags
    solved: Flags


def _starts(
    structure: Structure,
    z: Lanes,
    p: Parameters,
    soft: SoftModes,
    modes: Modes,
    nudges: tuple[float, ...],
) -> _Starts:
    """Configurations near states from which the flow leads away, along modes.

    Steps that cannot be solved, because the energy bends down within them, are tried again shorter.
    """
    # stiff modes relax, the soft one is not amplified much
    growth = np.maximum(np.abs(soft.eigenvalue), 1e-300)
    longest = np.minimum(10.0 / soft.stiffness, 0.3 / growth)
    start, leaves, told, back = z.copy(), *np.zeros((3, len(z)), bool)
    length = np.zeros(len(z))
    for size in nudges:
        todo = np.flatnonzero(~back)
        for shorter in SHORTER:
            if len(todo) == 0:
                break
            nudge = size * soft.length[todo, None] * modes[todo]
            h = shorter * longest[todo]
            moved, away, solved = _relax(structure, z[todo], p[todo], nudge, h)
            told[todo[solved]] = True
            back[todo[solved & (away <= 0.0)]] = True
            gone = todo[solved & (away > 0.0)]
            leaves[gone], start[gone] = True, moved[solved & (away > 0.0)]
            length[gone] = size * soft.length[gone]
            todo = todo[~solved]
    return _Starts(start, length, leaves, told)


def _relax(
    structure: Structure, z: Lanes, p: Parameters, nudge: Modes, h: Values
) -> tuple[Lanes, Values, Flags]:
    """Configurations near states on the constraints, and the speed of the flow away from there.

    The last says where all steps of length h were solved and stayed there.
    """
    n, moved = structure.unknowns, z.copy()
    moved[:, :n] += nudge
    solved = np.ones(len(z), bool)
    for _ in range(RELAXATIONS):
        before = moved
        moved, good = implicit_step(structure, moved, p, h)
        solved &= good
    size, allowed = (metric_length(structure, du) for du in ((moved - z)[:, :n], ASIDE * nudge))
    solved &= size <= allowed
    onwards = multiply((moved - before)[:, :n] * nudge, structure.mass)
    return moved, onwards, solved
