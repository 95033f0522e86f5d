"""Events of even multiplicity in many lanes, each with coefficients, start and goal of its own."""

import numpy as np
import pytest

import equimorph as em
from equimorph.equilibria import TraceOptions
from equimorph.structures import States
from oracles.polynomial import Polynomial
from typecheck import unchecked

RECORDED = TraceOptions(record=True)


@pytest.fixture(scope="module", autouse=True)
def _fast():
    with unchecked():
        yield


def following(energy):
    """Energy c E(x, a − g) with a second unknown y = m x² held by a spring k."""
    return Polynomial(
        lambda x, y, a, c, g, k, m: c * energy(x, a, g) + k * 0.5 * (y - m * x**2) ** 2,
        2,
        ("a", "c", "g", "k", "m"),
    )


HYSTERESIS = following(lambda x, a, g: x**4 * 0.25 - (a - g) * x)
"""x³ = a − g: a fold in which the path does not turn."""
TOUCHING = following(lambda x, a, g: x**4 * 0.25 + (a - g) ** 2 * x**2 * 0.5)
"""On x = 0 the eigenvalue c (a − g)² touches zero."""


def random_lanes(form, lanes, seed):
    """Starts below a = g and goals above, both between 1e-3 and 1.6 away."""
    draw = np.random.default_rng(seed)
    c, k = draw.uniform(0.2, 5.0, lanes), draw.uniform(0.5, 4.0, lanes)
    g, m = draw.uniform(-0.6, 0.6, lanes), draw.uniform(-1.0, 1.0, lanes)
    before, beyond = 10.0 ** draw.uniform(-3.0, 0.2, (2, lanes))
    x = -np.cbrt(before) if form is HYSTERESIS else np.zeros(lanes)
    z, p = np.stack([x, m * x**2], 1), np.stack([g - before, c, g, k, m], 1)
    return States(form, z, p), g + beyond


CASES = [(HYSTERESIS, "fold"), (TOUCHING, "branch point")]


@pytest.mark.parametrize(
    ("lanes", "seed"), [(150, 3), pytest.param(1250, 5, marks=pytest.mark.slow)]
)
@pytest.mark.parametrize(("form", "kind"), CASES)
def test_no_touching_event_is_missed_in_many_lanes(form, kind, lanes, seed):
    """Closed form: each path touches zero at a = g and ends there, as do its recorded points."""
    starts, goal = random_lanes(form, lanes, seed)
    many = em.lift(starts, {"a": goal}, options=RECORDED)
    assert set(many.kind.tolist()) == {kind}
    assert many.states["a"] == pytest.approx(many.states["g"], abs=1e-10)
    assert (many.points.states["a"] <= many.states["a"][many.points.lane] + 1e-12).all()


@pytest.mark.parametrize(("form", "kind"), CASES)
def test_touching_events_of_many_lanes_are_those_of_each_alone(form, kind):
    starts, goal = random_lanes(form, 20, 11)
    many = em.lift(starts, {"a": goal})
    for lane in range(20):
        alone = em.lift(starts[lane], {"a": goal[lane]}).end
        assert (alone.kind, alone.detail) == (kind, many.detail.get(lane, alone.detail))
        assert alone.state["a"] == pytest.approx(many.states["a"][lane], abs=1e-10)


@pytest.mark.parametrize(("form", "kind"), CASES)
def test_touching_events_on_the_way_are_kept_with_their_lanes(form, kind):
    starts, goal = random_lanes(form, 60, 7)
    many = em.lift(starts, {"a": goal}, through_folds=True)
    assert many.arrived.all()
    assert np.unique(many.events.lane).tolist() == list(range(60))
    assert set(many.events.kind.tolist()) == {kind}
    assert many.events.states["a"] == pytest.approx(many.events.states["g"], abs=1e-10)


def test_pairs_of_events_in_first_steps_are_separated_in_many_lanes():
    """x (x² + (a − g)² − depth) = 0 on x = 0: goals so near that the first step is the last."""
    form = following(lambda x, a, g: x**4 * 0.25 + ((a - g) ** 2 - 1e-6) * x**2 * 0.5)
    draw, lanes = np.random.default_rng(2), 60
    before, beyond = draw.uniform(0.003, 0.02, (2, lanes))
    one, p = np.ones(lanes), draw.uniform(-0.5, 0.5, lanes)
    starts = States(form, np.zeros((lanes, 2)), np.stack([p - before, one, p, one, 0 * p], 1))
    many = em.lift(starts, {"a": p + beyond}, through_folds=True)
    assert many.arrived.all()
    assert many.events.lane.tolist() == np.repeat(np.arange(lanes), 2).tolist()
    places = (many.events.states["a"] - many.events.states["g"]).reshape(lanes, 2)
    assert places == pytest.approx(np.tile([-1e-3, 1e-3], (lanes, 1)), abs=1e-10)


HYSTERESES = Polynomial(
    lambda x, y, a, c, d, k, m: (
        c * (x**4 * 0.25 - d * x**2 * 0.5 - a * x) + k * 0.5 * (y - m * x**2) ** 2
    ),
    2,
    ("a", "c", "d", "k", "m"),
)
"""x³ − d x = a: two folds at x = ∓√(d/3), a = ±2 (d/3)^1.5."""


@pytest.mark.parametrize(
    ("lanes", "seed"), [(1500, 3), pytest.param(5000, 0, marks=pytest.mark.slow)]
)
def test_no_pair_of_folds_hides_at_the_end_of_many_lanes(lanes, seed):
    """Goals close before or behind the first fold: 27 of 5000 lanes arrived behind both of them."""
    draw = np.random.default_rng(seed)
    d, c = 10.0 ** draw.uniform(-6.0, -1.0, lanes), draw.uniform(0.2, 5.0, lanes)
    k, m = draw.uniform(0.5, 4.0, lanes), draw.uniform(-1.0, 1.0, lanes)
    edge, fold = np.sqrt(d / 3.0), 2.0 * (d / 3.0) ** 1.5
    x = -edge - 10.0 ** draw.uniform(-1.5, 0.3, lanes)
    close = fold * draw.choice([-1.0, 1.0], lanes) * 10.0 ** draw.uniform(-3.0, -0.5, lanes)
    far = 10.0 ** draw.uniform(-6.0, 0.0, lanes)
    goal = fold + np.where(draw.random(lanes) < 0.5, far, close)
    starts = States(HYSTERESES, np.stack([x, m * x**2], 1), np.stack([x**3 - d * x, c, d, k, m], 1))
    many = em.lift(starts, {"a": goal})
    assert (many.kind == np.where(goal > fold, "fold", "arrived")).all()
    u = many.states.z[:, 0]
    assert (u <= -edge * (1.0 - 1e-6)).all()
    alone = [em.lift(starts[i], {"a": goal[i]}).end.kind for i in range(0, lanes, 50)]
    assert alone == many.kind[::50].tolist()
