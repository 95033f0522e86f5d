"""The corrector for points with conditions, on forms known in closed form."""

import sys

import numpy as np
import pytest

import equimorph as em
from equimorph.equilibria.critical_tests import cubic, gap, quadratic
from equimorph.equilibria.newton_step import Problem
from equimorph.equilibria.onto_set import STEEPEST, settle_onto
from equimorph.equilibria.point_conditions import Crossing, Fold, Plane, Values, Vanishing
from equimorph.equilibria.settle import (
    Guards,
    Held,
    Planes,
    Status,
    Tangents,
    _by_steps,
    free_directions,
    lower_index,
    settle,
)
from oracles.polynomial import (
    Polynomial,
    bead_on_a_circle,
    fold_form,
    pitchfork_form,
    slaved,
    transcritical_form,
)

ROUND_OFF = 1e-10


def held(form, z, p, place):
    """The plane on which one parameter keeps its value."""
    by_p = np.zeros((len(z), 1, p.shape[1]))
    by_p[:, 0, place] = 1.0
    return Plane(z, p, np.zeros((len(z), 1, form.size)), by_p)


def guesses(z, p, lanes=12, spread=0.1):
    """Many guesses near a point."""
    generator = np.random.default_rng(0)
    shifts = (generator.uniform(-spread, spread, (lanes, len(each))) for each in (z, p))
    return tuple(np.array(each) + shift for each, shift in zip((z, p), shifts, strict=True))


@pytest.fixture(scope="module")
def swallowtail():
    """x⁴ + a x² + b x + c = 0 [PostonStewart1978]_."""
    return Polynomial(
        lambda x, a, b, c: x**5 * 0.2 + a * x**3 * (1 / 3) + b * x**2 * 0.5 + c * x,
        1,
        ("a", "b", "c"),
    )


def test_roots_at_fixed_parameters_are_those_of_the_polynomial():
    """x² = a."""
    a = np.linspace(0.5, 4.0, 9)[:, None]
    found = settle(fold_form(), a, a)
    assert found.found.all()
    assert np.allclose(found.z, np.sqrt(a), atol=ROUND_OFF)
    assert (found.index == 0).all()


@pytest.mark.parametrize("frame", [Tangents(), Held()])
def test_fixed_parameters_equal_held_ones(frame):
    """A rod's fused Newton step against the bordered system with all parameters held."""
    arch = em.Rod(load="uniform")
    rest = arch.natural_state(Theta=0.9, Delta=0.0)
    end = em.lift(rest, to={"q": 2.0, "Delta": 0.1}).end.state
    z = np.tile(end.z, (5, 1)) + 1e-2 * np.cos(np.arange(5 * arch.size)).reshape(5, -1)
    p = np.tile(end.p, (5, 1))
    hold = held(arch, z, p, 1)
    plain = settle(arch, z, p)
    whole = settle(arch, z, p, frame=frame)
    assert np.array_equal(plain.z, whole.z)
    assert np.array_equal(plain.index, whole.index)
    assert np.array_equal(plain.first, whole.first)
    general = settle(arch, z, p, free_directions(arch, np.array([1]), 5), [hold], frame=frame)
    assert plain.found.all()
    assert general.found.all()
    assert np.abs(plain.z - general.z).max() < 1e-9
    assert np.abs(plain.p - general.p).max() < 1e-13
    assert np.array_equal(plain.index, general.index)


@pytest.mark.parametrize("kind", ["fixed", "held", "plane"])
def test_one_plane_by_fused_steps_equals_the_general_corrector(kind):
    """The compiled iteration against the general one, from guesses of which some fail."""
    arch, lanes = em.Rod(load="uniform"), 40
    end = em.lift(arch.natural_state(Theta=0.9, Delta=0.1), to={"q": 2.0}).end.state
    generator = np.random.default_rng(2)
    off = np.geomspace(1e-3, 30.0, lanes)[:, None]
    z = end.z + off * generator.uniform(-1.0, 1.0, (lanes, arch.size))
    p = np.tile(end.p, (lanes, 1))
    directions = np.zeros((lanes, 0 if kind == "fixed" else 1, 4))
    directions[:, :, 2] = 0.3
    frame = Held()
    if kind == "plane":
        by_z, by_p = generator.normal(size=(lanes, 1, arch.size)), np.ones((lanes, 1, 4))
        frame = Planes(by_z, by_p)
    guards = Guards(iterations=12, longest=0.6, too_long=np.linspace(4.0, 8.0, lanes),
                    contraction=0.9, free=3, following=1e-13)  # fmt: skip
    free = None if kind == "fixed" else directions
    fused = settle(arch, z, p, free, guards=guards, frame=frame)
    general = _by_steps(Problem(arch, directions, (), frame), z, p, guards)
    assert 0 < fused.found.sum() < lanes
    assert np.array_equal(fused.status, general.status)
    good = fused.found
    assert np.array_equal(fused.index[good], general.index[good])
    for name in ("z", "p", "size", "first", "frames"):
        one, other = (getattr(each, name)[good] for each in (fused, general))
        assert np.allclose(one, other, rtol=1e-6, atol=1e-9), name


