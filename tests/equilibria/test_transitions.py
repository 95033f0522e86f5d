"""Transition networks: barriers in closed form, and against independent descents."""

from itertools import product

import numpy as np
import pytest

import equimorph as em
from equimorph.errors import InputError
from oracles.landscapes import follow_edge, relax, string_pass
from oracles.polynomial import Polynomial
from oracles.quartics import Quartic, quartic_structure


def tilted_wells(count: int) -> em.EnergyStructure:
    """E = Σ yᵢ⁴/4 + (bᵢ − 1) yᵢ³/3 − bᵢ yᵢ²/2, y = R u: wells at 1 and −bᵢ, saddles at 0."""
    b = 0.6 + 0.1 * np.arange(count)
    rotation = np.linalg.qr(np.random.default_rng(3).normal(size=(count, count)))[0]
    names = [f"u{i}" for i in range(count)]
    turned = {
        f"y{i}": " + ".join(f"({float(rotation[i, j])!r})*u{j}" for j in range(count))
        for i in range(count)
    }
    energy = " + ".join(
        f"y{i}**4/4 + {float(b[i] - 1)!r}*y{i}**3/3 - {float(b[i])!r}*y{i}**2/2"
        for i in range(count)
    )
    unknowns = [em.Unknown(name, float(sum(rotation[:, j])), guesses=(-2, 2)) for j, name in
                enumerate(names)]  # fmt: skip
    load = em.Parameter("f", "1", 1.0, "load", 0.0)
    return em.EnergyStructure(f"{energy} - f*u0", unknowns, [load], definitions=turned)


@pytest.mark.parametrize("count", [1, 2, 3, pytest.param(4, marks=pytest.mark.slow)])
def test_barriers_of_double_wells_of_one_to_four_unknowns(count):
    """Wells of depth (1 + 2b)/12 and b³(2 + b)/12: a barrier is a corner's least depth."""
    network = em.transition_network(tilted_wells(count), {})
    b = 0.6 + 0.1 * np.arange(count)
    depths = list(zip((1 + 2 * b) / 12, b**3 * (2 + b) / 12, strict=True))
    corners = sorted((-sum(corner), min(corner)) for corner in product(*depths))
    assert len(network.minima) == 2**count
    minima = network.states[network.minima]
    found = sorted((state.energy, network.barrier(state).energy) for state in minima)
    assert np.array(found) == pytest.approx(np.array(corners), abs=1e-9)
    assert len(network.saddles) == count * 2 ** (count - 1)
    assert len(network.merges) == 2**count - 1


@pytest.mark.parametrize("x_l", [0.7, 0.95])
def test_the_barrier_of_a_spring_is_that_of_its_flat_state(x_l):
    """E = k/2 (1 − l)²: at l = x_l it is flat, otherwise at rest, at the energy zero."""
    network = em.transition_network(em.Spring(), {"x_l": x_l, "F": 0.0})
    barrier = network.barrier(network.states[0])
    assert (barrier.energy, barrier.released) == pytest.approx([0.5 * (1 - x_l) ** 2] * 2, abs=1e-9)
    assert barrier.landing.z[0] == pytest.approx(-network.states[0].z[0], abs=1e-9)


@pytest.mark.parametrize("rise", [0.1, 0.3])
def test_the_barrier_of_a_row_of_trusses_is_that_of_its_flattest_unit(rise):
    """Bars of length l₀ that slide over their span 1: EA l₀/2 (1/l₀ − 1)², two of them, guided."""
    truss = em.Truss(
        {"A": (0.0, 0.0), "B": (1.0, rise), "C": (0.0, 2.0 * rise)},
        [em.Bar(ends, EA=3.0) for ends in (("A", "B"), ("B", "C"))],
        {"A": "xy", "B": "x", "C": "x"},
        {"F": {"C": (0.0, -1.0)}},
    )
    network = em.transition_network(truss, {"F": 0.0})
    length = np.hypot(1.0, rise)
    known = 3.0 * length / 2.0 * (1.0 / length - 1.0) ** 2
    heights = [network.barrier(state).energy for state in network.states[network.minima]]
    assert heights == pytest.approx([known] * 4, abs=1e-9)


def test_the_barrier_of_a_von_mises_truss_is_known():
    """Two bars with Green strain: E = 2 ½ EA L ε², ε = (y² − a²)/(2 L²); flat at y = 0."""
    rise = 0.3
    truss = em.Truss(
        {"A": (-1.0, 0.0), "B": (0.0, rise), "C": (1.0, 0.0)},
        [em.Bar(("A", "B")), em.Bar(("B", "C"))],
        {"A": "xy", "B": "x", "C": "xy"},
        {"F": {"B": (0.0, -1.0)}},
        strain="green",
    )
    network = em.transition_network(truss, {"F": 0.0})
    length = np.hypot(1.0, rise)
    known = length * (rise**2 / (2.0 * length**2)) ** 2
    heights = [network.barrier(state).energy for state in network.states[network.minima]]
    assert heights == pytest.approx([known] * 2, abs=1e-9)


