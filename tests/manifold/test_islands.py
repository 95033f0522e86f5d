"""Closed folds and pitchfork curves inside cells, which no edge of the grid meets: closed forms."""

from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest

import equimorph as em
from equimorph.manifold.geometry.quadratics import least_in_simplex, monomials, through_corners
from equimorph.manifold.lifting import completeness, hidden_islands, seeds
from equimorph.manifold.lifting.grid import bisect, grid_lines, grid_mesh, split_at
from sets import blind
from typecheck import unchecked

BOX = em.Box(p=(-1, 1), r=(-1, 1))
STRIP, LIPS = (1, 3), (1, 1)
"""Components and Euler characteristic: a plane and a sphere around a circle, and a disc."""
SIZES, TINY = (0.002, 0.03), (0.001, 0.004)


def island(number, kind, seed=77, sizes=SIZES):
    """Random ellipse |y| < 1, y = (u/a, v/b), half axes of a size and at least a tenth of that.

    Strip: x (x² + w² (|y|² − 1)) = 0. Lips: x³ + h ((v/b)² − 1) x + 0.385 h^1.5 u/a = 0, which has
    three roots inside of two arcs that meet in cusps at (0, ±b); the sheet is bent for odd numbers.
    """
    generator = np.random.default_rng([seed, number])
    half = 10.0 ** generator.uniform(*np.log10(sizes))
    other = half * 10.0 ** generator.uniform(-1.0, 0.0)
    centre, angle = generator.uniform(-0.8, 0.8, 2), generator.uniform(0.0, np.pi)
    grid = tuple(int(count) for count in generator.integers(8, 13, 2))
    c, s = np.cos(angle), np.sin(angle)
    p, r = (f"({name} - ({at:.17g}))" for name, at in zip("pr", centre, strict=True))
    u, v = f"(({c:.17g})*{p} + ({s:.17g})*{r})", f"(({c:.17g})*{r} - ({s:.17g})*{p})"
    slope, a, b, x = "0", half, other, "x"
    if kind == "strip":
        level = f"{other**2:.17g}*(({u}/{a:.17g})**2 + ({v}/{b:.17g})**2 - 1)"
    else:
        height = 10.0 ** generator.uniform(-3.0, -1.0)
        u, v, a, b = (u, v, a, b) if generator.integers(2) else (v, u, b, a)
        level = f"{height:.17g}*(({v}/{b:.17g})**2 - 1)"
        slope = f"{0.385 * height**1.5 / a:.17g}*{u}"
        if number % 2:
            bends = generator.uniform(-0.5, 0.5, 3)
            x = "(x - ({:.17g})*p - ({:.17g})*r - ({:.17g})*p*r)".format(*bends)
    at = {"p": 0.0, "r": 0.0}
    roots = np.roots([1.0, 0.0, eval(level, at), eval(slope, at)])
    start = float(roots[np.abs(roots.imag) < 1e-9].real[0])
    structure = em.EnergyStructure(
        f"{x}**4/4 + {level}*{x}**2/2 + {slope}*{x}",
        [em.Unknown("x", start, guesses=(-2.5, 3.5))],
        [em.Parameter(name, "1", 1.0, "actuator", 0.0) for name in "pr"],
    )
    with unchecked():
        return em.equilibrium_set(structure, BOX, intervals=grid)


def assert_whole(eset, known):
    assert eset.audit.clean, eset.audit
    assert len(eset.folds) + len(eset.crossings) > 0
    assert (eset.audit.components, eset.audit.euler_characteristic) == known


@pytest.mark.parametrize(
    ("number", "kind", "known"),
    [(3, "strip", STRIP), (9, "lips", LIPS), (12, "lips", LIPS)],
)
def test_islands_that_no_edge_meets_are_lifted(number, kind, known):
    """Cells of 0.2; the last island is two fingers 0.0024 wide, of which one was cut off."""
    assert_whole(island(number, kind), known)


def test_an_island_whose_edges_all_meet_one_arc_of_it_is_no_closed_piece():
    """Of two arcs that meet in cusps, all edges at the only vertex in the lips cross the same one.

    Their fold points were joined along this arc, forth and back: a second component, a sphere.
    """
    assert_whole(island(51, "lips", 78, TINY), LIPS)


