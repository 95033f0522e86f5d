"""Determinants of structures with many unknowns, which are beyond the range of numbers.

Those of rods grow by 10 to 40 for each unknown: with 350 unknowns in space, or 300 in the plane,
they pass 1e308. Along a path they vary by a factor that does not depend on the number of elements.
"""

import numpy as np
import pytest

import equimorph as em
from equimorph.linalg import no_border, solve_bordered
from equimorph.linalg.determinants import in_units, no_determinants
from equimorph.structures import Bar, Frame, Member, Rod, Truss, natural_state

LARGEST = np.log(np.finfo(float).max)
ROUND = {"torsion": 0.77, "lateral": 1.0}
THRUST = {"P": em.PointForce(1.0, (-1.0, 0.0, 0.0))}


def some_of(start, goal):
    """Four states along a path."""
    states = em.lift(start, goal).states
    return states[np.linspace(0, len(states) - 1, 4).astype(int)]


def logarithms(determinants):
    """log |det| of determinants m·2^e."""
    return np.log(np.abs(determinants[:, 0])) + np.log(2.0) * determinants[:, 1]


def assert_told(determinants, sign, logarithm, rtol=1e-9):
    """Signs and logarithms of determinants are those of LAPACK."""
    np.testing.assert_array_equal(np.sign(determinants[:, 0]), sign)
    np.testing.assert_allclose(logarithms(determinants), logarithm, rtol=0.0, atol=rtol)


def steps_of(states):
    """Determinants that Newton steps tell."""
    z, one = states.z, np.ones(len(states.z))
    still = np.zeros_like(states.p), np.zeros_like(z)
    return states.structure.advance(z, states.p, *still, one, 0.0 * one).determinant


SPATIAL = {
    "arch": ({"torsion": 0.77, "lateral": 3.0}, {"Theta": 0.9}, {"q": 1.4}),
    "curved cantilever": (
        {**ROUND, "ends": ("clamped", "free"), "curvature": 3.0, "natural_twist": 1.0},
        {},
        {"q": 1.0},
    ),
    "column": ({**ROUND, "ends": ("clamped", "free"), "loads": THRUST}, {}, {"P": 0.05}),
    "pinned": (
        {"torsion": 0.77, "lateral": 3.0, "ends": ("pinned", "clamped")},
        {"theta_B": -0.5},
        {"q": 0.2},
    ),
    "soft": ({**ROUND, "axial": 400.0, "shear": 150.0}, {"Theta": 0.5}, {"twist_B": 1.0}),
    "orbits": ({**ROUND, "ends": ("clamped", "guided"), "loads": THRUST}, {}, {"P": 0.9}),
}


@pytest.mark.parametrize("elements", [10, 20, 40])
@pytest.mark.parametrize("kind", SPATIAL)
def test_determinants_of_rods_in_space_are_those_of_the_matrix_with_many_elements(kind, elements):
    """LU of the assembled matrix. Round-off of its logarithm: 1e-9."""
    options, shape, goal = SPATIAL[kind]
    rod = em.SpatialRod(**options, elements=elements)
    states = some_of(rod.natural_state(**shape), goal)
    z, p, mechanics = states.z, states.p, rod.mechanics
    whole = mechanics.layout.dense(mechanics.entries(z, p))
    sign, logarithm = np.linalg.slogdet(whole)
    assert (logarithm[0] > LARGEST) == (elements > 10)
    assert_told(steps_of(states), sign, logarithm)
    nothing = np.zeros((len(z), 0, rod.size))
    assert_told(rod.solve(z, p, nothing).determinant, sign, logarithm)
    assert_told(mechanics.layout.solve(mechanics.entries(z, p), None, nothing).determinant, sign,
                logarithm)  # fmt: skip


@pytest.mark.parametrize("elements", [10, 40])
def test_determinants_with_a_phase_condition_are_those_of_the_matrix_with_many_elements(elements):
    """LU of the matrix with the condition, off the axis; first order in the residual."""
    rod = em.SpatialRod(**ROUND, loads={}, span=0.95, phase=True, elements=elements)
    states = some_of(rod.natural_state(twist_B=6.0), {"nu": -0.1})
    mechanics = rod.mechanics
    sign, logarithm = np.linalg.slogdet(
        mechanics.layout.dense(mechanics.entries(states.z, states.p))
    )
    assert (logarithm[0] > LARGEST) == (elements > 10)
    assert_told(steps_of(states), sign, logarithm, 1e-6)


