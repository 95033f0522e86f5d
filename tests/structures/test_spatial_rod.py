"""Rods in space against planar rods, closed forms, published values and dense algebra."""

import numpy as np
import pytest
from scipy.linalg import eigh, null_space
from scipy.optimize import brentq

import equimorph as em
from equimorph.equilibria.settle import Guards, settle
from equimorph.errors import InputError
from equimorph.model import parameter_vector
from equimorph.structures.discrete import correct_at_parameters
from equimorph.structures.spatial.planar import PlanarPart
from equimorph.structures.spatial.quaternions import (
    clamp_rotation,
    exponential,
    matrices,
    product,
)
from equimorph.study.structures import SECTIONS
from typecheck import unchecked

LATERAL = 1.601471549048
"""First lateral load of the round arch at (0.9, 0), by the planar second variation."""
PITCHFORK = 4.2439977594
"""Planar pitchfork at (0.9, 0), by the planar rod."""


def arch(torsion=0.77, lateral=1.0, **options):
    return em.SpatialRod(torsion=torsion, lateral=lateral, **options)


def first_event(rod, load, **angles):
    """Parameter value and index below of the first event on the way to a load."""
    path = em.lift(rod.natural_state(**angles), {"q": load})
    return path.events[0] if path.events else path.end


def spectrum(rod, state):
    """Eigenvalues of the constrained Hessian in the metric, by dense algebra."""
    full = rod.mechanics.layout.dense(rod.mechanics.entries(state.z[None], state.p[None]))[0]
    n = rod.unknowns
    basis = null_space(full[n:, :n]) if rod.constraints else np.eye(n)
    mass = basis.T @ (rod.mass[:, None] * basis)
    return eigh(basis.T @ full[:n, :n] @ basis, mass, eigvals_only=True)


# --- the paper's arch ----------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("elements", "degree", "error"), [(6, 4, 1e-7), (8, 5, 2e-10), (6, 6, 4e-11)]
)
def test_round_arch_leaves_its_plane_at_the_lateral_load(elements, degree, error):
    """Three codes agree on the value; the errors are those of a prototype, times 2 to 4."""
    event = first_event(arch(elements=elements, degree=degree), 2.0, Theta=0.9)
    assert event.kind == "branch point"
    assert event.criticality == "supercritical"
    assert event.state["q"] == pytest.approx(LATERAL, abs=error)


def test_lateral_load_does_not_depend_on_torsional_stiffness():
    """At A = 1: C = 0.5 and 0.77 give the same to 2e-11; the resolution adds as much."""
    loads = [first_event(arch(torsion), 2.0, Theta=0.9).state["q"] for torsion in (0.5, 0.77)]
    assert loads[0] == pytest.approx(loads[1], abs=5e-11)


@pytest.mark.parametrize(
    ("elements", "degree", "error"), [(6, 4, 1e-5), (8, 5, 1e-8), (6, 6, 5e-9), (8, 6, 1e-10)]
)
def test_strip_reaches_the_planar_pitchfork(elements, degree, error):
    """A strip of ten times the stiffness aside stays in its plane; errors as of the prototype."""
    rod = arch(1.3, 10.0, elements=elements, degree=degree)
    event = first_event(rod, 4.5, Theta=0.9)
    assert (event.kind, event.criticality) == ("branch point", "subcritical")
    assert event.state["q"] == pytest.approx(PITCHFORK, abs=error)


def test_planar_state_in_space_has_the_known_eigenvalues():
    """q = 4, A = 1: −1.14060993 and 0.11903064 are its two lowest, λ is 1.80440904."""
    rod, planar = arch(elements=8, degree=6), em.Rod()
    state = rod.planar_state(em.lift(planar.natural_state(Theta=0.9), {"q": 4.0}).end.state)
    values = spectrum(rod, state)
    assert state.multipliers[0] == pytest.approx(1.80440904, abs=1e-8)
    assert values[0] == pytest.approx(-1.14060993, abs=1e-8)
    assert np.abs(values - 0.11903064).min() < 1e-8
    assert state.margin == pytest.approx(values[0], abs=1e-9)


