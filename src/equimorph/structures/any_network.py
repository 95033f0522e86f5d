"""What trusses and frames have in common, in the user's units; their mirror images."""

from abc import abstractmethod
from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import product
from typing import Any

import numpy as np

from equimorph.argument_checks import check_arguments
from equimorph.arrays import Float, Int, Lanes, Parameters, Values
from equimorph.errors import InputError
from equimorph.model import Descriptor, Parameter, position, remember_call
from equimorph.model.parameter import Role
from equimorph.structures.contract import Structure, Symmetry
from equimorph.structures.discrete import DiscreteStructure
from equimorph.structures.network import Network, length_limits
from equimorph.structures.quantities import effort_of
from equimorph.structures.unit_system import UnitSystem
from equimorph.tolerances import SAME_NUMBER

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

    @property
    @abstractmethod
    def _symmetries(self) -> tuple[Symmetry, ...]:
        """The same, found once."""

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
        """Number of a coordinate axis; other words are refused."""
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
    """Tables of numbers and names, as plain data."""
    if isinstance(given, Mapping):
        return {name: _plain(value) for name, value in given.items()}
    if isinstance(given, str):
        return given
    if isinstance(given, int | float | np.number):
        return float(given)
    return [_plain(value) for value in given]


Apply = Callable[[Lanes, Parameters], tuple[Lanes, Parameters]]
Signs = Float[np.ndarray, " space"]
Joints = Int[np.ndarray, " joints"]
Ends = Int[np.ndarray, "edges 2"]

NAMES: dict[tuple[int, ...], str] = {
    (-1, 1): "mirror",
    (1, -1): "reflection",
    (-1, -1): "half turn",
}


def images(places: Float[np.ndarray, "joints space"]) -> Iterator[tuple[str, Signs, Joints]]:
    """Reflections and half turns about the middle that take joints to joints.

    Yields names, signs of the axes, and the joint in the place of whose image each joint comes to
    be.
    """
    middle = 0.5 * (places.min(axis=0) + places.max(axis=0))
    near = SAME_NUMBER * np.ptp(places, axis=0).max()
    for signs in product((1, -1), repeat=places.shape[1]):
        if min(signs) == 1:
            continue
        moved = middle + np.array(signs) * (places - middle)
        apart = np.abs(moved[:, None] - places).max(axis=2)
        there = apart.argmin(axis=1)
        if (apart.min(axis=1) <= near).all() and len(set(there.tolist())) == len(places):
            flipped = "".join(axis for axis, sign in zip("xyz", signs, strict=False) if sign < 0)
            yield NAMES.get(signs, f"image in {flipped}"), np.array(signs, float), there


def edges_of_image(ends: Ends, joints: Joints) -> Int[np.ndarray, " edges"] | None:
    """The edge on which each comes to lie in an image; None if one does not lie on any."""
    pairs = [frozenset(pair) for pair in ends.tolist()]
    moved = [frozenset(joints[list(pair)].tolist()) for pair in pairs]
    if set(moved) != set(pairs):
        return None
    return np.array([pairs.index(pair) for pair in moved])


def sign_between(a: np.ndarray, b: np.ndarray) -> float | None:
    """1 if two arrays are equal, −1 if one is minus the other, else None."""
    near = SAME_NUMBER * max(np.abs(a).max(initial=0.0), np.abs(b).max(initial=0.0))
    for sign in (1.0, -1.0):
        if np.abs(a - sign * b).max(initial=0.0) <= near:
            return sign
    return None


def parameter_exchange(
    here: Sequence[np.ndarray], image: Sequence[np.ndarray]
) -> tuple[Float[np.ndarray, " parameters"], Int[np.ndarray, " parameters"]] | None:
    """Signs and order (see `Symmetry`) of parameters whose effects have images among each other.

    None if an effect has no such image, or the image of the image is another one.
    """
    count = len(here)
    signs, order = np.zeros(count), np.full(count, -1)
    for k in range(count):
        for j in (k, *range(count)):  # stays where it is, if it may
            sign = sign_between(image[k], here[j])
            if sign is not None and order[j] < 0:
                signs[j], order[j] = sign, k
                break
    if (order < 0).any() or (order[order] != range(count)).any():
        return None
    return (signs, order) if (signs[order] == signs).all() else None


def is_symmetry(structure: Structure, apply: Apply) -> bool:
    """Whether an image of unknowns and parameters leaves the Lagrangian as it is.

    Tested at random points and along random directions there: with L the same, D L at the image
    along the image of a direction is that at the point along the direction.
    """
    generator = np.random.default_rng(20)
    count, n = 6, structure.unknowns
    z = 0.1 * generator.normal(size=(count, structure.size))
    z[:, :n] /= np.sqrt(structure.mass * n)
    p = 0.1 * generator.normal(size=(count, len(structure.parameters))) * structure.scales
    dz = generator.normal(size=z.shape)
    there, at = apply(z, p)
    # images are affine in (z, p): their linear part is the difference of two of them
    moved = apply(z + dz, p)[0] - there
    here = (structure.residual(z, p) * dz).sum(axis=1)
    image = (structure.residual(there, at) * moved).sum(axis=1)
    size = np.abs(structure.residual(z, p) * dz).sum(axis=1)
    return bool((np.abs(here - image) <= SAME_NUMBER * size).all())
