"""The contract of structures: the methods by which the rest of the package uses them.

Those that Newton's method needs are in `structures.equations`.

`CompiledSteps` are what a structure offers whose paths are followed by loops compiled as a whole.
"""

import json
import re
from abc import abstractmethod
from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar, Self

import numpy as np

from equimorph.argument_checks import check_arguments
from equimorph.arrays import Flags, Float, Int, Lanes, Parameters, Values
from equimorph.errors import InputError, suggestion
from equimorph.model import (
    Call,
    Constraint,
    Descriptor,
    Drawing,
    Parameter,
    Rebuilt,
    names_of,
    parameter_vector,
    remember_call,
)
from equimorph.model.obstacle import straight_arcs
from equimorph.structures.guesses import many_if_cheap
from equimorph.structures.material_points import Inertial
from equimorph.structures.whole_turns import WholeTurns
from equimorph.tables import html_table


@dataclass(frozen=True)
class CompiledSteps:
    """Loops over the kernels of a structure: they follow straight lines in its parameters.

    Forces on the unknowns may change along these, too.

    Their results are those of `Structure.advance` and of the constraints.
    """

    march: Callable[..., int]
    """`marching.tick_kernels.march_of`, made with the structure's step and values of
    constraints."""
    search: Callable[..., int]
    """`marching.search_kernels.search_of`, made with the same."""
    tables: tuple[tuple[np.ndarray, ...], ...]
    """What these share among lanes."""
    bounds: Float[np.ndarray, "constraints 4"]
    """The constraints, one a row, as the structure's kernel reads them."""
    guard: float
    """Least ratio of the pivots of a step; below it `Structure.advance` takes the step."""


@dataclass(frozen=True)
class Symmetry:
    """An involution of unknowns and parameters that maps equilibria to equilibria."""

    name: str
    apply: Callable[[Lanes, Parameters], tuple[Lanes, Parameters]]
    signs: Float[np.ndarray, " parameters"]
    """Sign of each parameter of the image: −1 where it is reversed."""
    order: Int[np.ndarray, " parameters"] | None = None
    """Number of the parameter from which each one comes; None: all keep their place."""
    along_orbits: bool = False
    """Whether states are led to their images by turns along which the energy stays the same."""

    def image(
        self, p: Float[np.ndarray, "*lanes parameters"]
    ) -> Float[np.ndarray, "*lanes parameters"]:
        """Parameters of the image: ``signs · p[order]``."""
        return np.asarray(self.signs * (p if self.order is None else p[..., self.order]))


_CALL = re.compile(r"\s*(\w+)\s*(?:\(([^()]*)\))?\s*")
"""Text of a descriptor: its name, and its arguments in parentheses if it has some."""
Written = Mapping[str, str | Callable[..., Descriptor]]
Readers = Mapping[str, Callable[[str], Any]]


@dataclass(frozen=True)
class Growth:
    """Whether the energy is smooth for all u and grows at infinity.

    Then Σ (−1)^index of all equilibria is the Euler characteristic of the configurations: 1 of Rⁿ,
    and 0 where angles turn over [Milnor1965]_.

    applies: whether that is so, shown or promised; promised: by the author of the energy only;
    total: the sum.
    """

    applies: bool
    reason: str
    promised: bool = False
    total: int = 1


