"""The kernel of stability margins against plain numpy."""

import numpy as np

from equimorph.structures.margin import NEAR
from equimorph.structures.margin_kernels import rotate_pairs


def test_pairs_become_ritz_vectors_of_the_inverse():
    """Eigenvectors of the 2 × 2 projection by numpy, and Rayleigh quotients with the matrix itself.

    The rest of the mode is its residual in the inverse of the metric. Multipliers, here random,
    turn with the vectors. Tolerances: round-off, of squares for the residual.
    """
    generator, lanes, n, size = np.random.default_rng(3), 5, 9, 11
    mass, shift = generator.uniform(0.5, 2.0, n), generator.normal(size=lanes)
    root = generator.normal(size=(lanes, n, n))
    matrix = root @ root.transpose(0, 2, 1) + np.eye(n)  # K − shift·M
    before = np.zeros((lanes, 2, size))
    for lane in range(lanes):
        basis = np.linalg.qr(generator.normal(size=(n, 2)))[0]
        before[lane, :, :n] = basis.T / np.sqrt(mass)
    rhs, x = np.zeros_like(before), generator.normal(size=before.shape)
    rhs[:, :, :n] = before[:, :, :n] * mass
    x[:, :, :n] = np.linalg.solve(matrix, rhs[:, :, :n].transpose(0, 2, 1)).transpose(0, 2, 1)
    pairs, (first, second, off) = np.empty_like(x), np.empty((3, lanes))
    rotate_pairs(rhs, x, mass, shift, NEAR, pairs, first, second, off)
    gram = np.einsum("lai,i,lbi->lab", pairs[:, :, :n], mass, pairs[:, :, :n])
    np.testing.assert_allclose(gram, np.tile(np.eye(2), (lanes, 1, 1)), atol=1e-13)
    ritz, turn = np.linalg.eigh(rhs[:, :, :n] @ x[:, :, :n].transpose(0, 2, 1))
    np.testing.assert_allclose(second, shift + 1.0 / ritz[:, 0], rtol=1e-12)
    mode = np.einsum("la,lai->li", turn[:, :, 1], x)
    mode /= np.sqrt(mode[:, :n] ** 2 @ mass)[:, None]
    mode *= np.sign((mode * pairs[:, 0]).sum(axis=1))[:, None]
    np.testing.assert_allclose(pairs[:, 0], mode, atol=1e-12)
    bent = np.einsum("lij,lj->li", matrix, mode[:, :n])
    quotient = (bent * mode[:, :n]).sum(axis=1)
    np.testing.assert_allclose(first, shift + quotient, rtol=1e-12)
    rest = bent - quotient[:, None] * mass * mode[:, :n]
    np.testing.assert_allclose(off, (rest**2 / mass).sum(axis=1), atol=1e-12 * (bent**2).max())
