"""Events that neither the index nor the direction of a step betrays."""

import numpy as np
import pytest
from hypothesis import Phase, example, given, settings
from hypothesis import strategies as st

import equimorph as em
from oracles.polynomial import Polynomial, slaved
from typecheck import unchecked

PHASES = (Phase.explicit, Phase.generate)  # to shrink takes minutes
QUICK = settings(max_examples=5, deadline=None, derandomize=True, phases=PHASES)

factors = st.floats(0.2, 5.0)
stiff = st.floats(0.5, 4.0)
slopes = st.floats(-1.0, 1.0)
places = st.floats(-0.6, 0.6)


@pytest.fixture(scope="module", autouse=True)
def _fast():
    with unchecked():
        yield


def dipping(depth, centre, c=1.0):
    """x³ + ((a − centre)² − depth) x = 0: on x = 0 the eigenvalue dips by `depth` below zero."""
    return Polynomial(
        lambda x, a: c * (x**4 * 0.25 + ((a - centre) ** 2 - depth) * x**2 * 0.5), 1, ("a",)
    )


@QUICK
@example(power=-6.0, centre=0.0, c=1.0, k=1.0, m=0.5)
@given(power=st.floats(-6.0, -1.0), centre=places, c=factors, k=stiff, m=slopes)
def test_two_branch_points_in_one_step_are_separated(power, centre, c, k, m):
    """At a = centre ± √depth the eigenvalue crosses zero: steps are 0.5 long."""
    depth = 10.0**power
    form = slaved(dipping(depth, centre, c), k, m)
    start = form.state(0.0, 0.0, a=-1.0)
    path = em.lift(start, {"a": 1.0}, through_folds=True)
    assert [event.kind for event in path.events] == ["branch point", "branch point", "arrived"]
    places = [event.state["a"] for event in path.events[:2]]
    assert places == pytest.approx([centre - np.sqrt(depth), centre + np.sqrt(depth)], abs=1e-10)
    end = em.lift(start, {"a": 1.0}).end
    assert (end.kind, end.criticality) == ("branch point", "supercritical")
    assert end.state["a"] == pytest.approx(centre - np.sqrt(depth), abs=1e-10)


@QUICK
@given(centre=places, c=factors, k=stiff, m=slopes)
def test_eigenvalue_that_touches_zero_is_a_degenerate_branch_point(centre, c, k, m):
    """depth = 0: the index is zero on both sides."""
    form = slaved(dipping(0.0, centre, c), k, m)
    path = em.lift(form.state(0.0, 0.0, a=-1.0), {"a": 1.0}, through_folds=True)
    assert [event.kind for event in path.events] == ["branch point", "arrived"]
    assert path.events[0].state["a"] == pytest.approx(centre, abs=1e-10)
    assert (path.index == 0).all()
    end = em.lift(form.state(0.0, 0.0, a=-1.0), {"a": 1.0}).end
    assert end.kind == "branch point"
    assert end.state["a"] == pytest.approx(centre, abs=1e-10)


@QUICK
@given(power=st.floats(-6.0, -1.0), centre=places)
def test_eigenvalue_that_stays_above_zero_is_no_event(power, centre):
    form = dipping(-(10.0**power), centre)
    path = em.lift(form.state(0.0, a=-1.0), {"a": 1.0})
    assert path.arrived
    assert len(path.events) == 1


@QUICK
@given(c=factors, k=stiff, m=slopes)
def test_hysteresis_point_is_a_fold_in_which_the_path_does_not_turn(c, k, m):
    """x³ = a: a cusp met in its own direction.

    Tolerance of x: points between steps are corrected to 1e-11, relative to steps of 1e-2.
    """
    form = slaved(Polynomial(lambda x, a: c * (x**4 * 0.25 - a * x), 1, ("a",)), k, m)
    path = em.lift(form.state(-1.0, m, a=-1.0), {"a": 1.0}, through_folds=True)
    assert [event.kind for event in path.events] == ["fold", "arrived"]
    assert path.events[0].state["a"] == pytest.approx(0.0, abs=1e-10)
    assert path.events[0].state.z == pytest.approx([0.0, 0.0], abs=1e-9)
    end = em.lift(form.state(-1.0, m, a=-1.0), {"a": 1.0}).end
    assert (end.kind, end.detail) == ("fold", "the path touches a fold and goes on")


def test_paths_of_the_arch_hide_nothing():
    """Regular events are met once: no probe reports them again."""
    arch = em.Rod()
    path = em.lift(arch.natural_state(Theta=0.9, Delta=0.02), {"q": 8.0}, through_folds=True)
    assert [event.kind for event in path.events] == ["fold", "fold", "arrived"]
