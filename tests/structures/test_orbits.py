"""Rods with orbits: the phase condition against the rod without it, closed forms and symmetry."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import eigh, null_space

import equimorph as em
from equimorph.equilibria.critical import Critical, null_border
from equimorph.errors import InputError
from equimorph.linalg.determinants import in_units
from equimorph.structures.equations import Equations
from equimorph.structures.spatial.mechanics import SpatialMechanics
from equimorph.structures.spatial.quaternions import (
    clamp_rotation,
    exponential,
    matrices,
    product,
)
from oracles.kirchhoff import clamped_buckling_moment

ROUND = {"torsion": 0.75, "lateral": 1.0, "loads": {}, "span": 0.95}
"""A round rod between clamps."""


@pytest.fixture(scope="module")
def pinned():
    return em.SpatialRod(**ROUND, phase=True)


@pytest.fixture(scope="module")
def closing(pinned):
    """Clamps of a rod with a twist of 9 moved together, to the looping fold."""
    return em.lift(pinned.natural_state(twist_B=9.0), {"nu": -0.5})


def bare_spectrum(rod, state):
    """Residual, and eigenvalues in the metric, without the phase condition, by dense algebra."""
    description = replace(rod.description, phase=False)
    bare = SpatialMechanics(description.in_own_parameters(description.raw_model(*rod.resolution)))
    p = np.array([[state.parameters.get(name, 0.0) for name in bare.model.names]])
    z, n = state.z[None, :-1], bare.unknowns
    full = bare.layout.dense(bare.entries(z, p))[0]
    basis = null_space(full[n:, :n])
    mass = basis.T @ (bare.mass[:, None] * basis)
    values = eigh(basis.T @ full[:n, :n] @ basis, mass, eigvals_only=True)
    return np.abs(bare.residual(z, p)).max(), values


def clamp(angles):
    """Rotation of a clamp."""
    return clamp_rotation(np.array(angles)[None, None])[0, 0]


def index_of(rod, state):
    """Negative eigenvalues but for the one that the orbit makes zero."""
    residual, values = bare_spectrum(rod, state)
    assert residual < 1e-9
    assert np.abs(values).min() < 1e-9
    return (np.delete(values, np.argmin(np.abs(values))) < 0.0).sum()


# --- the condition changes no equilibrium --------------------------------------------------------


def test_multiplier_is_zero_and_index_leaves_the_orbit_out(pinned, closing):
    """μ = 0: F of the rod without the condition vanishes, too; one of its eigenvalues is zero."""
    states = closing.states
    assert np.abs(states.multipliers[:, -1]).max() < 1e-10
    for state in states[:-1:3]:
        assert index_of(pinned, state) == state.index == 0


@pytest.mark.slow
def test_beyond_the_looping_fold_one_direction_is_negative(pinned, closing):
    """The lift ends at a fold; around it the rod without the condition has index 1."""
    assert closing.end.kind == "fold"
    near = closing.states[-2]
    path = em.lift(near, {"nu": -0.5}, through_folds=True)
    beyond = path.states[np.flatnonzero(path.states.index == 1)[1]]
    assert index_of(pinned, beyond) == 1


def test_margin_vanishes_where_that_without_the_condition_does(pinned, closing):
    """Signs agree; on the condition margins are at most those across the orbit."""
    for state in closing.states[1:-1:3]:
        _, values = bare_spectrum(pinned, state)
        lowest = np.delete(values, np.argmin(np.abs(values)))[0]
        assert 0.0 < state.margin <= lowest * (1.0 + 1e-9)


def test_fold_is_the_limit_of_folds_of_rods_without_orbits(closing):
    """Stiffnesses aside of 1 + ε have no orbit, and take none of this: O(ε), extrapolated to 0."""
    found = []
    for change in (0.01, 0.02):
        rod = em.SpatialRod(**{**ROUND, "lateral": 1.0 + change}, coordinates={})
        begin = rod.natural_state(theta_A=0.3, theta_B=-0.3, nu=0.9)
        turned = em.lift(begin, [{"theta_A": 0.0, "theta_B": 0.0}, {"twist_B": 9.0}]).end
        end = em.lift(turned.state, {"nu": -0.5}).end
        assert (turned.kind, end.kind) == ("arrived", "fold")
        found.append(end.state["nu"])
    limit = 2.0 * found[0] - found[1]
    assert closing.end.state["nu"] == pytest.approx(limit, abs=1e-6)


@pytest.mark.parametrize(
    "options",
    [
        {},
        {"axial": 40.0, "shear": 15.0},
        {"ends": ("clamped", "guided"), "loads": {"P": em.PointForce(1.0, (-1.0, 0.0, 0.0))}},
        {"ends": ("pinned", "clamped"), "elements": 3, "degree": 4},
    ],
)
def test_solves_with_a_spring_and_two_borders_are_those_of_the_whole_matrix(options):
    """Solutions, inertia and determinant, with borders and shifts, on the axis without borders.

    Against F_z with the condition, eliminated with pivots; 1e-8: conditions reach 1e7.
    """
    rod = em.SpatialRod(**{**ROUND, **options}, phase=True)
    rng = np.random.default_rng(17)
    p = rng.uniform(-1.0, 1.0, (24, len(rod.parameters)))
    start = rod.natural_state(twist_B=1.0) if not options else None
    z = rod.mechanics.sample(p, rng)
    if start is not None:
        p[:8], z[:8] = start.p, start.z + 1e-6 * rng.standard_normal((8, len(start.z)))
    mechanics, lanes, size = rod.mechanics, len(z), rod.mechanics.size
    if "guided" in options.get(
        "ends", ""
    ):  # with its span given, F_z of a straight rod is singular
        z[-4:, : mechanics.unknowns] = np.tile([1.0, 0.3, 0.0, 0.0], mechanics.unknowns // 4)
        assert mechanics.on_axis(z)[-4:].all()
    for shift in (None, rng.uniform(-0.1, 0.3, lanes)):
        entries = mechanics.entries(z, p, shift)
        for k in (0, 2):
            columns, rows = rng.standard_normal((2, lanes, k, size))
            border = (columns, rows, rng.standard_normal((lanes, k, k))) if k else None
            sides = rng.standard_normal((lanes, 3, size + k))
            found = mechanics.solve(z, p, sides, border, shift)
            whole = mechanics.layout.solve(entries, border, sides)
            # on the axis: `test_on_the_axis_a_border_leaves_the_pair_one_null_vector`
            told = np.flatnonzero(~mechanics.on_axis(z)) if k else np.arange(lanes)
            scale = np.abs(whole.x[told]).max(axis=(1, 2), keepdims=True)
            np.testing.assert_allclose(
                found.x[told] / scale, whole.x[told] / scale, atol=1e-8, rtol=0.0
            )
            np.testing.assert_array_equal(found.negative[told], whole.negative[told])
            one, other = (each.determinant[told] for each in (found, whole))
            np.testing.assert_allclose(in_units(one, other[:, 1]), other[:, 0], 1e-7)
            assert found.pivoted.mean() < 0.1


@pytest.mark.parametrize(
    "options",
    [
        {},
        {"axial": 400.0, "shear": 150.0},
        # a thrust stretches the rod, and moves what the condition holds
        {"axial": 40.0, "shear": 15.0, "loads": {"P": em.PointForce(0.5, (1.0, 0.0, 0.0))}},
    ],
)
def test_steps_with_the_condition_applied_afterwards_are_those_of_the_whole_matrix(options):
    """At equilibria, whatever the row of the curve; off them they differ by first order in F.

    Against F_z with the condition, eliminated with pivots; 1e-9: conditions reach 1e6.
    """
    rod = em.SpatialRod(**{**ROUND, **options}, phase=True)
    states = em.lift(rod.natural_state(twist_B=6.0), {"nu": -0.1}).states
    rng, mechanics, gap = np.random.default_rng(18), rod.mechanics, {}
    dp, row = rng.standard_normal(states.p.shape), rng.standard_normal(states.z.shape)
    corner, defect = rng.standard_normal((2, len(states)))
    for size in (0.0, 1e-9):
        z = states.z + size * rng.standard_normal(states.z.shape)
        step = mechanics.advance(z, states.p, dp, row, corner, defect)
        rate = mechanics.parameter_derivative(z, states.p, dp)
        border = row[:, None], rate[:, None], corner[:, None, None]
        sides = np.concatenate([-mechanics.residual(z, states.p), -defect[:, None]], axis=1)
        entries = mechanics.entries(z, states.p)
        whole = mechanics.layout.solve(entries, (rate[:, None], row[:, None], border[2]),
                                       sides[:, None])  # fmt: skip
        found = np.concatenate([step.dz, step.dt[:, None]], axis=1)
        gap[size] = np.abs(found - whole.x[:, 0]).max() / np.abs(whole.x).max()
        np.testing.assert_array_equal(step.index, whole.negative - mechanics.constraints)
        one, other = step.determinant, whole.determinant
        rtol = 1e-9 + 1e3 * size
        np.testing.assert_allclose(in_units(one, other[:, 1]), other[:, 0], rtol=rtol)
    assert gap[0.0] < 1e-9
    assert gap[1e-9] < 1e-4


def test_steps_under_a_force_are_general_ones_where_states_could_be_turned():
    """With the condition; and without, on orbits and among states beside these."""
    pinned, rng = em.SpatialRod(**ROUND, phase=True), np.random.default_rng(19)
    states = em.lift(pinned.natural_state(twist_B=6.0), {"nu": -0.1}).states
    free = em.SpatialRod(**ROUND)
    names = [each.name for each in free.parameters]
    p = np.array([[state[name] if name in state.parameters else 0.0 for name in names]
                  for state in states[:6]])  # fmt: skip
    p[::2, names.index("Theta")] = 0.3
    off = states.z[:6] + 1e-3 * rng.standard_normal((6, pinned.size))
    for rod, z, at in ((pinned, off, states.p[:6]), (free, off[:, :-1].copy(), p)):
        force, growth, row = 0.1 * rng.standard_normal((3, *z.shape))
        closing = row, *rng.standard_normal((2, 6))
        found = rod.mechanics.advance_under((force, growth), z, at, *closing)
        general = Equations.advance_under(rod.mechanics, (force, growth), z, at, *closing)
        for name, value in vars(general).items():
            gap = np.abs(getattr(found, name) - value).max()
            assert gap <= 1e-7 * np.abs(value).max(), name
    there = free.mechanics.on_orbits(off[:, :-1], p)
    assert 0 < there.sum() < 6


# --- applied by itself ---------------------------------------------------------------------------


def test_rods_with_other_parameters_keep_to_one_phase_by_themselves(closing):
    """With theta, tilt, rise, sideways at zero, after a load aslant: the same fold to 1e-11."""
    load = {"q": em.LineLoad(direction=(0.1, -1.0, 0.3))}
    rod = em.SpatialRod(**{**ROUND, "loads": load})
    begin = em.lift(rod.natural_state(Theta=0.3), [{"q": 0.2}, {"twist_B": 9.0}]).end.state
    there = em.lift(begin, {"Theta": 0.0, "q": 0.0}).end
    assert (there.kind, there.state.index) == ("arrived", 0)
    assert rod.warnings(there.state)
    end = em.lift(there.state, {"nu": -0.5}).end
    assert end.kind == "fold"
    assert end.state["nu"] == pytest.approx(closing.end.state["nu"], abs=1e-11)


@pytest.mark.slow
def test_limit_load_of_a_thrust_is_that_of_the_pinned_rod():
    """A buckled strut under thrust: both ways to pose it give the same first critical load."""
    options = {
        **{"torsion": 1.0, "lateral": 1.0, "ends": ("clamped", "guided")},
        "loads": {"P": em.PointForce(1.0, (-1.0, 0.0, 0.0))},
    }
    free, rod = em.SpatialRod(**options, coordinates={}), em.SpatialRod(**options, phase=True)
    bent = em.lift(free.natural_state(theta_A=0.1), [{"P": 1.5}, {"theta_A": 0.0}]).end.state
    ends = [em.lift(each, {"P": 3.0}).end for each in (bent, rod.pinned_state(bent))]
    assert ends[0].kind == ends[1].kind == "branch point"
    assert ends[0].state["P"] == pytest.approx(ends[1].state["P"], abs=1e-10)
    unloading = em.lift(rod.pinned_state(bent), {"P": 0.5}).end
    assert (unloading.kind, unloading.criticality) == ("branch point", "supercritical")
    assert unloading.state["P"] == pytest.approx(1.0, abs=1e-11)  # Euler


def test_a_strip_has_no_orbits_and_takes_no_condition():
    for options, fixed in (({"lateral": 3.0}, {}), ({}, {"sideways": 0.1})):
        rod = em.SpatialRod(**{**ROUND, **options})
        p = np.array([[0.0, 0.0, 0.0, 0.3, 0.0, 0.4, 0.8, 0.0, fixed.get("sideways", 0.0)]])
        assert not rod.have_orbits(p)[0]


# --- on the axis ---------------------------------------------------------------------------------


@pytest.mark.parametrize("phase", [False, True])
@pytest.mark.parametrize("pull", [0.0, 0.3])
def test_on_the_axis_two_eigenvalues_vanish_at_once(phase, pull):
    """Greenhill's combined load, clamped, by the determinant of its linear equation; C = 3.

    The double eigenvalue is named a multiple point, no fold; a branch point where the condition
    picks the branch.
    """
    rod = em.SpatialRod(
        torsion=3.0, lateral=1.0, ends=("clamped", "guided"), phase=phase,
        loads={"P": em.PointForce(1.0, (-1.0, 0.0, 0.0))},
    )  # fmt: skip
    legs = [{"P": -pull}, {"twist_B": 5.0}] if pull else {"twist_B": 5.0}
    end = em.lift(rod.natural_state(), legs).end
    assert end.kind == ("branch point" if phase else "multiple point")
    assert not phase or end.criticality in {"supercritical", "subcritical"}
    moment = clamped_buckling_moment(pull * 4.0 * np.pi**2)
    assert 3.0 * end.state["twist_B"] == pytest.approx(moment, rel=1e-7)


def test_on_the_axis_a_border_leaves_the_pair_one_null_vector():
    """At Euler's load: bordered, F_z is regular; the vector is null, and keeps to the condition.

    Against dense algebra: two eigenvalues vanish, and the third does not. Off that load the index
    is that without a border.
    """
    options = {"ends": ("clamped", "guided"), "loads": {"P": em.PointForce(1.0, (-1.0, 0.0, 0.0))}}
    rod = em.SpatialRod(torsion=1.0, lateral=1.0, **options, phase=True)
    mechanics, end = rod.mechanics, em.lift(rod.natural_state(twist_B=0.7), {"P": 1.5}).end
    assert end.kind == "branch point"
    z, p = end.state.z[None], end.state.p[None]
    values = np.sort(np.abs(bare_spectrum(rod, end.state)[1]))
    assert values[1] < 1e-9
    assert values[2] > 0.01
    b = null_border(rod, z, p)
    null = Critical(rod, z, p, b)
    assert abs(null.g[0]) < 1e-9
    assert np.abs(mechanics.layout.dense(mechanics.entries(z, p))[0] @ null.v[0]).max() < 1e-8
    moved = rod.residual(z + 1e-3 * null.v, p)[0, -1] - rod.residual(z - 1e-3 * null.v, p)[0, -1]
    assert abs(moved) < 1e-7
    for load, index in ((0.9, 0), (1.1, 2)):
        place = p + (np.array([each.name for each in rod.parameters]) == "P") * (load - p[0, -1])
        held = rod.natural_state(twist_B=0.7)
        straight = em.lift(held, {"P": load}, through_folds=True).end.state
        border = b[:, None], b[:, None], np.zeros((1, 1, 1))
        nothing = np.zeros((1, 0, rod.size + 1))
        solved = rod.solve(straight.z[None], place, nothing, border)
        assert solved.negative[0] - rod.constraints == index == straight.index


def ring(rod):
    """An untwisted ring, with its end turned by 2π."""
    s = rod.mesh.nodes[rod.mechanics.model.unknown_nodes]
    q = clamp_rotation(np.stack([2.0 * np.pi * s, 0.0 * s, 0.0 * s], axis=-1)[None])[0]
    p = np.zeros(len(rod.parameters))
    p[[each.name for each in rod.parameters].index("theta_B")] = 2.0 * np.pi
    return em.structures.State(rod, np.append(q.ravel(), np.zeros(3)), p)


@pytest.mark.slow
def test_twisted_ring_is_stable_up_to_michell_and_zajac():
    """C τ/(2πB) = √3; two modes, as a ring is the same from each of its points [Zajac1962]."""
    options = {"torsion": 2.0, "lateral": 1.0, "span": 0.0, "loads": {}, "elements": 6}
    free, rod = em.SpatialRod(**options, coordinates={}), em.SpatialRod(**options, phase=True)
    closed = rod.pinned_state(ring(free))
    assert closed["twist_B"] == pytest.approx(2.0 * np.pi)
    for state, name, sign in ((closed, "twist_A", -1.0), (ring(free), "twist_B", 1.0)):
        end = em.lift(state, {name: sign * 6.0}).end
        assert (end.kind, end.state.index) == ("multiple point", 0)
        assert sign * 2.0 * end.state[name] / (2.0 * np.pi) == pytest.approx(np.sqrt(3), rel=1e-7)


# --- turns of 2π and 4π, rigid rotations ---------------------------------------------------------


def test_twists_that_differ_by_four_pi_are_the_same_problem(pinned):
    """The equilibrium at τ is one at τ − 4π; at τ − 2π it is none: another link."""
    state = pinned.natural_state(twist_B=7.0)
    p = np.repeat(state.p[None], 2, axis=0)
    p[:, 1] -= [4.0 * np.pi, 2.0 * np.pi]
    residual = np.abs(pinned.residual(state.z[None].repeat(2, axis=0), p)).max(axis=1)
    assert residual[0] < 1e-11
    assert residual[1] > 0.01
    other = em.structures.State(pinned, state.z, p[0])
    assert (other.index, other.energy) == (state.index, pytest.approx(state.energy, abs=1e-12))


def test_quaternions_of_both_signs_are_the_same_rotations():
    """Both clamps turned by 2π: −q is the same rod, with the same shape, energy, index, margin."""
    rod = em.SpatialRod(torsion=0.77, lateral=1.4)
    state = rod.natural_state(Theta=0.9, tilt_A=0.2, twist_A=0.3, twist_B=-0.5)
    names, p, z = [each.name for each in rod.parameters], state.p.copy(), state.z.copy()
    p[[names.index("twist_A"), names.index("twist_B")]] += 2.0 * np.pi
    z[: rod.unknowns] *= -1.0
    other = em.structures.State(rod, z, p)
    assert other.residual < 1e-11
    np.testing.assert_allclose(other.shape(), state.shape(), atol=1e-13)
    assert other.energy == pytest.approx(state.energy, abs=1e-13)
    assert (other.index, other.margin) == (state.index, pytest.approx(state.margin, rel=1e-9))


def test_with_one_clamp_a_turn_of_two_pi_changes_nothing():
    """No link is held: boxes of a set may be 2π wide; between two clamps 4π."""
    for ends, period in ((("clamped", "free"), 2.0), (("clamped", "clamped"), 4.0)):
        rod = em.SpatialRod(torsion=0.7, lateral=2.0, ends=ends, coordinates={})
        periods = {each.name: each.period for each in rod.parameters}
        assert periods["twist_A"] == periods["theta_A"] == period * np.pi
        with pytest.raises(InputError, match=r"`box.twist_A` must be no wider than"):
            em.equilibrium_set(rod, em.Box(twist_A=(-7.0, 7.0)))


@pytest.mark.parametrize("seed", range(3))
def test_rigid_rotation_of_clamps_and_rod_is_taken_back(pinned, closing, seed):
    """Clamps on any axis: told as an orbit; `pinned_state` gives the state that was turned."""
    state = closing.states[5]
    generator = np.random.default_rng(seed)
    whole = exponential(0.5 * generator.normal(size=3))
    rod = em.SpatialRod(**ROUND, coordinates={})
    q = state.z[: pinned.unknowns].reshape(-1, 4)
    q = pinned.mechanics.turn(state.z[None], np.array([generator.uniform(-1.5, 1.5)]))
    forces = matrices(whole) @ q[0, pinned.unknowns : -1]
    q = product(whole, q[0, : pinned.unknowns].reshape(-1, 4))
    place = matrices(whole) @ [state["nu"], 0.0, 0.0]
    values = dict(zip(("nu", "rise", "sideways"), place, strict=True))
    for side, twist in (("A", 0.0), ("B", state["twist_B"])):
        held = product(whole, clamp([0.0, 0.0, twist]))
        r = matrices(held)
        angles = [np.arctan2(r[1, 0], r[0, 0]), -np.arcsin(r[2, 0]), np.arctan2(r[2, 1], r[2, 2])]
        angles[2] += 2.0 * np.pi * float(clamp(angles) @ held < 0.0)
        names = [f"{angle}_{side}" for angle in ("theta", "tilt", "twist")]
        values |= dict(zip(names, angles, strict=True))
    p = np.array([values[each.name] for each in rod.parameters])
    turned = em.structures.State(rod, np.append(q.ravel(), forces), p)
    assert turned.residual < 1e-9
    assert turned.energy == pytest.approx(state.energy, abs=1e-12)
    assert rod.warnings(turned)
    back = pinned.pinned_state(turned)
    side = np.sign(back.shape()[50, 1])  # the same, or turned by π
    shape = back.shape() * [1.0, side, side]
    np.testing.assert_allclose(shape, state.shape(), atol=1e-9)
    assert (back.index, back.margin) == (state.index, pytest.approx(state.margin, abs=1e-7))


# --- refusals ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("options", "text"),
    [
        ({"lateral": 2.0}, "bending stiffnesses that differ"),
        ({"loads": None}, "got q, which acts across the axis"),
        ({"curvature": 1.0}, "got intrinsic curvature"),
        ({"actuators": {"k": em.Curvature(about="n")}}, "got k, which acts across the axis"),
        ({"actuators": {"T": em.Tendon(0.1)}}, "got T, which acts across the axis"),
        ({"rise": 0.1}, "got rise = 0.1"),
        ({"ends": ("clamped", em.SpatialEnd(y="free"))}, "supports that hold y and z"),
        ({"ends": (em.SpatialEnd(y=2.0), "clamped")}, "supports that hold y and z"),
        ({"coordinates": {"a": {"theta_A": 1.0}}}, "`coordinates.a` must combine"),
    ],
)
def test_a_rod_without_orbits_takes_no_phase_condition(options, text):
    with pytest.raises(InputError, match=text):
        em.SpatialRod(**{**ROUND, **options}, phase=True)


def test_what_needs_isolated_states_asks_for_a_phase_condition():
    """Searches and sets would find states of one orbit again and again."""
    rod = em.SpatialRod(**ROUND)
    with pytest.raises(InputError, match=r"`structure` must have isolated equilibria.*phase=True"):
        em.find_equilibria(rod, {"Theta": 0.0, "twist_B": 2.0})
    box = em.Box(twist_B=(0.0, 3.0), nu=(0.5, 0.9))
    with pytest.raises(InputError, match="`structure` must have isolated equilibria"):
        em.equilibrium_set(rod, box, fixed={"Theta": 0.0})
    with pytest.raises(InputError, match="`pinned_state` must be asked of a rod with phase=True"):
        rod.pinned_state(rod.natural_state(Theta=0.3))


def test_states_off_a_common_axis_are_not_pinned(pinned):
    bent = em.SpatialRod(**ROUND).natural_state(Theta=0.3)
    with pytest.raises(InputError, match="got clamps that are turned or moved"):
        pinned.pinned_state(bent)
    with pytest.raises(InputError, match="`state` must be a state of a rod in space; got 3"):
        pinned.pinned_state(3)


def test_the_condition_is_part_of_the_identity(pinned):
    again = em.structures.from_identity(pinned.identity())
    assert pinned.identity()["phase"] is True
    assert again.signature == pinned.signature
    assert [each.name for each in again.parameters] == ["twist_A", "twist_B", "nu"]


@pytest.mark.slow
def test_searches_find_each_orbit_twice(pinned):
    """z and the state turned by π meet the condition: pairs of the same energy."""
    at = {"twist_B": 5.0, "nu": 0.8}
    found = em.find_equilibria(pinned, at, within=[pinned.max_curvature <= 12], starts=12, runs=2)
    energies = np.sort([state.energy for state in found.stable])
    assert len(energies) >= 2
    np.testing.assert_allclose(energies[::2], energies[1::2], atol=1e-10)


@pytest.mark.parametrize("soft", [{}, {"axial": 5.0, "shear": 3.0}])
def test_the_kernel_of_the_condition_equals_jets(soft):
    """Value and gradient of the phase condition at random states; tolerance: round-off."""
    mechanics, generator = (
        em.SpatialRod(**ROUND, **soft, phase=True).mechanics,
        np.random.default_rng(5),
    )
    p = 0.3 * generator.normal(size=(11, mechanics.parameters))
    z = mechanics.sample(p, generator) + 0.05 * generator.normal(size=(11, mechanics.size))
    along = np.zeros_like(z)
    along[:, -1] = 1.0
    residual, wanted = mechanics.equations(z, p, (along, np.zeros_like(p)), mixed=False)
    gradient, value = mechanics._condition(z, p, np.zeros(11, bool))
    np.testing.assert_allclose(gradient, wanted, atol=1e-14)
    np.testing.assert_allclose(value, residual[:, -1], atol=1e-13)


def test_states_of_one_orbit_are_one_piece_of_the_graph_of_minima(pinned):
    """They differ by a turn for nothing: no saddle need be searched between them.

    Few starts, of a seed for which none of them leads to minima with whole turns.
    """
    at, few = {"twist_B": 0.0, "twist_A": 0.0, "nu": 0.8}, {"starts": 12, "runs": 2, "seed": 1}
    found = em.find_equilibria(pinned, at, within=[pinned.max_curvature <= 5], **few)
    graph = found.arguments[1]
    assert (graph.name, graph.standing) == ("graph of minima", "holds")
    assert graph.detail.startswith("2 minima in one piece")


def test_orbits_between_opposite_states_are_found(pinned):
    """Three of index 2, which are the same with 23 elements; random starts meet hardly any."""
    at = {"twist_B": 1.0, "twist_A": 0.0, "nu": 0.8}
    found = em.find_equilibria(pinned, at, within=[pinned.max_curvature <= 10])
    assert np.bincount(found.index).tolist() == [6, 0, 6]
    energies = [0.43495, 1.61543, 2.02327]
    np.testing.assert_allclose(found.energy[found.index == 2][::2], energies, rtol=1e-5)


def test_only_what_keeps_an_orbit_has_derivatives():
    """By neighbours that are lifted: the distance from the axis, which does not turn."""
    loads = {"w": em.PointForce(0.5, (0.0, 0.0, 1.0)), "x": em.PointForce(0.6, (1.0, 0.0, 0.0))}
    rod = em.SpatialRod(torsion=0.75, lateral=1.0, loads=loads, span=0.9)
    way = [{"twist_B": 3.0}, {"Theta": 0.0}]
    state = em.lift(rod.natural_state(Theta=0.2), way).end.state
    away = em.function_of("away", np.hypot, rod.height(0.5), rod.coordinate(2, 0.5))
    found = em.sensitivity(state, [away], ["x", "nu", "twist_B"])
    for name in found.names:
        ends = [em.lift(state, {name: state[name] + h}).end.state for h in (1e-5, -1e-5)]
        exact = (away(ends[0]) - away(ends[1])) / 2e-5
        assert found["away", name] == pytest.approx(exact, rel=1e-5)
    for name in ("w", "Theta", "sideways"):
        with pytest.raises(InputError, match=f"keep the orbit of the state; got {name}"):
            em.sensitivity(state, [away], ["nu", name])
