"""Derivatives, laws of imperfections, room, trials and least snaps, against closed forms."""

import re

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.stats import norm

import equimorph as em
from equimorph.errors import InputError
from equimorph.structures import Rod, Spring, State
from equimorph.tasks.robustness.derivatives import limit_sensitivity, sensitivity
from equimorph.tasks.robustness.imperfection import imperfection_law
from equimorph.tasks.robustness.room import stable_room
from equimorph.tasks.robustness.snaps import least_snap
from equimorph.tasks.robustness.trials import random_trials
from oracles.polynomial import Polynomial, pitchfork_form
from typecheck import unchecked


def spring_at(x: float, force: float) -> State:
    rest = Spring().natural_state(x_l=x)
    return rest if force == 0.0 else em.lift(rest, {"F": force}).end.state


def fold_load(x: float) -> float:
    """F/k = (1 − x_l^⅔)^(3/2) [Feher2025]_; the stable side of δ > 0 ends at −F."""
    return float((1 - x ** (2 / 3)) ** 1.5)


@pytest.fixture(scope="module")
def toward() -> float:
    """Sign of F that leads from the natural state to the fold."""
    return float(np.sign(em.limit_load(Spring().natural_state(x_l=0.8), "F").value))


def test_derivatives_of_the_spring_are_those_of_its_closed_form():
    """F = k (1 − x/cos δ) sin δ: dδ/dF = 1/F_δ, dδ/dx = −F_x/F_δ."""
    state = spring_at(0.8, 0.01)
    delta, x = state.z[0], 0.8
    by_delta = np.cos(delta) - x / np.cos(delta) ** 2
    by_x = -np.tan(delta)
    found = sensitivity(state, [Spring().angle, Spring().height], ["F", "x_l"])
    assert found["angle", "F"] == pytest.approx(1 / by_delta, rel=1e-9)
    assert found["angle", "x_l"] == pytest.approx(-by_x / by_delta, rel=1e-9)
    turned = np.tan(delta) + x / np.cos(delta) ** 2 * found["angle", "x_l"]
    assert found["height", "x_l"] == pytest.approx(turned, rel=1e-8)


def test_derivatives_of_descriptors_of_the_arch_are_differences():
    arch = Rod()
    state = em.lift(arch.natural_state(Theta=0.9, Delta=0.1), {"q": 2.0}).end.state
    asked = [arch.height(0.3), arch.max_curvature]
    found = sensitivity(state, asked)
    for name in ("Theta", "Delta", "q"):
        sides = [em.lift(state, {name: state[name] + h}).end.state for h in (1e-4, -1e-4)]
        for each in asked:
            slope = (each(sides[0]) - each(sides[1])) / 2e-4
            assert found[each.name, name] == pytest.approx(slope, rel=1e-5, abs=1e-8)


def test_fold_load_of_the_spring_changes_as_its_closed_form():
    """d/dx (1 − x^⅔)^(3/2) = −(1 − x^⅔)^½ x^(−⅓)."""
    limit = em.limit_load(Spring().natural_state(x_l=0.8), "F")
    found = limit_sensitivity(limit, "F", ["x_l", "k"])
    slope = -np.sqrt(1 - 0.8 ** (2 / 3)) * 0.8 ** (-1 / 3)
    assert abs(limit.value) == pytest.approx(fold_load(0.8), rel=1e-9)
    assert found["x_l"] == pytest.approx(np.sign(limit.value) * slope, rel=1e-6)
    assert found["k"] == pytest.approx(limit.value, rel=1e-6)


@pytest.mark.parametrize("cap", [None, 3.0])
def test_limit_loads_of_the_arch_change_as_their_differences(cap):
    arch = Rod()
    within = [] if cap is None else [arch.max_curvature <= cap]

    def limit(theta: float, delta: float) -> em.LimitLoad:
        return em.limit_load(arch.natural_state(Theta=theta, Delta=delta), "q", within=within)

    here = limit(0.9, 0.02)
    assert here.kind == ("fold" if cap is None else "constraint")
    found = limit_sensitivity(here, "q", ["Theta", "Delta"], within)
    h = 1e-4
    by_theta = (limit(0.9 + h, 0.02).value - limit(0.9 - h, 0.02).value) / (2 * h)
    by_delta = (limit(0.9, 0.02 + h).value - limit(0.9, 0.02 - h).value) / (2 * h)
    assert found["Theta"] == pytest.approx(by_theta, rel=1e-4)
    assert found["Delta"] == pytest.approx(by_delta, rel=1e-4)


