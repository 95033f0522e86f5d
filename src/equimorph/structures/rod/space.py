"""Descriptors of a rod's stability out of its plane."""

from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from equimorph.array_types import Float
from equimorph.arrays import Lanes, Parameters, Values
from equimorph.errors import InputError
from equimorph.model import Descriptor, Vanishing
from equimorph.structures.rod.criticality import NOT_JUDGED, criticality
from equimorph.structures.rod.lateral import OutOfPlane
from equimorph.structures.rod.measured import Measured
from equimorph.structures.rod.terms import Couple, Pressure, Term

LATERAL_BRANCH_POINT = "lateral branch point"
"""The event where a planar state begins to leave its plane."""


@dataclass(frozen=True, eq=False)
class LateralMode:
    """The movement out of the plane that a state resists least.

    Parameters
    ----------
    margin
        Its eigenvalue, in the unit of couples; negative where the rod leaves its plane.
    s
        Arclengths, as shares of the length.
    twist, turn
        Small rotations φ about the tangent and ψ about the normal, with ∫ φ² + ψ² ds = 1.
    z
        Sideways displacement −∫ψ, in the unit of lengths; positive in the middle.
    """

    margin: float
    s: Float[np.ndarray, " points"]
    twist: Float[np.ndarray, " points"]
    turn: Float[np.ndarray, " points"]
    z: Float[np.ndarray, " points"]


def lateral_mode(
    rod: Measured, block: OutOfPlane, z: Lanes, p: Parameters, s: Float[np.ndarray, " points"]
) -> LateralMode:
    """Mode of one state at arclengths."""
    x, mesh, n = block.mode(z, p)[0], block.mesh, block.unknowns
    phi, psi, stretch = x[0:n:2], x[1:n:2], np.empty(len(mesh.nodes))
    stretch[mesh.element_nodes] = block.coefficients(z, p).stretch[0]
    sideways = -mesh.integration(np.append(s, 1.0)) @ (stretch * psi)
    sideways -= 0.0 if block.holding.from_start else sideways[-1]
    margin = float(block.margin(z, p)[0]) * rod.units.value("couple")
    values, length = mesh.interpolation(s), rod.units.value("length")
    return LateralMode(margin, s, values @ phi, values @ psi, length * sideways[:-1])


def check_terms(terms: dict[str, tuple[Term, ...]]) -> None:
    """Refuse loads that have no potential in space.

    Raises
    ------
    InputError
        For pressure.
    """
    for name, acting in terms.items():
        if any(isinstance(term, Pressure) for term in acting):
            raise InputError(
                f"`torsion`, `lateral` must be left out for rods under the pressure `{name}`: on a "
                "curve in space pressure has no potential, so that leaving the plane is not "
                "judged. Use a dead line load."
            )


def lateral_index(rod: Measured, block: OutOfPlane, written: str) -> Descriptor:
    """Number of independent movements out of the plane that lower the energy."""

    def value(z: Lanes, p: Parameters) -> Values:
        return block.index(z, p).astype(float)

    return Descriptor(f"lateral_index{written}", "1", value, "lateral index", rod.signature)


def lateral_margin(
    rod: Measured, block: OutOfPlane, written: str, terms: dict[str, tuple[Term, ...]]
) -> Descriptor:
    """Smallest eigenvalue of the second variation for movements out of the plane."""
    unit = rod.units.value("couple")
    couples = any(isinstance(term, Couple) for acting in terms.values() for term in acting)

    def value(z: Lanes, p: Parameters) -> Values:
        return unit * block.margin(z, p)

    def not_judged(z: Lanes, p: Parameters) -> list[str]:
        del p
        return [NOT_JUDGED] * len(z)

    # beyond second order, what a couple inside the rod does in space is nobody's convention
    critical = not_judged if couples else partial(criticality, block)
    return Descriptor(
        f"lateral_margin{written}",
        rod.units.label("couple"),
        value,
        "lateral margin",
        rod.signature,
        vanishing=Vanishing(LATERAL_BRANCH_POINT, critical),
    )


def stiffness_arguments(text: str | None) -> list[Any]:
    """Stiffnesses in a descriptor's text: two numbers or texts with units, or none.

    Raises
    ------
    InputError
        For another number of them.
    """
    parts = [part.strip() for part in (text or "").split(",") if part.strip()]
    if len(parts) not in (0, 2):
        raise InputError(
            f"`lateral_margin`, `lateral_index` must have none or two stiffnesses, torsion and "
            f"lateral; got {text!r}."
        )
    return [_number_or_text(part) for part in parts]


def _number_or_text(part: str) -> float | str:
    try:
        return float(part)
    except ValueError:
        return part
