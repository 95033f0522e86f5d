"""Alternatives around holes, routes with snaps at a price, round corners, limits on efforts."""

import re

import numpy as np
import pytest

import equimorph as em
from equimorph.errors import InputError
from equimorph.tasks.planning.homology import cocycles, signature
from equimorph.tasks.planning.planner import plan
from equimorph.tasks.planning.route_classes import alternatives
from equimorph.tasks.planning.smoothing import smoothed
from equimorph.tasks.verification.schedule_check import verify
from typecheck import unchecked


def annulus(count: int) -> tuple[np.ndarray, np.ndarray]:
    """Edges and triangles of a ring: vertices 0 … n − 1 inside, n … 2n − 1 outside."""
    inner = np.arange(count)
    ahead = (inner + 1) % count
    triangles = np.concatenate(
        [
            np.stack([inner, ahead, inner + count], axis=1),
            np.stack([ahead, inner + count, ahead + count], axis=1),
        ]
    )
    triangles = np.sort(triangles, axis=1)
    sides = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [0, 2]]])
    return np.unique(sides, axis=0), triangles


def test_a_ring_has_one_cocycle_that_counts_turns():
    edges, triangles = annulus(7)
    values = cocycles(14, edges, triangles)
    assert values.shape[1] == 1
    around = np.array([*range(7), 0])
    outside = np.array([*range(7, 14), 7])
    trivial = np.array([0, 1, 8, 7, 0])
    once = signature(14, edges, values, around)
    assert abs(once[0]) == 1
    assert signature(14, edges, values, outside) == once
    assert signature(14, edges, values, np.concatenate([around, around[1:]])) == (2 * once[0],)
    assert signature(14, edges, values, trivial) == (0,)


def test_a_disc_has_no_cocycle():
    edges, triangles = annulus(6)
    apex = np.sort(np.stack([np.arange(6), (np.arange(6) + 1) % 6, np.full(6, 12)], 1), axis=1)
    whole = np.concatenate([triangles, apex])
    spokes = np.stack([np.arange(6), np.full(6, 12)], axis=1)
    assert cocycles(13, np.concatenate([edges, spokes]), whole).shape[1] == 0


@pytest.fixture(scope="module")
def ways(arch_set, ends):
    with unchecked():
        return alternatives(arch_set, *ends, 3)


def test_the_arch_turns_over_to_either_side(ways):
    """Mirror images Δ → −Δ are equally long, but pass the folds on different sides."""
    left, right = ways[:2]
    assert left.arrived
    assert right.arrived
    assert left.cost == pytest.approx(right.cost, rel=1e-3)
    sides = [
        np.sign(way.schedule.values[np.abs(way.schedule.values[:, 1]).argmax(), 1])
        for way in (left, right)
    ]
    assert sorted(sides) == [-1.0, 1.0]


def test_further_alternatives_are_longer(ways):
    assert len(ways) == 3
    assert ways[2].cost > 1.5 * ways[0].cost


def test_alternatives_obey_margins(arch_set, ends):
    with unchecked():
        found = alternatives(arch_set, *ends, 2, margin=0.3)
    assert [way.arrived for way in found] == [True, True]
    assert min(way.margin for way in found) >= 0.3


def test_without_a_route_there_is_no_alternative(short_spring_set):
    start, goal = (short_spring_set.at(x_l=0.8, F=0.0).stable[k] for k in (0, 1))
    (found,) = alternatives(short_spring_set, start, goal)
    assert found.why == "start and goal lie on different stable components of the set"


def test_alternatives_need_a_surface(ends, arch_set):
    with pytest.raises(InputError, match=r"^`count` must be a whole number from 1 to 10000; got 0"):
        alternatives(arch_set, *ends, 0)


