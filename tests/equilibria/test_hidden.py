"""Events that neither the index nor the direction of a step betrays."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import Phase, example, given, settings, strategies as st
from scipy.optimize import brentq
from scipy.special import airy

import equimorph as em
from equimorph.equilibria import ParameterLine, TraceOptions, trace
from equimorph.equilibria.determinants import may_vanish
from equimorph.equilibria.hidden_events import with_hidden_events
from equimorph.equilibria.trace_options import EventCode
from oracles.polynomial import Polynomial, slaved
from typecheck import unchecked

PHASES = (Phase.explicit, Phase.generate)  # to shrink takes minutes
QUICK = settings(max_examples=25, deadline=None, derandomize=True, phases=PHASES)

factors = st.floats(0.2, 5.0)
stiff = st.floats(0.5, 4.0)
slopes = st.floats(-1.0, 1.0)
places = st.floats(-0.6, 0.6)


@pytest.fixture(scope="module", autouse=True)
def _fast():
    with unchecked():
        yield


class Determined(Polynomial):
    """Polynomial whose steps tell the determinant, as those of rods do."""

    def advance(self, z, p, dp, row, corner, defect):
        out = super().advance(z, p, dp, row, corner, defect)
        found = np.linalg.det(self.second(z, p)[:, :, : self.size])
        return replace(out, determinant=np.stack([found, np.zeros_like(found)], axis=1))


@QUICK
@given(power=st.floats(-6.0, -1.0), centre=places, c=factors)
def test_determinants_separate_pairs_of_branch_points_without_any_probe(power, centre, c):
    """x (x² + (a − centre)² − depth) = 0 on x = 0, many lanes with their own ends."""
    depth = 10.0**power

    def energy(x, a):
        return c * (x**4 * 0.25 + ((a - centre) ** 2 - depth) * x**2 * 0.5)

    stop = np.linspace(centre + np.sqrt(depth) + 0.05, 1.0, 5)[:, None]
    curve = ParameterLine(Determined(energy, 1, ("a",)), np.full((5, 1), -1.0), stop + 1.0)
    through = TraceOptions(through_folds=True, through_branch_points=True, record=False)
    passed = trace(curve, np.zeros((5, 1)), options=through).passed
    assert passed.lanes.tolist() == [0, 0, 1, 1, 2, 2, 3, 3, 4, 4]
    a = -1.0 + passed.t * curve.velocity[passed.lanes, 0]
    root = np.sqrt(depth)
    assert a.reshape(5, 2) == pytest.approx(np.tile([centre - root, centre + root], (5, 1)))
    outcome = trace(curve, np.zeros((5, 1)), options=TraceOptions(record=False))
    assert outcome.code.tolist() == [EventCode.BRANCH_POINT] * 5


def dipping(depth, centre, c=1.0):
    """x³ + ((a − centre)² − depth) x = 0: on x = 0 the eigenvalue dips by `depth` below zero."""
    return Polynomial(
        lambda x, a: c * (x**4 * 0.25 + ((a - centre) ** 2 - depth) * x**2 * 0.5), 1, ("a",)
    )


@QUICK
@example(power=-6.0, centre=0.0, c=1.0, k=1.0, m=0.5)
@example(power=-7.8, centre=-0.55, c=0.24, k=2.6, m=-0.6)  # a point right between the two
@given(power=st.floats(-8.0, -1.0), centre=places, c=factors, k=stiff, m=slopes)
def test_two_branch_points_in_one_step_are_separated(power, centre, c, k, m):
    """At a = centre ± √depth the eigenvalue crosses zero: steps are 0.5 long."""
    depth = 10.0**power
    form = slaved(dipping(depth, centre, c), k, m)
    start = form.state(0.0, 0.0, a=-1.0)
    path = em.lift(start, {"a": 1.0}, through_folds=True)
    assert [event.kind for event in path.events] == ["branch point", "branch point", "arrived"]
    places = [event.state["a"] for event in path.events[:2]]
    assert places == pytest.approx([centre - np.sqrt(depth), centre + np.sqrt(depth)], abs=1e-10)
    end = em.lift(start, {"a": 1.0}).end
    assert (end.kind, end.criticality) == ("branch point", "supercritical")
    assert end.state["a"] == pytest.approx(centre - np.sqrt(depth), abs=1e-10)


@QUICK
@example(centre=0.393, c=0.26, k=1.54, m=-0.98)  # a point so near that its index is round-off's
@given(centre=places, c=factors, k=stiff, m=slopes)
def test_eigenvalue_that_touches_zero_is_a_degenerate_branch_point(centre, c, k, m):
    """depth = 0: the index is zero on both sides."""
    form = slaved(dipping(0.0, centre, c), k, m)
    path = em.lift(form.state(0.0, 0.0, a=-1.0), {"a": 1.0}, through_folds=True)
    assert [event.kind for event in path.events] == ["branch point", "arrived"]
    assert path.events[0].state["a"] == pytest.approx(centre, abs=1e-10)
    assert (path.index == 0).all()
    end = em.lift(form.state(0.0, 0.0, a=-1.0), {"a": 1.0}).end
    assert end.kind == "branch point"
    assert end.state["a"] == pytest.approx(centre, abs=1e-10)


TOUCHING = [(0.27, 1.1, 2.0, 0.3), (-0.41, 4.0, 0.8, -0.9), (0.05, 0.4, 3.1, 0.0)]


@pytest.mark.parametrize(("centre", "c", "k", "m"), TOUCHING)
def test_eigenvalues_that_touch_zero_show_in_many_lanes(centre, c, k, m):
    """Each lane by itself, from the determinants of its steps: it ends there or passes.

    A point of a lane within 1e-8 of the place has an index of round-off's: then it shows twice.
    """
    form = slaved(dipping(0.0, centre, c), k, m)
    stop = np.linspace(0.8, 1.0, 3)
    curve = ParameterLine(form, np.full((3, 1), -1.0), stop[:, None] + 1.0)
    outcome = trace(curve, np.zeros((3, 2)), options=TraceOptions(record=False))
    assert outcome.code.tolist() == [EventCode.BRANCH_POINT] * 3
    assert -1.0 + outcome.t * (stop + 1.0) == pytest.approx(np.full(3, centre), abs=1e-8)
    through = TraceOptions(through_folds=True, through_branch_points=True, record=False)
    outcome = trace(curve, np.zeros((3, 2)), options=through)
    assert outcome.code.tolist() == [EventCode.ARRIVED] * 3
    lanes = outcome.passed.lanes
    assert np.unique(lanes).tolist() == [0, 1, 2]
    places = -1.0 + outcome.passed.t * (stop + 1.0)[lanes]
    assert places == pytest.approx(np.full(len(lanes), centre), abs=1e-8)


@pytest.mark.parametrize(("start", "stop"), [(-1.3, 0.7), (-0.4, 1.6)])
def test_folds_in_which_paths_do_not_turn_show_in_many_lanes(start, stop):
    """x³ = a, as below."""
    form = slaved(Polynomial(lambda x, a: x**4 * 0.25 - a * x, 1, ("a",)), 1.4, 0.5)
    x = np.cbrt(start)
    z, p = np.tile([x, 0.5 * x**2], (2, 1)), np.full((2, 1), start)
    curve = ParameterLine(form, p, np.array([[stop], [stop + 0.1]]) - start)
    outcome = trace(curve, z, options=TraceOptions(record=False))
    assert outcome.code.tolist() == [EventCode.FOLD] * 2
    assert start + outcome.t * curve.velocity[:, 0] == pytest.approx([0.0, 0.0], abs=1e-10)


@QUICK
@given(power=st.floats(-6.0, -1.0), centre=places)
def test_eigenvalue_that_stays_above_zero_is_no_event(power, centre):
    form = dipping(-(10.0**power), centre)
    path = em.lift(form.state(0.0, a=-1.0), {"a": 1.0})
    assert path.arrived
    assert len(path.events) == 1


@QUICK
@example(c=2.0, k=1.61, m=0.38, a=-0.853, b=0.111)  # a step ends close by the fold
@example(c=1.2, k=1.49, m=0.0, a=-0.695, b=1.196)  # a trial hits it
@given(c=factors, k=stiff, m=slopes, a=st.floats(-2.0, -0.1), b=st.floats(0.1, 2.0))
def test_hysteresis_point_is_a_fold_in_which_the_path_does_not_turn(c, k, m, a, b):
    """x³ = a: a cusp met in its own direction.

    Tolerance of x: points between steps are corrected to 1e-11, relative to steps of 1e-2.
    """
    form = slaved(Polynomial(lambda x, a: c * (x**4 * 0.25 - a * x), 1, ("a",)), k, m)
    start = form.state(np.cbrt(a), m * np.cbrt(a) ** 2, a=a)
    path = em.lift(start, {"a": b}, through_folds=True)
    assert [event.kind for event in path.events] == ["fold", "arrived"]
    assert path.events[0].state["a"] == pytest.approx(0.0, abs=1e-10)
    assert path.events[0].state.z == pytest.approx([0.0, 0.0], abs=1e-9)
    end = em.lift(start, {"a": b}).end
    assert (end.kind, end.detail) == ("fold", "the path touches a fold and goes on")


def test_many_lanes_are_probed_together_each_as_if_alone():
    """Lane by lane: the two branch points of `dipping(1e-3, 0)`, one of them, none of them."""
    form = dipping(1e-3, 0.0)
    stop = np.array([1.0, 0.01, -0.5, 0.9, 0.7])
    curve = ParameterLine(form, np.full((5, 1), -1.0), stop[:, None] + 1.0)
    z, options = np.zeros((5, 1)), TraceOptions(through_folds=True, through_branch_points=True)
    outcome = with_hidden_events(curve, z, trace(curve, z, options=options), options)
    assert outcome.code.tolist() == [EventCode.ARRIVED] * 5
    root = np.sqrt(1e-3)
    places = curve.parameters(np.zeros(5))[outcome.passed.lanes, 0]
    places = places + outcome.passed.t * curve.velocity[outcome.passed.lanes, 0]
    assert outcome.passed.lanes.tolist() == [0, 0, 1, 3, 3, 4, 4]
    assert places == pytest.approx([-root, root, -root, -root, root, -root, root], abs=1e-10)
    assert outcome.index.tolist() == [0, 1, 0, 0, 0]
    options = TraceOptions()
    outcome = with_hidden_events(curve, z, trace(curve, z, options=options), options)
    assert outcome.code.tolist() == [
        EventCode.BRANCH_POINT,
        EventCode.BRANCH_POINT,
        EventCode.ARRIVED,
        EventCode.BRANCH_POINT,
        EventCode.BRANCH_POINT,
    ]
    assert outcome.why == {}
    assert -1.0 + outcome.t * (stop + 1.0) == pytest.approx([-root, -root, -0.5, -root, -root])


@settings(QUICK, max_examples=5)
@given(power=st.floats(-8.0, -2.0), centre=places, seed=st.integers(0, 2**20))
def test_pair_of_branch_points_shows_among_many_stiff_unknowns(power, centre, seed):
    """Eight unknowns with eigenvalues 1 to 30 in a random basis beside the one that dips."""
    generator, n = np.random.default_rng(seed), 9
    basis = np.linalg.qr(generator.normal(size=(n, n)))[0]
    stiffness = np.geomspace(1.0, 30.0, n - 1)

    def energy(*args):
        *x, a = args
        u = [sum(float(b) * xi for b, xi in zip(row, x, strict=True)) for row in basis]
        dip = ((a - centre) ** 2 - 10.0**power) * u[0] ** 2 * 0.5 + u[0] ** 2 * u[0] ** 2 * 0.25
        return dip + sum(0.5 * float(k) * v**2 for k, v in zip(stiffness, u[1:], strict=True))

    form = Polynomial(energy, n, ("a",))
    path = em.lift(form.state(*np.zeros(n), a=-1.0), {"a": 1.0}, through_folds=True)
    assert [event.kind for event in path.events] == ["branch point", "branch point", "arrived"]
    root = 10.0 ** (0.5 * power)
    found = [event.state["a"] for event in path.events[:2]]
    assert found == pytest.approx([centre - root, centre + root], abs=1e-10)


def test_paths_of_the_arch_hide_nothing():
    """Regular events are met once: no probe reports them again."""
    arch = em.Rod()
    path = em.lift(arch.natural_state(Theta=0.9, Delta=0.02), {"q": 8.0}, through_folds=True)
    assert [event.kind for event in path.events] == ["fold", "fold", "arrived"]


def test_eigenvalues_of_opposite_signs_that_swap_are_no_event():
    """Between −σ and σ the border of F_z is no eigenvector; its test function has a pole there."""
    arch = em.Rod()
    loaded = em.lift(arch.natural_state(Theta=1.0), {"q": 2.5}).end.state
    ends = [
        {"Theta": 1.613496231407899, "Delta": -0.337079180680602, "q": 2.4097057641696216},
        {"Theta": 1.7011385501804561, "Delta": -0.38523334934925946, "q": 2.9560497587390016},
    ]
    start = em.lift(loaded, ends[0]).end.state
    path = em.lift(start, ends[1])
    assert path.arrived
    assert path.states.margin.min() > 1.5


@pytest.mark.parametrize("size", [1e-6, 1.0, 1e6])
def test_a_determinant_is_looked_at_where_its_parabola_has_a_low_bottom_inside(size):
    """f = b (t − c)² + d on 0 ≤ t ≤ 1, of either sign: at most half as low as the lower end."""

    def parabola(bow, place, least):
        return bow * (np.array([0.0, 0.5, 1.0]) - place) ** 2 + least

    seen = [parabola(4.0, 0.5, 0.4), parabola(2.0, 0.4, -0.1), parabola(4.0, 0.6, 0.1)]
    unseen = [parabola(4.0, 0.5, 1.1), parabola(0.02, 13.0, -2.3), parabola(-1.0, 0.5, 1.0)]
    values = size * np.array([*seen, *unseen]).T
    assert may_vanish(values).tolist() == [True] * 3 + [False] * 3
    assert may_vanish(-values).tolist() == [True] * 3 + [False] * 3


# --- determinants beyond the range of numbers ----------------------------------------------------
THRUST = {
    "P": em.PointForce(1.0, (-1.0, 0.0, 0.0)),
    "w": em.LineLoad(direction=(-1.0, 0.0, 0.0)),
}
HEAVY = 0.2
"""Weight of a column around which loads are varied, in units of 4π²B/L²."""


def buckling_thrust(weight):
    """Least P at which θ″ + 4π² (P + w (1 − s)) θ = 0, θ(0) = 0 = θ′(1): by Airy's functions."""

    def determinant(thrust):
        scale = np.cbrt(4.0 * np.pi**2 * weight)
        foot, tip = (-4.0 * np.pi**2 * (thrust + weight * x) / scale**2 for x in (1.0, 0.0))
        (a, _, b, _), (_, slope_a, _, slope_b) = airy(foot), airy(tip)
        return slope_a * b - slope_b * a

    thrusts = 0.0625 - 0.33 * weight + np.linspace(-0.4, 0.4, 401) * (0.1 + abs(weight))
    signs = np.sign([determinant(thrust) for thrust in thrusts])
    first = np.flatnonzero(signs[1:] != signs[:-1])[0]
    return brentq(determinant, thrusts[first], thrusts[first + 1], xtol=1e-15)