def aside(rod, state, place):
    """Equilibrium with z(½) = `place` at a load that is found, by Newton from a state."""
    z, p = state.z[None].copy(), state.p[None].copy()
    q = [each.name for each in rod.parameters].index("q")
    _, _, across = rod.position(0.5)
    dp = np.zeros_like(p)
    dp[:, q] = 1.0
    for _ in range(12):
        moved = np.concatenate([z + 1e-6 * np.eye(rod.size), z - 1e-6 * np.eye(rod.size)])
        values = across.function(moved, p.repeat(len(moved), axis=0))
        row = (values[: rod.size] - values[rod.size :])[None] / 2e-6
        defect = across.function(z, p) - place
        step = rod.advance(z, p, dp, row, np.zeros(1), defect)
        z, p = z + step.dz, p + step.dt[:, None] * dp
    assert step.residual[0] < 1e-10
    return em.structures.State(rod, z[0], p[0])


def test_sideways_branch_is_supercritical_and_rejoins_the_inverted_shape():
    """A dense prototype: q at z(½) = .005, .04, .18, stable; z² = 0.1096 (2.476483 − q) then."""
    rod = arch()
    start = first_event(rod, 2.0, Theta=0.9).state
    shift = np.zeros((1, 37, 3))
    shift[0, :, 0], shift[0, :, 1] = 0.01 * np.sin(np.pi * rod.mesh.nodes), 0.01
    shift[0, :, 1] *= np.sin(2 * np.pi * rod.mesh.nodes)
    q = start.z[: rod.unknowns].reshape(-1, 4)
    bent = product(q, exponential(shift[0, 1:-1]))
    state = em.structures.State(rod, np.append(bent.ravel(), start.z[rod.unknowns :]), start.p)
    for place, load in ((0.005, 1.601557), (0.04, 1.607025), (0.18, 1.777788)):
        state = aside(rod, state, place)
        assert state["q"] == pytest.approx(load, abs=6e-7)
        assert state.index == 0
    moved = em.lift(state, {"q": 2.1}).end.state
    assert rod.height(0.5)(moved) == pytest.approx(-0.0385, abs=1e-4)
    assert rod.position(0.5)[2](moved) == pytest.approx(0.184, abs=5e-4)
    near = em.lift(moved, {"q": 2.4764}).end.state
    square = rod.position(0.5)[2](near) ** 2
    assert square / 0.1096 + near["q"] == pytest.approx(2.476483, abs=2e-6)


def test_both_planar_states_of_the_round_arch_are_unstable_in_space():
    """(1, 0), q = 2.5: margins −0.3424 upright, −0.0765 inverted, index 1 each."""
    rod, planar = arch(), em.Rod()
    setting = {"Theta": 1.0, "Delta": 0.0, "q": 2.5}
    found = em.find_equilibria(planar, setting, within=[planar.max_curvature <= 20])
    pair = sorted(found.stable, key=planar.height(0.5))
    for state, margin in zip(pair, (-0.0765, -0.3424), strict=True):
        inside = rod.planar_state(state)
        assert inside.index == 1
        assert inside.margin == pytest.approx(margin, abs=1e-4)


def test_the_stable_pair_beside_the_plane_has_its_energy():
    """(1, 0), q = 2.5: E = 0.36398, margin 0.1035; pushed aside, loaded, and let go."""
    across = {"side": em.PointForce(0.5, (0.0, 0.0, 1.0))}
    rod = em.SpatialRod("uniform", torsion=0.77, lateral=1.0, loads=across)
    steps = [{"side": 0.02}, {"q": 2.5}, {"side": 0.0}]
    end = em.lift(rod.natural_state(Theta=1.0), steps).end
    assert end.kind == "arrived"
    assert end.state.energy == pytest.approx(0.36398, abs=5e-6)
    assert end.state.margin == pytest.approx(0.1035, abs=5.1e-5)


