"""Frames in space on one line whose states may be turned about it for nothing.

Members along a line, as stiff in all directions across it, with supports and loads that do not
tell these apart: the turn R about the line takes a state with turns w of its nodes to one with
R w R⁻¹, of the same energy. Off the line equilibria lie in orbits then, F_z is singular along
these, and the sign of the eigenvalue that belongs to them is one of round-off. So there a weak
spring `SPRING` is added to F_z: index and determinant are those across the orbit. Round-off over
the spring may move a path along its orbit, on which all states are alike; margins are 0. Searches
and sets refuse such parameters.
See docs/decisions.md, "Orbits of frames get a weak spring".
"""

import numpy as np

from equimorph.arrays import Flags, Float, Lanes, Parameters, Scalars
from equimorph.structures.equations import Shift
from equimorph.structures.space_frame.mechanics import SpatialFrameMechanics
from equimorph.structures.spatial.quaternions import exponential, product

SAME = 1e-9
"""Change of energies, and error of places, by a turn that changes nothing, relative to them."""
OFF = 1e-8
"""Change of a quaternion by a turn, above which a state lies off the line."""
SPRING = 1e-7
"""Stiffness of the spring in the metric, in units of bending: far above round-off, 1e-13 there. A
critical load moves by as much, relative to it."""
TURN = 1.0
"""Angle of the turn, in radians: a turn by this angle is not among finitely many symmetries."""


def turn_for_nothing(frame: SpatialFrameMechanics, p: Parameters) -> Flags:
    """Whether a turn of any state about the line of a frame changes nothing, at parameters.

    By some random states at each of these: energies without multipliers stay as they are.
    """
    line = frame.model.line
    if line is None:
        return np.zeros(len(p), bool)
    count = 2 * frame.constraints + 3
    many = p.repeat(count, axis=0)
    z = frame.sample(many, np.random.default_rng(0))
    forces = z[:, frame.unknowns :].copy()
    z[:, frame.unknowns :] = 0.0
    pair = z, turned(frame, z, TURN * line)
    energies = np.stack([frame.energy(each, many) for each in pair]).reshape(2, len(p), count)
    change, size = np.abs(energies[1] - energies[0]).max(axis=1), np.abs(energies).max(axis=(0, 2))
    same = np.asarray(change <= SAME * size)
    for lane in np.flatnonzero(same) if frame.constraints else []:
        some = slice(lane * count, (lane + 1) * count)
        states = pair[0][some], pair[1][some]
        same[lane] = closes_alike(frame, states, forces[some], many[some])
    return same


def springs_on_orbits(frame: SpatialFrameMechanics, z: Lanes, p: Parameters) -> Shift:
    """Shifts of the spectrum that take the direction of orbits out of the inertia, or none."""
    on = on_orbits(frame, z, p)
    return np.where(on, -SPRING, 0.0) if on.any() else None


def on_orbits(frame: SpatialFrameMechanics, z: Lanes, p: Parameters) -> Flags:
    """Whether states may be turned about the line for nothing, and would move."""
    line = frame.model.line
    if line is None:
        return np.zeros(len(z), bool)
    on = np.asarray(np.abs(turned(frame, z, TURN * line) - z).max(axis=1) > OFF)
    on[on] = turn_for_nothing(frame, p[on])
    return on


def rates_on_orbits(frame: SpatialFrameMechanics, z: Lanes, p: Parameters) -> Lanes:
    """Rates of quaternions by a turn about the line; 0 off orbits."""
    rates, on = np.zeros_like(z), on_orbits(frame, z, p)
    line = frame.model.line
    if line is not None:
        around = np.zeros((len(z), len(frame.model.free), 4))
        around[..., 1:] = np.cross(line, frame.quaternions(z)[..., 1:])
        rates[on, : around[0].size] = around[on].reshape(on.sum(), around[0].size)
    return rates


def turned(frame: SpatialFrameMechanics, z: Lanes, vector: Float[np.ndarray, "3"]) -> Lanes:
    """States with R w R⁻¹ in place of the turns w, as to the rest the same."""
    out, rows = z.copy(), 4 * len(frame.model.free)
    turn = exponential(vector)
    back = turn * [1.0, -1.0, -1.0, -1.0]
    out[:, :rows] = product(product(turn, frame.quaternions(z)), back).reshape(len(z), rows)
    return out


def closes_alike(
    frame: SpatialFrameMechanics, pair: tuple[Lanes, Lanes], forces: Scalars, p: Parameters
) -> bool:
    """Whether what does not close turns like a vector B, and multipliers by B⁻ᵀ, so that L stays.

    pair: states and turned ones without multipliers; forces: those that are then given to them.
    """
    rows = slice(frame.unknowns, None)
    before, after = (residual(frame, each, p)[:, rows] for each in pair)
    matrix = np.linalg.lstsq(before, after, rcond=None)[0]
    if np.abs(before @ matrix - after).max() > SAME * np.abs(before).max():
        return False
    states, images = (each.copy() for each in pair)
    states[:, rows], images[:, rows] = forces, forces @ np.linalg.pinv(matrix).T
    before, after = (residual(frame, each, p)[:, rows] for each in (states, images))
    return bool(np.abs(before @ matrix - after).max() <= SAME * np.abs(before).max())


def residual(frame: SpatialFrameMechanics, z: Lanes, p: Parameters) -> Lanes:
    """F, without a look at orbits."""
    return SpatialFrameMechanics.linearised(frame, z, p, np.zeros_like(p))[0]
