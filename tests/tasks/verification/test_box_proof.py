"""Sheets over whole boxes: closed forms lie in the tubes, and folds are not overlooked.

Spring: F = (1 − x/cos δ) sin δ, stable where x > cos³δ; folds at F = (1 − x^⅔)^(3/2).
"""

import numpy as np
import pytest
from scipy.optimize import brentq

import equimorph as em
from equimorph.equilibria import settle
from equimorph.structures import State, States
from oracles.polynomial import bead_on_a_circle
from typecheck import unchecked

BOX = em.Box(x_l=(1.4, 1.5), F=(-0.1, 0.1))


def in_tube(proof, states, places):
    """Whether each state lies in the tube of a cell that holds its parameters."""
    errors = np.zeros((len(proof.half), len(places), states.p.shape[1]))
    errors[:, range(len(places)), places] = proof.half
    rows = []
    for z, p in zip(states.z, states.p, strict=True):
        gap = p[places] - proof.states.p[:, places]
        cell = int(np.flatnonzero((np.abs(gap) <= proof.half).all(axis=1))[0])
        middle = proof.states[cell : cell + 1]
        columns = [middle.structure.parameter_derivative(middle.z, middle.p, each[None])
                   for each in np.eye(len(p))[places]]  # fmt: skip
        turn = -middle.structure.solve(middle.z, middle.p, np.stack(columns, axis=1)).x[0]
        rows.append((np.abs(z - middle.z[0] - gap[cell] @ turn) <= proof.tubes[cell]).all())
    return np.array(rows)


@pytest.fixture(scope="module")
def sheet():
    return em.certify_box(em.Spring().natural_state(x_l=1.5), BOX)


def test_the_sheet_of_the_spring_lies_in_its_tubes(sheet):
    assert sheet.status is em.ProofStatus.PROVED
    generator = np.random.default_rng(1)
    p = generator.uniform([1.4, -0.1, 1.0], [1.5, 0.1, 1.0], (60, 3))
    delta = [
        brentq(lambda d, x=x, f=f: (1 - x / np.cos(d)) * np.sin(d) - f, -1.4, 1.4, xtol=1e-15)
        for x, f, _ in p
    ]
    states = States(em.Spring(), np.array(delta)[:, None], p)
    assert in_tube(sheet, states, np.array([0, 1])).all()
    # E'' = k x (x − cos³ δ)/cos⁴ δ is least at δ = 0 and the least x
    assert 0.1 < sheet.margin <= 1.4 * 0.4


def test_cells_fill_the_box_without_gaps(sheet):
    low, high = sheet.states.p[:, :2] - sheet.half, sheet.states.p[:, :2] + sheet.half
    np.testing.assert_allclose(low.min(axis=0), BOX.lower, atol=1e-12)
    assert (low.min(axis=0) <= BOX.lower).all()
    assert (high.max(axis=0) >= BOX.upper).all()
    np.testing.assert_allclose((2 * sheet.half).prod(axis=1).sum(), 0.1 * 0.2, rtol=1e-9)


def test_a_box_of_the_arch_is_proved(ends):
    box = em.Box(Theta=(0.97, 1.03), Delta=(-0.03, 0.03), q=(2.45, 2.5))
    with unchecked():
        proof = em.certify_box(ends[0], box, margin=0.3)
    assert proof.status == "proved", proof.why
    assert proof.margin >= 0.3
    p = np.tile(ends[0].p, (30, 1))
    generator = np.random.default_rng(5)
    p[:, :3] = generator.uniform(box.lower, box.upper, (30, 3))
    found = settle(ends[0].structure, np.tile(ends[0].z, (30, 1)), p)
    states = States(ends[0].structure, found.z, p)
    assert found.found.all()
    assert in_tube(proof, states, np.arange(3)).all()
    assert proof.margin <= states.margin.min()


@pytest.mark.parametrize(
    ("start", "box", "why"),
    [
        ({"x_l": 0.8}, em.Box(F=(-0.01, 0.12)), "the way to its middle ends at a fold"),
        ({"x_l": 0.8}, em.Box(F=(-0.01, 0.06)), "the sheet ends at a fold"),
        ({"x_l": 1.5}, em.Box(F=(-0.01, 0.01), x_l=(0.8, 1.5)), "100 cells do not suffice"),
    ],
    ids=["beyond", "fold inside", "branch point"],
)
def test_nothing_is_proved_where_the_sheet_ends(start, box, why):
    """At x_l = 0.8 the fold has the load 0.0513907829."""
    proof = em.certify_box(em.Spring().natural_state(**start), box, most=100)
    assert proof.status == "unproved"
    assert proof.why == why
    assert proof.failed is not None
    assert proof.margin == 0.0
    assert repr(proof) == f"BoxProof(unproved: {why})"


def test_a_margin_that_is_not_there_is_not_proved():
    """At δ = 0 it is x (x − 1)."""
    rest, line = em.Spring().natural_state(x_l=1.5), em.Box(x_l=(1.4, 1.5))
    assert em.certify_box(rest, line, margin=1.01 * 1.4 * 0.4, most=100).status == "unproved"
    assert em.certify_box(rest, line, margin=0.97 * 1.4 * 0.4, most=100).status == "proved"


def test_a_box_is_proved_up_to_close_to_a_fold():
    """At 99.9 % of its load (1 − 0.8^⅔)^(3/2)."""
    last = 0.999 * (1 - 0.8 ** (2 / 3)) ** 1.5
    proof = em.certify_box(em.Spring().natural_state(x_l=0.8), em.Box(F=(0.0, last)))
    assert proof.status == "proved"
    assert proof.half.min() < 0.1 * proof.half.max()


def test_sampled_bounds_give_support():
    hanging = bead_on_a_circle().state(0.0, 1.0, 1.0, g=1.0)
    proof = em.certify_box(hanging, em.Box(h=(-1e-3, 1e-3)))
    assert proof.status == "supported"
    assert repr(proof).startswith("BoxProof(supported: sampled bounds on ")


def test_an_unstable_state_is_refused_by_name():
    spring = em.Spring()
    unstable = State(spring, np.zeros(1), np.array([0.8, 0.0, 1.0]))
    assert em.certify_box(unstable, em.Box(F=(0.0, 0.01))).why == "the state is unstable"