def test_steps_in_lanes_that_seek_a_sheet_need_not_contract_on_it():
    """Newton for x² = a begins with steps that grow: lanes of the index sought go on."""
    z, p = np.array([[0.3], [0.3]]), np.full((2, 1), 4.0)
    guards = Guards(longest=np.inf, contraction=0.0, free=1, exempt=np.array([0, 1]))
    found = settle(fold_form(), z, p, guards=guards)
    assert found.status.tolist() == [Status.FOUND, Status.NOT_SHRINKING]
    assert abs(found.z[0, 0] - 2.0) < ROUND_OFF


def test_folds_of_the_cusp_form_have_no_discriminant():
    """x³ − a x = b folds at 27 b² = 4 a³; a is held, b is found."""
    form = slaved(pitchfork_form(1.0), 2.0, 0.3)
    z, p = guesses([-1.0, 0.3], [3.0, 2.0])
    directions = free_directions(form, np.array([0, 1]), len(z))
    found = settle(form, z, p, directions, [Fold(), held(form, z, p, 0)])
    assert found.found.all()
    a, b = found.p.T
    assert np.abs(27 * b**2 - 4 * a**3).max() < 1e-9
    assert np.allclose(a, p[:, 0], rtol=0, atol=1e-12)
    assert (lower_index(form, found.z, found.p) == 0).all()


def test_folds_with_a_multiplier_lie_on_the_astroid():
    """h^⅔ + g^⅔ = 1 for the bead on a circle [StonerWohlfarth1948]_."""
    form = bead_on_a_circle()
    angle = 0.7
    z = np.array([np.cos(angle), np.sin(angle), 0.0])
    h, g = np.cos(angle) ** 3, -(np.sin(angle) ** 3)
    z[2] = h / z[0] - 1.0
    z, p = guesses(z, [h, g], spread=0.02)
    directions = free_directions(form, np.array([0, 1]), len(z))
    found = settle(form, z, p, directions, [Fold(), held(form, z, p, 0)])
    assert found.found.all()
    size = np.abs(found.p) ** (2 / 3)
    assert np.allclose(size.sum(axis=1), 1.0, atol=1e-9)


def test_cusp_and_swallowtail_are_at_the_origin(swallowtail):
    """x³ − a x = b has its cusp there, x⁴ + a x² + b x + c its swallowtail."""
    form = pitchfork_form(1.0)
    z, p = guesses([0.0], [0.0, 0.0])
    directions = free_directions(form, np.array([0, 1]), len(z))
    vanishing = Vanishing(lambda some: (gap, quadratic), np.arange(len(z)))
    found = settle(form, z, p, directions, [vanishing])
    assert found.found.all()
    assert max(np.abs(found.z).max(), np.abs(found.p).max()) < ROUND_OFF
    z, p = guesses([0.0], [0.0, 0.0, 0.0])
    directions = free_directions(swallowtail, np.arange(3), len(z))
    vanishing = Vanishing(lambda some: (gap, quadratic, cubic), np.arange(len(z)))
    found = settle(swallowtail, z, p, directions, [vanishing])
    assert found.found.all()
    assert max(np.abs(found.z).max(), np.abs(found.p).max()) < 1e-8