class Structure(Rebuilt, Inertial):
    """A structure with energy E(u; p), constraints c(u; p) = 0 and L = E + λ·c.

    All methods take and return batches, lanes first. F = (∂L/∂u, c), with the derivatives and
    solves of `Equations`. A subclass gives the attributes without a value here and there and all
    abstract methods, and `drawing` if there are loads; its `kind` is registered in
    `equimorph.structures.KINDS`.
    """

    _call: Call
    kind: ClassVar[str]
    parameters: tuple[Parameter, ...]
    length_unit: str = "1"
    """Unit of the coordinates to draw."""
    upward: ClassVar[str] = "y"
    """Axis, y or z, that is upward in pictures of a structure in space."""
    unresolved: str = "the discretisation does not resolve the state: refine it"
    """What is told where states are not `resolved`, and what helps there."""
    longest_step: float = 0.7
    """Length in the metric to which steps of Newton's method from random guesses are shortened."""
    energy_scale: float = 1.0
    """Value of one unit of `energy` in the units of the parameters, in joules for example."""

    @cached_property
    def scales(self) -> Float[np.ndarray, " parameters"]:
        """Change of each parameter that counts as one unit of length."""
        return np.array([parameter.scale for parameter in self.parameters])

    def __repr__(self) -> str:
        """Kind and parameters."""
        return f"{type(self).__name__}({', '.join(names_of(self.parameters))})"

    def _repr_html_(self) -> str:
        """Table of the parameters, for notebooks."""
        rows = [
            [each.name, each.role, "none" if each.default is None else each.default, each.unit]
            for each in self.parameters
        ]
        head = ("parameter", "role", "default", "unit")
        return html_table(f"{type(self).__name__} with {self.size} unknowns", head, rows)

    @abstractmethod
    def identity(self) -> dict[str, Any]:
        """Return the kind, and the arguments of the constructor as plain data, by their names."""

    def __new__(cls, *arguments: Any, **named: Any) -> Self:
        """Keep the call, for what the identity cannot hold: functions."""
        made = super().__new__(cls)
        made._call = Call(cls, arguments, named)
        return made

    @property
    def origin_call(self) -> Call:
        """The constructor with the identity, or as it was called if functions were given."""
        try:
            data = self.identity()
        except InputError:
            return self._call
        data.pop("kind")
        return Call(type(self), (), data)

    @cached_property
    def signature(self) -> Hashable:
        """The identity as one text; the structure itself if it cannot be written down."""
        try:
            return json.dumps(self.identity(), sort_keys=True)
        except InputError:
            return self

    @abstractmethod
    def energy(self, z: Lanes, p: Parameters) -> Values:
        """Potential energy E."""

    @abstractmethod
    def effort(self, z: Lanes, p: Parameters) -> Parameters:
        """∂L/∂p: work-conjugates of the parameters (actuator efforts, the loads' displacements)."""

    def effort_unit(self, parameter: Parameter) -> str:
        """Unit of the effort of a parameter, like N m for an angle."""
        if parameter.unit in ("", "1", "rad"):
            return self.energy_unit
        return f"{self.energy_unit}/({parameter.unit})"

    @abstractmethod
    def natural(self, p: Parameters) -> tuple[Lanes, Flags]:
        """Unloaded state from which the structure starts, and whether it was found."""

    def in_reach(self, p: Parameters) -> Flags:
        """Whether there may be states at parameters: false where supports are too far apart."""
        return np.ones(len(p), bool)

    def may_be_natural(self, p: Parameters) -> Flags:
        """Whether natural states are defined at parameters; they need not exist everywhere."""
        return np.ones(len(p), bool)

    def unloaded(self) -> Mapping[str, float]:
        """Parameter values at which natural states are defined: all loads zero."""
        return {each.name: 0.0 for each in self.parameters if each.role == "load"}

    def natural_parameters(self, values: Mapping[str, float]) -> Float[np.ndarray, " parameters"]:
        """Parameters of a natural state: loads as in `unloaded`, the rest as given or by default.

        Raises
        ------
        InputError
            For unknown or meaningless parameters, or a load that has another value.
        """
        for name, rest in self.unloaded().items():
            if values.get(name, rest) != rest:
                raise InputError(
                    f"`{name}` must be {rest:g} in the natural state; got {values[name]!r}."
                )
        return parameter_vector(self.parameters, {**values, **self.unloaded()})

    @abstractmethod
    def sample(self, p: Parameters, generator: np.random.Generator) -> Lanes:
        """Random guesses, one per lane, spread over what equilibria may look like."""

    @property
    def guesses_per_start(self) -> float:
        """Random guesses for each start of a search, by default by their cost: `many_if_cheap`."""
        return many_if_cheap(self.size)

    def special_guesses(self, p: Parameters) -> Float[np.ndarray, "guesses lanes size"]:
        """Guesses to which random ones rarely lead, several per lane; by default there are none."""
        return np.zeros((0, len(p), self.size))

    def as_guess(self, mean: Lanes) -> Lanes:
        """Guesses at means of states; by default the means themselves."""
        return mean

    @abstractmethod
    def resolved(self, z: Lanes, p: Parameters) -> Flags:
        """Whether states lie within what the discretisation can represent."""

    def have_orbits(self, p: Parameters) -> Flags:
        """Whether a continuous symmetry moves equilibria at parameters; they are not isolated then.

        Lifts keep to one phase (`pick_on_orbits`); sets refuse such parameters, and searches
        unless `finds_orbits`.
        """
        return np.zeros(len(p), bool)

    def along_orbits(self, z: Lanes, p: Parameters) -> Lanes:
        """Rates of z at which a continuous symmetry moves states; 0 where none does."""
        return np.zeros_like(z)

    def pick_on_orbits(self, z: Lanes, p: Parameters, towards: Parameters) -> Lanes:
        """States from which paths to other parameters begin; by default the given ones.

        Where a continuous symmetry carries states over into each other, all along the way, the one
        that the structure's phase condition picks.
        """
        return z

    @property
    def whole_turns(self) -> WholeTurns:
        """Whole turns of what nothing, or springs alone, keep from it; none by default."""
        return WholeTurns.none(self.size)

    @property
    def validity(self) -> tuple[Constraint, ...]:
        """Constraints beyond which the energy does not describe the structure; none by default.

        Sets end there as at constraints that are asked for, and searches count no states beyond.
        """
        return ()

    @abstractmethod
    def shape(
        self, z: Lanes, p: Parameters, s: Float[np.ndarray, " points"] | None = None
    ) -> Float[np.ndarray, "lanes points space"]:
        """Coordinates to draw, in the plane or in space."""

    def frames(
        self, z: Lanes, p: Parameters, s: Float[np.ndarray, " points"] | None = None
    ) -> Float[np.ndarray, "lanes points 3 3"] | None:
        """Cross-sections at the points of `shape`, where a structure in space has them.

        The columns are the unit tangent, normal and binormal.
        """
        return None

    @property
    def flatness(self) -> float:
        """Width along the binormal over thickness along the normal, of cross-sections to draw."""
        return 1.0

    def arcs(self, z: Lanes, p: Parameters) -> Float[np.ndarray, "lanes arcs 4 space"]:
        """Shape as cubic arcs: both ends, and the derivatives there; straight lines by default."""
        return straight_arcs(self.shape(z, p))

    def drawing(self, z: Lanes, p: Parameters) -> Drawing:
        """Supports, loads and actuators to draw around the shape; none by default.

        A structure with loads draws each as a force or a couple proportional to it.
        """
        return Drawing()

    written: ClassVar[Written] = {"energy": "total_energy"}
    """Properties, methods or functions that make descriptors, by the texts that mean these.

    Like ``{"energy": "total_energy", "displacement(joint,axis)": "displacement"}``: the arguments
    in a text are given to the method as `readers` read them.
    """
    readers: ClassVar[Readers] = {}
    """How arguments in such a text are read, by their names there; as texts by default."""
    finds_orbits: ClassVar[bool] = False
    """Whether searches find the states on orbits that `pick_on_orbits` gives."""
    energy_unit: str = "energy"
    """Unit of the descriptor ``energy``."""

    @check_arguments
    def descriptor(self, text: str) -> Descriptor:
        """Return the descriptor written like one of the texts in `written`.

        Every structure knows ``energy``, which reports show.
        """
        found = _CALL.fullmatch(text)
        name, inner = found.groups() if found else ("", None)
        given = [each.strip() for each in inner.split(",")] if inner and inner.strip() else []
        for form, maker in self.written.items():
            called, _, needed = form.rstrip(")").partition("(")
            kinds = needed.split(",") if needed else []
            if called == name and len(kinds) == len(given):
                pairs = zip(kinds, given, strict=True)
                values = [self.readers.get(kind, _without_spaces)(each) for kind, each in pairs]
                made = maker(self, *values) if callable(maker) else getattr(self, maker)
                return made if isinstance(made, Descriptor) else made(*values)
        written = tuple(self.written)
        raise InputError(
            f"`descriptor` must be one of {', '.join(written)}; got {text!r}."
            f"{suggestion(text, written)}"
        )

    @property
    @remember_call
    def total_energy(self) -> Descriptor:
        """Potential energy with that of the loads: `energy` times `energy_scale`."""

        def value(z: Lanes, p: Parameters) -> Values:
            return np.asarray(self.energy_scale * self.energy(z, p))

        return Descriptor("energy", self.energy_unit, value, "E", self.signature)

    @property
    def elevation(self) -> Descriptor:
        """Descriptor that is the height in figures of the set: the energy by default."""
        return self.total_energy

    @property
    def support_reactions(self) -> tuple[Descriptor, ...]:
        """Descriptors of the forces and couples of its supports; none by default."""
        return ()

    def symmetries(self) -> tuple[Symmetry, ...]:
        """Symmetries of the equilibrium set; none unless the structure says so."""
        return ()

    def growth(self, p: Float[np.ndarray, " parameters"]) -> Growth:
        """Whether the energy at parameters p is smooth on Rⁿ and grows at infinity."""
        return Growth(False, "it is not known whether the energy grows at infinity")

    def error_estimate(self, z: Lanes, p: Parameters) -> Values:
        """Discretisation error of the unknowns; zero for discrete structures."""
        return np.zeros(len(z))

    @property
    def is_discretised(self) -> bool:
        """Whether a finer discretisation resolves more; elsewhere `resolved` only bounds states."""
        return type(self).error_estimate is not Structure.error_estimate

    def may_resolve(self, z: Lanes, p: Parameters) -> Flags:
        """Whether finer discretisations may resolve states that this one does not."""
        return np.full(len(z), self.is_discretised)

    def missing_bound(self, within: Sequence[Constraint]) -> str:
        """Bound to add where there are equilibria without end within others; empty if none."""
        return ""

    def compiled_steps(self, within: Sequence[Constraint]) -> CompiledSteps | None:
        """Compiled loops that follow straight lines under constraints; None: there are none."""
        return None

    @property
    def watched(self) -> tuple[Descriptor, ...]:
        """Descriptors whose zeros are events on the lift of one state; see `Vanishing`."""
        return ()

    def index_out_of_plane(self, z: Lanes, p: Parameters) -> Int[np.ndarray, " lanes"] | None:
        """Independent movements out of the plane that lower the energy; None: not judged."""
        return None


def _without_spaces(text: str) -> str:
    return re.sub(r"\s", "", text)
