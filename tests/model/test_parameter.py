"""Parameters, limits of their rates, and obstacles: what they refuse and what they measure."""

import re

import numpy as np
import pytest

from equimorph.errors import InputError
from equimorph.model import Disc, HalfPlane, Parameter, Rates, Schedule, parameter_vector, position
from typecheck import unchecked

SPAN = Parameter("span", "L", 1.0, "actuator", 0.5, 0.0, 1.0)
LENGTH = Parameter("length", "L", 1.0, "fixed", None, 0.0)
LOAD = Parameter("q", "1", 1.0, "load", 0.0)


@pytest.mark.parametrize(
    ("parameter", "value", "said"),
    [
        (SPAN, 0.0, "`span` must be a finite number between 0 and 1 (both excluded); got 0.0."),
        (SPAN, 1.0, "`span` must be a finite number between 0 and 1 (both excluded); got 1.0."),
        (LENGTH, -1.0, "`length` must be a finite number greater than 0; got -1.0."),
        (LENGTH, np.inf, "`length` must be a finite number greater than 0; got inf."),
        (LOAD, np.nan, "`q` must be a finite number; got nan."),
        (LOAD, "much", "`q` must be a finite number; got 'much'."),
    ],
)
def test_values_without_a_meaning_are_refused(parameter, value, said):
    with unchecked(), pytest.raises(InputError, match=f"^{re.escape(said)}$"):
        parameter.check(value)


def test_values_come_before_the_base_and_this_before_defaults():
    base = np.array([0.25, 3.0, 1.0])
    parameters = (SPAN, LENGTH, LOAD)
    assert parameter_vector(parameters, {"length": 2.0}).tolist() == [0.5, 2.0, 0.0]
    assert parameter_vector(parameters, {"q": 2.0}, base).tolist() == [0.25, 3.0, 2.0]
    with pytest.raises(InputError, match=r"^`length` must be given; got no value\.$"):
        parameter_vector(parameters, {})
    with pytest.raises(InputError, match=r"span, length, q\); got 'Span'\. Did you mean span\?"):
        position(parameters, "Span")


def test_the_slowest_parameter_sets_the_time():
    """Rates of 0.5 and 2: steps of (1, 1) take 2; steps of (0, 3) take 1.5."""
    values = np.array([[0.0, 9.0, 0.0], [1.0, 5.0, 1.0], [1.0, 9.0, -2.0]])
    rates = Rates({"a": 0.5, "c": 2.0})
    assert rates.durations(("a", "b", "c"), values).tolist() == [2.0, 1.5]


@pytest.mark.parametrize("limit", [0.0, -1.0, np.inf, np.nan])
def test_rates_are_positive(limit):
    with pytest.raises(
        InputError, match=f"`limits` must be positive numbers by name, .*; got a = {limit!r}"
    ):
        Rates({"a": limit})


def test_rates_name_parameters():
    with pytest.raises(InputError, match=r"`limits` must name at least one parameter; got none\."):
        Rates({})
    with pytest.raises(InputError, match=r"`limits` must name parameters \(a, b\); got 'c'\."):
        Rates({"c": 1.0}).durations(("a", "b"), np.zeros((2, 2)))


def test_a_schedule_names_what_moves_however_little():
    values = np.array([[0.0, 2.0], [0.0, 2.0 + 1e-6]])
    steps = np.array([0.0, 1.0])
    schedule = Schedule(("a", "b"), ("load", "load"), ("", ""), values, steps, steps + 0.5, {}, {})
    assert repr(schedule) == "Schedule(b: 2 steps; margin 0.5)"
    assert Rates({"b": 1e-6}).times(schedule) == pytest.approx([0.0, 1.0], rel=1e-9)


def test_distances_from_a_half_plane_do_not_depend_on_the_length_of_its_normal():
    wall = HalfPlane((1.0, 0.0), (3.0, 4.0))
    assert wall.normal == (0.6, 0.8)
    places = np.array([[1.0, 0.0], [1.6, 0.8], [0.0, 0.0]])
    assert wall.distance(places) == pytest.approx([0.0, 1.0, -0.6], abs=1e-15)
    assert str(wall) == "half_plane(1, 0, 0.6, 0.8)"
    with pytest.raises(InputError, match=r"`normal` must be .*, not both 0; got"):
        HalfPlane((0.0, 0.0), (0.0, 0.0))


def test_a_disc_forbids_its_inside_and_a_room_its_outside():
    places = np.array([[3.0, 4.0], [0.0, 1.0]])
    assert Disc((0.0, 0.0), 2.0).distance(places) == pytest.approx([3.0, -1.0])
    assert Disc((0.0, 0.0), 2.0, inside=True).distance(places) == pytest.approx([-3.0, 1.0])
    assert str(Disc((0.0, 0.5), 2.0, inside=True)) == "room(0, 0.5, 2)"
    assert Disc((0.0, 0.0), 0.0).distance(places) == pytest.approx([5.0, 1.0])


@pytest.mark.parametrize("radius", [-0.5, np.inf, np.nan])
def test_a_radius_is_finite_and_not_negative(radius):
    with pytest.raises(InputError, match="`radius` must be a finite number >= 0; got"):
        Disc((0.0, 0.0), radius)


def test_a_text_for_a_number_is_answered_with_the_unit():
    """`units` of rods are for their constructors: values of parameters are plain numbers."""
    span = Parameter("nu", "m", 1.0, "fixed", lower=-0.4, upper=0.4)
    said = r"got '320 mm'\. Write a number in units of m\.$"
    with unchecked(), pytest.raises(InputError, match=said):
        span.check("320 mm")