def test_cheap_snaps_are_taken_and_dear_ones_are_not(arch_set, ends):
    with unchecked():
        cheap = plan(arch_set, *ends, snap_price=0.3)
        dear = plan(arch_set, *ends, snap_price=5.0)
        free = plan(arch_set, *ends)
    assert cheap.arrived
    assert len(cheap.snaps) == 1
    assert cheap.snaps[0].landed
    assert cheap.snaps[0].released > 0.0
    assert cheap.cost == pytest.approx(cheap.length + 0.3, rel=1e-2)
    assert cheap.cost < free.cost
    assert dear.snaps == ()
    assert dear.cost == pytest.approx(free.cost, rel=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("price", [0.88, 0.92, 0.95, 1.2])
def test_a_price_on_snaps_makes_no_route_dearer(spring_set, price):
    """Routes that may snap are routes without a snap, too: 1.46 was the answer beside 1.37."""
    start, goal = (spring_set.at(x_l=0.8, F=0.0).stable[k] for k in (0, 1))
    with unchecked():
        for ends in ((start, goal), (goal, start)):
            free = plan(spring_set, *ends)
            assert plan(spring_set, *ends, snap_price=price).cost <= free.cost * (1 + 1e-12)


def state_over(eset, place, stable):
    """A stable state over a place."""
    return eset.at(**dict(zip(eset.names, place, strict=True))).stable[stable]


@pytest.mark.parametrize(
    ("name", "first", "second"),
    [
        ("spring", (0.491, -0.418), (1.155, 0.361)),
        ("spring", (0.612, -0.077), (1.128, -0.091)),
        ("spring", (0.515, 0.139), (1.105, 0.464)),
        ("arch", (0.879, 1.075), (1.409, -1.404)),
        ("arch", (1.416, -0.163), (0.343, 0.565)),
    ],
)
def test_routes_there_and_back_are_the_same(spring_set, arch_set, name, first, second):
    """The optimum does not depend on the direction: 0.36 and 0.2 % apart on the spring before.

    Way-points are equal; costs are sums over the steps of lifts, which differ beside folds.
    """
    eset = spring_set if name == "spring" else arch_set
    for which in (0, -1):
        start, goal = state_over(eset, first, which), state_over(eset, second, 0)
        with unchecked():
            there, back = plan(eset, start, goal), plan(eset, goal, start)
        assert there.arrived == back.arrived
        if there.arrived:
            assert back.cost == pytest.approx(there.cost, rel=1e-5)
            places = [np.array([list(step.values()) for step in each.way_points[:-1]])
                      for each in (there, back)]  # fmt: skip
            np.testing.assert_allclose(places[0], places[1][::-1], rtol=0, atol=1e-12)


@pytest.mark.parametrize("intervals", [(12, 12), pytest.param((19, 21), marks=pytest.mark.slow)])
def test_routes_over_a_snap_depend_on_no_direction_and_no_grid(intervals):
    """From δ = ∓0.6435 over a snap to ±0.6435: mirror images, 0.3596 by a search over all folds.

    The parameters go 5e-4 beyond the fold and back; 0.4956 and 0.5337 were the answers.
    """
    box = em.Box(x_l=(0.3, 1.3), F=(-0.5, 0.5))
    with unchecked():
        eset = em.equilibrium_set(em.Spring(), box, intervals=intervals, checks=0)
        start, goal = (eset.at(x_l=0.8, F=0.0).stable[k] for k in (0, 1))
        there, back = (plan(eset, *ends, snap_price=0.3) for ends in ((start, goal), (goal, start)))
    assert len(there.snaps) == len(back.snaps) == 1
    lengths = [route.cost - 0.3 for route in (there, back)]
    assert lengths == pytest.approx([0.3596 + 2 * 5e-4] * 2, rel=4e-3)


def test_sides_of_the_spring_are_joined_by_a_snap(short_spring_set):
    """x_l ≤ 0.95 parts the sides; over the fold F = (1 − x_l^⅔)^(3/2) one snaps to the other."""
    start, goal = (short_spring_set.at(x_l=0.8, F=0.0).stable[k] for k in (0, 1))
    with unchecked():
        route = plan(short_spring_set, start, goal, snap_price=1.0)
    assert route.arrived
    (snap,) = route.snaps
    x, force = snap.state["x_l"], snap.state["F"]
    assert abs(force) == pytest.approx((1 - x ** (2 / 3)) ** 1.5, rel=1e-6)
    np.testing.assert_allclose(route.path.states.z[-1], goal.z, rtol=0, atol=1e-7)
    assert route.schedule.margins.min() == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"snap_price": 0.0}, "`snap_price` must be positive and finite; got 0.0."),
        ({"snap_price": 1.0, "via": [{"Theta": 1.1}]}, "`via` must not be given with `snap_price`"),
    ],
)
def test_prices_without_meaning_are_input_errors(arch_set, ends, options, message):
    with pytest.raises(InputError, match=f"^{re.escape(message)}"):
        plan(arch_set, *ends, **options)


