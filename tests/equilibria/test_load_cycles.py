"""Load cycles: hysteresis loops of wells whose folds are known."""

import numpy as np
import pytest

import equimorph as em
from equimorph.errors import InputError
from oracles.polynomial import Polynomial


def well() -> em.State:
    """E = x⁴/4 − x²/2 − b x; folds at b = ∓2/(3√3), x = ±1/√3."""
    tilted = Polynomial(lambda x, b: x**4 * 0.25 - x**2 * 0.5 - b * x, 1, ("b",))
    return tilted.state(-1.0)


def area(cycle: em.LoadCycle, name: str) -> float:
    """Work of a parameter, ∮ ∂L/∂p dp, by the trapezoidal rule over the recorded steps."""
    total = 0.0
    for path in cycle.paths:
        states = path.states
        total += np.trapezoid(em.effort_of(states.structure, name)(states), states[name])
    return total


def test_the_loop_of_a_double_well_loses_three_halves():
    """Each fold releases ¾. The first cycle begins in the left well and ends there again."""
    cycle = em.load_cycle(well(), [{"b": 1.0}, {"b": -1.0}, {"b": 0.0}])
    assert (cycle.status, cycle.cycles, len(cycle.snaps)) == ("closed", 1, 2)
    assert cycle.lost == pytest.approx(1.5, abs=1e-9)
    assert area(cycle, "b") == pytest.approx(1.5, rel=1e-2)  # of that rule
    assert "2 snaps release 1.5 in cycle 1" in repr(cycle)


def test_a_one_sided_cycle_snaps_once_and_then_no_more():
    """b from 0 to 1 and back: the structure stays in the right well from then on."""
    cycle = em.load_cycle(well(), [{"b": 1.0}, {"b": 0.0}])
    assert (cycle.status, cycle.cycles, cycle.snaps, cycle.lost) == ("closed", 2, (), 0.0)


def test_a_cycle_ends_where_no_state_stops_the_snap():
    cubic = Polynomial(lambda x, a: x**3 * (1 / 3) - a * x, 1, ("a",))
    cycle = em.load_cycle(cubic.state(1.0, a=1.0), [{"a": -1.0}, {"a": 1.0}])
    assert cycle.status == "ended"
    assert "escaped" in cycle.detail
    assert "escaped" in repr(cycle)


def test_a_cycle_ends_where_a_snap_may_land_at_either_of_two_states():
    """x = 0 is lost at b = 1 in a subcritical pitchfork; at ±√2 the structure is stable."""
    even = Polynomial(
        lambda x, b: x**6 * (1 / 6) - x**4 * 0.5 + x**2 * 0.5 - b * x**2 * 0.5, 1, ("b",)
    )
    cycle = em.load_cycle(even.state(0.0), [{"b": 1.5}, {"b": 0.0}])
    assert cycle.status == "ended"
    assert cycle.detail == "the snap from a branch point may land at either of two states"


def test_other_ways_are_refused():
    with pytest.raises(InputError, match="must have at least one corner; got none"):
        em.load_cycle(well(), [])
    with pytest.raises(InputError, match="`cycles` must be a whole number from 1 to"):
        em.load_cycle(well(), [{"b": 1.0}, {"b": 0.0}], cycles=0)
    with pytest.raises(InputError, match="must end at the parameters of `state`"):
        em.load_cycle(well(), [{"b": 1.0}])
    top = well().structure.state(0.0)
    with pytest.raises(InputError, match="must be stable"):
        em.load_cycle(top, [{"b": 1.0}, {"b": 0.0}])
