"""Points where several eigenvalues vanish at once: a path has no direction of its own there."""

from dataclasses import replace

import numpy as np
from jaxtyping import Float, Int

from equimorph.arrays import Lanes, Parameters, Values
from equimorph.equilibria.curves import Curve
from equimorph.equilibria.outcome import LOST, MULTIPLE, Outcome
from equimorph.equilibria.tracing import FOLD
from equimorph.structures import Structure

Counts = Int[np.ndarray, " lanes"]

VANISHED, LOCATED = 1e-4, 1e-8
"""Eigenvalue, relative to the small ones at the start of the path, that counts as zero; that of a
simple fold where it is located."""
AT_ONCE = 1024
"""Lanes looked at together, so that memory does not grow with all of them."""


def with_multiple_points(
    curve: Curve, start: Float[np.ndarray, "lanes extended"], outcome: Outcome
) -> Outcome:
    """The outcome with lanes that ended at points of multiplicity two or more named so.

    One border row removes one null vector: where two eigenvalues vanish together, as symmetry or
    equal parts make them do, steps shrink until the lane is lost, within round-off of the point,
    or it ends as at a fold if their number is odd. The inertia of F_z ∓ εM counts the eigenvalues
    within ±ε. A fold with another small eigenvalue is located to round-off: one vanishes alone.

    Parameters
    ----------
    curve, start
        Curves and unknowns at their beginning, one per lane.
    outcome
        How the lanes ended.
    """
    ended = np.flatnonzero(np.isin(outcome.code, (LOST, FOLD)))
    if len(ended) == 0 or not curve.folds_change_index:
        return outcome
    code, why = outcome.code.copy(), dict(outcome.why)
    for first in range(0, len(ended), AT_ONCE):
        some = ended[first : first + AT_ONCE]
        for lane, several in zip(some.tolist(), _several(curve, start, outcome, some), strict=True):
            if several > 1:
                code[lane] = MULTIPLE
                why[lane] = (
                    f"{several} eigenvalues vanish at once, and no direction leads on: an "
                    "imperfection that parts them, however small, does"
                )
    return replace(outcome, code=code, why=why)


def _several(
    curve: Curve, start: Lanes, outcome: Outcome, ended: Int[np.ndarray, " some"]
) -> list[int]:
    """How many eigenvalues vanish where some lanes ended."""
    here, structure = curve.take(ended), curve.structure
    begun = here.states(start[ended], np.zeros(len(ended)))
    z, p = here.states(outcome.z[ended], outcome.t[ended])
    small = _small_eigenvalue(structure, *begun)
    count = multiplicity(structure, z, p, VANISHED * small)
    folds = np.flatnonzero((count > 1) & (outcome.code[ended] == FOLD))
    alone = multiplicity(structure, z[folds], p[folds], LOCATED * small[folds]) == 1
    count[folds[alone]] = 1
    return [int(n) for n in count]


def multiplicity(structure: Structure, z: Lanes, p: Parameters, near: Values) -> Counts:
    """Number of eigenvalues of the constrained Hessian, in the metric, within ±near of zero."""
    nothing = np.zeros((len(z), 0, structure.size))
    above, below = (structure.solve(z, p, nothing, shift=sign * near) for sign in (1.0, -1.0))
    return np.asarray(above.negative - below.negative)


def _small_eigenvalue(structure: Structure, z: Lanes, p: Parameters) -> Values:
    """Harmonic mean of the eigenvalues, of the size of the smallest one: by a single solution."""
    n, mass = structure.unknowns, structure.mass
    vector = np.cos(1.7 * np.arange(n)) + 1.3
    rhs = np.zeros((len(z), 1, structure.size))
    rhs[:, 0, :n] = mass * vector
    yielding = structure.solve(z, p, rhs).x[:, 0, :n] @ (mass * vector)
    return np.asarray(np.abs(mass @ vector**2 / np.where(yielding == 0.0, np.inf, yielding)))
