"""S.-L. Lee, F. S. Manuel, E. C. Rossow: Large deflections and stability of elastic frames (1968).

A column of length L, pinned at its foot, joined rigidly to a beam of length L, pinned at its far
end; a dead load P on the beam at L/5 from the column [LeeManuelRossow1968]_. Inextensible:
P L²/EI = 18.5588 at (u, v) = (0.22406, 0.40616) L, and −9.4213 on the way back; the frame is
unstable in between.
"""

import numpy as np
import pytest

import equimorph as em
from typecheck import unchecked


def frame(length=1.0, stiffness=1.0, **more):
    joints = {"A": (0, 0), "B": (0, length), "C": (0.2 * length, length), "D": (length, length)}
    members = [em.Member(ends, stiffness) for ends in (("A", "B"), ("B", "C"), ("C", "D"))]
    return em.Frame(joints, members, {"A": "pinned", "D": "pinned"}, {"P": {"C": (0, -1)}}, **more)


def upper(**more):
    made = frame(**more)
    with unchecked():
        return made, em.limit_load(made.natural_state(), "P")


def test_both_limit_loads():
    """Values printed to six digits: half a unit of the last one. The frame in mm and N, too."""
    made, limit = upper()
    assert limit.kind == "fold"
    assert limit.value == pytest.approx(18.5588, abs=6e-5)
    moved = [made.displacement("C", axis)(limit.state) for axis in "xy"]
    assert moved == pytest.approx([0.22406, -0.40616], abs=6e-6)
    with unchecked():
        back = em.lift(made.natural_state(), {"P": 25.0}, through_folds=True)
        down = em.lift(back.end.state, {"P": -12.0}, through_folds=True)
        up = em.lift(down.end.state, {"P": 25.0})
    assert back.end.kind == "returned"
    assert back.end.state.index == 1
    assert down.events[0].kind == "fold"
    assert down.events[0].state["P"] == pytest.approx(-9.4213, abs=6e-5)
    assert up.end.kind == "arrived"
    assert up.end.state.stable
    length, stiffness = 120.0, 1.7e6
    _, again = upper(length=length, stiffness=stiffness)
    assert again.value * length**2 / stiffness == pytest.approx(limit.value, rel=1e-9)


def test_limit_loads_converge_with_twice_the_degree():
    """Gauss–Lobatto elements, moments at joints: error of order 2d in the size of the elements."""
    exact = upper(elements=4, degree=9)[1].value
    for degree in (3, 4):
        errors = [abs(upper(elements=n, degree=degree)[1].value - exact) for n in (2, 4)]
        order = np.log2(errors[0] / errors[1])
        assert order == pytest.approx(2 * degree, abs=0.8)
