"""Questions of a study on what a state leads to, and how sure it is: against closed forms.

Of the spring: F = (1 − x_l/cos δ) sin δ, folds at x_l = cos³δ, F = sin³δ (PHYSICS section 2).
"""

import json
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import brentq

import equimorph as em
from equimorph.errors import InputError
from equimorph.storage import read_results, read_schedule
from equimorph.study import Outcome, html, parse_study, prepare, run_study
from studies import SPRING_SET, answered, answered_again, page

UPPER = '{ at = { x_l = 0.8, F = 0.0 }, highest = "angle" }'
QUESTIONS = f"""\
[[reach]]
name = "from-here"
start = {UPPER}
descriptors = ["angle", "F"]
targets = [[0.8, 0.02], [1.3, 0.01]]

[[reach]]
name = "whole"
start = {UPPER}
descriptors = ["angle"]
kind = "attainable"

[[verify]]
name = "by-hand"
start = {UPPER}
steps = [{{ x_l = 0.75 }}, {{ F = -0.05 }}]
proof = true

[[verify]]
name = "too-far"
start = {UPPER}
steps = [{{ F = 0.1 }}]

[[verify]]
name = "from-file"
schedule = "ways/up.csv"
margin = 0.01

[[sensitivity]]
name = "here"
state = {UPPER}
descriptors = ["angle", "effort(x_l)"]
parameters = ["x_l", "F"]

[[imperfection]]
name = "longer"
state = {UPPER}
load = "F"
imperfections = ["x_l"]

[[room]]
name = "around"
state = {UPPER}
tolerances = {{ x_l = 0.1, F = 0.02 }}

[[snap]]
name = "nearest"
state = {UPPER}

[[trials]]
name = "shaky"
start = {UPPER}
steps = [{{ F = 0.04 }}]
spreads = {{ F = 0.01 }}
trials = 100

[[trials]]
name = "shaky-file"
schedule = "ways/up.csv"
spreads = {{ x_l = 0.01, F = 0.01 }}
trials = 20

[[optimum]]
name = "robust"
objective = "worst(angle for F ± 0.01)"
within = ["F <= 0.05", "x_l <= 0.7", "angle >= 0.1"]

[[route]]
name = "cheap"
start = {{ at = {{ x_l = 0.8, F = 0.01 }}, highest = "angle" }}
goal = {{ at = {{ x_l = 0.6, F = -0.05 }}, highest = "angle" }}
objective = "work"

[[track]]
name = "beyond"
start = {{ at = {{ x_l = 0.8, F = 0.02 }}, highest = "angle" }}
targets = [{{ angle = 0.5 }}, {{ angle = 0.1 }}]
actuators = ["x_l"]
beyond = true
"""
LIMIT = (1.0 - 0.8 ** (2 / 3)) ** 1.5


def write_study(folder: Path) -> Path:
    """The study, with the schedule that it names beside it."""
    spring = em.Spring()
    upper = spring.natural_state(x_l=0.8)
    assert upper.z[0] > 0.5
    (folder / "ways").mkdir()
    schedule = em.verify([{"F": -0.03}, {"x_l": 0.9}], upper).schedule
    em.storage.write_schedule(schedule, folder / "ways" / "up.csv")
    (folder / "spring.toml").write_text(SPRING_SET + QUESTIONS)
    return folder / "spring.toml"


@pytest.fixture(scope="module")
def run(tmp_path_factory) -> tuple[Outcome, Path]:
    folder = tmp_path_factory.mktemp("sureness")
    return answered(folder, write_study(folder).read_text())


def test_every_answer_is_in_the_results(run):
    stored = read_results(run[1] / "results.h5")
    assert {each.question.kind.table for each in run[0].answers} == {*stored.answers, "route"}
    limit = stored.answers["imperfection"]["longer"]["x_l"].perfect
    assert limit == run[0].of("imperfection")["longer"]["x_l"].perfect


def test_a_reachable_set_has_its_boundary_by_kinds_and_answers_queries(run):
    """det J_S = −tan δ vanishes at δ = 0; at δ = 1.3, F = 0.01 the end would be at x_l = 0.265."""
    reach, (near, far) = run[0].of("reach")["from-here"]
    kinds = {piece.kind for piece in reach.boundary}
    assert kinds == {"snap-through", "singular Jacobian", "actuator limit"}
    assert near.can
    np.testing.assert_allclose(
        near.schedule.values[-1, 0], np.cos(0.8) * (1.0 - 0.02 / np.sin(0.8)), rtol=1e-9
    )
    assert not far.can
    assert "actuator limit" in far.why or "x_l" in far.why
    rows = (run[1] / "from-here-reach.csv").read_text().splitlines()
    assert rows[0] == "piece,kind,detail,x_l (natural length),F (k),angle (rad)"
    assert len(rows) == 1 + sum(len(piece.states) for piece in reach.boundary)
    assert (run[1] / "from-here-reach-parameters.png").exists()


