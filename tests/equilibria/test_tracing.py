"""The marching of many lanes."""

from dataclasses import replace

import numpy as np
import pytest

import equimorph as em
from equimorph.equilibria import ParameterLine, TraceOptions, trace
from equimorph.equilibria.curves import AlongCurve, along_parameters, dual
from equimorph.equilibria.locate import locate_branch_point
from equimorph.equilibria.point_conditions import Plane
from equimorph.equilibria.settle import settle
from equimorph.equilibria.steps import Bracket, Front, step_along, unit_tangents
from equimorph.equilibria.trace import Batching, Onwards
from equimorph.equilibria.trace_options import EventCode
from equimorph.structures import States
from oracles.polynomial import Polynomial, fold_form, pitchfork_form


def initial_front(curve, z, t):
    """Unit tangents at known points, pointing towards growing t."""
    step = curve.advance(z, t, np.zeros_like(z), np.ones(len(z)), np.zeros(len(z)))
    return unit_tangents(curve, Front(z + step.dz, t, step.tangent_z, step.tangent_t, step.index))


def lines(structure, z, start, stop):
    start, stop = np.array(start, float), np.array(stop, float)
    return ParameterLine(structure, start, stop - start), np.array(z, float)


def test_tangents_point_towards_growing_t_and_have_unit_length():
    """x² = a: dx/da = 1/(2x); metric |dx|² + |da|²."""
    curve, z = lines(fold_form(), [[1.0], [-2.0]], [[1.0], [4.0]], [[0.0], [6.0]])
    front = initial_front(curve, z, np.zeros(2))
    assert (front.tangent_t > 0).all()
    slope = np.array([-1.0, 2.0])
    assert front.tangent_z[:, 0] / front.tangent_t == pytest.approx(slope / (2 * z[:, 0]))
    length = front.tangent_z[:, 0] ** 2 + (slope * front.tangent_t) ** 2
    assert length == pytest.approx(np.ones(2), rel=1e-14)
    assert front.index.tolist() == [0, 1]


def test_lanes_do_not_influence_each_other():
    """Six lanes together end as each of them alone: arrivals, a fold, a branch point."""
    arch = em.Rod(elements=6, degree=6)
    rest = [arch.natural_state(Theta=T, Delta=D) for T, D in ((0.9, 0), (0.9, 0.02), (1.2, 0.3))]
    z = np.array([state.z for state in rest] * 2)
    start = np.array([state.p for state in rest] * 2)
    velocity = np.zeros_like(start)
    velocity[:3, 2], velocity[3:, 2] = 8.0, 1.0
    whole = trace(ParameterLine(arch, start, velocity), z)
    assert whole.code.tolist() == [
        EventCode.BRANCH_POINT,
        EventCode.FOLD,
        EventCode.FOLD,
        EventCode.ARRIVED,
        EventCode.ARRIVED,
        EventCode.ARRIVED,
    ]
    for i in range(6):
        alone = trace(ParameterLine(arch, start[i : i + 1], velocity[i : i + 1]), z[i : i + 1])
        assert alone.code[0] == whole.code[i]
        assert np.abs(alone.z[0] - whole.z[i]).max() < 1e-12
        assert alone.t[0] == pytest.approx(whole.t[i], rel=1e-13)


@pytest.mark.parametrize("largest", [0.5, 0.1, 0.02])
@pytest.mark.parametrize("x", [0.0, 0.3])
def test_lifts_that_locate_no_branch_points_are_lost_at_them_and_arrive_as_before(largest, x):
    """x³ = a x on x = 0 through the pitchfork at a = 0; the side branches lead away from it."""
    structure, a = pitchfork_form(1.0), x**2 if x else -1.0
    line, z = lines(structure, [[x]], [[a, 0.0]], [[2.0, 0.0]])
    located, refused = (
        trace(line, z, options=TraceOptions(largest_step=largest, locate_jumps=each))
        for each in (True, False)
    )
    ends = [EventCode.BRANCH_POINT, EventCode.LOST] if x == 0.0 else [EventCode.ARRIVED] * 2
    assert [located.code[0], refused.code[0]] == ends
    if x:
        assert np.array_equal(located.z, refused.z)
    else:
        assert refused.t[0] * 3.0 - 1.0 == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize("bound", [-0.001, -0.01, -0.1, -0.5, -2.0])
