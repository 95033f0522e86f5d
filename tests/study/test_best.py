"""Questions of a study on what is best, and routes for many actuators: against closed forms.

Of the spring: F = k (1 − x_l/cos δ) sin δ, folds at x_l = cos³δ, F = k sin³δ (PHYSICS section 2).
"""

from pathlib import Path

import numpy as np
import pytest

from equimorph.errors import InputError
from equimorph.storage import read_results, read_schedule
from equimorph.study import Outcome, parse_study, prepare, run_study
from studies import EXAMPLES, SPRING_SET, answered, draw_dots, page, rows_of
from typecheck import unchecked

SPRING = """\
[structure]
kind = "spring"

"""
UPPER = '{ at = { x_l = 0.8, F = 0.02 }, highest = "angle" }'
STRONGEST = """\
[[strongest]]
name = "load"
box = { x_l = [0.6, 0.98], k = [0.8, 1.2] }
intervals = [6, 4]
load = "F"
offsets = { x_l = 0.02 }
"""
SAMPLED = """\
[[sampled_route]]
name = "around"
start = { at = { x_l = 0.8 }, steps = [{ F = -0.01 }] }
goal = { at = { x_l = 0.9 }, steps = [{ F = -0.05 }] }
actuators = { x_l = [0.5, 1.3], F = [-0.2, 0.2] }
"""
QUESTIONS = f"""\
[[landscape]]
name = "upper"
objective = "angle"
within = ["angle >= 0.3"]
start = {UPPER}
box = {{ x_l = [0.6, 1.1], F = [-0.1, 0.12] }}
intervals = [6, 7]

[[landscape]]
name = "least"
objective = "energy"
intervals = [10, 11]

[[follow]]
name = "pushed"
start = {UPPER}
objective = "angle"
within = ["angle >= 0.1"]
targets = [{{ F = 0.05 }}, {{ F = 0.01 }}]
actuators = ["x_l"]

[[follow]]
name = "too-far"
start = {UPPER}
objective = "angle"
sense = "max"
targets = [{{ F = 0.6 }}]
actuators = ["x_l"]

{STRONGEST}
{SAMPLED}
"""
REDUNDANT = f"""\
{SPRING}[set]
box = {{ x_l = [0.5, 1.3], k = [0.5, 1.5] }}
fixed = {{ F = 0.02 }}
within = ["angle <= 1.4", "angle >= -1.4"]
intervals = [5, 5]

[[track]]
name = "shared"
start = {{ at = {{ x_l = 0.8, k = 1.0 }}, highest = "angle" }}
targets = [{{ angle = 0.8 }}]
actuators = ["x_l", "k"]

[[follow]]
name = "soft"
start = {{ at = {{ x_l = 0.8, k = 1.0 }}, highest = "angle" }}
objective = "k"
targets = [{{ angle = 0.7 }}]
actuators = ["x_l", "k"]
"""


@pytest.fixture(scope="module")
def run(tmp_path_factory) -> tuple[Outcome, Path]:
    return answered(tmp_path_factory.mktemp("best"), SPRING_SET + QUESTIONS)


@pytest.fixture(scope="module")
def redundant(tmp_path_factory) -> Outcome:
    return answered(tmp_path_factory.mktemp("redundant"), REDUNDANT)[0]


def test_a_landscape_has_values_where_the_piece_of_the_start_has_states(run):
    head, *settings = rows_of(run[1] / "upper-landscape.csv")
    assert head == ["x_l (natural length)", "F (k)", "angle (rad)"]
    assert len(settings) == 7 * 8
    known = np.array([[float(each) for each in row] for row in settings if row[2]])
    assert 0 < len(known) < len(settings)
    length, force, angle = known.T
    np.testing.assert_allclose((1.0 - length / np.cos(angle)) * np.sin(angle), force, atol=1e-9)
    assert f"{56 - len(known)} of 56" in page(run[1])


def test_a_landscape_has_its_barriers(run):
    """Least energy: that of the two mirror images that the force pushes on, up to the cusp.

    Both go on to the other's force, 0.2/11, where that is below the fold's, (1 − x_l^⅔)^(3/2).
    """
    found = run[0].of("landscape")["least"]
    middles = found.barriers.ends.mean(axis=1)
    np.testing.assert_allclose(middles[:, 1], 0.0, atol=1e-12)
    assert middles[:, 0].max() <= 1.0
    both = (1.0 - middles[:, 0] ** (2 / 3)) ** 1.5 > 0.2 / 11
    assert found.barriers.kind == tuple("preference" if go else "stability" for go in both)
    table = rows_of(run[1] / "least-landscape-barriers.csv")
    assert len(table) == 1 + len(found.barriers)
    assert {row[0] for row in table[1:]} <= {"stability", "preference"}


