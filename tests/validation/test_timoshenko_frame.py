"""Buckling of portal frames and continuous columns [TimoshenkoGere1961]_, chapter 2.

Two columns of height h (EI) and a beam of length b (EI_b), loads P on both columns. Sway, with the
beam's restraint 6 EI_b/b: feet pinned kh tan kh = 6 EI_b h/(EI b), fixed kh/tan kh = minus that,
k² = P/EI. Without sway the restraint is 2 EI_b/b. Inextensible columns stay straight before.
"""

import numpy as np
import pytest
from scipy.optimize import brentq

import equimorph as em
from typecheck import unchecked

HEIGHT, WIDTH, COLUMN, BEAM = 1.3, 2.0, 1.7, 2.4


def portal(feet, *, braced):
    joints = {"A": (0, 0), "B": (0, HEIGHT), "C": (WIDTH, HEIGHT), "D": (WIDTH, 0)}
    columns = [em.Member(ends, COLUMN) for ends in (("A", "B"), ("D", "C"))]
    supports = {"A": feet, "D": feet} | ({"B": "x"} if braced else {})
    loads = {"P": {"B": (0, -1), "C": (0, -1)}}
    return em.Frame(joints, [*columns, em.Member(("B", "C"), BEAM)], supports, loads)


def buckling(feet, *, braced):
    """First critical point along P from the straight frame."""
    frame = portal(feet, braced=braced)
    with unchecked():
        return frame, em.limit_load(frame.natural_state(), "P")


@pytest.mark.parametrize("feet", ["pinned", "fixed"])
def test_sway_buckling_load_of_a_portal(feet):
    """Roots of the closed forms. 1e-9: elements of degree 8."""
    ratio = 6.0 * BEAM * HEIGHT / (COLUMN * WIDTH)
    if feet == "pinned":
        root = brentq(lambda u: u * np.tan(u) - ratio, 1e-6, np.pi / 2 - 1e-9, xtol=1e-14)
    else:
        root = brentq(lambda u: u / np.tan(u) + ratio, np.pi / 2, np.pi - 1e-9, xtol=1e-14)
    _, limit = buckling(feet, braced=False)
    assert limit.kind == "branch point"
    assert limit.value == pytest.approx(COLUMN * (root / HEIGHT) ** 2, rel=1e-9)


def test_braced_buckling_load_of_a_portal_with_pinned_feet():
    """A column with restraint β = 2 EI_b/b at its top: tan u (1 + u² EI/(β h)) = u. 1e-9."""
    soft = COLUMN * WIDTH / (2.0 * BEAM * HEIGHT)
    root = brentq(lambda u: np.tan(u) * (1 + u**2 * soft) - u, np.pi + 1e-9, 4.4934, xtol=1e-14)
    _, limit = buckling("pinned", braced=True)
    assert limit.value == pytest.approx(COLUMN * (root / HEIGHT) ** 2, rel=1e-9)


def test_a_portal_that_has_swayed_is_stable_and_its_mirror_image_too():
    """Just beyond the load: a supercritical pitchfork, upright unstable."""
    frame, limit = buckling("pinned", braced=False)
    with unchecked():
        found = em.find_equilibria(frame, {"P": 1.02 * limit.value})
    left, right = (
        np.array([frame.displacement(joint, "x")(state) for state in found]) for joint in "BC"
    )
    upright = np.abs(left) < 1e-9
    assert found.index[upright].min() == 1
    near = np.maximum(np.abs(left), np.abs(right)) < 0.5
    leaning = np.flatnonzero((found.index == 0) & (left * right > 0.0) & near)
    assert len(leaning) == 2
    assert left[leaning] == pytest.approx(-right[leaning[::-1]], rel=1e-8)
