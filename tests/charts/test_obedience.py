"""Tasks obey barriers: the spring of least energy, whose barrier F = 0 is known."""

import numpy as np
import pytest
from scipy.optimize import brentq

import equimorph as em
from oracles.charted import lifted
from oracles.polynomial import Polynomial
from oracles.surfaces import integral, three_sheets
from typecheck import unchecked


@pytest.fixture(scope="module")
def by_energy(spring_set):
    with unchecked():
        return em.reduce(
            spring_set, prefer=em.charts.lowest(spring_set.structure.descriptor("energy"))
        )


def test_shapes_beyond_a_barrier_are_none(by_energy):
    """At x_l = 0.5 δ = 0.95 needs F > 0, where −δ has less energy; δ = 1.2 needs F < 0."""
    spring = by_energy.whole.structure
    length = em.value_of(spring, "x_l")
    with unchecked():
        for eset, delta, count in (
            (by_energy.eset, 0.95, 0),
            (by_energy.whole, 0.95, 0),
            (by_energy.eset, 1.2, 1),
        ):
            within = [by_energy.constraint]
            found = em.solve_shape(eset, {spring.angle: delta, length: 0.5}, within=within)
            assert len(found.states) == count


def test_a_motion_ends_at_the_barrier(by_energy):
    """δ decreases as F rises to 0, where δ = arccos x_l; without the barrier it goes on."""
    angle = by_energy.whole.structure.angle
    with unchecked():
        start = by_energy.state(np.array([[0.5, -0.05]])).states[0]
        within = [by_energy.constraint]
        motion = em.track(start, {angle: 0.95}, actuators=["F"], within=within)
        free = em.track(start, {angle: 0.95}, actuators=["F"])
    assert motion.status == "refused"
    assert "not preferred" in motion.why
    end = motion.path.states[-1]
    assert end["F"] == pytest.approx(0.0, abs=1e-9)
    assert angle(end) == pytest.approx(np.arccos(0.5), abs=1e-9)
    assert free.status == "arrived"


def test_an_optimum_lies_on_the_barrier_but_not_beyond(by_energy):
    """Least (δ − 0.9)² + (x_l − 0.5)² where F = 0, δ = arccos x_l; the free one has F = 0.153."""

    def gap(z, p):
        return (z[:, 0] - 0.9) ** 2 + (p[:, 0] - 0.5) ** 2

    with unchecked():
        found = em.optimise(
            by_energy.eset, em.Descriptor("gap", "1", gap), within=[by_energy.constraint]
        )
    best = brentq(lambda x: x - 0.5 - (np.arccos(x) - 0.9) / np.sqrt(1.0 - x**2), 0.5, 0.7)
    assert found.best.certificate.kind == "constraint"
    assert found.best.state["x_l"] == pytest.approx(best, abs=1e-7)
    assert found.best.state["F"] == pytest.approx(0.0, abs=1e-9)


def test_the_sheet_nearest_to_a_stratum_is_itself():
    """x³ − 9x + (a + b)/2: stable sheets near ±3, told apart by their strata."""
    eset = lifted(three_sheets(), em.Box(a=(-3, 3), b=(-3, 3)), (4, 4))
    at = np.array([[0.5, 0.5], [-2.0, 1.0]])
    for number, stratum in enumerate(eset.strata):
        if stratum.index:
            continue
        own = eset.points.z[eset.cells[eset.stratum == number][0], 0]
        with unchecked():
            chart = em.reduce(eset, prefer=em.charts.nearest(number))
            found = chart.state(at)
        assert chart.barriers == ()
        assert found.inside.all()
        assert (np.sign(found.states.z[:, 0]) == np.sign(own[0])).all()


def test_a_barrier_over_three_parameters_is_a_surface():
    """Least −x (a − 0.3) of two sheets x ≈ ±3 jumps at a = 0.3; probe_at at 1e-6 on both sides."""
    sheets = Polynomial(
        lambda x, a, b, c: integral(x**3 - 9.0 * x + 0.5 * a + 0.5 * b + 0.3 * c),
        1,
        ("a", "b", "c"),
    )
    eset = lifted(sheets, em.Box(a=(-3, 3), b=(-3, 3), c=(-3, 3)), (2, 2, 2))
    with unchecked():
        chart = em.reduce(eset, prefer=lambda states: -states.z[:, 0] * (states["a"] - 0.3))
        (barrier,) = chart.barriers
        at = np.array([[0.3 + 1e-6, 0.2, 0.1], [0.3 - 1e-6, 0.2, 0.1]])
        found = chart.state(at)
        assert chart.single_valued
    assert barrier.kind == "tie"
    np.testing.assert_allclose(barrier.points[:, 0], 0.3, rtol=0, atol=3e-7)
    assert barrier.facets.shape[1] == 3
    assert found.states.z[0, 0] > 2.9
    assert found.states.z[1, 0] < -2.9


def test_reaching_sampling_and_following_stop_at_the_barrier(by_energy):
    """From δ at (0.5, −0.05) nothing leads to F > 0, where −δ has less energy."""
    spring = by_energy.whole.structure
    within, force = [by_energy.constraint], em.value_of(spring, "F")
    with unchecked():
        start = by_energy.state(np.array([[0.5, -0.05]])).states[0]
        goal = em.lift(start, {"F": 0.05}).end.state
        reach = em.reachable(by_energy.whole, start, [spring.angle, force], within=within)
        few = em.SamplingOptions(lifts=200)
        room = em.Box(x_l=(0.4, 0.9), F=(-0.2, 0.2))
        sampled = em.plan_sampled(start, goal, room, within=within, options=few)
        pull = em.function_of("pull", lambda f: (f - 0.1) ** 2, force)
        moved = em.follow_optimum(start, pull, {"x_l": 0.55}, actuators=["F"], within=within)
    assert reach.states["F"].max() <= 1e-6
    assert sampled.status == "refused"
    assert moved.states["F"].max() <= 1e-6
