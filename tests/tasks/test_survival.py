"""Errors that routes survive: proved boxes against closed forms and trials, probabilities."""

from functools import cache

import numpy as np
import pytest
from scipy.optimize import brentq

import equimorph as em
from equimorph.equilibria import settle
from equimorph.errors import InputError
from equimorph.structures import Rod, Spring, State, States
from equimorph.tasks.robustness.error_model import ErringStructure, Errors
from equimorph.tasks.robustness.evidence import Survival
from equimorph.tasks.robustness.survival import survival, survival_room
from equimorph.tasks.robustness.trials import random_trials
from equimorph.tasks.verification.error_box import ErrorBox
from equimorph.tasks.verification.newton_kantorovich import segment_bounds
from equimorph.tasks.verification.tube import Tube, TubeProof
from typecheck import unchecked

pytestmark = pytest.mark.usefixtures("_unchecked")


@pytest.fixture
def _unchecked():
    with unchecked():
        yield


def fold_load(x: float) -> float:
    """F/k = (1 − x_l^⅔)^(3/2) [Feher2025]_."""
    return float((1 - x ** (2 / 3)) ** 1.5)


@cache
def spring_at(x: float) -> State:
    return Spring().natural_state(x_l=x)


def von_mises(EA: float = 1.0) -> em.Truss:
    return em.Truss(
        {"A": (-1.0, 0.0), "B": (0.0, 0.3), "C": (1.0, 0.0)},
        [em.Bar(ends, EA=EA) for ends in (("A", "B"), ("B", "C"))],
        {"A": "xy", "C": "xy"},
        {"F": {"B": (0.0, -1.0)}},
        {"a": {"A-B": 1.0, "B-C": 1.0}},
        strain="green",
    )


@pytest.mark.slow
@pytest.mark.parametrize("ratio", [0.2, 1.0, 5.0])
def test_proved_boxes_of_the_spring_are_most_of_the_true_ones(ratio):
    """From x_l = 0.7 to 0.85 at F = 0: the box ends where ``F = (1 − x_l^⅔)^(3/2)``."""
    errors = {"F": 0.01, "x_l": 0.01 * ratio}
    true = brentq(
        lambda r: 0.01 * r - fold_load(0.85 + 0.01 * ratio * r), 0.0, 0.149 / 0.01 / ratio
    )
    room = survival_room(spring_at(0.7), [{"x_l": 0.85}], errors)
    assert room.survived == pytest.approx(true, rel=0.011)
    assert 0.5 * true <= room.proved <= true
    assert "fold" in room.met


def test_a_box_is_refuted_by_name_and_place():
    found = survival(spring_at(0.7), [{"x_l": 0.85}], {"F": 1.1 * fold_load(0.85)})
    assert found.status == "refuted"
    assert "meets a fold at x_l = 0.8" in found.why
    assert not found.survives
    assert found.proof is None


def test_no_tube_is_proved_beyond_the_true_box():
    """Without trials before, the proof itself fails: 2 % beyond the fold load of the spring."""
    path = em.lift(spring_at(0.7), {"x_l": 0.85})
    for factor, right in ((0.5, True), (1.02, False)):
        steps = np.array([[0.0, factor * fold_load(0.85), 0.0]])
        proof = Tube(path.states, steps).prove()
        assert (proof.status == "proved") is right, proof
        assert (proof.failed is None) is right


