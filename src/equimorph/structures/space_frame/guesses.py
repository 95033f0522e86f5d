"""Random guesses of states of frames in space.

See docs/decisions.md, "Planar guesses in space" and "Guesses wind".
"""

import numpy as np

from equimorph.arrays import Bool, Float
from equimorph.structures.space_frame.model import SpatialFrameModel
from equimorph.structures.space_frame.network import Turning
from equimorph.structures.spatial.quaternions import exponential, product, turn_about
from equimorph.structures.spatial.windings import (
    FLATTER,
    WINDING,
    are_wound,
    random_axes,
)

FORCES = 10.0
"""Spread of the forces of random guesses, in units of bending stiffness over length squared."""
FLAT = 0.5
"""Share of the guesses of a plane frame that stay in its plane."""
TWICE = 1.0 / 3.0
"""Share of the guesses that wind in which a piece winds by 4π, where the elements resolve that."""
NOTHING = 1e-9
"""Component of an axis or a force, of length one, that is none."""

Guesses = tuple[
    Float[np.ndarray, "lanes free 4"],
    Float[np.ndarray, "lanes hinges"],
    Float[np.ndarray, "lanes multipliers"],
]
"""Rotations of the free nodes, angles of hinges, and multipliers."""


def random_guesses(model: SpatialFrameModel, lanes: int, generator: np.random.Generator) -> Guesses:
    """Random turns of the bodies, waves along the members, angles of hinges, and forces.

    Where all joints lie in a plane, half of the guesses stay in it: states that do are common, and
    of the other guesses hardly one leads to most of them. Where the elements resolve it, members
    wind about an axis in some of each.
    """
    size = generator.uniform(size=(lanes, 1))
    turns = size[:, :, None] * _turns(model, lanes, generator)
    angles = size * generator.normal(size=(lanes, len(model.hinged)))
    forces = FORCES * size * generator.normal(size=(lanes, model.multipliers))
    plane = np.full(lanes, -1)
    if len(model.normals):
        plane = generator.integers(len(model.normals), size=lanes)
        plane[generator.uniform(size=lanes) > FLAT] = -1
        for number, normal in enumerate(model.normals):
            flat = plane == number
            turns[flat] = (turns[flat] @ normal)[..., None] * normal
            angles[flat] *= _size(np.cross(model.hinge_axes, normal)) < NOTHING
            pulls = np.abs(model.starts[: model.multipliers] @ normal).max(axis=1)
            forces[flat] *= pulls < NOTHING * (1.0 + pulls.max(initial=0.0))
    if model.most_half_windings == 0:
        return exponential(turns)[:, model.free], angles, forces
    wound, axes = are_wound(plane >= 0, generator), random_axes(lanes, generator)
    for number, normal in enumerate(model.normals):
        axes[plane == number] = normal
    turns[wound] *= FLATTER
    q = exponential(turns)
    q[wound] = _wound(model, q[wound], axes[wound], generator)
    return q[:, model.free], angles, forces


def _wound(
    model: SpatialFrameModel,
    q: Float[np.ndarray, "lanes nodes 4"],
    axes: Float[np.ndarray, "lanes 3"],
    generator: np.random.Generator,
) -> Float[np.ndarray, "lanes nodes 4"]:
    """Rotations with pieces that wind about axes: by 2π between q and −q of bodies, else by 4π."""
    flipped = _flipped(model, len(q), generator)
    ends = model.piece_nodes[:, [0, -1]]
    half = (flipped[:, ends[:, 0]] ^ flipped[:, ends[:, 1]]).astype(int)
    if model.most_half_windings > 1:
        twice = generator.integers(model.pieces, size=len(q))
        some = np.flatnonzero(~half.any(axis=1) | (generator.uniform(size=len(q)) < TWICE))
        half[some, twice[some]] += 2
    half *= generator.choice([-1, 1], size=half.shape)
    sign = np.where(flipped, -1.0, 1.0)
    for piece, row in enumerate(model.piece_nodes):
        along = 0.5 * WINDING * half[:, piece, None] * model.mesh.nodes[1:-1]
        around = turn_about(along[None], axes[:, None])[0]
        q[:, row[1:-1]] = product(q[:, row[1:-1]], around) * sign[:, row[0], None, None]
    q[:, : len(model.network.bodies)] *= sign[..., None]
    return q


def _flipped(
    model: SpatialFrameModel, lanes: int, generator: np.random.Generator
) -> Bool[np.ndarray, "lanes bodies"]:
    """Bodies with the quaternion −q: one that is free and, rarely, others; and their hinges."""
    bodies = np.array([body.turning for body in model.network.bodies])
    flipped, free = np.zeros((lanes, len(bodies)), bool), np.flatnonzero(bodies == Turning.FREE)
    if len(free):
        flipped[:, free] = generator.uniform(size=(lanes, len(free))) < 1.0 / len(free)
        flipped[np.arange(lanes), generator.choice(free, size=lanes)] = True
    flipped[:, model.hinged] = flipped[:, model.parents]
    return flipped


def _turns(
    model: SpatialFrameModel, lanes: int, generator: np.random.Generator
) -> Float[np.ndarray, "lanes nodes 3"]:
    """Rotation vectors of all nodes: those of bodies, and waves between these."""
    vectors = np.zeros((lanes, len(model.turning), 3))
    bodies = len(model.network.bodies)
    vectors[:, :bodies] = 0.5 * generator.normal(size=(lanes, bodies, 3))
    s, modes = model.mesh.nodes, np.arange(1, 4)
    for row in model.piece_nodes:
        ends = vectors[:, row[[0, -1]]]
        amplitude = generator.normal(size=(lanes, 3, 3)) * (1.0 / modes)[:, None]
        waves = np.einsum("nm,lmk->lnk", np.sin(np.pi * np.outer(s, modes)), amplitude)
        base = ends[:, :1] * (1.0 - s)[:, None] + ends[:, 1:] * s[:, None]
        vectors[:, row[1:-1]] = (base + waves)[:, 1:-1]
    return vectors


def _size(vectors: Float[np.ndarray, "many 3"]) -> Float[np.ndarray, " many"]:
    return np.asarray(np.linalg.norm(vectors, axis=1))