@pytest.mark.parametrize(("load", "aside"), [(0.3, 0), (0.8, 4)])
def test_a_cantilever_that_is_bent_back_is_found(load, aside):
    """A strip under a dead load across its tip has all three states of the planar rod.

    And four others beside the plane under the larger load, in nine of ten searches at least: one
    random guess in thousands leads to these, and one push in twenty.
    """
    ends, tip, bound = ("clamped", "free"), {"P": em.PointForce(1.0)}, 18.0
    rod = em.SpatialRod(torsion=0.8, lateral=3.0, ends=ends, loads=tip).resolving(bound)
    planar = em.Rod(ends=ends, loads=tip).resolving(bound)
    flat = em.find_equilibria(planar, {"P": load}, within=[planar.max_curvature <= bound])
    heights, complete = np.sort(planar.height(1.0)(flat)), 0
    assert len(flat) == 3
    for seed in range(10):
        found = em.find_equilibria(rod, {"P": load}, seed=seed, within=[rod.max_curvature <= bound])
        tips = rod.shape(found.z, found.p)[:, -1]
        inside = np.sort(tips[np.abs(tips[:, 2]) < 1e-6, 1])
        np.testing.assert_allclose(inside, heights, atol=1e-6)
        complete += len(found) == 3 + aside
    assert complete >= 9


@pytest.mark.parametrize(("axis", "direction"), [(2, (0.0, -1.0, 0.0)), (1, (0.0, 0.0, 1.0))])
def test_what_bends_in_a_plane_is_an_equilibrium_in_space(axis, direction):
    """Up to the errors of the elements: bending about b or about n, as the load has it."""
    loads, ends = {"P": em.PointForce(0.6, direction)}, ("clamped", "pinned")
    rod = em.SpatialRod(torsion=0.8, lateral=3.0, loads=loads, ends=ends, elements=24)
    at = {"theta_A" if axis == 2 else "tilt_A": 0.3, "P": 0.4}
    p = np.tile(parameter_vector(rod.parameters, at), (60, 1))
    rng, mechanics = np.random.default_rng(0), rod.mechanics
    q, forces = PlanarPart(mechanics.model, axis).bend(mechanics.between(p), p, rng)
    inner = q[:, mechanics.model.unknown_nodes].reshape(len(p), mechanics.unknowns)
    residual = np.abs(mechanics.residual(np.concatenate([inner, forces], axis=1), p)).max(axis=1)
    assert np.quantile(residual, 0.7) < 1e-7


@pytest.mark.parametrize("direction", [(-0.6, 0.8), (-1.0, 0.0)])
@pytest.mark.parametrize("seed", [0, 1])
def test_states_in_a_plane_are_found_between_a_pin_and_a_clamp(direction, seed):
    """All eight of the planar rod: half of the guesses are states of one."""
    options = {"ends": ("pinned", "clamped"), "span": 0.8}
    options["loads"] = {"P": em.PointForce(0.5, direction)}
    rod = em.SpatialRod(torsion=1.0, lateral=3.0, **options).resolving(15.0)
    planar = em.Rod(**options).resolving(15.0)
    at = {"theta_B": 0.4, "P": 0.8}
    flat = em.find_equilibria(planar, at, within=[planar.max_curvature <= 15.0])
    found = em.find_equilibria(rod, at, within=[rod.max_curvature <= 15.0], seed=seed)
    inside = np.abs(rod.shape(found.z, found.p)[:, :, 2]).max(axis=1) < 1e-6
    energies = [np.sort([state.energy for state in each]) for each in (flat, found[inside])]
    assert len(flat) == 8
    assert energies[1] == pytest.approx(energies[0], abs=1e-6)


# --- the plane inside the space ------------------------------------------------------------------