def test_states_with_errors_lie_where_the_bounds_say(arch_set, ends):
    """Random errors on segments of a lift, settled: within r of the shifted chord, with margin."""
    path = em.lift(ends[0], {"Theta": 1.3})
    states = path.states[np.arange(len(path.states) // 2)]
    first, last = states[:-1], states[1:]
    steps = np.zeros((len(first), 2, 4))
    steps[:, 0, 0], steps[:, 1, 2] = 0.01, 0.05
    box = ErrorBox(steps)
    bounds = segment_bounds(first, last, errors=box)
    assert (bounds.proved & (bounds.margin > 0.0)).all()
    before, after = (box.responses(each) for each in (first, last))
    generator = np.random.default_rng(2)
    for share in (0.0, 0.4, 1.0):
        errors = generator.choice([-1.0, 1.0], (len(first), 2))
        z = (1 - share) * (first.z + np.einsum("lk,lkn->ln", errors, before))
        z += share * (last.z + np.einsum("lk,lkn->ln", errors, after))
        p = (1 - share) * first.p + share * last.p + np.einsum("lk,lkn->ln", errors, steps)
        near = settle(arch_set.structure, z, p)
        assert (np.abs(near.z - z) <= (bounds.error[:, None] * bounds.weights) + 1e-12).all()
        assert (States(arch_set.structure, near.z, p).margin >= bounds.margin).all()


def test_errors_of_a_stiffness_scale_the_limit_load():
    """F_c of the truss is proportional to EA: 0.9 F_c survives errors of EA up to 10 %."""
    truss = von_mises()
    limit = em.limit_load(truss.natural_state(), "F").value
    room = survival_room(truss.natural_state(), [{"F": 0.9 * limit}], {"EA": 0.05})
    assert 0.05 * room.survived == pytest.approx(0.1, rel=0.011)
    assert 0.25 * room.survived <= room.proved <= room.survived  # such errors are not divided
    both = {"EA": 0.02, "F": 0.02 * limit, "a": 1e-4}
    found = survival(truss.natural_state(), [{"F": 0.9 * limit}], both)
    assert found.survives
    assert found.proof.status == found.status


def test_stiffness_of_a_rod_is_an_error_of_its_loads():
    """In units of EI/L² the force F with EI (1 − δ) is F/(1 − δ): the same box of errors."""
    rod = Rod(ends=("clamped", "free"), loads={"P": em.PointForce(1.0)}, EI=2.0, length=1.5,
              elements=2, degree=5, coordinates={})  # fmt: skip
    erring = ErringStructure(rod, Errors({"EI": 0.1, "P": 0.1}))
    (deviation,) = erring.deviations
    assert abs(deviation.multiple) > 5.0
    z, p = np.full((1, rod.size), 0.1), np.array([[0.0, 0.7]])
    exact = rod.residual(z, p / 0.9) - rod.residual(z, p)
    np.testing.assert_allclose(deviation.force(z, p), exact, atol=1e-12)
    assert ErringStructure(rod, Errors({"EI": 0.1, "length": 0.1})).deviations is None
    found = survival(rod.natural_state(), [{"P": 1.0}], {"EI": 0.05, "P": 0.05})
    assert found.status == "proved"


def test_probability_has_the_bound_of_clopper_and_pearson():
    """Without a failure in n trials it is 0.05^(1/n)."""
    start, way = spring_at(0.7), [{"x_l": 0.72}]
    found = survival(start, way, Errors({"F": 1e-3}, probability=0.99, trials=300))
    assert found.status == "probable"
    assert found.probability == pytest.approx(0.05 ** (1 / 300), rel=1e-12)
    few = survival(start, way, Errors({"F": 1e-3}, probability=0.99, trials=100))
    assert few.status == "unproved"
    assert "more trials" in few.why
    wide = survival(start, way, Errors({"F": 1.0}, probability=0.99, trials=100))
    assert wide.status == "refuted"


def test_correlated_errors_may_cancel_each_other():
    """x_l and F at correlation −1 move along the fold of the spring, at +1 across it."""
    start = em.lift(spring_at(0.8), {"F": -0.4 * fold_load(0.8)}).end.state
    slope = -(fold_load(0.81) - fold_load(0.79)) / 0.02
    sizes = {"x_l": 0.06, "F": 0.06 * slope}
    ways = [
        survival(start, [{"x_l": 0.801}], Errors(sizes, 0.99, [[1, r], [r, 1]], trials=400))
        for r in (0.999, -0.999)
    ]
    assert sorted(way.survives for way in ways) == [False, True]


def test_plan_finds_a_route_that_survives(spring_set):
    """Plain routes pass beside the cusp; the one for errors keeps away."""
    upper, lower = over_the_cusp(spring_set)
    sizes = {"F": 0.005, "x_l": 0.005}
    plain = em.plan(spring_set, upper, lower)
    assert survival(upper, plain.schedule, sizes).status == "refuted"
    route = em.plan(spring_set, upper, lower, survive=sizes)
    assert route.arrived
    assert route.survival.status == "proved"
    assert route.survival.survivors == len(route.survival.kind)
    assert route.margin > 10 * plain.margin
    likely = em.plan(spring_set, upper, lower, survive=Errors(sizes, 0.99, trials=500))
    assert likely.survival.status == "probable"


def over_the_cusp(spring_set):
    here = spring_set.at(x_l=0.8, F=0.0).stable
    return max(here, key=Spring().angle), min(here, key=Spring().angle)


def test_plan_says_why_no_route_survives(spring_set, monkeypatch):
    monkeypatch.setattr("equimorph.tasks.verification.tube.MOST_CELLS", 100)
    monkeypatch.setattr("equimorph.tasks.planning.planner.FLOORS", ())
    upper, lower = over_the_cusp(spring_set)
    never = em.plan(spring_set, upper, lower, survive={"F": 0.1})
    assert "no route can survive: `start` itself does not" in never.why
    missed = em.plan(spring_set, upper, lower, survive={"F": 0.02, "x_l": 0.02})
    assert not missed.arrived
    assert "no route that survives was found" in missed.why
    assert "times these errors" in missed.why
    assert missed.survival.status == "unproved"
    given = em.plan(spring_set, upper, lower, via=[{"x_l": 0.9}, {"x_l": 0.8}], survive={"F": 0.01})
    assert given.survival is None  # the way-points lead elsewhere without errors


def test_errors_beyond_the_meaning_of_parameters_are_named():
    found = survival(spring_at(0.7), [{"x_l": 0.85}], {"k": 1.5})
    assert "a parameter leaves the limits of its meaning" in found.why
    assert found.status == "refuted"


@pytest.mark.slow
def test_plan_finds_a_route_of_the_arch_that_survives(arch_set, ends):
    """Plain routes pass within 0.001 of instability; max |κ| of the tube is judged by values."""
    sizes = {"Theta": 0.03, "q": 0.02}
    plain = em.plan(arch_set, *ends)
    assert random_trials(ends[0], plain.schedule, sizes, trials=100).share < 0.6
    route = em.plan(arch_set, *ends, survive=sizes)
    assert route.survival.status == "supported"
    assert route.survival.proof.bounds == "enclosed"
    missed = em.plan(arch_set, *ends, survive={"Theta": 0.3, "q": 0.1})
    assert "trials survive 0.6" in missed.why


@pytest.mark.parametrize(
    ("errors", "words"),
    [
        ({}, "at least one"),
        ({"Theta": -0.1}, "positive"),
        ({"EA": 0.1}, "must name parameters"),
        ({"degree": 1.5}, "below 1"),
    ],
)
def test_errors_without_meaning_are_refused(ends, errors, words):
    with pytest.raises(InputError, match=words):
        survival(ends[0], [{"Theta": 1.1}], errors)


def test_correlations_are_checked():
    for matrix in ([[1.0, 0.5]], [[1.0, 2.0], [2.0, 1.0]], [[1.0, 0.1], [0.2, 1.0]]):
        with pytest.raises(InputError, match="correlation"):
            Errors({"F": 1.0, "x_l": 1.0}, 0.9, matrix)
    with pytest.raises(InputError, match="beside a probability"):
        Errors({"F": 1.0}, None, [[1.0]])


def test_a_route_for_barriers_survives_errors_and_is_the_safer_one():
    """The box is proved, the least barrier is twice that of the shortest route that survives."""
    spring, errors = Spring(), {"x_l": 0.005, "F": 0.003}
    box = em.Box(x_l=(0.6, 1.3), F=(-0.1, 0.1))
    eset = em.equilibrium_set(spring, box, intervals=(14, 10))
    field = em.barriers(eset)
    goal, *_, start = sorted(eset.at(x_l=0.8, F=0.01).stable, key=spring.elevation)
    least = []
    for wish in ("length", field.descriptor):
        route = em.plan(eset, start, goal, objective=wish, survive=errors)
        assert (route.arrived, route.survival.status) == (True, "proved")
        least.append(field.of(route.states).energy.min())
    assert least[1] > 2.0 * least[0]
    assert random_trials(start, route.schedule, errors, trials=50).arrived.all()


@pytest.mark.parametrize(
    ("why", "proof", "told"),
    [
        ("the goal lies beyond a fold", None, "Survival(proved: the goal lies beyond a fold)"),
        ("", None, "Survival(proved: 2 of 3 trials in corners and inside arrived)"),
        ("", TubeProof("", 4, "enclosed"), "Survival(proved for F ± 0.01: TubeProof("),
    ],
)
def test_what_shows_survival_is_printed(why, proof, told):
    """A reason comes first, then a proof, then the trials."""
    kind = np.array(["arrived", "snapped", "arrived"])
    given = (Errors({"F": 0.01}), np.zeros((3, 1)), kind, np.ones(3), proof)
    assert repr(Survival("proved", why, *given)).startswith(told)
