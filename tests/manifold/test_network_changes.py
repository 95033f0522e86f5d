"""Curves on which networks change: against the roots of polynomials, and by symmetry."""

from itertools import permutations

import numpy as np
import pytest
from scipy.optimize import brentq

import equimorph as em
from equimorph import plotting
from typecheck import unchecked

SEXTIC = "x**6/6 - 5*x**4/4 + 2*x**2 - a*x - b*x**2/2"


def stationary(a: float, b: float) -> tuple[np.ndarray, np.ndarray]:
    """Energies of the minima and of the saddles of the sextic, by its roots, from left to right."""
    roots = np.roots([1.0, 0.0, -5.0, 0.0, 4.0 - b, -a])
    x = np.sort(roots[np.abs(roots.imag) < 1e-9].real)
    energy = x**6 / 6 - 5 * x**4 / 4 + 2 * x**2 - a * x - b * x**2 / 2
    lowest = 5 * x**4 - 15 * x**2 + 4 - b > 0
    return energy[lowest], energy[~lowest]


@pytest.fixture(scope="module")
def changes():
    loads = [em.Parameter(name, "1", 1.0, "load", 0.0) for name in "ab"]
    wells = em.EnergyStructure(SEXTIC, [em.Unknown("x", 0.0, guesses=(-3, 3))], loads)
    with unchecked():
        eset = em.equilibrium_set(wells, em.Box(a=(-0.81, 0.8), b=(-1.0, 1.02)), intervals=(7, 8))
        return em.network_changes(em.barriers(eset))


def test_minima_have_equal_energies_where_they_swap(changes):
    states = changes.swaps.states
    assert len(states) > 30
    for a, b in zip(states["a"], states["b"], strict=True):
        assert np.diff(np.sort(stationary(a, b)[0])).min() < 1e-9


def test_both_passes_out_of_the_middle_well_swap_by_symmetry(changes):
    states = changes.passes.states
    assert np.abs(states["a"]).max() < 1e-9
    ends = [np.sort(states["b"][piece])[[0, -1]] for piece in changes.passes.pieces]
    assert np.array(ends) == pytest.approx(np.array([[-1.0, 1.02]] * 2))


@pytest.mark.parametrize("a", [-0.6, 0.3, 0.7])
def test_no_swap_is_missing_along_a_line(changes, a):
    """The middle minimum and the one away from the load: one swap on each line a = const."""
    side = 0 if a > 0 else 2
    tie = brentq(lambda b: stationary(a, b)[0][side] - stationary(a, b)[0][1], -0.72, 1.0)
    at = np.stack([changes.swaps.states[name] for name in "ab"], axis=1)
    crossed = []
    for piece in changes.swaps.pieces:
        one, other = at[piece[:-1]], at[piece[1:]]
        share = (a - one[:, 0]) / (other - one)[:, 0]
        inside = (share >= 0) & (share <= 1)
        crossed += (one + share[:, None] * (other - one))[inside, 1].tolist()
    assert np.abs(np.array(crossed) - tie).min() < 0.01


def test_the_spring_swaps_without_a_load_and_its_figure_is_drawn():
    box = em.Box(x_l=(0.6, 1.2), F=(-0.1, 0.12))
    with unchecked():
        found = em.network_changes(
            em.barriers(em.equilibrium_set(em.Spring(), box, intervals=(5, 6)))
        )
    assert np.abs(found.swaps.states["F"]).max() < 1e-9
    assert found.swaps.states["x_l"].max() < 1.0
    assert len(found.passes.states) == 0
    assert "2 curves on which minima swap order, 0 on which" in repr(found)
    labels = [line.get_label() for line in plotting.network_changes(found).lines]
    assert "two minima swap order" in labels


@pytest.mark.slow
def test_where_descents_of_an_arch_begin_to_end_elsewhere_their_landing_folds():
    """In each such cell the lift of a landing from one corner to another one ends at a fold."""
    arch = em.Rod()
    box = em.Box(Theta=(0.6, 1.6), Delta=(-1.4, 1.4))
    with unchecked():
        eset = em.equilibrium_set(arch, box, fixed={"q": 2.5}, intervals=(20, 40))
        field = em.barriers(eset)
        landings, names = field.landings, [each.name for each in arch.parameters]
        cells = eset.cells[landings.row >= 0]
        assert np.count_nonzero(field.changing) > 10
        for cell in np.flatnonzero(field.changing):
            p, ends = eset.points.p[cells[cell]], landings.ends[cell]
            kinds = []
            for side in np.flatnonzero(~np.isfinite(landings.radius[cell])):
                for one, other in permutations(range(len(p)), 2):
                    landing = em.State(arch, ends[one, side], p[one])
                    led = em.lift(landing, dict(zip(names, p[other], strict=True)))
                    kinds.append(led.end.kind)
            assert "fold" in kinds