FAMILY = {
    "arch": ({}, {"Theta": 0.9, "Delta": 0.1}, {"q": 1.5}),
    "half load": ({"load": "left-half"}, {"Theta": 0.9}, {"q": 1.0}),
    "cantilever": (
        {"ends": ("clamped", "free"), "loads": {"P": em.PointForce(1.0), "q": em.LineLoad()}},
        {},
        {"P": 0.03, "q": 0.02},
    ),
    "curved, varying": (
        {"stiffness": [[0, 1], [1, 2]], "curvature": [[0, -1], [1, -3]], "span": 0.8},
        {"Theta": 1.0},
        {"q": 0.5},
    ),
    "stretching": (
        {"axial": 8.0, "span": 0.86, "loads": {"q": em.LineLoad(direction=(0.2, -1.0))}},
        {"Theta": 0.7},
        {"q": 0.6},
    ),
    "tendon": (
        {
            "ends": ("clamped", "free"),
            "actuators": {"T": em.Tendon(0.05, 0.0, 0.5)},
            "loads": {"P": em.PointForce(1.0)},
            "axial": 20.0,
        },
        {"T": 0.3},
        {"P": 0.02},
    ),
}


@pytest.mark.parametrize("name", FAMILY)
def test_in_its_plane_the_rod_is_the_planar_one(name):
    """Heights, energies, curvatures of a strip equal those of `Rod` to 1e-9: both are converged."""
    options, start, loads = FAMILY[name]
    planar, rod = em.Rod(**options, elements=8), arch(1.2, 30.0, **options, elements=8, degree=8)
    one = em.lift(planar.natural_state(**start), loads).end.state
    two = em.lift(rod.natural_state(**start), loads).end.state
    for s in (0.2, 0.5, 1.0):
        assert rod.height(s)(two) == pytest.approx(planar.height(s)(one), abs=1e-9)
        bend, flat = rod.strains(s)[2](two), planar.curvature(s)(one)
        assert bend == pytest.approx(flat, abs=1e-8)
    assert two.energy == pytest.approx(one.energy, abs=1e-9)
    assert rod.max_curvature(two) == pytest.approx(planar.max_curvature(one), abs=1e-8)
    again = rod.planar_state(one)
    np.testing.assert_allclose(again.shape(), two.shape(), atol=1e-9)


def test_heights_converge_with_twice_the_degree():
    """Observed order of y(½) under half load, by doubling the elements: near 2·4 = 8."""
    exact = em.Rod("left-half", elements=12, degree=12)
    target = exact.height(0.5)(em.lift(exact.natural_state(Theta=0.9), {"q": 1.0}).end.state)
    errors = []
    for elements in (4, 8):
        rod = arch(1.2, 30.0, load="left-half", elements=elements, degree=4)
        state = em.lift(rod.natural_state(Theta=0.9), {"q": 1.0}).end.state
        errors.append(abs(rod.height(0.5)(state) - target))
    assert 7.0 < np.log2(errors[0] / errors[1]) < 10.0


@pytest.mark.parametrize(
    ("elements", "degree", "error"), [(4, 4, 1e-7), (3, 4, 1e-5), (4, 3, 1e-5), (2, 8, 1e-10)]
)
def test_coarse_rods_have_natural_states_near_the_planar_one(elements, degree, error):
    """Errors of the middle's height, near those that the rods estimate or below."""
    planar = em.Rod()
    exact = planar.height(0.5)(planar.natural_state(Theta=0.9))
    rod = arch(elements=elements, degree=degree)
    state = rod.natural_state(Theta=0.9)
    assert float(rod.height(0.5)(state)) == pytest.approx(float(exact), abs=error)
    assert state.error_estimate > abs(float(rod.height(0.5)(state) - exact))


# --- closed forms and published values -----------------------------------------------------------


def twisted(rod, angle, turn=0.0, force=0.0):
    """Straight or ring-shaped rod, uniformly twisted: q = exp(e₃ turn s/2) exp(e₁ τ s/2)."""
    s = rod.mesh.nodes[rod.mechanics.model.unknown_nodes]
    angles = np.stack([turn * s, 0.0 * s, angle * s], axis=-1)
    q = clamp_rotation(angles[None])[0]
    return np.append(q.ravel(), [*np.zeros(rod.constraints - 1), force])


