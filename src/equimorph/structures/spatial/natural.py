"""States of rods in space to begin from: natural ones, continued from the stress-free shape.

There are guesses from states of planar rods, too. States that may be turned about the axis of their
clamps for nothing lie on orbits; one of each is taken.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from equimorph.arrays import Bool, Flags, Float, Lanes, Parameters, Values
from equimorph.errors import InputError
from equimorph.structures.rod.natural import Outcome, Part, continue_ends, follow
from equimorph.structures.rod.planar_fields import Measured
from equimorph.structures.spatial.ends import PLACES
from equimorph.structures.spatial.mechanics import SpatialMechanics
from equimorph.structures.spatial.model import ANGLES
from equimorph.structures.spatial.phase import PinnedMechanics
from equimorph.structures.spatial.quaternions import (
    RIGHT,
    clamp_rotation,
    conjugate,
    exponential,
    matrices,
    product,
    turn_about,
)
from equimorph.structures.states import State

Rotations = Float[np.ndarray, "lanes 4"]
TURN = 0.7
"""Angle in radians by which states are turned to see whether they stay equilibria."""
SAME = 1e-9
"""Residuals, angles, and moves of the rod, that are none."""
BEND, NEARLY = 0.2, 0.01
"""Angle in radians of both clamps that bends a straight rod to a side, on the way to a state; and
that from which the clamps are let go."""


@dataclass(frozen=True, eq=False)
class Shape:
    """Stress-free shapes that begin at the origin with R = 1: rotations and places at all nodes."""

    rotations: Float[np.ndarray, "lanes nodes 4"]
    chord: Float[np.ndarray, "lanes 3"]

    def turned(self, by: Rotations) -> "Shape":
        """The same shapes, turned as a whole."""
        chord = np.einsum("lck,lk->lc", matrices(by), self.chord)
        return Shape(product(by[:, None], self.rotations), chord)


def natural_states(rod: SpatialMechanics, p: Parameters) -> tuple[Lanes, Flags]:
    """Unloaded states continued from the stress-free shape, and which were found.

    `rod` is in the parameters of `model.raw_names`. The shape lies with its chord along the line
    between the supports, or as its only clamp says. Between two clamps it is turned with the span
    free; then the ends move to where they belong.
    """
    start = np.where(_forces(rod), 0.0, p)
    shape = _stress_free(rod, start)
    shape = shape.turned(_orientation(rod, p, shape))
    z = np.zeros((len(p), rod.size))
    inner = rod.model.unknown_nodes
    z[:, : rod.unknowns] = shape.rotations[:, inner].reshape(len(p), rod.unknowns)

    def pulls(before: Parameters, after: Parameters) -> Flags:
        return _apart(rod, after) > _apart(rod, before)

    found = continue_ends(rod, z, _ends_of(rod, start, shape), p, pulls)
    return found.z, found.outcome == Outcome.FOUND


def _apart(rod: SpatialMechanics, p: Parameters) -> Values:
    """Distance of the ends, as far as it is prescribed."""
    at = [rod.model.names.index(name) for name in PLACES if name in rod.model.names]
    return np.asarray(np.linalg.norm(p[:, at], axis=1))


def _forces(rod: SpatialMechanics) -> Bool[np.ndarray, " parameters"]:
    """Which parameters are forces, that a stress-free rod lacks."""
    model = rod.model
    rows = [np.abs(each).reshape(model.scalars, -1).max(axis=1)
            for each in (model.force, model.tension, model.torsion)]  # fmt: skip
    return np.asarray((np.max(rows, axis=0) > 0.0)[model.multipliers : -1])


def _stress_free(rod: SpatialMechanics, p: Parameters) -> Shape:
    """Shapes with the intrinsic strains, by collocation: q' = ½ q u."""
    mesh, model = rod.mesh, rod.model
    y = np.concatenate([np.zeros((len(p), rod.constraints)), p, np.ones((len(p), 1))], axis=1)
    strain = np.einsum("ls,seik->leik", y, model.moment) / model.stiffness
    order = mesh.degree + 1
    q = np.zeros((len(p), len(mesh.nodes), 4))
    here, chord = np.tile(np.eye(4)[0], (len(p), 1)), np.zeros((len(p), 3))
    at = np.arange(order)
    for e, nodes in enumerate(mesh.element_nodes):
        matrix = np.zeros((len(p), order, 4, order, 4))
        matrix[:] = np.einsum("ij,ab->iajb", rod.slopes[e], np.eye(4))
        matrix[:, at, :, at] -= 0.5 * np.einsum("lik,kab->ilab", strain[:, e], RIGHT)
        matrix[:, 0] = 0.0
        matrix[:, 0, :, 0] = np.eye(4)
        rhs = np.zeros((len(p), order, 4))
        rhs[:, 0] = here
        flat = np.linalg.solve(
            matrix.reshape(len(p), 4 * order, 4 * order), rhs.reshape(len(p), 4 * order, 1)
        )
        local = flat.reshape(len(p), order, 4)
        local /= np.linalg.norm(local, axis=-1, keepdims=True)
        q[:, nodes], here = local, local[:, -1]
        chord += np.einsum("i,lic->lc", mesh.element_weights[e], matrices(local)[..., 0])
    return Shape(q, chord)


