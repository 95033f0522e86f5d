"""Maps of the article against single paths at finer steps, and all their jumps on their curves."""

from functools import cache

import numpy as np
import pytest

import equimorph as em
from equimorph.equilibria import settle
from equimorph.paper import arch_maps
from equimorph.tasks.maps.curvature import FirstStablePaths
from typecheck import unchecked

LOADS = ("uniform", "left-half")
COARSE = {"Theta": (0.25, 1.45, 8), "Delta": (-1.3, 1.25, 11)}
COARSER = {"Theta": (0.25, 1.45, 5), "Delta": (-1.3, 1.25, 7)}
FINER = em.TraceOptions(first_step=0.0125, largest_step=0.1, turning=0.1, steps=20000)
ROUNDS = 16
"""Halvings of an edge: a cliff like Δ^⅔ is then lower than 1e-3 of its height on the edge."""
SEED = 20250916
BESIDE_CUSPS = 1e-5
"""Folds 1e-6 beside a cusp are 1e-9 apart in the load, which paths step over: 5.2e-6 at worst."""
BESIDE_GAPS = 5e-4
"""At the rims of gaps and barriers paths and curves differ by 2.7e-4 at worst, 1.4 % of an edge."""


@cache
def load_map(load, full):
    rod = em.Rod(load)
    grid = em.Grid(**(arch_maps.GRID if full else COARSE))
    with unchecked():
        return em.limit_load_map(rod, grid, "q", within=[rod.max_curvature <= 10])


@cache
def curvature_map(load, full):
    grid = em.Grid(**(arch_maps.GRID if full else COARSER))
    with unchecked():
        return em.curvature_map(em.Rod(load), grid, "q", arch_maps.LOAD)


def settings_of(amap, count):
    """Vertices of a map that have a value, drawn at random."""
    known = np.argwhere(np.isfinite(amap.value))
    drawn = np.random.default_rng(SEED).choice(len(known), size=count, replace=False)
    axes = amap.grid.axes()
    return [(axes[0][i], axes[1][j], amap.value[i, j]) for i, j in known[drawn]]


def check_limit_loads(amap, count):
    rod = amap.structure
    for theta, delta, expected in settings_of(amap, count):
        rest = rod.natural_state(Theta=theta, Delta=delta)
        found = em.limit_load(rest, "q", within=amap.within, options=FINER)
        np.testing.assert_allclose(found.value, expected, rtol=1e-8, err_msg=f"{theta}, {delta}")


def first_stable(rest, at):
    """First stable state at a load on the path from rest, followed through folds in both ways."""
    state, bound = rest, 40.0
    for _ in range(8):
        path = em.lift(state, {"q": bound}, through_folds=True, options=FINER)
        states, q = path.states, path.states["q"]
        for k in np.flatnonzero((q[:-1] - at) * (q[1:] - at) <= 0.0):
            share = (at - q[k]) / (q[k + 1] - q[k])
            p = states.p[k] + share * (states.p[k + 1] - states.p[k])
            near = settle(
                rest.structure,
                (states.z[k] + share * (states.z[k + 1] - states.z[k]))[None],
                p[None],
            )
            there = em.States(rest.structure, near.z, p[None])
            assert near.found[0]
            if there.index[0] == 0:
                return there[0]
        assert path.end.kind == "returned", path.end
        state, bound = path.end.state, -bound
    raise AssertionError("the path leads to no stable state")


def check_curvatures(amap, count):
    for theta, delta, expected in settings_of(amap, count):
        rest = amap.rest({"Theta": theta, "Delta": delta})  # rays from the straight rod may fold
        found = amap.structure.max_curvature(first_stable(rest, amap.at))
        np.testing.assert_allclose(found, expected, rtol=1e-7, err_msg=f"{theta}, {delta}")


def jumps(amap, values_at):
    """Places on grid lines where a map jumps or ends, and the edges around them after halving."""
    value = np.where(np.isfinite(amap.value), amap.value, -100.0)
    span, axes = np.ptp(amap.value[np.isfinite(amap.value)]), amap.grid.axes()
    edges = []
    for axis in (0, 1):
        step = np.abs(np.diff(np.moveaxis(value, axis, 0), axis=0))
        around = np.pad(step, ((1, 1), (0, 0)))
        usual = np.maximum(around[:-2], around[2:])
        for k, other in np.argwhere((step > 2.0 * usual) | (step > 0.1 * span)):
            ends = [(k, other), (k + 1, other)] if axis == 0 else [(other, k), (other, k + 1)]
            edges.append([[axes[0][i], axes[1][j]] for i, j in ends])
    low, high = np.moveaxis(np.array(edges), 1, 0)
    left, right = values_at(low), values_at(high)
    for _ in range(ROUNDS):
        middle = 0.5 * (low + high)
        here = values_at(middle)
        first = np.abs(here - left) > np.abs(right - here)
        low, high = np.where(first[:, None], low, middle), np.where(first[:, None], middle, high)
        left, right = np.where(first, left, here), np.where(first, here, right)
    real = np.abs(right - left) > 1e-2 * span
    return 0.5 * (low + high)[real], np.abs(high - low).sum(axis=1)[real]


def check_jumps(amap, evaluate, slack):
    def values_at(settings):
        found = evaluate(settings)
        return np.where(np.isfinite(found), found, -100.0)

    places, room = jumps(amap, values_at)
    assert len(places) > 10
    points = np.concatenate([curve.points for curve in amap.curves])
    errors = np.concatenate([curve.errors for curve in amap.curves])
    distance = np.abs(places[:, None] - points).sum(axis=2) - errors
    worst = distance.min(axis=1) - room
    at = int(worst.argmax())
    assert worst[at] <= slack, f"a jump at {places[at]} is {worst[at]:.2g} away from all curves"


def passages_of(amap):
    """Values of a curvature map at any settings."""
    options = em.TraceOptions(record=False, through_folds=True, through_branch_points=True)
    place = [each.name for each in amap.structure.parameters].index(amap.load)
    paths = FirstStablePaths(
        amap.sheet, place, amap.within, amap.bound, options, amap.at, amap.descriptor
    )
    return lambda settings: paths(settings).value


def test_limit_loads_at_random_settings_are_those_of_single_paths():
    """Five settings, steps five times shorter, each natural state made anew."""
    check_limit_loads(load_map("left-half", full=False), 5)


def test_curvatures_at_random_settings_are_those_of_single_paths():
    """Five settings; the path is searched for its first stable state here."""
    check_curvatures(curvature_map("left-half", full=False), 5)


def test_limit_loads_jump_on_curves_only():
    amap = load_map("left-half", full=False)
    check_jumps(amap, amap.rays, BESIDE_CUSPS)


@pytest.mark.slow
@pytest.mark.parametrize("load", LOADS)
def test_limit_loads_of_the_article_at_fifty_settings(load):
    check_limit_loads(load_map(load, full=True), 50)


@pytest.mark.slow
@pytest.mark.parametrize("load", LOADS)
def test_curvatures_of_the_article_at_fifty_settings(load):
    check_curvatures(curvature_map(load, full=True), 50)


@pytest.mark.slow
@pytest.mark.parametrize("load", LOADS)
def test_limit_loads_of_the_article_jump_on_curves_only(load):
    amap = load_map(load, full=True)
    check_jumps(amap, amap.rays, BESIDE_CUSPS)


@pytest.mark.slow
@pytest.mark.parametrize("load", LOADS)
def test_curvatures_of_the_article_jump_on_curves_only(load):
    amap = curvature_map(load, full=True)
    check_jumps(amap, passages_of(amap), BESIDE_GAPS)
