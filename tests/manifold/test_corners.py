"""Angles between curves on refined sets, against closed forms."""

import numpy as np
import pytest

from equimorph.manifold import equilibrium_set, refine
from equimorph.manifold.complex.excerpts import fabric_of
from equimorph.manifold.refining.quality import confined_angles, corner_angles
from equimorph.model import Box
from oracles.surfaces import transcriticals
from typecheck import unchecked


def test_triangles_in_a_sharp_corner_are_told():
    """On x = 0 the crossing a + 10·b = 0 leaves the box below, at arctan(0.1) = 5.7°.

    On the other sheet, x = a + 10·b, the lower side (1, 0, 1) and the crossing (10, −1, 0) enclose
    54.7°.
    """
    with unchecked():
        box = Box(a=(-1.0, 1.1), b=(-0.05, 1.2))
        eset = equilibrium_set(transcriticals(1.0, 10.0), box, checks=0, intervals=(3, 4))
        eset = refine(eset, 0.01)
        fabric = fabric_of(eset)
        corners = np.degrees(corner_angles(fabric))
        tight = confined_angles(fabric, np.radians(10.0))
    assert eset.audit.clean
    sharpest = np.degrees(np.arctan(0.1))
    met = np.degrees(np.arccos(10.0 / np.sqrt(2.0 * 101.0)))
    for known in (sharpest, 180.0 - sharpest, met, 180.0 - met, 90.0, 180.0):
        assert np.abs(corners - known).min() == pytest.approx(0.0, abs=1e-5)
    assert corners.min() == pytest.approx(sharpest, abs=1e-5)
    assert eset.audit.smallest_angle <= sharpest + 1e-6
    assert tight[(corners < 10.0).any(axis=1)].all()
    assert eset.audit.smallest_free_angle > eset.audit.smallest_angle
