"""Vibrations on springs whose places the unknowns leave free, against beams of cubic elements."""

from itertools import pairwise

import numpy as np
import pytest
from scipy.linalg import eigh

import equimorph as em
from equimorph.dynamics.own_equations import OwnModel
from equimorph.errors import InputError

PARTS = 32
"""Cubic elements along each member of the oracle."""
FIRM = 1e7
"""Axial stiffness of the oracle, whose members the frames do not stretch."""
LOAD = {"P": em.PointForce(1.0)}
SOFT = (1e4, 1e2, 1.0, 1e-1)


def element(h, turn):
    """Stiffness and consistent mass of a beam of length h, EI = 1 and mass 1 per length, turned."""
    bend = np.array([[12, 6 * h, -12, 6 * h], [0, 4 * h * h, -6 * h, 2 * h * h]])
    bend = np.vstack([bend, [0, 0, 12, -6 * h], [0, 0, 0, 4 * h * h]])
    heavy = np.array([[156, 22 * h, 54, -13 * h], [0, 4 * h * h, 13 * h, -3 * h * h]])
    heavy = np.vstack([heavy, [0, 0, 156, -22 * h], [0, 0, 0, 4 * h * h]])
    stiff, mass, across = np.zeros((6, 6)), np.zeros((6, 6)), [1, 2, 4, 5]
    stiff[np.ix_(across, across)] = (bend + np.triu(bend, 1).T) / h**3
    mass[np.ix_(across, across)] = (heavy + np.triu(heavy, 1).T) * h / 420.0
    stiff[np.ix_([0, 3], [0, 3])] = FIRM / h * np.array([[1, -1], [-1, 1]])
    mass[np.ix_([0, 3], [0, 3])] = h / 6.0 * np.array([[2, 1], [1, 2]])
    c, s = np.cos(turn), np.sin(turn)
    rotation = np.kron(np.eye(2), [[c, s, 0], [-s, c, 0], [0, 0, 1]])
    return rotation.T @ stiff @ rotation, rotation.T @ mass @ rotation


def frequencies(joints, pairs, supports, count):
    """Angular frequencies of a frame of rigidly joined beams; supports: (joint, x/y/angle) → k."""
    rows = {name: 3 * k for k, name in enumerate(joints)}
    size = 3 * (len(joints) + len(pairs) * (PARTS - 1))
    stiff, mass = np.zeros((size, size)), np.zeros((size, size))
    free = 3 * len(joints)
    for first, last in pairs:
        chord = np.subtract(joints[last], joints[first])
        here = element(np.hypot(*chord) / PARTS, np.arctan2(chord[1], chord[0]))
        starts = [rows[first], *range(free, free + 3 * (PARTS - 1), 3), rows[last]]
        free += 3 * (PARTS - 1)
        for a, b in pairwise(starts):
            at = np.ix_(*2 * ([*range(a, a + 3), *range(b, b + 3)],))
            stiff[at] += here[0]
            mass[at] += here[1]
    held = []
    for (joint, axis), k in supports.items():
        at = rows[joint] + axis
        held += [at] if k == np.inf else []
        stiff[at, at] += 0.0 if k == np.inf else k
    kept = np.setdiff1d(np.arange(size), held)
    squares = eigh(stiff[np.ix_(kept, kept)], mass[np.ix_(kept, kept)], eigvals_only=True)
    return np.sqrt(squares[:count])


BEAM = {"A": (0.0, 0.0), "B": (1.0, 0.0)}


@pytest.mark.parametrize("k", SOFT)
def test_a_beam_on_two_springs_heaves_and_rocks(k):
    """Rods and frames have the frequencies of the oracle, the rigid ones √(2k) and √(6k) too."""
    exact = frequencies(BEAM, [("A", "B")], {("A", 0): np.inf, ("A", 1): k, ("B", 1): k}, 4)
    member = em.Member(("A", "B"), mass=1.0)
    frame = em.Frame(
        BEAM, [member], {"A": {"x": "held", "y": k}, "B": {"y": k}}, {"P": {"B": (0, -1)}}
    )
    ends = em.End(angle="free", y=k), em.End(angle="free", x="free", y=k)
    rod = em.Rod(ends=ends, loads=LOAD, EI=1.0, length=1.0, mass=1.0)
    for structure in (frame, rod):
        found = structure.natural_state().natural_frequencies(4)
        np.testing.assert_allclose(found, exact, rtol=2e-5)


@pytest.mark.parametrize("k", SOFT)
@pytest.mark.parametrize("foot", ["A", "B"])
def test_a_cantilever_moves_with_its_foot(k, foot):
    """Of a rod that one end alone carries, on springs across and against turning."""
    exact = frequencies(BEAM, [("A", "B")], {("A", 0): np.inf, ("A", 1): k, ("A", 2): k}, 4)
    ends = em.End(angle=k, y=k), em.End(angle="free", x="free", y="free")
    if foot == "B":
        ends = em.End(angle="free", y="free"), em.End(angle=k, x="free", y=k)
    rod = em.Rod(ends=ends, loads=LOAD, EI=1.0, length=1.0, mass=1.0)
    np.testing.assert_allclose(rod.natural_state().natural_frequencies(4), exact, rtol=2e-5)


PORTAL = {"A": (0.0, 0.0), "B": (0.0, 1.0), "C": (1.5, 1.0), "D": (1.5, 0.0)}
PAIRS = [("A", "B"), ("B", "C"), ("C", "D")]


