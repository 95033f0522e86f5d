"""What may be wrong with a frame, and the line that says so."""

import pytest

import equimorph as em
from equimorph.errors import InputError
from equimorph.structures import Frame, Member
from typecheck import unchecked

JOINTS = {"A": (0, 0), "B": (0, 1), "C": (1, 1)}
MEMBERS = [("A", "B"), ("B", "C")]
HELD = {"A": "pinned", "C": "pinned"}
LOADS = {"P": {"B": (0, -1)}}
NAN = float("nan")
HINGED = [("A", "B"), Member(("B", "C"), hinges=["B"])]


def made(joints=JOINTS, members=MEMBERS, supports=HELD, loads=LOADS, actuators=None, **more):
    return Frame(joints, members, supports, loads, actuators, **more)


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        # mechanisms, and members held twice
        ({"supports": {"A": "y"}}, "`frame` must not be a mechanism; nothing holds it in x"),
        ({"supports": {"A": "x"}}, "`frame` must not be a mechanism; nothing holds it in y"),
        ({"supports": {"A": "pinned"}}, "a mechanism; joint B can move along (1, 0) without"),
        (
            {"supports": {"A": "pinned", "C": "y"}, "members": HINGED},
            "a mechanism; joint B can move along (1, 0) without force. Add a member or a support",
        ),
        (
            {"joints": {"A": (0, 0), "B": (1, 0), "C": (2, 0)}},
            "`supports` must not stretch or squeeze inextensible members; got A-B, B-C held",
        ),
        # joints
        ({"joints": {**JOINTS, "D": (0, 2)}}, "`members` must reach every joint; got none at D"),
        (
            {"joints": {**JOINTS, "D": (2, 1), "E": (2, 2)}, "members": [*MEMBERS, ("D", "E")]},
            "`members` must join all joints; got D, E apart from A. Join them, or make two frames",
        ),
        ({"joints": {"A": (0, 0)}}, "`joints` must be at least two; got 1"),
        ({"joints": {**JOINTS, "B": (0, 0, 1)}}, "`joints.B` must be 2 finite numbers; got [0, 0"),
        ({"joints": {**JOINTS, "B": (0, NAN)}}, "`joints` must be places of finite numbers"),
        ({"joints": {**JOINTS, "B": (0, 0)}}, "`joints` of member A-B must lie apart"),
        ({"joints": {**JOINTS, "B-1": (2, 0)}}, "other than weight, pressure; got 'B-1'"),
        ({"joints": {**JOINTS, "weight": (2, 0)}}, "other than weight, pressure; got 'weight'"),
        # members
        ({"members": []}, "`members` must be one at least; got none"),
        ({"members": [*MEMBERS, ("A", "D")]}, "`ends` of member A-D must be joints (A, B, C)"),
        ({"members": [*MEMBERS, ("C", "B")]}, "join each pair of joints once; got C-B again"),
        ({"members": [*MEMBERS, ("B", "B")]}, "joints, or data of members; got ('B', 'B')"),
        ({"members": ["AB", "BC"]}, "pairs of different joints, or data of members; got 'AB'"),
        ({"members": [{"ends": ("A", "B"), "E": 1}]}, "`members` must hold Members (ends, EI, EA"),
        (
            {"members": [*MEMBERS[:1], Member(("B", "C"), curvature=2.5)]},
            "`curvature` of member B-C must be less than 2 over the distance of its joints, 2,",
        ),
        (
            {"members": [*MEMBERS[:1], Member(("B", "C"), 1e6, 2.0)]},
            "`EI` and `EA` of member B-C must be those of a slender rod in one system of units",
        ),
        # supports
        ({"supports": {**HELD, "D": "x"}}, "`supports` must be at joints (A, B, C); got D"),
        ({"supports": {**HELD, "B": "xx"}}, "`supports.B` must be fixed, pinned, axes to hold"),
        ({"supports": {**HELD, "B": {"z": 1.0}}}, "must be supports by joint: fixed, pinned"),
        ({"supports": {**HELD, "B": ""}}, "`supports.B` must be fixed, pinned"),
        ({"supports": {**HELD, "B": {"x": -1.0}}}, "to 'held' or a positive stiffness; got B.x = "),
        ({"supports": {**HELD, "B": {"x": 0.0}}}, "to 'held' or a positive stiffness; got B.x = "),
        (
            {
                "members": [MEMBERS[0], Member(("B", "C"), hinges=["C"])],
                "supports": {**HELD, "C": "fixed"},
            },
            "`supports.C` must not hold an angle where every member is hinged",
        ),
        # loads and actuators
        ({"loads": {"P": {"D": (0, 1)}}}, "`joint` must be one of A, B, C; got 'D'"),
        ({"loads": {"P": {"A-C": (0, 1)}}}, "`member` must be one of A-B, B-C; got 'A-C'"),
        ({"loads": {"P": {"A": (0, 1)}}}, "`loads.P` must act on a member, or on a joint"),
        ({"loads": {"p": {"A-B": em.Pressure()}}}, "or the joints of a chain under 'pressure'"),
        ({"loads": {"P": {}}}, "`loads.P` must act on a member, or on a joint"),
        ({"loads": {"p": {"B": ("A", "C")}}}, "`loads.p.B` must be finite numbers; got ('A', 'C')"),
        ({"loads": {"p": {"pressure": ["A"]}}}, "`loads.p.pressure` must be joints of a chain in"),
        (
            {"loads": {"p": {"pressure": ["A", "B", "A", "B"]}}},
            "must be joints of a chain in their order, each once unless it closes; got ['A', 'B'",
        ),
        ({"loads": {"p": {"pressure": ["A", "C"]}}}, "`member` must be one of A-B, B-C; got 'A-C'"),
        (
            {"loads": {"p": {"pressure": ["A", "B"]}}},
            "`loads.p.pressure` must close, or end where supports leave one direction at most; got "
            "B, which moves in x and y: pressure is a follower load there, without a potential.",
        ),
        (
            {
                "members": [MEMBERS[0], Member(("B", "C"), EA=50.0)],
                "loads": {"p": {"pressure": ["A", "B", "C"]}},
            },
            "`loads.p.pressure` must act on inextensible members; got B-C, which has EA: pressure",
        ),
        (
            {
                "members": [*MEMBERS, Member(("A", "C"), EA=50.0)],
                "supports": {"A": "y", "C": "y", "B": "x"},
                "loads": {"p": {"pressure": ["A", "B", "C"]}},
            },
            "`loads.p.pressure` must not end at two joints that both move along x; got A and C.",
        ),
        (
            {
                "loads": {"p": {"pressure": ["A", "B", "C"]}},
                "actuators": {"a": {"length": {"B-C": 1.0}}},
            },
            "`actuators` must not change the length of members under pressure; got B-C",
        ),
        ({"loads": {"P": {"B": (0,)}}}, "`loads.P.B` must be 2 or 3 finite numbers; got (0,)"),
        ({"loads": {"P": {"weight": (0, -1)}}}, "`loads.P.weight` must act on members with a wei"),
        ({"loads": {"P 1": {"B": (0, 1)}}}, "must have different names of letters"),
        ({"loads": None}, "`loads` or `actuators` must name a parameter; got none"),
        ({"actuators": {"P": {"turn": {"A": 1.0}}}}, "must have different names of letters"),
        ({"actuators": {"a": {}}}, "`actuators.a` must have an effect (curvature, length, move"),
        ({"actuators": {"a": {"bend": {}}}}, "of finite numbers (curvature, length, move, turn)"),
        ({"actuators": {"a": {"curvature": {}}}}, "`actuators.a.curvature` must say where it acts"),
        ({"actuators": {"a": {"curvature": {"A-C": 1.0}}}}, "`member` must be one of A-B, B-C"),
        ({"actuators": {"a": {"length": {"A-B": 0.0}}}}, "`actuators.a.length.A-B` must be a fin"),
        ({"actuators": {"a": {"turn": {"A": 1.0}}}}, "`A.angle` must be held or sprung by a supp"),
        ({"actuators": {"a": {"move": {"B": (1, 0)}}}}, "`B.x` must be held or sprung by a supp"),
        ({"actuators": {"a": {"move": {"A": (0, 0)}}}}, "`actuators.a.move.A` must not be zero"),
        # resolution
        ({"elements": 0}, "`elements` must be a whole number from 1 to 1000; got 0"),
        ({"degree": 2}, "`degree` must be a whole number from 3 to 16; got 2"),
    ],
)  # fmt: skip
def test_a_wrong_frame_is_refused_by_name(arguments, text):
    with unchecked(), pytest.raises(InputError) as caught:
        made(**arguments)
    assert text in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("value", [0.0, -1.0, NAN, float("inf")])
