"""Damped Newton at fixed parameters."""

import numpy as np

from equimorph.arrays import Flags, Lanes, Parameters
from equimorph.structures import Structure


def newton(
    structure: Structure,
    z: Lanes,
    p: Parameters,
    *,
    iterations: int = 60,
    longest: float = 0.7,
) -> tuple[Lanes, Flags]:
    """Solve F(z; p) = 0 from guesses; steps longer than `longest` in the metric are shortened.

    Returns
    -------
    Points, and whether the last correction was at round-off (below 1e-10 in the metric).
    """
    z, found = z.copy(), np.zeros(len(z), bool)
    todo = np.arange(len(z))
    n = structure.unknowns
    for _ in range(iterations):
        count = len(todo)
        still, one = np.zeros((count, structure.size)), np.ones(count)
        none, fixed = np.zeros(count), np.zeros((count, p.shape[1]))
        dz = structure.advance(z[todo], p[todo], fixed, still, one, none).dz
        size = np.sqrt(dz[:, :n] ** 2 @ structure.mass)
        alive = np.isfinite(dz).all(axis=1)
        share = np.minimum(1.0, longest / np.maximum(size, 1e-300))
        z[todo[alive]] += share[alive, None] * dz[alive]
        small = alive & (size < 1e-10)
        found[todo[small]] = True
        todo = todo[alive & ~small]
        if len(todo) == 0:
            break
    return z, found
