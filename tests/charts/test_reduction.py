"""Reduction: the spring against closed forms, barriers probe_at on both sides, the arch."""

import numpy as np
import pytest
from scipy.spatial import cKDTree

import equimorph as em
import sets
from equimorph.charts.location import Found
from equimorph.charts.path_rules import Unloaded
from equimorph.charts.rules import first_of_each
from equimorph.errors import InputError
from equimorph.manifold.geometry.points import VertexKind
from oracles.charted import lifted, spring_fold
from oracles.polynomial import fold_form
from typecheck import unchecked


def reduced(eset, prefer, **options):
    with unchecked():
        return em.reduce(eset, prefer=prefer, **options)


@pytest.fixture(scope="module")
def by_energy(spring_set):
    return reduced(spring_set, em.charts.lowest(spring_set.structure.descriptor("energy")))


@pytest.fixture(scope="module")
def loaded(spring_set):
    return reduced(spring_set, em.quasi_static("F"))


@pytest.fixture(scope="module")
def first_stable(spring_set):
    return reduced(spring_set, em.first_stable_on_path("F"))


def test_energies_of_the_spring_are_equal_on_its_axis(by_energy):
    """By symmetry the barrier is F = 0 from the box to the cusp; it jumps from δ to −δ."""
    (barrier,) = by_energy.barriers
    assert barrier.kind == "tie"
    assert np.abs(barrier.points[:, 1]).max() < 1e-9
    x = barrier.points[:, 0]
    assert x.min() == pytest.approx(0.3, abs=1e-12)
    assert x.max() == pytest.approx(1.0, abs=1e-5)
    off = x < 0.999  # at the cusp both sides are one
    np.testing.assert_allclose(barrier.jump[off], 2.0 * np.arccos(x[off]), rtol=0, atol=1e-5)
    assert by_energy.gaps.loops == ()
    assert by_energy.domain.size == pytest.approx(1.0, abs=1e-3)


def test_the_spring_of_least_energy_leans_against_its_force(by_energy):
    at = np.random.default_rng(2).uniform((0.3, -0.5), (1.3, 0.5), (500, 2))
    with unchecked():
        found = by_energy.state(at)
    assert found.inside.all()
    assert (np.sign(found.states.z[:, 0]) == -np.sign(at[:, 1])).all()


def test_points_on_a_barrier_are_named(by_energy):
    found = by_energy.state(np.array([[0.5, 0.0], [0.5, 1e-6], [0.2, 0.0]]))
    assert found.status.tolist() == ["barrier", "inside", "beyond the box"]


def test_a_loaded_spring_has_a_gap_beyond_its_fold(loaded):
    """Natural state δ = arccos x_l > 0: for x_l < 1 it snaps at F = (1 − x_l^⅔)^(3/2)."""
    x = np.linspace(0.3, 1.0, 10_001)
    area = np.trapezoid(0.5 - spring_fold(x), x)
    assert loaded.gaps.size == pytest.approx(area, rel=5e-3)
    assert loaded.barriers == ()
    at = np.random.default_rng(3).uniform((0.3, -0.5), (1.3, 0.5), (500, 2))
    with unchecked():
        found = loaded.state(at)
    gap = (at[:, 0] < 1.0) & (at[:, 1] > spring_fold(at[:, 0]))
    assert np.array_equal(found.status, np.where(gap, "gap", "inside"))
    own = at[:, 0] < 1.0
    assert (found.states.z[own & ~gap, 0] > 0.0).all()


def test_the_first_stable_spring_jumps_at_its_fold(first_stable):
    """Through the fold to the other sheet: the barrier is the fold itself, F > 0."""
    (barrier,) = first_stable.barriers
    assert barrier.kind == "fold"
    x, force = barrier.points.T
    np.testing.assert_allclose(force, spring_fold(x), rtol=0, atol=1e-8)
    delta = np.arccos(np.cbrt(x))
    off = x < 0.999  # at the cusp both sides are one
    np.testing.assert_allclose(barrier.near.z[off, 0], delta[off], rtol=0, atol=1e-7)
    assert (barrier.far.z[x < 0.99, 0] < 0.0).all()


@pytest.mark.parametrize("which", ["by_energy", "first_stable"])
def test_barriers_are_just_where_the_state_jumps(which, request):
    """Probed 1e-6 on both sides of every point off the cusp; across along F here."""
    chart = request.getfixturevalue(which)
    (barrier,) = chart.barriers
    some = barrier.points[:, 0] < 0.98
    at = barrier.points[some]
    aside = np.array([0.0, 1e-6])
    inner = (at[:, 1] > -0.499) & (at[:, 1] < 0.499)
    with unchecked():
        above, below = chart.state(at[inner] + aside), chart.state(at[inner] - aside)
    gap = np.abs(above.states.z - below.states.z)[:, 0]
    np.testing.assert_allclose(gap, barrier.jump[some][inner], rtol=0.02, atol=5e-3)
    # and nowhere else
    away = np.random.default_rng(4).uniform((0.31, -0.49), (1.29, 0.49), (400, 2))
    clear = barrier.distance(away, np.ones(2)) > 0.02
    with unchecked():
        up, down = chart.state(away[clear] + aside), chart.state(away[clear] - aside)
    assert np.abs(up.states.z - down.states.z).max() < 1e-3


@pytest.mark.parametrize("which", ["by_energy", "loaded", "first_stable"])
def test_reduced_charts_are_single_valued(which, request):
    chart = request.getfixturevalue(which)
    with unchecked():
        assert chart.single_valued
        at = np.random.default_rng(6).uniform((0.3, -0.5), (1.3, 0.5), (200, 2))
        found = chart.state(at)
        own = found.states[found.inside]
        assert chart.contains(own).all()
        np.testing.assert_allclose(chart.coords(own), at[found.inside], rtol=0, atol=1e-10)