def test_two_thirds_law_of_the_arch():
    """q_fold ≈ 4.2440 − 4.05 Δ^⅔ at small Δ; the coefficient tends to 4.0999 (decisions)."""
    law = imperfection_law(Rod().natural_state(Theta=0.9, Delta=0.0), "q", "Delta")
    assert law.law == "two-thirds power: a symmetric branch point"
    assert law.perfect == pytest.approx(4.2439977594, rel=1e-9)
    assert law.exponent == pytest.approx(2 / 3, abs=5e-3)
    assert law.coefficient == pytest.approx(-4.0999, abs=2e-3)


def test_sizes_of_imperfections_are_in_the_unit_of_the_parameter():
    """The fitted formula gives the limit loads at the sizes; 1e-3: its next order."""
    joints = {"A": (-100.0, 0.0), "B": (0.0, 30.0), "C": (100.0, 0.0)}
    loads = {"F": {"B": (0.0, -1.0)}, "w": {"B": (1.0, 0.0)}}
    truss = em.Truss(joints, [("A", "B"), ("B", "C")], {"A": "xy", "C": "xy"}, loads)
    law = imperfection_law(truss.natural_state(), "F", "w")
    assert law.power == 2.0
    fitted = law.coefficient * np.abs(law.sizes) ** law.power
    np.testing.assert_allclose(law.loads - law.perfect, fitted, rtol=1e-3)


def test_two_thirds_law_of_the_normal_form():
    """−x³ − a x = b folds at a = −3 (b/2)^⅔."""
    structure = pitchfork_form(-1.0)
    law = imperfection_law(structure.state(0.0, a=-1.0), "a", "b")
    assert law.law.startswith("two-thirds")
    assert law.coefficient == pytest.approx(-3 / 2 ** (2 / 3), rel=1e-6)


def test_one_half_law_of_the_normal_form():
    """x² − a x = b folds at a = −2 (−b)^½, for b < 0 only: the worse sign counts."""
    structure = Polynomial(lambda x, a, b: x**3 * (1 / 3) - a * x**2 * 0.5 - b * x, 1, ("a", "b"))
    law = imperfection_law(structure.state(0.0, a=-1.0), "a", "b")
    assert law.law.startswith("one-half")
    assert law.coefficient == pytest.approx(-2.0, rel=1e-5)


def imperfect_cubic(order: int, factor: float) -> Polynomial:
    """−x³ + c x⁴ − a x = b^order: the normal form of a symmetric branch point, with the next order.

    On its folds a = −3x² + 4c x³ and b^order = 2x³ − 3c x⁴: c changes the fall of a by c·b.
    """
    return Polynomial(
        lambda x, a, b: (
            x**4 * -0.25 + x**5 * (0.2 * factor) + a * x**2 * -0.5 + x * b**order * -1.0
        ),
        1,
        ("a", "b"),
    )


def imperfect_parabola(order: int, factor: float) -> Polynomial:
    """x² + c x³ − a x = b^order: the normal form of an asymmetric branch point, and more."""
    return Polynomial(
        lambda x, a, b: (
            x**3 * (1 / 3) + x**4 * (0.25 * factor) + a * x**2 * -0.5 + x * b**order * -1.0
        ),
        1,
        ("a", "b"),
    )


@pytest.mark.parametrize("factor", [0.5, 2.0, 10.0, 40.0])
def test_higher_orders_do_not_enter_the_two_thirds_law(factor):
    """Folds of −x³ + c x⁴ − a x = b: a → −3 (b/2)^⅔ as b → 0, whatever c; c = 40 is strong."""
    law = imperfection_law(imperfect_cubic(1, factor).state(0.0, a=-1.0), "a", "b")
    assert law.law.startswith("two-thirds")
    assert law.exponent == pytest.approx(2 / 3, abs=1e-3)
    assert law.coefficient == pytest.approx(-3 / 2 ** (2 / 3), rel=1e-4)


