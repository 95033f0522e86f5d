"""Limit loads, heights, curvature and index of the default rod against shooting.

The package gives the limit load q; shooting (oracles/shooting.py) follows the loading path on its
own, from the unloaded arch to just below q, and ends it by its own condition: a singular Jacobian
of the shots, or max |κ| = 10.
"""

from dataclasses import dataclass, replace

import numpy as np
import pytest
from scipy.interpolate import BarycentricInterpolator
from scipy.optimize import brentq

import equimorph as em
from oracles import shooting
from typecheck import unchecked

CAP = 10.0
STEPS = (0.2, 0.4, 0.6, 0.8, 0.9, 0.96, 0.99)
"""Shares of the limit load at which shooting stops on its way."""
BESIDE = np.array([0.996, 0.998, 0.999, 0.9995, 1.0005, 1.001, 1.002, 1.004])
"""Shares of the load of a branch point at which det J is taken."""
HALFWAY = 2
"""The step at which states are compared."""
BEND = 0.2
"""Largest correction of a step relative to its length."""
HEIGHTS = (1 / 3, 0.46, 2 / 3)


@pytest.fixture(scope="module", autouse=True)
def _fast():
    with unchecked():
        yield


def waves(generator):
    """Q = 1 + a cos(ks + b), smooth and of both signs, as the package and the oracle take it."""
    a, k, b = generator.uniform((-1.5, 2.0, 0.0), (1.5, 12.0, 6.0))
    return (
        lambda s: 1.0 + a * np.cos(k * s + b),
        shooting.Load(lambda s: s + a / k * (np.sin(k * s + b) - np.sin(b))),
    )


def ramps(generator):
    """Two linear pieces with a jump between them."""
    at = generator.uniform(0.2, 0.8)
    q = generator.uniform(-0.5, 2.5, 4)
    left = 0.5 * (q[0] + q[1]) * at

    def rho(s):
        if s <= at:
            return q[0] * s + 0.5 * (q[1] - q[0]) * s * s / at
        t = s - at
        return left + q[2] * t + 0.5 * (q[3] - q[2]) * t * t / (1.0 - at)

    table = [[0.0, q[0]], [at, q[1]], [at, q[2]], [1.0, q[3]]]
    return table, shooting.Load(rho, (0.0, at, 1.0))


LOADS = (
    lambda _: ("uniform", shooting.UNIFORM),
    lambda _: ("left-half", shooting.LEFT_HALF),
    ramps,
    waves,
)


@dataclass(frozen=True)
class Errors:
    """Differences of the package from shooting."""

    limit: float
    height: float
    curvature: float


def followed(start, limit):
    """Rods that shooting meets on its way along the path, each guessed by the tangent before."""
    rods = [start]
    for share in STEPS:
        rods.append(stepped(rods[-1], share * limit))
    return rods


def stepped(rod, q, halvings=14):
    """The rod at another load, guessed by the tangent; in two steps where it bends away from it.

    A longer step may change to a neighbouring branch.
    """
    slope = -np.linalg.solve(rod.jacobian[:, :3], rod.jacobian[:, 3])
    way = slope * (q - rod.q)
    guess = replace(rod, q=q, w=rod.w + way)
    try:
        found = guess.solved()
    except RuntimeError:
        found = None
    straight = found and np.linalg.norm(found.w - guess.w) < BEND * np.linalg.norm(way) + 1e-9
    if straight and found.determinant * rod.determinant > 0.0:
        return found
    assert halvings > 0, "shooting finds no regular path to the limit load"
    return stepped(stepped(rod, 0.5 * (rod.q + q), halvings - 1), q, halvings - 1)


def fold_ahead(rods, limit):
    """The fold, sought where w = w₀ + c √(limit − q) through the last two rods leads."""
    before, last = rods[-2:]
    far, near = np.sqrt(limit - before.q), np.sqrt(limit - last.q)
    guess = last.w + (last.w - before.w) * near / (far - near)
    return shooting.fold(replace(last, q=limit, w=guess))


def branch_point_ahead(rods, limit):
    """Where det J, interpolated across the point where nothing can be solved, vanishes."""
    for at in BESIDE * limit:
        known = rods[-4:]
        path = BarycentricInterpolator([rod.q for rod in known], [rod.w for rod in known])
        rods = [*rods, replace(rods[-1], q=at, w=path(at)).solved()]
    across = BarycentricInterpolator(BESIDE - 1.0, [r.determinant for r in rods[-len(BESIDE) :]])
    return replace(rods[-1], q=limit + limit * brentq(across, -0.004, 0.004, xtol=1e-14))


def cap_ahead(rods, limit):
    """Where max |κ| = 10."""
    last = rods[-1]

    def excess(q):
        return replace(last, q=q).solved().max_curvature() - CAP

    q = brentq(excess, last.q, last.q + 2.0 * (limit - last.q), xtol=1e-13, rtol=1e-14)
    return replace(last, q=q)


AHEAD = {"fold": fold_ahead, "branch point": branch_point_ahead, "constraint": cap_ahead}


def draw(number, generator):
    """A rod at rest, and its load as the oracle takes it."""
    load, oracle = LOADS[number % len(LOADS)](generator)
    rod = em.Rod(load)
    while True:
        Theta, Delta = generator.uniform((0.3, -1.2), (2.0, 1.2))
        rest = rod.natural_state(Theta=Theta, Delta=0.0 if number % 20 == 0 else Delta)
        if rod.max_curvature(rest) < CAP:
            return rod, rest, oracle


def compare(rod, rest, oracle):
    """Errors of one random setting, and how its path ends."""
    limit = em.limit_load(rest, "q", within=[rod.max_curvature <= CAP])
    start = shooting.from_package(rest, oracle).solved()
    rods = followed(start, limit.value)
    exact = AHEAD[limit.kind](rods, limit.value)
    middle = rods[HALFWAY + 1]
    end = em.lift(rest, {"q": middle.q}).end
    assert end.kind == "arrived"
    assert end.state.index == middle.index() == 0
    heights = [abs(rod.height(s)(end.state) - middle.height(s)) for s in HEIGHTS]
    curvature = abs(rod.max_curvature(end.state) - middle.max_curvature())
    return limit.kind, Errors(abs(limit.value - exact.q), max(heights), curvature)


def check(settings, seed, first=0):
    generator, kinds = np.random.default_rng(seed), set()
    drawn = [draw(number, generator) for number in range(first + settings)]
    for number, setting in enumerate(drawn[first:], first):
        kind, errors = compare(*setting)
        kinds.add(kind)
        assert max(errors.limit, errors.height, errors.curvature) < 1e-8, (number, kind, errors)
    return kinds


def test_limit_loads_heights_and_curvature_are_exact_to_1e_8():
    """Three settings; the slow test takes a hundred."""
    assert check(3, seed=11) >= {"fold", "constraint", "branch point"}


@pytest.mark.slow
@pytest.mark.parametrize("first", [0, 25, 50, 75])
def test_limit_loads_heights_and_curvature_are_exact_to_1e_8_in_a_hundred_settings(first):
    """Issue 3. Errors of 1e-12 are usual: loading paths from the natural state bend little."""
    ends = {"fold", "constraint", "branch point"}
    assert check(25, 12, first) == (ends - {"branch point"} if first == 25 else ends)
