"""Strips of sets that are narrower than the grid: between pitchforks, and from folds to bounds."""

import numpy as np
import pytest

import equimorph as em
from oracles import rods
from oracles.complexes import assert_faithful
from typecheck import unchecked

BOX = em.Box(a=(-1.0, 1.1), b=(-1.0, 1.2))
SLANT = 0.13


def tube(squared_width, sign=1):
    """x (x² + (a − slant·b)² − w²) = 0: a plane, and a tube of half the width w around it."""
    energy = f"{sign} * (x**4/4 + ((a - {SLANT}*b)**2 - ({squared_width})) * x**2/2)"
    parameters = [
        em.Parameter("a", "1", 1.0, "actuator", 0.0),
        em.Parameter("b", "1", 1.0, "load", 0.0),
    ]
    return em.EnergyStructure(energy, [em.Unknown("x", "0", guesses=(-2.5, 3.5))], parameters)


def lifted(structure, grid):
    """Set without checks of shapes; those of the first test have them."""
    with unchecked():
        return em.equilibrium_set(structure, BOX, intervals=grid)


@pytest.fixture(scope="module")
def strip():
    return em.equilibrium_set(tube("0.01"), BOX, intervals=(6, 6), checks=0)


def test_a_strip_between_pitchforks_hangs_together(strip):
    """Euler characteristic: plane 1, tube 0, less two segments."""
    assert_faithful(strip)
    assert strip.audit.euler_characteristic == -1


@pytest.mark.parametrize(
    ("squared_width", "sign", "euler"),
    [
        pytest.param("0.01", -1, -1, id="subcritical", marks=pytest.mark.slow),
        pytest.param("0.01*(0.5 - b)*(b + 0.5)", 1, 3, id="closed", marks=pytest.mark.slow),
        pytest.param("0.0009", 1, -1, id="seen by no vertex"),
    ],
)
def test_strips_on_another_grid(squared_width, sign, euler):
    """A closed strip is a sphere: plane 1, sphere 2, less their common circle 0."""
    eset = lifted(tube(squared_width, sign), (7, 9))
    assert_faithful(eset)
    assert eset.audit.euler_characteristic == euler


def test_all_states_over_the_strip_are_in_the_set(strip):
    """Three over |a − slant·b| < w, from x² = w² − (a − slant·b)²; one beside it."""
    for b in np.linspace(-0.9, 1.1, 9):
        inside = np.sort(strip.at(a=SLANT * b + 0.03, b=b).z[:, 0])
        expected = np.sqrt(0.01 - 0.03**2) * np.array([-1, 0, 1])
        np.testing.assert_allclose(inside, expected, atol=1e-9)
        assert len(strip.at(a=SLANT * b + 0.13, b=b)) == 1


@pytest.mark.slow
@pytest.mark.parametrize("sign", [1, -1], ids=["supercritical", "subcritical"])
@pytest.mark.parametrize("grid", [(6, 6), (9, 7), (12, 12)])
@pytest.mark.parametrize("width", [0.05, 0.02, 0.01])
def test_strips_that_no_vertex_meets_are_found_or_named(width, grid, sign):
    """Down to a 35th of an interval, at which bisection ends on the coarsest grid."""
    audit = lifted(tube(repr(width**2), sign), grid).audit
    if width > 0.01 or grid != (6, 6):
        assert audit.clean
    assert not audit.clean or audit.euler_characteristic == -1


def folded(level):
    """x² = level over a and b: two sheets that meet in a fold."""
    parameters = [
        em.Parameter("a", "1", 1.0, "actuator", 0.0),
        em.Parameter("b", "1", 1.0, "load", 0.0),
    ]
    unknowns = [em.Unknown("x", "0", guesses=(-2.5, 3.5))]
    return em.EnergyStructure(f"x**3/3 - ({level})*x", unknowns, parameters)


def bounded(level, width, grid):
    """The set with −width/2 ≤ x ≤ width: strips of widths² along the fold, one under each sheet."""
    bend = em.Descriptor("bend", "1", lambda z, p: np.maximum(z[:, 0], -2.0 * z[:, 0]))
    with unchecked():
        return em.equilibrium_set(folded(level), BOX, within=[bend <= width], intervals=grid)


STRAIGHT, PARABOLA, WAVE = "a - 0.13*b", "a - 0.4*b**2", "a - 0.13*b - 0.3*sin(2*b)"


