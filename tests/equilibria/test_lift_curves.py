"""Lifting along smooth curves and with extra equations, against closed forms."""

import numpy as np
import pytest

import equimorph as em
from equimorph.equilibria.prescribed_curves import approximate
from equimorph.errors import InputError
from equimorph.model import Descriptor
from oracles.polynomial import Polynomial, fold_form, pitchfork_form


def bowl():
    """E = ½ x² − a x + ½ y² − b y: x = a, y = b, stable everywhere."""
    return Polynomial(lambda x, y, a, b: x**2 * 0.5 - a * x + y**2 * 0.5 - b * y, 2, ("a", "b"))


def test_unknowns_follow_a_circle_in_parameter_space():
    """x = a(t), y = b(t): exact at every step, and the way is √2 times that of the parameters."""
    form = bowl()
    path = em.lift(
        form.state(1.0, 0.0, a=1.0),
        lambda t: {"a": np.cos(2 * np.pi * t), "b": np.sin(2 * np.pi * t)},
    )
    assert path.arrived
    assert path.states.z[:, 0] == pytest.approx(np.cos(2 * np.pi * path.at), abs=1e-12)
    assert path.states["b"] == pytest.approx(np.sin(2 * np.pi * path.at), abs=1e-12)
    assert path.length[-1] == pytest.approx(2 * np.pi * np.sqrt(2), rel=0.01)


def test_fold_on_a_curved_path_lies_where_its_parameter_vanishes():
    """x² = a, a = cos(πt): a fold at t = ½."""
    end = em.lift(fold_form().state(1.0, a=1.0), lambda t: {"a": np.cos(np.pi * t)}).end
    assert end.kind == "fold"
    assert end.at == pytest.approx(0.5, abs=1e-11)
    assert end.state["a"] == pytest.approx(0.0, abs=1e-11)


def test_path_turns_with_its_parameter_without_an_event():
    """x² = a with a = 1 + sin(πt): the curve in a comes back, the path in t does not turn."""
    path = em.lift(fold_form().state(1.0, a=1.0), lambda t: {"a": 1.0 + np.sin(np.pi * t)})
    assert path.arrived
    assert len(path.events) == 1
    assert path.states["a"].max() > 1.9
    assert path.end.state.z[0] == pytest.approx(1.0, rel=1e-13)


@pytest.mark.parametrize(("sign", "word"), [(1.0, "supercritical"), (-1.0, "subcritical")])
def test_branch_point_on_a_curved_path(sign, word):
    """±x³ = a x with a = t² + t − 1: at t = (√5 − 1)/2."""
    end = em.lift(pitchfork_form(sign).state(0.0, a=-1.0), lambda t: {"a": t * t + t - 1.0}).end
    assert (end.kind, end.criticality) == ("branch point", word)
    assert end.at == pytest.approx((np.sqrt(5.0) - 1.0) / 2.0, abs=1e-11)


def test_spline_passes_its_samples_and_is_the_cubic_through_four():
    """Samples of t³ at four knots: not-a-knot gives t³ itself.

    Tolerance of y: points on the way are corrected to 1e-10.
    """
    knots = np.array([0.0, 0.2, 0.7, 1.0])
    spline = em.Spline(knots, a=knots**3, b=[0.0, 1.0, 0.0, 2.0])
    path = em.lift(bowl().state(0.0, 0.0), spline)
    assert path.arrived
    assert path.states["a"] == pytest.approx(path.at**3, abs=1e-13)
    assert path.states.z[:, 1] == pytest.approx(path.states["b"], abs=1e-9)
    assert path.end.state["b"] == pytest.approx(2.0, rel=1e-13)


def test_way_points_and_curves_follow_each_other():
    path = em.lift(
        bowl().state(0.0, 0.0),
        [{"a": 1.0}, lambda t: {"b": np.sin(t)}, em.Spline(a=[1.0, 3.0]), {"a": 0.0, "b": 0.0}],
    )
    assert path.arrived
    assert path.end.at == 4.0
    assert path.end.state.z == pytest.approx([0.0, 0.0], abs=1e-13)


def test_arch_on_a_closed_curve_is_where_it_was():
    """Tolerance: end points are polished to round-off."""
    rest = em.Rod().natural_state(Theta=0.9, Delta=0.1)
    path = em.lift(
        rest,
        lambda t: {
            "Theta": 0.9 + 0.2 * np.sin(2 * np.pi * t), "Delta": 0.1 * np.cos(2 * np.pi * t)
        },
    )  # fmt: skip
    assert path.arrived
    assert np.abs(path.end.state.z - rest.z).max() < 1e-12


