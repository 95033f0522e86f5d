"""Twisted cables throw loops: a localised buckle in a long round rod, in closed form.

With M = 2 √(BT) cos ψ the buckle has the slack D = 4 √(B/T) sin ψ, and both ends are turned by
R = M L/C + 4 ψ against each other: Love's solution for a rod without ends [Coyne1990]_,
[HeijdenThompson2000]_. Under rotation at constant slack, and under slack at constant rotation, the
rod jumps where dR/dψ = 0: cos 2ψ = −C D/(2 B L). Clamps at a distance change this by their tails,
exp(−2 L sin²ψ/D). The torsional stiffness is large, so that a short rod holds enough twist.
"""

import numpy as np
import pytest

import equimorph as em

pytestmark = pytest.mark.slow

TORSION = 2.0
UNIT = 4.0 * np.pi**2
"""Of forces and couples in B/L² and B/L."""


def rotation(psi, slack):
    """R of both ends."""
    return 4.0 * np.sin(2.0 * psi) / (TORSION * slack) + 4.0 * psi


@pytest.fixture(scope="module", params=[0.18, 0.15])
def slack(request):
    return request.param


@pytest.fixture(scope="module")
def path(slack):
    """Twisted further and further, through the fold; the buckle may slide before that."""
    span = 1.0 - slack
    rod = em.SpatialRod(
        torsion=TORSION, lateral=1.0, loads={}, span=span, phase=True, elements=8, degree=6
    )
    psi = 0.5 * np.arccos(-0.5 * TORSION * slack)
    start = rod.natural_state(twist_A=-8.0, twist_B=rotation(psi, slack) - 8.5)
    return em.lift(start, {"twist_B": 12.5}, through_folds=True)


def test_a_cable_jumps_into_a_loop_where_coyne_says(path, slack):
    """Closed forms of R, T and M; tails at the clamps: 1.4e-3 and 4.7e-4.

    Tolerances: the tail, of which R feels less, since it is largest there.
    """
    psi = 0.5 * np.arccos(-0.5 * TORSION * slack)
    tail = np.exp(-2.0 * np.sin(psi) ** 2 / slack)
    fold = next(each.state for each in path.events if each.kind == "fold")
    turned = fold["twist_B"] - fold["twist_A"]
    assert turned == pytest.approx(rotation(psi, slack), rel=0.1 * tail)
    tension = abs(fold.structure.support_force("x")(fold))
    assert tension * UNIT == pytest.approx(16.0 * np.sin(psi) ** 2 / slack**2, rel=tail)
    moment = fold.structure.end_couple(1, "x")(fold)
    assert moment * UNIT == pytest.approx(4.0 / slack * np.sin(2.0 * psi), rel=tail)
