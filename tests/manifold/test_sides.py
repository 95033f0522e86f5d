"""Folds, crossings and cusps that lie in a side of the box, touch it, or meet it in a corner."""

from itertools import product
from math import factorial

import numpy as np
import pytest

from equimorph.manifold import VertexKind, equilibrium_set
from equimorph.manifold.refining.refine import refine
from equimorph.model import Box, Descriptor
from equimorph.structures import Rod, Spring
from oracles.polynomial import Polynomial
from oracles.surfaces import integral
from typecheck import unchecked

UNIT, LONG = (0.0, 1.0), (-0.83, 1.0)
"""Sides: the singular curve is at the first end of the one, and inside the other."""

PLACES = {
    "lies in a side": (lambda a, b: a, UNIT, LONG),
    "lies in a side, from outside": (lambda a, b: -1.0 * a, UNIT, LONG),
    "touches a side from inside": (lambda a, b: a - b**2, UNIT, LONG),
    "touches a side, two lobes": (lambda a, b: b**2 - a, UNIT, LONG),
    "touches a side from outside": (lambda a, b: a + b**2, UNIT, LONG),
    "touches a corner": (lambda a, b: a + b, UNIT, UNIT),
    "leads through two corners": (lambda a, b: a - b, UNIT, UNIT),
    "leads through a corner": (lambda a, b: a - 0.37 * b, UNIT, UNIT),
    "is tangent to a side in a corner": (lambda a, b: a - b**2, UNIT, UNIT),
}
"""Where g(a, b) = 0 lies, and the box."""

FORCES = {
    "fold": lambda y, g: y**2 - g,
    "pitchfork": lambda y, g: y**3 - g * y,
    "transcritical": lambda y, g: y**2 - g * y,
}
"""Forces whose states y(g) meet where g = 0."""


def bent(x, a, b):
    """States are moved by a polynomial in the parameters, so that no sheet is flat."""
    return x - 0.31 * a + 0.23 * b - 0.11 * a * b


def states(kind, g):
    """Closed form of y, in order."""
    root = [-np.sqrt(g), np.sqrt(g)] if g > 0.0 else []
    found = {"fold": root, "pitchfork": [0.0, *root], "transcritical": [0.0, g]}[kind]
    return np.sort(found)


def check_states(eset, kind, g, seed=0):
    """States over random points, half of them near a = 0, against the closed form."""
    low, high = eset.box.lower, eset.box.upper
    generator = np.random.default_rng(seed)
    p = generator.uniform(low, high, (120, 2))
    p[::2, 0] = 10.0 ** generator.uniform(-4.0, 0.0, 60)
    found = eset.over(**dict(zip("ab", p.T, strict=True)))
    for (a, b), over in zip(p, found, strict=True):
        y = np.sort(bent(over.states.z[:, 0], a, b))
        np.testing.assert_allclose(y, states(kind, g(a, b)), rtol=0.0, atol=1e-9)


def integral_of(force, g, x, a, b):
    """Energy of a force in y = x − m(a, b)."""
    return integral(force(bent(x, a, b), g(a, b)))


USUAL = {
    "pitchfork": ("lies in a side", "touches a corner"),
    "transcritical": ("touches a side from outside", "leads through a corner"),
}
"""Places at which the others are tried each time, too; there folds are tried everywhere."""
CASES = [
    pytest.param(kind, place, marks=() if place in USUAL.get(kind, PLACES) else pytest.mark.slow)
    for kind in FORCES
    for place in PLACES
    if (kind, place) != ("transcritical", "is tangent to a side in a corner")
]
"""The exception is named: between its sheets, nearly parallel to the side, cells stay undecided."""


@pytest.mark.parametrize(("kind", "place"), CASES)
def test_sets_are_singular_on_sides(kind, place):
    """Closed forms: y² = g, y³ = g y, y² = g y where g = 0 is in no general position to the box.

    Folds and crossings lie on g = 0 to round-off, where F_z and with it dF_z/dy or F_z/y vanish,
    and all vertices in the box.
    """
    g, *sides = PLACES[place]
    force = FORCES[kind]
    with unchecked():
        structure = Polynomial(lambda x, a, b: integral_of(force, g, x, a, b), 1, ("a", "b"))
        box = Box(**dict(zip("ab", sides, strict=True)))
        eset = equilibrium_set(structure, box, intervals=(6, 7))
        check_states(eset, kind, g)
    assert eset.audit.clean, eset.audit.faults
    assert box.contains(eset.coordinates).all()
    singular = np.isin(eset.kinds, (VertexKind.FOLD, VertexKind.CROSSING))
    y = bent(eset.points.z[singular, 0], *eset.coordinates[singular].T)
    of_place = g(*eset.coordinates[singular].T)
    assert np.abs(y).max(initial=0.0) < 1e-7
    assert np.abs(of_place).max(initial=0.0) < 1e-9


