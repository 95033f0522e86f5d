"""What lies between the rows of schedules: polynomial structures, judged at 10 000 points a leg.

Over x the share of a straight leg is t = −E'(x; row)/(E'(x; next) − E'(x; row)): exact, and
monotone as long as the leg keeps a stable state.
"""

from itertools import pairwise

import numpy as np
import pytest
from numpy.polynomial import Polynomial

import equimorph as em
from equimorph.structures import State
from oracles.sextics import folds_at, random_energy, set_of, structure_of

POINTS = 10_001


def least_of(energy, rows, x):
    """Least E'' along the straight legs between rows; −∞ where a leg has no state of the branch."""
    force = [Polynomial(each).deriv() for each in energy]
    least = np.inf
    for (here, there), ends in zip(pairwise(rows), pairwise(x), strict=True):
        if np.array_equal(here, there):
            continue
        along = np.linspace(*ends, POINTS)
        f, a, b = (each(along) for each in force)
        begin, rate = f + here[0] * a + here[1] * b, np.array([a, b]).T @ (there - here)
        share = -begin / rate
        share[[0, -1]] = 0.0, 1.0
        if not (np.diff(share) > -1e-7).all():
            return -np.inf
        p = here + share[:, None] * (there - here)
        stiff = [each.deriv()(along) for each in force]
        least = min(least, (stiff[0] + p[:, 0] * stiff[1] + p[:, 1] * stiff[2]).min())
    return least


def grazing_motions(seed):
    """Motions x(t), r(t) of one structure that touch its folds but for 1e-4 to 1e-2, or end there.

    Beside a fold the actuator p(t) runs along the curve of folds, which bends to one of its sides.
    """
    energy, draw = random_energy(seed), np.random.default_rng(seed)
    force = [Polynomial(each).deriv() for each in energy]
    structure = structure_of(energy)
    for _ in range(10):
        x = draw.uniform(-2.0, 2.0)
        fold, step = folds_at(energy, x), 1e-5
        slope = (folds_at(energy, x + step)[1] - folds_at(energy, x - step)[1]) / (2.0 * step)
        way = draw.uniform(0.05, 0.8) * draw.choice([-1, 1])
        ends = np.array([x - way, x + way * draw.choice([0.0, draw.uniform(0.1, 1.0)])])
        r = fold[1] + draw.choice([-1, 1]) * 10.0 ** draw.uniform(-4, -2) + slope * (ends - x)
        if np.abs(fold).max() > 3.0 or abs(slope) > 4.0:
            continue
        p = -(force[0](ends[0]) + r[0] * force[2](ends[0])) / force[1](ends[0])
        start = State(structure, ends[:1], np.array([p, r[0]]))
        if start.index == 0 and abs(p) < 3.9 and start.margin > 1e-6:
            yield energy, start, {structure.descriptor("x"): ends[1], "r": r[1]}


@pytest.mark.parametrize("first", [0, pytest.param(12, marks=pytest.mark.slow)])
def test_schedules_of_motions_that_graze_folds_are_stable_between_their_rows(first):
    arrived = 0
    for seed in range(first, 12 + 4 * first):
        for energy, start, leg in grazing_motions(seed):
            found = em.track(start, leg, actuators={"p": (-4.0, 4.0)})
            if found.schedule is None:
                continue
            arrived += 1
            least = least_of(energy, found.schedule.values, found.states.z[:, 0])
            assert least > 0.0, seed
            assert found.margin == pytest.approx(least, abs=1e-8), seed
            assert np.isfinite(list(found.between.values())).all()
    assert arrived > first // 3


def test_what_no_rows_keep_stable_is_refused_with_its_place():
    """E = x³/3 + r x + (r − r³/2 …): the motion ends on a fold, to which p leads from outside."""
    energy = np.zeros((3, 5))
    energy[0, 4], energy[0, 2] = 0.25, -0.5
    energy[1, 1], energy[2, 2] = 1.0, 0.5
    structure = structure_of(energy)
    # E' = x³ − (1 − r) x + p: folds at x² = (1 − r)/3
    x, r = np.array([1.2, np.sqrt(1.0 / 3.0) + 1e-8]), np.array([0.9, 0.0])
    start = State(structure, x[:1], np.array([-(x[0] ** 3) + (1.0 - r[0]) * x[0], r[0]]))
    found = em.track(start, {structure.descriptor("x"): x[1], "r": r[1]}, actuators=["p"])
    assert (found.status, found.failure, found.schedule) == ("refused", "straight lines", None)
    assert found.why.startswith("parameters that move straight on lose stability behind p = ")
    assert found.last_good == pytest.approx(1.0, abs=1e-3)


@pytest.mark.parametrize("seed", [0, 2])
def test_margins_of_routes_are_the_least_on_the_way(seed):
    energy = random_energy(seed)
    eset, draw = set_of(energy), np.random.default_rng(seed)
    stable, arrived = np.flatnonzero(eset.points.index == 0), 0
    for _ in range(6):
        ends = [eset.points[int(k)] for k in draw.choice(stable, 2)]
        route = em.plan(eset, *ends)
        if route.arrived:
            least = least_of(energy, route.schedule.values, route.states.z[:, 0])
            assert route.margin == pytest.approx(least, abs=1e-8)
            checked = em.verify(route.schedule, ends[0], margin=max(least - 1e-7, 0.0))
            assert checked.verified
            assert checked.margin == pytest.approx(least, abs=1e-8)
            assert not em.verify(route.schedule, ends[0], margin=least + 1e-7).verified
            arrived += 1
    assert arrived


def test_targets_that_hold_but_for_round_off_are_no_raw_error():
    spring = em.Spring()
    start = em.lift(spring.natural_state(x_l=0.8), {"F": 0.02}).end.state
    angle = spring.descriptor("angle")
    found = em.track(start, {angle: np.nextafter(angle(start), 1.0)}, actuators=["x_l"])
    assert found.failure in ("", "lost")
    assert found.margin == pytest.approx(start.margin)
