"""Symmetries of trusses and frames: images of equilibria are equilibria of the same energy."""

import numpy as np
import pytest

import equimorph as em
from typecheck import unchecked

BAYS = [("A", "B"), ("B", "C"), ("C", "D")]


def portal(axial=None, hinges=(), right=1.0):
    """A portal with loads and actuators that its mirror image has, up to their sign."""
    members = [
        em.Member(("A", "B"), EA=axial),
        em.Member(("B", "C"), curvature=-0.3, hinges=hinges, weight=1.0),
        em.Member(("C", "D"), EI=right, EA=axial),
    ]
    return em.Frame(
        {"A": (0, 0), "B": (0, 1), "C": (1.2, 1), "D": (1.2, 0)},
        members,
        {"A": "fixed", "D": "fixed"},
        {
            "H": {"B": (1, 0), "C": (1, 0)},
            "V": {"B": (0, -1, 0.2), "C": (0, -1, -0.2)},
            "g": {"weight": (0, -1)},
        },
        {
            "k": {"curvature": {"A-B": 1, "C-D": 1}},
            "w": {"move": {"A": (-1, 0), "D": (1, 0)}},
            "r": {"turn": {"A": 1, "D": 1}},
        },
        degree=5,
    )


LOADED = {"H": 0.5, "V": 0.3, "g": 0.2, "k": 0.1, "w": 0.02, "r": 0.05}


@pytest.mark.parametrize("axial", [None, 80.0])
@pytest.mark.parametrize("hinges", [(), ("B", "C")])
def test_the_mirror_image_of_a_portal_is_in_equilibrium(axial, hinges):
    """Sway loads and turns change their sign. 1e-12: round-off."""
    frame = portal(axial, hinges)
    [mirror] = frame.symmetries()
    signs = {"k": 1, "w": 1, "r": -1, "H": -1, "V": 1, "g": 1}
    assert dict(zip(LOADED, mirror.signs[[3, 4, 5, 0, 1, 2]], strict=True)) == {
        name: signs[name] for name in LOADED
    }
    with unchecked():
        state = em.lift(frame.natural_state(), LOADED).end.state
    z, p = mirror.apply(state.z[None], state.p[None])
    image = em.State(frame, z[0], p[0])
    assert image["H"] == -state["H"]
    assert image.residual < 1e-12
    assert image.energy == pytest.approx(state.energy, abs=1e-12)
    drift = [frame.displacement("B", "x")(state), frame.displacement("C", "x")(image)]
    assert drift[0] == pytest.approx(-drift[1], abs=1e-12)
    again, _ = mirror.apply(z, p)
    np.testing.assert_allclose(again[0], state.z, atol=1e-12)


def test_a_truss_in_space_has_its_images():
    """Four bars to a top: bars change places, the load across changes its sign."""
    feet = {"A": (1, 0, 0), "B": (-1, 0, 0), "C": (0, 2, 0), "D": (0, -2, 0)}
    truss = em.Truss(
        {**feet, "T": (0, 0, 0.5)},
        [(foot, "T") for foot in feet],
        dict.fromkeys(feet, "xyz"),
        {"F": {"T": (0, 0, -1)}, "G": {"T": (1, 0, 0)}},
        {"a": {"A-T": 1.0, "B-T": 1.0}},
    )
    found = {each.name: each.signs.tolist() for each in truss.symmetries()}
    assert found == {
        "image in x": [1, 1, -1],
        "image in y": [1, 1, 1],
        "image in xy": [1, 1, -1],
    }
    state = em.lift(truss.natural_state(), {"F": 0.005, "G": 0.01, "a": 0.02}).end.state
    for each in truss.symmetries():
        z, p = each.apply(state.z[None], state.p[None])
        assert np.abs(truss.residual(z, p)).max() < 1e-12
        np.testing.assert_array_equal(each.apply(z, p)[0][0], state.z)


@pytest.mark.parametrize(
    "structure",
    [
        portal(right=1.1),
        em.Frame(
            {"A": (0, 0), "B": (0, 1), "C": (1, 1), "D": (1, 0)},
            BAYS,
            {"A": "fixed", "D": "pinned"},
            {"V": {"B": (0, -1), "C": (0, -1)}},
        ),
        em.Frame(
            {"A": (0, 0), "B": (0, 1), "C": (1, 1), "D": (1, 0)},
            BAYS,
            {"A": "fixed", "D": "fixed"},
            {"V": {"B": (0, -1)}},
        ),
        em.Truss(
            {"A": (-1, 0), "B": (0, 0.3), "C": (1, 0)},
            [em.Bar(("A", "B")), em.Bar(("B", "C"), EA=2.0)],
            {"A": "xy", "C": "xy"},
            {"F": {"B": (0, -1)}},
        ),
    ],
    ids=["stiffness", "support", "load", "bar"],
)
def test_what_differs_on_both_sides_has_no_symmetry(structure):
    assert structure.symmetries() == ()


def test_searches_return_images_together():
    """A von Mises truss under F alone: sideways states come in pairs."""
    truss = em.Truss(
        {"A": (-1, 0), "B": (0, 3.0), "C": (1, 0)},
        [("A", "B"), ("B", "C")],
        {"A": "xy", "C": "xy"},
        {"F": {"B": (0, -1)}},
    )
    found = em.find_equilibria(truss, {"F": 0.3})
    x = np.sort(found.z[:, 0])
    np.testing.assert_allclose(x, -x[::-1], atol=1e-9)
