"""Optima followed while loads and targets vary, against closed forms; jumps with both sides.

A slider at u = a, or u = a + b, is held by a spring of energy ½ (u − a − b)²; the load l counts in
the objective only, so that optima are those of plain functions of u.
"""

from types import SimpleNamespace

import numpy as np
import pytest
from numpy.polynomial import Polynomial

import equimorph as em
from equimorph.errors import InputError
from equimorph.model import Descriptor
from equimorph.structures import State
from equimorph.tasks.optimising.moving_optimum import _Track, follow_optimum
from oracles.sextics import roots_of
from typecheck import unchecked

SLIDER = em.EnergyStructure(
    "(u - a - b)**2/2 + l**2/2",
    [em.Unknown("u", 0.0)],
    [em.Parameter(name, "", 1.0, role, 0.0) for name, role in zip("abl", (
        "actuator", "actuator", "load"), strict=True)],
)  # fmt: skip
PLACE = SLIDER.descriptor("u")


def objective(function):
    def value(z, p):
        return function(z[:, 0], p[:, 0], p[:, 1], p[:, 2])

    return Descriptor("objective", "", value)


def at(u, load, b=0.0):
    return State(SLIDER, np.array([u]), np.array([u - b, b, load]))


def test_double_well_jumps_where_its_minimum_ends():
    """u⁴/4 − u²/2 + l u: the right minimum ends at u = 1/√3, l = 2/(3√3); the left is at −2/√3."""
    goal = objective(lambda u, a, b, q: u**4 / 4 - u**2 / 2 + q * u)
    with unchecked():
        found = follow_optimum(at(1.0, -0.2), goal, [{"l": 0.6}, {"l": -0.6}], actuators=["a"])
    assert found.arrived
    assert len(found.jumps) == 2
    there, back = found.jumps
    edge = 2 / (3 * np.sqrt(3))
    assert -0.2 + 0.8 * there.at == pytest.approx(edge, abs=1e-7)
    assert 0.6 - 1.2 * (back.at - 1) == pytest.approx(-edge, abs=1e-7)
    assert there.before.z[0] == pytest.approx(1 / np.sqrt(3), abs=1e-3)
    assert there.after.z[0] == pytest.approx(-2 / np.sqrt(3), abs=1e-7)
    assert back.after.z[0] == pytest.approx(2 / np.sqrt(3), abs=1e-7)
    assert there.values[0] > there.values[1]
    u, load = found.states.z[:, 0], found.states["l"]
    smooth = np.abs(3 * u**2 - 1) > 1e-2
    assert (u**3 - u + load)[smooth] == pytest.approx(0, abs=1e-7)
    assert len(found.certificates) == len(found.at) == len(found.values)
    assert found.schedule is None


def polynomials(*parts):
    """Objective of coefficients C of powers of u, plus the load q times B; and C′, B′."""
    first, second = map(Polynomial, parts)
    return objective(lambda u, a, b, q: first(u) + q * second(u)), first.deriv(), second.deriv()


def test_short_jumps_are_told():
    """Beside a cusp of the objective: C′ + q B′ = 0 turns where C′B″ − C″B′ = 0, once on the way.

    The minimum jumps by 0.08, less than optima move in a step. Found among 200 random objectives.
    """
    goal, first, second = polynomials(
        [0.0, -0.4805, 0.7298, -0.6253, 0.5359, -0.4668, 0.25], [0.0, 0.8528, -0.4654, -0.2615]
    )
    with unchecked():
        found = follow_optimum(at(1.1021386531656652, 0.6348), goal, {"l": 0.1786}, actuators=["a"])
    turns = roots_of(first * second.deriv() - first.deriv() * second)
    place = min(turns, key=lambda u: abs(u - 0.638))
    at_turn = (-first(place) / second(place) - 0.6348) / (0.1786 - 0.6348)
    assert [each.at for each in found.jumps] == [pytest.approx(at_turn, abs=1e-7)]
    assert found.jumps[0].after.z[0] < place - 0.03


