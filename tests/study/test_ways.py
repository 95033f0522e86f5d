"""Routes of a study: snaps at a price, round corners, weighted objectives, alternatives.

Of the spring: F = (1 − x_l/cos δ) sin δ, folds at x_l = cos³δ, F = sin³δ (PHYSICS section 2).
"""

from pathlib import Path

import numpy as np
import pytest

import equimorph as em
from equimorph.errors import InputError
from equimorph.storage import read_results, read_schedule
from equimorph.study import Outcome, parse_study, prepare
from studies import SPRING_SET, answered, answered_again, page

ENDS = """
start = { at = { x_l = 0.8, F = 0.01 }, highest = "angle" }
goal = { at = { x_l = 0.8, F = 0.01 }, lowest = "angle" }
"""
ROUTES = f"""\
[[route]]
name = "snapping"
snap_price = 0.1
{ENDS}
[[route]]
name = "round"
smooth = 0.05
via = [{{ x_l = 1.1 }}, {{ F = -0.1 }}]
start = {{ at = {{ x_l = 0.8, F = -0.05 }}, highest = "angle" }}
goal = {{ at = {{ x_l = 1.1, F = -0.1 }} }}
[[route]]
name = "timed"
objective = {{ time = 1.0, length = 0.5 }}
rates = {{ x_l = 0.1, F = 0.05 }}
{ENDS}
[[route]]
name = "several"
alternatives = 2
{ENDS}
[[route]]
name = "surviving"
survive = {{ x_l = 0.01 }}
start = {{ at = {{ x_l = 0.8, F = 0.0 }}, highest = "angle" }}
goal = {{ at = {{ x_l = 0.9, F = 0.0 }}, highest = "angle" }}
[[route]]
name = "probable"
survive = {{ F = 0.005 }}
probability = 0.99
start = {{ at = {{ x_l = 0.8, F = 0.0 }}, highest = "angle" }}
goal = {{ at = {{ x_l = 0.9, F = 0.0 }}, highest = "angle" }}
"""


def both_sides(eset, start, goal, count, within, margin, monitor):
    """Two routes in place of a search, which needs a set with a hole."""
    demands = {"within": within, "margin": margin, "monitor": monitor}
    around = [{"F": -0.05}, {"x_l": 1.2}, {"F": 0.05}, {"x_l": 0.8}, {"F": 0.01}]
    return tuple(em.plan(eset, start, goal, via=via, **demands) for via in (around, None)[:count])


@pytest.fixture(scope="module")
def run(tmp_path_factory) -> tuple[Outcome, Path]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("equimorph.study.kinds.route.alternatives", both_sides)
        return answered(tmp_path_factory.mktemp("ways"), SPRING_SET + ROUTES)


def test_a_snap_is_told_with_its_place_and_the_energy_it_frees(run):
    """At the fold x_l = cos³δ, F = sin³δ; what is freed is a difference of U + F x_l tan δ."""
    route = run[0].of("route")["snapping"][0]
    (snap,) = route.snaps
    x, force = snap.state["x_l"], snap.state["F"]
    np.testing.assert_allclose(x ** (2 / 3) + force ** (2 / 3), 1.0, rtol=1e-9)

    def energy(angle: float) -> float:
        return 0.5 * (x / np.cos(angle) - 1.0) ** 2 + force * x * np.tan(angle)

    before, after = np.arcsin(force ** (1 / 3)), float(snap.state.z[0])
    np.testing.assert_allclose(snap.released, energy(before) - energy(after), rtol=1e-7)
    assert "energy released" in page(run[1])
    assert "with the price of the snaps" in page(run[1])


def test_the_landings_of_a_route_are_in_the_results(run):
    stored = read_results(run[1] / "results.h5").routes["snapping"].snaps
    found = run[0].of("route")["snapping"][0].snaps
    assert [each.released for each in stored] == [each.released for each in found]
    np.testing.assert_array_equal(stored[0].way.z, found[0].way.z)


def test_a_smoothed_route_passes_beside_its_corner(run):
    """The distance is at most the tolerance, in scaled parameters (scales 1)."""
    schedule = read_schedule(run[1] / "round-schedule.csv")
    off = np.hypot(*(schedule.values[:, :2] - [1.1, -0.05]).T).min()
    assert 0.0 < off <= 0.05 * np.sqrt(2.0)
    assert "corners rounded by" in page(run[1])