def test_nothing_to_snap_to_is_an_answer():
    """A spring longer than its guide has one state; an unbounded well lets the structure escape."""
    network = em.transition_network(em.Spring(), {"x_l": 1.1, "F": 0.0})
    barrier = network.barrier(network.states[0])
    assert (barrier.status, barrier.energy, barrier.saddle) == ("nothing to snap to", np.inf, None)
    assert repr(barrier) == "EnergyBarrier(nothing to snap to)"
    cubic = Polynomial(lambda x, a: x**3 * (1 / 3) - a * x, 1, ("a",))
    network = em.transition_network(cubic, {"a": 1.0})
    barrier = network.barrier(network.states[network.minima][0])
    assert (barrier.status, barrier.landing) == ("escaped", None)
    assert barrier.energy == pytest.approx(4 / 3, abs=1e-9)
    assert np.isnan(barrier.released)


def test_the_arch_snaps_from_both_sides_over_two_saddles():
    """(1, 0), q = 2.5: 0.0631 upright, 0.1202 inverted."""
    arch = em.Rod()
    network = em.transition_network(arch, {"Theta": 1.0, "Delta": 0.0, "q": 2.5})
    by_height = sorted(network.states[network.minima], key=arch.elevation)
    heights = [network.barrier(state).energy for state in by_height]
    assert heights == pytest.approx([0.1202, 0.0631], abs=5e-5)
    assert len(network.saddles) == 2
    assert {frozenset(row) for row in network.ends.tolist()} == {frozenset(network.minima.tolist())}


def test_a_saddle_between_symmetric_states_leads_to_the_states_below_it():
    """E = x⁴/4 − x²/2 + y⁴/4 − y²/8 − x²y²/10: descents along the axes end at saddles."""
    wells = Polynomial(
        lambda x, y, a: x**4 * 0.25 - x**2 * 0.5 + y**4 * 0.25 + x**2 * y**2 * a - y**2 * 0.125,
        2, ("a",),
    )  # fmt: skip
    network = em.transition_network(wells, {"a": -0.1})
    minima = list(network.states[network.minima])
    assert all(network.barrier(state).landing.stable for state in minima)
    assert len(network.path(minima[0], minima[-1]).minima) > 1


def test_states_beyond_constraints_are_marked():
    """x ≤ ½ cuts off the right well: the barrier stays, and says so."""
    well = tilted_wells(1)
    bound = well.descriptor("u0")
    network = em.transition_network(well, {}, within=[bound <= 0.5])
    low = network.states[[k for k in network.minima if network.admissible[k]]][0]
    barrier = network.barrier(low)
    assert not barrier.admissible
    assert "beyond the constraints" in repr(barrier)
    assert "1 states beyond the constraints" in repr(network)


def test_a_path_leads_over_the_lowest_passes():
    """Energies fall from each saddle to the minima beside it; the saddles are those of merges."""
    network = em.transition_network(tilted_wells(2), {})
    minima = network.states[network.minima]
    path = network.path(minima[0], minima[3])
    energy = path.states.energy
    tops = np.flatnonzero((np.diff(energy)[:-1] > 0) & (np.diff(energy)[1:] <= 0)) + 1
    assert energy[tops] == pytest.approx(path.saddles.energy, abs=1e-12)
    assert path.saddles.energy.max() == pytest.approx(max(m.energy for m in network.merges))
    assert path.length[-1] > 2.0
    assert network.path(minima[0], minima[0]).saddles.energy.tolist() == []


def test_other_states_are_refused():
    network = em.transition_network(em.Spring(), {"x_l": 0.8, "F": 0.0})
    with pytest.raises(InputError, match="parameters of the network"):
        network.barrier(em.Spring().natural_state(x_l=0.9))
    with pytest.raises(InputError, match="stable state of the network"):
        network.barrier(network.states[int(network.saddles[0])])


def check_against_descents(unknowns, seed, points):
    """No basin, no transition and no lower pass than the network's, by descents of the test."""
    generator = np.random.default_rng(seed)
    energy = Quartic.random(unknowns, generator)
    structure = quartic_structure(unknowns)
    names = [each.name for each in structure.parameters]
    network = em.transition_network(structure, dict(zip(names, energy.values, strict=True)))
    minima = network.minima
    wells = network.states.z[minima]
    ends, label = relax(energy, generator.uniform(-2.0, 2.0, (points, unknowns)), wells)
    assert np.abs(ends - wells[label]).max() < 1e-6
    joined = {(int(saddle), *sorted(pair)) for saddle, *pair in network.ways}
    for saddle, one, other in follow_edge(energy, wells, generator, points // 5):
        gap = np.abs(network.states.z - saddle).max(axis=1)
        assert gap.min() < 1e-6
        assert (int(gap.argmin()), *sorted((minima[one], minima[other]))) in joined
    top = max((merge.energy for merge in network.merges), default=None)
    if top is not None and unknowns > 1:
        last = network.merges[-1]
        ends = network.states.z[list(last.between)]
        assert string_pass(energy, *ends) >= top - 1e-3 * abs(top)


def test_no_transition_is_missing_that_a_descent_finds():
    check_against_descents(2, 1, 40)


@pytest.mark.slow
@pytest.mark.parametrize("part", range(25))
def test_no_transition_of_fifty_structures_is_missing(part):
    for number in (2 * part, 2 * part + 1):
        check_against_descents(2 + number % 5 % 3, 100 + number, 200)
