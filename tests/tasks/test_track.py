"""Tracking: the spring against closed forms of [Feher2025]_ section 2.3, and the arch's square.

F/k = (1 − x_l/cos δ) sin δ; states are stable where x_l > cos³ δ.
"""

import numpy as np
import pytest
from scipy.optimize import brentq

import equimorph as em
from equimorph.errors import InputError
from equimorph.structures import State
from oracles.polynomial import Polynomial
from typecheck import unchecked

LOAD = (1 - 0.8 / np.cos(0.62)) * np.sin(0.62)
SPRING = em.Spring()
ANGLE = SPRING.descriptor("angle")


def support(delta: float, load: float) -> float:
    return float(np.cos(delta) * (1 - load / np.sin(delta)))


@pytest.fixture(scope="module")
def start() -> State:
    return State(SPRING, np.array([0.62]), np.array([0.80, LOAD, 1.0]))


@pytest.fixture(scope="module")
def middle() -> State:
    """The arch at q = 2.5 with both heights 0.15: Θ = 1.621098, Δ = 0."""
    arch = em.Rod()
    loaded = em.lift(arch.natural_state(Theta=1.0), {"q": 2.5}).end.state
    heights = {arch.height(1 / 3): 0.15, arch.height(2 / 3): 0.15}
    found = em.track(loaded, heights, actuators=["Theta", "Delta"])
    assert found.arrived
    return found.path.end.state


def test_angle_is_lowered_at_fixed_load(start):
    """δ = 0.40 at the level of C_s needs x_l = 0.89763."""
    found = em.track(start, {ANGLE: 0.40}, actuators=["x_l"])
    assert found.arrived
    assert found.schedule.values[-1, 0] == pytest.approx(support(0.40, LOAD), abs=1e-11)
    assert found.schedule.values[-1, 0] == pytest.approx(0.89763, abs=5e-6)
    delta = found.values[ANGLE.name]
    assert found.path.states["x_l"] == pytest.approx([support(d, LOAD) for d in delta], abs=1e-11)
    assert found.margin > 0


@pytest.mark.parametrize("goal", [0.40, 0.30, 0.75])
def test_misses_between_rows_are_those_of_the_closed_form(start, goal):
    """Half-way between rows x_l is the mean of two, δ its root, and the target the mean of both."""
    found = em.track(start, {ANGLE: goal}, actuators=["x_l"])
    delta, x_l = found.values[ANGLE.name], found.schedule.values[:, 0]
    misses = []
    for a, b, x in zip(delta[:-1], delta[1:], 0.5 * (x_l[:-1] + x_l[1:]), strict=True):
        low, high = sorted((a, b))
        root = brentq(lambda d, x=x: (1 - x / np.cos(d)) * np.sin(d) - LOAD, low, high, xtol=1e-15)
        misses.append(abs(root - 0.5 * (a + b)))
    assert found.between == {ANGLE.name: pytest.approx(max(misses), rel=1e-6)}
    assert f"{max(misses):.2g} off" in repr(found)


def test_curves_are_missed_between_rows_by_their_bend_too(start):
    """δ(t) = 0.62 − 0.2 t²: the target half-way is that of the curve, not the mean of two rows."""
    found = em.track(start, lambda t: {ANGLE: 0.62 - 0.2 * t**2}, actuators=["x_l"])
    t, x_l = found.path.at, found.schedule.values[:, 0]
    middle, delta = 0.5 * (t[:-1] + t[1:]), found.values[ANGLE.name]
    misses = []
    for a, b, x, s in zip(delta[:-1], delta[1:], 0.5 * (x_l[:-1] + x_l[1:]), middle, strict=True):
        low, high = sorted((a, b))
        root = brentq(lambda d, x=x: (1 - x / np.cos(d)) * np.sin(d) - LOAD, low, high, xtol=1e-15)
        misses.append(abs(root - (0.62 - 0.2 * s**2)))
    assert found.between[ANGLE.name] == pytest.approx(max(misses), rel=1e-6)


def largest_miss(delta, x_l, wanted):
    """Largest miss of δ half-way between rows, where x_l is the mean of two."""
    misses = [0.0]
    for a, b, x, d in zip(delta[:-1], delta[1:], 0.5 * (x_l[:-1] + x_l[1:]), wanted, strict=True):
        low, high = sorted((a, b))
        root = brentq(lambda d, x=x: (1 - x / np.cos(d)) * np.sin(d) - LOAD, low, high, xtol=1e-15)
        misses.append(abs(root - d))
    return max(misses)


