"""Layers of sets over three parameters, from a fold to a constraint, thinner than the grid."""

import numpy as np
import pytest

import equimorph as em
from equimorph.manifold.geometry.points import VertexKind
from oracles.complexes import assert_faithful
from typecheck import unchecked

BOX = em.Box(a=(-1.0, 1.1), b=(-1.0, 1.2), c=(-0.9, 1.0))
STRAIGHT, SADDLE = "a - 0.13*b - 0.21*c", "a - 0.3*b**2 + 0.25*c**2"
PARABOLOID, WAVE = "a - 0.4*b**2 - 0.2*c**2", "a - 0.13*b - 0.3*sin(2*b) + 0.2*sin(2*c)"
TILTED = "a - 0.55*b + 0.37*c"


def bounded(level, width, grid):
    """x² = level with −width/2 ≤ x ≤ width: layers of widths² beside a fold, under two sheets."""
    parameters = [em.Parameter(name, "1", 1.0, "load", 0.0) for name in "abc"]
    unknowns = [em.Unknown("x", "0", guesses=(-2.5, 3.5))]
    structure = em.EnergyStructure(f"x**3/3 - ({level})*x", unknowns, parameters)
    bend = em.Descriptor("bend", "1", lambda z, p: np.maximum(z[:, 0], -2.0 * z[:, 0]))
    with unchecked():
        return em.equilibrium_set(structure, BOX, within=[bend <= width], intervals=grid)


@pytest.mark.parametrize(
    ("level", "width", "grid", "most"),
    [
        pytest.param(STRAIGHT, 0.3, (3, 3, 3), 3500, id="straight"),
        pytest.param(STRAIGHT, 0.1, (3, 3, 3), 3000, id="straight, thin"),
        pytest.param(SADDLE, 0.6, (3, 3, 3), 500, id="saddle, thick"),
        pytest.param(TILTED, 0.3, (3, 2, 3), 4000, id="tilted", marks=pytest.mark.slow),
        pytest.param(SADDLE, 0.15, (3, 3, 3), 4000, id="saddle", marks=pytest.mark.slow),
        pytest.param(PARABOLOID, 0.3, (3, 3, 3), 8000, id="cup", marks=pytest.mark.slow),
        pytest.param(WAVE, 0.3, (3, 3, 3), 6000, id="wave", marks=pytest.mark.slow),
    ],
)
def test_layers_between_a_fold_and_a_constraint_hang_together(level, width, grid, most):
    """A ball, from 1 to 1/100 of an interval thick under one sheet.

    Where splitting sides led along it, the thin straight one took 6012 vertices; the saddle was not
    clean with 12 120, and the cup came to no end in three minutes.
    """
    eset = bounded(level, width, grid)
    assert_faithful(eset)
    assert (eset.audit.components, eset.audit.euler_characteristic) == (1, 1)
    assert eset.audit.vertices < most
    x = eset.points.z[:, 0]
    np.testing.assert_allclose(x[eset.kinds == VertexKind.FOLD], 0.0, atol=1e-9)
    caps = x[eset.kinds == VertexKind.CAP]
    np.testing.assert_allclose(np.maximum(caps, -2.0 * caps), width, atol=1e-9)
    a, b, c = eset.coordinates.T
    values = eval(level, {"a": a, "b": b, "c": c, "sin": np.sin})
    np.testing.assert_allclose(x**2, values, atol=1e-9)
