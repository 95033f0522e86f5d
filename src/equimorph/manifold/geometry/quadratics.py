"""Quadratic polynomials on simplices, in barycentric coordinates but for the first one."""

from itertools import combinations_with_replacement, product

import numpy as np

from equimorph.arrays import Float, Values

SUBDIVISIONS = 4
"""Of the lattice in each simplex on which the least value is sought."""
FAINT = 1e-5
"""Relative to the squares of the other coefficients, what leaves directions straight in which no
value shows how a polynomial is bent."""

Terms = Float[np.ndarray, "n terms"]
"""Coefficients of 1, the coordinates, and their products."""
Shares = Float[np.ndarray, "n corners"]


def monomials(at: Float[np.ndarray, "*n d"]) -> Float[np.ndarray, "*n terms"]:
    """1, coordinates, and their products."""
    products = [at[..., i] * at[..., j] for i, j in _pairs(at.shape[-1])]
    columns = [np.ones(at.shape[:-1]), *np.moveaxis(at, -1, 0), *products]
    return np.stack(columns, axis=-1)


def _pairs(d: int) -> list[tuple[int, int]]:
    return list(combinations_with_replacement(range(d), 2))


def through_corners(
    corners: Shares, at: Float[np.ndarray, "n m d"], values: Float[np.ndarray, "n m"]
) -> Terms:
    """Polynomials with given values at the corners, and as near as can be to others elsewhere.

    Other values that are not known, nan, are left out.
    """
    d = at.shape[2]
    known = np.isfinite(values) & np.isfinite(at).all(axis=2)
    at, values = np.where(known[..., None], at, 0.0), np.where(known, values, 0.0)
    first, rise = corners[:, 0], corners[:, 1:] - corners[:, :1]
    left = values - first[:, None] - np.einsum("nmd,nd->nm", at, rise)
    # products less what makes them vanish at the corners
    bows = monomials(at)[..., 1 + d :].copy()
    squares = [k for k, (i, j) in enumerate(_pairs(d)) if i == j]
    bows[..., squares] -= at
    bows *= known[..., None]
    left = np.where(known, left, 0.0)
    square = np.swapaxes(bows, 1, 2) @ bows
    count = square.shape[1]
    faint = FAINT**2 * np.einsum("nkk->n", square) + np.finfo(float).tiny
    square += faint[:, None, None] * np.eye(count)
    bent = np.linalg.solve(square, np.swapaxes(bows, 1, 2) @ left[..., None])[..., 0]
    return np.concatenate([first[:, None], rise - bent[:, squares], bent], axis=1)


def least_in_simplex(terms: Terms, d: int) -> tuple[Values, Shares]:
    """Least values on the simplex, and where: on a lattice, or inside."""
    rows = [r for r in product(range(SUBDIVISIONS + 1), repeat=d) if sum(r) <= SUBDIVISIONS]
    lattice = np.array(rows) / SUBDIVISIONS
    values = terms @ monomials(lattice).T
    best = values.argmin(axis=1)
    least, place = values.min(axis=1), lattice[best]
    slope, bend = terms[:, 1 : 1 + d], np.zeros((len(terms), d, d))
    for number, (i, j) in enumerate(_pairs(d)):
        bend[:, i, j] += terms[:, 1 + d + number]
        bend[:, j, i] += terms[:, 1 + d + number]
    regular = np.abs(np.linalg.det(bend)) > 0.0
    inner = np.full((len(terms), d), -1.0)
    inner[regular] = -np.linalg.solve(bend[regular], slope[regular, :, None])[:, :, 0]
    value = terms[:, 0] + 0.5 * (slope * inner).sum(axis=1)
    better = (inner >= 0.0).all(axis=1) & (inner.sum(axis=1) <= 1.0) & (value < least)
    place = np.where(better[:, None], inner, place)
    shares = np.concatenate([1.0 - place.sum(axis=1, keepdims=True), place], axis=1)
    return np.where(better, value, least), shares
