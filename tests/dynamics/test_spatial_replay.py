"""Rods in space as chains of links: statics to second order, at rest, in motion and buckling.

References: the equilibria of the library, its planar replay, and the load of SPACE §1 at which a
round arch leaves its plane, which three codes agree on.
"""

from functools import cache

import numpy as np
import pytest

import equimorph as em
from equimorph.dynamics import ReplaySettings, replay
from equimorph.dynamics.linkage_model import LinkageModel
from equimorph.dynamics.model import landing
from equimorph.dynamics.rods import ChainedRod
from equimorph.dynamics.spatial_rods import ChainedSpatialRod

FORCE = (0.3, -1.0, 0.7)
ASLANT = {"q": em.LineLoad(direction=(0.0, -1.0, 0.3))}
CURVED = {"span": 0.9, "curvature": -1.5, "side_curvature": 0.5}
SEGMENTS = {
    name: em.Curvature(1.0, 0.2, 0.7, about=axis) for name, axis in (("k", "n"), ("t", "t"))
}
CABLE = {"T": em.Tendon([[0, 0.05], [1, 0.02]], 0.0, 0.75, binormal=0.04)}
LEAVES = 1.601471549048
"""q at which the round arch at (Θ, Δ) = (0.9, 0) leaves its plane."""


def rod(*arguments, **options):
    return em.SpatialRod(*arguments, torsion=0.8, lateral=options.pop("lateral", 3.0), **options)


RODS = {
    "bent and twisted": (
        rod("uniform", lateral=2.0), {"Theta": 1.0},
        [{"q": 1.0}, {"twist_A": 0.8, "tilt_B": 0.3, "sideways": 0.1}],
    ),
    "cantilever": (
        rod(ends=("clamped", "free"), loads={"P": em.PointForce(1.0, FORCE)}), {},
        {"P": 0.1, "tilt_A": 0.4, "twist_A": 0.7},
    ),
    "free end A": (
        rod(ends=("free", "clamped"), loads={"P": em.PointForce(0.0, FORCE)}), {},
        {"P": 0.1, "tilt_B": 0.4, "twist_B": 0.7},
    ),
    "ball at B": (
        rod(ends=("clamped", "pinned"), loads=ASLANT, **CURVED), {}, {"q": 0.3, "twist_A": 0.5},
    ),
    "ball at A": (
        rod(ends=("pinned", "clamped"), loads=ASLANT, **CURVED), {},
        {"q": 0.3, "twist_B": 0.5, "rise": 0.05},
    ),
    "guided": (
        rod(ends=("clamped", "guided"), curvature=-1.5, natural_twist=1.0, loads=ASLANT), {},
        {"q": 0.3, "twist_A": 0.5},
    ),
    "springs": (
        rod(
            ends=(em.SpatialEnd(x=3.0), em.SpatialEnd(y=2.0, z=2.0)), span=0.9, curvature=-1.0,
            loads=ASLANT,
        ), {"Theta": 0.8}, {"q": 0.3, "twist_A": 0.5},
    ),
    "stretch and shear": (
        rod("uniform", lateral=2.0, axial=30.0, shear=15.0, span=0.9), {"Theta": 1.0},
        {"q": 1.0, "twist_A": 0.6, "sideways": 0.1},
    ),
    "tendon": (
        rod(
            ends=("clamped", "free"), axial=20.0, natural_twist=1.0, actuators=CABLE,
            loads={"P": em.PointForce(1.0, FORCE)},
        ), {}, {"T": 1.0, "P": 0.05},
    ),
    "segments that bend and twist": (
        rod("uniform", lateral=2.0, actuators=SEGMENTS), {"Theta": 1.0},
        {"q": 1.0, "k": 1.0, "t": 1.0},
    ),
    "stiffness with a jump": (
        rod([[0, 1], [0.4, 2], [1, 0.5]], stiffness=[[0, 1], [0.3, 2], [0.3, 0.7], [1, 1]]),
        {"Theta": 1.0}, {"q": 1.0, "twist_B": 0.6, "tilt_A": 0.2},
    ),
    "units": (
        rod("uniform", EI=2e-3, length=0.5, mass=0.2), {"Theta": 1.0},
        {"q": 1.0, "twist_A": 0.6},
    ),
}  # fmt: skip
"""Rod, actuators of its natural state, and what it is lifted to."""
FAST = ("bent and twisted", "cantilever")
NAMES = [name if name in FAST else pytest.param(name, marks=pytest.mark.slow) for name in RODS]


@cache
def loaded(name):
    made, actuators, to = RODS[name]
    return em.lift(made.natural_state(**actuators), to).end.state


