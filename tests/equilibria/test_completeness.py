"""Capture and recapture over independent runs."""

import numpy as np
import pytest

import equimorph as em
from equimorph.equilibria import Completeness


def test_what_every_run_finds_is_estimated_complete():
    every = Completeness(np.ones((3, 5), bool))
    assert (every.runs, every.found, every.per_run) == (3, 5, (5, 5, 5))
    assert (every.estimate, every.upper) == (5.0, 5.0)


def test_the_estimate_is_chaos():
    """Four found once, one twice, one by all of three runs: 6 + ⅔ · 4 · 3 / (2 · 2) = 8."""
    times = np.array([1, 1, 1, 1, 2, 3])
    captured = np.arange(3)[:, None] < times
    assert Completeness(captured).estimate == pytest.approx(8.0, rel=1e-12)


def test_runs_without_catch_say_nothing_of_what_is_missing():
    nothing = Completeness(np.zeros((4, 0), bool))
    assert (nothing.found, nothing.estimate, nothing.upper) == (0, 0.0, 0.0)
    # (1 − p)⁴ = 0.05
    assert nothing.detectable == pytest.approx(0.5271, abs=1e-4)


def test_the_likelihood_decides_on_the_upper_number():
    """Two of two runs found one, each another one of two more: N!/(N − 3)! pʰ (1 − p)ᵗ⁻ʰ, h = 4."""
    number = np.arange(3, 200)
    p = 4.0 / (2.0 * number)
    chance = number * (number - 1) * (number - 2) * p**4 * (1.0 - p) ** (2 * number - 4)
    plausible = number[2.0 * np.log(chance.max() / chance) <= 2.706]
    captured = np.array([[True, True, False], [True, False, True]])
    assert Completeness(captured).upper == plausible.max()


def test_nothing_bounds_the_number_when_nothing_is_found_again():
    assert Completeness(np.eye(3, dtype=bool)).upper == np.inf
    assert Completeness(np.ones((1, 4), bool)).upper == np.inf


def test_what_no_run_found_is_some_of_what_is_estimated_to_be_missing():
    """Chao's two more, ⅔ · 4 · 3 / (2 · 2), are those that were added, or at least as many."""
    captured = np.arange(3)[:, None] < np.array([1, 1, 1, 1, 2, 3])
    for added, estimate in ((1, 8.0), (2, 8.0), (5, 11.0)):
        told = Completeness(np.pad(captured, ((0, 0), (0, added))))
        assert (told.found, told.added, told.estimate) == (6 + added, added, estimate)


def test_more_than_runs_allow_refute_that_all_are_equally_easy_to_find():
    """Three runs that found the same nine of eleven told "at most 11", whatever else there is."""
    every = np.ones((3, 9), bool)
    assert Completeness(every).upper == 9.0
    told = Completeness(np.pad(every, ((0, 0), (0, 2))))
    assert told.upper == np.inf
    assert "; there may be any number more, as no run found 2 of them" in str(told)
    some = np.array([[True, True, False], [True, False, True]])
    bound = int(Completeness(some).upper)
    for found, upper in ((4, bound), (bound, bound), (bound + 1, np.inf)):
        assert Completeness(np.pad(some, ((0, 0), (0, found - 3)))).upper == upper


def test_equally_easy_equilibria_are_seldom_told_to_be_harder_to_find():
    """40 equilibria, each caught by 3 runs with chance 0.7, and all the others added by descents.

    The bound is wrong for 5 %, asymptotically, and nothing else refutes it.
    """
    generator = np.random.default_rng(6)
    refuted = 0
    for _ in range(400):
        refuted += Completeness(generator.random((3, 40)) < 0.7).upper == np.inf
    assert 0 < refuted <= 0.1 * 400


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_a_search_that_lacks_states_does_not_bound_their_number(seed):
    """An arch of two members has 20 states with |κ| ≤ 8, by shooting; 13 were "at most 13"."""
    drawn = {"A": (-1, 0), "B": (0, 0.3), "C": (1, 0)}
    held, load = {"A": "pinned", "C": "pinned"}, {"P": {"B": (0, -1)}}
    arch = em.Frame(drawn, [("A", "B"), ("B", "C")], held, load, elements=4)
    found = em.find_equilibria(arch, {"P": 5.0}, within=[arch.max_curvature <= 8.0], seed=seed)
    assert len(found) <= 20 <= found.completeness.upper