def _orientation(rod: SpatialMechanics, p: Parameters, shape: Shape) -> Rotations:
    """Turn of the stress-free shape as a whole."""
    values = dict(zip(rod.model.names, p.T, strict=True))
    if not all(rod.model.held):
        side, node = ("A", 0) if rod.model.held[0] else ("B", -1)
        angles = np.stack([values[f"{angle}_{side}"] for angle in ANGLES], axis=-1)
        return product(clamp_rotation(angles[None])[0], conjugate(shape.rotations[:, node]))
    length = np.linalg.norm(shape.chord, axis=1)
    given = [values.get(name, np.zeros(len(p))) for name in PLACES]
    if "nu" not in values:
        given[0] = np.sqrt(np.maximum(length**2 - given[1] ** 2 - given[2] ** 2, 0.0))
    return _shortest_turn(shape.chord, np.stack(given, axis=-1))


def _shortest_turn(
    source: Float[np.ndarray, "lanes 3"], target: Float[np.ndarray, "lanes 3"]
) -> Rotations:
    """Smallest rotation that takes one direction to another; none where one of them is zero."""
    a, b = (
        each / np.maximum(np.linalg.norm(each, axis=1, keepdims=True), 1e-300)
        for each in (source, target)
    )
    q = np.concatenate([1.0 + (a * b).sum(axis=1, keepdims=True), np.cross(a, b)], axis=1)
    size = np.linalg.norm(q, axis=1, keepdims=True)
    opposite = np.array([0.0, 0.0, 0.0, 1.0])
    return np.where(size > 1e-8, q / np.maximum(size, 1e-300), opposite)


def _ends_of(rod: SpatialMechanics, p: Parameters, shape: Shape) -> Parameters:
    """Parameters with the angles and places of the ends of shapes."""
    out = p.copy()
    for side, node in (("A", 0), ("B", -1)):
        q = shape.rotations[:, node]
        for angle, value in zip(ANGLES, clamp_angles(q), strict=True):
            if f"{angle}_{side}" in rod.model.names:
                out[:, rod.model.names.index(f"{angle}_{side}")] = value
    for k, name in enumerate(PLACES):
        if name in rod.model.names:
            out[:, rod.model.names.index(name)] = shape.chord[:, k]
    return out


def clamp_angles(q: Rotations) -> tuple[Values, Values, Values]:
    """Angles (a, b, τ) of rotations, with τ from −π to 3π such that they give q and not −q."""
    r = matrices(q)
    turn, tilt = np.arctan2(r[:, 1, 0], r[:, 0, 0]), -np.arcsin(np.clip(r[:, 2, 0], -1.0, 1.0))
    twist = np.arctan2(r[:, 2, 1], r[:, 2, 2])
    again = clamp_rotation(np.stack([turn, tilt, twist], axis=-1)[None])[0]
    return turn, tilt, twist + 2.0 * np.pi * ((again * q).sum(axis=1) < 0.0)


def planar_guess(mechanics: SpatialMechanics, state: Any) -> Lanes:
    """Unknowns with the angles and support forces of a planar rod's state; others are refused."""
    if not (isinstance(state, State) and isinstance(state.structure, Measured)):
        raise InputError(f"`state` must be a state of a planar rod; got {state!r}.")
    rod = state.structure
    z, p = state.z[None], state.p[None]
    nodes = mechanics.mesh.nodes[mechanics.model.unknown_nodes]
    angles = rod.fields(z, p, nodes)[:, :, 0]
    q = turn_about(angles[None], np.array([0.0, 0.0, 1.0]))[0]
    along = np.append(rod.mechanics.support_forces(z, p)[0], 0.0)
    m = mechanics.constraints
    held = mechanics.model.reaction[:, :m]  # which coordinate each multiplier belongs to
    return np.concatenate([q.reshape(1, mechanics.unknowns), (along @ held)[None]], axis=1)


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
