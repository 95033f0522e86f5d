"""Sets whose sheets cross, refined and cut: closed forms, and the arch at Δ = 0."""

import numpy as np
import pytest
from hypothesis import given, strategies as st

from draws import few
from equimorph.manifold import (
    EquilibriumSet,
    cell_sizes,
    cusps,
    equilibrium_set,
    level_set,
    part,
    refine,
    restricted,
    singular_set,
)
from equimorph.model import Box, Descriptor
from oracles.complexes import assert_crossings, assert_faithful, assert_upright
from oracles.surfaces import crossing_sheets, hilltop, pitchforks, transcriticals, tricritical
from typecheck import unchecked

intervals = st.tuples(st.integers(3, 5), st.integers(3, 5))
cubics = st.sampled_from([-2.0, -0.7, 0.6, 1.0, 1.9])
slants = st.sampled_from([-0.4, 0.0, 0.3])
BOX = Box(a=(-1.0, 1.1), b=(-1.0, 1.2))
X = Descriptor("x", "1", lambda z, p: z[:, 0].copy())
CUT = Descriptor("cut", "1", lambda z, p: z[:, 0] + 0.4 * p[:, 1])


def lifted(structure, grid=(4, 5), box=BOX, **options) -> EquilibriumSet:
    with unchecked():  # shapes are checked on small sets elsewhere
        return equilibrium_set(structure, box, checks=0, intervals=grid, **options)


def crossed(eset: EquilibriumSet) -> np.ndarray:
    """Unknowns and parameters where sheets cross."""
    at = eset.kinds == 7
    return np.column_stack([eset.points.z[at], eset.coordinates[at]])


def area(cubic: float, slant: float, inside) -> float:
    """Area of the plane x = 0 and of the cylinder a = cubic·x² − slant·b over the box."""
    size = BOX.upper - BOX.lower
    share = (np.arange(400) + 0.5) / 400
    a, b = np.meshgrid(*(low + span * share for low, span in zip(BOX.lower, size, strict=True)))
    plane = inside(0.0 * a, a, b).mean() * size.prod()
    widest = np.sqrt(2.0 / abs(cubic))
    x, b = np.meshgrid(np.linspace(-widest, widest, 2001), b[:, 0])
    a = cubic * x**2 - slant * b
    there = (a >= BOX.lower[0]) & (a <= BOX.upper[0]) & inside(x, a, b)
    stretch = np.sqrt(1.0 + slant**2 + (2.0 * cubic * x) ** 2)
    return float(plane + (there * stretch).mean() * 2 * widest * size[1])


@few(2)
@given(cubics, slants, intervals)
def test_refined_pitchforks_keep_their_common_curve(cubic, slant, grid):
    """x (cubic·x² − a − slant·b) = 0, within a tolerance; the crossing stays exact."""
    with unchecked():
        eset = refine(lifted(pitchforks(cubic, slant), grid), 0.01)
        assert_faithful(eset)
        assert_crossings(eset)
        assert_upright(eset)
    assert eset.audit.deviation <= 0.01
    x, a, b = crossed(eset).T
    np.testing.assert_allclose([x, a + slant * b], 0.0, atol=1e-9)
    assert (len(eset.crossings), eset.folds) == (1, ())
    assert (eset.audit.components, eset.audit.euler_characteristic) == (1, 1)
    assert sorted(piece.index for piece in eset.strata) == (
        [0, 0, 0, 1] if cubic > 0 else [0, 1, 1, 1]
    )


