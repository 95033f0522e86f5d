"""What trusses and frames have in common, in the user's units."""

from abc import abstractmethod
from collections.abc import Callable, Mapping
from functools import cached_property
from typing import Any

import numpy as np

from equimorph.argument_checks import check_arguments
from equimorph.array_types import Float
from equimorph.arrays import Lanes, Parameters, Values
from equimorph.errors import InputError
from equimorph.model import Descriptor, Parameter, position, remember_call
from equimorph.model.parameter import Role
from equimorph.structures.contract import Symmetry
from equimorph.structures.discrete import DiscreteStructure
from equimorph.structures.network import Network, length_limits
from equimorph.structures.quantities import effort_of
from equimorph.structures.unit_system import UnitSystem

CONJUGATE = {
    **{"force": "length", "force/length": "length²", "force·length": "rad"},
    **{"1/length": "force·length²", "length": "force", "rad": "force·length", "1": "force·length"},
}
"""What does work on a parameter, by what this measures; "1" stands for several kinds."""
Function = Callable[[Lanes, Parameters], Values]


class AnyNetwork(DiscreteStructure):
    """A truss or a frame: edges between joints, with loads and actuators that its user names."""

    network: Network
    system: UnitSystem
    _actuators: dict[str, Any]
    _loads: dict[str, Any]

    # --- what it is made from -------------------------------------------------------------------

    def _name_parameters(
        self, actuators: Mapping[str, Any] | None, loads: Mapping[str, Any] | None
    ) -> None:
        """Keep what actuators and loads do, by name."""
        self._actuators, self._loads = dict(actuators or {}), dict(loads or {})

    @abstractmethod
    def quantity(self, k: int) -> str:
        """What a parameter measures, in the words force and length."""

    def _set_parameters(self, longer: Float[np.ndarray, "parameters edges"]) -> None:
        """Actuators, which may take no length to zero, and loads, all 0 by default."""
        self.length_unit, found = self.system.label("length"), []
        self.energy_unit = self.system.label("force·length")
        names = (*self._actuators, *self._loads)
        for k, (name, change) in enumerate(zip(names, longer, strict=True)):
            unit = self.system.label(self.quantity(k))
            limits = length_limits(self.network.lengths, change)
            role: Role = "actuator" if name in self._actuators else "load"
            found.append(Parameter(name, unit, 1.0, role, 0.0, *limits))
        self.parameters = tuple(found)

    def options(self) -> dict[str, Any]:
        """Arguments of the constructor that only this kind of network has, as plain data."""
        return {}

    def identity(self) -> dict[str, Any]:
        """Kind, and what the network is made from."""
        made = self.network
        supports = zip(made.joints, made.supports_data(), strict=True)
        return {
            "kind": self.kind,
            "joints": dict(zip(made.joints, made.places.tolist(), strict=True)),
            f"{made.edge}s": [each.data() for each in made.members],
            "supports": {joint: given for joint, given in supports if given},
            "loads": _plain(self._loads),
            "actuators": _plain(self._actuators),
            **self.options(),
            **({} if self.system.plain else {"units": self.system.data()}),
        }

    # --- units and symmetries -------------------------------------------------------------------

    @property
    def time_unit(self) -> str:
        """Seconds with units, else that of its numbers."""
        return self.system.time_unit

    def effort_unit(self, parameter: Parameter) -> str:
        """Unit of the effort of a parameter, like N for a length."""
        unit = parameter.unit
        known = CONJUGATE.get(unit) if self.system.plain else self.system.conjugate(unit)
        return super().effort_unit(parameter) if known is None else known

    def symmetries(self) -> tuple[Symmetry, ...]:
        """Mirror images and half turns that leave the network as it is."""
        return self._symmetries

    @cached_property
    def _symmetries(self) -> tuple[Symmetry, ...]:
        return self._find_symmetries()

    def _find_symmetries(self) -> tuple[Symmetry, ...]:
        return ()

    # --- descriptors ----------------------------------------------------------------------------

    def _make(self, name: str, quantity: str, value: Function, symbol: str = "") -> Descriptor:
        label = self.system.label(quantity)
        return Descriptor(name, label, value, symbol or name, self.signature)

    @abstractmethod
    def displacements(self, z: Lanes, p: Parameters) -> Float[np.ndarray, "lanes joints space"]:
        """Moves of the joints, in units of `displacement_unit`."""

    displacement_unit: float = 1.0
    """Length by which displacements are measured."""

    def axis(self, given: str) -> int:
        """Number of a coordinate axis.

        Raises
        ------
        InputError
            For another word.
        """
        axes = tuple("xyz"[: self.network.space])
        if given not in axes:
            raise InputError(f"`axis` must be one of {', '.join(axes)}; got {given!r}.")
        return axes.index(given)

    @check_arguments
    @remember_call
    def displacement(self, joint: str, axis: str) -> Descriptor:
        """Move of a joint along an axis, from where it is drawn."""
        at, along, unit = self.network.joint(joint), self.axis(axis), self.displacement_unit

        def value(z: Lanes, p: Parameters) -> Values:
            return np.asarray(unit * self.displacements(z, p)[:, at, along])

        return self._make(f"displacement({joint},{axis})", "length", value, f"u_{axis}({joint})")

    def effort_of(self, parameter: str) -> Descriptor:
        """∂E/∂p of a parameter."""
        return effort_of(self, parameter)

    @check_arguments
    @remember_call
    def travel(self, load: str) -> Descriptor:
        """Displacement along a load, work per unit of its parameter."""
        if self.parameters[position(self.parameters, load)].role != "load":
            raise InputError(f"`travel({load})` must be that of a load; got an actuator.")
        borne, name = effort_of(self, load), f"travel({load})"

        def value(z: Lanes, p: Parameters) -> Values:
            return -borne.function(z, p)

        return Descriptor(name, borne.unit, value, name, self.signature)

    @property
    def elevation(self) -> Descriptor:
        """The travel of the first load; without loads, what moves first, or the energy."""
        return self.travel(next(iter(self._loads))) if self._loads else self.first_move()

    def first_move(self) -> Descriptor:
        """Height in figures of the set of a network without loads."""
        return self.total_energy


def _plain(given: Any) -> Any:
    """Tables of numbers, as plain data."""
    if isinstance(given, Mapping):
        return {name: _plain(value) for name, value in given.items()}
    if isinstance(given, int | float | np.number):
        return float(given)
    return [float(value) for value in given]
