"""Frames in space against rods in space, planar frames, statics, and dense algebra."""

import tracemalloc

import numpy as np
import pytest

import equimorph as em
from oracles.spatial_frames import bend, shed
from typecheck import unchecked


def lifted(structure, *steps):
    with unchecked():
        path = em.lift(structure.natural_state(), list(steps))
    assert path.end.kind == "arrived"
    return path.end.state


def test_one_member_is_a_rod_in_space():
    """The same elements: places, curvature and couples to 1e-9, margins by the rod's unit."""
    force = (0.2, -1.0, 0.4)
    rod = em.SpatialRod(
        torsion=0.7, lateral=2.0, ends=("clamped", "free"), elements=2, EI=1.0, length=1.0,
        loads={"P": em.PointForce(1.0, force)},
    )  # fmt: skip
    member = em.SpatialMember(("A", "B"), EI=1.0, EI_out=2.0, GJ=0.7, normal=(0, 1, 0))
    joints = {"A": (0, 0, 0), "B": (1, 0, 0)}
    frame = em.SpatialFrame(joints, [member], {"A": "fixed"}, {"P": {"B": force}})
    one, other = lifted(rod, {"P": 5.0}), lifted(frame, {"P": 5.0})
    for axis, coordinate in zip("xyz", rod.position(1.0), strict=True):
        assert frame.place("B", axis)(other) == pytest.approx(coordinate(one), abs=1e-9)
        couple = rod.descriptor(f"end_couple(0, {axis})")(one)
        assert frame.couple("A", axis)(other) == pytest.approx(couple, abs=1e-9)
    assert frame.max_curvature(other) == pytest.approx(rod.max_curvature(one), rel=1e-9)
    assert other.margin == pytest.approx(4.0 * np.pi**2 * one.margin, rel=1e-9)


PORTAL = {"A": (0.0, 0.0), "B": (0.0, 1.0), "C": (1.2, 1.1), "D": (1.3, 0.0)}


@pytest.mark.parametrize("axial", [None, 60.0])
def test_a_planar_frame_in_space_is_the_planar_frame(axial):
    """A portal of strips that do not leave the plane, by the degree of the planar default."""
    pairs = [("A", "B"), ("B", "C"), ("C", "D")]
    planar = em.Frame(
        PORTAL, [em.Member(pair, 1.0, axial) for pair in pairs], {"A": "fixed", "D": "pinned"},
        {"P": {"B": (1, -2)}},
    )  # fmt: skip
    across = {"B": (0, 1, 0), "A": (1, 0, 0), "C": (1, 0, 0)}
    members = [
        em.SpatialMember(pair, EI=1.0, EI_out=40.0, GJ=40.0, EA=axial, normal=across[pair[0]])
        for pair in pairs
    ]
    joints = {name: (*place, 0.0) for name, place in PORTAL.items()}
    held = {"A": "fixed", "D": "pinned"}
    frame = em.SpatialFrame(joints, members, held, {"P": {"B": (1, -2, 0)}}, degree=8)
    one, other = lifted(planar, {"P": 2.0}), lifted(frame, {"P": 2.0})
    for axis in "xy":
        moved = planar.displacement("C", axis)(one)
        assert frame.displacement("C", axis)(other) == pytest.approx(moved, abs=1e-9)
        held = planar.reaction("D", axis)(one)
        assert frame.reaction("D", axis)(other) == pytest.approx(held, abs=1e-8)
    # the binormal of B-C is along z: its moment is that in the plane, but for the axis' sense
    bending = planar.moment("B-C", "C")(one)
    assert abs(frame.moment("B-C", "C", "b")(other)) == pytest.approx(abs(bending), rel=1e-8)
    assert frame.displacement("C", "z")(other) == pytest.approx(0.0, abs=1e-12)


def test_small_loads_across_a_right_angle_bend():
    """P L³/EI (1/3 + 1/3 + EI/GJ): bending of both legs, and twist of the first. O(P²)."""
    joints = {"A": (0, 0, 0), "B": (1, 0, 0), "C": (1, 1, 0)}
    member = em.SpatialMember(("A", "B", "C"), EI=1.0, GJ=0.5)
    frame = em.SpatialFrame(joints, [member], {"A": "fixed"}, {"P": {"C": (0, 0, -1)}})
    state = lifted(frame, {"P": 1e-4})
    sunk = -frame.displacement("C", "z")(state) / 1e-4
    assert sunk == pytest.approx(1.0 / 3.0 + 1.0 / 3.0 + 2.0, abs=1e-5)
    assert frame.moment("A-B", "A", "t")(state) == pytest.approx(-1e-4, rel=1e-6)