@pytest.mark.parametrize("name", ["EI", "EA", "weight"])
def test_stiffness_and_weight_are_positive(name, value):
    with unchecked(), pytest.raises(InputError, match=f"^`{name}` must be positive and finite"):
        Member(("A", "B"), **{name: value})


@pytest.mark.parametrize(
    ("data", "text"),
    [
        ({"hinges": "A"}, "`hinges` must be a list of names; got 'A'"),
        ({"hinges": ["C"]}, "`hinges` of member A-B must name one or both of its ends"),
        ({"hinges": ["A", "A"]}, "`hinges` of member A-B must name one or both of its ends"),
        ({"curvature": NAN}, "`curvature` must be a finite number"),
    ],
)
def test_a_wrong_member_is_refused(data, text):
    with unchecked(), pytest.raises(InputError) as caught:
        Member(("A", "B"), **data)
    assert text in str(caught.value)


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("forces(A-B)", r"`descriptor` must be one of displacement\(joint,axis\), .*forces\(A-B\)"),
        ("moment(A-B)", "`descriptor` must be one of"),
        ("moment(A-C,A)", "`member` must be one of A-B, B-C; got 'A-C'"),
        ("moment(A-B,C)", "`joint` must be an end of member A-B; got 'C'"),
        ("displacement(D, x)", "`joint` must be one of A, B, C; got 'D'"),
        ("displacement(B, z)", "`axis` must be one of x, y; got 'z'"),
        ("reaction(B, x)", "`B.x` must be held or sprung by a support; it is free"),
        ("reaction(A, z)", "`axis` must be one of x, y, angle; got 'z'"),
        ("rotation(C)", r"`rotation\(C\)` must be of a joint where a member is not hinged"),
        ("travel(G)", "`G` must be a parameter"),
    ],
)
def test_a_wrong_descriptor_is_refused(text, line):
    frame = made(members=[MEMBERS[0], Member(("B", "C"), hinges=["C"])])
    with unchecked(), pytest.raises(InputError, match=line):
        frame.descriptor(text)