def test_lanes_end_the_same_where_folds_on_the_way_are_not_located(bound):
    """x² = a falling through the fold at a = 0, to a bound on x behind it or back to the start."""
    structure = fold_form()
    line, z = lines(structure, [[1.0]] * 3, [[1.0]] * 3, [[-1.0], [-0.1], [-0.001]])
    within = (structure.descriptor("0") >= bound,)
    options = TraceOptions(through_folds=True, through_branch_points=True)
    located, plain = (
        trace(line, z, within, replace(options, locate_folds=each)) for each in (True, False)
    )
    for name in ("code", "z", "t", "index", "travelled"):
        assert np.array_equal(getattr(located, name), getattr(plain, name))
    assert located.index.tolist() == [1, 1, 1]
    assert located.passed.lanes.tolist() == [0, 1, 2]
    same_step = bound > -0.1
    assert plain.passed.lanes.tolist() == ([0, 1, 2] if same_step else [])


def test_one_lost_lane_does_not_sink_the_batch():
    """The second lane starts at a fold, where nothing leads on."""
    curve, z = lines(fold_form(), [[1.0], [0.0]], [[1.0], [0.0]], [[4.0], [1.0]])
    outcome = trace(curve, z)
    assert outcome.code.tolist() == [EventCode.ARRIVED, 0]
    assert "singular" in outcome.why[1]
    assert outcome.z[0, 0] == pytest.approx(2.0, rel=1e-14)


def test_every_goal_is_arrived_at_wherever_the_last_step_ends():
    """x² = a from 1 to 2000 goals: Newton's last correction takes any size below its tolerance."""
    goals = np.linspace(1.2, 9.0, 2000)[:, None]
    ones = np.ones_like(goals)
    curve, z = lines(fold_form(), ones, ones, goals)
    outcome = trace(curve, z, options=TraceOptions(record=False, retries=0))
    assert (outcome.code == EventCode.ARRIVED).all()
    assert outcome.why == {}
    assert outcome.z == pytest.approx(np.sqrt(goals), rel=1e-14)


def test_recorded_points_keep_the_names_of_their_lanes():
    curve, z = lines(pitchfork_form(1.0), [[0.0], [1.0]], [[-1.0, 0], [1, 0]], [[1.0, 0], [4, 0]])
    outcome = trace(curve, z)
    assert outcome.code.tolist() == [EventCode.BRANCH_POINT, EventCode.ARRIVED]
    points = outcome.points
    assert points.z[points.lanes == 0] == pytest.approx(0.0, abs=1e-14)
    assert (points.z[points.lanes == 1] >= 1.0).all()
    for lane in range(2):
        assert (np.diff(points.travelled[points.lanes == lane]) > 0.0).all()


def test_length_of_a_path_is_its_length_in_the_metric():
    """Straight branch x = 0: |da| = 2. Curved: x² = a from 1 to 4, by elliptic-free quadrature.

    Tolerance: chords of steps ≤ 0.02 miss the arc by their square.
    """
    form = fold_form()
    path = em.lift(form.state(1.0, a=1.0), {"a": 4.0}, options=TraceOptions(largest_step=0.02))
    x, w = np.polynomial.legendre.leggauss(30)
    x = 1.5 + 0.5 * x
    exact = 0.5 * w @ np.sqrt(1 + 4 * x**2)
    assert path.length[-1] == pytest.approx(exact, rel=1e-4)


def outcome_columns(outcome):
    """What an outcome says of each lane, and its points, to be compared bit for bit."""
    points = outcome.points
    per_point = np.column_stack([points.travelled, points.z, points.t, points.index])
    return (outcome.code, outcome.z, outcome.t, outcome.index, outcome.travelled), [
        per_point[points.lanes == lane] for lane in range(len(outcome.code))
    ]


