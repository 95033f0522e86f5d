"""Descriptors and constraints are equal by what they mean, not by when they were made."""

import numpy as np
import pytest
from hypothesis import given, strategies as st

from equimorph.errors import InputError, suggestion
from equimorph.model import Descriptor, ease
from equimorph.structures import Rod, Spring, from_identity
from typecheck import unchecked

ARCH = Rod()
WRITTEN = [
    "max_curvature",
    "energy",
    "height(1/3)",
    "x(0.25)",
    "angle(2/7)",
    "curvature(0.123456789)",
    "support_force(mu)",
    "end_moment(1)",
]


@pytest.mark.parametrize("text", WRITTEN)
def test_a_descriptor_equals_another_one_written_alike(text: str):
    again = from_identity(ARCH.identity())
    first, second = ARCH.descriptor(text), again.descriptor(text)
    assert first == second
    assert hash(first) == hash(second)
    assert len({first <= 20, second <= 20.0, first <= 21, first >= 20}) == 3


def test_attributes_and_texts_name_the_same_descriptors():
    spring = Spring()
    assert ARCH.max_curvature == ARCH.descriptor("max_curvature")
    assert ARCH.height(1 / 3) == ARCH.descriptor("height(1/3)")
    assert ARCH.total_energy == ARCH.descriptor("energy")
    assert spring.height == Spring().descriptor(" height ")
    assert spring.descriptor("energy") == spring.descriptor("energy")


def test_descriptors_of_different_structures_differ():
    assert Rod(load="left-half").max_curvature != ARCH.max_curvature
    assert Spring(stiffness=2.0).angle != Spring().angle
    assert ARCH.height(0.5) != ARCH.height(0.25)


def test_a_rod_with_a_callable_load_knows_its_own_descriptors_only():
    """A callable cannot be written down: the object itself stands for it."""
    one, other = Rod(load=np.cos), Rod(load=np.cos)
    assert one.descriptor("max_curvature") == one.max_curvature
    assert one.max_curvature != other.max_curvature


def test_own_descriptors_are_equal_when_their_functions_are():
    def first(z: np.ndarray, p: np.ndarray) -> np.ndarray:
        return z[:, 0]

    assert Descriptor("u", "1", first) == Descriptor("u", "1", first)
    assert Descriptor("u", "1", first) != Descriptor("u", "1", lambda z, _: z[:, 1])


@given(s=st.one_of(st.floats(0.0, 1.0), st.fractions(0, 1, max_denominator=12).map(float)))
def test_the_name_of_a_place_leads_back_to_the_place(s: float):
    """A constraint is stored by name: a rounded place would come back as another constraint."""
    name = ARCH.angle(s).name
    assert ARCH.descriptor(name) == ARCH.angle(s)
    place = name.removeprefix("angle(").removesuffix(")").split("/")
    assert float(place[0]) / float(place[-1] if len(place) > 1 else 1) == s


def test_places_that_people_write_keep_their_names():
    assert ARCH.height(1 / 3).name == "height(1/3)"
    assert ARCH.height(0.5).name == "height(0.5)"
    assert ARCH.height(5 / 6).name == "height(5/6)"


def test_a_constraint_holds_on_its_bound_and_by_its_ease_beyond():
    states = Spring().natural_state(x_l=0.5).batch
    force = Descriptor("force", "1", lambda z, p: p[:, 1] + 2.0)
    for constraint in (force <= 2.0, force >= 2.0):
        assert constraint.holds(states).all()
        assert ease(constraint).excess(states.z, states.p) == pytest.approx(-2e-9, rel=1e-6)
    assert not (force <= 1.9).holds(states).any()
    assert not (force >= 2.1).holds(states).any()


def test_the_ease_of_a_constraint_is_relative_to_bounds_above_one():
    force = Spring().height
    assert [ease(force <= bound).ease for bound in (-50.0, 0.0, 0.5, 3.0)] == [
        pytest.approx(each) for each in (5e-8, 1e-9, 1e-9, 3e-9)
    ]


@pytest.mark.parametrize("bound", [np.nan, np.inf, "wide", None])
def test_a_bound_is_a_finite_number(bound):
    with (
        unchecked(),
        pytest.raises(InputError, match="`height` must be compared with a finite number; got"),
    ):
        Spring().height <= bound  # noqa: B015


@pytest.mark.parametrize(
    ("written", "meant"), [("BOX", "box"), ("theta", "Theta"), ("intervalls", "intervals")]
)
def test_suggestions_overlook_capitals(written: str, meant: str):
    assert suggestion(written, ["box", "Theta", "intervals"]) == f" Did you mean {meant}?"
    assert suggestion("x_l", ["box", "Theta", "intervals"]) == ""