ENTRIES = {
    "strip": (lambda a, b: -1.0 * a, 1e-6),
    "wider strip": (lambda a, b: -1.0 * a, 1e-4),
    "cap": (lambda a, b: -1.0 * a - b**2, 1e-6),
    "corner": (lambda a, b: -1.0 * a - (b + 0.83), 1e-4),
}
"""Depth of g(a, b) in the box, but for what is added, and how far it then reaches into the box."""


def entry_of(place, depth):
    """The set y² = g(a, b) + depth over 0 ≤ a ≤ 1, −0.83 ≤ b ≤ 1, and g."""
    outside = ENTRIES[place][0]

    def g(a, b):
        return outside(a, b) + depth

    with unchecked():
        structure = Polynomial(lambda x, a, b: integral_of(FORCES["fold"], g, x, a, b), 1, "ab")
        return equilibrium_set(structure, Box(a=UNIT, b=LONG), intervals=(6, 7)), g


@pytest.mark.parametrize("place", ENTRIES)
def test_sheets_enter_through_a_side_by_less_than_a_cell(place):
    """Closed form: y² = g where g > 0 in a strip, a cap or a corner of the box, down to 1e-6 deep.

    The states over points of it are there, and none over points beyond.
    """
    depth = ENTRIES[place][1]
    eset, g = entry_of(place, depth)
    assert eset.audit.clean, eset.audit.faults
    assert eset.audit.components == 1
    assert eset.audit.grazing == ()
    generator = np.random.default_rng(0)
    a = generator.uniform(0.0, 1.2 * depth, 200)
    width = {"cap": np.sqrt(depth), "corner": depth}.get(place, 1.0)
    b = width * generator.uniform(-0.8, 0.8, 200) if place != "corner" else -0.83 + a[::-1]
    found = np.bincount(eset.over(a=a, b=b).point, minlength=200)
    np.testing.assert_array_equal(found, np.where(g(a, b) > 0.0, 2, 0))


@pytest.mark.parametrize("place", ENTRIES)
def test_the_audit_names_sheets_that_end_in_sides(place):
    """y² = g ≤ 0 in the box: no set, but singular states in a = 0; beyond a distance nothing."""
    touching, _ = entry_of(place, 0.0)
    away, _ = entry_of(place, -1e-6)
    assert len(touching.cells) == len(away.cells) == 0
    assert touching.audit.clean
    assert any(dict(at)["a"] == 0.0 for at in touching.audit.grazing)
    assert "sheets end in sides" in dict(touching.audit.rows())
    assert away.audit.grazing == ()
    assert "sheets end in sides" not in dict(away.audit.rows())


def test_sheets_that_end_in_sides_are_named_of_refined_sets_too():
    """(x² + a)(x − 2) = 0 over a ≥ 0: the sheet x = 2, and singular states x = 0 in a = 0."""

    def energy(x, a, b):
        return 0.25 * x**4 - (2.0 / 3.0) * x**3 + 0.5 * a * x**2 - 2.0 * a * x

    with unchecked():
        structure = Polynomial(energy, 1, "ab")
        eset = equilibrium_set(structure, Box(a=UNIT, b=LONG), intervals=(6, 7))
    assert dict(eset.audit.grazing[0])["a"] == 0.0
    assert refine(eset, 1e-2).audit.grazing == eset.audit.grazing


def test_cusps_lie_on_sides():
    """y³ = a y + b: the cusp lies on a side or in a corner, or its axis lies in a side."""
    for sides in ((UNIT, LONG), (UNIT, UNIT), (LONG, UNIT), ((-1.0, 0.0), LONG)):
        with unchecked():
            structure = Polynomial(
                lambda x, a, b: integral(bent(x, a, b) ** 3 - a * bent(x, a, b) - b), 1, ("a", "b")
            )
            box = Box(**dict(zip("ab", sides, strict=True)))
            eset = equilibrium_set(structure, box, intervals=(6, 7))
            p = np.random.default_rng(0).uniform(box.lower, box.upper, (150, 2))
            found = eset.over(a=p[:, 0], b=p[:, 1])
        assert eset.audit.clean, eset.audit.faults
        discriminant = 4.0 * p[:, 0] ** 3 - 27.0 * p[:, 1] ** 2
        counts = np.bincount(found.point, minlength=len(p))
        np.testing.assert_array_equal(counts, np.where(discriminant > 0.0, 3, 1))


