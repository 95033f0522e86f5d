"""Bounds for boxes of errors hold the equilibria of every structure and load in them."""

import numpy as np
import pytest

import equimorph as em
from equimorph.equilibria import settle
from equimorph.structures import States
from equimorph.tasks.verification.error_box import Deviation, ErrorBox
from equimorph.tasks.verification.newton_kantorovich import segment_bounds

ERROR = 0.02
"""Relative error of the stiffness of one bar."""


def shallow(stiffness=1.0):
    return em.Truss(
        {"A": (-1.0, 0.0), "B": (0.0, 0.2), "C": (1.0, 0.0)},
        [em.Bar(("A", "B"), EA=stiffness), ("B", "C")],
        supports={"A": "xy", "C": "xy"}, loads={"P": {"B": (0.0, -1.0)}}, strain="green",
    )  # fmt: skip


@pytest.fixture(scope="module")
def segments():
    """Short steps in the load."""
    path = em.verify([{"P": 5e-4}], shallow().natural_state()).states
    return path[:-1], path[1:]


@pytest.mark.parametrize("errs", [True, False], ids=["stiffness", "exact"])
def test_equilibria_with_errors_lie_within_the_tubes(segments, errs):
    """Random loads within 1 % of the largest, and stiffness within 2 % where it errs."""
    first, last = segments
    nominal, far = shallow(), shallow(1.0 + 50 * ERROR)
    data = (Deviation(nominal, shallow(1.0 + ERROR), far, 50.0),) if errs else ()
    steps = np.full((len(first), 1, 1), 5e-6)
    errors = ErrorBox(steps, data)
    bounds = segment_bounds(first, last, 0.0, errors)
    assert bounds.proved.all()
    assert bounds.stable.all()
    turns = [errors.responses(each) for each in (first, last)]
    generator, reached = np.random.default_rng(2), 0.0
    for _ in range(12):
        share, size = generator.random(), 1 + len(data)
        chance = generator.choice([-1.0, 1.0], size) * generator.random(size) ** 0.2
        made = shallow(1.0 + ERROR * chance[-1]) if errs else nominal
        p = (1 - share) * first.p + share * last.p + chance[0] * steps[:, 0]
        turn = (1 - share) * turns[0] + share * turns[1]
        guess = (1 - share) * first.z + share * last.z + np.einsum("k,lkj->lj", chance, turn)
        found = settle(made, guess, p)
        assert found.found.all()
        away = (np.abs(found.z - guess) / bounds.weights).max(axis=1)
        assert (away <= bounds.error).all()
        reached = max(reached, float((away / bounds.error).max()))
        margin = States(made, found.z, p).margin
        assert (margin >= bounds.margin).all()
    assert reached > 0.05


def test_boxes_of_parameters_are_segments_of_one_point(segments):
    """Both ends are the same state."""
    first, _ = segments
    errors = ErrorBox(np.full((len(first), 1, 1), 1e-5))
    bounds = segment_bounds(first, first, None, errors)
    assert bounds.proved.all()
    assert bounds.stable.all()
    assert (bounds.margin == 0.0).all()