def test_greenhill_load_of_a_twisted_rod():
    """M L/B = 2 · 4.493409… (tan x = x), clamped, axially free [Greenhill1883]; here C = 1."""
    rod = arch(1.0, 1.0, ends=("clamped", "guided"), loads={}, coordinates={})

    def second(angle):
        p = np.zeros(len(rod.parameters))
        p[[each.name for each in rod.parameters].index("twist_B")] = angle
        z, found = correct_at_parameters(rod, twisted(rod, angle)[None], p[None])
        assert found[0]
        return spectrum(rod, em.structures.State(rod, z[0], p))[0]

    assert brentq(second, 8.5, 9.5, xtol=1e-12) == pytest.approx(8.986818915818, abs=1e-10)


def test_michell_zajac_instability_of_a_twisted_ring():
    """C φ/(2πB) = √3 [Michell1889, Zajac1962]; one eigenvalue is always zero: the ring's orbit."""
    rod = arch(1.4, 1.0, span=0.0, loads={}, coordinates={}, elements=12)

    def lowest(angle):
        p = np.zeros(len(rod.parameters))
        names = [each.name for each in rod.parameters]
        p[names.index("twist_B")], p[names.index("theta_B")] = angle, 2.0 * np.pi
        force = -1.4 * angle * 2.0 * np.pi / (4.0 * np.pi**2)  # along z, holds the twisting moment
        z = twisted(rod, angle, 2.0 * np.pi, force)
        assert np.abs(rod.residual(z[None], p[None])).max() < 1e-9
        values = spectrum(rod, em.structures.State(rod, z, p))
        order = np.argsort(np.abs(values))
        assert abs(values[order[0]]) < 1e-9
        return np.delete(values, order[0])[0]

    angle = brentq(lowest, 7.0, 8.5, xtol=1e-12)
    assert 1.4 * angle / (2.0 * np.pi) == pytest.approx(np.sqrt(3.0), abs=1e-9)


def test_prandtl_lateral_buckling_of_a_strip_cantilever():
    """P L²/(B √(AC)) = 4.01719 at A = C = 1e-3; 4.0126 in the limit [Prandtl1899, Michell1899]."""
    rod = em.SpatialRod(
        torsion=1e-3, lateral=1e-3, EI=1.0, length=1.0, ends=("clamped", "free"),
        loads={"P": em.PointForce(1.0)},
    )  # fmt: skip
    event = em.lift(rod.natural_state(), {"P": 0.006}).events[0]
    assert event.kind == "branch point"
    assert event.state["P"] / 1e-3 == pytest.approx(4.01719, abs=6e-6)


# --- identities ----------------------------------------------------------------------------------


def test_a_twist_of_four_pi_changes_nothing_and_one_of_two_pi_the_link():
    """q_B(τ + 4π) = q_B(τ), q_B(τ + 2π) = −q_B(τ): the same clamp, another rod between."""
    rod = arch()
    state = rod.natural_state(Theta=0.9, twist_B=0.3)
    at = [each.name for each in rod.parameters].index("twist_B")
    p = np.repeat(state.p[None], 3, axis=0)
    p[1:, at] += [4.0 * np.pi, 2.0 * np.pi]
    residual = rod.residual(np.repeat(state.z[None], 3, axis=0), p)
    assert np.abs(residual[1] - residual[0]).max() < 1e-13
    assert np.abs(residual[2]).max() > 0.01


def test_whole_scene_may_be_turned():
    """Clamp, load and intrinsic curvature of a cantilever turned together turn its shape."""
    turn = exponential(np.array([0.4, -0.7, 0.3]))
    down, clamp = np.array([0.2, -1.0, 0.5]), (0.3, -0.2, 0.4)
    turned = matrices(turn) @ down
    q = product(turn, clamp_rotation(np.array(clamp)[None, None])[0, 0])
    r = matrices(q)
    angles = np.arctan2(r[1, 0], r[0, 0]), -np.arcsin(r[2, 0]), np.arctan2(r[2, 1], r[2, 2])
    shapes = []
    for direction, (a, b, twist) in ((down, clamp), (turned, angles)):
        rod = arch(
            0.7, 2.0, ends=("clamped", "free"), curvature=0.5, natural_twist=1.0,
            loads={"q": em.LineLoad(direction=tuple(direction))},
        )  # fmt: skip
        start = rod.natural_state(theta_A=a, tilt_A=b, twist_A=twist)
        shapes.append(em.lift(start, {"q": 0.2}).end.state.shape())
    np.testing.assert_allclose(shapes[1], shapes[0] @ matrices(turn).T, atol=1e-10)


