"""Compiled kernels of Newton's method with conditions against the same in numpy."""

import numpy as np
import pytest

import equimorph as em
from equimorph.equilibria.critical import Critical
from equimorph.equilibria.newton_kernels import amount_lanes, judge_lanes, move_lanes, null_lanes
from equimorph.structures.newton_kernels import (
    FOUND,
    NEAR,
    NOT_SHRINKING,
    OPEN,
    SINGULAR,
    TOO_LONG,
    UNFINISHED,
)

LANES = 11
ROUND_OFF = 1e-12
"""Tolerance of sums of at most a hundred terms near one in another order."""


@pytest.fixture
def generator():
    return np.random.default_rng(4)


@pytest.mark.parametrize("k", [1, 2, 3])
def test_amounts_solve_the_conditions(generator, k):
    """Regular slopes as by numpy; dependent ones are told, and their amounts are no numbers."""
    slopes, value = generator.normal(size=(LANES, k, k)), generator.normal(size=(LANES, k))
    slopes[3, -1] = 0.0 if k == 1 else slopes[3, 0]
    slopes[5, 0, 0] = np.nan
    amount, regular = np.empty((LANES, k)), np.empty(LANES, bool)
    amount_lanes(slopes, value, amount, regular)
    assert np.flatnonzero(~regular).tolist() == [3, 5]
    assert np.isnan(amount[~regular]).all()
    solved = np.linalg.solve(slopes[regular], -value[regular, :, None])[:, :, 0]
    np.testing.assert_allclose(amount[regular], solved, rtol=1e-9)


@pytest.mark.parametrize("unfolded", [False, True])
def test_null_vectors_are_those_of_the_bordered_matrix(unfolded):
    """Near a fold tangents and one solution more tell what a solve with [F_z b; bᵀ 0] tells."""
    arch = em.Rod(load="left-half")
    end = em.limit_load(arch.natural_state(Theta=0.9, Delta=0.0), "q").state
    z = np.tile(end.z, (LANES, 1)) + 1e-3 * np.cos(np.arange(LANES * arch.size)).reshape(LANES, -1)
    p, k, size = np.tile(end.p, (LANES, 1)), 2, arch.size
    directions = np.tile(np.eye(4)[[0, 2]], (LANES, 1, 1))
    b = np.cos(np.arange(LANES * size)).reshape(LANES, size)
    system = arch.linear_system(z, p, directions)
    width = k + unfolded
    rows = np.cos(np.outer(np.arange(1, width + 1), 1.7 * np.arange(size + width)))
    rows, rhs = np.tile(rows, (LANES, 1, 1)), np.zeros((LANES, width + 2, size + width))
    rhs[:, :width, size:], rhs[:, -1, :size] = np.eye(width), b
    columns = np.concatenate([system.columns, b[:, None]][: 1 + unfolded], axis=1)
    x = system.solve(rhs, (columns, rows[:, :, :size], rows[:, :, size:])).x
    null = np.empty((LANES, size + 1))
    null_lanes(x, size, k, b, null)
    at = Critical(arch, z, p, b)
    np.testing.assert_allclose(null[:, :-1], at.v, atol=1e-8 * np.abs(at.v).max())
    np.testing.assert_allclose(null[:, -1], at.g, atol=1e-8)


def test_points_move_by_shares_of_steps(generator):
    """z + share dz, p + share da·directions, β + share dβ; without a share nothing moves."""
    z, p, beta = (
        generator.normal(size=(LANES, 5)),
        generator.normal(size=(LANES, 4)),
        np.ones(LANES),
    )
    directions, change = generator.normal(size=(LANES, 2, 4)), generator.normal(size=(LANES, 8))
    share = generator.uniform(size=LANES)
    share[2], change[2] = 0.0, np.nan
    new = np.empty_like(z), np.empty_like(p), np.empty_like(beta)
    move_lanes(z, p, beta, change, directions, share, *new)
    step = np.where(share == 0.0, 0.0, np.nan_to_num(change).T * share).T
    along = np.einsum("lk,lkp->lp", step[:, 5:7], directions)
    for found, wanted in zip(new, (z + step[:, :5], p + along, beta + step[:, 7]), strict=True):
        np.testing.assert_allclose(found, wanted, atol=ROUND_OFF)


@pytest.mark.parametrize("last", [False, True])
@pytest.mark.parametrize("free", [False, True])
def test_steps_are_judged_by_their_lengths(generator, free, last):
    """Each rule of `Guards` on lengths from 1e-12 to 10, against the rules written for arrays."""
    weights = np.array([0.5, 2.0, 0.0])
    wanted = 10.0 ** generator.uniform(-12, 1, 200)
    before = wanted * 10.0 ** generator.uniform(-1, 4, 200)
    change = generator.normal(size=(200, 3))
    change *= (wanted / np.sqrt(change**2 @ weights))[:, None]
    change[7] = np.nan
    factor = np.where(np.arange(200) % 3 == 0, -1.5, 1.0)
    limits, too_long, longest = (1e-9, 1e-13, 0.5), np.full(200, 5.0), 0.3
    converged, following, contraction = limits
    size, share, status = np.empty(200), np.empty(200), np.empty(200, int)
    given = (change, weights, factor, before, limits, too_long, longest, (free, last))
    judge_lanes(*given, size, status, share)
    length = np.sqrt(change**2 @ weights)
    np.testing.assert_allclose(size, length, rtol=ROUND_OFF)
    small = (length < converged) | ((length < NEAR) & (length**3 < following * before**2))
    rules = [
        (~np.isfinite(length), SINGULAR),
        (~(length < too_long), TOO_LONG),
        (~small & ~(length <= contraction * before) & (not free), NOT_SHRINKING),
        (small, FOUND),
    ]
    goes_on = UNFINISHED if last else OPEN
    expected = np.select([rule for rule, _ in rules], [state for _, state in rules], goes_on)
    assert np.array_equal(status, expected)
    assert len(np.unique(status)) == 4 + (not free)
    taken = factor * np.minimum(1.0, longest / np.abs(factor * length))
    taken = np.where(expected > UNFINISHED, 0.0, taken)
    np.testing.assert_allclose(share, taken, rtol=ROUND_OFF)
