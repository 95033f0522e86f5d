"""The phase condition of rods between coaxial clamps, and what keeps rods from having orbits."""

from dataclasses import replace

import numpy as np

from equimorph.arrays import Float, Values
from equimorph.errors import InputError
from equimorph.linalg.dense import multiply
from equimorph.structures.spatial.model import ANGLES, SpatialModel
from equimorph.tolerances import SAME_NUMBER

ACROSS = tuple(f"{angle}_{side}" for side in "AB" for angle in ANGLES[:2])
BROKEN_BY = (*ACROSS, "rise", "sideways")
"""Parameters that a rod with a phase condition does not have: they move a clamp off the axis."""


def phase_weight(s: Float[np.ndarray, "..."]) -> Float[np.ndarray, "..."]:
    """g(s): positive, and not symmetric, so that modes of either symmetry have a phase.

    With both ends on the axis, c is the mean of z with the weight −g' = 1 + (1 − 2s)/2.
    """
    return np.asarray(2.0 - s - 0.5 * s * (1.0 - s))


def phase_of(q: Float[np.ndarray, "lanes n 4"], weights: Float[np.ndarray, " n"]) -> Values:
    """Angle from what the condition picks, −π/2 to π/2; weights: of g at the nodes."""
    a, b, c, d = np.moveaxis(q, -1, 0)
    square, by = a * a + b * b + c * c + d * d, weights[:, None]
    left, aside = (multiply(t / square, by)[:, 0] for t in (b * c + a * d, b * d - a * c))
    side = np.where(left < 0.0, -1.0, 1.0)
    return np.asarray(np.arctan2(side * aside, side * left))


def with_phase_condition(model: SpatialModel) -> SpatialModel:
    """The rod with one more multiplier, the last: of the phase condition."""
    m = model.multipliers
    mesh = model.mesh
    row = np.zeros_like(model.force[0])
    row[..., 2] = phase_weight(mesh.nodes[mesh.element_nodes])

    def widen(rows: np.ndarray, axis: int) -> np.ndarray:
        return np.insert(rows, m, 0.0, axis=axis)

    force = widen(model.force, 0)
    force[m] = row
    return replace(
        model,
        multipliers=m + 1,
        force=force,
        moment=widen(model.moment, 0),
        tension=widen(model.tension, 0),
        torsion=widen(model.torsion, 0),
        quadratic=widen(widen(model.quadratic, 0), 1),
        turned=widen(model.turned, 2),
        reaction=widen(model.reaction, 1),
        origin=widen(model.origin, 1),
    )


def check_orbits(model: SpatialModel) -> None:
    """Refuse a rod whose states cannot be turned about the x axis for nothing, with the reason."""
    reason = obstacle(model) or _obstacle_by_parameters(model)
    if reason:
        raise InputError(
            "`phase` must be False unless every state may be turned about the x axis for nothing; "
            f"got {reason}."
        )


def obstacle(model: SpatialModel) -> str:
    """What of section and supports keeps states from being turned; empty if nothing does."""
    m = model.multipliers
    if not _same(model.stiffness[..., 1], model.stiffness[..., 2]):
        return "bending stiffnesses that differ: `lateral` is not 1"
    if not _same(model.softness[..., 1], model.softness[..., 2]):
        return "stiffnesses against shear that differ"
    held = np.abs(model.force[:m, 0, 0, :]).max(axis=0, initial=0.0)
    if held[1] != held[2] or _compliance(model, 1) != _compliance(model, 2):
        return "supports that hold y and z in different ways"
    return ""


def _obstacle_by_parameters(model: SpatialModel) -> str:
    """What of the parameters, or of the constant part, keeps states from being turned."""
    m = model.multipliers
    names = (*model.names, "")
    rows = np.concatenate([breaking_scalars(model), model.turned[:, 0]])
    at = np.flatnonzero(np.abs(rows[:, m:]).max(axis=0, initial=0.0) > SAME_NUMBER)
    if len(at) == 0:
        return ""
    return f"{names[at[0]]}, which acts across the axis" if names[at[0]] else "intrinsic curvature"


def breaking_scalars(model: SpatialModel) -> Float[np.ndarray, "some scalars"]:
    """Combinations of the scalars that are zero where states can be turned about the x axis.

    Beside these, the clamps' angles in the plane have to be multiples of 2π.
    """
    m, count = model.multipliers, model.scalars
    force = model.force[..., 1:].reshape(count, -1).T.copy()
    force[:, :m] = 0.0
    moment = model.moment[..., 1:].reshape(count, -1).T
    places = model.quadratic[:m].copy()
    places[np.abs(model.force[:m, 0, 0, 1:]).max(axis=1) == 0.0] = 0.0
    places[:, :m] = 0.0
    rows = np.concatenate([force, moment, model.turned[:, 1], places])
    rows = rows / np.maximum(np.abs(rows).max(axis=1, keepdims=True), 1e-300)
    _, size, basis = np.linalg.svd(rows, full_matrices=False)
    return np.asarray(basis[size > SAME_NUMBER * size.max(initial=1e-300)])


def _compliance(model: SpatialModel, axis: int) -> float:
    """Compliance of the supports along y or z together."""
    rows = np.flatnonzero(model.force[: model.multipliers, 0, 0, axis])
    return float(sum(model.quadratic[k, k] for k in rows))


def _same(a: np.ndarray, b: np.ndarray) -> bool:
    return bool(np.abs(a - b).max() <= SAME_NUMBER * np.abs(a).max(initial=1e-300))
