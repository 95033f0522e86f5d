"""Natural frequencies: small free vibrations about stable states; masses of material points.

The constrained eigenproblem ``L_uu v + c_uᵀ μ = ω² M v``, ``c_u v = 0`` with the physical mass
matrix M of `Structure.inertia`.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from equimorph.arrays import Float, Lanes, Parameters, Velocity
from equimorph.errors import InputError
from equimorph.structures.contract import Structure
from equimorph.structures.equations import Equations

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


STEP = 1e-3
"""Step of the differences, of unknowns of size one: errors of 1e-13 of truncation and round-off."""
RANK = 1e-10
"""Relative size below which a compliance counts as none: such constraints do not give way."""

Places = Callable[[Lanes, Parameters], Float[np.ndarray, "many points space"]]


@dataclass(frozen=True)
class MaterialPoints:
    """Masses at places, which are functions of unknowns and multipliers.

    Derivatives are differenced to fourth order. Where constraints ``c(u, λ) = 0`` give way, the
    multipliers follow from the unknowns: ``c_u δu + c_λ δλ = 0``.
    """

    equations: Equations
    places: Places
    masses: Float[np.ndarray, " points"]

    def inertia(self, z: Lanes, p: Parameters) -> Float[np.ndarray, "lanes unknowns unknowns"]:
        """Mass matrix JᵀWJ."""
        n = self.equations.unknowns
        out = np.empty((len(z), n, n))
        for lane in range(len(z)):
            flat, weights, _ = self._moved(z[lane], p[lane])
            out[lane] = flat.T @ (weights[:, None] * flat)
        return out

    def inertial_force(self, z: Lanes, p: Parameters, velocity: Velocity) -> Velocity:
        """``JᵀW D²x[u̇, u̇]``, with the second derivative of all places along the velocity."""
        out = np.zeros_like(velocity)
        for lane, rate in enumerate(velocity):
            size = float(np.abs(rate).max())
            if size == 0.0:
                continue
            flat, weights, follow = self._moved(z[lane], p[lane])
            way = STEP * np.concatenate([rate, follow @ rate]) / size
            at = z[lane] + np.array([-2.0, -1.0, 0.0, 1.0, 2.0])[:, None] * way
            x = self.places(at, np.repeat(p[lane][None], 5, axis=0)).reshape(5, -1)
            bend = np.array([-1.0, 16.0, -30.0, 16.0, -1.0]) @ x / (12.0 * (STEP / size) ** 2)
            out[lane] = flat.T @ (weights * bend)
        return out

    def _moved(
        self, z: Float[np.ndarray, " size"], p: Float[np.ndarray, " parameters"]
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Derivatives of all coordinates by the unknowns, their masses, rates of multipliers."""
        n = self.equations.unknowns
        moved = _derivative(self.places, z, p)
        follow = np.zeros((self.equations.constraints, n))
        if self.equations.constraints:
            rows = _derivative(self.equations.residual, z, p)[n:]
            follow = -np.linalg.pinv(rows[:, n:], rcond=RANK, hermitian=True) @ rows[:, :n]
            moved = moved[..., :n] + moved[..., n:] @ follow
        return moved.reshape(-1, n), np.repeat(self.masses, moved.shape[1]), follow


def _derivative(
    function: Callable[[Lanes, Parameters], np.ndarray],
    z: Float[np.ndarray, " size"],
    p: Float[np.ndarray, " parameters"],
) -> Float[np.ndarray, "... size"]:
    """Derivatives of values at one state by all entries of z, along the last axis."""
    steps = STEP * np.eye(len(z))
    at = np.concatenate([z + share * steps for share in (1.0, -1.0, 2.0, -2.0)])
    values = function(at, np.repeat(p[None], len(at), axis=0))
    ahead, behind, twice, back = values.reshape(4, len(z), *values.shape[1:])
    slope = (8.0 * (ahead - behind) - (twice - back)) / (12.0 * STEP)
    return np.asarray(np.moveaxis(slope, 0, -1))
