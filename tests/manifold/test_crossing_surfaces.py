"""Sets over three parameters whose sheets cross along surfaces: closed forms."""

import numpy as np
import pytest
from hypothesis import given, strategies as st

from draws import few
from equimorph import lift
from equimorph.manifold import (
    EquilibriumSet,
    cell_sizes,
    equilibrium_set,
    part,
    refine,
    restricted,
)
from equimorph.model import Box, Descriptor
from equimorph.structures import Rod
from oracles.complexes import assert_crossings, assert_faithful
from oracles.polynomial import Polynomial
from oracles.surfaces import integral
from typecheck import unchecked

intervals = st.tuples(*(st.integers(2, 3) for _ in range(3)))
slants = st.sampled_from([-0.4, 0.0, 0.3])
BOX = Box(a=(-1.0, 1.1), b=(-1.0, 1.2), c=(-1.05, 1.15))
X = Descriptor("x", "1", lambda z, p: z[:, 0].copy())
CUT = Descriptor("cut", "1", lambda z, p: p[:, 1] - z[:, 0] - 0.5 * p[:, 0])


def pitchforks(cubic: float, slant: float, other: float) -> Polynomial:
    """x (cubic·x² − a − slant·b − other·c)."""
    names = ("a", "b", "c")
    return Polynomial(
        lambda x, a, b, c: integral(cubic * x**3 - (a + slant * b + other * c) * x), 1, names
    )


def transcriticals(skew: float, slant: float, other: float) -> Polynomial:
    """x (skew·x − a − slant·b − other·c)."""
    names = ("a", "b", "c")
    return Polynomial(
        lambda x, a, b, c: integral(skew * x**2 - (a + slant * b + other * c) * x), 1, names
    )


def lifted(structure, grid=(3, 3, 2), **options) -> EquilibriumSet:
    with unchecked():  # shapes are checked on surfaces
        return equilibrium_set(structure, BOX, checks=0, intervals=grid, **options)


def assert_on_crossing(eset: EquilibriumSet, slant: float, other: float) -> None:
    """At x = 0, a + slant·b + other·c = 0; four parts of two sheets."""
    with unchecked():
        assert_faithful(eset)
        assert_crossings(eset)
    at = eset.kinds == 7
    a, b, c = eset.coordinates[at].T
    np.testing.assert_allclose(eset.points.z[at], 0.0, atol=1e-9)
    np.testing.assert_allclose(a + slant * b + other * c, 0.0, atol=1e-9)
    assert (len(eset.crossings), len(eset.strata), eset.folds) == (1, 4, ())
    assert (eset.audit.components, eset.audit.euler_characteristic) == (1, 1)


@pytest.mark.slow
@few(2)
@given(st.sampled_from([-2.0, -0.7, 0.6, 1.0]), slants, slants, intervals)
def test_pitchfork_surface_joins_both_halves_of_a_cylinder(cubic, slant, other, grid):
    eset = lifted(pitchforks(cubic, slant, other), grid)
    assert_on_crossing(eset, slant, other)
    assert sorted(piece.index for piece in eset.strata) == (
        [0, 0, 0, 1] if cubic > 0 else [0, 1, 1, 1]
    )


def test_two_hyperplanes_cross():
    """Volumes: 10.164 of x = 0, and that times √(1 + (1 + 0.3² + 0.2²)/0.6²) of the other."""
    eset = lifted(transcriticals(0.6, 0.3, -0.2))
    assert_on_crossing(eset, 0.3, -0.2)
    known = 2.1 * 2.2 * 2.2 * (1.0 + np.sqrt(1.0 + (1.0 + 0.09 + 0.04) / 0.36))
    x = eset.coordinates @ [1.0, 0.3, -0.2] / 0.6
    assert np.abs(x).max() > 2.0
    assert cell_sizes(eset).sum() == pytest.approx(known, rel=1e-12)


def test_constraint_cuts_the_surface_of_crossings():
    """b ≤ 0.3 + x + a/2: on the crossing a = 0.2·c − 0.3·b there is an edge."""
    eset = lifted(pitchforks(1.0, 0.3, -0.2), (3, 4, 3), within=[CUT <= 0.3])
    assert_on_crossing(eset, 0.3, -0.2)
    bounds = CUT.function(eset.points.z, eset.points.p) - 0.3
    assert (np.abs(bounds[eset.kinds == 7]) < 1e-9).sum() > 3


