"""Natural frequencies: small free vibrations about stable states.

The constrained eigenproblem ``L_uu v + c_uᵀ μ = ω² M v``, ``c_u v = 0`` with the physical mass
matrix M of `Structure.inertia`.
"""

from dataclasses import dataclass

import numpy as np

from equimorph.arrays import Float, Lanes, Parameters
from equimorph.errors import InputError
from equimorph.structures.contract import Structure
from equimorph.structures.material_points import Product, SupportSprings

GUARD = 4
"""Vectors beyond those asked for: subspace iteration converges by the ratio to the next one."""
SWEEPS = 80
"""Most steps of subspace iteration."""
CROWDED = 0.8
"""Share of 1/ω² of the last mode asked for above which the last vector is too near to it."""
CRITICAL = 1e-13
"""Ratio of ω₁² to the next mode's below which ω₁ is round-off."""
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
    There are twice as many where all have frequencies near those asked for. Springs at supports
    that the unknowns leave free have coordinates of their own. States on orbits vibrate across
    these, orthogonal to them in M: the turn along them is no vibration.

    Raises
    ------
    InputError
        For a state that is not stable or critical, about which no small movement stays small, for
        more modes than unknowns, or a structure without mass.

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
    moving = _Moving.of(structure, z, p)
    free = moving.coordinates - structure.constraints
    if not 1 <= count <= free:
        raise InputError(f"`count` must be from 1 to {free}, the free movements; got {count!r}.")
    _check_regular(moving, len(z))
    generator, more = np.random.default_rng(0), min(count + GUARD, moving.coordinates)
    vectors, crowded = np.zeros((len(z), 0, moving.coordinates)), True
    while more and crowded:
        added = generator.normal(size=(len(z), more, moving.coordinates))
        vectors = np.concatenate([vectors, moving.across(added)], axis=1)
        inverse, vectors = _lowest(moving, vectors, count)
        crowded = bool((inverse[:, -1] > CROWDED * inverse[:, count - 1]).any())
        more = min(vectors.shape[1], moving.coordinates - vectors.shape[1])
    size = np.sqrt(np.einsum("lki,lki->lk", vectors, moving.inertia(vectors)))
    with np.errstate(divide="ignore", invalid="ignore"):
        frequencies = 1.0 / np.sqrt(np.maximum(inverse[:, :count], 0.0))
        modes = (vectors / size[:, :, None])[:, :count, : structure.unknowns]
    return Vibrations(frequencies, modes)


@dataclass(frozen=True)
class _Moving:
    """Masses and compliance of some states in the coordinates that move mass.

    These are the unknowns, and the places of springs that do not follow from them.
    """

    coordinates: int
    inertia: Product
    response: Product
    across: Product

    @classmethod
    def of(cls, structure: Structure, z: Lanes, p: Parameters) -> "_Moving":
        """Of states; the response to forces keeps the constraints, and lies across orbits."""
        n, size = structure.unknowns, structure.size
        solve = structure.linear_system(z, p, np.zeros((len(z), 0, p.shape[1]))).solve
        sprung = structure.sprung
        if sprung is None or sprung.springs is None:
            springs = SupportSprings.of((), structure.constraints, 1)
            inertia = structure.inertia_product(z, p)
        else:
            springs, mass = sprung.springs, sprung.inertia(z, p)

            def inertia(v: np.ndarray) -> np.ndarray:
                return np.asarray(v @ mass)

        def response(forces: np.ndarray) -> np.ndarray:
            rhs = np.zeros((*forces.shape[:2], size))
            given = forces[:, :, n:] / springs.stiffness
            rhs[:, :, :n], rhs[:, :, n:] = forces[:, :, :n], -given @ springs.gaps.T
            x = solve(rhs, None).x
            away = x[:, :, n:] @ springs.gaps / springs.stiffness
            return across(np.concatenate([x[:, :, :n], given - away], axis=2))

        count = n + len(springs.stiffness)
        along = np.zeros((len(z), 1, count))
        along[:, 0, :n] = structure.along_orbits(z, p)[:, :n]
        heavy = inertia(along)
        weight = heavy @ along.transpose(0, 2, 1)
        share = np.divide(along, weight, out=np.zeros_like(along), where=weight > 0.0)

        def across(v: np.ndarray) -> np.ndarray:
            return np.asarray(v - (v @ heavy.transpose(0, 2, 1)) @ share)

        return cls(count, inertia, response, across)


