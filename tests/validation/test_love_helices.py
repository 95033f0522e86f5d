"""Helices as equilibria of rods in space [Love1927]_, §§270–271."""

import numpy as np
import pytest

import equimorph as em

TORSION = 0.77


def clamps(curvature: float, torsion: float) -> tuple[dict[str, float], np.ndarray]:
    """Angles and place of end B of a helix of unit length that starts along x with normal y.

    The frame turns about the axis of the helix by h = √(k² + t²) per length (Rodrigues' formula).
    """
    h = np.hypot(curvature, torsion)
    axis = np.array([torsion, 0.0, curvature]) / h

    def turned(angle, v):
        along = axis * (axis @ v)
        return along + np.cos(angle) * (v - along) + np.sin(angle) * np.cross(axis, v)

    frame = np.stack([turned(h, e) for e in np.eye(3)], axis=1)
    tangent = np.array([1.0, 0.0, 0.0])
    along = axis * (axis @ tangent)
    across = tangent - along
    place = along + (np.sin(h) * across + (1.0 - np.cos(h)) * np.cross(axis, across)) / h
    turn, tilt = np.arctan2(frame[1, 0], frame[0, 0]), -np.arcsin(frame[2, 0])
    twist = np.arctan2(frame[2, 1], frame[2, 2])
    angles = {"theta_B": turn, "tilt_B": tilt, "twist_B": twist}
    return angles | dict(zip(("nu", "rise", "sideways"), place.tolist(), strict=True)), axis


def test_a_helix_between_clamps_needs_a_wrench_along_its_axis():
    """From the stress-free helix (2, 1) to the helix (1.6, 0.4) of a round rod, B = 1, C = 0.77.

    The moment is C (t − t₀) along the tangent and B (k − k₀) along the binormal, the force is along
    the axis alone; the strains are constant. Tolerance: 1e-8.
    """
    (k0, t0), (k, t) = (2.0, 1.0), (1.6, 0.4)
    rod = em.SpatialRod(
        torsion=TORSION, lateral=1.0, curvature=k0, natural_twist=t0, EI=1.0, length=1.0,
        loads={"q": em.LineLoad()}, coordinates={},
    )  # fmt: skip
    first, _ = clamps(k0, t0)
    wanted, axis = clamps(k, t)
    path = em.lift(rod.natural_state(**first), wanted)
    assert path.end.kind == "arrived"
    state = path.end.state
    for s in (0.1, 0.5, 0.83):
        twist, aside, bend = (float(each(state)) for each in rod.strains(s))
        assert (twist, aside, bend) == pytest.approx((t, 0.0, k), abs=1e-8)
    force = np.array([float(rod.support_force(each)(state)) for each in "xyz"])
    h = np.hypot(k, t)
    wrench = h * (TORSION * (t - t0) - t / k * (k - k0))
    np.testing.assert_allclose(np.abs(force), np.abs(wrench * axis), atol=1e-8)


def test_a_stress_free_helix_has_its_closed_form():
    """Radius k/h², rise t/h² by radian. Tolerance: 1e-9."""
    k, t = 5.0, 3.0
    rod = em.SpatialRod(
        torsion=TORSION, lateral=4.0, curvature=k, natural_twist=t, ends=("clamped", "free"),
        EI=1.0, length=1.0,
    )  # fmt: skip
    state = rod.natural_state()
    where, _ = clamps(k, t)
    place = [where[name] for name in ("nu", "rise", "sideways")]
    np.testing.assert_allclose(state.shape()[-1], place, atol=1e-9)
    assert state.energy == pytest.approx(0.0, abs=1e-12)