def test_a_fold_lies_in_a_side_over_three_parameters():
    """y² = a − b²c² over a ≥ 0, b ≥ 0: folded along a = b²c², which touches two sides in lines."""
    with unchecked():
        structure = Polynomial(
            lambda x, a, b, c: integral(x**2 - a + b**2 * c**2), 1, ("a", "b", "c")
        )
        box = Box(a=UNIT, b=UNIT, c=LONG)
        eset = equilibrium_set(structure, box, intervals=(4, 4, 5), checks=1)
        p = np.random.default_rng(0).uniform(box.lower, box.upper, (150, 3))
        counts = np.bincount(eset.over(**dict(zip("abc", p.T, strict=True))).point, minlength=150)
    assert eset.audit.clean, eset.audit.faults
    assert eset.audit.euler_characteristic == 1
    a, b, c = p.T
    np.testing.assert_array_equal(counts, np.where(a > (b * c) ** 2, 2, 0))


LOW, HIGH = np.array([-1.0, -1.0, -0.9]), np.array([1.1, 1.2, 1.0])
"""Corners of a box."""


def part_above(normal, corner, d):
    """Closed form: volume where n·(x − corner) > 0 in the box from LOW to HIGH, n_i ≠ 0.

    That of a simplex beyond the half-space's corner, less those beyond the other corners.
    """
    low, high, normal = LOW[:d], HIGH[:d], np.array(normal)
    least = normal @ np.where(normal > 0.0, low, high)
    sides, level = np.abs(normal) * (high - low), normal @ corner - least
    corners = np.array(list(product((0.0, 1.0), repeat=d)))
    terms = (-1.0) ** corners.sum(axis=1) * np.maximum(level - corners @ sides, 0.0) ** d
    below = terms.sum() / (factorial(d) * np.prod(np.abs(normal)))
    return np.prod(high - low) - below


PLANES = {
    "two parameters": ((1.0, -0.37), (0, 0), (6, 7)),
    "two parameters, steep": ((0.05, -1.0), (1, 1), (5, 4)),
    "a small part of two": ((-0.6, 1.0), (1, 0), (3, 4)),
    "three parameters": ((1.0, -0.6, 0.4), (0, 0, 1), (3, 3, 3)),
    "little of the corner": ((1.0, 0.7, -0.5), (0, 1, 0), (2, 3, 3)),
    "much of the corner": ((-1.0, 1.0, 1.0), (1, 0, 1), (3, 3, 2)),
}
"""Normals of folds, the corners of the box through which they lead, and grids."""


@pytest.mark.parametrize("case", PLANES)
def test_flat_folds_lead_through_corners(case):
    """y² = n·(p − corner): half a ball's double, χ = 1, over a polytope of known volume."""
    normal, ends, grid = PLANES[case]
    d, names = len(normal), "abc"[: len(normal)]
    corner = np.where(ends, HIGH[:d], LOW[:d])

    def force(x, *p):
        y = x - 0.2 * p[0] + 0.1 * p[1]
        return y**2 - sum(n * (q - at) for n, q, at in zip(normal, p, corner.tolist(), strict=True))

    with unchecked():
        structure = Polynomial(lambda x, *p: integral(force(x, *p)), 1, tuple(names))
        sides = zip(LOW[:d].tolist(), HIGH[:d].tolist(), strict=True)
        box = Box(**dict(zip(names, sides, strict=True)))
        eset = equilibrium_set(structure, box, intervals=grid, checks=1)
    assert eset.audit.clean, eset.audit.faults
    assert eset.audit.euler_characteristic == 1
    corners = eset.coordinates[eset.cells]
    volume = np.abs(np.linalg.det(corners[:, 1:] - corners[:, :1])).sum() / factorial(d)
    # cells at the corner may be off by the part by which sides were moved
    np.testing.assert_allclose(volume, 2.0 * part_above(normal, corner, d), rtol=1e-5)


@pytest.mark.slow
def test_a_fold_and_constraints_meet_in_a_corner_over_three_parameters():
    """x² = a − 0.6 b + 0.4 c between −0.15 and 0.3: folded in a plane through a corner, χ = 1.

    Eight points of the fold lay within 1e-4 of the corner; between them a void had been left.
    """
    with unchecked():
        structure = Polynomial(
            lambda x, a, b, c: integral(x**2 - a + 0.6 * b - 0.4 * c), 1, ("a", "b", "c")
        )
        box = Box(**dict(zip("abc", zip(LOW.tolist(), HIGH.tolist(), strict=True), strict=True)))
        bend = Descriptor("bend", "1", lambda z, p: np.maximum(z[:, 0], -2.0 * z[:, 0]))
        eset = equilibrium_set(structure, box, within=[bend <= 0.3], intervals=(3, 3, 3))
    assert eset.audit.clean, eset.audit.faults
    assert eset.audit.euler_characteristic == 1


