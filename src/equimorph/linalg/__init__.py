"""Symmetric indefinite saddle-point matrices in batches of lanes, with their inertia."""

from equimorph.linalg.condensed import CondensedLayout as CondensedLayout
from equimorph.linalg.dense import (
    Border as Border,
    BorderedSolution as BorderedSolution,
    multiply as multiply,
    no_border as no_border,
    orthonormal_rows as orthonormal_rows,
    solve_bordered as solve_bordered,
)
from equimorph.linalg.lanes import set_threads as set_threads
