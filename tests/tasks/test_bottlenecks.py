"""The lowest peak of a route: closed forms on the spring, kinks, folds, and grids that agree.

The spring's states are (δ, x_l) with F = k (1 − x_l/cos δ) sin δ; they are stable where
x_l > cos³δ, so that a route from δ > 0 to δ < 0 crosses δ = 0 at some x_l ≥ 1. There the margin is
k x_l (x_l − 1) and the effort of x_l is k (x_l − 1).
"""

import numpy as np
import pytest

import equimorph as em
import sets
from equimorph.errors import InputError
from equimorph.tasks.planning.bottlenecks import find_bottleneck
from typecheck import unchecked

SPRING = em.Spring()
LENGTH, LOAD = em.value_of(SPRING, "x_l"), em.value_of(SPRING, "F")
SADDLE = em.function_of("saddle", lambda x, d: (x - 1.1) ** 2 - d**2, LENGTH, SPRING.angle)
KINK = em.largest_of(
    "kink",
    em.function_of("low", lambda x, d: x - d**2, LENGTH, SPRING.angle),
    em.function_of("high", lambda x, d: 2.3 - x - d**2, LENGTH, SPRING.angle),
)
MARGIN = em.margin_of(SPRING)
EFFORT = em.effort_of(SPRING, "x_l")
CASES = {
    "fold at the cusp": (em.peak(LENGTH), (), 1.0, "fold"),
    "effort at the cusp": (em.peak(EFFORT), (), 0.0, "goal"),
    "absolute effort": (em.peak(abs(EFFORT)), (), 0.0, "goal"),
    "side of the box": (em.least(MARGIN), (), 1.3 * 0.3, "box"),
    "constraint": (em.least(MARGIN), (LENGTH <= 1.1,), 1.1 * 0.1, "constraint"),
    "smooth saddle": (em.peak(SADDLE), (), 0.0, "saddle"),
    "kink": (em.peak(KINK), (), 1.15, "kink"),
}


@pytest.fixture(scope="module")
def sides(spring_set):
    """Both stable states at x_l = 0.8 without load."""
    return tuple(spring_set.at(x_l=0.8, F=0.0).stable)


@pytest.mark.parametrize(("objective", "within", "value", "kind"), CASES.values(), ids=CASES)
def test_bottlenecks_of_the_spring_have_closed_forms(
    spring_set, sides, objective, within, value, kind
):
    """1e-8: round-off of the fold's test, whose bound is met to first order."""
    with unchecked():
        found = find_bottleneck(spring_set, sides, objective, within).bottleneck
    assert found.value == pytest.approx(value, abs=1e-8)
    assert found.kind == kind


@pytest.mark.parametrize(
    "name",
    [
        "kink",
        *(
            pytest.param(each, marks=pytest.mark.slow)
            for each in ("fold at the cusp", "constraint")
        ),
    ],
)
def test_a_route_attains_the_peak_and_none_is_lower(spring_set, sides, name):
    """The slack is 1e-3 of the peak or of its difference to the ends; the path has finite steps."""
    objective, within, value, _ = CASES[name]
    sign = objective.sign
    with unchecked():
        route = em.plan(spring_set, *sides, within=within, objective=objective)
        lower = objective.bound(value, -0.01)
        refused = em.plan(spring_set, *sides, within=(*within, lower))
    assert route.arrived
    assert route.objective == str(objective)
    assert -1e-3 <= sign * (route.cost - value) <= 2e-3
    assert not refused.arrived


def test_one_parameter_has_one_way():
    """At x_l = 1.2 every state is stable; the margin is least where the load is zero."""
    with unchecked():
        line = em.equilibrium_set(SPRING, em.Box(F=(-0.2, 0.2)), fixed={"x_l": 1.2})
        ends = tuple(line.at(F=load).stable[0] for load in (-0.15, 0.13))
        found = find_bottleneck(line, ends, em.least(MARGIN)).bottleneck
    assert (found.kind, found.value) == ("saddle", pytest.approx(1.2 * 0.2, abs=1e-10))
    assert found.state["F"] == pytest.approx(0.0, abs=1e-8)


def test_three_parameters_meet_an_edge_of_the_box():
    """The margin k x_l (x_l − 1) at δ = 0 is largest at the largest stiffness and length."""
    box = em.Box(x_l=(0.6, 1.25), F=(-0.3, 0.3), k=(0.5, 1.5))
    with unchecked():
        solid = em.equilibrium_set(SPRING, box, intervals=(5, 5, 3), checks=0)
        ends = tuple(solid.at(x_l=0.8, F=0.0, k=1.0).stable)
        found = find_bottleneck(solid, ends, em.least(MARGIN)).bottleneck
        cusp = find_bottleneck(solid, ends, em.peak(LENGTH)).bottleneck
    assert found.value == pytest.approx(1.5 * 1.25 * 0.25, abs=1e-9)
    assert (found.kind, len(found.active)) == ("box", 2)
    assert cusp.value == pytest.approx(1.0, abs=1e-8)