def test_optima_on_both_sides_of_a_short_jump_predict_nothing():
    """1e-10 of a leg apart, they would tell a rate of 1e7: one of 96 random optima was lost so."""
    near, far = ([SimpleNamespace(time=each) for each in (0.3, 0.3 + gap)] for gap in (1e-10, 1e-6))
    assert _Track(None, near).smooth_pair() is None
    assert _Track(None, far).smooth_pair() == tuple(far)


def test_a_branching_minimum_goes_on_without_a_jump():
    """u⁴/4 − l u²/2: u = 0 up to l = 0, then ±√l."""
    goal = objective(lambda u, a, b, q: u**4 / 4 - q * u**2 / 2)
    with unchecked():
        found = follow_optimum(at(0.0, -0.5), goal, {"l": 0.5}, actuators=["a"])
    assert found.arrived
    assert found.jumps == ()
    assert abs(found.states.z[-1, 0]) == pytest.approx(np.sqrt(0.5), abs=1e-7)


def test_constraints_become_active_and_idle():
    """½(u − l)² with u ≤ ½: u = min(l, ½), there and back."""
    goal = objective(lambda u, a, b, q: (u - q) ** 2 / 2)
    for within, actuators, kind in (
        ([PLACE <= 0.5], ["a"], "constraint"),
        ([], {"a": (-1.0, 0.5)}, "box"),
    ):
        found = follow_optimum(
            at(0.0, 0.0), goal, [{"l": 1.0}, {"l": 0.2}], actuators=actuators, within=within
        )
        assert found.arrived
        assert found.jumps == ()
        wanted = np.minimum(found.states["l"], 0.5)
        assert found.states.z[:, 0] == pytest.approx(wanted, abs=1e-7)
        kinds = [each.kind for each in found.certificates]
        assert (kinds[0], kinds[-1], kind in kinds) == ("interior", "interior", True)


def test_spare_actuators_choose_the_best():
    """a² + 2 b² with a + b = S: a = 2 S/3, b = S/3."""
    goal = objective(lambda u, a, b, q: a**2 + 2 * b**2)
    start = at(0.3, 0.0, b=0.1)
    found = follow_optimum(start, goal, [{PLACE: 0.9}, {PLACE: 0.3}], actuators=["a", "b"])
    assert found.arrived
    target = found.states.z[:, 0]
    assert target == pytest.approx(np.where(found.at < 1, 0.3 + 0.6 * found.at, 0.9 - 0.6 * (
        found.at - 1)), abs=1e-8)  # fmt: skip
    assert found.states["a"] == pytest.approx(2 * target / 3, abs=1e-6)
    assert found.states["b"] == pytest.approx(target / 3, abs=1e-6)


def test_least_angle_of_the_spring_slides_along_the_stability_boundary():
    """sin³ δ = F/k, and with a margin inside: E'' = k x_l (x_l − cos³ δ)/cos⁴ δ."""
    spring = em.Spring()
    start = em.lift(spring.natural_state(x_l=0.8), {"F": 0.01}).end.state
    with unchecked():
        found = follow_optimum(start, spring.angle, {"F": 0.05}, actuators=["x_l"])
        kept = follow_optimum(start, spring.angle, {"F": 0.05}, actuators=["x_l"], margin=0.05)
    assert np.sin(found.values) ** 3 == pytest.approx(found.states["F"], abs=1e-9)
    assert {each.kind for each in found.certificates} == {"stability boundary"}
    assert kept.margin == pytest.approx(0.05, abs=1e-7)
    schedule = kept.schedule
    assert schedule.values == pytest.approx(kept.states.p)
    assert schedule.margins == pytest.approx(kept.margin)
    assert schedule.descriptors["angle"] == pytest.approx(kept.values)
    assert (schedule.progress[0], schedule.progress[-1]) == (0.0, 1.0)
    x, delta = kept.states["x_l"], kept.values
    assert x * (x - np.cos(delta) ** 3) / np.cos(delta) ** 4 == pytest.approx(0.05, abs=1e-7)