def test_a_followed_optimum_stays_on_the_folds(run):
    """The flattest stable state under F has sin δ = F^⅓."""
    found = run[0].of("follow")["pushed"]
    assert found.arrived
    np.testing.assert_allclose(found.values[0], np.arcsin(0.02 ** (1 / 3)), rtol=1e-6)
    np.testing.assert_allclose(found.values[-1], np.arcsin(0.01 ** (1 / 3)), rtol=1e-6)
    assert "stability boundary" in page(run[1])
    assert "stability boundary, stable" not in page(run[1])  # which the kind says already
    schedule = read_schedule(run[1] / "pushed-follow-schedule.csv")
    np.testing.assert_allclose(schedule.values[-1, 0], np.cos(found.values[-1]) ** 3, rtol=1e-5)


def test_an_optimum_that_ends_is_refused_with_the_leg(run):
    """No stable state with δ > 0 carries more than F = (1 − 0.5^⅔)^(3/2) = 0.225 in this box."""
    found = run[0].of("follow")["too-far"]
    assert not found.arrived
    assert 0.2 < found.states["F"][-1] < 0.226
    assert "of 1 legs" in page(run[1])


def test_the_strongest_setting_and_its_price(run):
    """F_lim = k (1 − x_l^⅔)^(3/2) falls with x_l: at the corner, and there with the worst error."""
    _, sure, robust = run[0].of("strongest")["load"]

    def limit(length: float) -> float:
        return 1.2 * (1.0 - length ** (2 / 3)) ** 1.5

    np.testing.assert_allclose(sure.best.value, limit(0.6), rtol=1e-6)
    np.testing.assert_allclose(robust.guaranteed, limit(0.62), rtol=1e-4)
    assert "its price is" in page(run[1])


def test_a_sampled_route_begins_and_ends_as_wanted(run):
    route = run[0].of("sampled_route")["around"]
    assert route.arrived
    schedule = read_schedule(run[1] / "around-sampled_route-schedule.csv")
    np.testing.assert_allclose(schedule.values[[0, -1], :2], [[0.8, -0.01], [0.9, -0.05]])
    assert "Sampled route around" in page(run[1])


def test_all_of_it_is_in_the_results(run):
    stored = read_results(run[1] / "results.h5").answers
    assert set(stored) == {"landscape", "follow", "strongest", "sampled_route"}
    found = run[0].of("landscape")["upper"]
    np.testing.assert_array_equal(stored["landscape"]["upper"].value, found.value)
    lmap, sure, _ = stored["strongest"]["load"]
    assert sure.best.value == run[0].of("strongest")["load"][1].best.value
    np.testing.assert_array_equal(lmap.value, run[0].of("strongest")["load"][0].value)


def test_two_actuators_share_one_target(redundant):
    """F = k (1 − x_l/cos δ) sin δ at the end, and both have moved."""
    motion = redundant.of("track")["shared"]
    end = motion.states[-1]
    assert motion.arrived
    wanted = end["k"] * (1.0 - end["x_l"] / np.cos(0.8)) * np.sin(0.8)
    np.testing.assert_allclose(wanted, 0.02, rtol=1e-9)
    assert abs(end["x_l"] - 0.8) > 1e-3
    assert abs(end["k"] - 1.0) > 1e-5


def test_a_spare_actuator_serves_a_second_objective(redundant):
    """The softest spring that holds δ = 0.7 is that of the box, and x_l follows from it."""
    found = redundant.of("follow")["soft"]
    assert found.arrived
    end = found.states[-1]
    np.testing.assert_allclose(end["k"], 0.5, rtol=1e-6)
    length = np.cos(0.7) * (1.0 - 0.02 / (0.5 * np.sin(0.7)))
    np.testing.assert_allclose(end["x_l"], length, rtol=1e-6)