def test_an_attainable_set_is_not_cut_where_parameters_do_not_steer(run):
    """Through x_l > 1 the mirror image can be reached."""
    reach, _ = run[0].of("reach")["whole"]
    assert reach.home.values.min() < -0.5
    assert reach.home.values.max() > 0.5


def test_steps_are_verified_and_proved(run):
    found = run[0].of("verify")["by-hand"]
    assert found.verified
    assert found.proof.status == "proved"
    assert "<strong>Proved</strong>" in page(run[1])
    certificate = json.loads((run[1] / "by-hand-verify-certificate.json").read_text())
    assert certificate["margin"] == found.proof.margin
    schedule = read_schedule(run[1] / "by-hand-verify-schedule.csv")
    np.testing.assert_array_equal(schedule.values[-1], found.states.p[-1])


def test_steps_that_snap_are_refused_with_the_place(run):
    found = run[0].of("verify")["too-far"]
    assert not found.verified
    np.testing.assert_allclose(found.states["F"][-1], LIMIT, rtol=1e-9)
    assert "meets a fold" in page(run[1])
    assert (run[1] / "too-far-verify-plane.png").exists()


def test_a_schedule_from_a_file_is_verified(run):
    found = run[0].of("verify")["from-file"]
    assert found.verified
    np.testing.assert_allclose(found.states.p[-1][:2], [0.9, -0.03], rtol=1e-12)


def test_derivatives_at_a_state(run):
    """dδ/dF = 1/(cos δ − x_l/cos²δ) = −1/0.45 at cos δ = 0.8."""
    found = run[0].of("sensitivity")["here"]
    np.testing.assert_allclose(found["angle", "F"], -1.0 / 0.45, rtol=1e-8)


def test_the_limit_load_falls_smoothly_with_the_length(run):
    """F_lim = (1 − x_l^⅔)^(3/2). Tolerance: the polynomial through four sizes."""
    law = run[0].of("imperfection")["longer"]["x_l"]
    slope = -np.sqrt(1.0 - 0.8 ** (2 / 3)) * 0.8 ** (-1 / 3)
    np.testing.assert_allclose(law.perfect, LIMIT, rtol=1e-9)
    np.testing.assert_allclose(law.coefficient, slope, rtol=1e-4)
    assert law.law == "smooth"


def test_the_room_ends_where_a_corner_meets_the_folds(run):
    """The corner at x_l = 0.8 + 0.1 s, F = 0.02 s lies on x_l^⅔ + F^⅔ = 1."""
    room = run[0].of("room")["around"]
    scale = brentq(lambda s: (0.8 + 0.1 * s) ** (2 / 3) + (0.02 * s) ** (2 / 3) - 1.0, 0.1, 3.0)
    np.testing.assert_allclose(room.least, scale, rtol=1e-3)
    np.testing.assert_allclose(room.boxes[0].upper, [0.8 + 0.1 * scale, 0.02 * scale], rtol=1e-3)


def test_the_least_snap_ends_on_the_folds(run):
    snap = run[0].of("snap")["nearest"]
    fold = snap.distance.nearest
    np.testing.assert_allclose(fold["x_l"] ** (2 / 3) + fold["F"] ** (2 / 3), 1.0, rtol=1e-9)
    np.testing.assert_allclose(snap.change["F"], fold["F"], rtol=1e-12)  # the state has F = 0
    assert snap.landing.landed
    assert "edge of stability" in page(run[1])


def test_trials_arrive_below_the_limit_load(run):
    trials = run[0].of("trials")["shaky"]
    np.testing.assert_array_equal(trials.arrived, trials.offsets[:, 0] < LIMIT - 0.04)
    assert f"{int(trials.arrived.sum())} of 100 arrived" in page(run[1])


def test_a_robust_optimum_is_that_of_the_worst_load(run):
    """δ grows with x_l and falls with F: at x_l = 0.7, F = 0.05 the worst is δ(F = 0.04)."""
    best = run[0].of("optimum")["robust"].best
    np.testing.assert_allclose([best.state["x_l"], best.state["F"]], [0.7, 0.05], rtol=1e-7)
    worst = brentq(lambda d: (1.0 - 0.7 / np.cos(d)) * np.sin(d) - 0.04, 0.6, 0.9)
    np.testing.assert_allclose(best.value, worst, rtol=1e-7)
    assert "worst(angle for F ± 0.01)" in page(run[1])


def test_a_route_is_planned_for_what_is_asked(run):
    """The cost is read back from the folder."""
    route = run[0].of("route")["cheap"][0]
    assert route.objective == "work"
    spent = em.Objective(((1.0, "work"),)).along(route.path.states)
    np.testing.assert_allclose(route.cost, spent, rtol=1e-12)
    assert f", work {html.number(route.cost)}" in page(run[1])


def test_a_motion_beyond_reach_is_followed_by_the_best_compromise(run):
    """The nearest states are at the smallest angle that is stable: sin³δ = 0.02."""
    motion = run[0].of("track")["beyond"]
    assert motion.failure == "snap-through"
    last = motion.compromise.states[-1]
    np.testing.assert_allclose(last.z[0], np.arcsin(0.02 ** (1 / 3)), rtol=1e-6)
    assert "nearest to the targets" in page(run[1])


