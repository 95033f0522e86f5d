"""Published planar frames as frames in space, and domes of members that each act as in a plane."""

import numpy as np
import pytest

import equimorph as em
from typecheck import unchecked

WIDE = 500.0
"""EI out of the plane over EI in it, and GJ: these frames stay in their plane."""


def test_lee_frame_in_space():
    """[LeeManuelRossow1968]_: 18.5588 at (0.22406, −0.40616); half a unit of the last digit."""
    joints = {"A": (0, 0, 0), "B": (0, 0, 1), "C": (0.2, 0, 1), "D": (1, 0, 1)}
    across = {("A", "B"): (1, 0, 0), ("B", "C"): (0, 0, 1), ("C", "D"): (0, 0, 1)}
    members = [
        em.SpatialMember(pair, EI_out=WIDE, GJ=WIDE, normal=normal)
        for pair, normal in across.items()
    ]
    # in the plane all rotations but that about y are held at the pins
    pin = {**dict.fromkeys("xyz", "held"), "rotation": (0, 1, 0)}
    held = {"A": pin, "D": pin}
    frame = em.SpatialFrame(joints, members, held, {"P": {"C": (0, 0, -1)}}, degree=8)
    with unchecked():
        limit = em.limit_load(frame.natural_state(), "P")
    assert limit.kind == "fold"
    assert limit.value == pytest.approx(18.5588, abs=6e-5)
    moved = [frame.displacement("C", axis)(limit.state) for axis in "xz"]
    assert moved == pytest.approx([0.22406, -0.40616], abs=6e-6)


@pytest.mark.parametrize("count", [3, 6])
def test_a_star_of_members_is_so_many_halves_of_a_toggle(count):
    """Clamped members to one rigid apex: each bears P/count as half of Williams' toggle does."""
    rise, EA = 0.1, 3000.0
    angles = 2.0 * np.pi * np.arange(count) / count
    ends = {f"E{k}": (np.cos(a), np.sin(a), 0.0) for k, a in enumerate(angles)}
    members = [em.SpatialMember((end, "T"), EA=EA, EI_out=20.0, GJ=20.0) for end in ends]
    star = em.SpatialFrame(
        {**ends, "T": (0, 0, rise)}, members, dict.fromkeys(ends, "fixed"),
        {"P": {"T": (0, 0, -1)}}, degree=8,
    )  # fmt: skip
    toggle = em.Frame(
        {"A": (-1, 0), "T": (0, rise), "B": (1, 0)},
        [em.Member(("A", "T"), 1.0, EA), em.Member(("T", "B"), 1.0, EA)],
        {"A": "fixed", "B": "fixed"}, {"P": {"T": (0, -1)}},
    )  # fmt: skip
    with unchecked():
        one = em.limit_load(star.natural_state(), "P")
        two = em.limit_load(toggle.natural_state(), "P")
    assert one.kind == two.kind == "fold"
    assert one.value / count == pytest.approx(two.value / 2.0, rel=1e-8)
    sunk = -star.displacement("T", "z")(one.state)
    assert sunk == pytest.approx(-toggle.displacement("T", "y")(two.state), abs=1e-6)
