"""Robust optima: closed forms of the spring, brute force over the box of imperfections."""

import numpy as np
import pytest
from scipy.optimize import brentq

import equimorph as em
from typecheck import unchecked

LOAD = 0.01


@pytest.fixture(scope="module")
def spring_at_load():
    with unchecked():
        return em.equilibrium_set(em.Spring(), em.Box(x_l=(0.5, 1.2)), fixed={"F": LOAD}, checks=0)


def turned(x, force):
    """δ > 0 of the stable state, F/k = (1 − x/cos δ) sin δ; nan beyond the fold [PHYSICS 2]."""
    if force >= (1.0 - x ** (2 / 3)) ** 1.5:
        return np.nan
    fold = np.arccos(np.cbrt(x))
    return brentq(lambda d: (1.0 - x / np.cos(d)) * np.sin(d) - force, fold, 1.5)


def edge_of(force):
    """x_l at which the fold is met under a load: F/k = (1 − x_l^⅔)^(3/2)."""
    return (1.0 - force ** (2 / 3)) ** 1.5


def ask(eset, objective, offsets, **options):
    angle = eset.structure.angle
    with unchecked():
        return em.robust_optimum(eset, objective, offsets, within=[angle >= 0.1], **options)


def test_the_flattest_spring_keeps_its_box_stable(spring_at_load):
    """Nominal on the fold of F, robust on that of F + 0.005; the worst angle is that at F − 0.005.

    The worst corner is another one than that which is critical.
    """
    found = ask(spring_at_load, spring_at_load.structure.angle, {"F": 0.005})
    x = edge_of(LOAD + 0.005)
    assert found.state["x_l"] == pytest.approx(x, abs=1e-8)
    assert found.guaranteed == pytest.approx(turned(x, LOAD - 0.005), abs=1e-7)
    assert found.value == pytest.approx(turned(x, LOAD), abs=1e-7)
    assert found.nominal.value == pytest.approx(np.arcsin(np.cbrt(LOAD)), abs=1e-7)
    assert found.price == pytest.approx(found.value - found.nominal.value)
    assert found.at_risk == np.inf
    assert found.edge == {"F": 0.005}


def test_before_a_fold_the_worst_case_is_inside_the_box(spring_at_load):
    """δ + 100 F falls towards the fold with infinite slope: its peak is just before the corner."""
    spring = spring_at_load.structure
    load = em.value_of(spring, "F")
    tilted = em.function_of("tilted", lambda angle, f: angle + 100.0 * f, spring.angle, load)
    found = ask(spring_at_load, tilted, {"F": 0.005})
    x = edge_of(LOAD + 0.005)
    assert found.state["x_l"] == pytest.approx(x, abs=1e-8)
    errors = 0.005 - 0.01 * np.linspace(0.0, 1.0, 4001)[1:] ** 3
    peak = max(turned(x, LOAD + e) + 100.0 * (LOAD + e) for e in errors)
    assert found.guaranteed == pytest.approx(peak, abs=1e-7)
    assert peak > np.arcsin(np.cbrt(LOAD + 0.005)) + 100.0 * (LOAD + 0.005) + 6e-3


@pytest.mark.parametrize("sense", ["min", "max"])
def test_no_setting_is_better_over_the_whole_box(spring_at_load, sense):
    """Brute force: 193 settings with 11 × 11 imperfections of x_l and F each, in closed form."""
    offsets = {"x_l": 0.01, "F": 0.005}
    found = ask(spring_at_load, spring_at_load.structure.angle, offsets, sense=sense)
    sign = 1.0 if sense == "min" else -1.0
    shifts = np.linspace(-1, 1, 11)

    def worst(x):
        values = [
            sign * turned(x + i * offsets["x_l"], LOAD + j * offsets["F"])
            for i in shifts
            for j in shifts
        ]
        return max(np.nan_to_num(values, nan=np.inf))

    x = np.linspace(0.5, 0.98, 193)
    best = min(map(worst, x))
    assert sign * found.guaranteed <= best + 1e-9
    assert sign * found.guaranteed >= best - 0.03
    inside = found.state["x_l"] - 1e-9
    assert worst(inside) == pytest.approx(sign * found.guaranteed, abs=1e-5)


@pytest.fixture(scope="module")
def spring_over_both():
    """Its vertices at x_l = 0.9006, on the fold, are close to the other stable sheet."""
    with unchecked():
        box = em.Box(x_l=(0.5, 1.2), F=(-0.3, 0.3))
        return em.equilibrium_set(em.Spring(), box, intervals=(21, 21), checks=0)


