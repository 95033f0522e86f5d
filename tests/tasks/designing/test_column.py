"""Strongest columns against published ones, and against branch points of rods made of them."""

import numpy as np
import pytest

import equimorph as em
from typecheck import unchecked

CLAMPED_CLAMPED = 52.3562
"""[OlhoffRasmussen1977]_: P L²/B of the uniform column, a bimodal optimum; uniform: 4π²."""


def first_critical_point(column, ends, direction):
    """On the straight path of a rod with the column's stiffness under an end load."""
    rod = em.Rod(
        ends=ends, EI=1.0, length=1.0, stiffness=column.stiffness, kinks=column.s[1:-1].tolist(),
        elements=len(column.s) - 1, degree=4, loads={"P": em.PointForce(1.0, direction=direction)},
    )  # fmt: skip
    with unchecked():
        return em.limit_load(rod.natural_state(), "P", bound=1.2 * column.load)


def test_a_free_column_is_a_third_stronger():
    """[Keller1960]_: P = 4/3 · π²/4 for clamped–free ends, similar sections and equal volume."""
    with unchecked():
        column = em.strongest_column("clamped-free", 32)
    assert column.load / column.uniform == pytest.approx(4.0 / 3.0, abs=1e-6)
    assert column.uniform == pytest.approx(np.pi**2 / 4.0, rel=2e-8)
    assert column.multiplicity == 1
    assert np.trapezoid(column.area, column.s) == pytest.approx(1.0, abs=1e-12)
    found = first_critical_point(column, ("clamped", "free"), (-1.0, 0.0))
    assert found.kind == "branch point"
    assert found.value == pytest.approx(column.load, rel=1e-6)


@pytest.mark.slow
def test_between_clamps_two_modes_coincide():
    """The branch point is multiple: both loads are equal up to the barrier's last weight."""
    with unchecked():
        column = em.strongest_column("clamped-clamped", 64)
    assert column.load == pytest.approx(CLAMPED_CLAMPED, abs=2e-4)
    assert column.multiplicity == 2
    found = first_critical_point(column, ("clamped", em.End(x="free")), (-1.0, 0.0))
    assert found.value == pytest.approx(column.load, rel=1e-6)
    assert found.kind in ("multiple point", "branch point")