@pytest.mark.parametrize("k", SOFT)
@pytest.mark.parametrize("axes", [(0, 1), (1,)])
def test_a_portal_on_springs_moves_as_a_whole(k, axes):
    """Springs outnumber the constraints. 2e-4: members of the oracle stretch, by 1/FIRM."""
    springs = {(foot, axis): k for foot in "AD" for axis in (0, 1)}
    springs |= {(foot, axis): np.inf for foot in "AD" for axis in (0, 1) if axis not in axes}
    exact = frequencies(PORTAL, PAIRS, springs, 5)
    holding = {name: k if axis in axes else "held" for axis, name in enumerate("xy")}
    supports = {"A": holding, "D": {**holding, "angle": 1e-9}}
    members = [
        em.Member(pair, mass=float(np.hypot(*np.subtract(*map(PORTAL.get, pair)))))
        for pair in PAIRS
    ]
    frame = em.Frame(PORTAL, members, supports, {"P": {"B": (1, 0)}})
    found = frame.natural_state().natural_frequencies(5)
    np.testing.assert_allclose(found, exact, rtol=2e-4)


@pytest.mark.parametrize("k", SOFT)
def test_beams_in_space_move_with_their_foot(k):
    """Springs along y and z with other stiffnesses: both planes of the cantilever."""
    exact = [
        frequencies(BEAM, [("A", "B")], {("A", 0): np.inf, ("A", 1): each, ("A", 2): np.inf}, 2)
        for each in (k, 2.0 * k)
    ]
    joints = {name: (*place, 0.0) for name, place in BEAM.items()}
    support = {"x": "held", "y": k, "z": 2.0 * k, "rotation": "held"}
    member = em.SpatialMember(("A", "B"), EI=1.0, GJ=1.0, mass=1.0)
    frame = em.SpatialFrame(joints, [member], {"A": support}, {"P": {"B": (0, 0, -1)}})
    ends = em.SpatialEnd(y=k, z=2.0 * k), em.SpatialEnd("free", *3 * ["free"])
    loads = {"P": em.PointForce(1.0, (0.0, 0.0, -1.0))}
    rod = em.SpatialRod(
        ends=ends, loads=loads, torsion=1.0, lateral=1.0, EI=1.0, length=1.0, mass=1.0
    )
    for structure in (frame, rod):
        found = structure.natural_state().natural_frequencies(4)
        np.testing.assert_allclose(found, np.sort(np.concatenate(exact)), rtol=2e-5)


def test_motions_of_the_unknowns_alone_are_refused():
    """Their equations would hold the springs' places where statics puts them."""
    ends = em.End(angle="free", y=1.0), em.End(angle="free", x="free", y=1.0)
    rod = em.Rod(ends=ends, loads=LOAD, EI=1.0, length=1.0, mass=1.0)
    with pytest.raises(InputError, match="springs"):
        OwnModel(rod, rod.natural_state())


def force_of_inertia(state, rates):
    """dM/dt u̇ − ½ ∂(u̇ᵀMu̇)/∂u by central differences, multipliers following the unknowns."""
    structure, z, p = state.structure, state.z[None], state.p[None]
    n, step = structure.unknowns, 1e-4
    changes = 1e-5 * np.eye(structure.size)
    rows = [structure.residual(z + c, p) - structure.residual(z - c, p) for c in changes]
    rows = np.stack([row[0, n:] for row in rows], axis=1) / 2e-5
    follow = -np.linalg.pinv(rows[:, n:], rcond=1e-8) @ rows[:, :n]

    def change(way):
        both = np.concatenate([way, follow @ way])
        ahead, behind = (structure.inertia(z + step * side * both, p)[0] for side in (1, -1))
        return (ahead - behind) / (2.0 * step)

    twice = [rates @ change(way) @ rates for way in np.eye(n)]
    return change(rates) @ rates - 0.5 * np.array(twice)


def sprung_rod():
    """A planar rod pushed against a spring along its chord."""
    ends = em.End(x=2.0), em.End()
    made = {"EI": 1.0, "length": 1.0, "mass": 1.0, "elements": 2, "degree": 5}
    rod = em.Rod(ends=ends, loads={"P": em.PointForce(0.5)}, **made)
    return em.lift(rod.natural_state(Theta=0.7), {"P": 0.3}).end.state


def sprung_frame(**member):
    """Two members between a spring along x and a pin."""
    joints = {"A": (0.0, 0.0), "B": (1.0, 0.3), "C": (2.0, 0.0)}
    members = [em.Member(pair, mass=1.0, **member) for pair in (("A", "B"), ("B", "C"))]
    supports = {"A": {"x": 3.0, "y": "held", "angle": "held"}, "C": "pinned"}
    frame = em.Frame(joints, members, supports, {"P": {"B": (0, -1)}}, elements=1, degree=4)
    return em.lift(frame.natural_state(), {"P": 2.0}).end.state


@pytest.mark.parametrize(
    "made", [sprung_rod, sprung_frame, lambda: sprung_frame(EA=300.0)], ids=["rod", "frame", "EA"]
)
def test_forces_of_inertia_where_constraints_give_way(made):
    """Multipliers follow the unknowns to second order; held to first they miss as much as is."""
    state = made()
    rates = np.random.default_rng(0).normal(size=state.structure.unknowns)
    found = state.structure.inertial_force(state.z[None], state.p[None], rates[None])[0]
    exact = force_of_inertia(state, rates)
    np.testing.assert_allclose(found, exact, atol=1e-5 * np.abs(exact).max())
