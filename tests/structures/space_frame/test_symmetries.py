"""Symmetries of frames in space: images of equilibria are equilibria, in the places they should."""

import numpy as np
import pytest

import equimorph as em


def tent(load=None, **options):
    """Four legs that meet above a square, held there by a beam along x and one hinged to it."""
    joints = {"A": (-1, 0, 0), "B": (0, -1, 0), "C": (1, 0, 0), "D": (0, 1, 0), "T": (0, 0, 0.3)}
    members = [
        em.SpatialMember(("A", "T", "C"), EI=1.0, EI_out=2.0, GJ=0.7, EA=500.0, **options),
        em.SpatialMember(("B", "T", "D"), EI=1.0, EI_out=2.0, GJ=0.7, hinges={"T": (0, 0, 1)}),
    ]
    loads = load or {"P": {"T": (0, 0, -1)}, "S": {"T": (1, 0, 0)}, "q": {"B-T": (0.0, 0.2, 0.0)}}
    actuators = {"b": {"curvature": {"B-T": (0.0, 0.0, 1.0)}}, "t": {"turn": {"B": (0, 0, 1)}}}
    supports = {"A": "fixed", "C": "fixed", "B": "fixed", "D": "fixed"}
    return em.SpatialFrame(joints, members, supports, loads, None if load else actuators)


def arched_portal():
    """Clamped posts and an arched beam, in the plane of x and y, with loads in and across it."""
    joints = {"A": (0, 0, 0), "B": (0, 1, 0), "C": (1.5, 1, 0), "D": (1.5, 0, 0)}
    members = [
        em.SpatialMember(("A", "B"), EI=1.0, EI_out=3.0, GJ=0.5, EA=400.0),
        em.SpatialMember(("B", "C"), EI=1.0, EI_out=3.0, GJ=0.5, curvature=-0.4, normal=(0, 1, 0)),
        em.SpatialMember(("C", "D"), EI=1.0, EI_out=3.0, GJ=0.5, EA=400.0),
    ]
    loads = {"q": {"B-C": (0, -1, 0)}, "w": {"B": (0, 0, 1), "C": (0, 0, 1)}}
    loads |= {"l": {"B": (1, 0, 0)}, "r": {"C": (1, 0, 0)}}
    return em.SpatialFrame(joints, members, {"A": "fixed", "D": "fixed"}, loads)


def deformed(frame, values):
    """A state near the natural one, all its parameters changed."""
    return em.lift(frame.natural_state(), values).end.state


@pytest.mark.parametrize(
    ("make", "values", "names"),
    [
        (tent, {"P": 0.5, "S": 0.2, "q": 0.3, "b": 0.2, "t": 0.1}, {"image in x"}),
        (
            lambda: tent({"P": {"T": (0, 0, -1)}, "S": {"T": (1, 0, 0)}}),
            {"P": 0.5, "S": 0.2},
            {"image in x", "image in y", "image in xy"},
        ),
        (
            arched_portal,
            {"q": 0.4, "w": 0.1, "l": 0.2, "r": 0.05},
            {"image in x", "image in z", "image in xz"},
        ),
    ],
)
def test_images_of_equilibria_are_equilibria(make, values, names):
    """With the same energy, in the mirrored places; the frame has these symmetries, no others."""
    frame = make()
    state = deformed(frame, values)
    for each in frame.symmetries():
        z, p = each.apply(state.z[None], state.p[None])
        assert np.abs(frame.residual(z, p)).max() < 1e-10
        np.testing.assert_allclose(p[0], each.signs * state.p[each.order], atol=1e-14)
        image = em.structures.State(frame, z[0], p[0])
        assert image.energy == pytest.approx(state.energy, rel=1e-11)
        assert image.margin == pytest.approx(state.margin, rel=1e-8)
        axes = np.array([-1.0 if axis in each.name[8:] else 1.0 for axis in "xyz"])
        places = frame.model.network.places
        middle = 0.5 * (places.min(axis=0) + places.max(axis=0))
        here, there = (
            np.array(
                [[float(frame.place(j, a)(s)) for a in "xyz"] for j in frame.model.network.joints]
            )
            for s in (state, image)
        )
        moved = middle + axes * (here - middle)
        apart = np.abs(moved[:, None] - there).max(axis=2).min(axis=1)
        assert apart.max() < 1e-10
        back = each.apply(z, p)
        np.testing.assert_allclose(back[0][0], state.z, atol=1e-10)
    assert {each.name for each in frame.symmetries()} == names
