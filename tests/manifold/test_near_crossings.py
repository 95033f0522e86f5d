"""States over points close to where sheets cross: closed forms of pitchforks and transcriticals."""

import numpy as np
import pytest
from hypothesis import given, strategies as st

from draws import few
from equimorph.manifold import EquilibriumSet, equilibrium_set, part, refine
from equimorph.model import Box
from oracles.surfaces import pitchforks, transcriticals
from typecheck import unchecked

factors = st.sampled_from([-2.0, -0.7, 0.6, 1.0, 1.9])
slants = st.sampled_from([-0.4, 0.0, 0.3])
BOX = Box(a=(-1.0, 1.1), b=(-1.0, 1.2))
MERGED = 1e-5
"""Distance below which states may be returned as one."""


def lifted(structure, box=BOX, grid=(4, 5), **options) -> EquilibriumSet:
    with unchecked():  # shapes are checked on small sets elsewhere
        return equilibrium_set(structure, box, checks=0, intervals=grid, **options)


def pitchfork_roots(cubic: float, u: float) -> tuple[np.ndarray, np.ndarray]:
    """Roots of x (cubic·x² − u), in order, and the index of each."""
    side = [np.sqrt(u / cubic)] if u / cubic > 0.0 else []
    x = np.array([*(-root for root in side), 0.0, *side])
    return x, (3.0 * cubic * x**2 - u < 0.0).astype(int)


def transcritical_roots(skew: float, u: float) -> tuple[np.ndarray, np.ndarray]:
    """Roots of x (skew·x − u), in order, and the index of each."""
    x = np.sort([0.0, u / skew])
    return x, (2.0 * skew * x - u < 0.0).astype(int)


def assert_all_are_found(eset: EquilibriumSet, slant: float, b: np.ndarray, roots) -> None:
    """Over points at ±10⁻³ … ±10⁻¹² from the crossing a + slant·b = 0; `roots` of a + slant·b.

    All states that are farther apart than `MERGED`, none besides, each with its index.
    """
    away = np.array([s * 10.0**-k for k in range(3, 13) for s in (-1.0, 1.0)])
    away, b = np.repeat(away, len(b)), np.tile(b, len(away))
    a = away - slant * b
    free = {"a": a, "b": b}
    with unchecked():
        over = eset.over(**{name: free[name] for name in eset.names})
    for states, u in zip(over, a + slant * b, strict=True):
        x, index = roots(u)
        order = np.argsort(states.states.z[:, 0])
        found, found_index = states.states.z[order, 0], states.index[order]
        if np.diff(x).min(initial=1.0) > 2.1 * MERGED:
            np.testing.assert_allclose(found, x, atol=1e-10)
            assert np.array_equal(found_index, index)
            assert (states.cell >= 0).all()
            assert np.array_equal(eset.cell_index[states.cell[order]], found_index)
        else:
            gap = np.abs(x[:, None] - found)
            assert gap.min(axis=1).max() <= 2.1 * MERGED
            assert gap.min(axis=0).max() <= MERGED
            assert np.isin(found_index, index).all()


@few(2)
@given(factors, slants, st.integers(0, 99))
def test_all_three_states_beside_a_pitchfork_curve(cubic, slant, seed):
    eset = lifted(pitchforks(cubic, slant))
    b = np.random.default_rng(seed).uniform(-0.99, 1.19, 1)
    assert_all_are_found(eset, slant, b, lambda u: pitchfork_roots(cubic, u))


@few(2)
@given(factors, slants, st.integers(0, 99))
def test_both_states_beside_a_transcritical_curve(skew, slant, seed):
    eset = lifted(transcriticals(skew, slant))
    b = np.random.default_rng(seed).uniform(-0.99, 1.19, 1)
    assert_all_are_found(eset, slant, b, lambda u: transcritical_roots(skew, u))


@pytest.mark.slow
@pytest.mark.parametrize("cubic", [-2.0, 1.0])
def test_refined_sets_lose_no_state_beside_their_crossings(cubic):
    with unchecked():
        eset = refine(lifted(pitchforks(cubic, 0.3)), 0.01)
    b = np.random.default_rng(3).uniform(-0.99, 1.19, 20)
    assert_all_are_found(eset, 0.3, b, lambda u: pitchfork_roots(cubic, u))


@pytest.mark.parametrize("cubic", [-0.7, 1.0])
def test_diagrams_lose_no_state_beside_their_branch_points(cubic):
    eset = lifted(pitchforks(cubic, 0.0), Box(a=(-1.0, 1.3)), (7,), fixed={"b": 0.0})
    assert_all_are_found(eset, 0.0, np.zeros(1), lambda u: pitchfork_roots(cubic, u))


def test_part_of_a_set_has_only_its_own_states_beside_its_crossing():
    """Of the subcritical pitchfork only x = 0, a + 0.3·b < 0, is stable."""
    with unchecked():
        eset = lifted(pitchforks(-1.0, 0.3))
        stable = part(eset, eset.cell_index == 0)
        away = np.array([-1e-4, -1e-6, -1e-8, 1e-4, 1e-6])
        over = stable.over(a=away - 0.3 * 0.2, b=np.full(5, 0.2))
    assert [states.index.tolist() for states in over] == [[0], [0], [0], [], []]
    np.testing.assert_allclose(over.states.z, 0.0, atol=1e-10)
