"""Natural states of discrete structures: known at some parameters, continued to others."""

from collections.abc import Callable

import numpy as np

from equimorph.arrays import Flags, Lanes, Parameters
from equimorph.structures.contract import Structure

STEPS = 12
"""Steps of the continuation from the parameters where the natural state is given."""
ITERATIONS = 12
SETTLED = 1e-9
"""Correction, relative to the unknowns, that counts as none."""
BALANCED = 1e-13


def continued(
    structure: Structure,
    guess: Callable[[Parameters], Lanes],
    start: Parameters,
    p: Parameters,
) -> tuple[Lanes, Flags]:
    """Equilibria at `p`, continued along the straight line in the parameters from `start`.

    The guess at `start` is corrected; each step predicts by the change of the guess and corrects
    by Newton. Lanes that do not converge are not found.
    """
    z, found = corrected(structure, guess(start), start)
    if np.array_equal(start, p):
        return z, found
    before = start
    for k in range(1, STEPS + 1):
        here = start + (p - start) * (k / STEPS)
        z, good = corrected(structure, z + guess(here) - guess(before), here)
        found, before = found & good, here
    return z, found


def corrected(structure: Structure, z: Lanes, p: Parameters) -> tuple[Lanes, Flags]:
    """Newton at fixed parameters, and whether it settled; balanced guesses stay as they are."""
    z = z.copy()
    settled = np.zeros(len(z), bool)
    for _ in range(ITERATIONS):
        residual = structure.residual(z, p)
        settled |= np.abs(residual).max(axis=1) <= BALANCED
        if settled.all():
            break
        step = structure.solve(z, p, -residual[:, None]).x[:, 0]
        usable = ~settled & np.isfinite(step).all(axis=1)
        z[usable] += step[usable]
        small = np.abs(step).max(axis=1) <= SETTLED * (1.0 + np.abs(z).max(axis=1))
        settled |= usable & small
    return z, settled & np.isfinite(z).all(axis=1)
