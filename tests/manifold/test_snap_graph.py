"""Snaps of the spring in closed form, and energies without a lower bound."""

import numpy as np
import pytest

from equimorph.errors import InputError
from equimorph.manifold import EquilibriumSet, equilibrium_set, snap_graph
from equimorph.model import Box
from equimorph.structures import Spring
from oracles.polynomial import fold_form, pitchfork_form
from typecheck import unchecked


def lifted(structure, box: Box, **options) -> EquilibriumSet:
    with unchecked():
        return equilibrium_set(structure, box, checks=0, **options)


def energy(delta: float, x: float, force: float) -> float:
    """E = ½ (1 − x_l/cos δ)² + F x_l tan δ for k = 1."""
    return 0.5 * (1 - x / np.cos(delta)) ** 2 + force * x * np.tan(delta)


def landing(x: float, force: float) -> float:
    """Stable δ on the other side at a fold load, the simple root: δ_fold is a double one."""
    roots = np.roots([1, -2 * x - 2j * force, 0, 2 * x - 2j * force, -1])
    delta = np.angle(roots)
    stable = (np.cos(delta) > 0) & (x > np.cos(delta) ** 3 + 1e-4)
    return float(delta[stable & (np.abs(np.abs(roots) - 1) < 1e-9)][0])


def test_spring_snaps_between_its_two_stable_branches():
    """x_l = 0.7: folds at cos³ δ = 0.7; two strata, each snaps to the other."""
    eset = lifted(Spring(), Box(F=(-0.4, 0.4)), fixed={"x_l": 0.7}, intervals=(9,))
    graph = snap_graph(eset)
    first, second = graph.strata
    assert [snap.target for snap in graph.leaving(first)] == [second]
    assert [snap.target for snap in graph.leaving(second)] == [first]
    fold = np.arccos(np.cbrt(0.7))
    load = np.sin(fold) ** 3
    freed = energy(fold, 0.7, load) - energy(landing(0.7, load), 0.7, load)
    for snap in graph.snaps:
        assert snap.status == "landed"
        # det F_z = 0 to 1e-9 leaves δ to about its root, and energies far better
        assert snap.released == pytest.approx((freed, freed), abs=1e-8)


def test_energies_freed_along_the_stability_boundary(spring_set):
    """One stable stratum: snaps lead from it to itself, from below to above the hinge and back."""
    graph = snap_graph(spring_set, samples=6)
    assert graph.strata == (0,)
    assert {snap.target for snap in graph.snaps} == {0}
    for snap in graph.snaps:
        for vertex, one in zip(snap.vertices, snap.landings, strict=True):
            x, force = spring_set.coordinates[vertex]
            there = landing(x, force)
            assert one.state.z[0] == pytest.approx(there, abs=1e-7)
            fold = spring_set.points.z[vertex, 0]
            freed = energy(fold, x, force) - energy(there, x, force)
            assert one.released == pytest.approx(freed, abs=1e-9)


def test_nothing_stops_a_snap_without_a_lower_bound_of_the_energy():
    """E = x³/3 − a x falls for ever below the fold."""
    graph = snap_graph(lifted(fold_form(), Box(a=(-1, 1)), intervals=(5,)))
    assert [(snap.status, snap.target) for snap in graph.snaps] == [("escaped", -1)]
    assert "out of the set (escaped)" in repr(graph)


def test_a_set_without_folds_has_no_snaps():
    eset = lifted(pitchfork_form(1), Box(a=(-2, -1), b=(-1, 1)), intervals=(3, 3))
    assert snap_graph(eset).snaps == ()


def test_snaps_can_be_read():
    eset = lifted(Spring(), Box(F=(-0.4, 0.4)), fixed={"x_l": 0.7}, intervals=(9,))
    lines = repr(snap_graph(eset)).splitlines()
    assert lines[0] == "SnapGraph over Box(F=(-0.4, 0.4)): 2 stable strata"
    assert sum("snaps to stratum" in line for line in lines) == 2


def test_wrong_questions_about_snaps_are_refused(spring_set):
    with pytest.raises(InputError, match=r"`samples` must be a whole number from 2 to"):
        snap_graph(spring_set, samples=1)
    graph = snap_graph(spring_set, samples=2)
    with pytest.raises(InputError, match=r"`stratum` must be a stable one \(0\); got 1"):
        graph.leaving(1)


def test_surfaces_of_folds_have_no_order_along_them():
    """Over three parameters a run is those vertices alone that were tried."""
    eset = lifted(Spring(), Box(x_l=(0.6, 0.8), F=(-0.3, 0.3), k=(0.8, 1.2)), intervals=(2, 5, 2))
    snaps = snap_graph(eset, samples=6).snaps
    assert len(snaps) == 2
    for snap in snaps:
        assert len(snap.vertices) > 1
        np.testing.assert_array_equal(snap.along, snap.vertices)