def test_a_cusp_line_leaves_through_a_side_over_three_parameters():
    """A cubic in x, its cusps in a line across a = 0: as many states as roots, nothing bisected.

    Behind the cusp in a = 0 the fold bulges beyond the side, in cells of every size.
    """
    with unchecked():
        structure = Polynomial(
            lambda x, a, b, c: integral(
                0.0343 * x**3
                - (b - 0.0154 * a) * x
                - (c + 0.029 * a + 0.2193 * b)
                - 0.0851 * a * x**2
            ),
            1,
            ("a", "b", "c"),
        )
        box = Box(a=(0.0, 0.5), b=(-0.8, 0.9), c=LONG)
        eset = equilibrium_set(structure, box, intervals=(2, 2, 4), checks=0)
        p = np.random.default_rng(0).uniform(box.lower, box.upper, (200, 3))
        counts = np.bincount(eset.over(**dict(zip("abc", p.T, strict=True))).point, minlength=200)
    assert eset.audit.clean, eset.audit.faults
    assert eset.audit.bisected == 0
    for (a, b, c), count in zip(p, counts, strict=True):
        roots = np.roots([0.0343, -0.0851 * a, -(b - 0.0154 * a), -(c + 0.029 * a + 0.2193 * b)])
        assert count == (np.abs(roots.imag) < 1e-9).sum()


def test_diagrams_begin_at_folds_and_crossings():
    """Over one parameter: y² = a and y³ = a y over a ≥ 0, from the singular state on."""
    for kind, sheets in (("fold", 2), ("pitchfork", 3)):
        with unchecked():
            structure = Polynomial(lambda x, a, kind=kind: integral(FORCES[kind](x, a)), 1, ("a",))
            eset = equilibrium_set(structure, Box(a=UNIT), intervals=(20,))
            counts = np.bincount(eset.over(a=np.linspace(0.01, 0.99, 50)).point)
        assert eset.audit.clean, eset.audit.faults
        assert (counts == sheets).all()


@pytest.mark.parametrize("intervals", [(12, 12), (13, 17), (13, 7), (9, 21)])
@pytest.mark.parametrize("seed", range(2))
def test_the_spring_is_clean_from_no_load_on(intervals, seed):
    """Its pitchfork at x_l = 1 is a cusp over (x_l, F), in corners of boxes over F >= 0.

    Closed form: for F = 0 and x_l < 1 there are three states, one of which is flat; the fold at
    k (1 − x_l^⅔)^(3/2) leaves one of them.
    """
    spring = Spring()
    with unchecked():
        eset, beside = (
            equilibrium_set(spring, Box(x_l=each, F=(0, 0.2)), intervals=intervals, seed=seed)
            for each in ((0.5, 1), (1, 1.5))
        )
        x, F = np.random.default_rng(0).uniform((0.5, 0.0), (1.0, 0.2), (200, 2)).T
        counts = np.bincount(eset.over(x_l=x, F=F).point, minlength=200)
    assert eset.audit.clean
    assert beside.audit.clean
    np.testing.assert_array_equal(counts, np.where((1.0 - x ** (2 / 3)) ** 1.5 > F, 3, 1))
    assert set(beside.cell_index) == {0}


def test_half_of_a_symmetric_set_is_half_of_it():
    """Over Δ >= 0, the arch has the pieces that the half of the set over all Δ has."""
    arch = Rod(load="uniform")
    common = {"fixed": {"q": 2.5}, "within": [arch.max_curvature <= 20]}
    half = equilibrium_set(arch, Box(Theta=(0.2, 2.5), Delta=(0, 2)), intervals=(12, 12), **common)
    with unchecked():
        box = Box(Theta=(0.2, 2.5), Delta=(-2, 2))
        whole = equilibrium_set(arch, box, intervals=(12, 21), **common)
        places = np.random.default_rng(0).uniform((0.2, 0.0), (2.5, 2.0), (150, 2))
        counts = [
            np.bincount(each.over(Theta=places[:, 0], Delta=places[:, 1]).point, minlength=150)
            for each in (half, whole)
        ]
    assert half.audit.clean
    np.testing.assert_array_equal(*counts)