@pytest.mark.parametrize("form", [pitchfork_form(1.0), pitchfork_form(-1.0), transcritical_form()])
def test_branch_points_are_found_with_the_border_as_an_unknown(form):
    """Paths in a branch at the origin; the second parameter of the pitchfork is zero."""
    z, p = guesses([0.0], np.zeros(len(form.parameters)))
    p[:, 1:] = 0.0
    directions = free_directions(form, np.array([0]), len(z))
    found = settle(form, z, p, directions, [Crossing(directions)], frame=Tangents(unfolded=True))
    assert found.found.all()
    assert max(np.abs(found.z).max(), np.abs(found.p).max()) < ROUND_OFF
    assert np.abs(found.unfolding).max() < ROUND_OFF


def test_an_imperfect_branch_point_shows_its_unfolding():
    """x³ − a x = b with b = 0.01: the branch point of F + βb exists, β is not zero."""
    form = pitchfork_form(1.0)
    z, p = guesses([0.0], [0.0, 0.0])
    p[:, 1] = 0.01
    directions = free_directions(form, np.array([0]), len(z))
    found = settle(form, z, p, directions, [Crossing(directions)], frame=Tangents(unfolded=True))
    assert found.found.all()
    assert np.allclose(np.abs(found.unfolding), 0.01)


def test_amplitudes_beside_a_branch_point_are_prescribed_with_a_kept_border():
    """x³ − a x − b = −β at x = 0.2: the residual of the reduced equation."""
    form = pitchfork_form(1.0)
    z, p, border = np.zeros((1, 1)), np.array([[0.3, 0.01]]), np.ones((1, 1))
    plane = Plane(z + 0.2, p, border[:, None], np.zeros((1, 1, 2)))
    found = settle(form, z, p, None, [plane], frame=Tangents(unfolded=True, border=border))
    assert found.found.all()
    assert np.isclose(found.unfolding[0], -(0.2**3 - 0.3 * 0.2 - 0.01), atol=1e-14)


def test_descriptors_take_their_values_on_a_fold():
    """x² = a with b = x: a corner of the fold's parameter and a value."""
    form = pitchfork_form(1.0)
    x = np.linspace(0.4, 0.9, 7)
    z, p = (x + 0.05)[:, None], np.stack([3 * x**2, -2 * x**3 + 0.02], axis=1)
    directions = free_directions(form, np.array([0, 1]), len(x))
    value = Values((lambda z, p: z[:, 0],), x[:, None])
    found = settle(form, z, p, directions, [Fold(), value])
    assert found.found.all()
    assert np.allclose(found.z[:, 0], x, atol=ROUND_OFF)
    assert np.allclose(found.p, np.stack([3 * x**2, -2 * x**3], axis=1), atol=1e-9)


@pytest.mark.parametrize("frame", [Tangents(), Held()])
def test_with_directions_to_spare_the_step_is_the_shortest(frame):
    """z = x + y on the plane u = x + y: from the origin to u = 1 by x = y = ½."""
    form = Polynomial(lambda u, x, y: u**2 * 0.5 - u * x - u * y, 1, ("x", "y"))
    value = Values((lambda z, p: z[:, 0],), np.ones((1, 1)))
    directions = free_directions(form, np.array([0, 1]), 1)
    start = np.zeros((1, 1)), np.zeros((1, 2))
    found = settle(form, *start, directions, [value], frame=frame)
    assert found.found.all()
    assert np.allclose(found.p, 0.5, atol=1e-9)


def test_planes_keep_the_coordinates_that_they_hold():
    """Arclength: the point of x² = a on a line through (1.1, 1) across the curve."""
    form = fold_form()
    z, p = np.array([[1.1]]), np.array([[1.0]])
    rows = np.array([[[1.0]]]), np.array([[[2.0]]])
    directions = free_directions(form, np.array([0]), 1)
    frame = Planes(*rows)
    found = settle(form, z, p, directions, [Plane(z, p, *rows)], frame=frame)
    assert found.found.all()
    assert np.isclose(found.z[0, 0] ** 2, found.p[0, 0], atol=1e-12)
    assert np.isclose(found.z[0, 0] - 1.1 + 2.0 * (found.p[0, 0] - 1.0), 0.0, atol=1e-12)


