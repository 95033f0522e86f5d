"""Curves of folds, branch points, cusps and bounds on forms known in closed form."""

import numpy as np
import pytest
from hypothesis import Phase, given, settings, strategies as st

import equimorph as em
from equimorph.equilibria.locus import Locus, nearest
from equimorph.equilibria.trace_locus import trace_locus
from equimorph.equilibria.trace_options import EventKind, TraceOptions
from equimorph.errors import InputError
from oracles.polynomial import Polynomial, pitchfork_form, slaved
from typecheck import unchecked

PHASES = (Phase.explicit, Phase.generate)  # to shrink takes minutes
QUICK = settings(max_examples=3, deadline=None, derandomize=True, phases=PHASES)
COARSE = em.TraceOptions(first_step=0.2, largest_step=0.6)

factors = st.floats(0.2, 5.0)
stiff = st.floats(0.5, 4.0)
slopes = st.floats(-1.0, 1.0)


@pytest.fixture(scope="module", autouse=True)
def _fast():
    """The curves of the arch check shapes."""
    with unchecked():
        yield


def swallowtail():
    """x⁴ + a x² + b x + c = 0 [PostonStewart1978]_."""
    return Polynomial(
        lambda x, a, b, c: x**5 * 0.2 + a * x**3 * (1 / 3) + b * x**2 * 0.5 + c * x,
        1,
        ("a", "b", "c"),
    )


def on_swallowtail(x, a):
    """The fold of the swallowtail at x."""
    b = -4 * x**3 - 2 * a * x
    return swallowtail().state(x, a=a, b=b, c=-(x**4 + a * x**2 + b * x))


def kinds(curve):
    return [event.kind for event in curve.events]


# --- folds ---------------------------------------------------------------------------------------


@QUICK
@given(sign=st.sampled_from([1.0, -1.0]), x=st.floats(0.3, 0.8), c=factors, k=stiff, m=slopes)
def test_folds_of_the_cusp_form_have_no_discriminant(sign, x, c, k, m):
    """±x³ − a x = b: folds on 27 b² = ±4 a³ with a cusp at the origin, standard or dual."""
    form = slaved(pitchfork_form(sign, c), k, m)
    start = form.state(x, m * x**2, a=3 * sign * x**2, b=-2 * sign * x**3)
    box = em.Box(a=(-3.0, 3.0))
    curve = em.fold_curve(start, ("a", "b"), box=box, options=COARSE)
    a, b = curve.states["a"], curve.states["b"]
    assert np.abs(27 * b**2 - 4 * sign * a**3).max() < 1e-10
    cusp = next(event for event in curve.events if event.kind == "cusp")
    assert cusp.detail == ("standard" if sign > 0 else "dual")
    assert np.abs([*cusp.state.z, cusp.state["a"], cusp.state["b"]]).max() < 1e-10
    assert (curve.index == 0).all()
    assert [end.kind for end in curve.ends] == ["box", "box"]
    assert [end.detail for end in curve.ends] == [f"a = {3 * sign:g}"] * 2
    assert [end.state["a"] for end in curve.ends] == pytest.approx([3 * sign] * 2, abs=1e-12)
    assert (np.diff(curve.length) > 0).all()


@QUICK
@given(x=st.floats(0.6, 0.9), power=st.floats(-5.0, 0.0))
def test_both_cusps_of_a_swallowtail_are_found_however_close(x, power):
    """Cusps at x = ±√(−a/6), one standard, one dual; between them paths along b cross."""
    a = -(10.0**power)
    curve = em.fold_curve(on_swallowtail(x, a), ("b", "c"), box=em.Box(b=(-4, 4)), options=COARSE)
    assert kinds(curve) == ["cusp", "branch point", "cusp"]
    assert [event.detail for event in curve.events] == ["standard", "b", "dual"]
    root = np.sqrt(-a / 6)
    assert [event.state.z[0] for event in curve.events] == pytest.approx(
        [root, 0, -root], abs=1e-10
    )
    assert curve.events[0].state["b"] == pytest.approx(-4 * root**3 - 2 * a * root, abs=1e-10)


