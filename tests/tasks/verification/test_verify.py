"""Schedules from routes, from files and by hand, and how they are refused."""

import re
from dataclasses import replace

import numpy as np
import pytest

import equimorph as em
from equimorph.errors import InputError
from equimorph.tasks.planning.planner import plan
from equimorph.tasks.verification.schedule_check import verify

VIA = [{"Theta": 1.3}, {"Delta": 1.3}, {"Theta": 1.0}, {"Delta": 0.0}]
OTHER_WAY = [{"Delta": 1.3}, {"Theta": 1.3}, {"Delta": 0.0}, {"Theta": 1.0}]


@pytest.fixture(scope="module")
def route(arch_set, ends):
    return plan(arch_set, *ends, via=VIA)


@pytest.fixture(scope="module")
def schedule(route):
    return route.schedule


def test_schedule_of_a_route_is_verified_with_its_margin(ends, route):
    schedule = route.schedule
    found = verify(schedule)
    assert found.verified
    assert found.margins.min() == pytest.approx(schedule.margins.min(), rel=1e-6)
    assert found.margin == pytest.approx(route.margin, rel=1e-9)
    np.testing.assert_allclose(found.states.z[-1], ends[1].z, rtol=0, atol=1e-9)
    assert found.schedule.start == schedule.start
    table = found.schedule
    np.testing.assert_allclose(table.values[table.way_points], schedule.values, rtol=0, atol=1e-12)


def test_schedule_read_from_files_is_verified(tmp_path, schedule):
    em.storage.write_schedule(schedule, tmp_path / "schedule.csv")
    found = verify(em.storage.read_schedule(tmp_path / "schedule.csv"))
    assert found.verified
    assert found.margin == pytest.approx(0.462, abs=5e-4)


def test_a_schedule_along_folds_is_refused_where_it_begins():
    """With no margin demanded the flattest spring stays on its folds."""
    spring = em.Spring()
    start = em.lift(spring.natural_state(x_l=0.8), {"F": 0.01}).end.state
    flattest = em.follow_optimum(start, spring.angle, {"F": 0.03}, actuators={"x_l": (0.6, 1.0)})
    done = verify(flattest.schedule)
    assert done.why == "the start lies on a fold or branch point, where stability is lost"
    assert done.margin == pytest.approx(0.0, abs=1e-3)


def test_start_written_with_few_digits_is_corrected(schedule):
    rough = {**schedule.start, "unknowns": [round(x, 4) for x in schedule.start["unknowns"]]}
    found = verify(replace(schedule, start=rough))
    assert found.verified
    assert found.states.residual.max() < 1e-9


def test_way_points_are_verified_from_any_state(ends):
    found = verify(VIA, ends[0])
    assert found.verified
    np.testing.assert_allclose(found.schedule.values[found.schedule.way_points[2], :2], [1.3, 1.3])


def test_first_violation_is_placed(ends):
    """The fold near |Δ| = 0.42 was computed independently."""
    found = verify(OTHER_WAY, ends[0])
    assert found.status == "refused"
    assert found.why == (
        "step 1 of 4 meets a fold: stability is lost and the structure would snap, "
        "at Delta = 0.418136"
    )
    assert found.violation.kind == "fold"
    assert found.at[-1] == pytest.approx(0.418136 / 1.3, abs=1e-6)
    assert found.schedule is None


def test_margin_and_constraints_are_watched(arch_set, ends):
    arch = arch_set.structure
    low = verify(VIA, ends[0], margin=0.5)
    assert low.why.startswith("the stability margin falls to 0.49")
    assert low.margins[-1] < 0.5 < low.margins[:-1].min()
    curved = verify(VIA, ends[0], within=[arch.max_curvature <= 15])
    assert "step 2 of 4 meets the constraint max_curvature <= 15" in curved.why
    assert arch.max_curvature(curved.states[-1]) == pytest.approx(15.0, abs=1e-6)


def test_start_that_breaks_the_demands_is_refused(arch_set, ends):
    arch = arch_set.structure
    assert verify(VIA, ends[0], margin=5.0).why.startswith("the start has a stability margin of")
    tight = verify(VIA, ends[0], within=[arch.max_curvature <= 1.0])
    assert tight.why.startswith("the start violates max_curvature <= 1")
    here = arch_set.at(Theta=1, Delta=0)
    saddle = here[int(np.flatnonzero(here.index == 2)[0])]
    assert verify(VIA, saddle).why == "the start is unstable (index 2)"


def test_long_steps_over_which_newton_would_change_branch_are_lifted(ends):
    """From the upright arch Newton alone lands on another equilibrium over the far corner."""
    far = verify([{"Theta": 2.2, "Delta": 0.3}, {"Theta": 0.9, "Delta": 0.0}], ends[0])
    path = em.lift(ends[0], [{"Theta": 2.2, "Delta": 0.3}, {"Theta": 0.9, "Delta": 0.0}])
    assert far.verified == path.arrived
    if path.arrived:
        np.testing.assert_allclose(far.states.z[-1], path.end.state.z, rtol=0, atol=1e-8)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            {"names": ("a", "b", "c", "d")},
            "`schedule` must give the parameters Theta, Delta, q, nu",
        ),
        (
            {"start": {"structure": None, "unknowns": []}},
            "`structure` must be given for a schedule",
        ),
    ],
)
def test_schedules_without_meaning_are_input_errors(schedule, change, message):
    with pytest.raises(InputError, match=f"^{re.escape(message)}"):
        verify(replace(schedule, **change))


def test_wrong_arguments_are_input_errors(ends, schedule):
    with pytest.raises(InputError, match=r"^`start` must be given with way-points; got none"):
        verify(VIA)
    with pytest.raises(InputError, match=r"^`margin` must be a number >= 0; got -1"):
        verify(schedule, margin=-1)
    with pytest.raises(InputError, match=r"^`start` must have the first parameters"):
        verify(schedule, em.lift(ends[0], {"Theta": 1.1}).end.state)
    with pytest.raises(InputError, match=r"^`schedule` must start with 55 unknowns"):
        verify(replace(schedule, start={**schedule.start, "unknowns": [1.0]}))
    moved = schedule.values + 0.3
    with pytest.raises(InputError, match=r"^`schedule` must start at an equilibrium"):
        verify(replace(schedule, values=moved))
    lost = np.concatenate([schedule.values[:1], np.full((len(moved) - 1, 4), np.nan)])
    with pytest.raises(InputError, match=r"^`values` must be an array of finite numbers"):
        verify(replace(schedule, values=lost))
    resting = replace(schedule, values=np.repeat(schedule.values[:1], len(moved), axis=0))
    with pytest.raises(InputError, match=r"^`schedule` must change at least one parameter"):
        verify(resting)
