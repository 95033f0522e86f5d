"""Results show themselves in one line, without their arrays."""

import pytest

import equimorph as em

SPRING = em.Spring()


@pytest.fixture(scope="module")
def limit():
    return em.limit_load(SPRING.natural_state(x_l=0.8), "F")


def test_a_limit_load_tells_kind_and_value(limit):
    assert repr(limit).startswith("LimitLoad(fold at 0.05139077832: State(spring: x_l=0.8, ")


def test_found_states_tell_how_many_and_how_complete():
    found = em.find_equilibria(SPRING, {"x_l": 0.8, "F": 0.0}, starts=20)
    assert repr(found).startswith("FoundStates(spring: 3, 2 of them stable; 3 found (in ")


def test_a_critical_curve_tells_its_special_points_and_ends(limit):
    box = em.Box(x_l=(0.5, 1.2), F=(-0.5, 0.5))
    curve = em.fold_curve(limit.state, ("x_l", "F"), box=box)
    points = len(curve.states)
    assert repr(curve) == (
        f"CriticalCurve(fold over x_l, F: {points} states, 1 branch point, 1 cusp, box to box)"
    )


def test_a_sensitivity_tells_of_what_by_what(limit):
    found = em.sensitivity(SPRING.natural_state(x_l=0.8), names=["F"])
    assert repr(found) == "Sensitivity(of z by F)"