def test_folds_of_an_isola_close():
    """x² + a² + b² = 1: folds on the unit circle, with isolated points where it turns."""
    form = Polynomial(
        lambda x, a, b: x**3 * (1 / 3) + (a**2 + b**2 - 1.0) * x, 1, ("a", "b")
    )  # fmt: skip
    curve = em.fold_curve(form.state(0.0, a=0.6, b=0.8), ("a", "b"))
    assert curve.closed
    assert [end.kind for end in curve.ends] == ["closed", "closed"]
    assert np.hypot(curve.states["a"], curve.states["b"]) == pytest.approx(1.0, abs=1e-12)
    assert np.abs(curve.states.z[0] - curve.states.z[-1]).max() < 1e-12
    assert [(e.kind, e.detail, e.criticality) for e in curve.events] == [
        ("branch point", name, "isola") for name in ("b", "a", "b", "a")
    ]


@QUICK
@given(d=st.floats(0.2, 0.9), stiffness=st.floats(0.5, 2.0))
def test_folds_of_the_spring_lie_on_their_closed_form(d, stiffness):
    """PHYSICS §2: x_l = cos³ δ, F/k = sin³ δ, with a cusp at (1, 0)."""
    spring = em.Spring(stiffness)
    p = np.array([np.cos(d) ** 3, stiffness * np.sin(d) ** 3, stiffness])
    start = em.State(spring, np.array([d]), p)
    curve = em.fold_curve(start, ("x_l", "F"), box=em.Box(x_l=(0.1, 2.0)), options=COARSE)
    delta = curve.states.z[:, 0]
    assert curve.states["x_l"] == pytest.approx(np.cos(delta) ** 3, abs=1e-11)
    assert curve.states["F"] == pytest.approx(stiffness * np.sin(delta) ** 3, abs=1e-11)
    cusp = curve.events[kinds(curve).index("cusp")]
    assert cusp.detail == "standard"
    assert [cusp.state["x_l"], cusp.state["F"]] == pytest.approx([1.0, 0.0], abs=1e-11)


def test_fold_curve_ends_where_a_constraint_is_violated():
    """Cusp form: x ≥ −0.25 ends the folds behind the cusp, where a = 3/16."""
    form = pitchfork_form(1.0)
    x = form.descriptor("0")
    curve = em.fold_curve(
        form.state(0.5, a=0.75, b=-0.25), ("a", "b"), box=em.Box(a=(-1, 2)), within=[x >= -0.25]
    )
    end = next(end for end in curve.ends if end.kind == "constraint")
    assert end.detail == "u0 >= -0.25"
    assert [*end.state.z, end.state["a"]] == pytest.approx([-0.25, 3 / 16], abs=1e-11)


def test_second_eigenvalue_that_vanishes_on_a_fold_curve_is_located():
    """x² = a beside y (b + ½ x + y²) = 0: on the folds x = 0 the second one vanishes at b = 0."""
    form = Polynomial(
        lambda x, y, a, b: x**3 * (1 / 3) - a * x + (b + x * 0.5) * y**2 * 0.5 + y**4 * 0.25,
        2,
        ("a", "b"),
    )
    curve = em.fold_curve(form.state(0.0, 0.0, b=0.73), ("a", "b"), box=em.Box(b=(-1, 1)))
    double = next(event for event in curve.events if event.kind == "double")
    assert double.state["b"] == pytest.approx(0.0, abs=1e-10)
    assert set(curve.index) == {0, 1}


# --- branch points, cusps, bounds ----------------------------------------------------------------