def test_a_fold_has_no_guarantee_from_the_other_sheet(spring_over_both):
    """Brute force over all stable states with δ ≥ 0.1, with errors of F of ±0.005."""
    offset = 0.005
    found = ask(spring_over_both, spring_over_both.structure.angle, {"F": offset})
    assert (found.state.index, found.edge) == (0, {})
    best = np.inf
    for x in np.linspace(0.5, 1.2, 71):
        fold = np.arccos(np.cbrt(min(x, 1.0)))
        delta = np.linspace(max(fold, 0.1), 1.5, 201)
        force = (1.0 - x / np.cos(delta)) * np.sin(delta)
        most = (1.0 - min(x, 1.0) ** (2 / 3)) ** 1.5
        kept = (np.abs(force) <= 0.3) & ((force + offset < most) | (x > 1.0))
        worst = [
            brentq(lambda d, x=x, f=f: (1.0 - x / np.cos(d)) * np.sin(d) - f + offset, fold, 1.55)
            for f in force[kept]
        ]
        best = min([best, *worst])
    # δ = 0.1 at x_l = 1.2 is on both grids
    assert found.guaranteed == pytest.approx(best, abs=1e-9)


def test_worst_cases_at_folds_are_not_those_of_another_sheet():
    """F/k = sin³δ at cos³δ = x_l: with errors of F either way stability is lost."""
    spring, x = em.Spring(), np.linspace(0.5, 0.99, 400)
    delta = np.arccos(np.cbrt(x))
    p = np.stack([x, np.sin(delta) ** 3, np.ones_like(x)], axis=1)
    worst = em.worst_over(spring, spring.angle, {"F": 0.005})
    assert (worst.function(delta[:, None], p) == np.inf).all()


@pytest.mark.parametrize("room", [1.2, 1.06, 1.01, 1.002])
def test_an_optimum_beside_the_edge_is_not_taken_for_one_on_it(room):
    """y = −b − 4 s wants both as large as possible; x stands on its fold at b − s = −2 / √27.

    In the corner of the box, the box of imperfections has some room to the fold; where more room is
    demanded first, s must give way, which costs more than going onto the edge.
    """
    energy = "x**4/4 - x**2/2 - (b - s)*x + (y + b + 4*s)**2/2"
    unknowns = [em.Unknown("x", 1.0, guesses=(-2, 2)), em.Unknown("y", 0.0, guesses=(-2, 2))]
    parameters = [
        em.Parameter("b", "1", 1.0, "load", 0.0),
        em.Parameter("s", "1", 1.0, "actuator", 0.0),
    ]
    owner = em.EnergyStructure(energy, unknowns, parameters)
    offset = 0.03
    most = 0.3 + 2.0 / np.sqrt(27.0) - room * offset
    eset = em.equilibrium_set(owner, em.Box(b=(0.0, 0.3), s=(0.0, most)), intervals=(6, 6))
    y, right = owner.descriptor("y"), owner.descriptor("x") >= 0.0
    found = em.robust_optimum(eset, y, {"b": offset}, within=[right])
    assert found.state["b"] == pytest.approx(0.3, abs=1e-9)
    assert found.guaranteed == pytest.approx(-0.3 + offset - 4.0 * most, abs=1e-9)


def test_what_cannot_be_kept_stable_is_refused(spring_at_load):
    """With F off by 0.5 no δ > 0.1 stays stable."""
    found = ask(spring_at_load, spring_at_load.structure.angle, {"F": 0.5})
    assert found.status == "refused"
    assert "room(F -0.5)" in found.why or "room(F +0.5)" in found.why
    assert np.isnan(found.guaranteed)
    assert found.nominal is not None


@pytest.mark.slow
def test_the_best_load_at_a_cliff_is_given_up_for_a_safe_one():
    """Left-half load, ±0.02: nominal 3.9908, the guarantee by 41 × 41 imperfections around it."""
    arch = em.Rod("left-half")
    with unchecked():
        grid = em.Grid(Theta=(0.8, 1.1, 6), Delta=(0.5, 0.7, 8))
        lmap = em.limit_load_map(arch, grid, "q", within=[arch.max_curvature <= 10])
        found = em.strongest(lmap, offsets={"Theta": 0.02, "Delta": 0.02})
        assert found.nominal.value == pytest.approx(3.990785, abs=2e-6)
        assert found.price == pytest.approx(found.nominal.value - found.best.value)
        steps = 0.02 * np.linspace(-1, 1, 41)
        box = np.stack(np.meshgrid(steps, steps, indexing="ij"), axis=-1).reshape(-1, 2)

        def worst(setting):
            return np.nan_to_num(lmap.rays(setting + box), nan=0.0).min()

        here = np.array(list(found.best.setting.values()))
        assert worst(here) == pytest.approx(found.guaranteed, abs=2e-3)
        sure = np.array(list(found.nominal.setting.values()))
        assert worst(sure) < found.guaranteed - 0.2
        for step in np.random.default_rng(3).uniform(-0.03, 0.03, (12, 2)):
            assert worst(here + step) <= found.guaranteed + 2e-3