@pytest.mark.parametrize("accuracy", [1e-4, 1e-6, 1e-8])
@pytest.mark.parametrize(
    ("targets", "wanted"),
    [
        ({ANGLE: 0.30}, lambda t: 0.62 - 0.32 * t),
        ([{ANGLE: 0.40}, {ANGLE: 0.75}], lambda t: np.interp(t, [0, 1, 2], [0.62, 0.40, 0.75])),
        (lambda t: {ANGLE: 0.62 - 0.3 * t**2}, lambda t: 0.62 - 0.3 * t**2),
    ],
)
def test_rows_are_inserted_until_an_accuracy_holds(start, targets, wanted, accuracy):
    """All rows meet the closed form, half-way they miss it by no more, and rows are few."""
    coarse = em.track(start, targets, actuators=["x_l"])
    found = em.track(start, targets, actuators=["x_l"], accuracy=accuracy)
    at, delta, x_l = found.path.at, found.values[ANGLE.name], found.schedule.values[:, 0]
    assert found.arrived
    assert (np.diff(at) > 0.0).all()
    assert delta == pytest.approx(wanted(at), abs=1e-9)
    assert x_l == pytest.approx([support(d, LOAD) for d in delta], abs=1e-9)
    miss = largest_miss(delta, x_l, wanted(0.5 * (at[:-1] + at[1:])))
    assert miss <= accuracy * (1.0 + 1e-6)
    assert found.between[ANGLE.name] == pytest.approx(miss, rel=1e-5, abs=1e-14)
    # halving a row divides its miss by four
    most = np.sqrt(max(coarse.between[ANGLE.name] / accuracy, 1.0))
    assert len(at) <= len(coarse.path.at) * max(1.0, 2.0 * most)


def test_an_accuracy_below_round_off_is_refused_by_name(start, monkeypatch):
    monkeypatch.setattr("equimorph.tasks.motion.between_rows.MOST_ROWS", 500)
    found = em.track(start, {ANGLE: 0.40}, actuators=["x_l"], accuracy=1e-12)
    assert (found.status, found.failure, found.schedule) == ("refused", "accuracy", None)
    assert "rows the targets are missed by" in found.why
    assert len(found.path.at) <= 500


def test_spare_actuators_get_further_rows_too(start):
    """With x_l and F free the rows in between are the nearest states that meet the target."""
    found = em.track(start, {ANGLE: 0.45}, actuators=["x_l", "F"], accuracy=1e-8)
    assert found.arrived
    assert found.between[ANGLE.name] <= 1e-8
    delta, (x_l, force) = found.values[ANGLE.name], found.schedule.values[:, :2].T
    assert (1 - x_l / np.cos(delta)) * np.sin(delta) == pytest.approx(force, abs=1e-9)


def test_angle_beyond_the_stability_boundary_is_a_snap(start):
    """cos³ δ = x_l is met at (0.2165, 0.9316): sin³ δ = F/k."""
    found = em.track(start, {ANGLE: -0.62}, actuators=["x_l"])
    assert (found.status, found.failure) == ("refused", "snap-through")
    edge = float(np.arcsin(np.cbrt(LOAD)))
    assert ANGLE(found.path.end.state) == pytest.approx(edge, abs=1e-9)
    assert found.path.end.state["x_l"] == pytest.approx(np.cos(edge) ** 3, abs=1e-9)
    assert found.last_good == pytest.approx((0.62 - edge) / 1.24, abs=1e-9)
    assert found.why.startswith("stability is lost")
    assert found.schedule is None


def test_load_moves_while_the_actuator_answers(start):
    """δ is held while F falls to −0.05: x_l = cos δ (1 − F/sin δ)."""
    found = em.track(start, {ANGLE: 0.62, "F": -0.05}, actuators=["x_l"])
    assert found.arrived
    assert found.values[ANGLE.name] == pytest.approx(0.62, abs=1e-11)
    assert found.schedule.values[-1, 0] == pytest.approx(support(0.62, -0.05), abs=1e-11)


def test_actuator_limit_is_met_where_the_closed_form_says(start):
    found = em.track(start, {ANGLE: 0.40}, actuators={"x_l": (0.5, 0.85)})
    assert (found.status, found.failure) == ("refused", "actuator limit")
    end = found.path.end.state
    assert end["x_l"] == pytest.approx(0.85, abs=1e-9)
    assert support(ANGLE(end), LOAD) == pytest.approx(0.85, abs=1e-9)


def test_constraint_is_told_from_a_limit(start):
    found = em.track(start, {ANGLE: 0.40}, actuators=["x_l"], within=[ANGLE >= 0.5])
    assert (found.failure, ANGLE(found.path.end.state)) == (
        "constraint",
        pytest.approx(0.5, abs=1e-9),
    )


def test_square_of_heights_is_closed_and_stable(middle):
    """PHYSICS §4.6: stable all around; by symmetry Δ = 0 where both heights are the same."""
    arch = middle.structure
    left, right = arch.height(1 / 3), arch.height(2 / 3)
    corners = [(0.1, 0.1), (0.2, 0.1), (0.2, 0.2), (0.1, 0.2), (0.1, 0.1)]
    around = em.track(
        middle, [{left: x, right: y} for x, y in corners], actuators=["Theta", "Delta"]
    )
    assert around.arrived
    assert around.margin > 0
    first, last = np.flatnonzero(np.isin(around.path.at, [1.0, 5.0]))
    assert around.path.states.p[last] == pytest.approx(around.path.states.p[first], abs=1e-10)
    values = around.schedule.descriptors
    assert set(values) == {left.name, right.name}
    assert values[left.name].max() == pytest.approx(0.2, abs=1e-9)


