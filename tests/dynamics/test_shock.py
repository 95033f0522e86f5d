"""Least shocks: bounds in closed form, losses on separatrices, and against MuJoCo."""

import numpy as np
import pytest

import equimorph as em
from equimorph.dynamics.model import landing
from equimorph.dynamics.outcomes import Clock, Launches, Outcome, least_force, play
from equimorph.dynamics.own_equations import Motion
from equimorph.dynamics.shock import _Trial
from equimorph.dynamics.simulators import model_of
from equimorph.errors import InputError
from equimorph.structures.added_load import Pushed
from equimorph.structures.contract import Structure
from equimorph.structures.vibration import vibrations
from equimorph.tolerances import SAME_SOLUTION

MASS = 2.0
QUICK = em.ReplaySettings(step=0.05)


@pytest.fixture(scope="module")
def well():
    """E = x⁴/4 − x²/2: minima at ±1, a saddle of height ¼ at 0."""
    unknown = em.Unknown("x", "1", guesses=(-2, 2))
    load = em.Parameter("f", "1", 1.0, "load", 0.0)
    return em.EnergyStructure("x**4/4 - x**2/2 - f*x", [unknown], [load], mass=[str(MASS)])


def von_mises(rise=0.3):
    joints = {"A": (-1.0, 0.0), "B": (0.0, rise), "C": (1.0, 0.0)}
    held = {"A": "xy", "B": "x", "C": "xy"}
    loads = {"F": {"B": (0.0, -1.0)}}
    return em.Truss(joints, [("A", "B"), ("B", "C")], held, loads, strain="green",
                    masses={"B": MASS})  # fmt: skip


def launches(structure, state, level, speeds):
    ones = np.ones((len(speeds), 1))
    return Launches(
        ones * state.z, ones * state.p, np.asarray(speeds)[:, None] * np.ones(structure.unknowns),
        ones * state.z, np.full(len(speeds), level),
    )  # fmt: skip


@pytest.mark.parametrize("rate", [0.01, pytest.param(0.002, marks=pytest.mark.slow)])
def test_the_least_impulse_of_a_double_well_is_that_of_its_damped_separatrix(well, rate):
    """v² = 2 (ΔE + c ∫ ẋ dx)/m with the loss on the undamped way, first order in c = rate·m."""
    loss = np.sqrt(2.0) * (2.0 / 3.0) * (1.0 - 0.5**1.5)
    speed = np.sqrt(2.0 * (0.25 + rate * loss) / MASS)
    share = 3.0 * rate**2 + 2e-4  # second order in the damping, and of the step
    tried = -speed * np.array([1.0 - share, 1.0 + share])
    given = launches(well, well.natural_state(), 0.0, tried)
    seen = play(well, given, Clock(0.02, rate, 5.0), watch=True)
    assert seen.code.tolist() == [Outcome.HELD, Outcome.LEFT]


@pytest.mark.slow
def test_no_smaller_impulse_can_and_a_slow_force_snaps_at_the_fold():
    """Bounds √(2 m ΔE); limit load (1 − x_l^⅔)^(3/2) of the spring, downwards only."""
    spring = em.Spring()
    shock = em.least_shock(spring.natural_state(x_l=0.8), at=spring.height, settings=QUICK)
    impulse, force = shock["point impulse"], shock["point force"]
    assert shock.barrier.energy == pytest.approx(0.02, abs=1e-12)
    assert shock["impulse over the saddle"].bound == pytest.approx(0.02, abs=1e-9)
    assert impulse.bound == pytest.approx(0.2, rel=1e-9)
    assert impulse.bound <= impulse.holds < abs(impulse.value) <= 1.001001 * impulse.holds
    assert impulse.value < 0.0
    assert impulse.landing.z[0] == pytest.approx(-np.arccos(0.8))
    assert force.value == pytest.approx(-((1.0 - 0.8 ** (2 / 3)) ** 1.5), abs=1e-9)
    assert force.landing.z[0] == pytest.approx(-np.arccos(0.8))
    assert shock.push[-1] == pytest.approx([0.0, -0.6])
    assert "point force" in repr(shock)