def test_a_route_may_be_planned_for_time_and_length(run):
    route = run[0].of("route")["timed"][0]
    rates = em.Rates({"x_l": 0.1, "F": 0.05})
    assert route.objective == "time + 0.5 length"
    time = rates.times(route.schedule)[-1]
    np.testing.assert_allclose(route.cost, time + 0.5 * route.length, rtol=1e-3)


def test_alternatives_have_schedules_of_their_own_and_one_table(run):
    first, second = run[0].of("route")["several"]
    for name, route in (("several", first), ("several-2", second)):
        schedule = read_schedule(run[1] / f"{name}-schedule.csv")
        np.testing.assert_array_equal(schedule.values, route.schedule.values)
        assert f'<a href="{name}-schedule.csv">' in page(run[1])
        assert read_results(run[1] / "results.h5").routes[name].length == route.length
    assert (run[1] / "several-alternatives.png").exists()


def test_routes_come_from_the_folder_when_asked_again(run):
    again = answered_again(run[1].parent / "spring.toml", run[1])
    assert again.of("route")["several"][1].length == pytest.approx(
        run[0].of("route")["several"][1].length, rel=0, abs=0
    )
    assert again.of("route")["snapping"][0].snaps[0].landed
    for name in ("surviving", "probable"):
        known, read = (each.of("route")[name][0].survival for each in (run[0], again))
        assert repr(read) == repr(known)
        assert np.array_equal(read.offsets, known.offsets)


def test_what_survives_errors_is_told(run):
    told = page(run[1])
    assert "Survives errors x_l ± 0.01: supported." in told  # the set has a constraint
    assert "Survives errors F ~ 0.005: probable (1000 of 1000 random trials arrived" in told


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ("snap_price = 0", r"`route\[0\]\.snap_price` must be greater than 0; got 0"),
        ("snap_price = 1\nvia = [{ F = 0 }]", "must give one of via, snap_price, alternatives"),
        ("snap_price = 1\nsmooth = 0.1", "must give one of smooth, snap_price"),
        ("alternatives = 1", r"`route\[0\]\.alternatives` must be at least 2"),
        ('objective = "speed"', r"`route\[0\]\.objective` must be one of length, travel, .*time"),
        ("objective = { length = -1 }", r"`route\[0\]\.objective` must be one of length"),
        ("objective = [1]", r"`route\[0\]\.objective` must be one of length"),
        ('objective = "time"', "must give the largest rates where its objective counts time"),
        ("rates = { F = 1 }", "must give the largest rates where its objective counts time"),
        ('objective = "time"\nrates = { y = 1 }', r"in `route\[0\]\.rates`: .*y"),
        ('objective = "time"\nrates = { F = 0 }', r"`route\[0\]\.rates\.F` must be greater than 0"),
    ],
)
def test_a_route_that_means_nothing(wrong, message):
    with pytest.raises(InputError, match=message):
        prepare(parse_study(f'{SPRING_SET}[[route]]\nname = "way"\n{ENDS}{wrong}', "spring.toml"))


def test_alternatives_need_two_parameters():
    narrow = (
        SPRING_SET.replace("F = [-0.2, 0.2]", "").replace("[9, 9]", "[9]").replace("1.3],", "1.3]")
    )
    ends = ENDS.replace(", F = 0.01", "")
    text = f'{narrow}[[route]]\nname = "way"\nalternatives = 2\n{ends}'
    with pytest.raises(InputError, match=r"`route\[0\]\.alternatives` needs a set over"):
        prepare(parse_study(text, "spring.toml"))


def test_files_of_two_questions_never_have_the_same_name():
    routes = [f'[[route]]\nname = "{name}"\n{ENDS}' for name in ("a", "a-2", "a-reach")]
    with pytest.raises(InputError, match=r"give its route a-2 a name without .* route a \(a-2\)"):
        parse_study(f"{SPRING_SET}{routes[0]}alternatives = 2\n{routes[1]}", "spring.toml")
    reach = '[[reach]]\nname = "a"\nstart = { at = { x_l = 0.8, F = 0.0 } }\ndescriptors = ["F"]\n'
    with pytest.raises(InputError, match=r"reach a a name without the files of the route a-reach"):
        parse_study(SPRING_SET + reach + routes[2], "spring.toml")
