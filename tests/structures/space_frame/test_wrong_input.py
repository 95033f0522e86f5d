"""What is no frame in space is refused in a line that says what, where and what to do."""

import pytest

import equimorph as em
from equimorph.errors import InputError

JOINTS = {"A": (0, 0, 0), "B": (1, 0, 0), "C": (1, 1, 0)}
LOAD = {"P": {"B": (0, 0, -1)}}
FIXED = {"A": "fixed"}
BOTH = [("A", "B"), ("B", "C")]


def frame(joints=JOINTS, members=BOTH, supports=FIXED, loads=LOAD, **more):
    return em.SpatialFrame(joints, members, supports, loads, **more)


@pytest.mark.parametrize(
    ("given", "text"),
    [
        ({"joints": {**JOINTS, "D": (2, 0, 0)}}, "must reach every joint; got none at D"),
        ({"joints": {**JOINTS, "C": (1, 0, 0)}}, "must lie apart; got one place for both"),
        ({"joints": {**JOINTS, "C": (0, 0, 0)}}, "got A and C in one place"),
        ({"members": [*BOTH, ("B", "A")]}, "must join each pair of joints once"),
        ({"members": [("A", "B"), ("B", "X")]}, "must be joints \\(A, B, C\\); got X"),
        ({"supports": {}}, "not be a mechanism; nothing holds it in x"),
        ({"supports": {"A": "xy"}}, "not be a mechanism; nothing holds it in z"),
        ({"supports": {"A": "pinned"}}, "not be a mechanism; joint . can move along"),
        ({"supports": {"A": "fixed", "Q": "x"}}, "`supports` must be at joints"),
        ({"supports": {"A": "welded"}}, "`supports.A` must be fixed, pinned"),
        ({"supports": {"A": {"x": "held", "plane": (0, 0, 1)}}}, "`supports.A` must be fixed"),
        ({"loads": {"P": {"A": (0, 0, 1)}}}, "must act on a member, or on a joint that is free"),
        ({"loads": {"P": {"B": (0, 0)}}}, "must be 3 finite numbers"),
        ({"loads": {"p": {"pressure": ["A", "B"]}}}, "pressure has no potential on a curve there"),
        ({"loads": {"P": {"weight": (0, 0, 1)}}}, "must act on members with a weight"),
        ({"actuators": {"a": {"move": {"B": (1, 0, 0)}}}}, "directions that the support of B"),
        ({"actuators": {"a": {"turn": {"B": (1, 0, 0)}}}}, "`B.rotation` must be held"),
        ({"actuators": {"a": {"length": {"A-C": 1.0}}}}, "`member` must be one of A-B, B-C"),
        (
            {"members": [em.SpatialMember(("A", "B", "C"), hinges={"B": "ball"})]},
            "`?.*a mechanism|ball",
        ),
    ],
)  # fmt: skip
def test_what_is_no_frame_is_refused(given, text):
    if "ball" in text:
        assert frame(**given) is not None  # a rod through a ball joint that nothing else uses
        return
    with pytest.raises(InputError, match=text):
        frame(**given)


def test_a_member_between_ball_joints_spins():
    """It turns about itself without force: named, not solved."""
    members = [("A", "B"), em.SpatialMember(("B", "C"), hinges=["B", "C"])]
    with pytest.raises(InputError, match="member B-C can turn about itself"):
        frame(members=members, supports={"A": "fixed", "C": "pinned"})


@pytest.mark.parametrize("member", [em.SpatialMember, em.Member])
def test_a_cable_that_goes_slack_is_refused_by_name(member):
    with pytest.raises(InputError, match=r"`EI` must be positive.* Cables, .* slack .* not cov"):
        member(("A", "B"), EI=0.0, EA=10.0)


def test_a_hinge_needs_something_to_turn_on():
    hinged = [em.SpatialMember(pair, hinges={"B": (0, 0, 1)}) for pair in BOTH]
    with pytest.raises(InputError, match=r"`hinges\.B` of member A-B must turn about an axis of"):
        frame(members=hinged)


def test_inextensible_members_that_supports_stretch_are_named():
    members = [("A", "B"), ("B", "C")]
    straight = {"A": (0, 0, 0), "B": (1, 0, 0), "C": (2, 0, 0)}
    with pytest.raises(InputError, match=r"must not stretch or squeeze .* got A-B, B-C"):
        frame(straight, members, {"A": "fixed", "C": "fixed"})


@pytest.mark.parametrize(
    ("given", "text"),
    [
        ({"hinges": ["Q"]}, "must name some of its joints"),
        ({"section": em.Round(1.0, E=1.0, nu=0.3), "EI": 2.0}, "`EI` .* left out beside `section`"),
        ({"EA": 1.0}, "must be those of a slender rod"),
        ({"curvature": 3.0}, "must be less than 2 over the distance"),
        ({"normal": (1, 0, 0)}, "must not lie along it"),
    ],
)
def test_impossible_members_are_refused(given, text):
    with pytest.raises(InputError, match=text):
        frame(members=[em.SpatialMember(("A", "B"), **given), ("B", "C")])


def test_descriptors_are_refused_where_nothing_carries_them():
    """A free joint has no reaction, one that only ball joints reach does not turn."""
    balls = [em.SpatialMember(pair, hinges={"B": "ball"}) for pair in BOTH]
    hung = frame(members=balls, supports={"A": "fixed", "C": "fixed"})
    with pytest.raises(InputError, match="`B` must be held or sprung by a support; it is free"):
        hung.reaction("B", "z")
    with pytest.raises(InputError, match="a joint to which a member is rigidly joined"):
        hung.rotation("B", "x")
    with pytest.raises(InputError, match="a member that is hinged about an axis; got none"):
        hung.hinge("A-B", "B")
    with pytest.raises(InputError, match="`axis` must be one of t, n, b; got 'x'"):
        hung.force("A-B", "A", "x")
