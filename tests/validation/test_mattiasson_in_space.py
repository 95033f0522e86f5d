"""Mattiasson's cantilever in any plane [Mattiasson1981]_: rotations of the load turn the answer."""

import numpy as np
import pytest

import equimorph as em

PRINTED = {1.0: (0.30172, 0.05643), 2.0: (0.49346, 0.16064), 10.0: (0.81061, 0.55500)}


@pytest.mark.parametrize(("load", "printed"), PRINTED.items())
@pytest.mark.parametrize("angle", [0.0, 0.7, np.pi / 2])
def test_the_tip_of_a_cantilever(load, printed, angle):
    """Five printed digits; a round rod does not twist."""
    down = np.array([0.0, -np.cos(angle), np.sin(angle)])
    rod = em.SpatialRod(
        torsion=0.77, lateral=1.0, ends=("clamped", "free"), EI=1.0, length=1.0,
        loads={"P": em.PointForce(1.0, tuple(down))},
    )  # fmt: skip
    state = em.lift(rod.natural_state(), {"P": load}).end.state
    place = state.shape()[-1]
    assert place @ down == pytest.approx(printed[0], abs=6e-6)
    assert 1.0 - place[0] == pytest.approx(printed[1], abs=6e-6)
    twist = float(rod.strains(0.3)[0](state))
    assert twist == pytest.approx(0.0, abs=1e-7)