def test_a_function_of_states_and_other_rules_prefer(spring_set):
    angle = spring_set.structure.angle
    chart = reduced(spring_set, lambda states: -angle(states))
    twin = reduced(spring_set, em.charts.highest(angle))
    upper = spring_set.at(x_l=0.5, F=0.0).stable[0]
    near = reduced(spring_set, em.charts.nearest(upper))
    at = np.array([[0.5, 0.1], [0.6, -0.05], [1.2, 0.2]])
    with unchecked():
        values = [each.state(at).states.z[:, 0] for each in (chart, twin)]
    assert values[0] == pytest.approx(values[1], abs=1e-12)
    assert values[0][0] > 0.0
    assert np.sign(near.state(at).states.z[0, 0]) == np.sign(upper.z[0])


def test_tasks_obey_a_reduction(spring_set, by_energy):
    """From δ > 0 to δ < 0 at x_l = 0.5 around the cusp, but not through the barrier."""
    start = by_energy.state(np.array([[0.5, -0.05]])).states[0]
    goal = by_energy.state(np.array([[0.5, 0.05]])).states[0]
    path = em.lift(start, to={"F": 0.05}, within=[by_energy.constraint])
    assert path.end.kind == "constraint"
    assert path.end.state["F"] == pytest.approx(0.0, abs=1e-6)
    route = em.plan(by_energy.eset, start, goal)
    assert route.arrived


def test_reduction_over_one_parameter():
    """x² = a: the stable half is preferred from a = 0 on."""
    eset = lifted(fold_form(), em.Box(a=(-1, 1)), (7,))
    chart = reduced(eset, em.charts.highest(eset.structure.descriptor("0")), stable=False)
    found = chart.state(np.array([[-0.5], [0.25]]))
    assert found.status.tolist() == ["gap", "inside"]
    assert found.states.z[1, 0] == pytest.approx(0.5, abs=1e-12)
    assert chart.barriers == ()


def test_the_reduced_arch_agrees_with_single_paths(arch_set):
    """First stable state on the path in q, at random settings; jumps of the map at barriers."""
    chart = reduced(arch_set, em.first_stable_on_path("q"))
    arch = arch_set.structure
    at = np.random.default_rng(7).uniform((0.3, -1.2), (1.6, 1.2), (12, 2))
    with unchecked():
        found = chart.state(at)
    for point, inside, z in zip(at, found.inside, found.states.z, strict=True):
        rest = arch.natural_state(Theta=point[0], Delta=point[1])
        path = em.lift(rest, to={"q": 2.5}, within=arch_set.constraints)
        if path.end.kind == "arrived":
            assert inside
            assert np.abs(z - path.end.state.z).max() < 1e-7
    assert len(chart.barriers) > 0
    assert chart.lost <= 2
    # states on the bound are ends of their paths: nothing is cut off just before it
    capped = np.isin(arch_set.kinds, (VertexKind.CAP, VertexKind.CORNER))
    gap, _ = cKDTree(arch_set.coordinates[capped]).query(chart.eset.coordinates[chart.cut])
    assert gap.min() > 1e-6


@pytest.mark.slow
def test_quasi_static_paths_of_the_arch_change_where_they_merge_with_folds_or_meet_the_bound():
    """Each change has a cause: the unloaded arch has max |κ| = 20, or Newton's cusp is confirmed.

    Arches that exceed the bound before they are loaded have no path. `lift` follows single paths.
    """
    eset = sets.arch_set((12, 21))
    chart, arch = reduced(eset, em.quasi_static("q")), eset.structure
    cut = chart.eset.points[chart.cut]
    rest, found = Unloaded.of(eset, "q").natural(cut.p)
    start = cut.p.copy()
    start[:, 2] = 0.0
    with unchecked():
        bent = arch.max_curvature.function(rest, start)
    bounded = found & (np.abs(bent - 20.0) < 1e-7)
    assert bounded.sum() > 10
    assert (~bounded).sum() > 10
    for p in cut.p[~bounded][::7]:
        for theta, delta in p[:2] * (1.0 + np.array([[1e-3, 0.0], [-1e-3, 0.0]])):
            state = arch.natural_state(Theta=theta, Delta=delta)
            arrives = arch.max_curvature(state) <= 20.0
            with unchecked():
                if arrives:
                    path = em.lift(state, {"q": 2.5}, within=eset.constraints)
                    arrives = path.end.kind == "arrived"
                inside = chart.state(np.array([[theta, delta]])).inside
            assert inside[0] == arrives, (theta, delta)


def test_wrong_reductions_are_refused(spring_set):
    with unchecked(), pytest.raises(InputError, match="`prefer` must be a rule"):
        em.reduce(spring_set, prefer="lowest")
    with pytest.raises(InputError, match="`parameter` must be a load"):
        em.reduce(spring_set, prefer=em.quasi_static("x_l"))
    with pytest.raises(InputError, match="`nearest` must name one of 2 strata"):
        em.reduce(spring_set, prefer=em.charts.nearest(7))


def test_of_equally_preferred_states_the_highest_is_taken():
    """Mirror images over F = 0 have one energy; the elevation of the spring is its angle."""
    spring = em.Spring()
    z, p = np.array([[-0.6], [0.6], [0.0]]), np.tile([0.8, 0.0, 1.0], (3, 1))
    none = np.zeros(3, int)
    found = Found(em.States(spring, z, p), none, none, np.ones(3, bool))
    energy = spring.energy(z, p)
    assert energy[0] == energy[1] < energy[2]
    assert first_of_each(found, energy, spring.elevation).tolist() == [False, True, False]
    assert first_of_each(found, -energy, spring.elevation).tolist() == [False, False, True]