@pytest.mark.parametrize("make", [shed, bend])
def test_reactions_balance_the_loads_in_any_equilibrium(make):
    """Forces and couples about the origin: 1e-8 of what acts; members end where joints are."""
    frame = make()
    target = {"P": 0.5} if make is bend else {"P": 0.3, "q": 0.2, "b": 0.1}
    state = lifted(frame, target)
    z, p, model = state.z[None], state.p[None], frame.model
    places = model.network.places / model.length + frame.displacements(z, p)[0]
    given = model.patterns
    lines = np.einsum("k,kma->ma", state.p, given.lines)
    nodes, weights = model.mesh.nodes, model.mesh.weights
    along = frame.outline(z, p, nodes)[0]
    forces = np.einsum("k,kja->ja", state.p, given.forces) + frame.reactions(z, p)[0]
    total = forces.sum(axis=0) + (lines * model.lengths[:, None]).sum(axis=0)
    np.testing.assert_allclose(total, 0.0, atol=1e-9)
    turning = np.cross(places, forces).sum(axis=0) + frame.couples(z, p)[0].sum(axis=0)
    pressed = np.einsum("n,mna,m->mna", weights, np.cross(along, lines[:, None]), model.lengths)
    if make is bend:  # the other frame is sprung by hinges and couples about their axes
        np.testing.assert_allclose(turning + pressed.sum(axis=(0, 1)), 0.0, atol=1e-8)
    ends = along[:, [0, -1]]
    np.testing.assert_allclose(ends, places[model.network.ends], atol=1e-9)


def test_the_index_is_that_of_dense_eigenvalues():
    """200 random states of two frames: as many negative eigenvalues as multipliers, and more."""
    generator = np.random.default_rng(3)
    for frame in (shed(), bend()):
        p = 0.2 * generator.normal(size=(100, len(frame.parameters)))
        z = frame.sample(p, generator)
        z[:, : frame.constraints] *= 1.0 + 0.1 * generator.normal(size=(100, frame.constraints))
        unit = np.tile(np.eye(frame.size), (100, 1, 1))
        with unchecked():
            solved = frame.solve(z, p, unit)
            index = frame.index(z, p)
        values = np.linalg.eigvalsh(np.linalg.inv(solved.x.transpose(0, 2, 1)))
        np.testing.assert_array_equal(index, (values < 0.0).sum(axis=1) - frame.constraints)
        assert len(np.unique(index)) > 3


def test_a_frame_that_is_drawn_turned_moves_turned():
    """A rotation of everything leaves energies, margins and curvatures as they are."""
    turn = np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))[0]
    turn *= np.sign(np.linalg.det(turn))
    results = []
    for rotation in (np.eye(3), turn):
        joints = {"A": (0, 0, 0), "B": (1, 0.2, 0), "C": (1.2, 1, 0.3), "D": (0.4, 0.3, 1.0)}
        joints = {name: tuple(rotation @ np.array(place)) for name, place in joints.items()}
        normal = tuple(rotation @ np.array([0.1, 0.2, 1.0]))
        axis = tuple(rotation @ np.array([0.0, 0.0, 1.0]))
        members = [
            em.SpatialMember(("A", "B", "C"), EI_out=3.0, normal=normal, EA=90.0, curvature=0.2),
            em.SpatialMember(("D", "B"), EI_out=2.0, normal=normal, EA=90.0, hinges={"B": axis}),
        ]
        load = tuple(rotation @ np.array([0.2, -0.4, -1.0]))
        held = {"A": "fixed", "D": "fixed", "C": {"line": axis}}
        frame = em.SpatialFrame(joints, members, held, {"P": {"B": load}})
        state = lifted(frame, {"P": 3.0})
        travel, bent = frame.travel("P")(state), frame.max_curvature(state)
        results.append([travel, bent, state.margin, frame.hinge("D-B", "B")(state)])
    np.testing.assert_allclose(results[1], results[0], rtol=1e-9)


def test_initial_stress_of_a_member_that_is_too_long():
    """Between fixed ends ε = 1 − L/l = 0.01 squeezes by EA ε, below the Euler load 4π² EI/l²."""
    joints = {"A": (0, 0, 0), "B": (1, 0, 0), "C": (2, 0, 0)}
    member = em.SpatialMember(("A", "B", "C"), EA=400.0, length=2.0 * 1.01)
    held = {"A": "fixed", "C": "fixed"}
    frame = em.SpatialFrame(joints, [member], held, {"P": {"B": (0, 0, -1)}})
    state = frame.natural_state()
    assert frame.force("A-B", "A", "t")(state) == pytest.approx(-4.0, rel=1e-9)
    assert state.stable
    assert state.residual < 1e-9


def test_a_ring_of_intrinsic_curvature_stands_under_stress():
    """A closed polygon of four arcs that want to be straighter: b-moments, and no net reaction."""
    joints = {"A": (1, 0, 0), "B": (0, 1, 0), "C": (-1, 0, 0), "D": (0, -1, 0)}
    bends = em.SpatialMember(
        ("A", "B", "C", "D", "A"), curvature=1.0, normal=(0, 0, 1), EI_out=2.0,
        strains=(0.0, 0.0, -0.2),
    )  # fmt: skip
    frame = em.SpatialFrame(joints, [bends], {"A": "fixed"}, {"P": {"C": (0, 0, -1)}})
    state = frame.natural_state()
    assert frame.residual(state.z[None], state.p[None]) == pytest.approx(0.0, abs=1e-9)
    assert [frame.reaction("A", axis)(state) for axis in "xyz"] == pytest.approx(
        [0, 0, 0], abs=1e-9
    )


