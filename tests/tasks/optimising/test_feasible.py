"""Feasible regions thinner than the cells are never called empty: random ones, by brute force.

On the slider u = a b/2, which is stable everywhere, descriptors are plain functions of (a, b).
"""

import numpy as np
import pytest

import equimorph as em
from equimorph.model import Descriptor
from typecheck import unchecked

SLIDER = em.EnergyStructure(
    "(u - a*b/2)**2/2",
    [em.Unknown("u", 0.0)],
    [em.Parameter(name, "", 1.0, "actuator", 0.0) for name in "ab"],
)


@pytest.fixture(scope="module")
def slider():
    with unchecked():
        return em.equilibrium_set(SLIDER, em.Box(a=(-1, 1), b=(-1, 1)), intervals=(8, 8), checks=0)


def waves(rng):
    """Sum of four plane waves, as long as four cells and more on the average."""
    direction, phase = rng.normal(0.0, 3.0, (4, 2)), rng.uniform(0.0, 2.0 * np.pi, 4)
    size = rng.normal(size=4)
    return lambda at: np.sin(at @ direction.T + phase) @ size


def described(name, function):
    return Descriptor(name, "", lambda z, p: function(p))


def on_level(function, value):
    """Places on the lines of a fine grid where a function has a value."""
    x = np.linspace(-1, 1, 1001)
    grid = np.stack(np.meshgrid(x, x, indexing="ij"), axis=-1)
    gap = function(grid) - value
    found = []
    for one, other in ((np.s_[:-1], np.s_[1:]), (np.s_[:, :-1], np.s_[:, 1:])):
        crossed = gap[one] * gap[other] < 0.0
        share = (gap[one] / (gap[one] - gap[other]))[crossed][:, None]
        found.append((1.0 - share) * grid[one][crossed] + share * grid[other][crossed])
    return np.concatenate(found)


def band(rng):
    """c ≤ g ≤ c + w, cut by h ≤ h(x) + 0.001 around a random place x."""
    g, h, x = waves(rng), waves(rng), rng.uniform(-1, 1, 2)
    low, width = g(x), 10.0 ** rng.uniform(-7, -2)
    one, other = described("g", g), described("h", h)
    places = np.concatenate([on_level(g, low), x[None]])
    cut = h(x) + 1e-3 if rng.random() < 0.5 else np.inf
    within = [one >= low, one <= low + width, *([other <= cut] if np.isfinite(cut) else [])]
    return within, places[h(places) <= cut]


def disc(rng):
    """A disc that holds no vertex."""
    x, radius = rng.uniform(-0.95, 0.95, 2), 10.0 ** rng.uniform(-6, -1.5)
    away = described("away", lambda at: ((at - x) ** 2).sum(axis=-1))
    return [away <= radius**2], x[None]


def lens(rng):
    """Two bands that cross."""
    x, width = rng.uniform(-0.95, 0.95, 2), 10.0 ** rng.uniform(-6, -2)
    within = []
    for name in "gh":
        function = waves(rng)
        each, middle = described(name, function), function(x)
        within += [each >= middle - width, each <= middle + width]
    return within, x[None]


@pytest.mark.parametrize("region", [band, disc, lens])
@pytest.mark.parametrize("seed", range(4))
def test_thin_regions_are_found_and_their_best_states_too(slider, region, seed):
    """No worse than the best of all places of the region on a grid of 1001 lines each way."""
    rng = np.random.default_rng(seed)
    within, places = region(rng)
    goal = waves(rng)
    with unchecked():
        found = em.optimise(slider, described("goal", goal), within=within)
    assert found.found, found.why
    assert found.best.value <= goal(places).min() + 1e-6
    for each in within:
        assert each.excess(found.best.state.z[None], found.best.state.p[None])[0] <= 1e-7


def test_what_is_empty_is_refused_with_the_least_excess(slider):
    """a² + b² ≤ −0.01 is missed by 0.01 at the origin; g ≤ 0 and g ≥ 0.2 by 0.1."""
    size = described("size", lambda at: (at**2).sum(axis=-1))
    first = described("a", lambda at: at[..., 0])
    with unchecked():
        none = em.optimise(slider, first, within=[size <= -0.01])
        neither = em.optimise(slider, first, within=[first <= 0.0, first >= 0.2])
    assert (none.status, neither.status) == ("refused", "refused")
    assert none.why.endswith("the least largest excess over the bounds is 0.01")
    assert neither.why.endswith("the least largest excess over the bounds is 0.1")


@pytest.mark.slow
def test_single_shapes_of_the_arch_are_feasible(arch_set):
    """Both heights within 1e-5 of those of a random stable state, and its largest curvature."""
    arch = arch_set.structure
    heights, kappa = (arch.height(1 / 3), arch.height(2 / 3)), arch.max_curvature
    stable = arch_set.points[arch_set.index == 0]
    rng, tried = np.random.default_rng(1), 0
    for k in rng.integers(len(stable), size=40):
        state = stable[int(k)]
        turn = dict(zip(("Theta", "Delta"), rng.uniform(-0.03, 0.03, 2), strict=True))
        aims = {name: float(np.clip(state[name] + by, *BOX[name])) for name, by in turn.items()}
        path = em.lift(state, aims, within=arch_set.constraints)
        if not path.arrived or not path.end.state.stable:  # begun on a fold
            continue
        tried += 1
        within = [c for d in heights for c in (d <= d(path.end.state) + 1e-5,
                                               d >= d(path.end.state) - 1e-5)]  # fmt: skip
        with unchecked():
            found = em.optimise(arch_set, kappa, within=within)
        assert found.found, found.why
        assert found.best.value <= kappa(path.end.state) + 1e-6
    assert tried > 20


BOX = {"Theta": (0.2, 2.5), "Delta": (-2.0, 2.0)}
