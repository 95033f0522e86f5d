"""Sets of round rods that buckle off their axis, where pairs of eigenvalues vanish."""

import numpy as np
import pytest

import equimorph as em
from equimorph.manifold import VertexKind
from equimorph.manifold.lifting.seeds import is_symmetric
from equimorph.manifold.lifting.spheres import Closed, part
from equimorph.manifold.question import setting_of
from oracles.complexes import assert_crossings
from oracles.kirchhoff import clamped_buckling_moment
from oracles.spatial_rods import coaxial


@pytest.fixture(scope="module")
def rod():
    """A round rod between clamps under thrust, with the phase condition."""
    return em.SpatialRod(
        torsion=3.0, lateral=1.0, ends=("clamped", "guided"), phase=True,
        loads={"P": em.PointForce(1.0, (-1.0, 0.0, 0.0))}, elements=4, degree=5,
    )  # fmt: skip


@pytest.fixture(scope="module")
def column(rod):
    """Its set over the thrust, untwisted, past the first two Euler loads."""
    within = [rod.max_curvature <= 5.0]
    fixed = {"twist_A": 0.0, "twist_B": 0.0}
    return em.equilibrium_set(
        rod, em.Box(P=(0.6, 2.3)), fixed=fixed, within=within, intervals=(6,), checks=0
    )


def test_a_column_buckles_at_both_euler_loads_by_a_pair(column):
    """λ₁ = 1, λ₂ = (x/π)² with tan x = x; the index of the straight one: 0, 2, 4.

    Branches have the index of the straight column below their load; of each circle of states the
    condition picks two. Tolerance: four elements of degree 5.
    """
    assert column.audit.clean
    assert_crossings(column, vanishing=2)
    loads = np.sort(column.points[column.kinds == VertexKind.CROSSING]["P"])
    np.testing.assert_allclose(loads, [1.0, (4.493409457909064 / np.pi) ** 2], rtol=5e-7)
    assert sorted(piece.index for piece in column.strata) == [0, 0, 0, 2, 2, 2, 4]
    for load, index in ((0.8, [0]), (1.02, [0, 0, 2]), (1.5, [2]), (2.1, [2, 2, 4])):
        assert sorted(state.index for state in column.at(P=load)) == index


@pytest.mark.parametrize("distance", [1e-7, 1e-5, 1e-3])
def test_states_next_to_a_pair_have_their_own_index(column, distance):
    """Within 1e-4 of a crossing states are roots of the reduced equation."""
    first = column.points[column.kinds == VertexKind.CROSSING]["P"].min()
    states = column.at(P=first + distance)
    assert sorted(state.index for state in states) == [0, 0, 2]
    at = column.over(P=np.array([first - distance, first + distance]))
    np.testing.assert_array_equal(np.sort(at.index), [0, 0, 0, 2])


def test_the_set_over_twist_and_tension_buckles_along_greenhills_curve(rod):
    """Every crossing, by the determinant of the linear equation of a clamped rod; C = 3.

    Tolerance: as before.
    """
    box, within = em.Box(P=(-0.6, -0.1), twist_B=(2.2, 3.8)), [rod.max_curvature <= 8.0]
    eset = em.equilibrium_set(
        rod, box, fixed={"twist_A": 0.0}, within=within, intervals=(2, 4), checks=0
    )
    assert eset.audit.clean
    assert_crossings(eset, vanishing=2)
    assert sorted(piece.index for piece in eset.strata) == [0, 0, 0, 2]
    assert len(eset.crossings) == 1
    met = eset.points[eset.kinds == VertexKind.CROSSING]
    for tension, twist in zip(-met["P"] * 4.0 * np.pi**2, met["twist_B"], strict=True):
        assert 3.0 * twist == pytest.approx(clamped_buckling_moment(tension), rel=1e-7)


@pytest.mark.parametrize(
    ("crossed", "above", "whole"), [(True, 2, True), (True, 3, False), (False, 2, False)]
)
def test_spheres_are_parted_where_a_pair_vanishes_on_a_crossing(crossed, above, whole):
    """Two pyramids on one triangle: over a fold a single eigenvalue changes its sign."""
    sides = np.array([[0, 1, 3], [1, 2, 3], [2, 0, 3], [0, 1, 4], [1, 2, 4], [2, 0, 4]])
    index, nothing = np.repeat([0, above], 3), np.zeros(0, int)
    met = np.zeros((6, 3), bool)
    met[:, 0] = crossed
    none = np.full(6, -1)
    sphere = Closed(sides, index, np.zeros(6, int), none, met, np.zeros(1, int), nothing)
    assert part(sphere, np.arange(5.0)).whole.tolist() == [whole]


