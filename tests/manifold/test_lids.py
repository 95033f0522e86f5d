"""Constraints with kinks over three parameters: where they bound a set inside grid cells."""

import numpy as np
import pytest

import equimorph as em
from oracles.complexes import assert_faithful
from typecheck import unchecked

BOX = em.Box(a=(-1.0, 1.1), b=(-1.0, 1.2), c=(-0.9, 1.0))
SHEET = "(x - 0.3*a + 0.2*b**2 - 0.1*c)**2/2"
CUSP = "x**4/4 - (a + 0.3*c)*x**2/2 - (b + 0.2*c)*x"
STAIR = "x**4/4 - 3*0.35**2*x**2/2 - (a + {}*b + {}*c)*x"
"""A sheet with two folds side by side, between the same indices."""
UMBILIC = "x**3/3 + y**3/3 + 0.6*x*y - (a + 0.2*c**2)*x - (b - 0.3*c)*y"


def bounded(excess, energy=SHEET, unknowns="x"):
    """The set of an energy where an excess is not positive."""
    parameters = [em.Parameter(name, "1", 1.0, "load", 0.0) for name in "abc"]
    given = [em.Unknown(name, "0", guesses=(-2.5, 2.5)) for name in unknowns]
    structure = em.EnergyStructure(energy, given, parameters)
    excess = em.Descriptor("excess", "1", excess)
    with unchecked():
        return em.equilibrium_set(structure, BOX, within=[excess <= 0.0], intervals=(3, 3, 3))


def assert_covers(eset, excess, margin):
    """Random places are in cells if they are allowed, and in none if they are not."""
    draw = np.random.default_rng(0)
    places = draw.uniform(BOX.lower, BOX.upper, (5_000, 3))
    a, b, c = places.T
    allowed = excess((0.3 * a - 0.2 * b**2 + 0.1 * c)[:, None], places)
    corners = eset.coordinates[eset.cells]
    spans = np.swapaxes(corners[:, 1:] - corners[:, :1], 1, 2)
    shares = np.einsum("tij,ptj->pti", np.linalg.inv(spans), places[:, None] - corners[:, 0])
    inside = ((shares > -1e-9).all(axis=2) & (shares.sum(axis=2) < 1.0 + 1e-9)).any(axis=1)
    assert inside[allowed < -margin].all()
    assert not inside[allowed > margin].any()


@pytest.mark.parametrize("tilt", [(0.31, 0.17), (0.7, -0.6)])
@pytest.mark.parametrize("width", [0.5, 0.3, 0.2])
def test_slabs_between_two_constraints_are_one_piece(width, tilt):
    """Slabs that few vertices of the grid see: two lids over most cells, and no edge across them.

    Closed by constraints that were taken to lead straight on, those of ±0.2 were two pieces.
    """

    def excess(z, p):
        u = p[:, 0] + tilt[0] * p[:, 1] + tilt[1] * p[:, 2] + 0.1 * z[:, 0] - 0.12
        return np.maximum(u - width, -1.1 * u - width)

    eset = bounded(excess)
    assert_faithful(eset)
    assert (eset.audit.components, eset.audit.euler_characteristic) == (1, 1)
    assert eset.audit.bisected == 0
    assert_covers(eset, excess, 0.05)


def wedge(angle, turn, sign):
    """Excess outside a wedge of an angle, or inside it."""

    def excess(z, p):
        u = np.cos(turn) * p[:, 0] + np.sin(turn) * p[:, 1]
        v = np.cos(turn) * p[:, 1] - np.sin(turn) * p[:, 0] + 0.15 * p[:, 2] + 0.05 * z[:, 0]
        return sign * (np.abs(v) - np.tan(angle / 2) * (u + 0.45))

    return excess


@pytest.mark.parametrize("turn", [0.2, 0.7])
@pytest.mark.parametrize("angle", [0.9, 0.3, 0.08])
def test_wedges_between_two_constraints_are_one_piece(angle, turn):
    """Those of 0.3 were two and four pieces with a clean audit.

    Around an edge of 0.08 constraints turn back: differences across it told the wrong way.
    """
    excess = wedge(angle, turn, 1.0)
    eset = bounded(excess)
    assert_faithful(eset)
    assert (eset.audit.components, eset.audit.euler_characteristic) == (1, 1)
    assert_covers(eset, excess, 0.06)


@pytest.mark.parametrize("lean", [-0.4, -0.3])
def test_sides_that_end_in_a_kink_stay_in_their_triangles(lean):
    """From between its ends Newton's method follows the weaker bound, away from the edge.

    With points beyond the side 51 cells of the first wedge were undecided, of 920 equilibria.
    """

    def excess(z, p):
        u = np.cos(0.7) * p[:, 0] + np.sin(0.7) * p[:, 1] + lean * p[:, 2]
        v = np.cos(0.7) * p[:, 1] - np.sin(0.7) * p[:, 0] + 0.15 * p[:, 2] + 0.05 * z[:, 0]
        far = np.tan(0.15) * (u + 0.45)
        return np.maximum(0.2 * (v - far), -v - far)

    eset = bounded(excess)
    assert_faithful(eset)
    assert (eset.audit.components, eset.audit.euler_characteristic) == (1, 1)
    assert eset.audit.bisected == 0
    assert_covers(eset, excess, 0.06)