def test_mirror_images_across_the_plane_are_equilibria_with_the_same_index():
    """z → −z of a state off the plane: residual and index agree."""
    rod = arch()
    start = rod.natural_state(Theta=0.9, tilt_A=0.2, tilt_B=0.1, twist_A=0.3, sideways=0.02)
    state = em.lift(start, {"q": 1.0}).end.state
    mirror = next(each for each in rod.symmetries() if each.name == "sideways mirror")
    z, p = mirror.apply(state.z[None], state.p[None])
    assert np.abs(rod.residual(z, p)).max() < 1e-10
    assert rod.index(z, p)[0] == state.index
    np.testing.assert_allclose(rod.shape(z, p)[0] * [1, 1, -1], state.shape(), atol=1e-12)


def test_index_is_that_of_dense_eigenvalues_on_random_states():
    """600 random states; those with an eigenvalue that is zero to round-off are left out."""
    rod, generator = arch(0.8, 1.5), np.random.default_rng(3)
    p = np.zeros((600, len(rod.parameters)))
    p[:, 0], p[:, 1:6] = generator.uniform(0.3, 1.5, 600), generator.normal(size=(600, 5))
    p[:, 6], p[:, 7] = generator.uniform(-6, 6, 600), generator.uniform(0.4, 0.95, 600)
    z = rod.sample(p, generator)
    entries = rod.mechanics.entries(z, p)
    values = np.linalg.eigvalsh(rod.mechanics.layout.dense(entries))
    sure = np.abs(values).min(axis=1) > 1e-11 * np.abs(values).max(axis=1)
    assert sure.mean() > 0.99
    exact = (values < 0.0).sum(axis=1) - rod.constraints
    row, one = np.zeros_like(z), np.ones(600)
    step = rod.advance(z, p, np.zeros_like(p), row, one, np.zeros(600))
    np.testing.assert_array_equal(step.index[sure], exact[sure])
    np.testing.assert_array_equal(rod.index(z, p)[sure], exact[sure])


def test_states_on_an_orbit_are_told():
    """Equal stiffnesses and coaxial clamps: off the axis; a load across or a strip ends it."""
    bend = {"k": em.Curvature(lambda s: np.sin(np.pi * s))}
    for lateral, load, told in ((1.0, 0.0, True), (1.0, 0.3, False), (3.0, 0.0, False)):
        rod = arch(1.0, lateral, span=0.9, actuators=bend)
        start = rod.natural_state(Theta=0.0, k=1.0)
        state = em.lift(start, [{"q": 0.3}, {"k": 0.0, "q": load}]).end.state
        assert state["k"] == 0.0
        assert bool(rod.warnings(state)) is told


def test_a_study_file_describes_the_same_rod():
    """The table of a study file, read and built, has the residuals of the rod itself."""
    table = {
        "kind": "spatial rod",
        "section": {"kind": "round", "diameter": "2 mm", "E": "70 GPa", "nu": 0.33},
        "length": "0.5 m",
        "ends": ["clamped", {"rotation": "held", "x": "free"}],
        "loads": {"q": {"term": "line load", "direction": [0, -1, 0.1]}},
        "actuators": {"push": {"term": "curvature", "about": "n"}},
        "side_curvature": [[0, 0], [1, 2]],
    }
    section = SECTIONS["spatial rod"].model_validate(table)
    made = em.structures.from_identity(section.model_dump(exclude_none=True))
    own = em.SpatialRod(
        section=em.Round("2 mm", E="70 GPa", nu=0.33), length="0.5 m",
        ends=("clamped", em.SpatialEnd(x="free")),
        loads={"q": em.LineLoad(direction=(0, -1, 0.1))},
        actuators={"push": em.Curvature(about="n")}, side_curvature=[[0, 0], [1, 2]],
    )  # fmt: skip
    p = np.full((3, len(own.parameters)), 0.1)
    z = own.sample(p, np.random.default_rng(0))
    assert [each.name for each in made.parameters] == [each.name for each in own.parameters]
    np.testing.assert_allclose(made.residual(z, p), own.residual(z, p), rtol=1e-12, atol=1e-15)


