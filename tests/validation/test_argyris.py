"""J. H. Argyris et al.: On the geometrical stiffness of a beam in space (1979).

A cantilever of two legs of 240 mm at a right angle, of a strip of 30 × 0.6 mm that is wide in its
plane (E = 71 240 N/mm², ν = 0.31, J = b t³/3), under a force at its end along the clamped leg
[Argyris1979]_. It leaves its plane at 1.088 N if the force pulls on this leg.
"""

import numpy as np
import pytest

import equimorph as em
from typecheck import unchecked

LEG, WIDTH, THICKNESS, MODULUS = 240.0, 30.0, 0.6, 71240.0
EI, EI_WIDE = MODULUS * WIDTH * THICKNESS**3 / 12.0, MODULUS * THICKNESS * WIDTH**3 / 12.0
GJ = MODULUS / 2.62 * WIDTH * THICKNESS**3 / 3.0


def leaving(force, **more):
    """Force at the end under which the frame leaves its plane."""
    joints = {"A": (0, 0, 0), "B": (LEG, 0, 0), "C": (LEG, -LEG, 0)}
    member = em.SpatialMember(("A", "B", "C"), EI=EI, EI_out=EI_WIDE, GJ=GJ, normal=(0, 0, 1))
    frame = em.SpatialFrame(joints, [member], {"A": "fixed"}, {"P": {"C": force}}, **more)
    with unchecked():
        event = em.lift(frame.natural_state(), {"P": 4.0}).events[0]
    assert event.kind == "branch point"
    return event.state["P"]


def test_the_force_that_pulls_on_the_clamped_leg():
    """Printed to four digits: half a unit of the last one."""
    assert leaving((1, 0, 0), degree=8) == pytest.approx(1.088, abs=5e-4)


def test_critical_loads_converge_with_twice_the_degree():
    """Gauss–Lobatto elements that meet at the corner: error of order 2d in their size."""
    exact = leaving((1, 0, 0), elements=4, degree=9)
    errors = [abs(leaving((1, 0, 0), elements=n, degree=3) - exact) for n in (2, 4)]
    assert np.log2(errors[0] / errors[1]) == pytest.approx(6.0, abs=0.9)