def _check_regular(moving: _Moving, lanes: int) -> None:
    """Refuse critical states, whose softest movement hides all others in round-off.

    That movement answers a first push; a second one, orthogonal to it in M, does not excite it.
    """
    first, second = np.random.default_rng(1).normal(size=(2, lanes, 1, moving.coordinates))
    first, second = moving.across(first), moving.across(second)

    def square(v: np.ndarray, w: np.ndarray) -> np.ndarray:
        return np.asarray((moving.inertia(v) * w).sum(axis=2, keepdims=True))

    soft = moving.response(moving.inertia(first))
    others = second - square(soft, second) / square(soft, soft) * soft
    some = square(others, others) > CRITICAL * square(second, second)
    stiff = moving.response(moving.inertia(others))
    by_soft = square(soft, soft) * square(others, others)
    by_others = square(stiff, stiff) * square(first, first)
    critical = np.flatnonzero(some & (by_others < CRITICAL**2 * by_soft))
    if len(critical):
        raise InputError(
            "`state` must be stable to vibrate; got a critical one, which can move without force, "
            f"state {int(critical[0])} of {lanes}."
        )


def _lowest(
    moving: _Moving, vectors: Float[np.ndarray, "lanes w n"], count: int
) -> tuple[Float[np.ndarray, "lanes w"], Float[np.ndarray, "lanes w n"]]:
    """Values 1/ω², descending, and modes to which steps from some vectors converge."""
    last = np.zeros((len(vectors), count))
    for _ in range(SWEEPS):
        forces = moving.inertia(vectors)
        moved = moving.response(forces)
        stiff = moved @ forces.transpose(0, 2, 1)
        heavy = moved @ moving.inertia(moved).transpose(0, 2, 1)
        inverse, vectors = _ritz(stiff, heavy, moved)
        now = inverse[:, :count]
        if (np.abs(now - last) <= RELATIVE * now).all():
            break
        last = now
    return inverse, vectors


def _ritz(
    stiff: Float[np.ndarray, "lanes w w"],
    heavy: Float[np.ndarray, "lanes w w"],
    vectors: Float[np.ndarray, "lanes w n"],
) -> tuple[Float[np.ndarray, "lanes w"], Float[np.ndarray, "lanes w n"]]:
    """Values 1/ω², descending, and the best combinations: ``heavy c = stiff c/ω²``.

    `stiff` is positive in exact arithmetic; directions in which it is round-off are left out. All
    vectors count as equally long in it, whose sizes differ by the squares of their frequencies.
    """
    size = np.sqrt(np.einsum("lkk->lk", stiff))
    by = np.divide(1.0, size, out=np.zeros_like(size), where=size > 0.0)
    stiff, heavy = (by[:, :, None] * each * by[:, None, :] for each in (stiff, heavy))
    scale, basis = np.linalg.eigh(0.5 * (stiff + stiff.transpose(0, 2, 1)))
    keep = scale > 1e-14 * scale[:, -1:]
    root = np.where(keep, 1.0 / np.sqrt(np.where(keep, scale, 1.0)), 0.0)
    reduce = basis * root[:, None, :]
    values, turned = np.linalg.eigh(reduce.transpose(0, 2, 1) @ heavy @ reduce)
    best = (reduce @ turned)[:, :, ::-1]
    return values[:, ::-1], best.transpose(0, 2, 1) @ (by[:, :, None] * vectors)
