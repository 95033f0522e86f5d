"""Alternative routes around discs of a plane, against closed forms."""

from itertools import combinations

import numpy as np
import pytest

import equimorph as em
from oracles.polynomial import Polynomial
from oracles.taut_strings import taut_strings
from typecheck import unchecked

PLANE = Polynomial(lambda x, a, b: x**2 * 0.5 + a * 0.0 + b * 0.0, 1, ("a", "b"))
"""Stable with x = 0 everywhere: lengths are those in the plane of the parameters."""


@pytest.fixture(scope="module")
def plane():
    with unchecked():
        box = em.Box(a=(-1.0, 1.0), b=(-1.0, 1.0))
        return em.equilibrium_set(PLANE, box, intervals=(16, 16), checks=0)


def outside(middle, radius, name="squared"):
    squared = em.Descriptor(
        name, "1", lambda z, p: ((p[:, :2] - middle) ** 2).sum(axis=1), "s", PLANE.signature
    )
    return squared >= radius**2


def ways_around(first, last, radius):
    """Lengths of the shortest ways on both sides of a disc about the origin."""
    size = np.hypot(*first), np.hypot(*last)
    turn = (np.arctan2(last[1], last[0]) - np.arctan2(first[1], first[0])) % (2.0 * np.pi)
    free = sum(np.arccos(radius / each) for each in size)
    tangents = sum(np.sqrt(each**2 - radius**2) for each in size)
    straight = np.linalg.norm(np.subtract(first, last))
    return sorted(
        tangents + radius * (each - free) if each > free else straight
        for each in (turn, 2.0 * np.pi - turn)
    )


SEEDS = [(0, 1), (1, 1), (2, 1), (14, 1), (21, 1), (27, 1), (30, 1), (33, 1), (7, -1), (18, -1)]


@pytest.mark.parametrize(("seed", "side"), SEEDS)
def test_both_ways_around_a_disc_are_found(plane, seed, side):
    """In 0, 1 and 14 the straight way is free: it was taken for a class beside its own.

    In the mirror images of 7 and 18 a way that passes the disc more than once came second: over the
    mesh it is the shorter one.
    """
    rng = np.random.default_rng(seed)
    middle, radius = rng.uniform(-0.2, 0.2, 2), rng.uniform(0.15, 0.45)
    ends = rng.uniform(-0.95, 0.95, (40, 2, 2))
    away = np.linalg.norm(ends - middle, axis=2)
    close = (away[:, 0] < radius + 0.15) | (seed % 2 == 0)
    first, last = ends[np.argmax((away.min(axis=1) > radius + 0.03) & close)] * (side, 1.0)
    middle *= (side, 1.0)
    start, goal = (PLANE.state(0.0, a=float(a), b=float(b)) for a, b in (first, last))
    wanted = ways_around(first - middle, last - middle, radius)
    for count in (1, 2, 4):
        with unchecked():
            found = em.alternatives(plane, start, goal, count, within=[outside(middle, radius)])
            back = em.alternatives(plane, goal, start, count, within=[outside(middle, radius)])
        lengths = [route.length for route in found if route.arrived]
        assert lengths[:2] == pytest.approx(wanted[:count], rel=1e-2)
        assert lengths == pytest.approx([route.length for route in back], rel=1e-3)
        assert lengths[0] >= wanted[0] * (1.0 - 1e-9)
        # further ones pass around the disc more than once
        assert all(each > wanted[1] for each in lengths[2:])


@pytest.mark.parametrize("radius", [0.27, 0.298])
def test_a_slit_between_vertices_is_not_overlooked(plane, radius):
    """The gap between two discs is narrower than a cell: only the straight way leads through."""
    start, goal = PLANE.state(0.0, a=0.07, b=-0.9), PLANE.state(0.0, a=0.07, b=0.9)
    walls = [outside(np.array([-0.23, 0.0]), radius), outside(np.array([0.37, 0.0]), radius)]
    with unchecked():
        found = em.alternatives(plane, start, goal, 3, within=walls)
    assert found[0].length == pytest.approx(1.8, rel=1e-3)
    assert len(found) == 3
    assert found[1].length > 1.9


def discs_apart(rng, count):
    """Discs with gaps of two cells between them, and two points outside."""
    while True:
        discs = [(rng.uniform(-0.6, 0.6, 2), rng.uniform(0.12, 0.35)) for _ in range(count)]
        inside = all(np.abs(middle).max() + radius < 0.95 for middle, radius in discs)
        apart = all(
            np.linalg.norm(a[0] - b[0]) > a[1] + b[1] + 0.25 for a, b in combinations(discs, 2)
        )
        if inside and apart:
            break
    while True:
        ends = rng.uniform(-0.95, 0.95, (2, 2))
        free = all((np.linalg.norm(ends - m, axis=1) > r + 0.03).all() for m, r in discs)
        if free and np.linalg.norm(ends[0] - ends[1]) > 0.7:
            return discs, ends


@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize("seed", [4, 0, 6])
def test_the_best_three_ways_around_several_discs_are_taut_strings(plane, seed, side):
    """In 4 the third one was 3 % too long, but not in its mirror image.

    Along one diagonal of the grid ways over edges are 41 % too long, whatever the grid, so that
    classes came in another order.
    """
    rng = np.random.default_rng(seed)
    discs, ends = discs_apart(rng, int(rng.integers(2, 4)))
    wanted = taut_strings(*ends, discs, 4.5)[:3]
    mirror = np.array([side, 1.0])
    start, goal = (PLANE.state(0.0, a=float(a), b=float(b)) for a, b in ends * mirror)
    walls = [outside(m * mirror, r, f"{k} {side}") for k, (m, r) in enumerate(discs)]
    with unchecked():
        found = em.alternatives(plane, start, goal, 3, within=walls)
    lengths = [route.length for route in found if route.arrived]
    assert lengths == pytest.approx(wanted, rel=5e-3)
    assert (np.array(lengths) >= np.array(wanted) * (1.0 - 1e-9)).all()
