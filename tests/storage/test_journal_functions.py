"""A journal belongs to the functions of its question, not to their names."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import equimorph as em
from equimorph.manifold import EquilibriumSet
from equimorph.model import Descriptor
from typecheck import unchecked

BOX = em.Box(F=(-0.2, 0.2))


def lifted(path: Path, function: Callable[..., object]) -> EquilibriumSet:
    """Set of a short spring within a bound on a user's descriptor, with a journal."""
    spring = em.Spring()
    within = [Descriptor("mine", "1", function) <= 0.5]
    with unchecked(), em.storage.open_journal(path) as journal:
        return em.equilibrium_set(
            spring, BOX, fixed={"x_l": 0.8}, within=within, intervals=(8,), checks=0,
            journal=journal,
        )  # fmt: skip


def angle(z, p):
    return z[:, 0]


def height(z, p):
    return np.tan(z[:, 0]) * p[:, 0]


def test_another_function_of_the_same_name_is_another_question(tmp_path: Path):
    """The bound on the angle is met at δ = 0.5, that on the height at tan δ = 0.5/0.8."""
    first = lifted(tmp_path / "journal", angle)
    assert first.points.z[:, 0].max() == pytest.approx(0.5, abs=1e-9)
    with pytest.raises(em.InputError, match="must be that of this very computation"):
        lifted(tmp_path / "journal", height)
    again = lifted(tmp_path / "journal", angle)
    np.testing.assert_array_equal(again.points.z, first.points.z)
    other = lifted(tmp_path / "other", height)
    assert other.points.z[:, 0].max() == pytest.approx(np.arctan(0.5 / 0.8), abs=1e-9)


def test_a_function_that_cannot_be_told_is_refused_by_name_and_nothing_is_written(tmp_path: Path):
    with (
        (tmp_path / "table").open("w") as file,
        pytest.raises(em.InputError, match="`mine` must be computed from numbers") as found,
    ):
        lifted(tmp_path / "journal", lambda z, p: z[:, 0] + 0.0 * file.fileno())
    assert "\n" not in str(found.value)
    assert not (tmp_path / "journal").exists()
