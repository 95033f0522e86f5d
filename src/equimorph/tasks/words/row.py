"""Rows of bistable units in series, from the energies of the units."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from equimorph.argument_checks import check_arguments
from equimorph.arrays import Float
from equimorph.equilibria import find_equilibria, settle
from equimorph.errors import InputError
from equimorph.model import Constraint, Parameter, parameter_vector
from equimorph.structures import EnergyStructure, States, Unknown

FARTHEST = 3.0
"""Elongations between which equilibria of a unit are searched, both ways."""


@check_arguments
@dataclass(frozen=True)
class Row:
    """Bistable units in series, between a wall and a machine that pulls.

    ``E = Σ eᵢ(uᵢ) + k/2 (Σ uᵢ − d)² − F Σ uᵢ``: with k = 0 a dead load F acts on all units alike;
    with k > 0 the machine, of stiffness k, moves by the stroke d, and units feel each other.

    Parameters
    ----------
    units
        Energy of each unit as a formula of its elongation u, at rest at u = 0 as it is made, like
        ``"(u*(u - 2))**2/4"`` or that of two bars of a von Mises truss.

    Raises
    ------
    InputError
        If there is no unit, or a unit does not have two stable states at rest with one equilibrium
        between them.
    """

    units: Sequence[str]

    def __post_init__(self) -> None:
        """Check the units."""
        if len(self.units) == 0:
            raise InputError("`units` must name at least one unit; got none.")

    @cached_property
    def structure(self) -> EnergyStructure:
        """The row as a structure: unknowns u1, u2, …; parameters F, d and k."""
        names = [f"u{k}" for k in range(1, len(self.units) + 1)]
        return _structure(self.units, names)

    @cached_property
    def wells(self) -> Float[np.ndarray, "units 3"]:
        """Elongations of each unit at its three equilibria without load, increasing."""
        known: dict[str, Float[np.ndarray, " 3"]] = {}
        for number, unit in enumerate(self.units):
            if unit not in known:
                found = find_equilibria(_structure([unit], ["u1"]), {})
                order = np.argsort(found.z[:, 0])
                if found.index[order].tolist() != [0, 1, 0]:
                    raise InputError(
                        f"`units[{number}]` must have two stable equilibria and one between them; "
                        f"got {unit!r}, with {len(found)}."
                    )
                known[unit] = found.z[order, 0]
        return np.array([known[unit] for unit in self.units])

    @property
    def letters(self) -> tuple[Constraint, ...]:
        """One for each unit: whether it is longer than in its unstable equilibrium."""
        middles, own = self.wells[:, 1].tolist(), self.structure
        return tuple(own.descriptor(f"u{k}") >= u for k, u in enumerate(middles, 1))

    def rest(self) -> States:
        """All equilibria without load and machine: each combination of those of the units."""
        axes = np.meshgrid(*self.wells, indexing="ij")
        z = np.stack([axis.ravel() for axis in axes], axis=1)
        p = np.tile(parameter_vector(self.structure.parameters, {}), (len(z), 1))
        return States(self.structure, settle(self.structure, z, p).z, p)


def _structure(units: Sequence[str], names: Sequence[str]) -> EnergyStructure:
    total, pairs = " + ".join(names), zip(units, names, strict=True)
    energies = {f"e{name}": re.sub(r"\bu\b", name, unit) for unit, name in pairs}
    return EnergyStructure(
        f"{' + '.join(energies)} + k/2*(total - d)**2 - F*total",
        [Unknown(name, 0.0, (-FARTHEST, FARTHEST)) for name in names],
        [
            Parameter("F", "1", 1.0, "load"),
            Parameter("d", "1", 1.0, "actuator", 0.0),
            Parameter("k", "1", 1.0, "fixed", 0.0),
        ],
        definitions={"total": total, **energies},
        descriptors={"elongation": "total"},
    )