@pytest.mark.parametrize(
    ("level", "width", "grid", "most"),
    [
        pytest.param(STRAIGHT, 0.3, (6, 6), 100, id="wide"),
        pytest.param(STRAIGHT, 0.1, (6, 6), 400, id="narrow"),
        pytest.param(STRAIGHT, 0.05, (12, 12), 500, id="very narrow"),
        pytest.param(PARABOLA, 0.1, (7, 9), 500, id="parabola"),
        pytest.param(WAVE, 0.1, (6, 6), 500, id="wave"),
    ],
)
def test_strips_between_a_fold_and_a_constraint_are_led_along(level, width, grid, most):
    """One piece, a disc, with few vertices, down to a 60th of an interval wide under one sheet.

    States are the roots of x² = level. The narrow strip took 1065 vertices, and was not clean.
    """
    eset = bounded(level, width, grid)
    assert_faithful(eset)
    assert eset.audit.euler_characteristic == 1
    assert eset.audit.components == 1
    assert eset.audit.vertices < most
    b = np.linspace(-0.45, 0.65, 22)
    edge = np.array([-eval(level, {"a": 0.0, "b": each, "sin": np.sin}) for each in b])
    for share, roots in ((0.6, 1), (0.2, 2)):
        point = eset.over(a=edge + share * width**2, b=b).point
        assert np.bincount(point, minlength=len(b)).tolist() == [roots] * len(b)


@pytest.mark.parametrize("grid", [(6, 6), (4, 7)])
@pytest.mark.parametrize(
    "slant", [-0.13, pytest.param(0.3, marks=pytest.mark.slow)], ids=["along", "across"]
)
def test_strips_that_get_narrower_end_at_their_own_tip(slant, grid):
    """x² = a − slant·b with |x| ≤ w = 0.35 (b + 0.3): a strip as wide as w², with a tip at w = 0.

    Each triangle that it leaves took the tip for the corner in which fold and constraint meet over
    it: four pieces with 580 cells of a wrong sense for the first one.
    """
    size = em.Descriptor("size", "1", lambda z, p: np.abs(z[:, 0]) - 0.35 * (p[:, 1] + 0.3))
    with unchecked():
        structure = folded(f"a - ({slant})*b")
        eset = em.equilibrium_set(structure, BOX, within=[size <= 0.0], intervals=grid)
    assert_faithful(eset)
    assert (eset.audit.components, eset.audit.euler_characteristic) == (1, 1)
    b = np.linspace(-0.2, 1.1, 27)
    inside = 0.7 * (0.35 * (b + 0.3)) ** 2
    found = eset.over(a=slant * b + inside, b=b)
    np.testing.assert_allclose(
        found.states.z[np.lexsort((found.states.z[:, 0], found.point)), 0].reshape(-1, 2),
        np.sqrt(inside)[:, None] * np.array([-1.0, 1.0]),
        atol=1e-9,
    )
    beyond = eset.over(a=slant * b + 1.3 * inside / 0.7, b=b)
    assert len(beyond.states.z) == 0


CUBIC = "a - 0.7*b**3 + 0.3*b"


@pytest.mark.parametrize(
    ("level", "width", "grid"),
    [
        (PARABOLA, 0.1, (6, 6)),
        (PARABOLA, 0.2, (11, 8)),
        pytest.param(PARABOLA, 0.05, (11, 8), id="slivers"),
        pytest.param(CUBIC, 0.08, (11, 8), id="lifts along constraints"),
    ],
)
def test_states_over_strips_narrower_than_their_bulge_are_found(level, width, grid):
    """Chords of a fold lie up to five widths beside it: 21 of 10 800 points in 36 sets failed.

    Roots of x² = level(a, b) are −√ for 2√ ≤ width, and √ for √ ≤ width. Beside a vertex that lies
    1e-10 from a fold, cells are flat: guesses are 700 of their heights away from them there, and
    Newton's method from both sheets led to none of the two states. A lift that began on the
    constraint led to a state beyond it.
    """
    eset = bounded(level, width, grid)
    rng = np.random.default_rng(7)
    b, height = rng.uniform(-1.0, 1.2, 6000), rng.uniform(0.0, 1.3 * width**2, 6000)
    height[:3000] *= 0.3
    a = height - eval(level, {"a": 0.0, "b": b})
    inside = np.abs(a - 0.05) < 1.05
    a, b, root = a[inside], b[inside], np.sqrt(height[inside])
    found = eset.over(a=a, b=b)
    count = np.bincount(found.point, minlength=len(b))
    np.testing.assert_array_equal(count, (root <= width) * 1 + (2.0 * root <= width))
    np.testing.assert_allclose(np.abs(found.states.z[:, 0]), root[found.point], atol=1e-9)


@pytest.mark.slow
def test_the_constraint_is_closed_on_the_side_of_the_triangle_where_the_set_is():
    """A strip between two parts of a constraint ends in a tip beyond a side: a cell lay before it.

    The tip that was found was on the other side, where the strip is, and no bisection helped.
    """
    rod, _, _ = rods.rolling_rod(6, 9)
    eset = em.equilibrium_set(
        rod,
        em.Box(theta_A=(-0.0267, 0.6679), offset=(-0.2507, 0.41)),
        fixed={"P": 0.0},
        within=[rod.max_curvature <= 12.17],
        intervals=(14, 7),
    )
    assert eset.audit.clean