@pytest.mark.parametrize(
    "batching",
    [Batching(threads=1), Batching(threads=2), Batching(capacity=9), Batching(capacity=61)],
    ids=["one thread", "two threads", "few at once", "some at once"],
)
def test_results_are_the_same_bit_for_bit_in_any_order_on_any_number_of_threads(batching):
    """300 rays in q with folds, branch points, constraints and arrivals among their ends."""
    arch = em.Rod(elements=6, degree=6)
    Theta, Delta = np.meshgrid(np.linspace(0.5, 1.3, 20), np.linspace(0.0, 0.4, 15))
    start = np.zeros((300, 4))
    start[:, 0], start[:, 1], start[:, 3] = Theta.ravel(), Delta.ravel(), np.sin(1.0)
    z, found = arch.natural(start)
    assert found.all()
    velocity = np.zeros_like(start)
    velocity[:, 2] = np.where(np.arange(300) % 3 == 0, 2.0, 8.0)
    within = (arch.max_curvature <= 5.0,)
    order = np.random.default_rng(2).permutation(300)
    back = np.argsort(order)
    columns, points = outcome_columns(trace(ParameterLine(arch, start, velocity), z, within))
    assert set(columns[0].tolist()) == {
        EventCode.ARRIVED,
        EventCode.FOLD,
        EventCode.BRANCH_POINT,
        EventCode.CONSTRAINT,
    }
    line = ParameterLine(arch, start[order], velocity[order])
    other, others = outcome_columns(trace(line, z[order], within, batching=batching))
    for a, b in zip(columns, other, strict=True):
        assert np.array_equal(a, b[back])
    for lane in range(300):
        assert np.array_equal(points[lane], others[back[lane]])


@pytest.mark.parametrize("batching", [Batching(threads=1), Batching(threads=2), Batching(9)])
def test_lanes_that_begin_where_others_end_are_the_same_bit_for_bit(batching):
    """300 rays in q, and from those that arrive on to other shortenings."""
    arch = em.Rod(elements=6, degree=6)
    Theta, Delta = np.meshgrid(np.linspace(0.5, 1.3, 20), np.linspace(0.01, 0.4, 15))
    start = np.zeros((600, 4))
    start[:, 0], start[:, 1] = np.tile(Theta.ravel(), 2), np.tile(Delta.ravel(), 2)
    start[:, 3] = np.sin(1.0)
    velocity = np.zeros_like(start)
    velocity[:300, 2], velocity[300:, 3] = 3.0, -0.3
    start[300:, 2] = 3.0
    z, found = arch.natural(start * [1, 1, 0, 1])
    assert found.all()
    line, given = ParameterLine(arch, start, velocity), []

    def follow(ended, code, there):
        going = (code == EventCode.ARRIVED) & (ended < 300)
        given.append(ended[going] + 300)
        return given[-1], there[going]

    whole = trace(line, z, batching=batching, onwards=Onwards(300, follow))
    first = trace(line.take(np.arange(300)), z[:300])
    going = np.flatnonzero(first.code == EventCode.ARRIVED)
    assert 0 < len(going) < 300
    assert np.array_equal(np.sort(np.concatenate(given)), going + 300)
    second = trace(line.take(going + 300), first.z[going])
    for rows, part in ((np.arange(300), first), (going + 300, second)):
        columns, points = outcome_columns(whole)
        wanted, others = outcome_columns(part)
        for a, b in zip(columns, wanted, strict=True):
            assert np.array_equal(a[rows], b)
        for own, row in enumerate(rows):
            assert np.array_equal(points[row], others[own])