def test_best_compromise_beyond_a_limit_and_beyond_a_snap():
    """At x_l = 0.85 the angle stays where F = (1 − 0.85/cos δ) sin δ; at a snap, sin³ δ = F."""
    spring = em.Spring()
    angle = spring.angle
    start = em.lift(spring.natural_state(x_l=0.8), {"F": 0.01}).end.state
    limited = em.track(start, {angle: 0.40}, actuators={"x_l": (0.5, 0.85)}, beyond=True)
    assert limited.failure == "actuator limit"
    rest = limited.compromise
    assert rest.arrived
    assert rest.states["x_l"] == pytest.approx(0.85, abs=1e-8)
    gap = rest.states.z[-1, 0] - 0.40
    assert rest.values[-1] == pytest.approx(gap**2 / 2, rel=1e-6)
    snapped = em.track(start, {angle: -0.3}, actuators=["x_l"], beyond=True)
    assert snapped.failure == "snap-through"
    assert snapped.compromise.states.z[:, 0] == pytest.approx(np.arcsin(np.cbrt(0.01)), abs=1e-7)
    assert em.track(start, {angle: 0.40}, actuators=["x_l"], beyond=True).compromise is None


def test_targets_regained_leave_the_limit():
    """Out to 0.40 and back to 0.60: beyond the limit for a while, then on target again."""
    spring = em.Spring()
    start = em.lift(spring.natural_state(x_l=0.8), {"F": 0.01}).end.state
    legs = [{spring.angle: 0.40}, {spring.angle: 0.60}]
    found = em.track(start, legs, actuators={"x_l": (0.5, 0.85)}, beyond=True)
    rest = found.compromise
    assert rest.states.z[-1, 0] == pytest.approx(0.60, abs=1e-7)
    assert rest.values[-1] < 1e-14
    assert rest.values.max() > 5e-3


def test_compromise_beyond_a_singular_jacobian_of_the_arch():
    """Heights beyond reach: what is left of the targets is orthogonal to what can be steered."""
    arch = em.Rod()
    left, right = arch.height(1 / 3), arch.height(2 / 3)
    with unchecked():
        loaded = em.lift(arch.natural_state(Theta=1.0), {"q": 2.5}).end.state
        found = em.track(
            loaded,
            {left: 0.26, right: 0.25},
            actuators={"Theta": (0.2, 2.5), "Delta": (-2, 2)},
            beyond=True,
        )
    assert found.failure == "singular Jacobian"
    rest = found.compromise
    assert rest.arrived
    assert rest.certificates[-1].residual < 1e-7
    last = rest.states[-1]
    gap = np.array([left(last) - 0.26, right(last) - 0.25])
    h, changes = 1e-4, []
    for name in ("Theta", "Delta"):
        ends = [em.lift(last, {name: last[name] + s}).end.state for s in (h, -h)]
        changes.append([(d(ends[0]) - d(ends[1])) / (2 * h) for d in (left, right)])
    assert np.abs(np.array(changes) @ gap).max() < 1e-5
    assert np.linalg.norm(gap) == pytest.approx(np.sqrt(2 * rest.values[-1]), rel=1e-8)


@pytest.mark.parametrize(
    ("to", "options", "words"),
    [
        ({PLACE: 0.3}, {}, "must prescribe fewer descriptors than there are actuators"),
        ({"a": 0.3}, {}, "leave the actuator a free; got 0.3"),
        ({"l": 0.3}, {"sense": "most"}, "`sense` must be min or max"),
        ({"l": 0.3}, {"margin": -1.0}, "`margin` must be a number >= 0"),
        ({"l": 0.3}, {"actuators": {"a": (1.0, 0.0)}}, "limits in order"),
    ],
)
def test_bad_questions_are_refused(to, options, words):
    with unchecked(), pytest.raises(InputError, match=words):
        follow_optimum(at(0.0, 0.0), PLACE, to, **{"actuators": ["a"], **options})


def test_no_optimum_at_all_is_refused():
    """u falls without end."""
    found = follow_optimum(at(0.0, 0.0), PLACE, {"l": 1.0}, actuators=["a"])
    assert found.status == "refused"
    assert "no optimum" in found.why
    assert len(found.states) == 0
