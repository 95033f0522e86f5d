"""Reachable sets of the spring over (x_l, F), steered in S = (δ, y_B), y_B = x_l tan δ.

In coordinates (δ, x_l) of the set det J_S = tan δ: the sides δ > 0 and δ < 0 are regions. States
are stable where x_l > cos³ δ, and F/k = (1 − x_l/cos δ) sin δ.
"""

import numpy as np
import pytest

import equimorph as em
from equimorph.errors import InputError
from equimorph.manifold import part
from equimorph.tasks.reach.reachable_sets import attainable, reachable
from typecheck import unchecked

LOW, HIGH, LOAD = 0.3, 1.3, 0.5


def force(delta, x):
    return (1 - x / np.cos(delta)) * np.sin(delta)


def inside(delta, x):
    """Whether states of the side δ > 0 are stable and within the box."""
    return (delta > 0) & (x > np.cos(delta) ** 3) & (x < HIGH) & (x > LOW) & (
        np.abs(force(delta, x)) < LOAD
    )  # fmt: skip


@pytest.fixture(scope="module")
def descriptors(spring_set):
    return [spring_set.structure.angle, spring_set.structure.height]


@pytest.fixture(scope="module")
def start(spring_set):
    return max(spring_set.at(x_l=0.8, F=0.01).stable, key=spring_set.structure.angle)


@pytest.fixture(scope="module")
def reach(spring_set, start, descriptors):
    with unchecked():
        return reachable(spring_set, start, descriptors, accuracy=0.004)


def test_boundary_is_exact_and_classed(reach):
    kinds = {piece.kind for piece in reach.boundary}
    assert kinds == {"snap-through", "singular Jacobian", "actuator limit"}
    assert reach.status == "found"
    assert reach.why == ""
    for piece in reach.boundary:
        delta, x, load = piece.states.z[:, 0], piece.states["x_l"], piece.states["F"]
        assert load == pytest.approx(force(delta, x), abs=1e-12)
        if piece.kind == "snap-through":
            assert x == pytest.approx(np.cos(delta) ** 3, abs=1e-9)
        elif piece.kind == "singular Jacobian":
            assert np.abs(delta).max() < 1e-9
        else:
            name, _, bound = piece.detail.partition(" = ")
            assert piece.states[name] == pytest.approx(float(bound), abs=1e-9)
    details = {piece.detail for piece in reach.boundary if piece.detail}
    assert {"x_l = 1.3", "x_l = 0.3", "F = -0.5"} <= details


def test_both_sides_are_regions_of_one_stable_piece(reach):
    """The mirror δ → −δ, F → −F maps one on the other."""
    assert len(reach.regions) == 2
    assert reach.regions[0].side == -reach.regions[1].side
    sizes = [region.size for region in reach.regions]
    assert sizes[0] == pytest.approx(sizes[1], rel=5e-3)
    assert (reach.home.values[:, 0] > -1e-9).all()
    assert (reach.margin > -1e-7).all()


def test_area_of_the_image_is_the_integral_of_the_jacobian(reach):
    """∫∫ tan δ dδ dx_l over the region, by the midpoint rule; covered once."""
    delta, x = np.meshgrid(
        (np.arange(2000) + 0.5) / 2000 * 1.5, LOW + (np.arange(2000) + 0.5) / 2000 * (HIGH - LOW)
    )
    area = (np.tan(delta) * inside(delta, x)).sum() * 1.5 * (HIGH - LOW) / 2000**2
    assert reach.home.image_size == pytest.approx(area, rel=4e-3)
    assert reach.home.multiplicity == 1
    assert reach.home.areas[1] == pytest.approx(area, rel=4e-3)


def test_queries_agree_with_the_closed_form(reach, descriptors):
    """(δ, y_B) is reached from δ > 0 exactly if its state is stable and within the box."""
    angle, height = descriptors
    generator = np.random.default_rng(2)
    counts = [0, 0]
    with unchecked():
        for _ in range(40):
            delta, x = generator.uniform(-0.3, 1.0), generator.uniform(0.4, 1.4)
            answer = reach.query({angle: delta, height: x * np.tan(delta)})
            can = bool(inside(delta, x))
            assert answer.can is can, (delta, x, answer)
            counts[can] += 1
            if can:
                assert answer.schedule.values[-1, 0] == pytest.approx(x, abs=1e-9)
                assert answer.margin > 0
            else:
                assert answer.why
    assert min(counts) >= 10