def test_heights_out_of_reach_end_with_a_class_and_a_place(middle):
    """No arch of length 1 between supports sin 1 apart can have heights of 0.3."""
    arch = middle.structure
    found = em.track(
        middle,
        {arch.height(1 / 3): 0.3, arch.height(2 / 3): 0.3},
        actuators={"Theta": (0.2, 2.5), "Delta": (-2, 2)},
    )
    assert found.status == "refused"
    assert found.failure in ("snap-through", "singular Jacobian", "actuator limit")
    assert 0 < found.last_good < 1
    assert "Theta = " in found.why


@pytest.mark.parametrize(
    ("targets", "actuators", "words"),
    [
        ({"F": 0.4}, ["x_l"], r"as many descriptors as there are actuators \(1\), or fewer; got 0"),
        ({ANGLE: 0.4, "x_l": 0.9}, ["x_l"], "leave the actuator x_l free; got 0.9"),
        ({ANGLE: 0.4}, {"x_l": (1.0, 0.5)}, "limits in order"),
        ({ANGLE: 0.4}, ["y"], "`y` must be a parameter"),
        ([0.4], ["x_l"], "must be finite values by name, a `Spline` or a function of t"),
    ],
)
def test_bad_questions_are_refused(start, targets, actuators, words):
    with unchecked(), pytest.raises(InputError, match=words):
        em.track(start, targets, actuators=actuators)


def test_an_unstable_start_is_refused():
    unstable = State(SPRING, np.array([0.0]), np.array([0.80, 0.0, 1.0]))
    with pytest.raises(InputError, match="must be stable; got a state of index 1"):
        em.track(unstable, {ANGLE: 0.1}, actuators=["x_l"])


def named(name, function):
    return em.Descriptor(name, "1", function)


@pytest.mark.parametrize("names", [("same", "same"), (ANGLE.name,)])
def test_descriptors_that_share_a_name_are_refused(start, names):
    """A schedule knows values by name: one of both was left out in silence."""
    both = [named(n, lambda z, p, k=k: (3.0 + k) * z[:, 0]) for k, n in enumerate(names)]
    with pytest.raises(em.InputError, match="names of their own"):
        em.track(start, {ANGLE: 0.5}, actuators=["x_l"], monitor=both)


@pytest.mark.parametrize(
    "name", ["progress", "stability_margin", "time", "x_l", "a,b", 'a "b"', "="]
)
def test_descriptors_with_names_of_columns_come_back(start, tmp_path, name):
    own = named(name, lambda z, p: 7.0 + z[:, 0])
    found = em.track(start, {ANGLE: 0.5}, actuators=["x_l"], monitor=[own])
    for schedule in (found.schedule, found.schedule.in_time(duration=2.0)):
        for ending in (".csv", ".json"):
            em.storage.write_schedule(schedule, tmp_path / f"table{ending}")
            back = em.storage.read_schedule(tmp_path / f"table{ending}")
            assert np.array_equal(back.descriptors[name], 7.0 + found.values[ANGLE.name])
            assert back.descriptor_units == {ANGLE.name: ANGLE.unit, name: own.unit}
            assert np.array_equal(back.progress, schedule.progress)
            assert np.array_equal(back.margins, schedule.margins)
            assert np.array_equal(back.values, schedule.values)


DIPPING = Polynomial(
    lambda x, a, b, m, d: (x - m) ** 4 * (1 / 12) - d * (x - m) ** 2 * 0.5 - (a + b) * x,
    1,
    ("a", "b", "m", "d"),
)
"""E'' = (x − m)² − d: stability is lost between x = m ∓ √d alone."""


@pytest.mark.parametrize("way", ["one leg", "many legs", "spare actuators"])
def test_no_narrow_loss_of_stability_is_passed(way):
    """16 of 510 random motions arrived across an unstable stretch between two of their rows."""
    draw = np.random.default_rng(4)
    place = DIPPING.descriptor("0")
    for _ in range(12):
        m, d = draw.uniform(-0.5, 0.5), float(draw.choice([-1.0, 1.0]) * 10 ** draw.uniform(-7, -3))
        x, goal = m - draw.uniform(0.2, 0.9), m + draw.uniform(0.05, 0.9)
        force = (x - m) ** 3 / 3 - d * (x - m)
        start = DIPPING.state(x, a=force, m=m, d=d)
        count = 20 if way == "many legs" else 1
        legs = [{place: x + (goal - x) * k / count} for k in range(1, count + 1)]
        actuators = ["a", "b"] if way == "spare actuators" else ["a"]
        with unchecked():
            found = em.track(start, legs, actuators=actuators)
        if d < 0.0:
            assert found.arrived
            continue
        assert found.failure == "snap-through"
        edge = m - np.sqrt(d)
        assert found.path.end.state.z[0] == pytest.approx(edge, abs=1e-8)
        assert found.last_good / count == pytest.approx((edge - x) / (goal - x), abs=1e-8)