LANDSCAPE = '[[landscape]]\nname = "a"\nobjective = "angle"\n'
FOLLOW = f'[[follow]]\nname = "a"\nstart = {UPPER}\nobjective = "angle"\n'


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ('[[landscape]]\nname = "a"\nobjective = "curl"', r"in `landscape\[0\]\.objective`.*curl"),
        (f"{LANDSCAPE}box = {{ x_l = [0.6, 2], F = [0, 0.1] }}", r"landscape\[0\]\.box\.x_l` must"),
        (f"{LANDSCAPE}box = {{ x_l = [0.6, 1] }}", r"box` must span exactly two"),
        (f"{LANDSCAPE}box = {{ x_l = [0.6, 1], k = [1, 2] }}", r"box` must name the free"),
        (f"{LANDSCAPE}intervals = [1, 5]", r"`landscape\[0\]\.intervals\[0\]` must be at least 2"),
        (f'{LANDSCAPE}sense = "best"', r"`landscape\[0\]\.sense` must be 'min' or 'max'"),
        (f"{LANDSCAPE}start = {{ at = {{ x_l = 3, F = 0 }} }}", r"start\.at\.x_l` must lie in"),
        (f'{LANDSCAPE}within = ["curl <= 1"]', r"in `landscape\[0\]\.within\[0\]`.*curl"),
        (f'{FOLLOW}targets = []\nactuators = ["x_l"]', r"`follow\[0\]\.targets` must have at"),
        (f'{FOLLOW}targets = [{{ F = 0.1 }}]\nactuators = ["k"]', r"`follow\[0\]\.actuators` must"),
        (f'{FOLLOW}targets = [{{ curl = 1 }}]\nactuators = ["x_l"]', r"follow\[0\]\.targets\[0\]`"),
        (STRONGEST.replace("x_l = 0.02", "F = 1"), r"`strongest\[0\]\.offsets` must be of act"),
        (STRONGEST.replace("0.02", "-1"), r"`strongest\[0\]\.offsets\.x_l` must be greater than 0"),
        (STRONGEST.replace('"F"', '"y"'), r"in `strongest\[0\]`: .*y"),
        (STRONGEST.replace("[6, 4]", "[6]"), r"`strongest\[0\]\.intervals` must have at least 2"),
        (SAMPLED.replace("{ x_l = 0.8 }", "{ F = 0.8 }"), r"start\.at` must have no loads"),
        (SAMPLED.replace("{ x_l = 0.8 }", "{ y = 0.8 }"), r"in `sampled_route\[0\]\.start\.at`.*y"),
        (SAMPLED.replace("F = [-0.2", "y = [-0.2"), r"in `sampled_route\[0\]\.actuators`.*y"),
        (f"{SAMPLED}loads = [{{ F = 0.1 }}]", r"`sampled_route\[0\]\.loads\[0\]` must not move"),
        (f"{SAMPLED}lifts = 0", r"`sampled_route\[0\]\.lifts` must be at least 1"),
        (
            "\n".join(line for line in SAMPLED.splitlines() if not line.startswith("goal")),
            r"`sampled_route\[0\]` must give a goal, or loads",
        ),
    ],
)
def test_a_question_that_means_nothing(wrong, message):
    with pytest.raises(InputError, match=message):
        prepare(parse_study(SPRING_SET + wrong, "spring.toml"))


@pytest.mark.parametrize("question", [STRONGEST, SAMPLED])
def test_questions_that_begin_with_natural_states_need_no_set(question):
    assert prepare(parse_study(SPRING + question, "spring.toml")).ground.extent is None
    with pytest.raises(InputError, match=r"must have a \[set\]"):
        parse_study(SPRING + question + LANDSCAPE, "spring.toml")


@pytest.mark.slow
def test_a_load_drives_across_a_bridge_with_eight_actuators(tmp_path):
    """Without actuators mid-span sinks by 0.214; on the way no joint of the deck leaves ±0.03."""
    with pytest.MonkeyPatch.context() as patch, unchecked():
        draw_dots(patch)
        found = run_study(EXAMPLES / "drive.toml", tmp_path).of("sampled_route")["across"]
    assert found.arrived
    deck = [found.schedule.descriptors[f"displacement(b{k},y)"] for k in range(1, 6)]
    assert np.abs(deck).max() <= 0.03 * (1 + 1e-6)
    assert found.schedule.descriptors["max_utilisation"].max() <= 1.0 + 1e-6
    loads = [found.schedule.values[:, found.schedule.names.index(f"F{k}")] for k in range(1, 6)]
    np.testing.assert_allclose(np.max(loads, axis=1), 1.0, rtol=1e-12)


def test_steps_that_the_structure_cannot_make_are_refused(tmp_path):
    """Pushed down at x_l = 0.8 it snaps at F = 0.0517."""
    (tmp_path / "spring.toml").write_text(SPRING + SAMPLED.replace("F = -0.01", "F = 0.1"))
    with pytest.raises(InputError, match=r"start\.steps` must be steps .* got a fold in step 1"):
        run_study(tmp_path / "spring.toml", tmp_path / "out")