def test_known_solutions_are_avoided():
    """x³ = x: from 0.9 the roots 1, and then the others."""
    form = Polynomial(lambda x, a: x**4 * 0.25 - x**2 * 0.5 + 0.0 * a, 1, ("a",))
    start, p, roots = np.array([[0.9]]), np.zeros((1, 1)), []
    found = settle(form, start, p, guards=Guards(iterations=60, longest=0.7))
    while found.found[0]:
        roots.append(found.z[0, 0])
        known = np.array(roots)[None, :, None]
        found = settle(form, start, p, guards=Guards(iterations=30, longest=0.7, known=known))
    assert np.allclose(sorted(roots), [-1.0, 0.0, 1.0], atol=1e-12)


def test_a_known_solution_at_which_a_lane_begins_is_found_again():
    """x³ = x from x = 1: there is no side to which it could be pushed."""
    form = Polynomial(lambda x, a: x**4 * 0.25 - x**2 * 0.5 + 0.0 * a, 1, ("a",))
    start, p = np.array([[1.0]]), np.zeros((1, 1))
    found = settle(form, start, p, guards=Guards(known=np.array([[[1.0], [-1.0]]])))
    assert found.found[0]
    assert found.z[0, 0] == pytest.approx(1.0, abs=1e-12)


def test_a_lane_pushed_without_end_is_singular():
    """Of (1 + 1/x²) x from x = 1 on: the derivative vanishes, and nothing else is there."""
    form = Polynomial(lambda x, a: x**2 * 0.5 + 0.0 * a, 1, ("a",))
    guards = Guards(known=np.zeros((1, 1, 1)))
    found = settle(form, np.array([[1.0]]), np.zeros((1, 1)), guards=guards)
    assert found.status[0] == Status.SINGULAR


def test_rows_of_nan_stand_for_no_known_solution():
    form = Polynomial(lambda x, a: x**4 * 0.25 - x**2 * 0.5 + 0.0 * a, 1, ("a",))
    start, p = np.array([[0.9], [1.3]]), np.zeros((2, 1))
    found = settle(form, start, p, guards=Guards(known=np.full((2, 3, 1), np.nan)))
    assert found.found.all()
    assert np.allclose(found.z, settle(form, start, p).z, atol=1e-12)


CASES = [
    (Guards(), 1.0, Status.FOUND),
    (Guards(iterations=2), 9.0, Status.UNFINISHED),
    (Guards(), 0.0, Status.SINGULAR),
    (Guards(too_long=0.5), 9.0, Status.TOO_LONG),
    (Guards(contraction=0.3), 9.0, Status.NOT_SHRINKING),
    (Guards(contraction=0.3, free=30), 9.0, Status.FOUND),
    (Guards(trust=np.array([0.5])), 9.0, Status.FAR),
    (Guards(index=np.array([1])), 1.5, Status.WRONG_INDEX),
    (Guards(index=np.array([0])), 1.5, Status.FOUND),
    (Guards(within=(fold_form().descriptor("0") <= 0.9,)), 1.5, Status.VIOLATED),
]


@pytest.mark.parametrize(("guards", "start", "status"), CASES)
def test_lanes_say_why_they_ended(guards, start, status):
    """x² = 1 from various starts: singular at zero, slow from far away."""
    found = settle(fold_form(), np.array([[start]]), np.ones((1, 1)), guards=guards)
    assert found.status[0] == status


def test_a_fold_of_another_index_is_refused():
    form = pitchfork_form(1.0)
    z, p = np.array([[-1.0]]), np.array([[3.0, 2.0]])
    directions = free_directions(form, np.array([0, 1]), 1)
    conditions = [Fold(), held(form, z, p, 0)]
    for low, status in ((0, Status.FOUND), (1, Status.WRONG_INDEX)):
        guards = Guards(lower_index=np.array([low]))
        assert settle(form, z, p, directions, conditions, guards).status[0] == status


def test_a_lane_that_fails_leaves_the_others_as_they_are():
    """Each lane ends where it would end alone; no state is not a number."""
    form = pitchfork_form(1.0)
    x = np.array([0.5, 0.0, 0.8, 0.3])
    z, p = x[:, None], np.stack([3 * x**2 + 0.1, -2 * x**3], axis=1)
    p[1] = np.nan
    conditions = [Fold(), held(form, z, p, 0)]
    directions = free_directions(form, np.array([0, 1]), 4)
    whole = settle(form, z, p, directions, conditions)
    assert whole.found.tolist() == [True, False, True, True]
    assert whole.status[1] == Status.SINGULAR
    for lane in (0, 2, 3):
        own = slice(lane, lane + 1)
        mine = [Fold(), held(form, z[own], p[own], 0)]
        alone = settle(form, z[own], p[own], directions[own], mine)
        assert np.allclose(alone.z, whole.z[own], rtol=0, atol=1e-13)