@pytest.mark.parametrize(
    ("structure", "grid"),
    [
        (pitchforks(-2.0, -0.4), (3, 4)),
        (crossing_sheets(), (4, 5)),
        pytest.param(pitchforks(1.0, 0.0), (3, 4), marks=pytest.mark.slow),
        pytest.param(pitchforks(1.0, 0.3), (4, 5), marks=pytest.mark.slow),
        pytest.param(tricritical(-0.7), (4, 5), marks=pytest.mark.slow),
        pytest.param(hilltop(2.5), (3, 4), marks=pytest.mark.slow),
    ],
)
def test_triangles_beside_crossings_are_not_thin(structure, grid):
    """At 10⁻³ one sheet needs triangles thirty times smaller than the other; both share edges.

    Curves meet one another and the box at more than 20°.
    """
    with unchecked():
        eset = refine(lifted(structure, grid), 1e-3)
        assert_faithful(eset)
        assert_crossings(eset)
        assert_upright(eset)
    assert eset.audit.deviation <= 1e-3
    assert eset.audit.smallest_angle >= 10.0
    assert eset.audit.smallest_free_angle >= eset.audit.smallest_angle


@few(2)
@given(cubics, slants)
def test_areas_of_pitchforks_and_of_their_parts(cubic, slant):
    """Chords lose at most the deviation per radius: the rest falls with the tolerance."""
    coarse = lifted(pitchforks(cubic, slant))
    lost = []
    for accuracy in (0.03, 0.005):
        with unchecked():
            eset = refine(coarse, accuracy)
            below = restricted(eset, CUT <= 0.2)
            stable = part(eset, eset.cell_index == 0)
        assert_crossings(below)
        stable_plane = area(cubic, slant, lambda x, a, b: (x == 0.0) & (a + slant * b < 0.0))
        cylinder = area(cubic, slant, lambda x, a, b: x != 0.0)
        known = (
            area(cubic, slant, lambda x, a, b: b < np.inf),
            area(cubic, slant, lambda x, a, b: x + 0.4 * b <= 0.2),
            stable_plane + (cylinder if cubic > 0 else 0.0),
        )
        assert below.audit.clean
        assert stable.audit.clean
        sets = (eset, below, stable)
        lost.append([1 - cell_sizes(s).sum() / k for s, k in zip(sets, known, strict=True)])
    assert_faithful(below)
    assert np.abs(lost[0]).max() < 0.02
    assert np.abs(lost[1]).max() < 0.004


def test_stable_part_ends_where_sheets_cross():
    """Subcritical: of the four cells at the crossing one is stable; supercritical: three."""
    for cubic, around in ((-1.0, 1), (1.0, 3)):
        with unchecked():
            eset = refine(lifted(pitchforks(cubic, 0.3)), 0.02)
            stable = part(eset, eset.cell_index == 0)
            again = refine(stable, 0.01)
        for own in (stable, again):
            assert own.audit.clean, own.audit
            assert own.audit.overturned == 0
            assert (own.cell_index == 0).all()
            assert len(own.crossings) == 1
            assert len(own.strata) == around
            ends = own.crossings[0][[0, -1]]
            assert sorted(own.points["b"][ends]) == pytest.approx([-1.0, 1.2])


def test_level_of_both_sheets_meets_on_their_crossing():
    """x + 0.4·b = 0.2: on the plane b = ½, on the cylinder both sides of that point."""
    with unchecked():
        eset = refine(lifted(pitchforks(1.0, 0.3)), 0.02)
        level = level_set(eset, CUT, 0.2)
    assert level.lost == 0
    x, b = level.states.z[:, 0], level.states["b"]
    np.testing.assert_allclose(x + 0.4 * b, 0.2, atol=1e-12)
    ends = np.concatenate([piece[[0, -1]] for piece in level.pieces])
    common = np.flatnonzero(np.bincount(ends) == 4)
    assert len(level.pieces) == 4
    np.testing.assert_allclose(level.states.p[common], [[-0.15, 0.5]], atol=1e-12)


