"""Questions to a set in a study file: shapes, optima, estimates; sets over one parameter."""

import re
from pathlib import Path

import numpy as np
import pytest

from equimorph.errors import InputError
from equimorph.storage import read_schedule
from equimorph.study import Outcome, parse_study, prepare, run_study
from studies import SPRING_SET, answered, answered_again, page
from typecheck import unchecked

QUESTIONS = """\
[[shape]]
name = "flat"
targets = { angle = 0.4, F = 0.01 }
start = { at = { x_l = 0.8, F = 0.0 }, highest = "angle" }

[[shape]]
name = "never"
targets = { angle = 1.3, F = 0.01 }

[[optimum]]
name = "flattest"
objective = "angle"
start = { at = { x_l = 0.8, F = 0.02 }, highest = "angle" }
within = ["F >= 0.02", "F <= 0.1", "angle >= 0.1"]

[[track]]
name = "there-and-back"
start = { at = { x_l = 0.8, F = 0.02 }, highest = "angle" }
targets = [{ angle = 0.8 }, { angle = 0.5, F = 0.03 }, { angle = 0.8, F = 0.02 }]
actuators = ["x_l"]

[[track]]
name = "too-far"
start = { at = { x_l = 0.8, F = 0.02 }, highest = "angle" }
targets = [{ angle = 0.5 }, { angle = 0.1 }]
actuators = ["x_l"]

[[estimate]]
name = "seen"
measured = { angle = 0.62, x_l = 0.8 }
errors = { angle = 0.01, x_l = 0.002 }
"""


@pytest.fixture(scope="module")
def run(tmp_path_factory) -> tuple[Outcome, Path]:
    return answered(tmp_path_factory.mktemp("questions"), SPRING_SET + QUESTIONS, dots=False)


def test_a_shape_is_found_with_the_way_to_it(run):
    """F = k (1 − x_l/cos δ) sin δ, PHYSICS section 2."""
    found = run[0].of("shape")["flat"]
    wanted = np.cos(0.4) * (1.0 - 0.01 / np.sin(0.4))
    np.testing.assert_allclose(found.states["x_l"], [wanted], rtol=1e-10)
    assert found.routes[0].arrived


def test_a_shape_that_is_not_on_the_set_is_refused(run):
    assert run[0].of("shape")["never"].status == "refused"


def test_an_optimum_sits_on_the_stability_boundary(run):
    """x_l = cos³δ with F = k sin³δ: the flattest under F ≥ 0.02 has sin δ = F^(1/3)."""
    best = run[0].of("optimum")["flattest"].best
    assert best.certificate.kind == "stability boundary"
    np.testing.assert_allclose(best.value, np.arcsin(0.02 ** (1.0 / 3.0)), rtol=1e-7)
    schedule = read_schedule(run[1] / "flattest-optimum-schedule.csv")
    np.testing.assert_array_equal(schedule.values, best.route.schedule.values)


def test_an_estimate_tells_the_load(run):
    estimate = run[0].of("estimate")["seen"]
    assert estimate.known
    wanted = (1.0 - 0.8 / np.cos(0.62)) * np.sin(0.62)
    np.testing.assert_allclose(estimate.state["F"], wanted, rtol=1e-9)


def test_a_motion_is_followed_with_its_schedule(run):
    """x_l = (1 − F/sin δ) cos δ at its end."""
    motion = run[0].of("track")["there-and-back"]
    assert motion.arrived
    schedule = read_schedule(run[1] / "there-and-back-track-schedule.csv")
    wanted = (1.0 - 0.02 / np.sin(0.8)) * np.cos(0.8)
    np.testing.assert_allclose(schedule.values[-1, 0], wanted, rtol=1e-9)
    assert (run[1] / "there-and-back-track-film.gif").exists()


def test_a_motion_that_meets_instability_is_refused_with_the_place(run):
    """At x_l = cos³δ, F = sin³δ: half-way through the second leg, where δ = 0.2749."""
    motion = run[0].of("track")["too-far"]
    assert motion.failure == "snap-through"
    np.testing.assert_allclose(motion.values["angle"][-1], np.arcsin(0.02 ** (1 / 3)), rtol=1e-6)
    assert "After 1.5" in page(run[1])


