"""Gradients of exact events by data of structures, against differences of the events themselves."""

import numpy as np
import pytest

import equimorph as em
from equimorph.tasks.designing.bounds import RouteExtreme
from equimorph.tasks.designing.family import DesignFamily
from equimorph.tasks.designing.pieces import follow_piece
from families import STRIP, TRUSS, arch, strip, truss
from typecheck import unchecked

STEP = 2e-4
"""Of differences of fourth order in scaled variables: they err by about 1e-10."""

SLANTED = {"k": ([-8.0] * 3, [8.0] * 3, [0.3] * 3), "b": ([0.4] * 3, [2.5] * 3, [1.0, 0.9, 1.2])}


def start_of(family, variables):
    made = DesignFamily.of(family, variables)
    return made, made.structure(made.start)


def arch_limit(cap=None):
    family, first = start_of(arch, SLANTED)
    within = [] if cap is None else [first.max_curvature <= cap]
    return family, em.LoadLimit(first.natural_state(Theta=0.9, Delta=0.1), "q", within)


def arch_value(of):
    family, first = start_of(arch, SLANTED)
    here = em.lift(first.natural_state(Theta=0.9, Delta=0.1), {"q": 1.0}).end.state
    return family, em.StateValue(here, of(first))


def strip_value(of):
    family, first = start_of(strip, STRIP)
    here = em.lift(first.natural_state(), {"P": 0.1, "H": 0.05}).end.state
    return family, em.StateValue(here, of(first))


def truss_limit(deepest=None):
    family, first = start_of(truss, TRUSS)
    within = [] if deepest is None else [first.displacement("B", "y") >= deepest]
    return family, em.LoadLimit(first.natural_state(), "F", within)


def truss_value(of):
    family, first = start_of(truss, TRUSS)
    here = em.lift(first.natural_state(), {"F": 0.001}).end.state
    return family, em.StateValue(here, of(first))


def work_of_both(rod):
    return em.function_of("both", lambda a, b: a * b, *efforts_of(rod))


def larger_effort(rod):
    return em.largest_of("larger", *map(abs, efforts_of(rod)))


def efforts_of(rod):
    return [em.effort_of(rod, name) for name in ("Theta", "Delta")]


CASES = {
    "fold of the arch": (arch_limit, 6),
    "curvature of the arch under load": (lambda: arch_limit(2.7), 6),
    "largest curvature": (lambda: arch_value(lambda a: em.peak(a.max_curvature)), 6),
    "margin of the arch": (lambda: arch_value(lambda a: em.least(em.margin_of(a))), 6),
    "effort of the arch": (lambda: arch_value(lambda a: em.peak(em.effort_of(a, "Delta"))), 6),
    "tip of the strip": (lambda: strip_value(lambda a: em.peak(a.height(1.0))), 3),
    "margin of the strip": (lambda: strip_value(lambda a: em.least(em.margin_of(a))), 3),
    "curvature of the strip": (lambda: strip_value(lambda a: em.peak(a.max_curvature)), 3),
    "fold of the truss": (truss_limit, 2),
    "margin of the truss": (lambda: truss_value(lambda a: em.least(em.margin_of(a))), 2),
    "other effort of the arch": (
        lambda: arch_value(lambda a: em.peak(em.effort_of(a, "Theta"))),
        6,
    ),
    "crown of the arch": (lambda: arch_value(lambda a: em.least(a.height(0.5))), 6),
    "quarter of the arch": (lambda: arch_value(lambda a: em.peak(a.height(0.25))), 6),
    "product of efforts": (lambda: arch_value(lambda a: em.peak(work_of_both(a))), 6),
    "larger effort": (lambda: arch_value(lambda a: em.peak(larger_effort(a))), 6),
    "middle of the strip": (lambda: strip_value(lambda a: em.peak(a.height(0.5))), 3),
    "effort of the strip": (lambda: strip_value(lambda a: em.peak(em.effort_of(a, "P"))), 3),
    "pull of the strip": (lambda: strip_value(lambda a: em.peak(em.effort_of(a, "H"))), 3),
    "effort of the truss": (lambda: truss_value(lambda a: em.peak(em.effort_of(a, "F"))), 2),
    "sinking of the truss": (lambda: truss_value(lambda a: em.least(a.displacement("B", "y"))), 2),
    "sinking of the truss under load": (lambda: truss_limit(-0.01), 2),
}