def test_batches_do_not_change_results(monkeypatch):
    """Lanes of which some fail, on folds and pushed away from known solutions, eight at a time."""
    form, lanes = pitchfork_form(1.0), 43
    generator = np.random.default_rng(5)
    z, p = generator.normal(size=(lanes, 1)), generator.normal(size=(lanes, 2))
    directions = free_directions(form, np.array([0, 1]), lanes)
    guards = Guards(iterations=8, too_long=generator.uniform(1.0, 9.0, lanes))
    pushed = Guards(iterations=8, known=generator.normal(size=(lanes, 2, 1)))

    def both():
        conditions = [Fold(), held(form, z, p, 0)]
        return [settle(form, z, p, directions, conditions, guards),
                settle(form, z, p, None, (), pushed)]  # fmt: skip

    whole = both()
    module = sys.modules[settle.__module__]
    monkeypatch.setattr(module, "BATCH", 1)
    monkeypatch.setattr(module, "FEWEST", 8)
    for one, other in zip(whole, both(), strict=True):
        assert 0 < one.found.sum() < lanes
        for name, values in vars(one).items():
            np.testing.assert_allclose(getattr(other, name), values, 1e-9, 1e-9, err_msg=name)


def test_no_lanes_are_no_trouble():
    form = pitchfork_form(1.0)
    none = np.zeros((0, 1)), np.zeros((0, 2))
    assert len(settle(form, *none).z) == 0
    directions = free_directions(form, np.array([0]), 0)
    assert len(settle(form, *none, directions, [Fold()]).found) == 0


@pytest.mark.parametrize("iterations", [1, 12])
@pytest.mark.parametrize("in_planes", [False, True])
@pytest.mark.parametrize("at_fold", [False, True])
def test_steps_onto_the_set_by_responses_are_those_of_the_bordered_system(
    in_planes, at_fold, iterations
):
    """Of the arch, and at its fold, where tangents over parameters are steep.

    Bordered solves are regular there, too. 1e-9: tangents of up to 1e3 lose three digits. Lanes
    that end early leave the others as they are, bit for bit.
    """
    arch, generator = em.Rod(load="uniform"), np.random.default_rng(5)
    natural = arch.natural_state(Theta=0.9, Delta=0.02)
    here = em.limit_load(natural, "q").state if at_fold else em.lift(natural, {"q": 2.0}).end.state
    off = np.geomspace(1e-7, 1e-7 if iterations == 1 else 1e-2, 24)[:, None]
    z = here.z + off * generator.normal(size=(24, arch.size))
    p, free = np.tile(here.p, (24, 1)), np.array([0, 2])
    rows = generator.normal(size=(24, 2, arch.size)) / arch.size, np.zeros((24, 2, 4))
    rows[1][:, 0, 0] = rows[1][:, 1, 2] = 1.0
    frame = Planes(*rows) if in_planes else Tangents()
    problem, guards = Problem(arch, free_directions(arch, free, 24), (), frame), Guards(iterations)
    (found, sure), exact = settle_onto(problem, z, p, guards), _by_steps(problem, z, p, guards)
    response = arch.respond(z[:1], p[:1], problem.directions[:1])
    assert problem.onto_set
    assert (np.abs(response.tangents).max() > STEEPEST) == at_fold
    np.testing.assert_array_equal(found.status, exact.status)
    good = found.status == (Status.UNFINISHED if iterations == 1 else Status.FOUND)
    assert good.sum() >= 22  # some planes are not near the tangent spaces
    np.testing.assert_array_equal(found.index, exact.index)
    np.testing.assert_array_equal(sure, exact.sure)
    for name, other in (("z", exact.z), ("p", exact.p), ("tangents", exact.frames)):
        mine = getattr(found, name)
        np.testing.assert_allclose(mine[good], other[good], rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(found.first, exact.first, rtol=1e-8, atol=1e-14)
    some = np.array([3, 17])
    alone, _ = settle_onto(problem.take(some), z[some], p[some], guards)
    for one, other in zip(vars(alone).values(), vars(found).values(), strict=True):
        np.testing.assert_array_equal(one, other[some])