@QUICK
@given(slope=slopes, c=factors, k=stiff, m=slopes)
def test_symmetric_pitchforks_are_followed_and_change_their_criticality(slope, c, k, m):
    """x⁵ + q x³ = (a − slope q) x: pitchforks at a = slope q, subcritical for q < 0."""
    form = slaved(
        Polynomial(
            lambda x, a, q: c * (x**6 * (1 / 6) + q * x**4 * 0.25 - (a - slope * q) * x**2 * 0.5),
            1,
            ("a", "q"),
        ),
        k,
        m,
    )
    start = em.lift(form.state(0.0, 0.0, a=slope - 0.7, q=1.0), {"a": slope + 1.0}).end
    assert (start.kind, start.criticality) == ("branch point", "supercritical")
    box = em.Box(q=(-1.0, 2.0))
    curve = em.branch_curve(start.state, ("a", "q"), along="a", box=box, options=COARSE)
    assert curve.states["a"] == pytest.approx(slope * curve.states["q"], abs=1e-11)
    assert kinds(curve) == ["degenerate"]
    assert curve.events[0].state["q"] == pytest.approx(0.0, abs=1e-10)


@QUICK
@given(sign=st.sampled_from([1.0, -1.0]), bent=slopes)
def test_branch_points_without_symmetry_need_a_third_parameter(sign, bent):
    """±x² = (a − c)² + b − bent c²: paths along a branch at a = c, b = bent c²."""
    form = Polynomial(
        lambda x, a, b, c: x**3 * (sign / 3) - ((a - c) ** 2 + b - bent * c**2) * x,
        1,
        ("a", "b", "c"),
    )
    start = form.state(0.0, a=0.5, b=bent * 0.25, c=0.5)
    box = em.Box(c=(-1.0, 1.0))
    curve = em.branch_curve(start, ("a", "b", "c"), along="a", box=box, options=COARSE)
    c = curve.states["c"]
    assert curve.states["a"] == pytest.approx(c, abs=1e-11)
    assert curve.states["b"] == pytest.approx(bent * c**2, abs=1e-11)
    fold = form.state(0.0, a=0.5, b=bent * 0.16 - 0.01, c=0.4)
    with pytest.raises(InputError, match=r"`state` must lie on a branch point curve in a, b, c"):
        em.branch_curve(fold, ("a", "b", "c"), along="a")


@QUICK
@given(a=st.floats(-1.5, -0.3))
def test_cusps_are_followed_through_the_swallowtail(a):
    """x = ±√(−a/6), b = 8x³, c = −3x⁴ meet at the origin."""
    x = np.sqrt(-a / 6)
    curve = em.cusp_curve(
        on_swallowtail(x, a), ("a", "b", "c"), box=em.Box(a=(-2, 1)), options=COARSE
    )
    x = curve.states.z[:, 0]
    assert curve.states.p == pytest.approx(np.stack([-6 * x**2, 8 * x**3, -3 * x**4], 1), abs=1e-11)
    middle = curve.events[kinds(curve).index("swallowtail")].state
    assert np.abs(middle.p).max() < 1e-10
    assert x.min() < -0.5
    assert x.max() > 0.5


@QUICK
@given(bound=st.floats(0.1, 0.5), a=st.floats(-1.0, 1.0))
def test_folds_on_a_bound_are_followed_in_three_parameters(bound, a):
    """Folds of the swallowtail at x = bound."""
    start = on_swallowtail(bound, a)
    x = start.structure.descriptor("0")
    curve = em.fold_curve(
        start, ("a", "b", "c"), on=[x <= bound], box=em.Box(a=(-2, 2)), options=COARSE
    )
    assert curve.states.z[:, 0] == pytest.approx(bound, abs=1e-11)
    a = curve.states["a"]
    assert curve.states["b"] == pytest.approx(-4 * bound**3 - 2 * a * bound, abs=1e-11)
    cusp = curve.events[kinds(curve).index("cusp")]
    assert cusp.state["a"] == pytest.approx(-6 * bound**2, abs=1e-10)


def test_states_on_a_bound_become_critical_where_it_meets_the_folds():
    """x³ − a x = b at x = ½ is a fold at a = ¾."""
    form = pitchfork_form(1.0)
    x = form.descriptor("0")
    start = form.state(0.5, a=0.0, b=0.125)
    curve = em.constraint_curve(start, ("a", "b"), on=[x <= 0.5], box=em.Box(a=(-1, 2)))
    assert kinds(curve) == ["critical"]
    assert curve.events[0].state["a"] == pytest.approx(0.75, abs=1e-10)
    assert curve.index[0] == 0
    assert curve.index[-1] == 1