@pytest.mark.slow
def test_refined_volumes_and_those_of_parts():
    """The cylinder is stretched by √(1 + 0.3² + 0.2² + 4x²); tetrahedra lose as their deviation."""
    coarse = lifted(pitchforks(1.0, 0.3, -0.2), (3, 4, 3))
    lost = []
    for accuracy in (0.1, 0.03):
        with unchecked():
            eset = refine(coarse, accuracy)
            below = restricted(eset, X <= 0.3)
            stable = part(eset, eset.cell_index == 0)
        assert_on_crossing(eset, 0.3, -0.2)
        assert_on_crossing(below, 0.3, -0.2)
        assert stable.audit.clean
        assert eset.audit.deviation <= accuracy
        whole = volume(lambda x, a, b, c: x < np.inf)
        known = (
            whole,
            volume(lambda x, a, b, c: x <= 0.3),
            whole - volume(lambda x, a, b, c: (x == 0.0) & (a + 0.3 * b - 0.2 * c > 0.0)),
        )
        sizes = [cell_sizes(each).sum() for each in (eset, below, stable)]
        lost.append(1.0 - np.array(sizes) / known)
    assert (lost[0] < 0.006).all()
    assert (lost[1] < 0.5 * lost[0]).all()
    assert (np.array(lost) > -1e-3).all()


def volume(inside) -> float:
    """Volume of x = 0 and of a = x² − 0.3·b + 0.2·c over the box, by midpoints."""
    share, size = (np.arange(100) + 0.5) / 100, BOX.upper - BOX.lower
    axes = [low + span * share for low, span in zip(BOX.lower, size, strict=True)]
    a, b, c = np.meshgrid(*axes, indexing="ij")
    plane = inside(0.0 * a, a, b, c).mean() * size.prod()
    x, b, c = np.meshgrid(3.0 * (np.arange(900) + 0.5) / 900 - 1.5, *axes[1:], indexing="ij")
    a = x**2 - 0.3 * b + 0.2 * c
    there = (a >= BOX.lower[0]) & (a <= BOX.upper[0]) & inside(x, a, b, c)
    stretch = np.sqrt(1.0 + 0.3**2 + 0.2**2 + 4.0 * x**2)
    return float(plane + (there * stretch).mean() * 3.0 * size[1] * size[2])


@pytest.mark.slow
def test_folds_that_pass_crossings_of_surfaces_are_not_called_clean():
    """x (x⁴ + b x² − a): folds leave the crossings along a curve, which these balls cannot hold."""
    names = ("a", "b", "c")
    tricritical = Polynomial(
        lambda x, a, b, c: integral(x**5 + b * x**3 - (a - 0.2 * c) * x), 1, names
    )
    eset = lifted(tricritical, (2, 2, 2))
    assert not eset.audit.clean
    assert eset.audit.undecided > 0


@pytest.mark.slow
def test_pitchforks_of_the_symmetric_arch_form_a_surface_over_angle_load_and_span():
    """At each angle and span of a vertex the load is raised from rest to the branch point."""
    arch = Rod()
    with unchecked():
        eset = equilibrium_set(
            arch,
            Box(Theta=(0.6, 0.75), q=(3.5, 4.6), nu=(0.81, 0.87)),
            fixed={"Delta": 0.0},
            within=[arch.max_curvature <= 20],
            intervals=(3, 4, 3),
            checks=1,
        )
        assert_faithful(eset)
        assert_crossings(eset)
    assert len(eset.crossings) == 1
    met = np.flatnonzero(eset.kinds == 7)
    assert (eset.index[met] == 0).all()
    for vertex in met[::20]:
        state = eset.points[vertex]
        rest = arch.natural_state(Theta=state["Theta"], nu=state["nu"])
        path = lift(rest, to={"q": 8.0})
        assert path.end.kind == "branch point"
        assert path.end.state["q"] == pytest.approx(state["q"], abs=1e-8)
