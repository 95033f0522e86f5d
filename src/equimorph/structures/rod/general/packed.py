"""The tables of a general rod as its kernels read them: what is zero left out, point by point."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

from equimorph.structures.rod.general.model import RodModel


@dataclass(frozen=True, eq=False)
class Packed:
    """Coefficients of those scalars that have any, beside each other for every point.

    Attributes
    ----------
    points
        For the nodes of every element the coefficients of sin θ, of cos θ and of the cables' pull.
        The multipliers come first in each of the first two groups.
    slope
        Coefficients of θ at every node of the rod.
    picks
        Which scalars all these belong to, group by group.
    splits
        Where the second, third and fourth group begin in `picks`.
    """

    points: Float[np.ndarray, "points many"]
    slope: Float[np.ndarray, "nodes few"]
    picks: Int[np.ndarray, " all"]
    splits: Int[np.ndarray, "3"]


def packed(model: RodModel) -> Packed:
    """Tables of a rod."""
    m, tables = model.multipliers, (model.sine, model.cosine, model.tension, model.slope)
    used: list[Bool[np.ndarray, " scalars"]] = [np.asarray(a.any(axis=1)) for a in tables]
    for each in used[:2]:
        each[:m] = True
    picks = [np.flatnonzero(each) for each in used]
    groups = [table[pick].T for table, pick in zip(tables, picks, strict=True)]
    return Packed(
        np.ascontiguousarray(np.concatenate(groups[:3], axis=1)),
        np.ascontiguousarray(groups[3]),
        np.concatenate(picks),
        np.cumsum([len(pick) for pick in picks[:3]]),
    )
