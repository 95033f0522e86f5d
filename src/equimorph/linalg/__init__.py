"""Symmetric indefinite saddle-point matrices in batches of lanes, with their inertia."""

from equimorph.linalg.condensed import CondensedLayout
from equimorph.linalg.dense import (
    Border,
    BorderedSolution,
    multiply,
    negative_eigenvalues,
    no_border,
    orthonormal_rows,
    solve_bordered,
)
from equimorph.linalg.lanes import set_threads

__all__ = [
    "Border",
    "BorderedSolution",
    "CondensedLayout",
    "multiply",
    "negative_eigenvalues",
    "no_border",
    "orthonormal_rows",
    "set_threads",
    "solve_bordered",
]