@pytest.mark.parametrize("factor", [1.0, 10.0, 50.0])
def test_higher_orders_do_not_enter_the_one_half_law(factor):
    """Folds of x² + c x³ − a x = b: a → −2 (−b)^½; at c = 10, 50 large b have no fold at all."""
    law = imperfection_law(imperfect_parabola(1, factor).state(0.0, a=-1.0), "a", "b")
    assert law.law.startswith("one-half")
    assert law.exponent == pytest.approx(0.5, abs=1e-3)
    assert law.coefficient == pytest.approx(-2.0, rel=1e-4)


@pytest.mark.parametrize(
    ("structure", "name", "power", "coefficient"),
    [
        (imperfect_cubic(2, 0.5), "four-thirds", 4 / 3, -3 / 2 ** (2 / 3)),
        (
            Polynomial(lambda x, a, b: x**3 * (1 / 3) + a * x**2 * -0.5 + x * b**2, 1, ("a", "b")),
            "|ε|: an asymmetric",
            1.0,
            -2.0,
        ),
    ],
)
def test_imperfections_of_the_second_order_have_twice_the_exponent(
    structure, name, power, coefficient
):
    """b² instead of b: a → −3 (b²/2)^⅔ and −2 |b|; the smallest are not told from the perfect."""
    law = imperfection_law(structure.state(0.0, a=-1.0), "a", "b")
    assert law.law.startswith(name)
    assert law.power == power
    assert law.exponent == pytest.approx(power, abs=1e-3)
    assert law.coefficient == pytest.approx(coefficient, rel=1e-3)


def test_a_fold_may_fall_with_the_square_of_an_imperfection():
    """x² + a = 1 − b² folds at a = 1 − b²; without b nothing is fitted."""
    found = [
        imperfection_law(
            Polynomial(
                lambda x, a, b, f=factor: x**3 * (1 / 3) + a * x + x * -1.0 + b**2 * x * f,
                1,
                ("a", "b"),
            ).state(1.0, a=0.0),
            "a",
            "b",
        )
        for factor in (1.0, 0.0)
    ]
    assert found[0].law.startswith("quadratic")
    assert found[0].coefficient == pytest.approx(-1.0, rel=1e-6)
    assert found[1].status == "refused"
    assert "do not change the limit load" in found[1].why


@pytest.mark.parametrize("least", [1e-8, 1e-9, 1e-10, 1e-11])
def test_an_imperfect_path_is_not_taken_for_the_perfect_one(least):
    """−x³ − a x = b with tiny b: right, or refused; −3 (b/2)^⅔ is never zero."""
    start = pitchfork_form(-1.0).state(0.0, a=-1.0)
    law = imperfection_law(start, "a", "b", sizes=[30 * least, 10 * least, 3 * least, least])
    if least < 1e-9:
        assert law.status == "refused"
        assert "three imperfections" in law.why
    else:
        assert law.coefficient == pytest.approx(-3 / 2 ** (2 / 3), rel=1e-6)


def test_smooth_law_where_the_limit_is_a_fold():
    law = imperfection_law(Spring().natural_state(x_l=0.8), "F", "x_l")
    assert law.law == "smooth"


def test_box_of_the_spring_touches_the_fold_at_a_corner(toward):
    state = spring_at(0.8, 0.0)
    room = stable_room(state, {"x_l": 0.02, "F": 0.01})
    exact = brentq(lambda r: 0.01 * r - fold_load(0.8 + 0.02 * r), 0.0, 9.9)
    assert room.kind == ("fold",)
    assert room.scale[0] == pytest.approx(exact, rel=1e-8)
    assert room.met[0]["F"] * toward > 0


def test_ellipsoid_of_the_spring_touches_the_fold(toward):
    state = spring_at(0.8, 0.0)
    room = stable_room(state, {"x_l": 0.02, "F": 0.01}, shape="ellipsoid")
    x = np.linspace(0.5, 0.9999, 200001)
    exact = np.hypot((x - 0.8) / 0.02, (1 - x ** (2 / 3)) ** 1.5 / 0.01).min()
    assert room.scale[0] == pytest.approx(exact, rel=1e-5)
    assert room.scale[0] >= exact * (1 - 1e-9)


def test_room_along_a_route_is_the_least_of_its_states():
    path = em.lift(spring_at(0.8, 0.0), {"x_l": 0.9})
    room = stable_room(path.states, {"F": 0.01})
    exact = [fold_load(x) / 0.01 for x in path.states["x_l"]]
    np.testing.assert_allclose(room.scale, exact, rtol=1e-6)
    assert room.least == room.scale.min()