def test_a_refusal_says_what_stops_it_and_where_else_it_is_possible(reach, descriptors):
    angle, height = descriptors
    beyond = reach.query({angle: -0.5, height: -0.9 * np.tan(0.5)})
    assert not beyond.can
    assert beyond.region.tolist() == [1]
    assert "beyond a singular Jacobian" in beyond.why
    assert beyond.straight.failure == "snap-through"
    unstable = reach.query({angle: 0.1, height: 0.5 * np.tan(0.1)})
    assert (len(unstable.states), unstable.schedule) == (0, None)
    assert "no stable state around the start" in unstable.why
    assert np.isnan(unstable.margin)


def test_a_straight_line_that_fails_is_no_refusal(spring_set, descriptors):
    """From (0.9, 0.35) to (0.9, 1.25) the chord in (δ, y_B) may leave the set; a route does not."""
    angle, height = descriptors
    states = spring_set.at(x_l=0.35, F=0.3).stable
    start = max(states, key=angle)
    with unchecked():
        reach = reachable(spring_set, start, descriptors)
        answer = reach.query({angle: 0.02, height: 1.02 * np.tan(0.02)})
    assert not answer.straight.arrived
    assert answer.can
    assert answer.route is not None
    assert answer.schedule.values[-1, 0] == pytest.approx(1.02, abs=1e-9)


def test_attainable_states_are_all_that_hang_together(spring_set, start, descriptors):
    """Around x_l > 1 both signs of δ hang together; below, they do not."""
    with unchecked():
        found = attainable(spring_set, start, descriptors)
        short = attainable(spring_set, start, descriptors, within=[em.value_of(
            spring_set.structure, "x_l") <= 0.95])  # fmt: skip
    assert found.states.z.min() < -0.5
    assert {piece.kind for piece in found.boundary} == {"snap-through", "actuator limit"}
    assert short.states.z.min() > 0.0
    assert "constraint" in {piece.kind for piece in short.boundary}
    answer = found.query({descriptors[0]: -0.5, descriptors[1]: -0.9 * np.tan(0.5)})
    assert answer.can
    assert answer.route is not None


def test_on_a_curve_the_boundary_is_points():
    """One parameter F at x_l = 0.8: from F = −0.3 to the fold F = (1 − x_l^⅔)^{3/2}."""
    spring = em.Spring()
    eset = em.equilibrium_set(
        spring, em.Box(F=(-0.3, 0.3)), fixed={"x_l": 0.8}, intervals=(9,), checks=0
    )
    start = max(eset.at(F=0.0).stable, key=spring.angle)
    reach = reachable(eset, start, [spring.angle])
    ends = {piece.kind: piece.states["F"] for piece in reach.boundary}
    assert ends["snap-through"] == pytest.approx([(1 - 0.8 ** (2 / 3)) ** 1.5], rel=1e-9)
    assert ends["actuator limit"] == pytest.approx([-0.3], abs=1e-12)
    lowest = np.arcsin(np.cbrt(ends["snap-through"][0]))
    assert reach.home.values.min() == pytest.approx(lowest, abs=1e-8)
    assert reach.query({spring.angle: 0.6}).can
    assert not reach.query({spring.angle: 0.1}).can


def test_bad_questions_are_refused(spring_set, start, descriptors, reach):
    angle, height = descriptors
    with pytest.raises(InputError, match="`descriptors` must be 2"):
        reachable(spring_set, start, [angle])
    unstable = next(s for s in spring_set.at(x_l=0.8, F=0.01) if s.index)
    with pytest.raises(InputError, match="must be stable; got a state of index 1"):
        reachable(spring_set, unstable, descriptors)
    with pytest.raises(InputError, match="must obey angle >= 1"):
        attainable(spring_set, start, descriptors, within=[angle >= 1.0])
    other = em.Spring().natural_state(x_l=0.5)
    beside = part(spring_set, spring_set.coordinates[spring_set.cells, 0].min(axis=1) > 0.6)
    with pytest.raises(InputError, match="which is not"):
        reachable(beside, other, descriptors)
    with pytest.raises(InputError, match="`targets` must give as many descriptors"):
        reach.query({angle: 0.3})
    with pytest.raises(InputError, match="must be finite"):
        reach.query({angle: 0.3, height: np.inf})