@pytest.mark.parametrize(
    ("number", "seed", "sizes"),
    [(72, 78, TINY), pytest.param(28, 90, SIZES, marks=pytest.mark.slow)],
)
def test_curves_over_the_smallest_edges_of_an_island_are_traced(number, seed, sizes):
    """Edges of 1e-4, on which steps that turn by little are shorter than 1e-7: 20 were lost."""
    assert_whole(island(number, "lips", seed, sizes), LIPS)


def island_in_space(number, kind):
    """Random ellipsoid y = (u/a, v/b, w/c), |y| < 1; half axes 0.01 to 0.15 in cells of 0.3 to 0.5.

    Lips: x³ + h (v²/b² + w²/c² − 1) x + 0.385 h^1.5 u/a = 0, bent for odd numbers: the graph of u,
    a ball. Sphere: x² + ε² (|y|² − 1) = 0 beside x = 3: a three-sphere and a ball.
    """
    seed = {"lips": 77, "sphere": 81}[kind]
    generator = np.random.default_rng([seed, number, 3])
    half = 10.0 ** generator.uniform(np.log10(0.01), np.log10(0.15))
    axes = half * 10.0 ** generator.uniform(-0.7, 0.0, 3)
    axes[0] = half
    centre = generator.uniform(-0.7, 0.7, 3)
    turn = np.linalg.qr(generator.normal(size=(3, 3)))[0] / axes[:, None]
    grid = tuple(int(count) for count in generator.integers(4, 7, 3))
    away = [f"({name} - ({at:.17g}))" for name, at in zip("prs", centre, strict=True)]
    u, v, w = ("(" + " + ".join(f"({t:.17g})*{y}" for t, y in zip(row, away, strict=True)) + ")"
               for row in turn)  # fmt: skip
    if kind == "lips":
        height, x = 10.0 ** generator.uniform(-3.0, -1.0), "x"
        if number % 2:
            bends = generator.uniform(-0.5, 0.5, 4)
            x = "(x - ({:.17g})*p - ({:.17g})*r - ({:.17g})*p*r - ({:.17g})*s)".format(*bends)
        level, slope = f"{height:.17g}*({v}**2 + {w}**2 - 1)", f"{0.385 * height**1.5:.17g}*{u}"
        energy = f"{x}**4/4 + {level}*{x}**2/2 + {slope}*{x}"
        at = {"p": 0.0, "r": 0.0, "s": 0.0}
        roots = np.roots([1.0, 0.0, eval(level, at), eval(slope, at)])
        start = float(roots[np.abs(roots.imag) < 1e-9].real[0])
    else:
        c, start = generator.uniform(-0.5, 0.5), 3.0
        square = f"({c**2:.17g} + {half**2:.17g}*({u}**2 + {v}**2 + {w}**2 - 1))"
        energy = (
            f"x**4/4 - ({2 * c + 3:.17g})*x**3/3 + ({6 * c:.17g} + {square})*x**2/2 - 3*{square}*x"
        )
    unknown = em.Unknown("x", start, guesses=(-2.5, 3.5))
    parameters = [em.Parameter(name, "1", 1.0, "actuator", 0.0) for name in "prs"]
    with unchecked():
        return em.equilibrium_set(
            em.EnergyStructure(energy, [unknown], parameters),
            em.Box(p=(-1, 1), r=(-1, 1), s=(-1, 1)),
            intervals=grid,
        )


BALL, SPHERE = (1, 1), (2, 1)
"""Components and Euler characteristic; that of a three-sphere is zero."""


@pytest.mark.parametrize(
    ("number", "kind", "known"),
    [
        (3, "lips", BALL),
        (1, "sphere", SPHERE),
        (11, "sphere", SPHERE),
        (18, "lips", BALL),
        *(pytest.param(k, "lips", BALL, marks=pytest.mark.slow) for k in (1, 4)),
    ],
)
def test_islands_over_three_parameters_are_in_one_piece(number, kind, known):
    """Lips were closed in two to four pieces, spheres in two, under clean audits.

    Some pass a side without meeting its edges: a straight way leads from part to part.
    """
    assert_whole(island_in_space(number, kind), known)


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "known"), [("strip", STRIP), ("lips", LIPS)])
def test_random_islands_are_whole_or_named(kind, known):
    """Of 40 each; without the look at determinants half of the strips are missed."""
    named = 0
    for number in range(40):
        eset = island(number, kind)
        if eset.audit.clean:
            assert_whole(eset, known)
        named += not eset.audit.clean
    assert named <= 6


