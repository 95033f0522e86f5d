"""Vectors of doubles inside compiled kernels."""

import numpy as np
from numba import njit

from equimorph.linalg.simd import LANES, load, sincos, store, transpose, work_rows


@njit
def _sincos_rows(angles, sines, cosines):
    for row in range(angles.shape[0]):
        sine, cosine = sincos(load(angles, row))
        store(sines, row, sine)
        store(cosines, row, cosine)


@njit
def _transpose(source, target):
    transpose(source, 2, 11, target, 0, LANES)


def test_sine_and_cosine_are_exact_to_two_units_in_the_last_place():
    """Oracle: the C library in extended precision, angles up to 10⁴.

    Two units: half for rounding, one for the unsplit 1 − x²/2, half for the reduced angle. Where
    the value nearly vanishes, the reduced angle's rounding counts absolutely: 2⁻⁵³.
    """
    generator = np.random.default_rng(0)
    angles = np.concatenate(
        [generator.uniform(-10, 10, 40000), generator.uniform(-1e4, 1e4, 8000), np.arange(-8, 8)]
    )
    angles = np.concatenate([angles, np.arange(-8, 8) * np.pi / 2]).reshape(-1, LANES)
    sines, cosines = np.empty_like(angles), np.empty_like(angles)
    _sincos_rows(angles, sines, cosines)
    for found, exact in ((sines, np.sin), (cosines, np.cos)):
        reference = exact(angles.astype(np.longdouble))
        error = np.abs(found - reference).astype(float)
        bound = np.maximum(2.0 * np.spacing(np.abs(reference).astype(float)), 2.0**-53)
        assert (error <= bound).all()


def test_sine_and_cosine_of_what_is_no_number_are_not_numbers():
    angles = np.array([np.nan, np.inf, -np.inf, 0.0, 1.0, 2.0, 3.0, 4.0]).reshape(-1, LANES)
    sines, cosines = np.empty_like(angles), np.empty_like(angles)
    _sincos_rows(angles, sines, cosines)
    assert np.isnan(sines.flat[:3]).all()
    assert np.isnan(cosines.flat[:3]).all()
    assert np.isfinite(sines.flat[3:]).all()


def test_transposition_moves_every_entry_to_its_mirror_place():
    source, target = np.arange(11.0 * LANES).reshape(LANES, 11), np.empty((LANES, LANES))
    _transpose(source, target)
    np.testing.assert_array_equal(target, source[:, 2 : 2 + LANES].T)


def test_work_arrays_start_on_a_cache_line():
    assert all(work_rows(rows).ctypes.data % 64 == 0 for rows in range(1, 40))
