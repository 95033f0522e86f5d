"""The four internal parameterisations of the arch: what fails, and what mends it."""

import inspect

import numpy as np
import pytest

from equimorph.paper.shape_control import parameterisations
from typecheck import unchecked


@pytest.fixture(scope="module")
def found(tmp_path_factory):
    folder = tmp_path_factory.mktemp("paper")
    with unchecked():
        numbers = parameterisations(folder)
    assert (folder / "parameterisations.svg").exists()
    return numbers


def test_projection_works_beside_the_cusp_and_heights_work_around_it(found):
    """Panels (a) and (b)."""
    assert found["(a) projection is single-valued"] == 1.0
    assert found["(b) projection is single-valued"] == 0.0
    assert found["(b) (y(2/3), Delta) is single-valued"] == 1.0
    assert found["(b) area with two stable states"] > 0.01


def test_the_reduction_has_a_barrier_that_ends_at_the_cusp_and_gaps(found):
    """Panel (c): at the cusp the jump vanishes like the root of the distance."""
    assert found["(c) barriers"] == 1.0
    assert found["(c) least jump at the barrier"] < 0.01 < found["(c) largest jump at the barrier"]
    assert found["(c) gaps"] == 2.0


def test_the_atlas_has_three_charts_cut_from_the_cusp_on(found):
    """Panel (d). The cusp by Newton on the extended system: `em.cusps` of a finer set."""
    assert found["(d) charts"] == 3.0
    cusp = [found["(d) Theta of the cusp"], found["(d) Delta of the cusp"]]
    np.testing.assert_allclose(cusp, [1.12327601, 0.58931659], rtol=0, atol=1e-7)


def test_the_example_is_short_and_uses_the_public_face():
    assert len(inspect.getsource(parameterisations).splitlines()) <= 60
    assert "from equimorph" not in inspect.getsource(inspect.getmodule(parameterisations))