# --- polynomials ---------------------------------------------------------------------------------


def test_polynomials_agree_with_a_function_and_its_derivatives():
    """exp(sin 9t): tolerances by 81 and 81² times the error of values, 1e-12."""
    f = approximate(lambda t: np.array([[np.exp(np.sin(9 * t))]]), 1, np.ones(1))
    t = np.linspace(0.0, 1.0, 101)
    f = f.take(np.zeros(101, int))
    value, s, c = np.exp(np.sin(9 * t)), np.sin(9 * t), np.cos(9 * t)
    assert f.value(t)[:, 0] == pytest.approx(value, rel=1e-12)
    assert f.rate(t)[:, 0] == pytest.approx(9 * c * value, abs=1e-9)
    assert f.bend(t)[:, 0] == pytest.approx(81 * (c * c - s) * value, abs=1e-6)


def test_curves_go_on_straight_beyond_their_ends():
    f = approximate(lambda t: np.array([[t**2]]), 1, np.ones(1)).take(np.zeros(2, int))
    assert f.value(np.array([-0.5, 1.5]))[:, 0] == pytest.approx([0.0, 2.0], abs=1e-12)
    assert f.bend(np.array([-0.5, 1.5])).ravel().tolist() == [0.0, 0.0]


# --- extra equations -----------------------------------------------------------------------------


def test_unknown_parameter_follows_what_is_prescribed():
    """x² = a: x from 1 to 3 at a constant rate needs a = x²."""
    form = fold_form()
    x = form.descriptor("0")
    path = em.lift(form.state(1.0, a=1.0), {x: 3.0, "a": None})
    assert path.arrived
    assert path.states.z[:, 0] == pytest.approx(1.0 + 2.0 * path.at, rel=1e-13)
    assert path.states["a"] == pytest.approx(path.states.z[:, 0] ** 2, rel=1e-12)
    assert (path.states.residual < 1e-12).all()


def test_stability_lost_on_the_way_is_located():
    """x² = a: x from 1 to −1 passes the fold at a = 0 smoothly; beyond it states are unstable.

    Tolerance: gradients of descriptors are taken by differences.
    """
    form = fold_form()
    x = form.descriptor("0")
    end = em.lift(form.state(1.0, a=1.0), {x: -1.0, "a": None}).end
    assert (end.kind, end.at) == ("critical", pytest.approx(0.5, abs=1e-10))
    assert end.state["a"] == pytest.approx(0.0, abs=1e-10)
    through = em.lift(form.state(1.0, a=1.0), {x: -1.0, "a": None}, through_folds=True)
    assert [event.kind for event in through.events] == ["critical", "arrived"]
    assert through.end.state.index == 1


def test_descriptor_that_turns_ends_the_lift_at_a_fold():
    """S = x² with x = a: S cannot fall below 0, where dS/da = 0."""
    form = bowl()
    square = Descriptor("square", "1", lambda z, p: z[:, 0] ** 2)
    end = em.lift(form.state(1.0, 0.0, a=1.0), {square: -1.0, "a": None}).end
    assert end.kind == "fold"
    assert end.state["a"] == pytest.approx(0.0, abs=1e-9)
    assert "Jacobian" in end.detail


def test_held_descriptor_and_given_parameters_together():
    """x = a, y = b: hold x + y while b moves along a curve; a = 1 − b."""
    form = bowl()
    total = Descriptor("total", "1", lambda z, p: z[:, 0] + z[:, 1])
    path = em.lift(
        form.state(1.0, 0.0, a=1.0),
        lambda t: {"b": np.sin(2 * t), total: 1.0, "a": None},
    )
    assert path.arrived
    assert path.states["a"] == pytest.approx(1.0 - np.sin(2 * path.at), abs=1e-11)


