"""Are all equilibria found, with the right index? Judged by multiple shooting, and more effort.

Parameters are random in the box of the design, Θ in 0.2 ... 2.5, |Δ| ≤ 2, and every other time in
its part with many equilibria, Θ ≤ 1.2, |Δ| ≤ 0.8; 0 ≤ q ≤ 6. Loads take turns: uniform, left half,
and a table with a step, which has no symmetry.
"""

from functools import cache

import numpy as np
import pytest

import equimorph as em
from oracles.shots import LEFT_HALF, SPAN, UNIFORM, Shots, all_equilibria, from_states

STEPPED = ((0.0, 0.5), (0.3, 2.0), (0.3, 1.0), (1.0, 0.5))
LOADS = (
    ("uniform", UNIFORM),
    ("left-half", LEFT_HALF),
    ([list(row) for row in STEPPED], STEPPED),
)
POINTS, FAST = 100, (0, 2, 3, 4, 5)
ORACLE_STARTS = 1000
CAP = 20.0
SAME = 1e-6
"""Relative difference of the forces of two solutions that are the same, both solved by shooting."""


def _points() -> list[tuple[int, float, float, float]]:
    generator = np.random.default_rng(2026)
    points = []
    for number in range(POINTS):
        largest, wide = ((2.5, 2.0), (1.2, 0.8))[number % 2]
        point = generator.uniform([0.2, -wide, 0.0], [largest, wide, 6.0])
        points.append((number % len(LOADS), *point.tolist()))
    return points


def _cases() -> list:
    slow = [pytest.mark.slow]
    return [
        pytest.param(i, *point, marks=[] if i in FAST else slow, id=str(i))
        for i, point in enumerate(_points())
    ]


@cache
def _rod(load: int) -> em.Rod:
    return em.Rod(LOADS[load][0])


def _solved(states: em.States, load: int) -> Shots:
    """The states of the package, solved again by shooting."""
    shots, found = from_states(states, LOADS[load][1]).solved()
    assert found.all()
    return shots


def _absent(wanted: Shots, known: Shots) -> np.ndarray:
    """Which of the wanted solutions are not among the known ones."""
    size = 1.0 + np.abs(wanted.forces).max(axis=1, initial=0.0)
    gap = np.abs(wanted.forces[:, None] - known.forces[None]).max(axis=2)
    return gap.min(axis=1, initial=np.inf) > SAME * size


@pytest.mark.parametrize(("number", "load", "Theta", "Delta", "q"), _cases())
def test_no_equilibrium_is_missing_and_every_index_is_right(number, load, Theta, Delta, q):
    """Neither shooting nor ten times the effort knows another one with max |κ| ≤ 20.

    Where max |κ| is within 1e-3 of 20 either answer is right. The index is the number of conjugate
    points of the same rod, solved by shooting.
    """
    rod, at = _rod(load), {"Theta": Theta, "Delta": Delta, "q": q}
    wide = [rod.max_curvature <= CAP + 1e-3]
    found = em.find_equilibria(rod, at, within=wide, seed=number)
    known = _solved(found, load)
    # no state is an artefact of the discretisation, none is listed twice
    assert known.forces == pytest.approx(found.multipliers, abs=1e-3)
    gap = np.abs(known.forces[:, None] - known.forces[None]).max(axis=2)
    assert (gap + np.eye(len(gap)) > SAME).all()
    assert np.array_equal(known.index(), found.index)

    shooting = all_equilibria(LOADS[load][1], (Theta, Delta, q, SPAN), ORACLE_STARTS, number)
    shooting = shooting.take(shooting.max_curvature() <= CAP)
    assert not _absent(shooting, known).any()

    narrow = [rod.max_curvature <= CAP]
    effort = em.find_equilibria(rod, at, within=narrow, starts=2000, seed=1000 + number)
    assert not _absent(_solved(effort, load), known).any()


def test_the_oracle_knows_the_circular_arc():
    """Θ = 1, no load: κ = −2, no forces, stable [PHYSICS §3]; heights of a circle of radius ½."""
    arc = all_equilibria(UNIFORM, (1.0, 0.0, 0.0, SPAN), 200, 0)
    arc = arc.take(np.abs(arc.forces).max(axis=1) < 1e-9)
    assert len(arc) == 1
    assert arc.index().tolist() == [0]
    assert arc.max_curvature() == pytest.approx(2.0, abs=1e-11)
    s = np.arange(1, 7) / 6.0
    assert arc.heights()[0] == pytest.approx(0.5 * (np.cos(1 - 2 * s) - np.cos(1)), abs=1e-12)


def test_the_oracle_knows_the_five_states_of_the_arch():
    """Uniform load, q = 2.5, (Θ, Δ) = (1, 0): indices 0, 0, 1, 1, 2 with max |κ| ≤ 20."""
    arch = all_equilibria(UNIFORM, (1.0, 0.0, 2.5, SPAN), 600, 0)
    arch = arch.take(arch.max_curvature() <= CAP)
    assert sorted(arch.index()) == [0, 0, 1, 1, 2]
    rise = arch.heights()[arch.index() == 0, 2]
    assert sorted(rise) == pytest.approx([-0.1496, 0.2258], abs=1e-4)