def girder(bays, stiffness):
    """A cantilever of square bays with one diagonal each."""
    joints = {f"b{i}": (i, 0.0) for i in range(bays + 1)}
    joints |= {f"t{i}": (i, 1.0) for i in range(bays + 1)}
    pairs = [(f"b{i}", f"t{i}") for i in range(1, bays + 1)]
    for i in range(bays):
        ends = (f"b{i}", f"b{i + 1}"), (f"t{i}", f"t{i + 1}"), (f"b{i}", f"t{i + 1}")
        pairs += list(ends)
    bars = [Bar(pair, stiffness) for pair in pairs]
    return Truss(joints, bars, {"b0": "xy", "t0": "xy"}, {"F": {f"t{bays}": (0.0, -1.0)}})


def arcade(bays, axial):
    """A row of portals."""
    joints = {f"a{i}": (i, 0.0) for i in range(bays + 1)}
    joints |= {f"c{i}": (i, 1.0) for i in range(bays + 1)}
    pairs = [(f"a{i}", f"c{i}") for i in range(bays + 1)]
    pairs += [(f"c{i}", f"c{i + 1}") for i in range(bays)]
    supports = {f"a{i}": "fixed" for i in range(bays + 1)}
    loads = {"P": {f"c{i}": (0.1, -1.0) for i in range(bays + 1)}}
    members = [Member(pair, 1.0, axial) for pair in pairs]
    return Frame(joints, members, supports, loads, elements=1, degree=6)


PLANAR = {
    "truss": (lambda: girder(40, 2e7), {}, {"F": 12.0}),
    "frame": (lambda: arcade(40, 100.0), {}, {"P": 0.3}),
    "inextensible frame": (lambda: arcade(40, None), {}, {"P": 0.3}),
    "arch": (lambda: Rod("uniform", elements=60, degree=9), {"Theta": 0.9}, {"q": 2.0}),
    "cantilever": (
        lambda: Rod("uniform", ends=("clamped", "free"), elements=60, degree=9),
        {},
        {"q": 2.0},
    ),
}


@pytest.mark.parametrize("kind", PLANAR)
def test_determinants_of_large_structures_in_the_plane_are_those_of_the_matrix(kind):
    """LU of the inverse, by as many solves as columns; 1e-8: its condition."""
    make, shape, goal = PLANAR[kind]
    structure = make()
    states = some_of(natural_state(structure, **shape), goal)
    inverse = structure.solve(
        states.z, states.p, np.tile(np.eye(structure.size), (len(states), 1, 1))
    ).x
    sign, logarithm = np.linalg.slogdet(inverse)
    assert -logarithm[0] > LARGEST
    assert_told(steps_of(states), sign, -logarithm, 1e-8)


@pytest.mark.parametrize("power", [-12.0, 12.0])
def test_determinants_of_large_and_small_dense_matrices_are_those_of_libraries(power):
    """LAPACK; matrices with 2 × 2 pivots, scaled. 1e-9: round-off of the logarithm."""
    generator = np.random.default_rng(5)
    matrix = 10.0**power * generator.normal(size=(3, 80, 80))
    matrix += matrix.transpose(0, 2, 1)
    matrix[:, 50:, 50:] = 0.0
    found = solve_bordered(matrix, *no_border(3, 80), np.zeros((3, 0, 80)))
    sign, logarithm = np.linalg.slogdet(matrix)
    assert (np.abs(logarithm) > LARGEST).all()
    assert_told(found.determinant, sign, logarithm)


def test_determinants_in_units_are_numbers():
    """m·2^e over 2^u, by hand; beyond the range of numbers infinite or 0, and nan where none is."""
    given = np.array([[0.75, 512.0], [-3.0, 256.0], [1.0, 9000.0], [1.0, -9000.0], [0.0, 0.0]])
    np.testing.assert_array_equal(in_units(given, 510.0), [3.0, -3.0 * 2.0**-254, np.inf, 0.0, 0.0])
    np.testing.assert_array_equal(in_units(given[:2], given[:2, 1]), [0.75, -3.0])
    assert np.isnan(in_units(no_determinants(2), 256.0)).all()