@pytest.mark.slow
def test_greenhills_curve_is_a_surface_over_both_twists(rod):
    """Three free parameters: the moment depends on the difference of the twists alone; C = 3.

    Tolerance: as before.
    """
    box, within = (
        em.Box(P=(-0.6, -0.1), twist_A=(0.0, 0.2), twist_B=(2.2, 3.8)),
        [rod.max_curvature <= 8.0],
    )
    eset = em.equilibrium_set(rod, box, within=within, intervals=(2, 2, 3), checks=0)
    assert eset.audit.clean
    assert_crossings(eset, vanishing=2)
    assert sorted(piece.index for piece in eset.strata) == [0, 0, 0, 2]
    assert len(eset.crossings) == 1
    met = eset.points[eset.kinds == VertexKind.CROSSING]
    twists = met["twist_B"] - met["twist_A"]
    for tension, twist in zip(-met["P"] * 4.0 * np.pi**2, twists, strict=True):
        assert 3.0 * twist == pytest.approx(clamped_buckling_moment(tension), rel=1e-7)


@pytest.mark.slow
def test_random_searches_find_the_states_of_the_set():
    """Independent of lifting: energies and indices over points on both sides of the crossings."""
    rod, _, _ = coaxial()
    within, fixed = [rod.max_curvature <= 6.0], {"twist_A": 0.57, "twist_B": 0.37}
    box = em.Box(P=(-0.15, 0.48), nu=(0.77, 0.81))
    eset = em.equilibrium_set(rod, box, fixed=fixed, within=within, intervals=(3, 3))
    assert eset.audit.clean
    assert_crossings(eset, vanishing=2)
    generator = np.random.default_rng(4)
    for _ in range(25):
        at = dict(zip(box.names, generator.uniform(box.lower, box.upper).tolist(), strict=True))
        found = em.find_equilibria(rod, fixed | at, within=within)
        told = [
            sorted((round(s.energy, 8), s.index) for s in each) for each in (found, eset.at(**at))
        ]
        assert set(told[0]) <= set(told[1])
        assert len(told[1]) in {1, 3}


@pytest.mark.slow
def test_straight_rods_with_whole_turns_more_are_found():
    """Turns by 4π both ways are the same clamps: E = C τ²/(8π²) + the thrust's, C = 0.7.

    They are unstable throughout, join no other states inside the box, and lie where random guesses
    hardly lead: to the axis.
    """
    rod, _, _ = coaxial(elements=8, degree=5)
    fixed = {"twist_A": 0.1, "twist_B": 0.6, "P": 0.0}
    within = [rod.max_curvature <= 3.0]
    eset = em.equilibrium_set(
        rod, em.Box(nu=(0.8, 0.86)), fixed=fixed, within=within, intervals=(4,)
    )
    assert eset.audit.clean
    energies = eset.at(nu=0.83).energy
    for turns in (-1, 0, 1):
        twist = 0.5 + 4.0 * np.pi * turns
        straight = 0.7 * twist**2 / (8.0 * np.pi**2) + 0.5 * 6.0 * 0.17**2
        assert np.abs(energies - straight).min() < 1e-8


def test_searches_begin_from_straight_rods_with_whole_turns():
    """All three with 4π more or less; those with 8π are not resolved. Energies as above."""
    rod, _, _ = coaxial(elements=12, degree=5)
    at = {"twist_A": 0.1, "twist_B": 0.6, "P": 0.0, "nu": 0.83}
    energies = em.find_equilibria(rod, at, within=[rod.max_curvature <= 3.0]).energy
    twists = 0.5 + 4.0 * np.pi * np.arange(-1, 2)
    straight = 0.7 * twists**2 / (8.0 * np.pi**2) + 0.5 * 6.0 * 0.17**2
    np.testing.assert_allclose(np.abs(energies[:, None] - straight).min(axis=0), 0.0, atol=1e-7)


def test_the_turn_along_orbits_asks_for_no_more_searches(rod):
    """It takes each state to the opposite one of its orbit; the mirror of the arch keeps some."""
    box, fixed = em.Box(twist_A=(0.1, 0.4), P=(0.7, 0.9)), {"twist_B": 0.6}
    assert not is_symmetric(setting_of(rod, box, fixed, ()))
    arch, box = em.Rod(load="uniform"), em.Box(Theta=(0.5, 1.0), q=(0.0, 4.0))
    assert is_symmetric(setting_of(arch, box, {"Delta": 0.0}, ()))
