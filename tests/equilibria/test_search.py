"""All equilibria at given parameters."""

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

import equimorph as em
from equimorph.equilibria import distinct, search_points, settle
from equimorph.equilibria.random_search import Ground, Pools
from equimorph.errors import InputError
from oracles.polynomial import Polynomial, pitchfork_form

QUICK = settings(max_examples=5, deadline=None, derandomize=True)
AT = {"Theta": 1.0, "Delta": 0.0, "q": 2.5}


@pytest.fixture(scope="module")
def arch():
    return em.Rod(elements=6, degree=6)


@QUICK
@given(a=st.floats(0.5, 2.0), b=st.floats(-0.1, 0.1), sign=st.sampled_from([1.0, -1.0]))
def test_all_roots_of_a_cubic_are_found(a, b, sign):
    """±x³ − a x = b: as many states as `numpy.roots` has real roots, sorted by energy."""
    found = em.find_equilibria(pitchfork_form(sign), {"a": sign * a, "b": sign * b}, starts=40)
    roots = np.roots([1.0, 0.0, -a, -b])
    assert sorted(found.z[:, 0]) == pytest.approx(sorted(roots.real), abs=1e-9)
    assert (np.diff(found.energy) >= 0).all()
    assert (found.residual < 1e-10).all()


def test_equilibria_of_a_plane_lattice_are_counted_with_their_indices():
    """E = Σ (x⁴/4 − x²/2) over two unknowns: nine states, indices 0, 1, 2 as 4, 4, 1."""
    plane = Polynomial(
        lambda x, y, a: (x**4 + y**4) * 0.25 - (x**2 + y**2) * 0.5 + a * 0.0, 2, ("a",)
    )
    found = em.find_equilibria(plane, {}, starts=200)
    assert np.bincount(found.index).tolist() == [4, 4, 1]
    assert found.z[found.index == 2] == pytest.approx(np.zeros((1, 2)), abs=1e-9)


def test_same_seed_finds_the_same_states_in_the_same_order(arch):
    first = em.find_equilibria(arch, AT, within=[arch.max_curvature <= 20], starts=60, seed=3)
    again = em.find_equilibria(arch, AT, within=[arch.max_curvature <= 20], starts=60, seed=3)
    assert np.array_equal(first.z, again.z)


@pytest.mark.parametrize("seed", [1, 2])
def test_every_seed_finds_the_five_states_of_the_arch(arch, seed):
    """PHYSICS §5. The mirror completes pairs, so that heights come in equal pairs."""
    found = em.find_equilibria(arch, AT, within=[arch.max_curvature <= 20], seed=seed)
    assert sorted(found.index) == [0, 0, 1, 1, 2]
    assert (np.diff(found.energy) > -1e-12).all()


def test_mirror_images_are_states_too(arch):
    found = em.find_equilibria(arch, AT, within=[arch.max_curvature <= 40], starts=100)
    z, p = arch.symmetries()[0].apply(found.z, found.p)
    images = em.States(arch, z, p)
    assert (images.residual < 1e-9).all()
    assert len(distinct(arch, np.concatenate([found.z, z]))) == len(found)


def test_a_search_beside_known_states_finds_the_others():
    """E = Σ (x⁴/4 − x²/2) over two unknowns: nine states, whatever part of them is known."""
    plane = Polynomial(
        lambda x, y, a: (x**4 + y**4) * 0.25 - (x**2 + y**2) * 0.5 + a * 0.0, 2, ("a",)
    )
    every = em.find_equilibria(plane, {}, starts=200)
    for some in ([], [0], [1, 4, 8], list(range(9))):
        (found,) = search_points(plane, every.p[:1], starts=60, runs=1, known=every[some])
        np.testing.assert_allclose(np.sort(found.energy), every.energy, atol=1e-12)
        told = found.completeness
        assert told.captured[0].sum() == len(some)
        assert told.captured[1:].any(axis=0).all()  # what was known is met again
    with pytest.raises(InputError, match="`known` must lie over the points"):
        search_points(plane, every.p[:1] + 1.0, known=every)


def test_known_states_to_which_nothing_leads_are_not_caught():
    """Of three known states of E = x⁴/4 − x²/2 Newton's method leads to one, twice."""
    plane = pitchfork_form(1.0)
    z = np.zeros((3, plane.size))
    z[:, 0] = [-1.0, 0.0, 1.0]
    point = np.array([[1.0, 0.0]])
    pools = Pools(Ground(plane, point, ()), np.random.default_rng(0), z, np.zeros(3, int))
    assert len(pools.caught(0)) == 0
    pools._take(np.repeat(z[2:], 2, axis=0) + 1e-12, np.zeros(2, int))
    assert pools.caught(0)[:, 0] == pytest.approx([1.0])
    assert len(pools.z) == 3


def test_nothing_outside_the_constraints_is_returned(arch):
    wide = em.find_equilibria(arch, AT, within=[arch.max_curvature <= 20], starts=150)
    narrow = em.find_equilibria(
        arch, AT, within=[arch.max_curvature <= 8, arch.height(0.5) >= 0.06], starts=150
    )
    kept = (arch.max_curvature(wide) <= 8) & (arch.height(0.5)(wide) >= 0.06)
    assert 0 < len(narrow) == kept.sum() < len(wide)
    assert np.allclose(narrow.energy, wide.energy[kept], rtol=1e-10)


def test_no_equilibrium_is_an_answer():
    """x² = a < 0 has none."""
    empty = em.find_equilibria(
        Polynomial(lambda x, a: x**3 * (1 / 3) - a * x, 1, ("a",)), {"a": -1.0}, starts=20
    )
    assert len(empty) == 0


@pytest.mark.parametrize(
    ("at", "message"),
    [
        ({"Theta": 1.0, "theta": 1.0}, "`theta` must be a parameter"),
        ({"Delta": 0.0}, "`Theta` must be given; got no value"),
        ({"Theta": 1.0, "nu": 1.2}, "`nu` must be a finite number between 0 and 1"),
    ],
)
def test_parameters_without_meaning_are_refused(arch, at, message):
    with pytest.raises(InputError, match=message):
        em.find_equilibria(arch, at)


def test_newton_reports_lanes_without_root_and_keeps_the_others():
    """x² = a: the lane with a < 0 has no root, and does not spoil the lane with a > 0."""
    form = Polynomial(lambda x, a: x**3 * (1 / 3) - a * x, 1, ("a",))
    near = settle(form, np.array([[3.0], [3.0]]), np.array([[4.0], [-1.0]]))
    assert near.found.tolist() == [True, False]
    assert near.z[0, 0] == pytest.approx(2.0, rel=1e-14)
