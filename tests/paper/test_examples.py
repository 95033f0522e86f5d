"""The article computed anew: key numbers against PHYSICS section 5 and closed forms."""

import inspect

import numpy as np
import pytest

import equimorph as em
from equimorph.paper import arch_maps, reproduction
from equimorph.paper.examples import EXAMPLES, Example
from equimorph.paper.reproduction import QUOTED, TABLES, in_words
from typecheck import unchecked

COARSE = em.Grid(Theta=(0.3, 1.5, 11), Delta=(-1.4, 1.4, 14))

MAINS = {each.name: each.main for each in EXAMPLES}

LIGHT = 1_000_000
"""Bytes."""


@pytest.fixture
def numbers_of(monkeypatch, tmp_path):
    """Key numbers of an example; its figures are drawn, but not written."""
    monkeypatch.setattr(em.plotting, "save", lambda *drawing: None)

    def compute(name, **how):
        with unchecked():
            return MAINS[name](tmp_path, **how)

    return compute


def test_spring(numbers_of):
    """PHYSICS section 2: F = (1 − x_l/cos δ) sin δ, E'' = x_l (x_l − cos³ δ)/cos⁴ δ."""
    found = numbers_of("spring", accuracy=0.02)
    for delta, x_l, name in ((0.62, 0.8, "C_s"), (0.4, 0.9, "(0.40, 0.90)"),
                             (0.3, 0.925, "(0.30, 0.925)")):  # fmt: skip
        load = (1 - x_l / np.cos(delta)) * np.sin(delta)
        np.testing.assert_allclose(found[f"load of {name}"], load, rtol=1e-10)
    stiffness = 0.925 * (0.925 - np.cos(0.3) ** 3) / np.cos(0.3) ** 4
    np.testing.assert_allclose(found["margin of (0.30, 0.925)"], stiffness, rtol=1e-8)
    np.testing.assert_allclose(found["x_l of the cusp"], 1.0, rtol=1e-8)
    assert found["free parameters of the set"] == 2.0
    assert found["a route to C_t1 at fixed load"] == 1.0
    np.testing.assert_allclose(found["load of C_s"], 0.009908, atol=5e-7)
    np.testing.assert_allclose(found["load of (0.40, 0.90)"], 0.008904, atol=5e-7)
    np.testing.assert_allclose(found["x_l of delta = 0.40 at the load of C_s"], 0.89763, atol=5e-6)
    sine = np.cbrt(found["load of C_s"])
    np.testing.assert_allclose(found["delta of C_t2"], np.arcsin(sine), rtol=1e-7)
    np.testing.assert_allclose(found["x_l of C_t2"], np.cos(np.arcsin(sine)) ** 3, rtol=1e-7)
    np.testing.assert_allclose(found["x_l of C_t3 at the load of C_s"], 0.82776, atol=5e-6)
    assert found["a route to C_t3 at fixed load"] == 0.0
    assert found["a route to C_t3 with the load free"] == 1.0
    assert found["largest x_l on that route"] > 1.0


def test_limit_loads(numbers_of):
    """PHYSICS section 5; Q_a's optimum within a few per cent of the article's 4.0."""
    found = numbers_of("limit_loads", grid=COARSE)
    np.testing.assert_allclose(found["uniform: limit load at (0.9, 0)"], 4.2439977594, rtol=1e-10)
    np.testing.assert_allclose(found["left-half: limit load at (0.9, 0)"], 2.3638940346, rtol=1e-10)
    np.testing.assert_allclose(found["uniform: limit load at (0.9, 0.02)"], 3.9485039281, rtol=1e-9)
    np.testing.assert_allclose(found["uniform: lambda there"], 1.9075023017, rtol=1e-8)
    np.testing.assert_allclose(found["uniform: largest limit load"], 4.264995, rtol=1e-6)
    np.testing.assert_allclose(found["left-half: largest limit load"], 4.0, rtol=0.05)
    for load in ("uniform", "left-half"):
        ends = [v for k, v in found.items() if k.startswith(f"{load}: settings that end by")]
        assert sum(ends) == 12 * 15
    np.testing.assert_allclose(found["left-half: its Theta"], 0.94, atol=0.02)
    np.testing.assert_allclose(found["left-half: its Delta"], 0.60, atol=0.02)


@pytest.mark.slow
def test_curvatures(numbers_of):
    """PHYSICS section 5: 2.132 and 14.17 at (0.96, 0); the optimum of Q_a near (0.65, 0.52)."""
    found = numbers_of("curvatures", grid=COARSE)
    np.testing.assert_allclose(found["uniform: max |kappa| at (0.96, 0)"], 2.132, atol=1e-3)
    key = "left-half: max |kappa| at (0.96, 0)"
    np.testing.assert_allclose(found[key], 14.17, atol=0.01)
    assert found["left-half: snaps on the way to (0.96, 0)"] == 1.0
    assert found["uniform: snaps on the way to (0.96, 0)"] == 0.0
    np.testing.assert_allclose(
        found["uniform: max |kappa| at (0.64, 1.16)"],
        found["uniform: max |kappa| at (0.64, -1.16)"],
        rtol=1e-9,
    )
    for load in ("uniform", "left-half"):
        product = found[f"{load}: factor"] * found[f"{load}: least max |kappa|"]
        there = found[f"{load}: max |kappa| there under the other load"]
        np.testing.assert_allclose(product, there, rtol=1e-12)
        assert found[f"{load}: factor"] > 3.0  # "more than a 3-fold increase"
    np.testing.assert_allclose(found["left-half: least max |kappa|"], 3.02, atol=0.01)
    np.testing.assert_allclose(found["left-half: its Theta"], 0.65, atol=0.005)
    np.testing.assert_allclose(found["left-half: its Delta"], 0.52, atol=0.005)


