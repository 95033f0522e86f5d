"""Random guesses of states of frames in space.

See docs/decisions.md, "Planar guesses in space".
"""

import numpy as np

from equimorph.arrays import Float
from equimorph.structures.space_frame.model import ON_LINE, SpatialFrameModel
from equimorph.structures.spatial.quaternions import exponential

FORCES = 10.0
"""Spread of the forces of random guesses, in units of bending stiffness over length squared."""
FLAT = 0.5
"""Share of the guesses of a plane frame that stay in its plane."""
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
    of the other guesses hardly one leads to most of them.
    """
    size = generator.uniform(size=(lanes, 1))
    turns = size[:, :, None] * _turns(model, lanes, generator)
    angles = size * generator.normal(size=(lanes, len(model.hinged)))
    forces = FORCES * size * generator.normal(size=(lanes, model.multipliers))
    normals = _normals(model)
    if len(normals):
        plane = generator.integers(len(normals), size=lanes)
        plane[generator.uniform(size=lanes) > FLAT] = -1
        for number, normal in enumerate(normals):
            flat = plane == number
            turns[flat] = (turns[flat] @ normal)[..., None] * normal
            angles[flat] *= _size(np.cross(model.hinge_axes, normal)) < NOTHING
            pulls = np.abs(model.starts[: model.multipliers] @ normal).max(axis=1)
            forces[flat] *= pulls < NOTHING * (1.0 + pulls.max(initial=0.0))
    return exponential(turns)[:, model.free], angles, forces


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


def _normals(model: SpatialFrameModel) -> Float[np.ndarray, "planes 3"]:
    """Normals of planes in which all joints lie: none, one, or two of those around a line."""
    away = model.network.places - model.network.places[0]
    _, sizes, axes = np.linalg.svd(away)
    return np.asarray(axes[np.append(sizes, np.zeros(3))[:3] <= ON_LINE * sizes[0]])


def _size(vectors: Float[np.ndarray, "many 3"]) -> Float[np.ndarray, " many"]:
    return np.asarray(np.linalg.norm(vectors, axis=1))
