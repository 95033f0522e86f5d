"""What a caller can do wrong with routes, and what the answer is."""

import re
from dataclasses import replace

import pytest

from equimorph.equilibria import lift
from equimorph.errors import InputError
from equimorph.structures import Rod
from equimorph.tasks.planning.planner import plan

BOX = "Box(Theta=(0.2, 2.5), Delta=(-2, 2))"


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (
            {"via": [{"Theta": 1.3}, {"Delta": 2.3}]},
            f"`via[1]` must lie in {BOX}; got {{'Delta': 2.3}}.",
        ),
        ({"via": [{"Theta": 0.1}]}, f"`via[0]` must lie in {BOX}; got {{'Theta': 0.1}}."),
        (
            {"via": [{"q": 2.0}]},
            "`via` must change free parameters (Theta, Delta); got 'q'.",
        ),
        (
            {"via": [{"height": 2.0}]},
            "`via` must change free parameters (Theta, Delta); got 'height'.",
        ),
        ({"margin": -0.1}, "`margin` must be a number >= 0; got -0.1."),
        ({"margin": float("nan")}, "`margin` must be a number >= 0; got nan."),
    ],
)
def test_wrong_options_are_refused_by_name(arch_set, ends, options, message):
    with pytest.raises(InputError, match=f"^{re.escape(message)}$"):
        plan(arch_set, *ends, **options)


@pytest.mark.parametrize("name", ["start", "goal"])
def test_state_that_is_no_equilibrium_is_refused(arch_set, ends, name):
    pushed = replace(ends[0], z=ends[0].z + 0.01)
    pair = (pushed, ends[1]) if name == "start" else (ends[0], pushed)
    with pytest.raises(InputError, match=f"^`{name}` must"):
        plan(arch_set, *pair)


def test_state_with_another_load_is_refused(arch_set, ends):
    rest = Rod().natural_state(Theta=1.0, Delta=0.0)
    with pytest.raises(InputError, match="`start` must have the fixed parameters of the set"):
        plan(arch_set, rest, ends[1])


def test_state_outside_the_box_is_refused(arch_set, ends):
    beyond = lift(ends[0], {"Theta": 2.6}).end.state
    with pytest.raises(InputError, match=re.escape(f"must lie in {BOX}")):
        plan(arch_set, beyond, ends[1])