@pytest.mark.parametrize("x_l", [0.7, 0.9])
def test_the_least_slow_force_is_the_limit_load(x_l):
    """(1 − x_l^⅔)^(3/2), downwards only, from a force that the spring has no parameter for."""
    spring = em.Spring()
    start = spring.natural_state(x_l=x_l)
    barrier = em.transition_network(spring, start.parameters).barrier(start)
    force = least_force(start, barrier, spring.height)
    assert force.value == pytest.approx(-((1.0 - x_l ** (2 / 3)) ** 1.5), abs=1e-9)
    assert (force.unit, force.landing.z[0]) == ("force", pytest.approx(-np.arccos(x_l)))


@pytest.mark.slow
def test_least_shocks_of_a_von_mises_truss():
    """Green strain: ΔE = EA L (a²/2L²)², F = EA (y³ − a² y)/L³ with its limit at y = a/√3."""
    rise, truss = 0.3, von_mises()
    length = np.hypot(1.0, rise)
    shock = em.least_shock(truss.natural_state(), at=truss.displacement("B", "y"), kick={"F": 0.02})
    barrier = length * (rise**2 / (2.0 * length**2)) ** 2
    impulse, kick = shock["point impulse"], shock["kick"]
    assert impulse.bound == pytest.approx(np.sqrt(2.0 * MASS * barrier), rel=1e-9)
    limit = 2.0 * rise**3 / (3.0 * np.sqrt(3.0)) / length**3
    assert shock["point force"].value == pytest.approx(-limit, rel=1e-9)
    # a load that is put on at once does F a work up to the flat truss, whose energy is ΔE
    assert kick.bound < kick.value
    assert 0.02 * kick.value < limit
    assert 0.02 * kick.value > barrier / (2.0 * rise)


def test_forces_of_inertia_are_those_of_the_energy_of_motion():
    """Undamped motions keep their energy, to second order in the step; Γ against differences."""
    spring = em.Spring()
    start = spring.natural_state(x_l=0.8)
    drift = []
    for step in (0.04, 0.02):
        motion, p = Motion.of(start.z[None], np.array([[0.1]])), start.p[None]
        first = motion.energy(spring, p)[0]
        for _ in range(round(8.0 / step)):
            motion, _ = motion.step(spring, p, step, 0.0)
        drift.append(abs(motion.energy(spring, p)[0] / first - 1.0))
    assert drift[1] < 2e-3
    assert drift[0] / drift[1] == pytest.approx(4.0, rel=0.2)
    generator = np.random.default_rng(0)
    member = em.Member(("A", "B"), mass=1.0, EI=1.0)
    rods = [
        em.Rod(elements=2),
        em.Rod(ends=("clamped", "free"), loads={"P": em.PointForce(1.0)}, elements=2),
        em.Frame({"A": (0, 0), "B": (0, 1)}, [member], {"A": "fixed"}, {"F": {"B": (0, -1)}}),
    ]
    for rod in rods:
        state = rod.natural_state(**({"Theta": 1.0, "Delta": 0.2} if rod is rods[0] else {}))
        z, v = state.z + 0.1 * generator.normal(size=rod.size), generator.normal(size=rod.unknowns)
        here = z[None], state.p[None], v[None]
        plain = Structure.inertial_force(rod, *here)
        error = np.abs(rod.inertial_force(*here) - plain).max()
        assert error < 1e-6 * np.abs(plain).max()


