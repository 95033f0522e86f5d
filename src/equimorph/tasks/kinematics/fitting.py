"""States of a set whose descriptors come nearest to given values."""

import numpy as np
from jaxtyping import Bool, Float

from equimorph.manifold.queries.nearest import local_minima
from equimorph.model import Constraint, combined
from equimorph.structures import States
from equimorph.tasks.kinematics.prediction import Predictor
from equimorph.tasks.optimising.descent import descend
from equimorph.tasks.optimising.objectives import Objective
from equimorph.tasks.optimising.plane import spots_of
from equimorph.tasks.optimising.programme import Programme

STARTS = 12
"""Local minima over the vertices from which fits are searched."""
VIOLATED = 1e-7


def best_fits(
    known: Predictor,
    wanted: Float[np.ndarray, " k"],
    within: tuple[Constraint, ...],
    allowed: Bool[np.ndarray, " V"] | None = None,
) -> tuple[States, Float[np.ndarray, " fits"]]:
    """Local minima of ``Σ ((S − S*)/range)²``, the best first, and the roots of these sums.

    Minima at the sides of the box and on constraints count, too.

    Parameters
    ----------
    within
        Constraints, those of the set among them.
    allowed
        Vertices from which to search; all if None.
    """
    eset, spread = known.eset, known.spread
    squares = combined(
        "misfit",
        lambda *each: sum(
            ((value - target) / unit) ** 2
            for value, target, unit in zip(each, wanted, spread, strict=True)
        ),
        *known.descriptors,
    )
    edges, value = known.edges, known.misfits(wanted)
    if allowed is not None:
        edges = edges[allowed[edges].all(axis=1)]
    starts = local_minima(edges, value)[:STARTS]
    programme = Programme.over(eset, Objective(squares, 1.0), within)
    ends = [
        end
        for end in descend(programme, spots_of(eset, starts))
        if end.expansion.g.max(initial=-1.0) <= VIOLATED
    ]
    ends.sort(key=lambda end: float(end.expansion.f.max()))
    structure = eset.structure
    z = np.concatenate([np.zeros((0, structure.size)), *(end.spot.z for end in ends)])
    p = np.concatenate([np.zeros((0, len(structure.parameters))), *(end.spot.p for end in ends)])
    misfit = np.sqrt(np.maximum([float(end.expansion.f.max()) for end in ends], 0.0))
    return States(structure, z, p), misfit