@pytest.mark.parametrize("chance", [0.5, 0.9])
def test_the_upper_number_holds_for_equally_easy_equilibria(chance):
    """40 equilibria, each caught by 3 runs with the same chance: at least 40 in about 95 %.

    The limit is asymptotic (92 % of many trials for the smaller chance); and two standard
    deviations of 400 trials are 2.2 %.
    """
    generator = np.random.default_rng(5)
    held = 0
    for _ in range(400):
        caught = generator.random((3, 40)) < chance
        held += Completeness(caught[:, caught.any(axis=0)]).upper >= 40.0
    assert held >= 0.9 * 400


def test_one_line_says_it_all():
    line = str(Completeness(np.array([[True, True], [True, False]])))
    assert line.startswith("2 found (in single runs 2, 1); estimated 2.0, at most ")


def test_a_search_tells_how_many_of_its_starts_arrived():
    """Newton's method always arrives on the spring beyond x_l = 1, seldom on some rods in space.

    Its estimates rest on those that arrive: with 7 of 201 it met one of nine states of a rod.
    """
    spring = em.Spring()
    told = em.find_equilibria(spring, {"x_l": 1.2, "F": 0.1}).completeness
    assert told.starts == 67 * spring.guesses_per_start * told.runs
    assert told.arrived == told.starts
    rod = em.SpatialRod("uniform", torsion=0.77, lateral=1.0, elements=6)
    told = em.find_equilibria(rod, {"Theta": 0.9, "q": 1.0}, starts=60).completeness
    assert 0 < told.arrived < told.starts == 20 * told.runs
    line = str(Completeness(np.ones((3, 1), bool), starts=201, arrived=7))
    assert line.endswith("if all are equally easy to find; 7 of 201 starts arrived")


def test_states_beyond_the_discretisation_are_not_counted_as_none():
    """Under q = 200 the arch has equilibria; the default mesh resolves none of them."""
    arch = em.Rod(load="uniform")
    found = em.find_equilibria(arch, {"Theta": 1.0, "Delta": 0.0, "q": 200.0})
    assert len(found) == 0
    assert found.completeness.upper == np.inf
    assert "the discretisation does not resolve the state: refine it" in repr(found)


def test_starts_that_squeeze_bars_to_nothing_are_told_what_bounds_them():
    """Trusses cannot be refined. Of l = 1 − F with F = .995 nothing is left but the bar's kink."""
    bars, held = [("A", "B")], {"A": "xy", "B": "y"}
    bar = em.Truss({"A": (0, 0), "B": (1, 0)}, bars, held, {"F": {"B": (-1, 0)}})
    found = em.find_equilibria(bar, {"F": 0.995})
    assert "led to where a bar has collapsed: bound `max_shortening`, or" in repr(found)
    assert found.completeness.upper == np.inf
    within = [bar.max_shortening <= 0.5]
    assert em.find_equilibria(bar, {"F": 0.4}, within=within).completeness.upper < np.inf
    end = em.lift(bar.natural_state(), {"F": 5.0}).end
    assert end.detail.endswith("where a bar has collapsed: bound `max_shortening`")


@pytest.mark.parametrize("load", ["uniform", "left-half"])
@pytest.mark.parametrize(
    "q",
    [
        *(2.5, 50.0),
        *(pytest.param(q, marks=pytest.mark.slow) for q in (10, 20, 100, 200, -50, -200)),
    ],
)
def test_the_bound_holds_for_finer_meshes_too(load, q):
    """Twelve elements never find more than what six allow.

    Under q = 50 six elements resolve one of at least five states up to max |κ| = 30.
    """
    coarse, fine = em.Rod(load=load), em.Rod(load=load, elements=12)
    at = {"Theta": 1.0, "Delta": 0.0, "q": q}
    for cap in (20.0, 30.0):
        few = em.find_equilibria(coarse, at, within=[coarse.max_curvature <= cap])
        many = em.find_equilibria(fine, at, within=[fine.max_curvature <= cap])
        assert len(many) <= few.completeness.upper
    if abs(q) <= 6.0:
        assert few.completeness.upper == len(many) == len(few)


@pytest.mark.slow
@pytest.mark.parametrize("span", [0.6, 0.7, 0.8, 0.9])
def test_the_bound_holds_for_other_spans(span):
    """As above, for loads between."""
    for load in ("uniform", "left-half"):
        coarse, fine = (em.Rod(load=load, span=span, elements=n) for n in (6, 12))
        for q in np.linspace(-60.0, 60.0, 13):
            at = {"Theta": 1.2, "Delta": 0.1, "q": q}
            few = em.find_equilibria(coarse, at, within=[coarse.max_curvature <= 30.0])
            many = em.find_equilibria(fine, at, within=[fine.max_curvature <= 30.0])
            assert len(many) <= few.completeness.upper, (load, q, few, many)