def test_paths_graze_a_bound_along_a_curve():
    """x = b + c² − a² touches x ≤ 1 along a at a = 0, b = 1 − c²."""
    form = Polynomial(
        lambda x, a, b, c: x**2 * 0.5 + (a**2 - b - c**2) * x, 1, ("a", "b", "c")
    )  # fmt: skip
    curve = em.grazing_curve(
        form.state(1.0, a=0.0, b=0.75, c=0.5), ("a", "b", "c"),
        on=form.descriptor("0") <= 1.0, along="a", box=em.Box(b=(-1, 2)),
    )  # fmt: skip
    assert curve.states["b"] == pytest.approx(1 - curve.states["c"] ** 2, abs=1e-12)
    assert np.abs(curve.states["a"]).max() < 1e-9


# --- refusals ------------------------------------------------------------------------------------


def test_starts_and_parameters_without_meaning_are_refused():
    form = pitchfork_form(1.0)
    fold = form.state(0.5, a=0.75, b=-0.25)
    regular = form.state(0.5, a=0.0, b=0.125)
    with pytest.raises(InputError, match=r"`parameters` must be 2 different names; got \['a'\]"):
        em.fold_curve(fold, ("a",))
    with pytest.raises(InputError, match=r"`c` must be a parameter \(a, b\)"):
        em.fold_curve(fold, ("a", "c"))
    with pytest.raises(InputError, match=r"`state` must lie on a fold curve in a, b"):
        em.fold_curve(regular, ("a", "b"))
    with pytest.raises(InputError, match=r"`state` must lie in the box; got a = 0\.75 outside 1"):
        em.fold_curve(fold, ("a", "b"), box=em.Box(a=(1, 2)))
    with pytest.raises(InputError, match=r"`along` must be one of the parameters that vary"):
        em.branch_curve(form.state(0.0), ("a", "b"), along="c")
    x = form.descriptor("0")
    with pytest.raises(InputError, match=r"`state` must obey u0 <= 0\.2"):
        em.fold_curve(fold, ("a", "b"), within=[x <= 0.2])


def test_too_few_steps_are_an_end_that_says_so():
    form = pitchfork_form(1.0)
    curve = em.fold_curve(
        form.state(0.5, a=0.75, b=-0.25), ("a", "b"), options=em.TraceOptions(steps=3)
    )
    assert [end.kind for end in curve.ends] == ["lost", "lost"]
    assert curve.ends[0].detail == "no end in 3 steps"


def test_without_conditions_the_general_tracer_follows_the_path_of_a_lift():
    """Lifts, the case without conditions, march in compiled kernels: both must agree.

    Tolerance: states are exact to round-off, times the slope of the path near its fold.
    """
    arch = em.Rod(elements=6, degree=6)
    rest = arch.natural_state(Theta=0.9, Delta=0.4)
    path = em.lift(rest, {"q": 8.0})
    assert path.end.kind == EventKind.FOLD
    load = np.array([[each.name for each in arch.parameters].index("q")])
    line = Locus(arch, rest.p, load, (), singular=False)
    start, found = nearest(line, line.join(rest.z[None], rest.p[None]))
    assert found.all()
    start = start.turn(np.sign(start.tangent[:, -1]))
    _, forward = trace_locus(line, start, [], TraceOptions(largest_step=0.2, steps=25))
    critical = forward.landmarks[0]
    assert critical.kind == EventKind.CRITICAL
    z, p = line.split(critical.spot.x)
    np.testing.assert_allclose(p[0], path.end.state.p, rtol=1e-9)
    np.testing.assert_allclose(z[0], path.end.state.z, rtol=1e-6, atol=1e-6)
    before = [x for x, way in zip(forward.spots, forward.lengths, strict=True)
              if way < critical.length - 0.3]  # fmt: skip
    assert len(before) > 3
    z, p = line.split(np.concatenate([spot.x for spot in before[1:]]))
    for state, q in zip(z, p[:, load[0]], strict=True):
        np.testing.assert_allclose(em.lift(rest, {"q": q}).end.state.z, state, rtol=0, atol=1e-9)
