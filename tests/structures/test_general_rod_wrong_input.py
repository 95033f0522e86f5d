"""Refusals of general rods: one line that says what, which value, and what is allowed."""

import numpy as np
import pytest

import equimorph as em
from typecheck import unchecked

FREE_ENDS = ("clamped", "free")

WRONG = {
    "unknown end": (
        {"ends": ("clamped", "glued")},
        r"`ends` must be a list of ends: 'clamped'.*'glued'",
    ),
    "one end": ({"ends": ("clamped",)}, "`ends` must be two ends"),
    "negative spring": (
        {"ends": ("clamped", {"angle": -1.0})},
        "`angle` must be 'held', 'free' or the stiffness of a spring.*-1",
    ),
    "drifting in x": (
        {"ends": ({"x": "free"}, {"x": "free"})},
        "`ends` must hold x at one end at least",
    ),
    "turning about a pin": ({"ends": ("pinned", "free")}, "`ends` must hold an angle"),
    "no stiffness": ({"stiffness": 0.0, "ends": FREE_ENDS}, "`stiffness` must be positive.*got 0"),
    "negative stiffness somewhere": (
        {"stiffness": [[0, 1], [0.5, -0.1], [1, 1]]},
        r"`stiffness` must be positive everywhere; got -0\.1 at s = 0\.5",
    ),
    "no axial stiffness": ({"axial": -3.0}, "`axial` must be positive"),
    "curvature by name": (
        {"curvature": "big"},
        "`curvature` must be a finite number, a text with its unit, a table.*; got 'big'",
    ),
    "curvature not finite": (
        {"curvature": np.inf},
        "`curvature` must be a finite number, .*; got inf",
    ),
    "kink outside": (
        {"curvature": lambda s: s, "kinks": [1.2]},
        r"`kinks` must be a list of numbers between 0 and 1 \(both excluded\); got 1\.2",
    ),
    "kinks too close": (
        {"loads": {"P": em.PointForce(0.3), "M": em.Couple(0.3 + 1e-9)}},
        "`kinks`, of loads and profiles together, must lie 1e-06 apart",
    ),
    "follower load": (
        {"loads": {"P": {"term": "follower force", "s": 1.0}}},
        "`loads.P` must be conservative; got 'follower force'.*Use a dead load",
    ),
    "pressure on a moving end": (
        {"ends": ("clamped", "free"), "loads": {"p": em.Pressure()}},
        "`ends` must leave each end .*pressure is a follower load without a potential",
    ),
    "pressure on a stretching rod": (
        {"axial": 5.0, "loads": {"p": em.Pressure()}},
        "`axial` must be left out for rods under the pressure `p`",
    ),
    "no term": (
        {"loads": {"P": 3.0}},
        r"`loads` must be terms, or lists of terms, by name, .*; got P = 3\.0",
    ),
    "data of a term": (
        {"loads": {"P": {"term": "point force", "at": 1.0}}},
        r"`PointForce` must have arguments among s, direction; got at",
    ),
    "name taken": ({"loads": {"nu": em.Couple(0.5)}}, r"`loads\.nu` must have a different name"),
    "name twice": (
        {"loads": {"P": em.Couple(0.5)}, "actuators": {"P": em.Couple(0.2)}},
        r"`loads\.P` must have a different name",
    ),
    "terms of two kinds": (
        {"loads": {"P": [em.Couple(0.5), em.PointForce(0.5)]}},
        r"`loads\.P` must hold terms of one kind",
    ),
    "unknown coordinate": (
        {"coordinates": {"turn": {"theta_C": 1.0}}},
        r"`coordinates\.turn` must combine theta_A, theta_B, q, nu, rise; got 'theta_C'",
    ),
    "coordinate of two units": (
        {"coordinates": {"turn": {"theta_A": 1.0, "nu": 1.0}}},
        r"`coordinates\.turn` must combine parameters of one unit; got angle, length",
    ),
    "coordinate with the name of a parameter": (
        {"coordinates": {"nu": {"theta_A": 1.0}}},
        "`coordinates` must not name a parameter; got 'nu'",
    ),
    "EI alone": ({"EI": 2.0}, "`length` must be given together with `EI`"),
    "no length": ({"EI": 2.0, "length": 0.0}, "`length` must be positive and finite.*; got 0"),
    "span beyond the rod": (
        {"span": 1.2, "curvature": 1.0},
        "`span` must be less than the length of the rod, 1; got 1.2",
    ),
    "span beyond the rod in units": (
        {"span": "320 mm", "EI": 1.0, "length": "0.3 m", "units": {"force": "N", "length": "mm"}},
        "`span` must be less than the length of the rod, 0.3 m; got '320 mm'",
    ),
    "span beyond the rod in numbers": (
        {"span": 320.0, "EI": 1.0, "length": 300.0},
        "`span` must be less than the length of the rod, 300.0 m; got 320.0",
    ),
    "no span": ({"span": np.nan, "curvature": 1.0}, "`span` must be a finite number.*; got nan"),
}


@pytest.mark.parametrize(("options", "text"), WRONG.values(), ids=WRONG)
def test_a_wrong_rod_is_refused(options, text):
    with unchecked(), pytest.raises(em.InputError, match=text) as caught:
        em.Rod(**options)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("make", "text"),
    [
        (
            lambda: em.PointForce(1.5),
            "`s` must be a share of the length, from 0 to 1; got 1.5",
        ),
        (
            lambda: em.PointForce(0.5, (0, 0)),
            "`direction` must be .*, not both 0",
        ),
        (lambda: em.LineLoad("moon"), "`shape` must be 'uniform', 'left-half', a table"),
        (lambda: em.Curvature(1.0, 0.5, 0.2), "`start` must be less than `stop`"),
        (lambda: em.Tendon("far"), "`offset` must be a finite number, a table"),
    ],
)
def test_a_wrong_term_is_refused(make, text):
    with unchecked(), pytest.raises(em.InputError, match=text):
        make()


def test_a_straight_rod_between_near_pins_has_no_natural_state():
    rod = em.Rod(ends=("pinned", "pinned"), loads={})
    with unchecked(), pytest.raises(em.InputError, match="A straight rod buckles either way"):
        rod.natural_state(nu=0.9)


def test_loads_must_vanish_in_the_natural_state():
    rod = em.Rod(ends=FREE_ENDS, loads={"P": em.PointForce(1.0)})
    with (
        unchecked(),
        pytest.raises(em.InputError, match="`P` must be 0 in the natural state; got 2"),
    ):
        rod.natural_state(P=2.0)


def test_callables_cannot_be_written_down():
    rod = em.Rod(ends=FREE_ENDS, stiffness=lambda s: 1 + s)
    with unchecked(), pytest.raises(em.InputError, match="`stiffness` must be a number or a table"):
        rod.identity()
    rod = em.Rod(ends=FREE_ENDS, loads={"q": em.LineLoad(lambda s: s)})
    with (
        unchecked(),
        pytest.raises(em.InputError, match="`shape` of a line load must be a number or a table"),
    ):
        rod.identity()


def test_states_of_another_rod_are_refused():
    rod, other = em.Rod(ends=FREE_ENDS), em.Rod(ends=FREE_ENDS, elements=5)
    state = other.natural_state()
    with unchecked(), pytest.raises(em.InputError, match="`z` must have shape"):
        rod.residual(state.z[None], state.p[None])
