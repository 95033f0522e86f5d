"""Symmetric indefinite saddle-point matrices in batches of lanes, with their inertia."""

from equimorph.linalg.condensed import CondensedLayout
from equimorph.linalg.dense import BorderedSolution, multiply, negative_eigenvalues, solve_bordered

__all__ = [
    "BorderedSolution",
    "CondensedLayout",
    "multiply",
    "negative_eigenvalues",
    "solve_bordered",
]