def test_heights_of_the_arch_are_tracked_around_a_square():
    """The square of heights at s = 1/3, 2/3 is stable all around (the paper's case at q = 2.5).

    By symmetry Δ = 0 at both corners of equal heights; Θ = 1.621098 at (0.15, 0.15).
    """
    arch = em.Rod()
    left, right = arch.height(1 / 3), arch.height(2 / 3)
    start = em.lift(arch.natural_state(Theta=1.0), {"q": 2.5}).end.state
    free = {"Theta": None, "Delta": None}
    middle = em.lift(start, {left: 0.15, right: 0.15, **free}).end.state
    assert middle["Theta"] == pytest.approx(1.621098, abs=5e-7)
    corners = [(0.1, 0.1), (0.2, 0.1), (0.2, 0.2), (0.1, 0.2), (0.1, 0.1)]
    path = em.lift(middle, [{left: x, right: y, **free} for x, y in corners])
    assert path.arrived
    assert (path.index == 0).all()
    ends = np.flatnonzero(np.isin(path.at, np.arange(1.0, 6.0)))
    assert left(path.states[ends]) == pytest.approx([x for x, _ in corners], abs=1e-11)
    assert right(path.states[ends]) == pytest.approx([y for _, y in corners], abs=1e-11)
    assert path.states["Delta"][ends[[0, 2, 4]]] == pytest.approx(0.0, abs=1e-11)
    assert path.states["Theta"][ends[0]] == pytest.approx(path.states["Theta"][ends[4]], rel=1e-11)


# --- constraints that are grazed -----------------------------------------------------------------


@pytest.mark.parametrize("excess", [1e-2, 1e-4, 1e-6, 1e-8])
def test_constraint_that_is_violated_for_a_moment_within_a_step_is_met(excess):
    """x = a(t) rises to 1 and returns; the bound 1 − ε is crossed where sin(πt) = 1 − ε.

    The steps are longer than the violation: 2·√(2ε)/π of the way.
    """
    form = bowl()
    bound = 1.0 - excess
    end = em.lift(
        form.state(0.0, 0.0),
        lambda t: {"a": np.sin(np.pi * t), "b": 4.0 * t},
        within=[form.descriptor("0") <= bound],
    ).end
    assert end.kind == "constraint"
    assert end.at == pytest.approx(np.arcsin(bound) / np.pi, rel=1e-9)


def test_constraint_that_is_almost_touched_is_not_met():
    form = bowl()
    path = em.lift(
        form.state(0.0, 0.0),
        lambda t: {"a": np.sin(np.pi * t), "b": 4.0 * t},
        within=[form.descriptor("0") <= 1.0 + 1e-7],
    )
    assert path.arrived
    assert path.states.z[:, 0].max() > 1.0 - 1e-3


# --- what is refused -----------------------------------------------------------------------------


def test_curve_that_begins_elsewhere_is_refused():
    with pytest.raises(InputError, match=r"must begin at the start, where a = 0; got 1 at t=0"):
        em.lift(bowl().state(0.0, 0.0), lambda t: {"a": 1.0 + t})


def test_curve_with_a_corner_is_refused():
    with pytest.raises(InputError, match=r"must be smooth .* near t=0\.3"):
        em.lift(bowl().state(0.0, 0.0), lambda t: {"a": abs(t - 1 / 3) - 1 / 3})


@pytest.mark.parametrize(
    ("to", "words"),
    [
        ({"c": 1.0}, r"`c` must be a parameter \(a, b\)"),
        ({"a": np.nan}, "`a` must be a finite number"),
        ({"a": np.array([1.0, 2.0])}, "one for each of 1 states"),
        ({"a": None}, "as many parameters unknown"),
        (lambda t: [t], r"must give \{name: value\}; got \[0.0\]"),
        ([], "must change at least one parameter"),
        ({"a": 0.0}, "must change at least one parameter"),
        (lambda t: {"a": 0.0 * t}, "must change at least one parameter"),
        (lambda t: {"a": np.nan * t}, "`a` must be a finite number"),
    ],
)  # fmt: skip
def test_bad_legs_are_refused(to, words):
    with pytest.raises(InputError, match=words):
        em.lift(bowl().state(0.0, 0.0), to)


@pytest.mark.parametrize(
    ("t", "samples", "words"),
    [
        (None, {}, "must name at least one parameter"),
        (None, {"a": [1.0]}, "two or more samples"),
        (None, {"a": [1.0, 2.0], "b": [1.0, 2.0, 3.0]}, "as many of each"),
        ([0.0, 0.6, 0.5, 1.0], {"a": [1.0, 2.0, 3.0, 4.0]}, "grow from 0 to 1"),
        ([0.0, 0.9], {"a": [1.0, 2.0]}, "grow from 0 to 1"),
        (None, {"a": [1.0, np.inf]}, "finite numbers"),
    ],
)
def test_bad_splines_are_refused(t, samples, words):
    with pytest.raises(InputError, match=words):
        em.Spline(t, **samples)
