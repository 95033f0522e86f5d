"""At F = 0 and x_l = 0.8 the spring rests at cos δ = 0.8 (stable) and at δ = 0 (unstable)."""

from pathlib import Path

import numpy as np
import pytest

from equimorph.errors import InputError
from equimorph.manifold import EquilibriumSet
from equimorph.structures import State
from equimorph.study import Outcome
from equimorph.study.lookup import Ground
from equimorph.study.states import StateSection, choose_state

AT = {"x_l": 0.8, "F": 0.0}
REST = float(np.arccos(0.8))


def _choose(eset: EquilibriumSet, section: StateSection, key: str) -> State:
    return choose_state(Ground(eset.structure, None, eset), section, key)


@pytest.fixture
def eset(finished: tuple[Outcome, Path]) -> EquilibriumSet:
    return finished[0].equilibrium_set


@pytest.mark.parametrize(
    ("choice", "angle"),
    [
        ({"highest": "angle"}, REST),
        ({"lowest": "angle"}, -REST),
        ({"near": {"angle": -0.6435}}, -REST),
    ],
)
def test_a_choice_picks_the_exact_state(
    choice: dict[str, object], angle: float, eset: EquilibriumSet
):
    """Closed form. Tolerance: round-off of a polished state."""
    state = _choose(eset, StateSection(at=AT, **choice), "route[0].start")
    assert state.z[0] == pytest.approx(angle, abs=1e-12)


def test_a_single_stable_state_needs_no_choice(eset: EquilibriumSet):
    """For x_l > 1 every state is stable, PHYSICS section 2."""
    state = _choose(eset, StateSection(at={"x_l": 1.2, "F": 0.0}), "route[0].start")
    assert state.z[0] == pytest.approx(0.0, abs=1e-12)


def test_an_open_choice_is_refused(eset: EquilibriumSet):
    with pytest.raises(InputError, match=r"`route\[0\]\.goal` must choose .*got 2 stable"):
        _choose(eset, StateSection(at=AT), "route[0].goal")


def test_a_state_that_is_no_equilibrium_is_refused_with_those_there_are(eset: EquilibriumSet):
    with pytest.raises(InputError, match=r"`route\[0\]\.start\.near` .*have -0\.6435, 0\.6435"):
        _choose(eset, StateSection(at=AT, near={"angle": 0.62}), "route[0].start")


def test_an_unstable_state_is_refused(eset: EquilibriumSet):
    with pytest.raises(InputError, match=r"stable equilibrium; got angle = 0, which has index 1"):
        _choose(eset, StateSection(at=AT, near={"angle": 0.0}), "route[0].start")
