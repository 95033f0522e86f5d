"""Pieces that no guess leads to, as one state attracts all of them, are found by deflation."""

import numpy as np
import pytest

import equimorph as em
from equimorph.manifold.lifting import completeness
from typecheck import unchecked

BOX = em.Box(p=(-1, 1), r=(-1, 1))
RADIUS, PLACE, HALF = 0.25, 3.0, 1.5


def attracted(centre: tuple[float, float]) -> em.EnergyStructure:
    """E' = x ((x − 3)² − c), c = 1.5² (1 − ϱ²/0.25²), ϱ the distance of (p, r) from a centre.

    x = 0 everywhere, and 3 ± √c over the disc ϱ < 0.25, which closes in a fold. From |x| ≤ 0.5,
    where guesses are, Newton's method leads to x = 0 over every point.
    """
    p, r = centre
    c = f"{HALF**2}*(1 - ((p - {p})**2 + (r - {r})**2)/{RADIUS**2})"
    return em.EnergyStructure(
        f"x**4/4 - {2 * PLACE / 3}*x**3 + ({PLACE**2} - {c})*x**2/2",
        [em.Unknown("x", "0", guesses=(-0.5, 0.5))],
        [em.Parameter(name, "1", 1.0, "actuator", 0.0) for name in "pr"],
    )


@pytest.mark.parametrize("centre", [(0.55, -0.45), (-0.4, -0.6), (-0.55, 0.5), (0.5, 0.6)])
def test_a_piece_beside_a_state_that_attracts_all_guesses_is_found(centre, monkeypatch):
    """A disc of 5 % of the box; no guess but those that are pushed on leads to it."""
    structure = attracted(centre)
    with unchecked():
        eset = em.equilibrium_set(structure, BOX, intervals=(9, 8))
        found = np.sort(eset.at(p=centre[0] + 0.1, r=centre[1]).z[:, 0])
        monkeypatch.setattr(completeness, "push_on", lambda eset, *_: eset.points[:0])
        before = em.equilibrium_set(structure, BOX, intervals=(9, 8))
    assert eset.audit.clean
    assert (before.audit.clean, before.audit.components) == (True, 1)
    assert eset.audit.components == 2
    half = HALF * np.sqrt(1.0 - 0.1**2 / RADIUS**2)
    np.testing.assert_allclose(found, [0.0, PLACE - half, PLACE + half], atol=1e-9)
