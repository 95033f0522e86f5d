"""Worst cases over boxes, against dense scans of sheets in closed form."""

from itertools import product

import numpy as np
import pytest

import equimorph as em
from equimorph.equilibria.box_peaks import BoxPeaks
from oracles.polynomial import Polynomial
from oracles.surfaces import integral
from typecheck import unchecked


def random_sheet(rng, k):
    """Structure x³ + x = g(p) with a random polynomial g, and its only state x(p)."""
    powers = [e for e in product(range(5), repeat=k) if 0 < sum(e) <= 4]
    factors = rng.normal(size=len(powers)) / (1.0 + np.array([sum(e) for e in powers]))

    def right(*q):
        return sum(
            f * np.prod([x**e for x, e in zip(q, power, strict=True)], axis=0)
            for f, power in zip(factors, powers, strict=True)
        )

    def energy(x, *q):
        force = x**3 + x
        for factor, power in zip(factors, powers, strict=True):
            term = None
            for each, e in zip(q, power, strict=True):
                if e:
                    term = each**e if term is None else term * each**e
            force = force - term * factor
        return integral(force)

    def state(*q):
        half = 0.5 * right(*q)
        root = np.sqrt(half**2 + 1.0 / 27.0)
        return np.cbrt(half + root) + np.cbrt(half - root)

    return Polynomial(energy, 1, ("a", "b", "c")[:k]), state


def scan(k, count):
    axes = np.meshgrid(*[np.linspace(-1.0, 1.0, count)] * k, indexing="ij")
    return np.stack([each.ravel() for each in axes])


def squared(structure, target):
    return em.Descriptor(
        "squared", "1", lambda z, p: (z[:, 0] - target) ** 2, "s", structure.signature
    )


@pytest.mark.parametrize("seed", range(9))
def test_no_dense_scan_finds_a_worse_one(seed):
    rng = np.random.default_rng(seed)
    k = 1 + seed % 3
    structure, state = random_sheet(rng, k)
    centres, sizes = rng.uniform(-0.5, 0.5, (5, k)), rng.uniform(0.05, 0.8, k)
    target = float(state(*(centres[0] + 0.5 * sizes * rng.uniform(-1.0, 1.0, k))))
    own = squared(structure, target)
    mesh = scan(k, {1: 2001, 2: 101, 3: 31}[k])
    offsets = dict(zip(("a", "b", "c")[:k], sizes.tolist(), strict=True))
    for sense, sign in (("max", 1.0), ("min", -1.0)):
        with unchecked():
            worst = em.worst_over(structure, own, offsets, sense)
            found = sign * worst.function(state(*centres.T)[:, None], centres)
        for centre, value in zip(centres, found, strict=True):
            q = centre[:, None] + sizes[:, None] * mesh
            scanned = sign * (state(*q) - target) ** 2
            spread = np.ptp(scanned)
            assert scanned.max() - 1e-6 * spread <= value <= scanned.max() + 0.02 * spread


def test_a_square_about_a_target_within_the_box_is_guaranteed_nothing():
    """Where the box reaches the target the least square is 0; the best box does not reach it."""
    rng = np.random.default_rng(100)
    structure, state = random_sheet(rng, 1)
    with unchecked():
        eset = em.equilibrium_set(structure, em.Box(a=(-1.0, 1.0)), intervals=(24,), checks=0)
        own, size = squared(structure, float(state(0.1))), 0.3
        inside = em.worst_over(structure, own, {"a": size}, "min")
        assert inside(eset.at(a=0.0).stable[0]) == pytest.approx(0.0, abs=1e-12)
        found = em.robust_optimum(eset, own, {"a": size}, sense="max")
    box = size * np.linspace(-1.0, 1.0, 2001)
    best = max(((state(a + box) - state(0.1)) ** 2).min() for a in np.linspace(-1.0, 1.0, 401))
    assert (found.status, found.guaranteed) == ("found", pytest.approx(best, abs=1e-5))


def random_robust_question(seed, k):
    """A random sheet, and a square about a target with a box of errors, in turn min and max."""
    rng = np.random.default_rng(1000 + seed)
    structure, state = random_sheet(rng, k)
    target, sizes = float(state(*rng.uniform(-0.7, 0.7, k))), rng.uniform(0.1, 0.5, k)
    with unchecked():
        box = em.Box(**dict.fromkeys(("a", "b")[:k], (-1.0, 1.0)))
        intervals = {1: (24,), 2: (12, 12)}[k]
        eset = em.equilibrium_set(structure, box, intervals=intervals, checks=0)
    offsets = dict(zip(("a", "b")[:k], sizes.tolist(), strict=True))
    sense, sign = (("min", 1.0), ("max", -1.0))[seed % 2]
    own = squared(structure, target)

    def worst(points, count):
        """Worst case at each of some points, by a scan of its box."""
        mesh = points[:, :, None] + sizes[:, None] * scan(k, count)
        return (sign * (state(*mesh.swapaxes(0, 1)) - target) ** 2).max(axis=1)

    return eset, own, offsets, (sense, sign), worst


