"""What rods in the plane and in space have in common, in the user's units."""

from abc import abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, wraps
from typing import Any, ClassVar, TypeVar, cast

import numpy as np

from equimorph.argument_checks import check_arguments
from equimorph.argument_vocabulary import SHARE
from equimorph.arrays import Flags, Float, Lanes, Parameters, Values
from equimorph.errors import InputError
from equimorph.model import Constraint, Descriptor, remember_call
from equimorph.model.families import Family, Member
from equimorph.structures.contract import Readers, Structure, Symmetry, Written
from equimorph.structures.equations import (
    CompiledNewton,
)  # fmt: skip
from equimorph.structures.resolution import Refinable
from equimorph.structures.rod.arclengths import (
    Arclengths,
    arclengths,
    name_at,
    read_end,
    read_fraction,
)
from equimorph.structures.rod.centreline import Centreline, arcs_through, closest_approach
from equimorph.structures.rod.discretisation import Mesh
from equimorph.structures.rod.inertia import HeavyRod
from equimorph.structures.rod.mechanics import RodMechanics
from equimorph.structures.rod.sections import SectionProperties
from equimorph.structures.rod.space_options import SpaceOptions
from equimorph.structures.rod.terms import Term
from equimorph.structures.rod.units import Units
from equimorph.structures.states import State, States
from equimorph.structures.unit_system import Quantity, Units as SystemSpec, unit_system
from equimorph.structures.whole_turns import WholeTurns

ENDLESS = 20.0
"""Curvature, times the length, that is proposed as the bound of a set."""
BOUNDING = {*((f"max_{name}", "<=") for name in ("curvature", "strain", "stress")),
            ("safety_factor", ">=")}  # fmt: skip
"""Descriptors and senses of constraints that bound the curvature of a rod."""
TOUCHING = 1e-9
"""Distance, as a share of the length, at which a rod without a thickness touches itself."""
COORDINATES = ("x", "height", "z")
"""Names of the descriptors of coordinates."""
_SYMBOLS = {0.5: "½", 1 / 3: "1/3", 2 / 3: "2/3", 0.25: "¼", 0.75: "¾"}

Peaks = Float[np.ndarray, "lanes peaks"]
Method = TypeVar("Method", bound=Callable[..., Any])
Branches = Callable[[Lanes, Parameters], tuple[Peaks, Peaks]]
"""Local maxima along the rod, and their arclengths."""


@dataclass(frozen=True)
class Coordinate:
    """x, y or z (axis 0, 1, 2) along a rod."""

    rod: "AnyRod"
    axis: int

    def __call__(self, z: Lanes, p: Parameters, s: Arclengths) -> Float[np.ndarray, "lanes points"]:
        """Values at arclengths."""
        return self.rod.places(z, p, s)[:, :, self.axis]


def by_mechanics(method: Method) -> Method:
    """A method of the contract of structures that rods leave to their mechanics."""

    @wraps(method)
    def answer(rod: "AnyRod", *given: Any, **named: Any) -> Any:
        return getattr(rod.mechanics, method.__name__)(*given, **named)

    vars(answer).pop("__isabstractmethod__", None)  # which `wraps` copies
    return cast(Method, answer)


