"""Compiled kernel of stability margins: pairs of vectors rotated to Ritz vectors."""

import numpy as np

from equimorph.linalg.compiled import njit
from equimorph.linalg.kernels import FLAGS


@njit(**FLAGS)
def rotate_pairs(rhs, x, mass, shift, near, pairs, first, second, off):
    """Ritz vectors of pairs x (lanes, 2, size) after a step of inverse iteration, and their values.

    rhs: what was solved for, the pairs before times the mass (unknowns,); near: least share of the
    largest of both Ritz values of the inverse. Written are pairs, orthonormal in the metric, values
    first and second, shift included, and off: the square of the residual of the first, in the
    inverse of the metric.
    """
    size, unknowns = x.shape[2], len(mass)
    for lane in range(len(x)):
        # Ritz values of the inverse: eigenvalues of Xᵀ M (K⁻¹ M X), 2 × 2
        a, b, c, e, f, g = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        for i in range(unknowns):
            one, two = x[lane, 0, i], x[lane, 1, i]
            a += rhs[lane, 0, i] * one
            b += rhs[lane, 0, i] * two
            c += rhs[lane, 1, i] * two
            e += mass[i] * one * one
            f += mass[i] * one * two
            g += mass[i] * two * two
        mean, half = 0.5 * (a + c), np.hypot(0.5 * (a - c), b)
        angle = 0.5 * np.arctan2(2.0 * b, a - c)
        cos, sin = np.cos(angle), np.sin(angle)
        # products of the rotated vectors in the metric
        top = cos * cos * e + 2.0 * cos * sin * f + sin * sin * g
        cross = cos * sin * (g - e) + (cos * cos - sin * sin) * f
        low = sin * sin * e - 2.0 * cos * sin * f + cos * cos * g
        part = cross / top
        scale = 1.0 / np.sqrt(top)
        other = 1.0 / np.sqrt(max(low - part * cross, 1e-14 * top))
        for i in range(size):
            one, two = x[lane, 0, i], x[lane, 1, i]
            pairs[lane, 0, i] = scale * (cos * one + sin * two)
            turned = (cos - part * sin) * two - (sin + part * cos) * one
            pairs[lane, 1, i] = other * turned
        # K y = M x: the Rayleigh quotient of y needs no product with K
        above = (mean + half) / top
        first[lane] = shift[lane] + above
        second[lane] = shift[lane] + 1.0 / max(mean - half, near * (mean + half))
        off[lane] = max(1.0 / top - above * above, 0.0)