@pytest.mark.parametrize(
    ("seed", "k"),
    [
        (115, 1),
        (116, 1),
        (109, 1),
        (3, 2),
        *(pytest.param(*each, marks=pytest.mark.slow) for each in [(118, 1), (102, 1), (8, 2)]),
    ],
)
def test_no_state_of_a_scan_is_better_in_its_worst_case(seed, k):
    """In 118 and 8 the worst case dips between two vertices that are on a plateau."""
    eset, own, offsets, (sense, sign), worst = random_robust_question(seed, k)
    with unchecked():
        found = em.robust_optimum(eset, own, offsets, sense=sense)
    scanned = worst(scan(k, {1: 801, 2: 61}[k]).T, {1: 401, 2: 21}[k])
    assert found.status == "found"
    assert sign * found.guaranteed <= scanned.min() + 3e-4 * abs(scanned.min())
    # what is guaranteed is the worst case there, and so is what the nominal state risks
    for state, value in ((found.state, found.guaranteed), (found.nominal.state, found.at_risk)):
        here = worst(state.p[None, :k], {1: 20001, 2: 401}[k])[0]
        assert here <= sign * value + 1e-9
        assert sign * value <= here + 1e-3 * max(abs(here), 1e-3)


@pytest.mark.parametrize("seed", range(6))
def test_the_first_search_knows_the_corners_alone(seed):
    """With no lattice the worst case is the largest value of middle and corners, as in `scan`."""
    rng = np.random.default_rng(seed)
    k = 1 + seed % 3
    structure, state = random_sheet(rng, k)
    own, sizes = squared(structure, 0.3), rng.uniform(0.1, 0.5, k)
    places, centres = np.arange(k), rng.uniform(-0.5, 0.5, (4, k))
    q = centres[:, :, None] + sizes[:, None] * np.hstack([np.zeros((k, 1)), scan(k, 2)])
    expected = (state(*q.swapaxes(0, 1)) - 0.3) ** 2
    with unchecked():
        box = BoxPeaks(structure, own, places, sizes, 1.0, 0)
        values, offsets = box.over(state(*centres.T)[:, None], centres)
    assert values == pytest.approx(expected, abs=1e-10)
    assert centres[:, :, None] + sizes[:, None] * offsets.swapaxes(1, 2) == pytest.approx(q)


@pytest.mark.parametrize(("height", "stable"), [(0.999, False), (1.001, True)])
def test_what_is_at_risk_counts_stability_that_is_lost_between_lattice_points(height, stable):
    """x² = a² + b² − 1: the box meets the unit disc between points of the lattice."""
    structure = Polynomial(lambda x, a, b: integral(x**2 - a**2 - b**2 + 1.0), 1, ("a", "b"))
    place = {"a": 0.05625, "b": height + 0.3}
    gap = em.Descriptor(
        "gap", "1", lambda z, p: ((p[:, :2] - list(place.values())) ** 2).sum(axis=1), "g",
        structure.signature,
    )  # fmt: skip
    with unchecked():
        box = em.Box(a=(-2.0, 2.0), b=(0.2, 2.0))
        eset = em.equilibrium_set(structure, box, intervals=(24, 16), checks=0)
        found = em.robust_optimum(eset, gap, {"a": 0.45, "b": 0.3})
    assert found.nominal.state.p[:2] == pytest.approx(list(place.values()), abs=1e-5)
    assert np.isfinite(found.at_risk) == stable
    assert found.state["b"] - 0.3 >= 1.0 - 1e-6


@pytest.mark.parametrize("least", [0.0883, 0.3033])
def test_stability_that_is_lost_between_corners_bounds_the_box(least):
    """x² = a² + b² − 1: no box may reach into the unit disc, whose side it touches."""
    structure = Polynomial(lambda x, a, b: integral(x**2 - a**2 - b**2 + 1.0), 1, ("a", "b"))
    x = em.Descriptor("x", "1", lambda z, p: z[:, 0], "x", structure.signature)
    half = {"a": 0.45, "b": 0.32}
    with unchecked():
        box = em.Box(a=(-2.0, 2.0), b=(0.2, 2.0))
        eset = em.equilibrium_set(structure, box, intervals=(24, 16), checks=0)
        within = [em.value_of(structure, "a") >= least, em.value_of(structure, "b") >= 0.9]
        found = em.robust_optimum(eset, x, half, within=within)
    # the box holds a = 0, where the disc is highest, and its far corner counts
    corner = np.hypot(least + half["a"], 1.0 + 2.0 * half["b"])
    assert found.status == "found"
    assert found.guaranteed == pytest.approx(np.sqrt(corner**2 - 1.0), abs=1e-5)
    assert found.edge == pytest.approx({"a": -least, "b": -half["b"]}, abs=1e-2)


def test_a_load_range_holds_between_its_ends():
    """The largest x over a range is inside it: the bound is met exactly there."""
    structure, state = random_sheet(np.random.default_rng(3), 1)
    x = em.Descriptor("x", "1", lambda z, p: z[:, 0], "x", structure.signature)
    p = np.linspace(-0.9, 0.9, 7)[:, None]
    scanned = state(np.linspace(-1.0, 1.0, 20001)).max()
    held = em.stable_over(structure, "a", (-1.0, 1.0), [x <= 0.0])
    excess = held.descriptor.function(state(p[:, 0])[:, None], p)
    assert excess == pytest.approx(np.full(7, scanned), abs=1e-8)
