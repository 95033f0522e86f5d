"""Symbols and units as they are printed."""

import pytest

from equimorph.plotting.labels import (
    constraint_label,
    descriptor_label,
    parameter_label,
    symbol,
    with_unit,
)
from equimorph.structures import Rod, Spring


@pytest.mark.parametrize(
    ("name", "printed"),
    [("Theta", "Θ"), ("theta_A", "$θ_A$"), ("nu", "ν"), ("x_l", "$x_l$"), ("tip_load", "tip load")],
)
def test_names_become_symbols_or_plain_words(name, printed):
    assert symbol(name) == printed


def test_a_pure_number_has_no_brackets():
    assert with_unit("ν", "") == "ν"


def test_labels_of_the_arch_carry_symbols_and_units():
    arch = Rod()
    assert parameter_label(arch, "Theta") == "Θ (rad)"
    assert descriptor_label(arch.height(0.5)).endswith("(L)")
    assert descriptor_label(arch.max_curvature) == "max |κ| (1/L)"


def test_labels_of_the_spring_carry_symbols_and_units():
    spring = Spring()
    assert parameter_label(spring, "x_l") == "$x_l$ (natural length)"
    assert descriptor_label(spring.angle) == "δ (rad)"


def test_a_cap_is_named_by_its_bound():
    assert constraint_label([Rod().max_curvature <= 20]) == "max |κ| = 20"


def test_a_set_without_constraints_has_a_plain_edge():
    assert constraint_label([]) == "edge of the set"
