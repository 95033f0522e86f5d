"""``[[chart]]``, ``[[reduction]]`` and ``[[robust_optimum]]`` of a study: against closed forms.

Of the spring: F = (1 − x_l/cos δ) sin δ, folds at x_l = cos³δ, F = sin³δ (PHYSICS section 2).
"""

from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import brentq

from equimorph.errors import InputError
from equimorph.storage import read_results
from equimorph.study import Outcome, parse_study, prepare
from studies import SPRING_SET, answered, page
from typecheck import unchecked

SET = (
    SPRING_SET.rstrip()
    + """
seed = 3
checks = 1
accuracy = 0.05
tiles = [3, 2]

"""
)
QUESTIONS = """\
[[chart]]
name = "plane"

[[chart]]
name = "heights"
kind = "descriptors"
coordinates = ["angle", "x_l"]

[[chart]]
name = "atlas"
kind = "atlas"

[[reduction]]
name = "least"
prefer = { lowest = "energy" }

[[robust_optimum]]
name = "sure"
objective = "angle"
offsets = { F = 0.01 }
within = ["F <= 0.05", "x_l <= 0.7", "angle >= 0.1"]
"""
LOADED = """[[reduction]]
name = "loaded"
prefer = { first_stable_on_path = "F", bound = 2.0 }
"""


@pytest.fixture(scope="module")
def run(tmp_path_factory) -> tuple[Outcome, Path]:
    return answered(tmp_path_factory.mktemp("charts"), SET + QUESTIONS)


def test_every_option_of_a_set_can_be_asked_for(run):
    """The accuracy is kept: no segment is farther from the set than asked for."""
    audit = run[0].equilibrium_set.audit
    assert audit.accuracy == 0.05
    assert audit.deviation <= 0.05
    options = {"seed": 3, "checks": 1, "accuracy": 0.05, "limit": None, "tiles": [3, 2]}
    assert run[0].problem.extents["set"].options == options


def test_the_plane_is_no_coordinates_of_the_stable_states_but_angle_and_length_are(run):
    """Two stable states lie over points inside the cusp; F is a function of δ and x_l."""
    charts = run[0].of("chart")
    assert not charts["plane"].single_valued
    assert charts["heights"].single_valued
    assert (charts["plane"].eset.cell_index == 0).all()
    assert "several states lie over some points" in page(run[1])
    assert "(angle, x_l) are coordinates" in page(run[1])
    found = charts["heights"].state(np.array([[0.6, 0.8]])).states
    np.testing.assert_allclose(found["F"], (1.0 - 0.8 / np.cos(0.6)) * np.sin(0.6), rtol=1e-9)


def test_an_atlas_covers_the_stable_states(run):
    atlas = run[0].of("chart")["atlas"]
    assert len(atlas) >= 2
    assert f"{len(atlas)} charts over x_l, F" in page(run[1])


def test_the_state_of_least_energy_changes_at_zero_force(run):
    """Two mirror images have the same energy there."""
    found = run[0].of("reduction")["least"]
    assert found.barriers
    for barrier in found.barriers:
        np.testing.assert_allclose(barrier.points[:, 1], 0.0, atol=1e-9)
    assert "barriers" in page(run[1])


def test_a_robust_optimum_is_best_in_the_worst_case_and_has_its_price(run):
    """δ grows with x_l and falls with F: at x_l = 0.7, F = 0.05 the worst is δ(F = 0.04)."""
    found = run[0].of("robust_optimum")["sure"]
    worst = brentq(lambda d: (1.0 - 0.7 / np.cos(d)) * np.sin(d) - 0.04, 0.6, 0.9)
    np.testing.assert_allclose(found.guaranteed, worst, rtol=1e-7)
    np.testing.assert_allclose([found.state["x_l"], found.state["F"]], [0.7, 0.05], rtol=1e-6)
    assert "its price is" in page(run[1])


def test_a_rule_keeps_its_bound():
    (question,) = prepare(parse_study(SET + LOADED, "spring.toml")).questions
    assert question["prefer"].identity == {
        "rule": "first_stable_on_path", "parameter": "F", "bound": 2.0
    }  # fmt: skip


def test_charts_and_reductions_are_in_the_results(run):
    with unchecked():
        stored = read_results(run[1] / "results.h5")
    assert stored.unreadable == {}
    assert set(stored.answers) == {"chart", "reduction", "robust_optimum"}
    assert set(stored.answers["chart"]) == {"plane", "heights", "atlas"}
    assert repr(stored.answers["chart"]["atlas"]) == repr(run[0].of("chart")["atlas"])
    least = stored.answers["reduction"]["least"]
    assert least.rule.identity == run[0].of("reduction")["least"].rule.identity
    assert stored.answers["robust_optimum"]["sure"].price == pytest.approx(
        run[0].of("robust_optimum")["sure"].price, rel=0, abs=0
    )


def test_each_has_its_figure(run):
    names = ("plane-chart", "heights-chart", "atlas-chart", "least-reduction")
    for name in (*names, "sure-robust_optimum"):
        assert (run[1] / f"{name}.png").exists(), name


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ('[[chart]]\nname = "a"\nkind = "disc"', r"`chart\[0\]\.kind` must be 'projection', 'desc"),
        ('[[chart]]\nname = "a"\nkind = "descriptors"', "must give coordinates to a chart"),
        ('[[chart]]\nname = "a"\ncoordinates = ["angle"]', "must give coordinates to a chart"),
        (
            '[[chart]]\nname = "a"\nkind = "descriptors"\ncoordinates = ["angel", "F"]',
            r"in `chart\[0\]\.coordinates\[0\]`.*Did you mean angle",
        ),
        ('[[reduction]]\nname = "a"', r"`reduction\[0\]\.prefer` must be given; got nothing"),
        ('[[reduction]]\nname = "a"\nprefer = {}', "must give one of highest, lowest, quasi_st"),
        (
            '[[reduction]]\nname = "a"\nprefer = { lowest = "energy", bound = 1.0 }',
            "must give a bound of the load to first_stable_on_path only",
        ),
        (
            '[[reduction]]\nname = "a"\nprefer = { quasi_static = "G" }',
            r"in `reduction\[0\]\.prefer\.quasi_static`.*G",
        ),
        (
            '[[reduction]]\nname = "a"\nprefer = { low = "energy" }',
            r"`reduction\[0\]\.prefer\.low` must be a key of `reduction\[0\]\.prefer`.*lowest\?",
        ),
        (
            '[[robust_optimum]]\nname = "a"\nobjective = "angle"\noffsets = { G = 0.1 }',
            r"in `robust_optimum\[0\]\.offsets`.*G",
        ),
        (
            '[[robust_optimum]]\nname = "a"\nobjective = "angle"\noffsets = {}',
            r"`robust_optimum\[0\]\.offsets` must have at least 1 entries",
        ),
    ],
)
def test_a_question_that_means_nothing(wrong, message):
    with pytest.raises(InputError, match=message):
        prepare(parse_study(SET + wrong, "spring.toml"))


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("0.05", "-1", r"`set\.accuracy` must be greater than 0; got -1"),
        ("checks = 1", "checks = -1", r"`set\.checks` must be at least 0; got -1"),
        ("checks = 1", "checks = 1.5", r"`set\.checks` must be a whole number; got 1\.5"),
        ("seed = 3", "sead = 3", r"`set\.sead` must be a key of .*Did you mean seed\?"),
    ],
)
def test_an_option_of_the_set_that_means_nothing(old, new, message):
    with pytest.raises(InputError, match=message):
        parse_study(SET.replace(old, new), "spring.toml")