# --- wrong input ---------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("options", "text"),
    [
        (
            {"torsion": None, "lateral": None},
            "`torsion`, `lateral` must be given for a rod in space",
        ),
        ({"torsion": -1.0}, "`torsion` must be positive everywhere; got -1"),
        ({"lateral": 0.0}, "`lateral` must be positive everywhere; got 0"),
        ({"loads": {"M": em.Couple(0.5)}}, "`loads.M` must have a potential; got a couple"),
        ({"loads": {"p": em.Pressure()}}, "`loads.p` must have a potential; got pressure"),
        ({"span": 1.2}, "`span` must be less than the length of the rod, 1; got 1.2"),
        ({"span": 0.8, "rise": 0.5, "sideways": 0.5}, "must place end B nearer to A"),
        ({"ends": ("pinned", "pinned")}, "`ends` must hold the rotation of one end at least"),
        ({"ends": (em.SpatialEnd(x="free"), em.SpatialEnd(x="free"))}, "must hold x at one end"),
        ({"ends": ({"x": -1.0}, "clamped")}, "`x` must be 'held', 'free' or"),
        ({"ends": ("hinged", "clamped")}, r"`ends\[0\]` must be one of 'clamped'"),
        (
            {"loads": {"P": {"term": "point force", "s": 0.5, "direction": (1, 2, 3, 4)}}},
            "`direction` must be two numbers",
        ),
        (
            {"actuators": {"k": {"term": "curvature", "about": "x"}}},
            "`about` must be t or n or b; got 'x'",
        ),
        ({"axial": -1.0}, "`axial` must be positive everywhere"),
        ({"elements": 1}, "`elements` must be a whole number from 2"),
    ],
)
def test_what_makes_no_rod_is_refused(options, text):
    with unchecked(), pytest.raises(InputError, match=text):
        arch(**options)


def test_planar_rods_refuse_what_leaves_their_plane():
    for loads, text in (
        ({"q": em.LineLoad(direction=(0, 0, 1))}, "`direction` must lie in the plane of the rod"),
        ({"k": em.Curvature(about="n")}, "`about` must be 'b' on a planar rod"),
        ({"T": em.Tendon(0.1, binormal=0.1)}, "`binormal` must be 0 on a planar rod"),
    ):
        with pytest.raises(InputError, match=text):
            em.Rod(loads=loads)


@pytest.mark.slow
def test_what_jumps_between_neighbouring_nodes_is_no_state_of_finer_elements():
    """Hundreds of equilibria of 6 elements with quaternions that change their sign: of 20, none.

    Others that are not resolved are found again, with their energy, where 20 are enough.
    """
    given = {"torsion": 0.77, "lateral": 1.3, "loads": {}, "coordinates": {}}
    given |= {"curvature": 0.4, "side_curvature": 0.1}
    rod, fine = em.SpatialRod(**given), em.SpatialRod(**given, elements=20)
    rng, p = np.random.default_rng(5), np.tile(rod.natural_state(twist_B=5.0, nu=0.8).p, (3000, 1))
    met = settle(rod, rod.sample(p, rng), p, guards=Guards(iterations=60))
    z, p = met.z[met.found], p[met.found]
    resolved, smooth = rod.resolved(z, p), rod.may_resolve(z, p)
    assert smooth[resolved].all()
    z, p, smooth = z[~resolved], p[~resolved], smooth[~resolved]
    assert (~smooth).sum() > 200
    guess = rod.mechanics.guess_for(fine.mechanics, z, p)
    again, found = correct_at_parameters(fine, guess, p)
    found &= fine.resolved(again, p)
    assert not found[~smooth].any()
    assert found.any()
    here, there = rod.mechanics.energy(z, p)[found], fine.mechanics.energy(again, p)[found]
    np.testing.assert_allclose(there, here, rtol=1e-3)