def test_sheets_that_no_search_sees_are_found_as_mirror_images(monkeypatch):
    """The spring at x_l < 1 near F = 0: sheets at ±δ, which join only beyond the box."""

    def lower(states):
        return states.z[:, 0] < -0.1

    for module in (seeds, completeness):
        monkeypatch.setattr(module, "search_points", blind(module.search_points, lower))
    monkeypatch.setattr(completeness, "SCATTERED", 0)
    box = em.Box(x_l=(0.6, 0.8), F=(-0.01, 0.01))
    with unchecked():
        lone = em.equilibrium_set(em.Spring(), box, intervals=(4, 4), checks=0)
        assert len(lone.strata) < 3
        assert not lone.holding(completeness._mirrored(lone))[0].all()
        eset = em.equilibrium_set(em.Spring(), box, intervals=(4, 4))
    assert eset.audit.clean
    assert sorted(each.index for each in eset.strata) == [0, 0, 1]


@pytest.mark.parametrize("d", [2, 3])
def test_quadratic_polynomials_are_read_from_corners_and_other_points(d):
    """As many other points as products: the polynomial itself. Least values by a fine lattice."""
    generator = np.random.default_rng(d)
    corners = np.concatenate([np.zeros((1, d)), np.eye(d)])
    middles = np.array([0.5 * (one + other) for one, other in combinations(corners, 2)])
    terms = generator.normal(size=(20, 1 + d + len(middles)))
    at = middles + generator.uniform(-0.1, 0.1, (20, *middles.shape))
    values = np.einsum("nk,nmk->nm", terms, monomials(at))
    found = through_corners(terms @ monomials(corners).T, at, values)
    # what leaves directions straight in which nothing is known moves the others a little
    np.testing.assert_allclose(found, terms, atol=1e-6)
    fine = generator.dirichlet(np.ones(d + 1), 20000)[:, 1:]
    least, shares = least_in_simplex(terms, d)
    np.testing.assert_allclose(shares.sum(axis=1), 1.0)
    reached = np.einsum("nk,nk->n", terms, monomials(shares[:, 1:]))
    np.testing.assert_allclose(reached, least, atol=1e-12)
    # on edges of the simplex it is taken on a lattice of quarters
    assert (least <= (terms @ monomials(fine).T).min(axis=1) + 0.2).all()


@pytest.mark.parametrize("d", [2, 3])
def test_places_become_vertices_of_the_grid(d):
    """After as many splits as there are parameters; more where a sliver would be parted off."""
    box, counts = em.Box(**dict.fromkeys("prs"[:d], (-1.0, 1.2))), []
    for seed in range(20):
        place = np.random.default_rng(seed).uniform(-0.95, 1.15, d)
        mesh = grid_mesh(grid_lines(box, (4, 5, 3)[:d]))
        known = len(mesh.vertices)
        while np.linalg.norm(mesh.vertices - place, axis=1).min() > 1e-12:
            edge, share = split_at(mesh, place)
            mesh = bisect(mesh, np.array([edge]), {edge: share})
            assert len(mesh.vertices) < known + 40
        counts.append(len(mesh.vertices) - known)
    assert np.median(counts) == d


@pytest.mark.parametrize("kind", ["strip", "lips"])
def test_islands_are_found_by_determinants_beyond_the_range_of_numbers(kind, monkeypatch):
    """Those of many unknowns: here of the same islands, times 2^6000. Same cells, bit for bit."""
    known, advance = island(0, kind), em.EnergyStructure.advance

    def scaled(*given):
        step = advance(*given)
        return replace(step, determinant=step.determinant + np.array([0.0, 6000.0]))

    monkeypatch.setattr(em.EnergyStructure, "advance", scaled)
    found = island(0, kind)
    np.testing.assert_array_equal(found.points.z, known.points.z)
    np.testing.assert_array_equal(found.cells, known.cells)


def test_cells_without_an_island_are_not_searched_again(monkeypatch):
    """States with the other index, here on parts that cells cut off, are found each time."""
    eset, counts, inside = island(9, "lips"), [], hidden_islands._inside

    def counted(setting, patches, *given):
        counts.append(len(patches.unit))
        return inside(setting, patches, *given)

    monkeypatch.setattr(hidden_islands, "_inside", counted)
    finder = hidden_islands.IslandFinder()
    first, searched = finder.find(eset), counts[0]
    counts.clear()
    again = finder.find(eset)
    assert len(first) > 0
    np.testing.assert_array_equal(first.z, again.z)
    assert 0 < counts[0] < searched / 2
