"""Paths that nearly cross: many lanes with random coefficients, each with its own imperfection ε.

With ε below 1e-9 or so a path cannot be told from one through the branch point, and says so.
"""

import numpy as np
import pytest

import equimorph as em
from equimorph.structures import States
from oracles.polynomial import Polynomial
from typecheck import unchecked

NAMES = ("a", "e", "c", "g", "s", "r", "k", "m")


@pytest.fixture(scope="module", autouse=True)
def _fast():
    with unchecked():
        yield


def following(energy):
    """Energy c E(x, a − g) with a second unknown y = m x² held by a spring k."""
    return Polynomial(
        lambda x, y, a, e, c, g, s, r, k, m: (
            c * energy(x, a - g, e, s, r) + k * 0.5 * (y - m * x**2) ** 2
        ),
        2,
        NAMES,
    )


PITCHFORK = following(lambda x, a, e, s, r: x**4 * 0.25 - a * x**2 * 0.5 + e * x)
"""x³ − a x + ε = 0."""
CROSSING = following(
    lambda x, a, e, s, r: (
        x**3 * (1 / 3) - a * (s + r * 2.0) * x**2 * 0.5 + a**2 * r * (r + s) * x + e * x
    )
)
"""(x − r a) (x − (r + s) a) + ε = 0: lines of slopes r and r + s."""


def coefficients(lanes, size, seed):
    """Random ones by name, with |ε| of the given size, and distances of 0.01 to 3 from a = g."""
    draw = np.random.default_rng(seed)
    sign = draw.choice([-1.0, 1.0], (3, lanes))
    values = {
        "e": size * sign[0] * draw.uniform(0.1, 1.0, lanes),
        "c": sign[1] * draw.uniform(0.2, 5.0, lanes),
        "g": draw.uniform(-0.6, 0.6, lanes),
        "s": sign[2] * 10.0 ** draw.uniform(-1.7, 0.0, lanes),
        "r": draw.uniform(-0.5, 0.5, lanes),
        "k": draw.uniform(0.5, 4.0, lanes),
        "m": draw.uniform(-1.0, 1.0, lanes),
    }
    return values, 10.0 ** draw.uniform(-2.0, 0.5, (2, lanes))


def starts(form, values, a, x):
    """States at a − g = `a` with first unknown `x`."""
    p = np.stack([values["g"] + a, *(values[name] for name in NAMES[1:])], axis=1)
    return States(form, np.stack([x, values["m"] * x**2], axis=1), p)


def outer_root(a, e):
    """Root of x³ − a x + ε with the sign of −ε, which there is for every a."""
    x = -np.cbrt(e) - np.sign(e) * np.sqrt(np.maximum(a, 0.0))
    for _ in range(100):
        x = x - (x**3 - a * x + e) / (3.0 * x**2 - a)
    return x


def named(ends):
    return np.isin(ends.kind, ("branch point", "lost"))


SIZES = [1e-4, 1e-6, 1e-8, 1e-10, 1e-12]
MANY = [(30, 1), pytest.param(300, 5, marks=pytest.mark.slow)]


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize(("lanes", "seed"), MANY)
def test_paths_past_a_pitchfork_end_on_their_own_side_or_say_why_not(size, lanes, seed):
    """From a < 0 the only root goes over into the outer one with the sign of −ε."""
    values, (low, high) = coefficients(lanes, size, seed)
    ends = em.lift(
        starts(PITCHFORK, values, -low, outer_root(-low, values["e"])),
        {"a": values["g"] + high},
    )
    expected = outer_root(high, values["e"])
    good = ends.arrived & (np.abs(ends.states.z[:, 0] - expected) < 1e-8)
    assert (good | named(ends)).all()
    assert good.all() or size < 1e-7


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize(("lanes", "seed"), MANY)
def test_paths_that_turn_before_a_crossing_end_there_and_others_pass_it(size, lanes, seed):
    """ε > 0: a fold at a = −2 √ε / |s|; ε < 0: two curves that pass each other; lines from 0.02."""
    values, (low, high) = coefficients(lanes, size, seed)
    e, s, r = (values[name] for name in "esr")
    side = np.where(values["k"] > 2.0, 1.0, -1.0)
    low = np.maximum(low, 4.0 * np.sqrt(np.abs(e)) / np.abs(s))

    def root(a, side):
        return (r + 0.5 * s) * a + side * np.sqrt(np.maximum(0.25 * s**2 * a**2 - e, 0.0))

    begun = starts(CROSSING, values, -low, root(-low, side))
    ends, around = (
        em.lift(begun, {"a": values["g"] + high}, through_folds=through)
        for through in (False, True)
    )
    turn = -2.0 * np.sqrt(np.abs(e)) / np.abs(s)
    folds = (ends.kind == "fold") & (np.abs(ends.states["a"] - values["g"] - turn) < 1e-9)
    passes = ends.arrived & (np.abs(ends.states.z[:, 0] - root(high, side)) < 1e-8)
    good = np.where(e > 0.0, folds, passes)
    assert (good | named(ends)).all()
    assert good.all() or size < 1e-7
    gap = np.abs(around.states.z[:, 0] - np.where(e > 0.0, root(-low, -side), root(high, side)))
    there = (around.kind == np.where(e > 0.0, "returned", "arrived")) & (gap < 1e-8)
    told = np.isin(np.arange(lanes), around.events.lane[around.events.kind == "branch point"])
    assert (there | told | named(around)).all()


@pytest.mark.parametrize("size", [1e-5, 1e-9, 1e-12])
def test_lanes_that_nearly_cross_are_those_of_each_alone(size):
    values, (low, high) = coefficients(6, size, 3)
    begun = starts(PITCHFORK, values, -low, outer_root(-low, values["e"]))
    goal = values["g"] + high
    many = em.lift(begun, {"a": goal})
    for lane in range(6):
        alone = em.lift(begun[lane], {"a": goal[lane]}).end
        assert alone.kind == many.kind[lane]
        np.testing.assert_allclose(alone.state.z, many.states.z[lane], rtol=0, atol=1e-8)