def test_inside_out(numbers_of):
    """PHYSICS sections 4.9 and 5."""
    found = numbers_of("inside_out", intervals=(24, 41))
    assert found["equilibria at (1, 0)"] == 5.0
    np.testing.assert_allclose(found["crown of the upright arch"], 0.2258, atol=5e-5)
    np.testing.assert_allclose(found["crown of the inverted arch"], -0.1496, atol=5e-5)
    np.testing.assert_allclose(found["smallest margin of the route"], 0.462, atol=5e-4)
    np.testing.assert_allclose(found["largest max |kappa| of the route"], 16.4, atol=0.06)
    np.testing.assert_allclose(found["max |kappa| of the goal"], 10.55, atol=5e-3)
    assert found["a route along the way-points"] == 1.0
    assert found["a route within max |kappa| <= 6"] == 0.0
    assert found["thrust lambda of the inverted arch"] > 0.0  # the supports push
    assert found["stable equilibria at (1, 0)"] == 2.0
    assert found["stable equilibria at (1.3, 1.3)"] == 1.0


def test_tracking(numbers_of):
    """PHYSICS section 5: Θ = 1.621098, Δ = 0; the square is stable all around and closes."""
    found = numbers_of("tracking", intervals=(18, 31))
    np.testing.assert_allclose(found["Theta at (0.15, 0.15)"], 1.621098, atol=5e-7)
    np.testing.assert_allclose(found["Delta at (0.15, 0.15)"], 0.0, atol=1e-9)
    assert found["square tracked"] == 1.0
    assert found["largest change of an actuator around it"] < 1e-9
    assert found["stable states at (0.15, 0.15)"] == 1.0
    assert found["most stable states at a corner"] == 2.0
    assert found["kinds of boundary of the reachable set"] == 3.0
    assert found["sides of the box on its boundary"] == 4.0


def test_introduction(numbers_of):
    """The article's statements: two stable states, and a stable way to the target."""
    found = numbers_of("introduction")
    assert found["margin of the upper state"] > 0.0
    assert found["margin of the lower state"] > 0.0
    assert found["crown of the upper state"] > 0.0 > found["crown of the lower state"]
    assert found["stable states under the force"] == 2.0
    assert found["target reached"] == 1.0
    assert found["smallest margin on the way"] > 0.0
    np.testing.assert_allclose(found["height at 1/3 adapted"], 0.23, rtol=1e-9)
    np.testing.assert_allclose(found["height at 2/3 adapted"], 0.10, rtol=1e-9)


def test_space_route(numbers_of):
    """Round −0.342, A = 2 +0.173, strips .355, .467 to the digits; between 65 stations less.

    At the stations .572 and .604 for the wider strips: `tests/validation/test_rods_in_space.py`.
    """
    found = numbers_of("space_route", widths=6)
    names = ("round", "A = 2, C = 0.9", "2 : 1", "3.16 : 1")
    own = [found[f"{name}: smallest on the way"] for name in names]
    np.testing.assert_allclose(own, [-0.342, 0.173, 0.355, 0.467], atol=6e-4)
    wide = [found[f"{name}: smallest on the way"] for name in ("10 : 1", "40 : 1")]
    assert 0.567 < wide[0] < 0.572
    assert 0.597 < wide[1] < 0.604
    assert found["round: stable in space all along"] is False


@pytest.mark.slow
def test_space_sideways(numbers_of):
    """A round rod beside its plane from 1.6015 to 2.4765, at q = 2.1 at (−0.0385, 0.184)."""
    found = numbers_of("space_sideways")
    assert found["the arch leaves its plane at q"] == pytest.approx(1.601471549048, abs=2e-11)
    assert found["it is back in its plane at q"] == pytest.approx(2.476483, abs=5.1e-7)
    assert found["height of the middle at q = 2.1"] == pytest.approx(-0.0385, abs=5.1e-5)
    aside = found["distance of the middle from the plane at q = 2.1"]
    assert aside == pytest.approx(0.184, abs=5.1e-4)
    assert found["margin at q = 2.1"] > 0.0


def test_space_stiffness(numbers_of):
    """Smallest A of the way for three C, and at (0.9, 0) up to two loads; last digit."""
    found = numbers_of("space_stiffness", settings=(2, 2))
    for torsion, exact in ((0.77, 1.4745), (1.0, 1.4715), (1.4, 1.4687)):
        key = f"least A for the way inside out, C = {torsion:g}"
        np.testing.assert_allclose(found[key], exact, atol=1e-4)
    loads = {"q = 2.5": 1.5708, "the planar limit load": 2.7901}
    for load, exact in loads.items():
        np.testing.assert_allclose(found[f"least A at (0.9, 0) up to {load}"], exact, atol=1e-4)


