"""Orbits of rods in space: states that may be turned about the axis of their clamps for nothing."""

from typing import Any

import numpy as np

from equimorph.arrays import Flags, Float, Lanes, Parameters
from equimorph.errors import InputError
from equimorph.structures.rod.natural import Part, follow
from equimorph.structures.spatial.ends import PLACES
from equimorph.structures.spatial.mechanics import SpatialMechanics
from equimorph.structures.spatial.natural import clamp_angles, natural_states
from equimorph.structures.spatial.phase import PinnedMechanics
from equimorph.structures.spatial.quaternions import (
    clamp_rotation,
    conjugate,
    exponential,
    matrices,
    product,
)
from equimorph.structures.states import State

TURN = 0.7
"""Angle in radians by which states are turned to see whether they stay equilibria."""
SAME = 1e-9
"""Residuals, angles, and moves of the rod, that are none."""
BEND, NEARLY = 0.2, 0.01
"""Angle in radians of both clamps that bends a straight rod to a side, on the way to a state; and
that from which the clamps are let go."""


def on_orbit(rod: SpatialMechanics, z: Lanes, p: Parameters) -> Flags:
    """Whether equilibria turned about a clamp's tangent a, sections turned back, are others.

    q → exp(a α/2) q exp(−e₁ α/2), and the forces of the supports with it.
    """
    node = 0 if rod.model.held[0] else -1
    axis = matrices(rod.rotations(z, p)[:, node])[..., 0]
    turn, back = exponential(TURN * axis), exponential(-TURN * np.eye(3)[0])
    moved, m = z.copy(), rod.constraints
    q = z[:, : rod.unknowns].reshape(len(z), rod.unknowns // 4, 4)
    spun = product(product(turn[:, None], q), back)
    moved[:, : rod.unknowns] = spun.reshape(len(z), rod.unknowns)
    held = rod.model.reaction[:, :m]
    forces = np.einsum("lck,lk->lc", matrices(turn), z[:, rod.unknowns :] @ held.T)
    moved[:, rod.unknowns :] = forces @ held
    balanced = np.abs(rod.residual(moved, p)).max(axis=1) < SAME + 2.0 * np.abs(
        rod.residual(z, p)
    ).max(axis=1)
    return np.asarray(balanced & (np.abs(spun - q).max(axis=(1, 2)) > np.sqrt(SAME)))


def pinned_natural_states(
    rod: PinnedMechanics,
    raw: SpatialMechanics,
    p: Parameters,
    given: Float[np.ndarray, "lanes others"],
) -> tuple[Lanes, Flags]:
    """Natural states that meet the phase condition, and which of them were found.

    Untwisted, both clamps are turned a little to bend the rod to the side of positive y, and back;
    then the rod is twisted. `given` are the parameters of `raw`, the rod without the condition.
    """
    names, own = raw.model.names, rod.model.names
    bent, start = given.copy(), p.copy()
    for name in ("twist_A", "twist_B"):
        if name in names:
            bent[:, names.index(name)] = 0.0
            start[:, own.index(name)] = 0.0
    if "nu" in names:
        for name, turn in (("theta_A", BEND), ("theta_B", -BEND)):
            if name in names:
                bent[:, names.index(name)] = turn
    let = bent.copy()
    let[:, [name.startswith("theta") for name in names]] *= NEARLY / BEND
    z, found = natural_states(raw, bent)
    z = _follow(raw, bent, let, z, found)
    z = _follow(rod, start, p, np.insert(z, raw.size, 0.0, axis=1), found)
    return z, found


def _follow(
    rod: SpatialMechanics,
    start: Float[np.ndarray, "lanes given"],
    stop: Float[np.ndarray, "lanes given"],
    z: Lanes,
    found: Flags,
) -> Lanes:
    """Found states at other parameters; `found` becomes false where the way ends before."""
    out, here = np.full_like(z, np.nan), np.flatnonzero(found)
    still = np.zeros(len(here), bool)
    part = Part(start[here], stop[here], free=False, sharpening=still, span=0)
    share, x = follow(rod, part, np.concatenate([z[here], start[here, :1]], axis=1))
    there = share >= 1.0
    out[here[there]] = x[there, :-1]
    found[here[~there]] = False
    return out


def pinned_guess(rod: PinnedMechanics, state: Any) -> tuple[Lanes, dict[str, float]]:
    """A state between coaxial clamps, turned as a whole to the x axis; and its clamps there.

    Its unknowns, and the parameters that place the clamps. Refused for anything but the state of a
    rod in space of the same resolution, between clamps that are not on one axis.
    """
    other = getattr(getattr(state, "structure", None), "mechanics", None)
    if not (isinstance(state, State) and isinstance(other, SpatialMechanics)):
        raise InputError(f"`state` must be a state of a rod in space; got {state!r}.")
    if other.unknowns != rod.unknowns or other.model.held != rod.model.held:
        raise InputError(
            "`state` must be one of a rod with the same resolution and supports; got "
            f"{other.unknowns // 4} free nodes and {rod.unknowns // 4} here."
        )
    z, p = state.z[None], state.p[None]
    q, nodes = other.rotations(z, p), {"A": 0, "B": -1}
    held = [side for side, on in zip("AB", rod.model.held, strict=True) if on]
    turn, tilt, _ = clamp_angles(q[:, nodes[held[0]]])
    whole = clamp_rotation(np.stack([turn, tilt, 0.0 * turn], axis=-1)[None])[0]
    q = product(conjugate(whole)[:, None], q)
    place = np.array([state.parameters.get(name, 0.0) for name in PLACES]) @ matrices(whole)[0]
    angles = [np.concatenate(clamp_angles(q[:, nodes[side]])) for side in held]
    off = max(*(np.abs(each[:2]).max() for each in angles), np.abs(place[1:]).max())
    if off > SAME:
        raise InputError(
            "`state` must be one between clamps on one axis; got clamps that are turned or moved "
            f"off it by {off:.3g}."
        )
    reaction, inner = rod.model.reaction[:, : rod.constraints], rod.model.unknown_nodes
    forces = other.support_forces(z, p) @ matrices(whole)[0]
    free = q[:, inner].reshape(1, rod.unknowns)
    found = {f"twist_{side}": float(each[2]) for side, each in zip(held, angles, strict=True)}
    return np.concatenate([free, forces @ reaction], axis=1), {**found, "nu": float(place[0])}