def assert_gradient_is_that_of_differences(piece, family, x, some):
    """Of the largest value, to 1e-6 of its largest derivative."""
    slopes, top = piece.slopes(family, x), int(piece.values.argmax())
    assert slopes.shape == (len(piece.values), len(x))
    for k in some:
        step = STEP * np.eye(len(x))[k]
        ends = [follow_piece(piece, family, x, x + h * step) for h in (1, -1, 2, -2)]
        values = [end.values[top] for end in ends]
        change = 8.0 * (values[0] - values[1]) - (values[2] - values[3])
        allowed = 1e-6 * np.abs(slopes[top]).max()
        assert slopes[top, k] == pytest.approx(change / (12.0 * STEP), abs=allowed)


FAST = ("fold of the arch", "fold of the truss", "margin of the truss")


@pytest.mark.parametrize(
    ("case", "count"),
    [
        pytest.param(*each, id=name, marks=[] if name in FAST else pytest.mark.slow)
        for name, each in CASES.items()
    ],
)
def test_gradients_are_those_of_differences(case, count):
    """Of limit loads, margins, curvatures, efforts, places: arch, strip, truss."""
    with unchecked():
        family, question = case()
        x = family.start
        (piece,) = question.answer(family.structure(x), ()).pieces
        assert_gradient_is_that_of_differences(piece, family, x, range(count))


def test_fold_load_of_a_truss_has_the_slope_of_its_closed_form():
    """Shallow von Mises truss: F_max = 0.38490 · 2 EA/2 · a³/L³; 3/a by the rise, −3/L by half."""
    shallow = {"rise": (0.01, 0.03, 0.02), "half": (0.8, 1.2, 1.0)}
    family, first = start_of(truss, shallow)
    question = em.LoadLimit(first.natural_state(), "F")
    with unchecked():
        answer = question.answer(first, ())
    slopes = answer.pieces[0].slopes(family, family.start)[0] / family.width / -answer.value
    np.testing.assert_allclose(slopes, [3.0 / 0.02, -3.0], rtol=2e-3)


@pytest.mark.slow
@pytest.mark.parametrize("margin", [0.0, 0.4])
def test_peaks_of_routes_have_the_gradients_of_their_passes(margin):
    """The pass is followed by Newton's method on structures nearby."""
    family, first = start_of(arch, SLANTED)
    with unchecked():
        box = em.Box(Theta=(-1.6, 1.6), Delta=(-2.0, 2.0))
        eset = em.equilibrium_set(
            first, box, fixed={"q": 0.5}, within=[first.max_curvature <= 18.0],
            intervals=(12, 21), checks=0,
        )  # fmt: skip
        up = max(eset.at(Theta=0.7, Delta=0.0).stable, key=first.height(0.5))
        down = min(eset.at(Theta=-0.7, Delta=0.0).stable, key=first.height(0.5))
        efforts = (em.effort_of(first, name) for name in ("Theta", "Delta"))
        motor = abs(em.function_of("motor A", lambda a, b: 0.5 * (a + b), *efforts))
        question = RouteExtreme(eset, up, down, em.peak(motor), margin=margin)
        answer = question.answer(first, ())
        assert [piece.kind for piece in answer.pieces] == ["start", "goal", "pass"]
        for piece in answer.pieces:
            assert_gradient_is_that_of_differences(piece, family, family.start, (0, 1, 3))