class AnyRod(HeavyRod, Refinable):
    """A rod: mechanics in non-dimensional numbers inside, the user's units outside.

    Unknowns, multipliers, residuals and energies are non-dimensional; parameters, shapes and
    descriptors are in the user's units.
    """

    written: ClassVar[Written] = {
        "max_curvature": "max_curvature",
        "max_shortening": "max_shortening",
        "energy": "total_energy",
        "clearance(s)": "clearance",
        "support_force(x)": "support_force",
    }
    readers: ClassVar[Readers] = {"s": read_fraction, "0": read_end}
    mechanics: RodMechanics
    units: Units
    space_options: SpaceOptions
    """The cross-section, or the stiffnesses out of the plane, as given."""

    @property
    def mesh(self) -> Mesh:
        """Elements along the rod."""
        return self.mechanics.mesh

    @property
    def longest_piece(self) -> float:
        """Length of the rod."""
        return self.units.value("length")

    @property
    def section(self) -> SectionProperties | None:
        """Stiffnesses and weight of the section in the rod's units; None if none was given."""
        return self.space_options.properties(self.units)

    @property
    @abstractmethod
    def terms(self) -> dict[str, tuple[Term, ...]]:
        """Loads and actuators that act on the rod, by the name of their amplitude."""

    def _use_units(
        self,
        options: SpaceOptions,
        EI: Quantity | None,
        length: Quantity | None,
        units: SystemSpec | None,
        lengths: Mapping[str, Any],
        mass: Quantity | None = None,
    ) -> None:
        """Set the units by stiffness and mass, or by the section; check the `lengths` by name."""
        system = unit_system(units)
        self.space_options = options.check(EI, length)
        self.units = options.units(EI, length, system, mass)
        system.check_all_have_units(options.quantities | {"EI": EI, "length": length, **lengths})

    def _use_mechanics(self, mechanics: RodMechanics) -> None:
        """Set the mechanics, and what the contract of structures asks of them."""
        self.mechanics = mechanics
        self.unknowns, self.constraints = mechanics.unknowns, mechanics.constraints
        self.mass, self.fused_directions = mechanics.mass, mechanics.fused_directions
        self.length_unit, self.energy_unit = self.units.label("length"), self.units.energy_label
        self.energy_scale = self.units.value("couple")

    def _complete_identity(
        self, data: dict[str, Any], resolution: tuple[int, int]
    ) -> dict[str, Any]:
        """Identity from what differs from the default, with section and resolution."""
        data = {"kind": self.kind, **data, **self.space_options.data()}
        if self.space_options.section is not None:  # which gives it
            data.pop("EI")
        return {**data, "elements": resolution[0], "degree": resolution[1]}

    # --- the contract, by the mechanics ---------------------------------------------------------

    energy = by_mechanics(Structure.energy)
    residual = by_mechanics(Structure.residual)
    parameter_derivative = by_mechanics(Structure.parameter_derivative)
    second_derivative = by_mechanics(Structure.second_derivative)
    enclosure = by_mechanics(Structure.enclosure)
    effort = by_mechanics(Structure.effort)
    solve = by_mechanics(Structure.solve)
    linear_system = by_mechanics(Structure.linear_system)
    advance = by_mechanics(Structure.advance)
    advance_under = by_mechanics(Structure.advance_under)
    respond = by_mechanics(Structure.respond)
    correction = by_mechanics(Structure.correction)
    index = by_mechanics(Structure.index)
    sample = by_mechanics(Structure.sample)
    resolved = by_mechanics(Structure.resolved)

    @property
    def compiled_newton(self) -> CompiledNewton | None:
        """Newton's method of the mechanics, if it is compiled."""
        return self.mechanics.compiled_newton

    @property
    def whole_turns(self) -> WholeTurns:
        """Whole turns of a rod whose ends may turn."""
        return self.mechanics.whole_turns

    def symmetries(self) -> tuple[Symmetry, ...]:
        """Mirror images and half turns of equilibria that are equilibria."""
        return self._symmetries

    @cached_property
    def _symmetries(self) -> tuple[Symmetry, ...]:
        return self.mechanics.symmetries()

    # --- shapes ---------------------------------------------------------------------------------

    @abstractmethod
    def places(
        self, z: Lanes, p: Parameters, s: Arclengths
    ) -> Float[np.ndarray, "lanes points axes"]:
        """Coordinates at arclengths."""

    @abstractmethod
    def centreline(self, z: Lanes, p: Parameters, s: Arclengths) -> Centreline:
        """Places, tangents and normals at arclengths."""

    @abstractmethod
    def largest_curvature(self, z: Lanes, p: Parameters) -> tuple[Values, Values]:
        """Largest bending curvature along the rod, and the arclength where it occurs."""

    def shape(
        self, z: Lanes, p: Parameters, s: Arclengths | None = None
    ) -> Float[np.ndarray, "lanes points axes"]:
        """Coordinates at arclengths `s` (default: 101 equidistant ones)."""
        return self.places(z, p, arclengths(s))

    def arcs(self, z: Lanes, p: Parameters) -> Float[np.ndarray, "lanes arcs 4 axes"]:
        """Shape as cubic arcs with the rod's positions and their derivatives at their ends."""
        return arcs_through(lambda s: self.places(z, p, s))

    # --- natural states -------------------------------------------------------------------------

    @check_arguments
    def natural_state(self, **values: float) -> State:
        """Natural state at given actuators: unloaded, continued from the stress-free rod.

        Raises
        ------
        InputError
            For unknown or meaningless parameters, a load that is not 0, Θ ≤ 0 for the clamped arch
            (the straight rod has no upright side), where the continuation from the stress-free
            shape meets a fold, or where the elements do not resolve it.
        """
        p = self.natural_parameters(values)
        z, found = self.natural(p[None])
        if found[0]:
            return State(self, z[0], p)
        raise InputError(self.explain_no_natural_state(p))

    def natural_states(self, p: Parameters) -> tuple[States, Flags]:
        """Natural states of many settings, and which of them were found."""
        z, found = self.natural(p)
        return States(self, z, p), found

    def explain_no_natural_state(self, p: Float[np.ndarray, " parameters"]) -> str:
        """Error message where the continuation from the stress-free rod ends before `p`."""
        given = ", ".join(
            f"{each.name}={value:g}" for each, value in zip(self.parameters, p, strict=True)
        )
        return (
            f"`natural_state` must be reached from the stress-free rod; got {given}, and the "
            "continuation ends before. A straight rod buckles either way: turn an end, give it "
            "curvature, or choose ends nearer to the stress-free ones."
        )

    # --- descriptors ----------------------------------------------------------------------------

    @check_arguments
    def height(self, s: float) -> Descriptor:
        """y(s), in units of L."""
        return self.coordinate(1, s)

    @remember_call
    def coordinate(self, axis: int, s: float) -> Descriptor:
        """x(s), y(s) or z(s) (axis 0, 1, 2), in units of L."""
        along = Coordinate(self, axis)
        return self.field_at(s, COORDINATES[axis], "xyz"[axis], "length", along)

    def field_at(
        self, s: float, name: str, symbol: str, quantity: str, field: Family
    ) -> Descriptor:
        """Descriptor of a field along the rod at one arclength."""
        if not 0.0 <= s <= 1.0:  # in texts: numbers are checked before
            raise InputError(f"`s` must be {SHARE.words}; got {s!r}.")
        value = Member(field, np.array([s], float))
        label, symbol = self.units.label(quantity), f"{symbol}({_SYMBOLS.get(s, f'{s:g}')})"
        return Descriptor(name_at(name, float(s)), label, value, symbol, self.signature)

    @property
    def may_collapse(self) -> bool:
        """A rod that stretches may be pressed together, too."""
        return self.mechanics.is_extensible

    def shortenings(self, z: Lanes, p: Parameters) -> Float[np.ndarray, "lanes points"]:
        """Elastic shortenings of the axis at the nodes of every element."""
        return self.mechanics.shortenings(z, p)

    @property
    def elevation(self) -> Descriptor:
        """y(½)."""
        return self.height(0.5)

    def max_curvature_descriptor(self, branches: Branches | None = None) -> Descriptor:
        """Largest bending curvature; `branches` are its local maxima, where they are known."""

        def value(z: Lanes, p: Parameters) -> Values:
            return self.largest_curvature(z, p)[0]

        def place(z: Lanes, p: Parameters) -> Values:
            return self.largest_curvature(z, p)[1]

        label = self.units.label("curvature")
        return Descriptor("max_curvature", label, value, "max |κ|", self.signature, place, branches)

    @property
    @abstractmethod
    def max_curvature(self) -> Descriptor:
        """max_s |κ(s)| in units of 1/L, ends and interior extrema included."""

    @abstractmethod
    def support_force(self, component: str) -> Descriptor:
        """Component of the force of the support at A on the rod."""

    @remember_call
    def support_force_along(self, axis: int, component: str) -> Descriptor:
        """Component of the force of the support at A along an axis."""
        unit = self.units.value("force")

        def value(z: Lanes, p: Parameters) -> Values:
            return unit * self.mechanics.support_forces(z, p)[:, axis]

        name, label = f"support_force({component})", self.units.label("force")
        return Descriptor(name, label, value, "λμν"[axis], self.signature)

    @check_arguments
    @remember_call
    def clearance(self, apart: float = 0.1) -> Descriptor:
        """Smallest distance between points whose arclengths differ by `apart` at least.

        Contact is not modelled: a rod of thickness h touches itself where this is below h.
        """
        if not 0.0 < apart < 1.0:  # in texts, too
            raise InputError(
                f"`apart` must be a share of the rod's length between 0 and 1; got {apart!r}."
            )

        def value(z: Lanes, p: Parameters) -> Values:
            return closest_approach(lambda s: self.places(z, p, s), apart)[0]

        def place(z: Lanes, p: Parameters) -> Values:
            return closest_approach(lambda s: self.places(z, p, s), apart)[1]

        name, label = f"clearance({apart:.9g})", self.units.label("length")
        return Descriptor(name, label, value, "clearance", self.signature, place)

    def missing_bound(self, within: Sequence[Constraint]) -> str:
        """Rods wind up without end unless their curvature, strain or stress is bounded."""
        given = {(each.descriptor.name.partition("(")[0], each.sense) for each in within}
        largest = ENDLESS * self.units.value("curvature")
        return "" if given & BOUNDING else f"max_curvature <= {largest:g}"

    def warn_of_contact(self, state: State, thickness: float) -> tuple[str, ...]:
        """One line where a rod of some thickness touches itself in a state."""
        distance = self.clearance()(state)
        free = distance > max(thickness, TOUCHING * self.units.value("length"))
        return () if free else (f"the rod touches itself: points come as near as {distance:.3g}",)