def test_errors_are_estimated_and_small():
    """The estimate bounds the change from degree 4 to 12 of a bent frame."""
    joints = {"A": (0, 0, 0), "B": (1, 0, 0), "C": (1, 1, 0)}
    tips = []
    for degree in (4, 12):
        frame = em.SpatialFrame(
            joints, [("A", "B", "C")], {"A": "fixed"}, {"P": {"C": (0, 0, -1)}}, degree=degree
        )
        state = lifted(frame, {"P": 3.0})
        tips.append(frame.place("C", "z")(state))
        if degree == 4:
            bound = frame.error_estimate(state.z[None], state.p[None])[0]
    assert abs(tips[1] - tips[0]) < bound < 1e-2


def lattice(columns, rows):
    """Rods along x that are hinged to rods along y, pinned at their ends."""
    along = [[f"{i}x{j}" for i in range(columns + 2)] for j in range(1, rows + 1)]
    across = [[f"{i}x{j}" for j in range(rows + 2)] for i in range(1, columns + 1)]
    joints = {name: (*map(float, name.split("x")), 0.0) for rod in along + across for name in rod}
    members = [em.SpatialMember(rod, EA=2000.0) for rod in along]
    for rod in across:
        hinges = dict.fromkeys(rod[1:-1], (0.0, 0.0, 1.0))
        members.append(em.SpatialMember(rod, EA=2000.0, hinges=hinges))
    ends = dict.fromkeys((rod[k] for rod in along + across for k in (0, -1)), "pinned")
    load = {"P": {across[0][1]: (0.0, 0.0, 1.0)}}
    return em.SpatialFrame(joints, members, ends, load, elements=1, degree=5)


def test_memory_of_a_grid_is_linear_in_its_members():
    """Largest bytes of construction, step, tangent and index of eight states: power 1.04.

    1.1: the factor of a plane graph has O(n log n) entries. The tables of the elimination alone
    grew as the power 1.3; circulations, which are kept once, grow as n².
    """
    most = []
    with unchecked():
        for size in ((2, 2), (2, 2), (6, 7)):  # the first one also imports and compiles
            tracemalloc.start()
            frame = lattice(*size)
            z, p = frame.natural_guess(np.zeros((8, 1))), np.zeros((8, 1))
            ones = np.ones(8)
            assert np.isfinite(frame.advance(z, p, p + 1.0, 0.0 * z, ones, ones).dz).all()
            most.append((frame.model.pieces, tracemalloc.get_traced_memory()[1]))
            tracemalloc.stop()
    (_, (few, less), (many, more)) = most
    assert (few, many) == (12, 97)
    assert np.log(more / less) / np.log(many / few) < 1.1


TOGGLE = {"A": (0, 0), "B": (0.5, 0.2), "C": (1, 0)}


@pytest.mark.parametrize(
    ("places", "held", "force", "bound", "states"),
    [
        (TOGGLE, {"A": "fixed", "C": "pinned"}, (-3.04, -7.16), 8.94, 5),
        (TOGGLE, {"A": "fixed", "C": "pinned"}, (-9.03, -2.31), 7.55, 3),
        ({"A": (0, 0), "B": (0, 1), "C": (1, 1)}, {"A": "fixed"}, (-22.11, 7.0), 8.93, 2),
    ],
)
@pytest.mark.parametrize("seed", [0, 1])
def test_states_of_a_plane_frame_are_found_in_space(places, held, force, bound, states, seed):
    """All of the planar frame's: guesses in all directions met one, "at most 1"."""
    pairs, at = [("A", "B"), ("B", "C")], {"P": 1.0}
    loads = {"P": {"B": force}}
    planar = em.Frame(places, [em.Member(pair, 1.0) for pair in pairs], held, loads)
    joints = {name: np.array([*place, 0.0]) for name, place in places.items()}
    members = [
        em.SpatialMember(
            pair, EI=1.0, EI_out=4.5, GJ=1.7,
            normal=tuple(np.cross([0, 0, 1], joints[pair[1]] - joints[pair[0]])),
        ) for pair in pairs
    ]  # fmt: skip
    frame = em.SpatialFrame(
        {name: tuple(place) for name, place in joints.items()},
        members,
        held,
        {"P": {"B": (*force, 0)}},
    )
    energies = []
    for each in (planar.resolving(bound), frame.resolving(bound)):
        found = em.find_equilibria(each, at, within=[each.max_curvature <= bound], seed=seed)
        across = np.abs(each.shape(found.z, found.p)[..., 2:])
        inside = np.nanmax(across, axis=(1, 2), initial=0.0) < 1e-6
        energies.append(np.sort([state.energy for state in found[inside]]))
    assert len(energies[0]) == states
    assert energies[1] == pytest.approx(energies[0], abs=1e-3)
