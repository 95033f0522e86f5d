"""Designs against closed forms, bounds and bad input; each is judged by a full rebuild."""

import numpy as np
import pytest

import equimorph as em
from equimorph.errors import InputError
from families import ARCH, STRIP, TRUSS, arch, strip, truss, volume
from typecheck import unchecked

REST = truss(0.2, 1.0).natural_state()
LIMIT = em.LoadLimit(REST, "F")
PRESSED = em.LoadLimit(em.lift(REST, {"F": 0.001}).end.state, "F")


def fold_load(rise, half):
    """Vertical bars' force 2 EA (ℓ/ℓ₀ − 1) sin of two bars, largest over the height: by its root.

    With L₀² = h² + a², the force F(y) = 2 (L₀/ℓ − 1)... is stationary at ℓ³ = h² L₀.
    """
    rest = np.hypot(rise, half)
    length = (half**2 * rest) ** (1.0 / 3.0)
    height = np.sqrt(length**2 - half**2)
    return 2.0 * (1.0 / length - 1.0 / rest) * height * rest / rest


def test_limit_load_of_a_truss_of_given_length_of_bars():
    """Bars of length 1: F = 2 (L₀/ℓ − 1) y, largest by the fold, then over the rise at a bound."""
    bound = em.DesignBound(lambda rise, half: rise**2 + half**2, 1.04, 1.04)
    with unchecked():
        found = em.design(truss, TRUSS, LIMIT, [bound])
    assert found.status == "found"
    rise, half = found.variables["rise"], found.variables["half"]
    assert rise**2 + half**2 == pytest.approx(1.04, abs=1e-8)
    assert rise == pytest.approx(0.4, abs=1e-6)
    assert found.value == pytest.approx(fold_load(rise, half), rel=1e-6)
    again = em.limit_load(found.structure.natural_state(), "F")
    assert found.value == pytest.approx(again.value, rel=1e-13)  # to round-off
    assert [step.value for step in found.history] == sorted(s.value for s in found.history)


@pytest.mark.slow
def test_an_interior_optimum_is_stationary():
    """The tip's height under a load is prescribed, by its squared distance."""
    with unchecked():
        found = em.design(strip, STRIP, gap_to(-0.05), tolerance=1e-9)
    assert found.value == pytest.approx(0.0, abs=1e-6)
    assert found.structure.height(1.0)(found.found[0]) == pytest.approx(-0.05, abs=1e-3)


@pytest.mark.slow
def test_the_worst_of_several_objectives_counts():
    """Two states of the strip: their deflections are equal at the best design."""
    first = strip(0.02, 0.5, 0.6)
    states = [em.lift(first.natural_state(), {name: 0.05}).end.state for name in ("P", "H")]
    questions = [em.StateValue(each, em.peak(first.max_curvature)) for each in states]
    with unchecked():
        found = em.design(strip, STRIP, questions)
    worst = max(found.structure.max_curvature(each) for each in found.found)
    assert found.value == pytest.approx(worst, rel=1e-9)
    assert found.value < found.history[0].value


def gap_to(place):
    """Squared distance of the strip's tip from a height, under a load."""
    first = strip(0.02, 0.5, 0.6)
    here = em.lift(first.natural_state(), {"P": 0.05}).end.state
    square = em.function_of(f"to {place}", lambda y: (y - place) ** 2, first.height(1.0))
    return em.StateValue(here, em.peak(square))


@pytest.mark.slow
def test_a_front_between_two_places_of_the_tip_is_known():
    """Between places 0.02 apart: √a + √b = 0.02 for the squared distances a and b."""
    with unchecked():
        front = em.design_front(strip, STRIP, [gap_to(-0.05), gap_to(-0.03)], points=3)
    assert [each.status for each in front.designs] == ["found"] * 3
    np.testing.assert_allclose(np.sqrt(front.values).sum(axis=1), 0.02, atol=1e-4)
    assert (np.diff(front.values[:, 0]) > 0.0).all()
    assert (np.diff(front.values[:, 1]) < 0.0).all()


