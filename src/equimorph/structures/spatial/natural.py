"""States of rods in space to begin from: natural ones, continued from the stress-free shape.

And guesses from states of planar rods.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from equimorph.arrays import Bool, Flags, Float, Lanes, Parameters, Values
from equimorph.errors import InputError
from equimorph.structures.rod.natural import Outcome, continue_ends
from equimorph.structures.rod.planar_fields import Measured
from equimorph.structures.spatial.ends import PLACES
from equimorph.structures.spatial.mechanics import SpatialMechanics
from equimorph.structures.spatial.model import ANGLES
from equimorph.structures.spatial.quaternions import (
    RIGHT,
    clamp_rotation,
    conjugate,
    matrices,
    product,
    turn_about,
)
from equimorph.structures.states import State

Rotations = Float[np.ndarray, "lanes 4"]


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
