"""The stability margin: smallest eigenvalue of the constrained Hessian in the metric."""

import numpy as np
from jaxtyping import Bool, Float

from equimorph.structures.contract import Structure

RELATIVE = 1e-11


def stability_margin(
    structure: Structure,
    z: Float[np.ndarray, "lanes size"],
    p: Float[np.ndarray, "lanes parameters"],
) -> Float[np.ndarray, " lanes"]:
    """Smallest σ of ``L_uu v + c_uᵀ μ = σ M v``, ``c_u v = 0``, per lane.

    The inertia of F_z − σM counts the eigenvalues below σ. Bisection on that count isolates the
    smallest one; inverse iteration with the Rayleigh quotient then converges to round-off.
    Scale: energy over the metric's unit squared.
    """
    low, high = _bracket(structure, z, p)
    for _ in range(12):
        middle = 0.5 * (low + high)
        below = _count_below(structure, z, p, middle) > 0
        high, low = np.where(below, middle, high), np.where(below, low, middle)
    return _polish(structure, z, p, low, high)


def _count_below(
    structure: Structure,
    z: Float[np.ndarray, "lanes size"],
    p: Float[np.ndarray, "lanes parameters"],
    shift: Float[np.ndarray, " lanes"],
) -> Float[np.ndarray, " lanes"]:
    nothing = np.zeros((len(z), 0, structure.size))
    return structure.solve(z, p, nothing, shift=shift).negative - float(structure.constraints)


def _bracket(
    structure: Structure,
    z: Float[np.ndarray, "lanes size"],
    p: Float[np.ndarray, "lanes parameters"],
) -> tuple[Float[np.ndarray, " lanes"], Float[np.ndarray, " lanes"]]:
    """Numbers below and above the smallest eigenvalue, by doubling from zero."""
    some = _count_below(structure, z, p, np.zeros(len(z))) > 0
    low, high = np.where(some, -1.0, 0.0), np.where(some, 0.0, 1.0)
    for _ in range(60):
        wrong_low = _count_below(structure, z, p, low) > 0
        wrong_high = _count_below(structure, z, p, high) == 0
        if not (wrong_low.any() or wrong_high.any()):
            break
        high = np.where(wrong_low, low, high)
        low = np.where(wrong_high, np.maximum(high, low), low)
        low = np.where(wrong_low, 2.0 * low, low)
        high = np.where(wrong_high, 2.0 * high, high)
    return low, high


def _polish(
    structure: Structure,
    z: Float[np.ndarray, "lanes size"],
    p: Float[np.ndarray, "lanes parameters"],
    low: Float[np.ndarray, " lanes"],
    high: Float[np.ndarray, " lanes"],
) -> Float[np.ndarray, " lanes"]:
    """Inverse iteration from a shift just below the smallest eigenvalue."""
    n, mass = structure.unknowns, structure.mass
    vector = np.tile(np.cos(1.7 * np.arange(n)) + 1.3, (len(z), 1))
    # an eigenvalue of zero lies on the bracket's end, where the matrix is singular
    bottom = low - 0.5 * (high - low)
    value, shift = 0.5 * (low + high), bottom.copy()
    for sweep in range(40):
        rhs = np.zeros((len(z), 1, structure.size))
        rhs[:, 0, :n] = mass * vector
        solved = structure.solve(z, p, rhs, shift=shift).x[:, 0, :n]
        norm = np.sqrt(np.einsum("li,i,li->l", solved, mass, solved))
        # Rayleigh quotient of the new vector: (F_z − shift M) solved = M vector
        quotient = shift + np.einsum("li,i,li->l", solved, mass, vector) / norm**2
        previous, value = value, np.where(norm > 0, quotient, value)
        vector = solved / norm[:, None]
        if sweep > 1 and _settled(value, previous).all():
            break
        # a shift equal to the eigenvalue would be singular: stay a little below
        near = (value > bottom) & (value < high + 0.5 * (high - low))
        closer = value - 1e-3 * (high - low)
        shift = np.where(near & (sweep > 2), np.maximum(closer, bottom), bottom)
    return np.asarray(value)


def _settled(
    value: Float[np.ndarray, " lanes"], previous: Float[np.ndarray, " lanes"]
) -> Bool[np.ndarray, " lanes"]:
    return np.asarray(np.abs(value - previous) <= RELATIVE * np.maximum(np.abs(value), 1e-3))