def test_progress_is_reported_and_an_error_of_the_sink_cancels():
    """Raising from the sink stops all threads at once and reaches the caller."""

    class Impatient:
        def __init__(self):
            self.seen = []

        def report(self, stage, done, total):
            self.seen.append((stage, done, total))
            raise TimeoutError

    arch = em.Rod(elements=6, degree=6)
    rest = arch.natural_state(Theta=0.9)
    start, velocity = np.tile(rest.p, (20000, 1)), np.zeros((20000, 4))
    velocity[:, 2] = 8.0
    sink = Impatient()
    with pytest.raises(TimeoutError):
        trace(ParameterLine(arch, start, velocity), np.tile(rest.z, (20000, 1)), progress=sink)
    [(stage, done, total)] = sink.seen
    assert stage == "tracing lanes"
    assert 0 <= done < total == 20000


def test_lanes_whose_steps_end_next_to_the_goal_arrive_there():
    """Newton's method takes them from within 1e-9 of it; those farther away are lost.

    A smallest step above the second one makes lanes end after the first.
    """
    rest = em.Spring().natural_state(x_l=1.5)
    first = em.lift(rest, {"F": 0.5}).states["F"][1]
    options = TraceOptions(smallest_step=0.2)
    for excess, kind in ((5e-11, "arrived"), (1e-6, "lost")):
        goal = first * (1.0 + excess)
        many = em.lift(States(rest.structure, *(np.tile(x, (3, 1)) for x in (rest.z, rest.p))),
                       {"F": goal}, options=options)  # fmt: skip
        alone = em.lift(rest, {"F": goal}, options=options).end
        assert set(many.kind.tolist()) == {alone.kind} == {kind}
    there = em.lift(rest, {"F": first * (1.0 + 5e-11)}, options=options).end.state
    assert there["F"] == first * (1.0 + 5e-11)
    assert there.residual < 1e-14


def test_points_at_a_length_are_those_of_the_corrector_for_points_with_conditions():
    """The compiled corrector of lifts: F = 0 on the plane at a length along the tangent."""
    rod = em.Rod(load="uniform")
    p = np.stack(
        [np.linspace(0.6, 1.4, 9), np.full(9, 0.1), np.zeros(9), np.full(9, np.sin(1.0))], 1
    )
    z, _ = rod.natural(p)
    line = ParameterLine(rod, p, np.tile([0.0, 0.0, 2.0, 0.0], (9, 1)))
    front, length = initial_front(line, z, np.zeros(9)), np.full(9, 0.05)
    there, good = step_along(line, front, length)
    assert good.all()

    row, corner = dual(rod, line.weight, front.tangent_z, front.tangent_t)
    ahead = front.z + length[:, None] * front.tangent_z, along_parameters(length * front.tangent_t)
    by_t = np.stack([corner, np.zeros(9)], 1)[:, None]
    plane, directions = Plane(*ahead, row[:, None], by_t), np.tile([[[1.0, 0.0]]], (9, 1, 1))
    found = settle(AlongCurve(line), *ahead, directions, [plane])
    assert found.found.all()
    assert np.abs(found.z - there.z).max() < 1e-13
    assert np.abs(found.p[:, 0] - there.t).max() < 1e-13


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
@pytest.mark.parametrize("offset", [0.0, 1e-4])
def test_branch_points_exist_or_not_in_any_unit_of_energy(scale, offset):
    """s (x³ − a x) = s b: curves cross at the origin for b = 0, else pass at a distance of √2b."""
    form = Polynomial(lambda x, a, b: (x**4 * 0.25 - a * x**2 * 0.5 - b * x) * scale, 1, ("a", "b"))
    line = ParameterLine(form, np.array([[-0.1, offset]]), np.array([[0.2, 0.0]]))
    ends = [initial_front(line, np.array([[x]]), np.array([t]))
            for x, t in ((10.0 * offset, 0.0), (-10.0 * offset, 1.0))]  # fmt: skip
    length, lane = np.array([0.2]), np.array([0])
    found = locate_branch_point(line, Bracket(lane, *ends, length, length * 0.0, lane))
    assert found.found.tolist() == [offset == 0.0]
    if offset == 0.0:
        assert abs(found.t[0] - 0.5) < 1e-9