@pytest.mark.parametrize(
    ("variables", "objective", "within", "message"),
    [
        ({}, LIMIT, [], "`variables` must name at least one variable; got none."),
        ({"rise": (1, 0)}, LIMIT, [], "`rise` must have finite bounds (low, high)"),
        ({"rise": (0.1, 0.3, 0.5)}, LIMIT, [], "`rise` must start within its bounds; got"),
        ({"rise": "wide"}, LIMIT, [], "`rise` must have finite bounds (low, high)"),
        (
            {"rise": (0.1, 0.3, 0.25), "half": (0.8, 1.2)}, PRESSED, [],
            "`objective` and `within` must have states of the structure that the family makes",
        ),
        (TRUSS, [], [], "`objective` must be one or more questions"),
    ],
)  # fmt: skip
def test_bad_input_is_refused_in_one_line(variables, objective, within, message):
    with pytest.raises(InputError) as caught:
        em.design(truss, variables, objective, within)
    assert str(caught.value).startswith(message)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({}, "`lower` must not exceed `upper`, and one must be finite"),
        ({"lower": 2.0, "upper": 1.0}, "`lower` must not exceed `upper`"),
        ({"upper": 1.0}, "`upper` must not be given for what is made large"),
    ],
)
def test_bounds_without_meaning_are_refused(given, message):
    with pytest.raises(InputError) as caught:
        em.DesignBound(LIMIT, **given)
    assert str(caught.value).startswith(message)


def test_families_of_different_sizes_are_refused():
    def family(elements):
        return em.Rod(load="uniform", elements=3 if elements < 3.0 else 4)

    start = em.LoadLimit(family(2.9995).natural_state(Theta=0.9, Delta=0.1), "q")
    with pytest.raises(InputError, match="must return structures with the same unknowns"):
        em.design(family, {"elements": (2.0, 5.0, 2.9995)}, start)


def test_a_design_that_cannot_obey_its_bounds_is_infeasible():
    with unchecked():
        found = em.design(truss, TRUSS, LIMIT, [em.DesignBound(LIMIT, lower=10.0)], rebuilds=12)
    assert found.status in ("infeasible", "stalled")
    assert "violated" in found.why


def test_a_load_without_a_limit_stays():
    """The spring does not snap from a length above 1; nothing is better than no limit."""
    question = em.LoadLimit(em.Spring().natural_state(x_l=1.2), "F")
    found = em.design(em.Spring, {"stiffness": (1.0, 2.0)}, question)
    assert (found.status, found.value, found.rebuilds) == ("found", 100.0, 1)


def test_a_question_without_an_answer_at_the_start_says_why():
    """On the symmetric path the arch ends at a branch point, which has no derivative."""
    first = arch([0.0] * 3, [1.0] * 3)
    question = em.LoadLimit(first.natural_state(Theta=0.9, Delta=0.0), "q")
    with unchecked():
        found = em.design(arch, ARCH, question)
    assert found.status == "undefined start"
    assert "branch point" in found.why
    assert np.isnan(found.value)


def torque(rod):
    """Larger couple of the two motors."""
    efforts = [em.effort_of(rod, name) for name in ("Theta", "Delta")]
    first = em.function_of("M_A", lambda a, b: 0.5 * (a + b), *efforts)
    second = em.function_of("M_B", lambda a, b: 0.5 * (a - b), *efforts)
    return em.largest_of("torque", abs(first), abs(second))


def inverting(rod, within=(), **options):
    """Set over the moves of both ends at q = 0.5, and the states to lead from and to."""
    box = em.Box(Theta=(-1.6, 1.6), Delta=(-2.0, 2.0))
    within = [rod.max_curvature <= 18.0 + 1e-6, *within]
    eset = em.equilibrium_set(rod, box, fixed={"q": 0.5}, within=within, **options)
    up = max(eset.at(Theta=0.7, Delta=0.0).stable, key=rod.height(0.5))
    down = min(eset.at(Theta=-0.7, Delta=0.0).stable, key=rod.height(0.5))
    return eset, up, down


@pytest.mark.slow
def test_an_arch_is_inverted_with_less_torque():
    """q = 0.5, Θ 0.7 → −0.7: at least 60 % less torque; rebuilt, planned and replayed in MuJoCo."""
    first = arch([0.0] * 3, [1.0] * 3)
    with unchecked():
        asked = inverting(first, intervals=(12, 21), checks=0)
        question = em.RouteExtreme(*asked, em.peak(torque(first)), margin=0.5)
        found = em.design(arch, ARCH, question, [em.DesignBound(volume, 1.0, 1.0)], tolerance=1e-4)
        made = found.structure
        allowed = [torque(made) <= 1.003 * found.value]
        eset, up, down = inverting(made, allowed, intervals=(24, 42))
        route = em.plan(eset, up, down, margin=0.5)
        played = em.replay(em.speed_limit(route.schedule, 0.01, start=up).schedule, up)
    assert found.status == "found"
    assert found.value < 0.4 * found.history[0].value
    assert eset.audit.clean
    assert route.arrived
    assert route.margin >= 0.5
    assert not played.snapped
    assert played.deviation.max() < 0.01
