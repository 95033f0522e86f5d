"""A rigid-jointed toggle between clamps [Williams1964]_, in pounds and inches, as he built it.

His theory, of small slopes with the shortening by bending, in closed form: a member of length L
and slope a = h/L whose inner end goes down by v has the shape v f(x), f'''' + (k/L)² f'' = 0,
clamped at both ends, and the thrust N = EI k²/L² = EA (a v/L − ½ ∫ (v f')² dx/L). The load is
``P = 2 (N a + S v)``, S = EI f'''(0) with the sign of a restoring force.
"""

import numpy as np
import pytest
from scipy.optimize import brentq, minimize_scalar

import equimorph as em
from typecheck import unchecked

HALF, RISE, WIDTH, DEPTH, MODULUS = 12.943, 0.386, 0.753, 0.243, 1.03e7
UNITS = {"force": "lbf", "length": "in"}
PLACES, WEIGHTS = np.polynomial.legendre.leggauss(40)


def stiffness(depth):
    """EA and EI of a member."""
    return MODULUS * WIDTH * depth, MODULUS * WIDTH * depth**3 / 12.0


def shape(k):
    """Mean of f'² and the stiffness S in units of EI/L³, for f from 0 to 1 on the unit interval."""
    a, b, s = np.cos(k) - 1.0, np.sin(k), 0.5 * (PLACES + 1.0)
    end = a * (np.cos(k) - 1.0) + b * (np.sin(k) - k)
    slope = (-a * k * np.sin(k * s) + b * k * (np.cos(k * s) - 1.0)) / end
    return 0.5 * WEIGHTS @ slope**2, b * k**3 / end


def load(v, rise, depth):
    """Load at which the apex has gone down by v."""
    (EA, EI), a = stiffness(depth), rise / HALF

    def excess(k):
        return EI * k**2 / HALF**2 - EA * (a * v / HALF - 0.5 * (v / HALF) ** 2 * shape(k)[0])

    k = brentq(excess, 1e-3, 2.0 * np.pi - 1e-3)
    return 2.0 * (EI * k**2 / HALF**2 * a + EI / HALF**3 * shape(k)[1] * v)


def limits(rise, depth):
    """Upper and lower limit loads, and the travels there."""
    upper = minimize_scalar(
        lambda v: -load(v, rise, depth), bounds=(0.3 * rise, 0.8 * rise), method="bounded"
    )
    lower = minimize_scalar(
        lambda v: load(v, rise, depth), bounds=(0.8 * rise, 1.3 * rise), method="bounded"
    )
    return (-upper.fun, lower.fun), (upper.x, lower.x)


def toggle(rise, depth):
    """Frame of two members, and its folds on the way of the load through them."""
    EA, EI = stiffness(depth)
    joints = {"A": (-HALF, 0.0), "B": (0.0, rise), "C": (HALF, 0.0)}
    members = [em.Member(pair, EI=EI, EA=EA) for pair in (("A", "B"), ("B", "C"))]
    held = {"A": "fixed", "C": "fixed"}
    frame = em.Frame(joints, members, held, {"P": {"B": (0, -1)}}, units=UNITS)
    with unchecked():
        path = em.lift(frame.natural_state(), {"P": 80.0 * rise / RISE}, through_folds=True)
    folds = [event.state for event in path.events if event.kind == "fold"]
    travel = frame.travel("P")
    return [state["P"] for state in folds], [travel(state) for state in folds]


def test_limit_loads_of_the_toggle():
    """33.900 and 31.306 lbf by the theory of small slopes; it errs by about a² = 0.0009."""
    loads, travels = toggle(RISE, DEPTH)
    theory, ways = limits(RISE, DEPTH)
    assert theory == pytest.approx((33.9000, 31.3063), abs=1e-4)
    assert loads == pytest.approx(theory, rel=1.5e-3)
    assert travels == pytest.approx(ways, rel=1.5e-3)


def test_the_theory_of_small_slopes_is_met_as_slopes_become_small():
    """Rise and depth halved together: what is left of the difference falls by four. 10 %: a⁴."""
    gaps = []
    for share in (1.0, 0.5):
        loads, _ = toggle(share * RISE, share * DEPTH)
        gaps.append(loads[0] / limits(share * RISE, share * DEPTH)[0][0] - 1.0)
    assert gaps[0] / gaps[1] == pytest.approx(4.0, rel=0.1)