def test_ends_may_decide(arch_set, ends):
    """The goal's own largest curvature, and the start's own margin.

    Independent values at 19 925 vertices by another program: 10.54917, 0.926467.
    """
    arch = arch_set.structure
    with unchecked():
        kappa, margin = (
            find_bottleneck(arch_set, ends, objective).bottleneck
            for objective in (em.peak(arch.max_curvature), em.least(em.margin_of(arch)))
        )
    assert (kappa.kind, kappa.value) == ("goal", pytest.approx(10.54917, abs=1e-5))
    assert (margin.kind, margin.value) == ("start", pytest.approx(0.926467, abs=1e-6))


def test_wishes_without_meaning_are_refused_in_a_line(spring_set, sides):
    with unchecked():
        with pytest.raises(InputError, match=r"must not be the largest of several functions"):
            em.least(abs(EFFORT))
        with pytest.raises(InputError, match=r"`snap_price` must not be given with the objective"):
            em.plan(spring_set, *sides, objective=em.peak(LENGTH), snap_price=1.0)
        with pytest.raises(InputError, match=r"`slack` must be"):
            em.peak(LENGTH, slack=0.0)


def _strip_set(intervals):
    """A strip of 300 × 12 × 0.25 mm, span 270 mm, 50 g at a third of its length and its weight."""
    strip = em.Rod(
        EI=3280.0, length=300.0, span=270.0, units={"force": "N", "length": "mm"},
        loads={"F": em.PointForce(1 / 3), "g": em.LineLoad()},
    )  # fmt: skip
    weight = {"F": 0.05 * 9.81, "g": 7850 * 9.81 * 3e-9}
    box = em.Box(Theta=(-1.2, 1.2), Delta=(-1.2, 1.2))
    within = [strip.max_curvature <= 0.05]
    return em.equilibrium_set(strip, box, fixed=weight, within=within, intervals=(intervals,) * 2)


def _torque(strip):
    """Larger one of the couples of the two motors."""
    both = [em.effort_of(strip, name) for name in ("Theta", "Delta")]
    couples = [
        abs(em.function_of(f"M{s:+}", lambda a, b, s=s: 0.5 * (a + s * b), *both, unit="N mm"))
        for s in (1, -1)
    ]
    return em.largest_of("torque", *couples)


def truss_that_gives() -> em.Truss:
    """Two bars that change their lengths together; its folds meet in a cusp at a = 1 − √1.09."""
    return em.Truss(
        {"A": (-1.0, 0.0), "B": (0.0, 0.3), "C": (1.0, 0.0)},
        [em.Bar(ends, EA=1.0) for ends in (("A", "B"), ("B", "C"))],
        {"A": "xy", "C": "xy"},
        {"F": {"B": (0.0, -1.0)}},
        {"a": {"A-B": 1.0, "B-C": 1.0}},
    )


@pytest.mark.slow
def test_the_bars_of_a_truss_need_not_be_shorter_than_straight():
    """Its two folds meet in a cusp where the bars are straight: a = 1 − √1.09."""
    truss = truss_that_gives()
    box, height = em.Box(a=(-0.1, 0.03), F=(-0.02, 0.02)), truss.displacement("B", "y")
    objective = em.least(em.value_of(truss, "a"))
    with unchecked():
        for intervals in ((17, 17), (26, 26), (35, 35)):
            eset = em.equilibrium_set(truss, box, intervals=intervals)
            rest = eset.at(a=0.0, F=0.001).stable
            ends = max(rest, key=height), min(rest, key=height)
            found = find_bottleneck(eset, ends, objective).bottleneck
            assert found.kind == "fold"
            assert found.value == pytest.approx(1.0 - np.sqrt(1.09), abs=1e-10)


@pytest.mark.slow
def test_a_fold_beside_a_cusp_on_three_grids():
    """Θ is least not at the cusp (1.123276) but where the image of the fold is upright."""
    values = []
    with unchecked():
        for intervals in ((24, 41), (34, 58), (48, 83)):
            eset = sets.arch_set(intervals)
            here, rise = eset.at(Theta=1, Delta=0).stable, eset.structure.height(0.5)
            ends = max(here, key=rise), min(here, key=rise)
            objective = em.peak(em.value_of(eset.structure, "Theta"))
            values.append(find_bottleneck(eset, ends, objective).bottleneck.value)
        route = em.plan(eset, *ends, objective=objective)
    assert values == pytest.approx([values[0]] * 3, abs=1e-10)
    assert 1.123276 < values[0] < 1.12329
    assert route.arrived


