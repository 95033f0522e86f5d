"""Completeness by argument: descents, the graph of minima, the sum of indices."""

import numpy as np
import pytest

import equimorph as em
from equimorph.equilibria import minima_graph, random_search
from equimorph.equilibria.minima_graph import MinimaGraph
from equimorph.equilibria.random_search import Ground
from equimorph.equilibria.saddles import Met
from oracles.close_states import close_roots, close_sheets, truss_row
from oracles.polynomial import bead_on_a_circle

AT = {"p": 0.3, "r": 0.2}
HOLDS, OPEN, NOT = "holds", "open", "does not apply"


def standing(found):
    return {each.name: each.standing for each in found.arguments}


@pytest.mark.parametrize(
    ("p", "r"), [(0.31, 0.2), (0.1, 0.7), (-0.4, 0.3), (0.7, -0.2), (-0.33, 0.66)]
)
def test_pushes_along_soft_modes_meet_close_states(p, r):
    """Wells as deep as 1e-30 in units of energy: all arguments hold without four of the states."""
    found = em.find_equilibria(close_sheets(1e-5, 6), {"p": p, "r": r})
    assert np.sort(found.z[:, 0]) == pytest.approx(close_roots(1e-5, 6, p, r), abs=1e-9)


@pytest.mark.parametrize("sheets", [2, 3, 4, 5, 6])
@pytest.mark.parametrize("distance", [1e-1, 1e-3, 1e-5])
def test_no_state_is_missing_among_close_ones(sheets, distance):
    """All roots of E' = (x − 3) Π (x − a − kd), k < sheets. Newton ends at corrections of 1e-10."""
    found = em.find_equilibria(close_sheets(distance, sheets), AT)
    roots = close_roots(distance, sheets, **AT)
    assert np.sort(found.z[:, 0]) == pytest.approx(roots, abs=1e-9)
    # the energy of an even number of roots falls without end to the left
    even = len(roots) % 2 == 0
    assert standing(found) == {
        "descents": HOLDS,
        "graph of minima": HOLDS,
        "sum of indices": NOT if even else HOLDS,
    }


@pytest.mark.parametrize(("count", "seed"), [(2, 0), (3, None), (3, 0), (3, 1)])
def test_rows_of_bistable_trusses_have_all_their_stable_states(count, seed):
    found = em.find_equilibria(truss_row(count, seed), {"F": 0.0})
    assert int((found.index == 0).sum()) == 2**count
    assert set(standing(found).values()) == {HOLDS}


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(10))
@pytest.mark.parametrize("count", [2, 3, 4])
def test_no_row_lacks_a_stable_state(count, seed):
    found = em.find_equilibria(truss_row(count, seed), {"F": 0.0})
    assert int((found.index == 0).sum()) == 2**count


def test_arguments_say_where_pushes_were_left_out(monkeypatch):
    """Over points with very many states, like an unloaded dome with 1644, they take too long."""
    for module in (minima_graph, random_search):
        monkeypatch.setattr(module, "PUSHED", 3)
    found = em.find_equilibria(close_sheets(0.1), AT)
    (told,) = (each for each in found.arguments if each.name == "pushes")
    assert str(told) == "pushes: open (left out: 4 states are more than 3; others may be missing)"


def graph_of(structure, z, p):
    z = np.asarray(z, dtype=float).reshape(-1, structure.size)
    return MinimaGraph(Ground(structure, np.atleast_2d(p), ()), z, np.zeros(len(z), int))


@pytest.mark.parametrize("count", [2, 3])
def test_every_state_that_is_left_out_is_found_again(count):
    """Leave one minimum out, or a minimum and one saddle: the rest leads back to it."""
    truss = truss_row(count, 0)
    found = em.find_equilibria(truss, {"F": 0.0})
    minima = np.flatnonzero(found.index == 0)
    for left_out in minima:
        graph = graph_of(truss, np.delete(found.z, left_out, axis=0), found.p[0])
        graph.descend()
        assert (graph.index == 0).sum() == len(minima)
    saddles = np.flatnonzero(found.index == 1)
    for minimum, saddle in zip(minima, saddles, strict=False):
        graph = graph_of(truss, np.delete(found.z, [minimum, saddle], axis=0), found.p[0])
        graph.descend()
        graph.connect()
        assert (graph.index == 0).sum() == len(minima)


def test_saddles_are_found_between_minima_alone():
    """From the four minima of a row of two alone: the graph becomes connected."""
    truss = truss_row(2, 0)
    found = em.find_equilibria(truss, {"F": 0.0})
    graph = graph_of(truss, found.z[found.index == 0], found.p[0])
    assert graph.pieces(0)[1].max() == 3
    graph.connect()
    assert graph.pieces(0)[1].max() == 0


def test_pairs_are_tried_at_once_in_fewer_rounds(monkeypatch):
    """Where no saddle is found, from the minima of a row of three: until none is left to be tried.

    Which pairs cut a minimum off from all others depends on their order.
    """
    truss = truss_row(3, 0)
    found = em.find_equilibria(truss, {"F": 0.0})
    minima = found.z[found.index == 0]
    nothing = Met(minima[:0], np.zeros(0, int))
    rounds = []
    for at_once in (1, 6):
        given = []

        def fail(structure, pairs, given=given):
            given.append(pairs)
            return nothing

        monkeypatch.setattr(minima_graph, "AT_ONCE", at_once)
        monkeypatch.setattr(minima_graph, "states_between", fail)
        graph = graph_of(truss, minima, found.p[0])
        graph.connect()
        assert graph._gaps(0) == []
        assert len(graph.tried[0]) == sum(len(pairs.start) for pairs in given)
        rounds.append(len(given))
    assert rounds[1] < rounds[0]


def test_constraints_and_promises_are_named():
    """A bead on a circle has no sum; a cosine well grows by promise only."""
    bead = em.find_equilibria(bead_on_a_circle(), {})
    assert standing(bead)["sum of indices"] == NOT
    energy = "x**2/2 + 3*cos(x) - a*x"
    parameter = em.Parameter("a", "1", 1.0, "load", 0.0)
    unknown = em.Unknown("x", 2.2788626602, guesses=(-4, 4))
    silent = em.EnergyStructure(energy, [unknown], [parameter])
    promised = em.EnergyStructure(energy, [unknown], [parameter], coercive=True)
    assert standing(em.find_equilibria(silent, {}))["sum of indices"] == NOT
    found = em.find_equilibria(promised, {})
    assert found.index.tolist() == [0, 0, 1]
    assert standing(found)["sum of indices"] == "holds if the promise does"
    assert promised.identity()["coercive"]


def test_what_lands_beyond_a_constraint_is_told():
    """x ≤ 1 cuts off the minimum x = 3: the saddle beside it leads there."""
    structure = close_sheets(0.1)
    x = structure.descriptor("x")
    found = em.find_equilibria(structure, AT, within=[x <= 1.0])
    assert len(found) == 3
    assert "1 landed beyond the constraints" in found.arguments[0].detail
    assert found.arguments[2].detail == "constraints cut states off"
