"""Symmetries of trusses and frames: images of equilibria are equilibria of the same energy."""

import numpy as np
import pytest

import equimorph as em
from equimorph.equilibria.random_search import Ground
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


def two_angles():
    return em.Rod(
        ends=("clamped", "clamped"), coordinates={}, loads={"q": em.LineLoad()}, elements=3
    )


def two_segments():
    halves = {"left": em.Curvature(1.0, 0.0, 0.5), "right": em.Curvature(1.0, 0.5, 1.0)}
    return em.Rod(
        ends=("pinned", "pinned"), curvature=-1.5, actuators=halves, elements=4,
        loads={"P": em.PointForce(0.25), "Q": em.PointForce(0.75)},
    )  # fmt: skip


def two_bars():
    return em.Truss(
        {"A": (-1, 0), "B": (0, 0.5), "C": (1, 0)},
        [("A", "B"), ("B", "C")],
        {"A": "xy", "C": "xy"},
        {"F": {"B": (0, -1)}},
        {"a": {"A-B": 1.0}, "b": {"B-C": 1.0}},
    )


def two_columns():
    return em.Frame(
        {"A": (0, 0), "B": (0, 1), "C": (1, 1), "D": (1, 0)},
        BAYS,
        {"A": "fixed", "D": "fixed"},
        {"V": {"B": (0, -1)}, "W": {"C": (0, -1)}, "H": {"B": (1, 0), "C": (1, 0)}},
        degree=5,
    )


@pytest.mark.parametrize(
    ("make", "swapped", "at", "sign"),
    [
        (two_angles, ("theta_A", "theta_B"), {"theta_A": 1.1, "theta_B": -0.8, "q": 1.0}, -1.0),
        (two_segments, ("left", "right"), {"left": 0.4, "right": -0.3, "P": 0.2, "Q": 0.1}, 1.0),
        (two_bars, ("a", "b"), {"a": 0.05, "b": -0.02, "F": 0.01}, 1.0),
        (two_columns, ("V", "W"), {"V": 0.8, "W": 0.3, "H": 0.2}, 1.0),
    ],
)
def test_parameters_that_change_places_in_the_mirror(make, swapped, at, sign):
    """Equilibria go to equilibria of the same energy with both values exchanged. Round-off."""
    structure = make()
    mirror = next(each for each in structure.symmetries() if sorted(each.order) != [*each.order])
    loads = {name: value for name, value in at.items() if name in structure.unloaded()}
    fixed = {name: value for name, value in at.items() if name not in loads}
    with unchecked():
        state = em.lift(structure.natural_state(**fixed), loads).end.state
    z, p = mirror.apply(state.z[None], state.p[None])
    image = em.State(structure, z[0], p[0])
    np.testing.assert_array_equal(p[0], mirror.image(state.p))
    for one, other in (swapped, swapped[::-1]):
        assert image[one] == sign * state[other]
    assert image.residual < 1e-11
    assert image.index == state.index
    assert image.energy == pytest.approx(state.energy, abs=1e-11)
    back = mirror.apply(z, p)
    np.testing.assert_allclose(back[0][0], state.z, atol=1e-12)
    np.testing.assert_array_equal(back[1][0], state.p)


def test_a_set_over_both_angles_gets_the_images_of_what_is_found():
    """At θ_A = −θ_B the rod is its own image: a state found there brings its mirror image."""
    rod = two_angles()
    at = {"theta_A": 1.0, "theta_B": -1.0, "q": 2.5}
    vector = np.array([at.get(each.name, each.default) for each in rod.parameters])
    ground = Ground(rod, vector[None], ())
    z = rod.sample(vector[None], np.random.default_rng(0))
    [image] = ground.images(z, 0)
    np.testing.assert_array_equal(image[0, : rod.unknowns], -z[0, : rod.unknowns][::-1])
    assert ground.images(z, 0)[0].shape == z.shape
    apart = Ground(rod, vector[None] + np.eye(len(vector))[:1], ())
    assert apart.images(z, 0) == []


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