@pytest.mark.slow
def test_least_motor_torque_that_inverts_a_steel_strip():
    """45.17736997 N mm at (0.0054643, −0.3424063) by another program; `plan` bisected: 45.2."""
    with unchecked():
        eset = _strip_set(25)
        strip, torque = eset.structure, _torque(eset.structure)
        rest = [em.optimise(eset, torque, within=[side]).best.state
                for side in (strip.height(0.5) >= 10, strip.height(0.5) <= -10)]  # fmt: skip
        found = [find_bottleneck(each, rest, em.peak(torque)).bottleneck
                 for each in (eset, _strip_set(34), _strip_set(41))]  # fmt: skip
        route = em.plan(eset, *rest, objective=em.peak(torque))
    assert [each.value for each in found] == pytest.approx([45.17736997] * 3, rel=1e-9)
    assert [found[0].state[name] for name in ("Theta", "Delta")] == pytest.approx(
        [0.0054643, -0.3424063], abs=1e-7
    )
    assert found[0].kind == "saddle"
    assert route.arrived
    assert route.cost <= 45.17737 * 1.0011


@pytest.mark.slow
def test_no_route_is_found_just_below_the_least_torque():
    """0.02 % below 45.17737 N mm."""
    with unchecked():
        eset = _strip_set(25)
        strip, torque = eset.structure, _torque(eset.structure)
        rest = [em.optimise(eset, torque, within=[side]).best.state
                for side in (strip.height(0.5) >= 10, strip.height(0.5) <= -10)]  # fmt: skip
        below = em.plan(eset, *rest, within=[torque <= 45.17])
    assert not below.arrived


def test_a_start_without_a_way_on_is_itself_the_nearest_state(spring_set):
    """Two vertices, and a bound that holds no other: no route leads from the start to itself."""
    stable = list(spring_set.points[(spring_set.index == 0) & (spring_set.kinds == 0)])
    ends = stable[0], stable[-1]
    gap = em.Descriptor(
        "gap", "1", lambda _, p: np.min([np.abs(p - end.p).max(axis=1) for end in ends], axis=0)
    )
    with unchecked():
        route = em.plan(spring_set, *ends, within=[gap <= 1e-6])
    assert route.status == "refused"
    np.testing.assert_array_equal(route.nearest.p, ends[0].p)


def test_refusals_say_how_far_each_demand_has_to_give_way(spring_set, sides):
    """Margin x (x − 1) where δ = 0: 0.3 needs x = 1.24162, and x = 1.2 allows 0.24."""
    with unchecked():
        route = em.plan(spring_set, *sides, within=[LENGTH <= 1.2], margin=0.3)
    length, margin = route.relaxations
    assert length.bound == pytest.approx(0.5 * (1.0 + np.sqrt(2.2)), abs=1e-8)
    assert margin.bound == pytest.approx(0.24, abs=1e-8)
    assert length.bound <= length.attained < 1.02 * length.bound
    assert 0.98 * margin.bound < margin.attained <= margin.bound
    assert route.explanation.startswith(route.why)
    assert route.nearest is not None
    assert route.nearest["x_l"] <= 1.2


@pytest.mark.parametrize(("a", "load"), [(0.0, 0.001), (-0.01, -0.002)])
def test_a_bound_just_above_a_fold_leaves_a_way(a, load):
    """Sheets meet at the cusp, |a| = √1.09 − 1: bounds .2 and .05 % above are obeyed; not below."""
    truss, height = truss_that_gives(), np.sqrt(1.09) - 1.0
    rise, change = truss.displacement("B", "y"), abs(em.value_of(truss, "a"))
    with unchecked():
        box = em.Box(a=(-0.1, 0.03), F=(-0.02, 0.02))
        eset = em.equilibrium_set(truss, box, intervals=(20, 20))
        rest = eset.at(a=a, F=load).stable
        ends = max(rest, key=rise), min(rest, key=rise)
        for share in (1.002, 1.0005):
            route = em.plan(eset, *ends, within=[change <= share * height])
            assert route.arrived
            assert height <= change(route.states).max() <= share * height
        assert not em.plan(eset, *ends, within=[change <= 0.998 * height]).arrived
