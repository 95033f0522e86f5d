"""Supports that actuators move carry masses along: modes, other equations, exact forces."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

import equimorph as em
from equimorph.dynamics.own_equations import OwnModel
from equimorph.dynamics.simulators import model_of

LINKS, VELOCITY = 40, 0.02


def cantilever(space=2, **options):
    """A cantilever of length 1, density 1 and stiffness 1 whose clamp moves across it."""
    along, across = np.eye(space)[:2].tolist()
    joints, actuators = {"A": (0.0,) * space, "B": along}, {"m": {"move": {"A": across}}}
    kind, member = (em.Frame, em.Member), em.Member(("A", "B"), EI=1.0, mass=1.0)
    if space == 3:
        kind, member = em.SpatialFrame, em.SpatialMember(("A", "B"), EI=1.0, mass=1.0)
        return kind(joints, [member], {"A": "fixed"}, None, actuators, elements=2)
    return em.Frame(joints, [member], {"A": "fixed"}, None, actuators, elements=2, **options)


def tip_by_modes(t):
    """Deflection of the tip relative to a clamp that rises at rate 1: −Σ Γ φ(1) sin(ωt)/ω."""
    x, total = np.linspace(0.0, 1.0, 2001), np.zeros_like(t)
    for low, high in ((1.5, 2.5), (4.0, 5.0), (7.0, 8.5), (10.5, 11.5)):
        b = brentq(lambda b: np.cos(b) * np.cosh(b) + 1.0, low, high)
        ratio = (np.cosh(b) + np.cos(b)) / (np.sinh(b) + np.sin(b))
        phi = np.cosh(b * x) - np.cos(b * x) - ratio * (np.sinh(b * x) - np.sin(b * x))
        share = np.trapezoid(phi, x) / np.trapezoid(phi**2, x)
        total -= share * phi[-1] * np.sin(b**2 * t) / b**2
    return total


def play(structure, simulator, velocity, step, time=2.5):
    """Tip relative to its equilibrium, at times, of a support that begins to move at once."""
    start = structure.natural_state()
    model = model_of(start, simulator, LINKS)
    plant, size = model.plant(start, step / model.unit, 1e-4), round(time / step)
    tip = np.empty(size)
    for k in range(size):
        plant.set(np.array([velocity * step * (k + 1)]))
        plant.step()
        tip[k] = plant.points[-1, 1] - velocity * step * (k + 1)
    return step * np.arange(1, size + 1), tip


@pytest.mark.parametrize(
    ("space", "simulator", "step"),
    [(2, "mujoco", 1e-3), (2, "own", 1e-2), pytest.param(3, "own", 1e-2, marks=pytest.mark.slow)],
)
def test_a_cantilever_lags_behind_its_clamp_as_its_modes_do(space, simulator, step):
    """Euler and Bernoulli's cantilever; all replays deviated by 0, as if its mass were at rest.

    Tolerance: 2 % of the largest lag; 9 % at all times, for links (the mass of a node at the tip:
    .5 % of the frequency) and for damping by steps (which takes away the third mode).
    """
    if simulator == "mujoco":
        pytest.importorskip("mujoco")
    t, tip = play(cantilever(space), simulator, VELOCITY, step)
    exact = VELOCITY * tip_by_modes(t)
    largest = np.abs(exact).max()
    assert largest == pytest.approx(0.48 * VELOCITY, rel=0.02)
    np.testing.assert_allclose(tip, exact, atol=0.09 * largest)
    assert np.abs(tip).max() == pytest.approx(largest, rel=0.02)


def test_mujoco_and_the_own_equations_agree_at_large_rates():
    """The tip falls behind by .2 of the length, beyond linear theory. Tolerance: as above."""
    pytest.importorskip("mujoco")
    (t, chain), (times, own) = (
        play(cantilever(), simulator, 0.5, 5e-3, 1.2) for simulator in ("mujoco", "own")
    )
    assert np.abs(own).max() > 0.2
    assert np.abs(np.interp(times, t, chain) - own).max() < 0.025


@pytest.mark.slow
def test_a_support_that_stops_gives_its_velocity_back():
    """A clamp that moves for one period of the first mode and stops leaves hardly any of it.

    What the modes say: the same again, later, with the other sign. Tolerance: as above.
    """
    structure = cantilever()
    start = structure.natural_state()
    period = 2.0 * np.pi / float(start.natural_frequencies(1)[0])
    model = OwnModel(structure, start)
    step = period / 400
    plant = model.plant(start, step / model.unit, 1e-6)
    moving = []
    for k in range(800):
        plant.set(np.array([VELOCITY * step * min(k + 1, 400)]))
        plant.step()
        moving.append(plant.points[-1, 1] - plant.p[0])
    t = step * np.arange(1, 801)
    exact = VELOCITY * (tip_by_modes(t) - np.where(t > period, tip_by_modes(t - period), 0.0))
    largest = np.abs(exact).max()
    assert np.abs(exact[500:]).max() < 0.2 * largest
    np.testing.assert_allclose(moving, exact, atol=0.09 * largest)


def test_a_free_end_without_load_turns_freely():
    """Chains held it in its direction: 1.587 times the frequency, that of a guided end."""
    pytest.importorskip("mujoco")
    structure = cantilever()
    start = structure.natural_state()
    model = model_of(start, "mujoco", 20)
    plant = model.plant(start, 0.005 / model.unit, 1e-5)
    plant._plant.data.qvel[:] = 1e-3
    tip = []
    for _ in range(800):
        plant.step()
        tip.append(plant.points[-1, 1])
    up = np.flatnonzero((np.array(tip[1:]) > 0.0) & (np.array(tip[:-1]) <= 0.0))
    period = 2.0 * np.pi / float(start.natural_frequencies(1)[0])
    assert 0.005 * np.diff(up)[0] == pytest.approx(period, rel=0.02)


def test_the_spring_moves_its_mass_where_its_support_moves():
    """m ÿ = −∂E/∂y with y = x_l tan δ, by a solver of differential equations. BDF2: 1e-3."""
    spring = em.Spring(mass=0.5)
    start = em.lift(spring.natural_state(x_l=0.8), {"F": 0.01}).end.state
    model = OwnModel(spring, start)
    step, rate = 2e-3, 0.3
    plant = model.plant(start, step / model.unit, 0.0)
    times = step * np.arange(1, 501)
    y = np.empty(len(times))
    for k, t in enumerate(times):
        plant.set(np.array([0.8 + rate * t, *start.p[1:]]))
        plant.step()
        y[k] = plant.p[0] * np.tan(plant.z[0])

    def rates(t, state):
        length = np.hypot(0.8 + rate * t, state[0])
        pull = (1.0 - length) * state[0] / length - 0.01
        return [state[1], pull / 0.5]

    exact = solve_ivp(rates, (0.0, times[-1]), [0.8 * np.tan(start.z[0]), 0.0],
                      t_eval=times, rtol=1e-10, atol=1e-12).y[0]  # fmt: skip
    assert np.abs(exact - exact[0]).max() > 0.04
    np.testing.assert_allclose(y, exact, atol=1e-3)


def specimens():
    """Structures with parameters that move masses, and their scales."""
    portal = em.Frame(
        {"A": (0, 0), "B": (0, 1), "C": (1, 1), "D": (1, 0)},
        [em.Member(("A", "B"), mass=1.0), em.Member(("B", "C"), mass=0.5, EA=200.0),
         em.Member(("C", "D"), mass=1.0)],
        {"A": "fixed", "D": {"x": 30.0, "y": "held", "angle": "held"}}, {"P": {"B": (1, 0)}},
        {"m": {"move": {"A": (0.5, 1.0)}}, "t": {"turn": {"A": 1.0}}},
    )  # fmt: skip
    return {
        "cantilever": cantilever(),
        "cantilever in space": cantilever(3),
        "portal that yields": portal,
        "clamped rod": em.Rod(),
        "rod that stretches": em.Rod(ends=("clamped", "pinned"), axial=5.0, curvature=-2.0),
        "rod in space": em.SpatialRod(torsion=0.8, lateral=1.2),
        "spring": em.Spring(),
    }


@pytest.mark.parametrize("name", list(specimens()))
def test_driven_forces_are_those_of_the_accelerated_points(name):
    """M ü + Γ + driven = JᵀW ẍ of the points along a motion of unknowns and parameters.

    Multipliers follow where constraints give way; places on the way by Newton's method.
    """
    structure = specimens()[name]
    generator, n = np.random.default_rng(3), structure.unknowns
    z = structure.natural(p := defaults(structure))[0]
    z[:, :n] += 0.02 * generator.normal(size=(1, n))
    points = structure.material
    u, a = 0.1 * generator.normal(size=(2, n))
    dp, ddp = 0.1 * generator.normal(size=(2, 1, p.shape[1])) * structure.scales
    if structure.constraints:
        corner = points._moved(z[0], p[0]).compliance
        assert (np.abs(corner).max() > 0.0) == ("yields" in name or "stretches" in name)
        if np.abs(corner).max() > 0.0:
            u, a = np.zeros((2, n))  # multipliers follow parameters only: first order in time

    def places(t):
        at = z.copy()
        at[0, :n] += t * u + 0.5 * t**2 * a
        here = p + t * dp + 0.5 * t**2 * ddp
        return points.places(close(structure, points, at, here, z, p), here)[0].ravel()

    h = 2e-3
    twice = (
        -places(2 * h) + 16.0 * places(h) - 30.0 * places(0.0) + 16.0 * places(-h) - places(-2 * h)
    ) / (12.0 * h**2)
    moved = points._moved(z[0], p[0])
    exact = moved.columns.T @ (moved.weights * twice)
    velocity = u[None]
    found = structure.inertia(z, p)[0] @ a + structure.inertial_force(z, p, velocity)[0]
    found = found + structure.driven_force(z, p, velocity, dp, ddp)[0]
    np.testing.assert_allclose(found, exact, atol=2e-6 * np.abs(exact).max())


def close(structure, points, z, p, start, before):
    """States whose constraints have the values of the start, by the multipliers that give way."""
    n = structure.unknowns
    compliance = points._moved(start[0], before[0]).compliance
    if not structure.constraints or np.abs(compliance).max() == 0.0:
        return z
    wanted = structure.residual(start, before)[:, n:]
    for _ in range(8):
        z[:, n:] -= (structure.residual(z, p)[:, n:] - wanted) @ compliance
    return z


def defaults(structure):
    """One row of default parameters."""
    values = [1.0 if each.default is None else each.default for each in structure.parameters]
    return np.array([values])
