"""Chains of links stand for rods of all kinds to second order, in statics and at rest in MuJoCo."""

import numpy as np
import pytest

import equimorph as em
from dynamics.rods import RODS, loaded
from equimorph.dynamics.linkage_model import LinkageModel
from equimorph.dynamics.plant import LinkagePlant
from equimorph.dynamics.rods import ChainedRod


def model(rod, links):
    return LinkageModel(ChainedRod(rod, links))


def gap(made, state):
    """Largest distance between points of the chain and of the rod, in lengths of the rod."""
    found = made.balance(state)
    assert found is not None
    assert found.least > 0.0
    apart = made.points(found.v) - made.reference(state.batch)[0]
    return np.linalg.norm(apart, axis=1).max() / state.structure.units.value("length")


@pytest.mark.parametrize("name", RODS)
def test_the_chain_is_accurate_to_second_order(name):
    """Half a link with twice the stiffness at each clamp; forces between joints are shared."""
    state = loaded(name)
    coarse, fine = (gap(model(state.structure, links), state) for links in (16, 32))
    assert fine < 1e-3
    assert coarse / fine == pytest.approx(4.0, abs=0.3)


@pytest.mark.parametrize("name", RODS)
def test_mujoco_rests_where_the_chain_has_its_equilibrium(name):
    """An independent simulation: closures are soft by some 1e-5 of the length."""
    pytest.importorskip("mujoco", reason="MuJoCo is not installed (extra `replay`)")
    state = loaded(name)
    made = model(state.structure, 16)
    found = made.balance(state)
    moved = found.v + 1e-3 * np.sin(np.arange(made.linkage.size))
    plant = LinkagePlant(made.linkage, 0.02, 0.2)
    plant.start(np.where(made.linkage.free, moved, found.v), found.y)
    for _ in range(1500):
        plant.step()
    assert plant.speed < 1e-4
    assert np.abs(made.linkage.places(plant.v) - found.places).max() < 1e-4


def test_dampers_turn_with_their_clamp():
    """A free rod follows a clamp that turns; dampers in the world would hold it back by 0.3."""
    pytest.importorskip("mujoco", reason="MuJoCo is not installed (extra `replay`)")
    rod, rate, step = em.Rod(ends=("clamped", "free")), 0.1, 0.05
    made = model(rod, 8)
    plant, found = LinkagePlant(made.linkage, step, 3.0), made.balance(rod.natural_state())
    plant.start(found.v, found.y)
    for k in range(1, 401):
        plant.set(np.append(rate * step * k, found.y[1:]))
        plant.step()
    behind = rate * step * 400 - plant.v[made.linkage.angle_entries]
    assert np.abs(behind).max() < 0.01


def test_derivatives_of_a_chain_are_those_of_its_residual():
    """Central differences, for a rod with every kind of entry."""
    rod = em.Rod(
        ends=(em.End(angle=0.2, y=3.0), em.End(angle=0.1, x=2.0)), span=0.9, curvature=-1.0,
        axial=20.0, loads={"q": em.LineLoad(), "M": em.Couple(0.4), "P": em.PointForce(0.3)},
    )  # fmt: skip
    linkage = model(rod, 6).linkage
    generator = np.random.default_rng(4)
    v, along = 0.3 * generator.normal(size=(2, linkage.size))
    forces, pull = generator.normal(size=(2, 2))
    y = np.append(generator.normal(size=len(rod.parameters)), 1.0)
    step = 1e-6
    ahead, behind = (linkage.residual(v + k * along, forces + k * pull, y) for k in (step, -step))
    slope = linkage.jacobian(v, forces, y) @ np.concatenate([along, pull])
    assert np.allclose((ahead - behind) / (2 * step), slope, atol=1e-7)


def test_pressure_on_a_chain_has_a_symmetric_stiffness_between_held_ends():
    """The potential is the area between the chain and its chord."""
    linkage = model(em.Rod(loads={"p": em.Pressure()}), 8).linkage
    y = np.array([1.0, 0.2, 0.5, 0.84, 0.0, 1.0])
    v = linkage.prescribe(np.random.default_rng(5).normal(size=linkage.size), y)
    whole = linkage.jacobian(v, np.zeros(2), y)
    basis = np.linalg.svd(whole[linkage.size :][:, : linkage.size][:, linkage.free])[2][2:].T
    inner = whole[: linkage.size, : linkage.size][np.ix_(linkage.free, linkage.free)]
    reduced = basis.T @ inner @ basis
    assert np.allclose(reduced, reduced.T, atol=1e-10)


def test_units_change_no_entry_of_the_chain_of_a_stretched_rod():
    """Entries are without dimension: 30 EA L²/B, a pull of 4, and the same in N and mm."""
    plain = em.Rod(
        ends=("clamped", "free"), axial=30.0, loads={"P": em.PointForce(1.0, (1.0, 0.0))}
    )
    system = {"force": "N", "length": "mm"}
    unit = 4.0 * np.pi**2 * 2000.0 / 300.0**2
    sized = em.Rod(
        ends=("clamped", "free"), axial=30.0 * unit, loads={"P": em.PointForce(1.0, (1.0, 0.0))},
        EI=2000.0, length=300.0, units=system, mass="1 kg",
    )  # fmt: skip
    found = []
    for rod, force in ((plain, 4.0), (sized, 4.0 * unit)):
        state = em.lift(rod.natural_state(), {"P": force}).end.state
        found.append(ChainedRod(rod, 8).entries(state))
    np.testing.assert_allclose(found[1], found[0], atol=1e-12)
    linkage = ChainedRod(plain, 8).linkage
    np.testing.assert_allclose(found[0][linkage.strain_entries], 4.0 / 30.0, rtol=1e-9)