def column(kind, elements):
    """A column, clamped below, under thrust at its top and its weight."""
    options = {"ends": ("clamped", "free"), "elements": elements}
    if kind == "space":
        return em.SpatialRod(torsion=0.77, lateral=3.0, loads=THRUST, **options)
    loads = {"P": em.PointForce(1.0, (-1.0, 0.0)), "w": em.LineLoad(direction=(-1.0, 0.0))}
    return em.Rod(loads=loads, **options)


@pytest.mark.parametrize(
    ("kind", "elements"), [("space", 12), ("space", 60), ("plane", 12), ("plane", 60)]
)
def test_a_pair_of_buckling_loads_inside_a_step_is_found_however_many_the_elements(kind, elements):
    """Chords of the convex region in which a column stands: the index is 1 but between two loads.

    Half widths from 3 % to a third of the largest step; with 60 elements determinants are beyond
    the range of numbers. 1e-7: elements of degree 6, and as searches for events end.
    """
    rod, generator = column(kind, elements), np.random.default_rng(8)
    state = rod.natural_state()
    thrust, weight = ([each.name for each in rod.parameters].index(name) for name in "Pw")
    half, ways = 10.0 ** generator.uniform(-2.5, -1.0, 12), generator.uniform(0.3, 1.2, (2, 12))
    start, velocity = state.p + np.zeros((12, 1)), np.zeros((12, len(state.p)))
    ends = HEAVY - half, HEAVY + half
    low, high = (np.array([buckling_thrust(w) for w in end]) for end in ends)
    steep = (high - low) / (2.0 * half)
    start[:, weight], start[:, thrust] = ends[0] - ways[0], low - steep * ways[0]
    velocity[:, weight] = 2.0 * half + ways.sum(axis=0)
    velocity[:, thrust] = steep * velocity[:, weight]
    wanted = np.stack([ways[0], ways[0] + 2.0 * half], axis=1) / velocity[:, weight, None]
    curve, z = ParameterLine(rod, start, velocity), np.repeat(state.z[None], 12, axis=0)
    through = TraceOptions(through_folds=True, through_branch_points=True, record=False)
    passed = trace(curve, z, options=through).passed
    order = np.lexsort((passed.t, passed.lanes))
    assert passed.lanes[order].tolist() == np.arange(12).repeat(2).tolist()
    assert passed.t[order].reshape(12, 2) == pytest.approx(wanted, abs=1e-7)