def model(state, links):
    return LinkageModel(ChainedSpatialRod(state.structure, links))


def gap(state, links):
    """Largest distance between points of the chain and of the rod, in lengths of the rod."""
    made = model(state, links)
    found = made.balance(state)
    apart = made.points(found.v) - made.reference(state.batch)[0]
    return np.linalg.norm(apart, axis=1).max() / state.structure.units.value("length")


@pytest.mark.parametrize("name", NAMES)
def test_the_chain_is_accurate_to_second_order(name):
    """Hinges in alternating orders; in one order, this cantilever's chain is of first order."""
    coarse, fine = (gap(loaded(name), links) for links in (16, 64))
    assert fine < 3e-4
    assert np.log2(coarse / fine) / 2.0 == pytest.approx(2.0, abs=0.2)


@pytest.mark.parametrize("name", NAMES)
def test_mujoco_rests_where_the_chain_has_its_equilibrium(name):
    """An independent simulation, from a disturbed start; it lands in the state of the library."""
    pytest.importorskip("mujoco", reason="MuJoCo is not installed (extra `replay`)")
    state = loaded(name)
    chained = ChainedSpatialRod(state.structure, 8)
    found = LinkageModel(chained).balance(state)
    plant = chained.simulation(0.05, 0.5)
    plant.start(found.v + 1e-2 * np.sin(np.arange(len(found.v))), found.y)
    for _ in range(1000 if name in FAST else 3000):
        plant.step()
    assert plant.speed < 1e-3
    assert np.abs(found.linkage.places(plant.v) - found.places).max() < 1e-3
    landed = landing(state.structure, chained.unknowns(plant.v), state.p)
    assert np.abs(landed.shape() - state.shape()).max() < 1e-8


@pytest.mark.parametrize("name", ["bent and twisted", "ball at A", "stretch and shear", "tendon"])
def test_derivatives_of_a_chain_are_those_of_its_potential(name):
    """Central differences of the potential and of the residual."""
    chain = ChainedSpatialRod(RODS[name][0], 5).linkage
    generator = np.random.default_rng(4)
    v, along = 0.3 * generator.normal(size=(2, chain.size))
    pulls, pull = generator.normal(size=(2, chain.closures))
    y = np.append(generator.normal(size=chain.springs.shape[2] - 1), 1.0)
    along, step = np.where(chain.free, along, 0.0), 1e-6
    ends = [v + k * along for k in (step, -step)]
    energies = [chain.potential(each, y) + pulls @ chain.closure(each) for each in ends]
    forces = chain.residual(v, pulls, y)[: chain.size]
    assert np.diff(energies)[0] / (-2 * step) == pytest.approx(forces @ along, abs=1e-7)
    ahead, behind = (
        chain.residual(each, pulls + k * pull, y)
        for each, k in zip(ends, (step, -step), strict=True)
    )
    slope = chain.jacobian(v, pulls, y) @ np.concatenate([along, pull])
    error = (ahead - behind) / (2 * step) - slope
    assert np.abs(error[chain.unknown]).max() < 1e-7


def test_in_the_plane_the_chain_moves_as_that_of_a_planar_rod():
    """The same links with other joints: equal at rest; in motion a planar rod's clamps lag.

    Its first hinge is damped against the world, by the angle damping · rate.
    """
    pytest.importorskip("mujoco", reason="MuJoCo is not installed (extra `replay`)")
    flat = em.lift(em.Rod("uniform").natural_state(Theta=1.0), {"q": 1.5}).end.state
    deep = rod("uniform").planar_state(flat)
    rate, damping, step, moving = 0.05, 0.1, 0.05, []
    for made in (ChainedRod(flat.structure, 8), ChainedSpatialRod(deep.structure, 8)):
        found = LinkageModel(made).balance(flat if made.structure is flat.structure else deep)
        plant, y, places = made.simulation(step, damping), found.y.copy(), []
        plant.start(found.v, y)
        for k in range(450):
            if k < 50:
                y[0] += rate * step
                y[1] += 0.5 * rate * step
                plant.set(y)
            plant.step()
            if k % 10 == 9:
                places.append(made.linkage.places(plant.v)[0])
        moving.append(np.array(places))
    apart = np.abs(moving[1][..., :2] - moving[0]).max(axis=(1, 2))
    assert np.abs(moving[1][..., 2]).max() < 1e-12
    assert apart.max() < damping * rate
    assert apart[-1] < 3e-5


