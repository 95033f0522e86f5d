"""Natural frequencies: small free vibrations about stable states.

The constrained eigenproblem ``L_uu v + c_uᵀ μ = ω² M v``, ``c_u v = 0`` with the physical mass
matrix M of `Structure.inertia`.
"""

from dataclasses import dataclass

import numpy as np

from equimorph.array_types import Float
from equimorph.arrays import Lanes, Parameters
from equimorph.errors import InputError
from equimorph.structures.contract import Structure

GUARD = 4
"""Vectors beyond those asked for: subspace iteration converges by the ratio to the next one."""
SWEEPS = 80
"""Most steps of subspace iteration."""
RELATIVE = 1e-12
"""Relative change of all frequencies' squares that counts as none."""


@dataclass(frozen=True, eq=False)
class Vibrations:
    """Lowest modes of small free vibrations.

    frequencies: angular ones, ascending, in radians per `Structure.time_unit`; infinite for modes
    that move no mass. modes: of the unknowns, with ``vᵀMv = 1``.
    """

    frequencies: Float[np.ndarray, "lanes k"]
    modes: Float[np.ndarray, "lanes k unknowns"]


def vibrations(structure: Structure, z: Lanes, p: Parameters, count: int) -> Vibrations:
    """Lowest modes of stable states, by subspace iteration with the constrained Hessian.

    Each step solves with F_z and takes the best combinations (Rayleigh and Ritz) of all vectors.

    Raises
    ------
    InputError
        For a state that is not stable, about which no small movement stays small, for more modes
        than unknowns, or a structure without mass.

    References
    ----------
    [Bathe2014]_, section 11.6.
    """
    unstable = np.flatnonzero(structure.index(z, p) != 0)
    if len(unstable):
        raise InputError(
            f"`state` must be stable to vibrate; got one that is not, state {int(unstable[0])} of "
            f"{len(z)}."
        )
    free = structure.unknowns - structure.constraints
    if not 1 <= count <= free:
        raise InputError(f"`count` must be from 1 to {free}, the free movements; got {count!r}.")
    product = structure.inertia_product(z, p)
    width = min(count + GUARD, structure.unknowns)
    vectors = np.random.default_rng(0).normal(size=(len(z), width, structure.unknowns))
    solve = structure.linear_system(z, p, np.zeros((len(z), 0, p.shape[1]))).solve
    last = np.zeros((len(z), count))
    rhs = np.zeros((len(z), width, structure.size))
    for _ in range(SWEEPS):
        rhs[:, :, : structure.unknowns] = product(vectors)
        moved = solve(rhs, None).x[:, :, : structure.unknowns]
        stiff = moved @ rhs[:, :, : structure.unknowns].transpose(0, 2, 1)
        inverse, vectors = _ritz(stiff, moved @ product(moved).transpose(0, 2, 1), moved)
        now = inverse[:, :count]
        if (np.abs(now - last) <= RELATIVE * now).all():
            break
        last = now
    size = np.sqrt(np.einsum("lki,lki->lk", vectors, product(vectors)))
    with np.errstate(divide="ignore", invalid="ignore"):
        frequencies = 1.0 / np.sqrt(np.maximum(inverse[:, :count], 0.0))
        modes = (vectors / size[:, :, None])[:, :count]
    return Vibrations(frequencies, modes)


def _ritz(
    stiff: Float[np.ndarray, "lanes w w"],
    heavy: Float[np.ndarray, "lanes w w"],
    vectors: Float[np.ndarray, "lanes w n"],
) -> tuple[Float[np.ndarray, "lanes w"], Float[np.ndarray, "lanes w n"]]:
    """Values 1/ω², descending, and the best combinations: ``heavy c = stiff c/ω²``.

    `stiff` is positive in exact arithmetic; directions in which it is round-off are left out.
    """
    scale, basis = np.linalg.eigh(0.5 * (stiff + stiff.transpose(0, 2, 1)))
    keep = scale > 1e-14 * scale[:, -1:]
    root = np.where(keep, 1.0 / np.sqrt(np.where(keep, scale, 1.0)), 0.0)
    reduce = basis * root[:, None, :]
    values, turned = np.linalg.eigh(reduce.transpose(0, 2, 1) @ heavy @ reduce)
    best = (reduce @ turned)[:, :, ::-1]
    return values[:, ::-1], best.transpose(0, 2, 1) @ vectors