@pytest.mark.parametrize(
    ("angle", "turn"), [(0.9, 0.2), (0.9, 0.7), (0.3, 0.2), (0.15, 0.7), (0.08, 0.7), (0.04, 0.2)]
)
def test_notches_leave_one_piece(angle, turn):
    """A wedge is cut out of the box, from one of its sides; some raised a KeyError.

    Narrow ones pass between vertices: what is known beside them leads there.
    """
    excess = wedge(angle, turn, -1.0)
    eset = bounded(excess)
    assert_faithful(eset)
    assert (eset.audit.components, eset.audit.euler_characteristic) == (1, 1)
    assert eset.audit.vertices < 300
    assert_covers(eset, excess, 0.06)


@pytest.mark.parametrize("tilt", [(0.1, 0.2), (0.6, 0.5), (0.9, -0.4)])
@pytest.mark.parametrize("radius", [0.5, 0.35, 0.25])
def test_tubes_are_no_lids(radius, tilt):
    """A box less a cylinder through it."""

    def excess(z, p):
        del z
        u, v = (p[:, k + 1] - 0.1 + 0.05 * k - tilt[k] * p[:, 0] for k in range(2))
        return radius**2 - u**2 - v**2

    eset = bounded(excess)
    assert_faithful(eset)
    assert (eset.audit.components, eset.audit.euler_characteristic) == (1, 0)
    assert_covers(eset, excess, 0.15)


@pytest.mark.parametrize(("limit", "most"), [(0.05, 600), (-0.2, 400)])
def test_lids_are_parted_along_the_folds_of_an_umbilic(limit, most):
    """Indices 0, 1 and 2 on one lid; with a lid for two of them at most there were 763 and 671."""
    eset = bounded(
        lambda z, p: p[:, 2] + 0.3 * p[:, 0] - 0.2 * p[:, 1] + 0.1 * z[:, 0] - limit,
        UMBILIC,
        "xy",
    )
    assert_faithful(eset)
    assert (eset.audit.components, eset.audit.euler_characteristic) == (1, 1)
    assert eset.audit.vertices < most


@pytest.mark.parametrize(
    ("normal", "limit", "most"),
    [
        ((0.3, -0.2, 1.0), 0.05, 12),
        ((0.8, 0.3, 0.6), 0.3, 6),
        ((0.2, 0.9, 0.4), 0.2, 0),
        ((-0.6, 0.2, 0.8), 0.2, 3),
    ],
)
def test_lids_may_meet_cusps(normal, limit, most):
    """Cells at cusps are overturned, whatever they are coned from: 20, 9, 6 and 5 were bisected.

    States are counted by the roots of x³ = (a + 0.3 c) x + b + 0.2 c.
    """

    def excess(z, p):
        return p @ np.array(normal) + 0.1 * z[:, 0] - limit

    eset = bounded(excess, CUSP)
    assert_faithful(eset)
    assert (eset.audit.components, eset.audit.euler_characteristic) == (1, 1)
    assert eset.audit.bisected <= most
    places = np.random.default_rng(3).uniform(BOX.lower, BOX.upper, (300, 3))
    a, b, c = places.T
    wanted, clear = np.zeros((2, len(places)))
    for k, (slope, shift) in enumerate(zip(a + 0.3 * c, b + 0.2 * c, strict=True)):
        roots = np.roots([1.0, 0.0, -slope, -shift])
        real = roots[np.abs(roots.imag) < 1e-9].real
        at = excess(real[:, None], np.tile(places[k], (len(real), 1)))
        wanted[k] = np.count_nonzero(at <= 0.0)
        # coarse cells miss slivers at folds and at the bound
        clear[k] = np.abs(4.0 * slope**3 - 27.0 * shift**2) > 0.3 and np.abs(at).min() > 0.05
    with unchecked():
        found = [len(each.states) for each in eset.over(a=a, b=b, c=c)]
    assert clear.sum() > 150
    assert np.array_equal(np.array(found)[clear > 0], wanted[clear > 0])


@pytest.mark.parametrize(("seed", "most"), [(0, 3), (1, 21)])
def test_lids_are_parted_along_several_folds(seed, most):
    """Random planes across two folds that pass tetrahedra side by side: rims with four corners.

    14 and 52 cells were bisected.
    """
    draw = np.random.default_rng([11, seed])
    tilt, way, lean = (
        draw.uniform(-0.5, 0.5, 2),
        draw.uniform(-0.5, 0.5, 2),
        draw.uniform(-0.3, 0.3),
    )
    eset = bounded(
        lambda z, p: p[:, 2] + p[:, :2] @ way + lean * z[:, 0] - 0.2, STAIR.format(*tilt)
    )
    assert_faithful(eset)
    assert (eset.audit.components, eset.audit.euler_characteristic) == (1, 1)
    assert eset.audit.bisected <= most