def test_what_does_not_steer_each_sheet_is_found_on_each():
    """(b, x + a²) on a = x², x ≠ 0: dx(1 + 4x³) ∧ db; on x = 0: 2a da ∧ db.

    The crossing a = 0 is where it vanishes on the plane; on the cylinder x³ = −¼ does.
    """
    with unchecked():
        eset = refine(lifted(pitchforks(1.0, 0.0)), 0.02)
        other = Descriptor("other", "1", lambda z, p: z[:, 0] + (p[:, 0] - 0.4) ** 2)
        b = Descriptor("b", "1", lambda z, p: p[:, 1].copy())
        level = singular_set(eset, [b, other])
    x, a = level.states.z[:, 0], level.states["a"]
    flat = np.abs(x) < 1e-9
    np.testing.assert_allclose(a[flat], 0.4, atol=1e-9)
    # 1 + 4x(x² − 0.4) = 0
    np.testing.assert_allclose(1 + 4 * x[~flat] * (x[~flat] ** 2 - 0.4), 0.0, atol=1e-8)
    assert (level.lost, len(level.pieces)) == (0, 2)


@few(2)
@given(cubics, slants, intervals)
def test_planes_that_cross_need_no_refinement(skew, slant, grid):
    coarse = lifted(transcriticals(skew, slant), grid)
    with unchecked():
        eset = refine(coarse, 1e-6)
        kept = restricted(eset, X <= 0.25)
    assert eset.audit.deviation < 1e-12
    assert_faithful(eset)
    assert_crossings(kept)
    assert kept.points.z[:, 0].max() == pytest.approx(0.25, abs=1e-12)


@pytest.mark.parametrize(
    ("structure", "box"),
    [
        (tricritical(1.0), BOX),
        pytest.param(tricritical(-0.7), BOX, marks=pytest.mark.slow),
        (hilltop(1.0), BOX),
        pytest.param(hilltop(2.5), BOX, marks=pytest.mark.slow),
        pytest.param(crossing_sheets(), Box(a=(-1, 1.1), b=(-1.03, 1.5)), marks=pytest.mark.slow),
    ],
)
def test_folds_that_pass_a_crossing_keep_their_common_point(structure, box):
    coarse = lifted(structure, (3, 4), box)
    with unchecked():
        eset = refine(coarse, 0.01)
        assert_faithful(eset)
        assert_crossings(eset)
        assert_upright(eset)
    assert eset.audit.deviation <= 0.01
    assert (len(eset.crossings), len(eset.folds)) == (1, 1)
    hub = np.intersect1d(eset.folds[0], eset.crossings[0])
    np.testing.assert_allclose(eset.coordinates[hub], [[0.0, 0.0]], atol=1e-3)


@pytest.mark.slow
@pytest.mark.parametrize("accuracy", [None, 0.02])
def test_cusps_lie_where_pitchforks_change_their_criticality(accuracy):
    """x (x⁴ − 0.7·b x² − a): at the origin the fold's image a = −(0.35·b)² turns back.

    Where a fold passes a crossing straight, as at hilltops, there is none.
    """
    found = []
    others = [(hilltop(1.0), BOX), (crossing_sheets(), Box(a=(-1, 1.1), b=(-1.03, 1.5)))]
    for structure, box in ((tricritical(-0.7), BOX), *others):
        eset = lifted(structure, (3, 4), box)
        with unchecked():
            found.append(cusps(refine(eset, accuracy) if accuracy else eset))
    assert [(len(each.states), each.lost) for each in found] == [(1, 0), (0, 0), (0, 0)]
    np.testing.assert_allclose(found[0].states.p, 0.0, atol=1e-9)
    assert found[0].index.tolist() == [0]


@few(2)
@given(cubics, st.integers(2, 12))
def test_refined_pitchfork_diagram(cubic, count):
    """x (cubic·x² − a) = 0 over a: four branches from one point."""
    with unchecked():
        coarse = equilibrium_set(
            pitchforks(cubic, 0.0), Box(a=(-1, 1.3)), fixed={"b": 0.0}, intervals=(count,), checks=0
        )
        eset = refine(coarse, 1e-3)
    assert_faithful(eset)
    assert_crossings(eset)
    assert eset.audit.deviation <= 1e-3
    assert len(eset.cells) > len(coarse.cells)
    assert (eset.audit.components, eset.audit.euler_characteristic) == (1, 1)