def test_a_pushed_structure_is_what_its_load_makes_of_it():
    """A force on the height of the spring is its load: derivatives agree with the closed form."""
    spring = em.Spring()
    pushed = Pushed(spring, spring.height, 1.0, 1.0)
    z, own = np.array([[0.4]]), np.array([[0.8, 0.01, 1.0]])
    p = np.append(own, [[0.03]], axis=1)
    loaded = own - [[0.0, 0.03, 0.0]]
    assert pushed.residual(z, p) == pytest.approx(spring.residual(z, loaded), abs=1e-10)
    assert pushed.energy(z, p) == pytest.approx(spring.energy(z, loaded))
    assert pushed.gradient(z[:0], p[:0]).shape == (0, 1)
    assert pushed.hessian(z[:0], p[:0]).shape == (0, 1, 1)
    rhs = np.ones((1, 1, 1))
    assert pushed.solve(z, p, rhs).x == pytest.approx(spring.solve(z, loaded, rhs).x, rel=1e-5)


def test_states_without_a_barrier_have_no_shock_and_bad_ones_are_refused(well):
    alone = em.least_shock(em.Spring().natural_state(x_l=1.2))
    assert (alone.barrier.status, alone.shocks) == ("nothing to snap to", ())
    start = well.natural_state()
    with pytest.raises(InputError, match="must be stable"):
        em.least_shock(em.State(well, np.zeros(1), np.zeros(1)))
    with pytest.raises(InputError, match="damping"):
        em.least_shock(start, settings=em.ReplaySettings(damping=0.0))
    still = em.Descriptor("still", "1", lambda z, p: np.zeros(len(z)))
    with pytest.raises(InputError, match="must move with the unknowns"):
        em.least_shock(start, at=still)


@pytest.mark.slow
@pytest.mark.parametrize("damping", [0.01, 0.05])
def test_the_least_impulse_of_an_arch_is_confirmed_by_mujoco(damping):
    """Blows on the crown, in the two lowest modes, on a chain of 40 rigid links, within 10 %.

    Both are damped in proportion to their mass: joints have no damping of their own, and between
    steps all rates of the chain decay by exp(−c dt), the exact flow of M q̈ = −c M q̇.
    """
    pytest.importorskip("mujoco", reason="MuJoCo is not installed (extra `replay`)")
    arch, used = em.Rod(), em.ReplaySettings(step=0.04, damping=damping)
    start = em.lift(arch.natural_state(Theta=1.0), {"q": 2.5}).end.state
    crown = arch.height(0.5)
    slope = Pushed(arch, crown, 1.0, 1.0).gradient(start.z[None], np.append(start.p, 0.0)[None])[0]
    saddle = em.transition_network(arch, start.parameters).barrier(start).saddle
    trial = _Trial(start, saddle, used, 2)
    impulse = trial.impulse(crown, slope)
    modes = vibrations(arch, start.z[None], start.p[None], 2).modes[0]
    way = np.zeros(arch.size)
    way[: arch.unknowns] = 1e-5 * modes.T @ (modes @ slope)
    model = model_of(start, "mujoco", 40)
    settings, places = model.settings(start.p), []
    decay = np.exp(-0.02 * trial.clock.rate)
    for moved in (start.z + way, start.z - way):
        links = model._chained.entries(em.State(arch, moved, start.p))
        chain = model.plant(start, 0.02, 0.0)._plant
        chain.start(model.linkage.prescribe(links, settings), settings)
        places.append(chain.data.qpos.copy())

    def snaps(size):
        plant = model.plant(start, 0.02, 0.0)
        rates = plant._plant.data.qvel
        rates[:] = size * (places[0] - places[1]) / 2e-5
        for _ in range(5000):
            plant.step()
            rates *= decay
        rest = landing(arch, plant.guess(), start.p)
        return np.sqrt(arch.mass @ (rest.z - start.z)[: arch.unknowns] ** 2) > SAME_SOLUTION

    assert not snaps(0.95 * np.sign(impulse.value) * impulse.bound)
    assert not snaps(0.9 * impulse.value)
    assert snaps(1.1 * impulse.value)
