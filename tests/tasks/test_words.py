"""Words of rows: Preisach's rule, loading in small steps, sets, and refusals in a line."""

import numpy as np
import pytest

import equimorph as em
from equimorph.errors import InputError
from oracles import rows
from typecheck import unchecked

SPRING = em.Spring()
STIFFNESS = (1.0, 1.3, 1.6)
ROW = em.Row([f"{a}*(u*(u - 2))**2/4" for a in STIFFNESS])


@pytest.fixture(scope="module")
def graph():
    """Three units under a load that can reset the weakest alone."""
    return em.word_graph(ROW.rest().stable, {"F": (-0.45, 1.0)}, ROW.letters)


def test_independent_units_snap_at_their_own_thresholds(graph):
    """e' = a (v³ − v) with v = u − 1 has its extrema ±2a/(3√3)."""
    route = graph.route("000", "011")
    values = [each.value for each in route.moves if each.kind == "snap"]
    expected = [2 * a / 27**0.5 for a in STIFFNESS]
    assert values == pytest.approx([*expected, -expected[0]], abs=1e-9)
    assert route.words == ("000", "100", "110", "111", "011")
    assert route.snaps == 4


def test_work_and_energy_released_have_closed_forms(graph):
    """At the fold of the first unit (v² − 1)²/4 − F u falls from v = −1/√3 to 2/√3."""
    first = graph.words.index("000")
    move = next(e for e in graph.moves if e.start == first and e.kind == "snap")
    force, v = 2 / 27**0.5, np.array([-1.0, 2.0]) / 3**0.5
    energies = (v**2 - 1) ** 2 / 4 - force * (v + 1)
    assert move.released == pytest.approx(energies[0] - energies[1], abs=1e-9)
    start = ROW.rest().stable
    there = em.lift(start[[0]], {"F": force - 1e-12}).states
    drop = ROW.structure.energy(start.z[:1], start.p[:1]) - there.energy
    assert move.work == pytest.approx(float(drop[0]), abs=1e-6)


def test_what_strokes_cannot_reach_is_told_from_what_is_not_known(graph):
    assert graph.route("000", "001").status == "unreachable"
    assert "000, 010, 011, 100, 110, 111" in graph.route("000", "001").why
    assert graph.route("000", "100", snaps=False).status == "unreachable"
    alone = em.word_graph(ROW.rest().stable[[0]], {"F": (-0.45, 1.0)}, ROW.letters)
    assert alone.route(alone.words[0], "001").status == "not found"


def test_equal_units_may_snap_in_any_order():
    """Two units reach their folds together: nobody knows which of them snaps."""
    twins = em.Row(["(u*(u - 2))**2/4"] * 2)
    graph = em.word_graph(twins.rest().stable, {"F": (-1.0, 1.0)}, twins.letters)
    assert graph.route("00", "10").status == "not found"
    assert "ends undecided" in graph.route("00", "10").why


@pytest.mark.slow
def test_random_rows_agree_with_loading_in_small_steps():
    """Rows under a load, half of them also between walls of finite stiffness that move."""
    rng = np.random.default_rng(7)
    kinds = {n: rows.structure(n) for n in (3, 4, 5)}
    with unchecked():
        for _ in range(40):
            n = int(rng.integers(3, 6))
            ours, undecided, brute = rows.compare(kinds[n], n, rng)
            assert ours == brute
            assert not any(undecided.values())


@pytest.mark.slow
def test_a_unit_does_not_snap_over_a_low_barrier_of_another():
    """Row 554 of benchmarks/rows.py: where the first unit snaps, the last one nearly does."""
    with unchecked():
        ours, undecided, brute = rows.compare(rows.structure(5), 5, _row(554))
    assert ours == brute
    assert not any(undecided.values())


def _row(number):
    """Random numbers of a row, after that of its units is drawn."""
    rng = np.random.default_rng([0, number])
    rng.integers(3, 6)
    return rng


@pytest.mark.slow
def test_eight_units_have_6561_equilibria_and_follow_the_rule_of_preisach():
    """The weakest unit that can snaps first, both ways [Preisach1935]."""
    units = [f"{1 + 0.13 * k}*(u*(u - 2))**2/4" for k in range(8)]
    row = em.Row(units)
    rest = row.rest()
    assert len(rest) == 3**8
    assert (rest.index == 0).sum() == 2**8
    graph = em.word_graph(rest.stable, {"F": (-3.0, 3.0)}, row.letters)
    reached = graph.reached("0" * 8)
    assert set(reached.values()) <= {"reached", "unreachable"}
    assert {word for word, status in reached.items() if status == "reached"} == _preisach(8)


def _preisach(count):
    """Words that setting, or resetting, the weakest unit leads to, again and again."""
    found, todo = set(), ["0" * count]
    while todo:
        word = todo.pop()
        if word not in found:
            found.add(word)
            for old, new in ("01", "10"):
                if old in word:
                    todo.append(word.replace(old, new, 1))
    return found


def test_both_sides_of_the_spring_are_one_stratum(spring_set):
    """Around the cusp without a snap; a load alone has to snap."""
    letter = [SPRING.angle >= 0]
    with unchecked():
        together = em.word_graph_over(spring_set, {"x_l": 0.8, "F": 0.0}, letter)
        alone = em.word_graph(spring_set.at(x_l=0.8, F=0.0).stable, {"F": (-0.2, 0.2)}, letter)
    assert together.route("0", "1", snaps=False).status == "reached"
    assert alone.route("0", "1", snaps=False).status == "unreachable"
    assert alone.route("0", "1").snaps == 1


def test_wrong_questions_are_refused_in_a_line(graph, spring_set):
    start, side = ROW.rest(), [SPRING.angle >= 0]
    for wrong, said in (
        (lambda: em.Row([]), "at least one unit"),
        (lambda: em.Row(["u**2"]).wells, "two stable equilibria and one between"),
        (lambda: em.word_graph(start, {"F": (-1, 1)}, ROW.letters), "must be stable"),
        (lambda: em.word_graph(start.stable, {"F": (0.1, 1)}, ROW.letters), "F = 0 between"),
        (lambda: em.word_graph(start.stable, {}, ROW.letters), "at least one parameter"),
        (lambda: em.word_graph(start.stable, {"F": (-1, 1)}, []), "for each unit"),
        (lambda: graph.route("00", "111"), "one state at rest"),
        (lambda: graph.route("000", "11"), "3 letters 0 or 1"),
        (lambda: em.word_graph_over(spring_set, {"x_l": 2.0, "F": 0.0}, side), "must lie"),
    ):
        with unchecked(), pytest.raises(InputError, match=said) as told:
            wrong()
        assert "\n" not in str(told.value)