def test_every_kind_has_its_figure(run):
    for name in (
        *("from-here-reach", "by-hand-verify-shapes", "here-sensitivity", "longer-imperfection"),
        *("around-room", "nearest-snap", "shaky-trials", "shaky-file-trials", "robust-optimum"),
    ):
        assert (run[1] / f"{name}.png").exists(), name


def test_answers_come_from_the_folder_until_the_schedule_changes(run, tmp_path):
    study = write_study(tmp_path)
    answered_again(study, run[1])
    schedule = read_schedule(tmp_path / "ways" / "up.csv")
    schedule.values[-1, 1] += 1e-3
    em.storage.write_schedule(schedule, tmp_path / "ways" / "up.csv")
    with pytest.raises(InputError, match="results of another study"):
        run_study(study, run[1])


WRONG = {
    "a route for nothing": (
        "route",
        f'start = {UPPER}\ngoal = {UPPER}\nobjective = "speed"',
        r"`route\[0\]\.objective` must be one of length, travel, work, clearance, time",
    ),
    "no way": ("verify", "", r"`verify\[0\]` must give a schedule, or a start with its steps"),
    "two ways": (
        "verify",
        f'schedule = "up.csv"\nstart = {UPPER}',
        r"`verify\[0\]\.schedule` must be the table of a schedule that can be read",
    ),
    "no schedule there": ("verify", 'schedule = "none.csv"', r"that can be read: .*none\.csv"),
    "no table": ("trials", 'schedule = "a.txt"\nspreads = { F = 1 }', r"must end in \.csv"),
    "a schedule of two": ("verify", "schedule = 3", r"must be the name of a schedule's \.csv file"),
    "a step that is no parameter": (
        "verify",
        f"start = {UPPER}\nsteps = [{{ G = 1 }}]",
        r"in `verify\[0\]\.steps\[0\]`.*G",
    ),
    "spreads of none": (
        "trials",
        f"start = {UPPER}\nsteps = [{{ F = 0.1 }}]\nspreads = {{ G = 0.1 }}",
        r"in `trials\[0\]\.spreads`.*G",
    ),
    "a target too short": (
        "reach",
        f'start = {UPPER}\ndescriptors = ["angle", "F"]\ntargets = [[0.1]]',
        r"`reach\[0\]` must give each target one value for each of its descriptors",
    ),
    "an accuracy for nothing": (
        "reach",
        f'start = {UPPER}\ndescriptors = ["angle"]\nkind = "attainable"\naccuracy = 0.1',
        "give an accuracy to reachable sets only",
    ),
    "a descriptor unknown": (
        "reach",
        f'start = {UPPER}\ndescriptors = ["angel"]',
        r"in `reach\[0\]\.descriptors\[0\]`.*Did you mean angle",
    ),
    "a sensitivity to nothing": (
        "sensitivity",
        f'state = {UPPER}\ndescriptors = ["angle"]\nparameters = ["y"]',
        r"in `sensitivity\[0\]\.parameters`.*y",
    ),
    "an imperfect load": (
        "imperfection",
        f'state = {UPPER}\nload = "F"\nimperfections = ["F"]',
        r"`imperfection\[0\]\.imperfections` must not name the load; got F",
    ),
    "a room of no size": (
        "room",
        f"state = {UPPER}\ntolerances = {{ F = 0.0 }}",
        r"`room\[0\]\.tolerances\.F` must be greater than 0",
    ),
    "a room elsewhere": (
        "room",
        "state = { at = { x_l = 3, F = 0 } }\ntolerances = { F = 1.0 }",
        r"`room\[0\]\.state\.at\.x_l` must lie in the box",
    ),
    "a snap of nothing": ("snap", "", r"`snap\[0\]\.state` must be given"),
    "a key that there is not": (
        "snap",
        f"state = {UPPER}\nway = 1",
        r"`snap\[0\]\.way` must be a key of `snap\[0\]` \(name, state\)",
    ),
    "a schedule's key": (
        "verify",
        f"start = {UPPER}\nsteps = [{{ F = 0.1 }}]\nproofs = true",
        r"`verify\[0\]\.proofs` must be a key of .*Did you mean proof",
    ),
}


@pytest.mark.parametrize(("table", "wrong", "message"), WRONG.values(), ids=WRONG)
def test_questions_that_mean_nothing(table, wrong, message, tmp_path):
    with pytest.raises(InputError, match=message):
        prepare(
            parse_study(f'{SPRING_SET}[[{table}]]\nname = "x"\n{wrong}', "spring.toml", tmp_path)
        )


@pytest.mark.parametrize("text", ["worst(angle for F)", "worst(angle for F ± -1)", "worst(angle)"])
def test_worst_cases_that_mean_nothing(text):
    wrong = f'[[optimum]]\nname = "x"\nobjective = "{text}"'
    with pytest.raises(InputError, match=r"in `optimum\[0\]\.objective`"):
        prepare(parse_study(SPRING_SET + wrong, "spring.toml"))