def test_constraints_bound_the_room_too():
    spring = Spring()
    state = spring_at(0.8, 0.0)
    room = stable_room(state, {"F": 0.01}, within=[spring.angle <= 0.7, spring.angle >= 0.6])
    bounds = [abs((1 - 0.8 / np.cos(d)) * np.sin(d)) / 0.01 for d in (0.6, 0.7)]
    assert room.kind == ("constraint",)
    assert room.scale[0] == pytest.approx(min(bounds), rel=1e-7)


def test_share_of_trials_is_the_probability(toward):
    """F off by N(0, σ) at one σ before the fold: Φ(1) = 0.8413."""
    start, sigma = spring_at(0.8, 0.0), 0.004
    goal = {"F": toward * (fold_load(0.8) - sigma)}
    with unchecked():
        found = random_trials(start, [goal], {"F": sigma}, trials=1000, seed=2)
    low, high = found.interval
    assert low < norm.cdf(1.0) < high
    over = found.offsets[:, 0] * toward > sigma
    np.testing.assert_array_equal(found.arrived, ~over)
    assert set(found.kind[over]) == {"fold"}


def test_imperfect_load_and_intrinsic_curvature_are_parameters():
    """A tilt of the load and a bend of the rod lower the limit load of some trials below 4."""
    arch = Rod(
        loads={"q": em.LineLoad(), "tilt": em.LineLoad([[0.0, 1.0], [1.0, -1.0]])},
        actuators={"bend": em.Curvature([[0.0, -1.0], [1.0, 1.0]])},
    )
    start = arch.natural_state(Theta=0.9, Delta=0.0)
    spreads = {"tilt": 0.2, "bend": 0.05, "Delta": 0.01}
    with unchecked():
        low = random_trials(start, [{"q": 1.5}], spreads, trials=30)
        high = random_trials(start, [{"q": 4.1}], spreads, trials=30)
    assert low.share == 1.0
    assert high.share < 1.0


def test_least_snap_lands_on_the_other_side(spring_set):
    """From δ > 0 at F = 0 the nearest fold in (x_l, F) is that of the closed form."""
    state = spring_set.at(x_l=0.8, F=0.0).stable
    upper = max(state, key=Spring().angle)
    with unchecked():
        found = least_snap(spring_set, upper)
    x = np.linspace(0.5, 0.9999, 200001)
    scales = Spring().scales
    exact = np.hypot((x - 0.8) / scales[0], (1 - x ** (2 / 3)) ** 1.5 / scales[1]).min()
    assert found.status == "found"
    assert found.distance.in_parameters == pytest.approx(exact, rel=1e-4)
    x = 0.8 + found.change["x_l"]
    assert x > 0.8
    assert found.change["F"] == pytest.approx(fold_load(x), rel=1e-6)
    assert found.landing.landed
    assert found.landing.state["x_l"] == pytest.approx(x, rel=1e-12)
    assert found.landing.state.z[0] < 0.0


def straight_moves_of_the_spring(state: State, folds: np.ndarray) -> np.ndarray:
    """Lengths of straight moves to folds δ that snap there, ∞ for others, by tracking roots.

    F = (1 − x/cos δ) sin δ is solved by Newton at 1000 stations of each move; stable as long as
    x > cos³ δ. Folds stand at x = cos³ δ, F = sin³ δ; that at δ = 0 is the tip of a cusp.
    """
    start, scales = np.array([state["x_l"], state["F"]]), Spring().scales[:2]
    goals = np.stack([np.cos(folds) ** 3, np.sin(folds) ** 3], axis=1)
    delta, stable = np.full(len(folds), state.z[0]), np.ones(len(folds), bool)
    for share in np.linspace(0.0, 1.0 - 1e-6, 1000)[1:]:
        x, force = (start + share * (goals - start)).T
        for _ in range(3):
            slope = np.cos(delta) - x / np.cos(delta) ** 2
            delta = delta - (np.sin(delta) - x * np.tan(delta) - force) / slope
            delta = np.clip(delta, -1.5, 1.5)
        stable &= x > np.cos(delta) ** 3
    length = np.linalg.norm((goals - start) / scales, axis=1)
    return np.where(stable & (np.abs(delta - folds) < 0.02) & (folds != 0.0), length, np.inf)


