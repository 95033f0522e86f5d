"""The stability boundary as a smooth function."""

import numpy as np

from equimorph.arrays import Lanes, Parameters, Values
from equimorph.model import Constraint, Descriptor
from equimorph.structures import Structure, margin_of

SWEEPS = 5
SHIFT = -1e-7
"""Of the inverse iteration: at folds the matrix is regular with it."""
STABLE = "stable"


def stability(structure: Structure, margin: float) -> Constraint:
    """Constraint that the stability margin stays above `margin`."""
    if margin > 0.0:
        return margin_of(structure) >= margin

    def value(z: Lanes, p: Parameters) -> Values:
        return nearest_eigenvalue(structure, z, p)

    return Descriptor(STABLE, "1", value, STABLE, structure.signature) >= 0.0


def is_stability(constraint: Constraint) -> bool:
    """Whether a constraint is one of stability."""
    return constraint.descriptor.name in (STABLE, "stability_margin")


def nearest_eigenvalue(structure: Structure, z: Lanes, p: Parameters) -> Values:
    """Eigenvalue of the constrained Hessian nearest to zero, in the metric, by inverse iteration.

    Near the stability boundary it is the margin to round-off; far from it, about as large.
    """
    n, mass = structure.unknowns, structure.mass
    v = np.tile(np.cos(1.7 * np.arange(n)) + 1.3, (len(z), 1))
    shift, value = np.full(len(z), SHIFT), np.zeros(len(z))
    for _ in range(SWEEPS):
        rhs = np.zeros((len(z), 1, structure.size))
        rhs[:, 0, :n] = mass * v
        x = structure.solve(z, p, rhs, shift=shift).x[:, 0, :n]
        size = x**2 @ mass
        value = SHIFT + np.einsum("li,i,li->l", x, mass, v) / size
        v = x / np.sqrt(size)[:, None]
    return value
