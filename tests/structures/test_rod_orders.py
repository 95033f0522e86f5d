"""Observed order of convergence for every option of the rod."""

import numpy as np
import pytest

import equimorph as em

DEGREE = 3


def exponential(s):
    return np.exp(s)


def wave(s):
    return 3 * np.sin(4 * s)


CANTILEVER = ("clamped", "free")
TIP = {"P": em.PointForce(1.0)}
OPTIONS = {
    "stiffness with a jump": (
        {
            "ends": CANTILEVER,
            "stiffness": [[0, 1], [0.5, 2], [0.5, 1], [1, 0.5]],
            "loads": TIP,
        },
        {},
        {"P": 0.1},
    ),
    "curvature": ({"ends": CANTILEVER, "curvature": wave, "loads": TIP}, {}, {"P": 0.1}),
    "axial stiffness": (
        {"ends": CANTILEVER, "axial": [[0, 3.0], [1, 5.0]], "loads": TIP},
        {},
        {"P": 0.15},
    ),
    "springs": (
        {
            "ends": (em.End(angle=0.05), em.End(angle="free", x="free", y=1.0)),
            "loads": {"P": em.PointForce(0.5)},
        },
        {},
        {"P": 0.3},
    ),
    "inclined line load": (
        {"ends": CANTILEVER, "loads": {"q": em.LineLoad(exponential, (0.5, -1.0))}},
        {},
        {"q": 0.1},
    ),
    "force and couple inside": (
        {
            "ends": ("clamped", "pinned"),
            "curvature": -2.0,
            "loads": {"P": em.PointForce(0.5), "M": em.Couple(0.5)},
        },
        {"theta_A": 1.0},
        {"P": 0.5, "M": 0.05},
    ),
    "tendon": (
        {
            "ends": CANTILEVER,
            "actuators": {"T": em.Tendon([[0, 0.1], [1, 0.02]])},
            "loads": TIP,
        },
        {"T": 1.0},
        {"P": 0.1},
    ),
    "tendon on a soft axis": (
        {
            "ends": CANTILEVER,
            "axial": 5.0,
            "actuators": {"T": em.Tendon(0.1, 0.0, 0.5)},
            "loads": TIP,
        },
        {"T": 0.5},
        {"P": 0.1},
    ),
    "half a line load": (
        {"ends": ("clamped", "sliding"), "loads": {"q": em.LineLoad("left-half")}},
        {},
        {"q": 1.0},
    ),
    "inclined roller": (
        {
            "ends": ("clamped", em.End(angle="free", slide=0.5)),
            "loads": {"q": em.LineLoad(exponential)},
        },
        {},
        {"q": 0.4},
    ),
    "pressure": (
        {"ends": ("clamped", "pinned"), "curvature": -2.0, "loads": {"p": em.Pressure()}},
        {"theta_A": 1.0},
        {"p": -0.5},
    ),
}


@pytest.mark.parametrize("option", OPTIONS)
def test_energies_converge_with_twice_the_degree(option):
    """8 and 16 elements of degree 3 against 16 of degree 9: order 6 within 0.5."""
    described, natural, loaded = OPTIONS[option]

    def energy(elements, degree):
        rod = em.Rod(elements=elements, degree=degree, **described)
        return em.lift(rod.natural_state(**natural), loaded).end.state.energy

    exact = energy(16, 9)
    errors = [abs(energy(elements, DEGREE) - exact) for elements in (8, 16)]
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2 * DEGREE, abs=0.5)