@pytest.mark.slow
def test_space_loads(numbers_of):
    """The first lateral loads of the round rod; maps on few settings."""
    found = numbers_of("space_loads", grid=em.Grid(Theta=(0.5, 1.3, 3), Delta=(-0.6, 0.6, 4)))
    expected = {
        ("uniform", 0.6, 0.0): 1.125177, ("uniform", 0.9, 0.0): 1.601472,
        ("uniform", 0.9, 0.02): 1.601348, ("uniform", 1.2, 0.0): 2.086648,
        ("uniform", 1.5, 0.0): 2.693904, ("uniform", 0.94, 0.6): 1.637928,
        ("left-half", 0.9, 0.0): 1.534254, ("left-half", 0.94, 0.6): 1.596116,
    }  # fmt: skip
    for (load, theta, delta), value in expected.items():
        key = f"round, {load}: leaves its plane at ({theta:g}, {delta:g})"
        np.testing.assert_allclose(found[key], value, atol=1e-6)
    assert found["round: snaps out of its plane at (0.9, 0)"] is False
    sideways = "share of settings that leave the plane first"
    assert found[f"planar: {sideways}"] == 0.0
    assert found[f"round: {sideways}"] == 1.0
    assert found[f"strip 3: {sideways}"] == 0.0


@pytest.mark.parametrize("example", EXAMPLES, ids=lambda each: each.name)
def test_examples_are_short_and_use_the_public_face(example):
    """At most 60 lines; nothing imported from within."""
    assert len(inspect.getsource(example.main).splitlines()) <= 60
    assert "from equimorph" not in inspect.getsource(inspect.getmodule(example.main))


def test_every_quoted_number_has_an_example():
    names = {example.name for example in EXAMPLES}
    assert {each.example for each in QUOTED} <= names


def test_the_report_shows_theirs_beside_ours(tmp_path):
    """With stand-ins for the computation."""

    def stand_in(example):
        keys = [each.key for each in QUOTED if each.example == example.name]
        cells = [row[1] for table in TABLES if table.example == example.name for row in table.rows]
        keys += [key for row in cells for _, key in row]

        def main(folder):
            return dict.fromkeys(keys, 1.5)

        main.__name__ = example.name
        return Example(example.title, main, example.captions)

    tmp_path = tmp_path / "results" / "paper"  # made if it does not exist
    reproduction.reproduce(tmp_path, examples=[stand_in(each) for each in EXAMPLES])
    page = (tmp_path / "index.html").read_text(encoding="utf-8")
    text = (tmp_path / "report.md").read_text(encoding="utf-8")
    plain = text.replace("\\|", "|")
    for each in QUOTED:
        assert each.note in plain
        assert f"| {each.what} |" in plain
    assert page.count("<h2>") == len(EXAMPLES)
    assert all(table.caption in plain for table in TABLES)
    assert "| 0.96, 0 | 2.1 (1.5) | 7.6 (1.5) |" in plain
    assert "| the closed target curve can be tracked | yes | yes |  |" in plain


def test_the_article_halves_its_angle_in_the_table():
    """At (0.64, ±0.58) instead of the printed (0.64, 1.16): 11.39 and 3.76 for 11.7 and 3.35."""
    with unchecked():
        found = {
            (load, sign): arch_maps.curvature_at(em.Rod(load), 0.64, sign * 0.58)[0]
            for load in ("uniform", "left-half")
            for sign in (1, -1)
        }
    np.testing.assert_allclose([found["uniform", 1], found["uniform", -1]], 11.39, atol=5e-3)
    np.testing.assert_allclose(found["left-half", 1], 3.76, atol=5e-3)


def test_questions_are_answered_in_words():
    assert [in_words(value, 4) for value in (True, False, 1.0, -0.25)] == [
        "yes",
        "no",
        "1",
        "−0.25",
    ]


@pytest.mark.slow
@pytest.mark.parametrize("example", EXAMPLES, ids=lambda each: each.name)
def test_the_article_at_full_resolution(example, tmp_path):
    """Every picture and every quoted number is there, and light to open."""
    with unchecked():
        found = reproduction.reproduce(tmp_path, examples=[example])
    for name in example.captions:
        assert 0 < (tmp_path / f"{name}.png").stat().st_size < LIGHT
        assert 0 < (tmp_path / f"{name}.svg").stat().st_size < LIGHT
    quoted = [each for each in QUOTED if each.example == example.name]
    assert len(found.rows(example.name)) == len(quoted)
    page = (tmp_path / "index.html").read_text(encoding="utf-8")
    assert len(page) < 10 * LIGHT
    assert page.count("<img") == len(example.captions)
    assert not any(f'{where}="http' in page for where in ("src", "href"))


def test_a_folder_that_cannot_be_written_is_refused(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(em.InputError):
        reproduction.reproduce(tmp_path / "file" / "paper")