def test_a_replay_in_space_holds_its_statics():
    pytest.importorskip("mujoco", reason="MuJoCo is not installed (extra `replay`)")
    used = ReplaySettings(links=6, step=0.1, damping=0.3, hold=10.0)
    played = replay({"twist_A": 0.9}, loaded("bent and twisted"), rate=0.05, settings=used)
    assert not played.snapped
    assert played.points.shape[1:] == (7, 3)
    assert played.dynamics[[0, -1]].max() < 1e-4
    assert played.largest_deviation < 2e-2
    assert played.closure < 1e-4


@pytest.fixture(scope="module")
def arch():
    """The round arch in its plane before it buckles; a load along z can disturb it."""
    loads = {"q": em.LineLoad(), "w": em.LineLoad(direction=(0.0, 0.0, 1.0))}
    made = em.SpatialRod(torsion=0.77, lateral=1.0, loads=loads)
    return em.lift(made.natural_state(Theta=0.9), {"q": 1.5}).end.state


def buckling_load(state, links):
    """Load at which the chain's planar equilibria lose their stability."""

    def motion(time):
        row = state.p.copy()
        row[list(state.parameters).index("q")] = time
        return row

    return model(state, links).quasistatics(state, motion, np.linspace(1.5, 1.7, 5)).fold


def test_the_chain_of_a_round_arch_leaves_its_plane_where_the_rod_does(arch):
    """SPACE §1: q = 1.6015; of second order in the number of links."""
    coarse, fine = (buckling_load(arch, links) for links in (10, 20))
    assert fine + (fine - coarse) / 3.0 == pytest.approx(LEAVES, abs=1e-3)


def held(state, links, q, pushed=1e-2):
    """Where a load holds the chain after a push out of its plane, and the stable state there."""
    chained = ChainedSpatialRod(state.structure, links)
    start = LinkageModel(chained).balance(state)
    plant = chained.simulation(0.1, 0.3)
    plant.start(start.v, start.y)
    names = list(state.parameters)
    y = start.y.copy()
    y[names.index("q")] = q
    for push, steps in ((pushed, 50), (0.0, 1200)):
        y[names.index("w")] = push
        plant.set(y)
        for _ in range(steps):
            plant.step()
    rests = landing(state.structure, chained.unknowns(plant.v), y[:-1])
    return chained.linkage.places(plant.v)[0], rests


def test_a_round_arch_is_held_below_the_load_at_which_it_leaves_its_plane_and_not_above(arch):
    """The landing is the sideways state that an imperfect load leads to in the library."""
    pytest.importorskip("mujoco", reason="MuJoCo is not installed (extra `replay`)")
    sideways = em.lift(arch, [{"w": 1e-2}, {"q": 1.7}, {"w": 0.0}]).end.state
    depth = arch.structure.coordinate(2, 0.5)
    flat, still = held(arch, 8, 1.5)
    assert np.abs(flat[:, 2]).max() < 1e-6
    assert np.abs(still.z - arch.z).max() < 1e-8
    deep, left = held(arch, 8, 1.7)
    assert deep[4, 2] > 0.5 * depth(sideways)
    assert np.abs(left.z - sideways.z).max() < 1e-8


def test_orbits_are_refused():
    """A round rod between coaxial clamps may be turned about their axis for nothing."""
    pytest.importorskip("mujoco", reason="MuJoCo is not installed (extra `replay`)")
    pinned = em.SpatialRod(torsion=0.77, lateral=1.0, phase=True, loads={}, span=0.9)
    with pytest.raises(em.errors.InputError, match="orbit"):
        replay({"nu": 0.8}, pinned.natural_state(), rate=0.1)
    with pytest.raises(em.errors.InputError, match="orbit"):
        replay({"nu": 0.8}, pinned.natural_state(), rate=0.1, simulator="own")


@pytest.mark.slow
@pytest.mark.parametrize(("links", "most"), [(20, 2e-3), (40, 1.2e-3)])
def test_a_route_of_twisting_and_shortening(links, most):
    """At 0.02 per T; most of the deviation is that of the motion."""
    pytest.importorskip("mujoco", reason="MuJoCo is not installed (extra `replay`)")
    start = em.lift(RODS["bent and twisted"][0].natural_state(Theta=1.0), {"q": 1.0}).end.state
    used = ReplaySettings(links=links)
    played = replay([{"twist_A": 1.0}, {"nu": 0.7}], start, rate=0.02, settings=used)
    assert not played.snapped
    assert played.largest_deviation < most
    assert np.nanmax(played.discretisation) < 0.25 / links**2
    assert played.dynamics[-1] < 1e-4
    assert played.closure < 1e-4