def random_stable_states(eset: em.EquilibriumSet, count: int) -> list[State]:
    stable = np.unique(eset.cells[eset.cell_index == 0])
    stable = stable[eset.kinds[stable] == 0]
    chosen = np.random.default_rng(1).choice(stable, count, replace=False)
    return [eset.points[vertex] for vertex in chosen.tolist()]


def infima_of_the_spring(eset: em.EquilibriumSet, states: list[State]) -> int:
    """Compare with all straight moves; how many least snaps are infima that are not attained."""
    folds = np.linspace(-0.9, 0.9, 1201)
    infima = 0
    for state in states:
        found = least_snap(eset, state)
        moves = straight_moves_of_the_spring(state, folds)
        assert found.landing is not None
        assert found.landing.status != "held"
        length = np.hypot(
            *(found.change[name] / Spring().scales[k] for k, name in enumerate(("x_l", "F")))
        )
        assert found.infimum == pytest.approx(moves.min(), rel=2e-3, abs=3e-4)
        assert (1 - 1e-12) * found.infimum <= length <= (1 + 1e-3) * found.infimum
        infima += found.status == "infimum"
    return infima


def test_no_least_snap_is_a_cusp_where_nothing_snaps(spring_set):
    """Nearest to (1.1, 0.1) and (1.2, 0.01) is the tip of the cusp, where nothing snaps."""
    places = ({"x_l": 1.1, "F": 0.1}, {"x_l": 1.2, "F": 0.01}, {"x_l": 0.9, "F": 0.01})
    with unchecked():
        states = [spring_set.at(**place).stable[0] for place in places]
        assert infima_of_the_spring(spring_set, states) == 2


@pytest.mark.slow
def test_least_snaps_of_many_states_of_the_spring(spring_set):
    with unchecked():
        assert infima_of_the_spring(spring_set, random_stable_states(spring_set, 40)) >= 4


@pytest.mark.slow
def test_least_snaps_of_many_states_of_the_arch(arch_set):
    """Of 119 states, 57 were told the tip of a cusp and 15 nothing; each has a snap."""
    with unchecked():
        for state in random_stable_states(arch_set, 30):
            found = least_snap(arch_set, state)
            assert found.status in ("found", "infimum")
            assert found.landing.landed
            assert np.abs(found.landing.state.z - found.fold.z).max() > 1e-3
            beyond = {name: found.fold[name] + 1e-3 * by for name, by in found.change.items()}
            assert em.lift(state, beyond).end.kind in ("fold", "branch point")


def test_critical_states_have_no_derivative():
    fold = em.limit_load(Spring().natural_state(x_l=0.8), "F").state
    with pytest.raises(InputError, match=r"^`state` must be regular; got a critical one"):
        sensitivity(fold)


def test_branch_points_are_referred_to_the_law():
    limit = em.limit_load(Rod().natural_state(Theta=0.9, Delta=0.0), "q")
    with pytest.raises(InputError, match=r"^`limit` must be a fold or a constraint; got a branch"):
        limit_sensitivity(limit, "q", ["Delta"])


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda s: sensitivity(s, [], ["y"]), "`y` must be a parameter"),
        (lambda s: imperfection_law(s, "F", "F"), "`imperfection` must not be the load; got 'F'."),
        (lambda s: imperfection_law(s, "F", "x_l", sizes=[1e-3]), "`sizes` must be three or more"),
        (lambda s: stable_room(s, {}), "`tolerances` must name at least one parameter; got none."),
        (lambda s: stable_room(s, {"F": -1.0}), "`tolerances` must be positive numbers by name"),
        (lambda s: stable_room(s, {"F": 1.0}, shape="ball"), "`shape` must be box or ellipsoid;"),
        (lambda s: stable_room(s, {"F": 1.0}, most=0.0), "`most` must be positive and finite"),
        (
            lambda s: random_trials(s, [{"F": 0.1}], {}),
            "`spreads` must name at least one parameter; got none.",
        ),
        (
            lambda s: random_trials(s, [{"F": 0.1}], {"F": 0.1}, trials=0),
            "`trials` must be a whole number from 1 to",
        ),
    ],
)
def test_wrong_arguments_are_input_errors(call, message):
    state = spring_at(0.8, 0.01)
    with unchecked(), pytest.raises(InputError, match=f"^{re.escape(message)}"):
        call(state)
