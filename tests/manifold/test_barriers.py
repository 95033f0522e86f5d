"""Energy barriers over sets: closed forms, and the networks of single settings."""

import numpy as np
import pytest

import equimorph as em
from equimorph.errors import InputError


@pytest.fixture(scope="module")
def line():
    """Spring without load: E = ½ (1 − l)² is ½ (1 − x_l)² where it lies flat."""
    return em.equilibrium_set(
        em.Spring(), em.Box(x_l=(0.6, 1.3)), fixed={"F": 0.0}, intervals=(15,)
    )


@pytest.fixture(scope="module")
def plane():
    box = em.Box(x_l=(0.5, 1.3), F=(-0.2, 0.2))
    return em.equilibrium_set(em.Spring(), box, intervals=(10, 10))


@pytest.fixture(scope="module")
def arch_set():
    arch = em.Rod()
    box = em.Box(Theta=(0.5, 1.6), Delta=(-1.0, 1.4))
    bounds = [arch.max_curvature <= 20]
    return em.equilibrium_set(arch, box, fixed={"q": 2.5}, within=bounds, intervals=(16, 30))


def test_barriers_of_the_unloaded_spring_are_known(line):
    """½ (1 − x_l)² above the tilted states, none above the flat ones of a spring that is long."""
    found = em.barriers(line)
    stable = line.points[np.flatnonzero(line.index == 0)]
    known = np.where(stable["x_l"] < 1.0, 0.5 * (1.0 - stable["x_l"]) ** 2, np.inf)
    known[np.abs(stable["x_l"] - 1.0) < 1e-6] = 0.0
    assert found.of(stable).energy == pytest.approx(known, abs=1e-9)
    unstable = line.points[np.flatnonzero(line.index == 1)]
    assert found.of(unstable).energy == pytest.approx(0.0, abs=1e-12)
    assert {each.status for each in found.of(unstable)} == {"unstable"}


def test_a_bound_on_the_barrier_cuts_a_set_exactly(line):
    """ΔE ≥ 0.02: up to x_l = 0.8, and where there is nothing to snap to."""
    field = em.barriers(line)
    pieces = em.components(line, stable=True, within=[field.descriptor >= 0.02])
    ends = sorted(float(piece.points["x_l"].max()) for piece in pieces)
    assert ends == pytest.approx([0.8, 0.8, 1.3], abs=1e-9)
    assert field.ceiling == pytest.approx(2.0 * 0.5 * 0.4**2)


def agree(eset, points, seed=0):
    """Barriers from the set and from the network of each setting: the number that agree."""
    field, generator = em.barriers(eset), np.random.default_rng(seed)
    count = 0
    for point in generator.uniform(eset.box.lower, eset.box.upper, (points, len(eset.names))):
        at = dict(zip(eset.names, point.tolist(), strict=True))
        stable = eset.at(**at).stable
        network = em.transition_network(
            eset.structure, {**eset.fixed, **at}, within=eset.constraints
        )
        for state, mine in zip(stable, field.of(stable), strict=True):
            other = network.barrier(state)
            assert mine.status == other.status
            if other.landing is not None:
                assert mine.energy == pytest.approx(other.energy, abs=1e-9)
                assert mine.landing.energy == pytest.approx(other.landing.energy, abs=1e-9)
                assert mine.released == pytest.approx(other.released, abs=1e-9)
            bound = float(field.descriptor(state))
            assert bound <= min(other.energy, field.ceiling) + 1e-12
            count += 1
    return count


def test_barriers_vanish_where_snaps_begin_and_lead_to_the_same_states(plane):
    """At folds `snap_graph` has the limit of what `barriers` say of states before: 0.1 % of F."""
    field, graph, count = em.barriers(plane), em.snap_graph(plane, samples=4), 0
    for snap in graph.snaps:
        for vertex, one in zip(snap.vertices, snap.landings, strict=True):
            fold = plane.points[int(vertex)]
            if one.status != "landed" or abs(fold["F"]) < 1e-3:
                continue
            stable = plane.at(x_l=fold["x_l"], F=0.999 * fold["F"]).stable
            gap = np.abs(stable.z[:, 0] - fold.z[0])
            near = field.of(stable[[int(gap.argmin())]])[0]
            assert 0.0 < near.energy < 1e-4
            assert near.landing.z[0] == pytest.approx(one.state.z[0], abs=1e-3)
            assert near.released == pytest.approx(one.released, rel=0.01, abs=1e-5)
            count += 1
    assert count >= 4


def test_a_set_knows_the_barriers_of_single_settings(plane):
    assert agree(plane, 5) >= 5


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(4))
def test_the_set_of_an_arch_knows_the_barriers_of_single_settings(arch_set, seed):
    assert agree(arch_set, 40, seed) >= 40


@pytest.mark.slow
def test_a_three_parameter_set_has_barriers():
    """k (1 − x_l)²/2 without load; with three parameters F = 0 lies inside the set."""
    box = em.Box(x_l=(0.6, 0.9), F=(-0.005, 0.005), k=(0.5, 2.0))
    eset = em.equilibrium_set(em.Spring(), box, intervals=(3, 3, 3))
    stable = eset.at(x_l=0.7, F=0.0, k=1.5).stable
    assert em.barriers(eset).of(stable).energy == pytest.approx([1.5 * 0.045] * 2, abs=1e-9)


@pytest.mark.slow
def test_the_barrier_is_not_least_where_the_margin_is():
    """README's route: 0.0064 at a margin of 0.54, known from single networks.

    The least barrier, 0.0043 at a margin of 0.41, is met where the other equilibrium vanishes.
    """
    arch = em.Rod(load="uniform")
    box = em.Box(Theta=(0.2, 2.5), Delta=(-2, 2))
    bounds = [arch.max_curvature <= 20]
    eset = em.equilibrium_set(arch, box, fixed={"q": 2.5}, within=bounds)
    down, up = sorted(eset.at(Theta=1.0, Delta=0.0).stable, key=arch.elevation)
    route = em.plan(eset, up, down, margin=0.3)
    field = em.barriers(eset)
    energy, margin = field.of(route.states).energy, route.states.margin
    least = int(energy.argmin())
    low, high = np.interp([0.535, 0.545], margin[least:0:-1], energy[least:0:-1])
    assert low < 6.4e-3 + 5e-5  # both numbers are rounded
    assert high > 6.4e-3 - 5e-5
    # the barrier jumps to infinity between two states of the route: bisected
    last, beyond = route.states[least], route.states[least + 1]
    for _ in range(10):
        middle = {name: 0.5 * (last[name] + beyond[name]) for name in ("Theta", "Delta")}
        state = em.lift(last, middle).end.state
        if np.isfinite(field.of(state.batch).energy[0]):
            last = state
        else:
            beyond = state
    assert field.of(last.batch).energy[0] == pytest.approx(4.3e-3, abs=5e-5)
    assert last.margin == pytest.approx(0.41, abs=5e-3)
    assert margin.min() < 0.31


def test_states_of_other_settings_are_refused(line):
    field = em.barriers(line)
    assert "cells of index one" in repr(field)
    with pytest.raises(InputError, match="must lie over Box"):
        field.of(em.lift(em.Spring().natural_state(x_l=0.8), {"F": 0.01}).end.state.batch)
    with pytest.raises(InputError, match="structure of the set"):
        field.of(em.Rod().natural_state(Theta=1.0).batch)
    far = field.of(line.points[:1])
    assert len(far) == 1
    assert "1 states" in repr(far)
