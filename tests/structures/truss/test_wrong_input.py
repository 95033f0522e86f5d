"""What may be wrong with a truss, and the line that says so."""

import pytest

from equimorph.errors import InputError
from equimorph.structures import Bar, Truss
from typecheck import unchecked

JOINTS = {"A": (-1, 0), "B": (0, 0.1), "C": (1, 0)}
BARS = [("A", "B"), ("B", "C")]
HELD = {"A": "xy", "C": "xy"}
LOADS = {"F": {"B": (0, -1)}}
NAN = float("nan")


def made(joints=JOINTS, bars=BARS, supports=HELD, loads=LOADS, **more):
    return Truss(joints, bars, supports, loads, **more)


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        # mechanisms
        ({"supports": {"A": "x", "C": "xy"}}, "`truss` must not be a mechanism; joint A can move"),
        ({"supports": {}}, "without force. Add a bar or a support"),
        ({"joints": {**JOINTS, "B": (0, 0)}}, "not be a mechanism; joint B can move along (0, 1)"),
        (
            {"joints": {**JOINTS, "D": (0, 1)}, "bars": [*BARS, ("B", "D")]},
            "not be a mechanism; joint D can move along (1, 0) without force",
        ),
        # joints
        ({"joints": {**JOINTS, "D": (0, 1)}}, "`bars` must reach every joint; got none at D"),
        (
            {"joints": {**JOINTS, "D": (0, 1), "E": (0, 2)}, "bars": [*BARS, ("D", "E")]},
            "`bars` must join all joints; got D, E apart from A. Join them, or make two trusses",
        ),
        ({"joints": {"A": (0, 0)}}, "`joints` must be at least two; got 1"),
        ({"joints": {**JOINTS, "B": (0, 0, 1)}}, "`joints.B` must be 2 finite numbers; got [0, 0"),
        ({"joints": {**JOINTS, "B": (0, NAN)}}, "`joints` must be places of finite numbers"),
        ({"joints": {**JOINTS, "B": (-1, 0)}}, "`joints` of bar A-B must lie apart"),
        ({"joints": {**JOINTS, "B-1": (2, 0)}}, "letters, digits and underscores; got 'B-1'"),
        # bars
        ({"bars": [*BARS, ("A", "D")]}, "`ends` of bar A-D must be joints (A, B, C); got D"),
        ({"bars": [*BARS, ("C", "B")]}, "must join each pair of joints once; got C-B again"),
        ({"bars": [*BARS, ("B", "B")]}, "different joints, or data of bars; got ('B', 'B')"),
        ({"bars": ["AB", "BC"]}, "pairs of different joints, or data of bars; got 'AB'"),
        ({"bars": [{"ends": ("A", "B"), "E": 1}]}, "Bars (ends, EA, EI, rest, mass)"),
        # supports
        ({"supports": {**HELD, "D": "x"}}, "`supports` must be at joints (A, B, C); got D"),
        ({"supports": {**HELD, "B": "xy"}}, "`supports` must leave a joint free to move; got all"),
        ({"bars": [*BARS, ("A", "C")]}, "got bar A-C with both held"),
        ({"supports": {**HELD, "B": "xx"}}, "must hold axes among xy, each once; got 'xx'"),
        ({"supports": {**HELD, "B": "z"}}, "must hold axes among xy, each once; got 'z'"),
        ({"supports": {**HELD, "B": ""}}, "must hold axes among xy, each once; got ''"),
        # loads and actuators
        ({"loads": {"F": {"D": (0, 1)}}}, "`joint` must be one of A, B, C; got 'D'"),
        ({"loads": {"F": {"A": (0, 1)}}}, "`loads.F` must act on a joint that is free to move"),
        ({"loads": {"F": {"B": (0, 1, 0)}}}, "`loads.F on B` must be 2 finite numbers"),
        ({"loads": {"F 1": {"B": (0, 1)}}}, "must have different names of letters"),
        ({"loads": None}, "`loads` or `actuators` must name a parameter; got none"),
        ({"actuators": {"F": {"A-B": 1.0}}}, "must have different names of letters"),
        ({"actuators": {"a": {"A-C": 1.0}}}, "`bar` must be one of A-B, B-C; got 'A-C'"),
        ({"actuators": {"a": {"A-B": 0.0}}}, "`actuators.a` must give rates by bar, not 0"),
        ({"actuators": {"a": {}}}, "rates by bar, not 0; got {}"),
        ({"bars": [BARS[0], Bar(BARS[1], rest=40.0)]}, "`rest` lengths must allow a stable eq"),
    ],
)  # fmt: skip
def test_a_wrong_truss_is_refused_by_name(arguments, text):
    with unchecked(), pytest.raises(InputError) as caught:
        made(**arguments)
    assert text in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("value", [0.0, -1.0, NAN, float("inf")])
@pytest.mark.parametrize("name", ["EA", "EI", "rest"])
def test_stiffness_and_length_are_positive(name, value):
    with unchecked(), pytest.raises(InputError, match=f"^`{name}` must be positive and finite"):
        Bar(("A", "B"), **{name: value})


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("forces(A-B)", r"`descriptor` must be one of force\(bar\), .*; got 'forces\(A-B\)'"),
        ("force", "`descriptor` must be one of"),
        ("force(A-C)", "`bar` must be one of A-B, B-C; got 'A-C'"),
        ("utilisation(A-B)", r"`utilisation\(A-B\)` must be of a bar with EI; got one without"),
        (
            "max_utilisation",
            "`max_utilisation` must be of a truss with EI; got no bar that has one",
        ),
        ("displacement(D, x)", "`joint` must be one of A, B, C; got 'D'"),
        ("displacement(B, z)", "`axis` must be one of x, y; got 'z'"),
        ("displacement(A, x)", "`A.x` must be free to move; it is held by a support"),
        ("reaction(B, y)", "`B.y` must be held by a support; it is free"),
        ("reaction(A, z)", "`axis` must be one of x, y; got 'z'"),
        ("travel(G)", "`G` must be a parameter"),
    ],
)
def test_a_wrong_descriptor_is_refused(text, line):
    with unchecked(), pytest.raises(InputError, match=line):
        made().descriptor(text)
