"""Points where several eigenvalues vanish at once: a path has no direction of its own there."""

from dataclasses import replace

import numpy as np
from jaxtyping import Float, Int

from equimorph.equilibria.curves import Curve
from equimorph.equilibria.outcome import LOST, MULTIPLE, Outcome
from equimorph.structures import Structure
from equimorph.structures.margin import stability_margin

Lanes = Float[np.ndarray, "lanes size"]
Parameters = Float[np.ndarray, "lanes parameters"]
Counts = Int[np.ndarray, " lanes"]

VANISHED = 1e-4
"""Eigenvalue, relative to the smallest one at the start of the path, that counts as zero."""


def with_multiple_points(
    curve: Curve, start: Float[np.ndarray, "lanes extended"], outcome: Outcome
) -> Outcome:
    """The outcome with lanes that were lost at points of multiplicity two or more named so.

    One border row removes one null vector: where two eigenvalues vanish together, as symmetry or
    equal parts make them do, steps shrink until the lane is lost, within round-off of the point.
    The inertia of F_z ∓ εM counts the eigenvalues within ±ε.

    Parameters
    ----------
    curve, start
        Curves and unknowns at their beginning, one per lane.
    outcome
        How the lanes ended.
    """
    lost = np.flatnonzero(outcome.code == LOST)
    if len(lost) == 0 or not curve.folds_change_index:
        return outcome
    here, structure = curve.take(lost), curve.structure
    begun = here.states(start[lost], np.zeros(len(lost)))
    ended = here.states(outcome.z[lost], outcome.t[lost])
    size = np.abs(stability_margin(structure, *begun))
    count = multiplicity(structure, *ended, VANISHED * size)
    code, why = outcome.code.copy(), dict(outcome.why)
    for lane, several in zip(lost.tolist(), count.tolist(), strict=True):
        if several > 1:
            code[lane] = MULTIPLE
            why[lane] = (
                f"{several} eigenvalues vanish at once, and no direction leads on: an imperfection "
                "that parts them, however small, does"
            )
    return replace(outcome, code=code, why=why)


def multiplicity(
    structure: Structure, z: Lanes, p: Parameters, near: Float[np.ndarray, " lanes"]
) -> Counts:
    """Number of eigenvalues of the constrained Hessian, in the metric, within ±near of zero."""
    nothing = np.zeros((len(z), 0, structure.size))
    above, below = (structure.solve(z, p, nothing, shift=sign * near) for sign in (1.0, -1.0))
    return np.asarray(above.negative - below.negative)