@pytest.fixture(scope="module")
def cornered(arch_set, ends):
    with unchecked():
        return plan(arch_set, *ends, margin=0.3)


def test_smoothed_route_stays_near_and_turns_slowly(arch_set, ends, cornered):
    with unchecked():
        smooth = smoothed(cornered, 0.05, margin=0.2)
        again = verify(smooth.schedule, margin=0.2)
    assert smooth.arrived
    assert again.verified
    corners = cornered.schedule.values[cornered.schedule.way_points, :2]
    values = smooth.schedule.values[:, :2]
    sides = np.diff(corners, axis=0)
    share = ((values[:, None] - corners[:-1]) * sides).sum(2) / (sides**2).sum(1)
    nearest = corners[:-1] + np.clip(share, 0, 1)[:, :, None] * sides
    assert np.linalg.norm(values[:, None] - nearest, axis=2).min(axis=1).max() <= 0.05 + 1e-6
    turns = [_largest_turn(route) for route in (cornered, smooth)]
    assert turns[1] < 0.5 * turns[0]
    np.testing.assert_allclose(smooth.path.states.z[-1], ends[1].z, rtol=0, atol=1e-6)


def _largest_turn(route: em.Route) -> float:
    """Angle between successive steps in the parameters."""
    steps = np.diff(route.schedule.values[:, :2], axis=0)
    steps /= np.linalg.norm(steps, axis=1)[:, None]
    return float(np.arccos(np.clip((steps[1:] * steps[:-1]).sum(1), -1, 1)).max())


def test_smoothing_that_is_not_allowed_is_refused(cornered):
    with unchecked():
        smooth = smoothed(cornered, 0.05, margin=cornered.margin * 1.5)
    assert smooth.status == "refused"
    assert "the margin falls to" in smooth.why


def test_only_routes_that_arrived_can_be_smoothed(cornered, arch_set, ends):
    refused = plan(arch_set, *ends, margin=50.0)
    with pytest.raises(InputError, match=r"^`route` must have arrived without a snap"):
        smoothed(refused, 0.1)
    with pytest.raises(InputError, match=r"^`tolerance` must be positive and finite; got -1"):
        smoothed(cornered, -1.0)


def test_efforts_are_limited_by_constraints(arch_set, ends):
    """The fastest route under a limit on a couple that the fastest of all exceeds."""
    arch, rates = arch_set.structure, em.Rates({"Theta": 0.2, "Delta": 0.2})
    effort = em.effort_of(arch, "Delta")
    with unchecked():
        fast = plan(arch_set, *ends, objective=rates, monitor=[effort])
        bound = 0.7 * np.abs(fast.schedule.descriptors["effort(Delta)"]).max()
        within = [effort <= bound, effort >= -bound]
        limited = plan(arch_set, *ends, objective=rates, within=within)
    assert bound > 0.04
    assert limited.arrived
    assert np.abs(limited.schedule.descriptors["effort(Delta)"]).max() <= bound + 1e-9
    assert limited.cost > fast.cost