def test_the_page_tells_every_answer(run):
    told = page(run[1])
    for words in ("Shape flat", "Shape never", "Refused.", "Optimum flattest", "Estimate seen"):
        assert words in told
    assert "stability boundary" in told
    for name in ("flat-shape", "flattest-optimum", "seen-estimate"):
        assert (run[1] / f"{name}.svg").exists()


def test_the_answers_come_from_the_folder_when_asked_again(run):
    again = answered_again(run[1].parent / "spring.toml", run[1])
    before, after = (each.of("optimum")["flattest"].best.state for each in (run[0], again))
    np.testing.assert_array_equal(after.z, before.z)


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ('objective = "curl"', r"in `optimum\[0\]\.objective`.*curl"),
        ('objective = "effort(y)"', r"in `optimum\[0\]\.objective`.*must be a parameter"),
        ('objective = "angle"\nsense = "least"', r"`optimum\[0\]\.sense` must be 'min' or 'max'"),
        (
            'objective = "angle"\nstart = { at = { x_l = 2, F = 0 } }',
            r"`optimum\[0\]\.start\.at\.x_l` must lie in the box",
        ),
    ],
)
def test_an_optimum_that_means_nothing(wrong, message):
    with pytest.raises(InputError, match=message):
        prepare(parse_study(f'{SPRING_SET}[[optimum]]\nname = "best"\n{wrong}', "spring.toml"))


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ('targets = [{ angle = 0.5 }]\nactuators = ["k"]', r"free parameters .*got k"),
        ('targets = [{ curl = 0.5 }]\nactuators = ["x_l"]', r"in `track\[0\]\.targets\[0\]`"),
        ('targets = []\nactuators = ["x_l"]', r"`track\[0\]\.targets` must have at least 1"),
    ],
)
def test_a_motion_that_means_nothing(wrong, message):
    start = 'start = { at = { x_l = 0.8, F = 0.02 }, highest = "angle" }'
    with pytest.raises(InputError, match=message):
        prepare(parse_study(f'{SPRING_SET}[[track]]\nname = "go"\n{start}\n{wrong}', "spring.toml"))


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ("measured = { angle = 0.6 }\nerrors = { x_l = 0.1 }", "standard error of each value"),
        ("measured = { angle = 0.6 }\nerrors = { angle = 0.0 }", "greater than 0"),
        ("measured = { angle = 0.6 }\nerrors = { angle = 0.1 }", "at least"),
    ],
)
def test_an_estimate_that_means_nothing(wrong, message, tmp_path):
    study = tmp_path / "spring.toml"
    study.write_text(f'{SPRING_SET}[[estimate]]\nname = "seen"\n{wrong}')
    with pytest.raises(InputError, match=message):
        run_study(study, tmp_path / "out")


def test_a_question_needs_a_set():
    text = '[structure]\nkind = "spring"\n[[shape]]\nname = "flat"\ntargets = { angle = 0.4 }'
    with pytest.raises(InputError, match=r"have a \[set\] to which its equilibria and questions"):
        parse_study(text, "spring.toml")


def test_a_set_over_one_parameter_gets_its_diagram(tmp_path):
    text = re.sub("box = .*", "box = { F = [-0.1, 0.1] }\nfixed = { x_l = 0.8 }", SPRING_SET)
    text = text.replace("[9, 9]", "[9]")
    text += '[[route]]\nname = "a"\nstart = { at = { F = 0.0 }, highest = "angle" }\n'
    text += 'goal = { at = { F = -0.05 }, highest = "angle" }\n'
    (tmp_path / "spring.toml").write_text(text)
    with unchecked():
        outcome = run_study(tmp_path / "spring.toml", tmp_path / "out")
    assert outcome.equilibrium_set.audit.clean
    assert outcome.of("route")["a"][0].arrived
    names = {file.name for file in (tmp_path / "out").iterdir()}
    assert {"diagram.png", "diagram.svg", "a-shapes.png", "a-margins.png"} <= names
    assert not {"surface.png", "a-plane.png"} & names


def test_intervals_that_do_not_fit_the_box():
    with pytest.raises(InputError, match="one number of intervals for each parameter"):
        parse_study(SPRING_SET.replace("[9, 9]", "[9]"), "spring.toml")


def test_a_box_over_four_parameters_is_refused():
    box = "box = { a = [0, 1], b = [0, 1], c = [0, 1], d = [0, 1] }"
    with pytest.raises(InputError, match="span one, two or three free parameters"):
        parse_study(re.sub("box = .*", box, SPRING_SET), "spring.toml")
