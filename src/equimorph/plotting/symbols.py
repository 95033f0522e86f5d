"""Printed symbols and axis labels of parameters and descriptors."""

from collections.abc import Sequence

from equimorph.model import Constraint, Descriptor, position
from equimorph.structures import Structure

_SYMBOLS = {
    "Theta": "Θ",
    "Delta": "Δ",
    "theta_A": "$θ_A$",
    "theta_B": "$θ_B$",
    "nu": "ν",
    "q": "$q$",
    "x_l": "$x_l$",
    "F": "$F$",
    "k": "$k$",
    "max_curvature": "max |κ|",
}


def symbol(name: str) -> str:
    """Symbol of a parameter or descriptor by name; one without a symbol is put in plain words.

    Examples
    --------
    >>> symbol("Theta"), symbol("max_curvature"), symbol("tip_load")
    ('Θ', 'max |κ|', 'tip load')
    """
    return _SYMBOLS.get(name, name.replace("_", " "))


def with_unit(label: str, unit: str) -> str:
    """Label with its unit in brackets; a pure number has none.

    Examples
    --------
    >>> with_unit("Δ", "rad"), with_unit("ν", "")
    ('Δ (rad)', 'ν')
    """
    return label if unit in ("", "1") else f"{label} ({unit})"


def parameter_label(structure: Structure, name: str) -> str:
    """Axis label of a parameter."""
    parameter = structure.parameters[position(structure.parameters, name)]
    return with_unit(symbol(name), parameter.unit)


def descriptor_label(descriptor: Descriptor) -> str:
    """Axis label of a descriptor."""
    printed = _SYMBOLS.get(descriptor.name) or descriptor.symbol or symbol(descriptor.name)
    return with_unit(printed, descriptor.unit)


def constraint_label(constraints: Sequence[Constraint]) -> str:
    """Legend entry for the edges that constraints cut into a set."""
    named = [
        f"{c.descriptor.symbol or symbol(c.descriptor.name)} = {c.bound:g}" for c in constraints
    ]
    return " or ".join(named) or "edge of the set"
