"""Newton that is pushed away from solutions already known."""

import numpy as np
from jaxtyping import Float

from equimorph.arrays import Flags, Lanes, Parameters, Values
from equimorph.structures import Structure


def deflated_newton(
    structure: Structure,
    z: Lanes,
    p: Parameters,
    known: Float[np.ndarray, "lanes roots unknowns"],
    *,
    iterations: int = 30,
    longest: float = 0.7,
) -> tuple[Lanes, Flags]:
    """Solve ``m(u) F(z; p) = 0`` with m = Π (1 + 1/‖u − uᵢ‖²) in the metric, uᵢ known solutions.

    The Newton step of the product is that of F, lengthened by 1/(1 − ∇(log m)·du): one solve as
    ever [FarrellBirkissonFunke2015]_. Steps longer than `longest` in the metric are shortened.

    Parameters
    ----------
    known
        Known solutions of each lane; rows of NaN where a lane has fewer than others.

    Returns
    -------
    Points, and whether the last correction was at round-off (below 1e-10 in the metric).
    """
    z, found = z.copy(), np.zeros(len(z), bool)
    todo, n = np.arange(len(z)), structure.unknowns
    for _ in range(iterations):
        count = len(todo)
        still, one, none = np.zeros((count, structure.size)), np.ones(count), np.zeros(count)
        dz = structure.advance(z[todo], p[todo], np.zeros_like(p[todo]), still, one, none).dz
        size = np.sqrt(dz[:, :n] ** 2 @ structure.mass)
        factor = _lengthening(structure, z[todo, :n], dz[:, :n], known[todo])
        alive = np.isfinite(dz).all(axis=1) & np.isfinite(factor)
        share = np.minimum(1.0, longest / np.maximum(np.abs(factor) * size, 1e-300)) * factor
        z[todo[alive]] += share[alive, None] * dz[alive]
        small = alive & (size < 1e-10)
        found[todo[small]] = True
        todo = todo[alive & ~small]
        if len(todo) == 0:
            break
    return z, found


def _lengthening(
    structure: Structure,
    u: Float[np.ndarray, "lanes unknowns"],
    du: Float[np.ndarray, "lanes unknowns"],
    known: Float[np.ndarray, "lanes roots unknowns"],
) -> Values:
    """1/(1 − ∇(log m)·du)."""
    gap = u[:, None] - known
    squared = gap**2 @ structure.mass
    along = np.einsum("lri,i,li->lr", gap, structure.mass, du)
    slopes = -2.0 * along / (squared * (1.0 + squared))
    return np.asarray(1.0 / (1.0 - np.nansum(slopes, axis=1)))
