"""The Lagrangian of a rod in space as the tables that its kernels read."""

from functools import cache

import numpy as np

from equimorph.array_types import Float, Int
from equimorph.structures.spatial.model import SpatialModel
from equimorph.structures.spatial.quaternions import PAIRS


def step_tables(
    model: SpatialModel, lengths: Float[np.ndarray, " unknown"]
) -> tuple[np.ndarray, ...]:
    """What `step_kernels.advance_lanes` shares among lanes.

    Nodes of elements stand in the order of elimination: inner ones, left, right. Tables of the
    scalars belong to those with entries only, whose numbers among (p, 1) come after each table.

    Parameters
    ----------
    model
        The rod.
    lengths
        Half the stiffness of the lengths of unknown quaternions.
    """
    mesh, m = model.mesh, model.multipliers
    places = np.array([*range(1, mesh.degree), 0, mesh.degree])
    slopes = mesh.reference.derivative / mesh.lengths[:, None, None]
    weights = mesh.element_weights[:, places]
    stiff = weights[..., None] * model.stiffness[:, places]
    whole = np.ones(len(mesh.nodes))
    whole[model.unknown_nodes] = lengths
    forces, force_picks = _used(model.force[m:, :, places])
    moments, moment_picks = _used(model.moment[m:, :, places] * weights[..., None])
    torsion, torsion_picks = _used(model.torsion[m:, :, places] * weights)
    axes, closing, compliance = _closures(model)
    softness = model.softness[:, places] if model.soft else model.softness[:0]
    # the kernel weights the axes of the cross-section, and so the forces
    tables = (
        places, slopes[:, places][:, :, places], weights, stiff, moments, moment_picks, torsion,
        torsion_picks, forces, force_picks, *_used(model.tension[m:, :, places]), softness,
        model.turned[:, :, m:].reshape(6, -1),
        np.array(model.held, dtype=np.int64), axes, closing, compliance, whole,
    )  # fmt: skip
    return tuple(np.ascontiguousarray(each) for each in tables)


def equation_tables(
    model: SpatialModel, lengths: Float[np.ndarray, " unknown"]
) -> tuple[np.ndarray, ...]:
    """What `derivative_kernels.equations_lanes` shares among lanes, after the pairs of its jets.

    `lengths` are those of `step_tables`.
    """
    whole = np.ones(len(model.mesh.nodes))
    whole[model.unknown_nodes] = lengths
    return *field_tables(model), whole, np.ascontiguousarray(model.quadratic[: model.multipliers])


def field_tables(model: SpatialModel) -> tuple[np.ndarray, ...]:
    """Stiffnesses, loads and clamps by all scalars, at the nodes of elements in their order."""
    mesh = model.mesh
    slopes = mesh.reference.derivative / mesh.lengths[:, None, None]
    softness = model.softness if model.soft else model.softness[:0]
    tables = (
        slopes, mesh.element_weights, model.stiffness, *_used(model.moment),
        *_used(model.torsion), *_used(model.force), *_used(model.tension), softness, model.turned,
        np.array(model.held, dtype=np.int64),
    )  # fmt: skip
    return tuple(np.ascontiguousarray(each) for each in tables)


@cache
def pairs_of(parts: int) -> tuple[Int[np.ndarray, "pairs 3"], Int[np.ndarray, "parts 3"]]:
    """Pairs of parts whose products make those of a jet; and of those with a constant."""
    rows = [(to, a, b) for to, pairs in enumerate(PAIRS[parts]) for a, b in pairs]
    return np.array(rows), np.array([(part, part, 0) for part in range(parts)])


def _used(rows: Float[np.ndarray, "scalars ..."]) -> tuple[np.ndarray, Int[np.ndarray, " used"]]:
    """Rows with entries, and their numbers."""
    picks = np.flatnonzero(np.abs(rows).reshape(len(rows), -1).max(axis=1) > 0.0)
    return rows[picks], picks


def _closures(
    model: SpatialModel,
) -> tuple[Int[np.ndarray, "3"], Float[np.ndarray, "3 scalars"], Float[np.ndarray, "3 3"]]:
    """Multiplier of each coordinate or −1, its row of the quadratic form, and the compliances."""
    m = model.multipliers
    axes, closing = np.full(3, -1), np.zeros((3, model.scalars - m))
    compliance = -np.eye(3)
    for k in range(m):
        axis = int(np.argmax(np.abs(model.force[k, 0, 0])))
        axes[axis] = k
        closing[axis] = model.quadratic[k, m:]
    held = np.flatnonzero(axes >= 0)
    compliance[np.ix_(held, held)] = model.quadratic[np.ix_(axes[held], axes[held])]
    return axes, closing, compliance
