"""The truss: bars between pinned joints, loads on joints, bars that change their length."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from typing import Annotated, Any, ClassVar

import numpy as np

from equimorph.argument_checks import check_arguments
from equimorph.arrays import Float, Lanes, Parameters, Values, Velocity
from equimorph.errors import InputError
from equimorph.model import Descriptor, remember_call
from equimorph.structures.collapse import Shortening
from equimorph.structures.contract import Symmetry
from equimorph.structures.discrete import correct_at_parameters
from equimorph.structures.material_points import Product
from equimorph.structures.network import Joints, check_parameter_names, direction_of_mechanism
from equimorph.structures.truss.mechanics import BarValues, TrussMechanics, symmetries
from equimorph.structures.truss.network import (
    AXES,
    BarSpec,
    Energies,
    Strain,
    TrussNetwork,
    truss_network,
)
from equimorph.structures.unit_system import Quantity, Units, unit_system
from equimorph.tolerances import SINGULAR

Forces = Annotated[
    Mapping[str, Mapping[str, Sequence[float]]],
    "forces of finite numbers by joint, by the name of the load, like `{'F': {'B': (0, -1)}}`",
]
Rates = Annotated[
    Mapping[str, Mapping[str, float]],
    "finite rates by bar, by the name of the actuator, like `{'a': {'A-B': 1.0}}`",
]

NodalMasses = Annotated[Mapping[str, Quantity], "masses by joint, like `{'B': '0.2 kg'}`"]

AXES_BY_JOINT = "held axes by joint, like `{'A': 'xy'}`"

TINY = 1e-300
"""In place of zero in denominators."""


class Truss(TrussMechanics, Shortening):
    """Pin-jointed elastic bars in the plane or in space, with displacements of any size.

    Each bar has the energy ½ EA l₀ ε² with its rest length l₀ and engineering strain ε = l/l₀ − 1
    or Green strain ε = (l²/l₀² − 1)/2; nodal forces are dead loads. Unknowns are the displacements
    of the joints, in units of length, from the places where they are drawn. The metric measures
    them by a typical move: a tenth of a bar, or less if the stiffness changes sooner.
    The natural state is the equilibrium without load nearest to the drawing: the drawing itself,
    unless bars have other rest lengths. Engineering strain has a kink where a bar shrinks to a
    point, and sheets of the set end there: sets are bounded by ``max_shortening <= 0.99``, and
    states beyond are not resolved. Green strain has no kink.

    Parameters
    ----------
    joints
        Places by name, of two or three coordinates.
    bars
        `Bar`s, or pairs of joints.
    supports
        Held axes by joint, like ``{"A": "xy", "C": "y"}``.
    loads
        Patterns of nodal forces by the name of the load parameter, which multiplies them:
        ``{"F": {"B": (0, -1)}}``.
    actuators
        Changes of rest lengths by the name of the actuator, in units of length per unit of the
        parameter: ``{"a": {"A-B": 1.0}}``.
    strain
        "engineering" or "green".
    masses
        Masses at joints by name, like ``{"B": "0.2 kg"}``, beside those of bars: in kg or as texts,
        as of `Bar`. Where anything has a mass, every joint that moves must get some.
    units
        Units of force and length of all numbers, like ``{"force": "kN", "length": "mm"}``; places,
        lengths and stiffnesses may then be texts with units. None: any one system.

    Raises
    ------
    InputError
        For a joint without bars, a stiffness or length that is not positive, supports that leave
        nothing free, a load or actuator without effect, a mechanism (with the joint that moves), or
        rest lengths without an equilibrium nearby.

    Examples
    --------
    >>> from equimorph import Truss
    >>> arch = Truss({"A": (-1, 0), "B": (0, 0.1), "C": (1, 0)}, [("A", "B"), ("B", "C")],
    ...     {"A": "xy", "C": "xy"}, {"F": {"B": (0, -1)}})
    >>> arch.natural_state()
    State(truss: F=0; index 0)
    """

    @check_arguments
    def __init__(  # what a truss can have
        self,
        joints: Joints,
        bars: Iterable[BarSpec],
        supports: Annotated[Mapping[str, str], AXES_BY_JOINT],
        loads: Forces | None = None,
        actuators: Rates | None = None,
        strain: Strain = "engineering",
        *,
        masses: NodalMasses | None = None,
        units: Units | None = None,
    ) -> None:
        system = unit_system(units)
        made = truss_network(joints, bars, supports, system)
        self._name_parameters(actuators, loads)
        check_parameter_names([*self._actuators, *self._loads])
        stiffness = np.array([float(bar.EA) for bar in made.members])
        energies = Energies(strain == "green", stiffness)
        rates = _rates(made, self._actuators)
        forces = [made.vector(each, f"loads.{name}") for name, each in self._loads.items()]
        super().__init__(
            made,
            energies,
            np.pad(rates, ((0, 0), (0, len(forces)))),
            np.array([*np.zeros((len(self._actuators), len(made.moves))), *forces]),
            system,
        )
        self._set_parameters(self.rates.T)
        self._masses = dict(masses or {})
        self._set_masses()
        self._start = self._equilibrium()
        self._set_scales()

    def _set_masses(self) -> None:
        """Sum the masses of joints and bars at the unknowns."""
        made, total = self.network, np.zeros(len(self.network.joints))
        for joint, mass in self._masses.items():
            total[made.joint(joint)] += self.system.mass(mass, f"masses.{joint}")
        for bar, ends in zip(made.members, made.ends, strict=True):
            if bar.mass is not None:
                total[ends] += 0.5 * self.system.mass(bar.mass, f"mass of bar {bar.name}")
        free = ~made.held
        bare = np.flatnonzero(free.any(axis=1) & (total == 0.0))
        if total.any() and len(bare):
            raise InputError(
                f"`masses` must leave no joint that moves without mass; got none at "
                f"{made.joints[bare[0]]}."
            )
        self._nodal_masses = np.repeat(total[:, None], made.space, axis=1)[free]

    @property
    def massless(self) -> str:
        """How a truss is given its mass."""
        return 'Give its joints or bars some, like Truss(..., masses={"B": 0.2}).'

    def inertia(self, z: Lanes, p: Parameters) -> Float[np.ndarray, "lanes unknowns unknowns"]:
        """Diagonal mass matrix of the joints."""
        if not self._nodal_masses.any():
            return super().inertia(z, p)
        return np.repeat(np.diag(self._nodal_masses)[None], len(z), axis=0)

    def inertia_product(self, z: Lanes, p: Parameters) -> Product:
        """Function that multiplies by the nodal masses, without a matrix."""
        if not self._nodal_masses.any():
            return super().inertia_product(z, p)
        return lambda v: np.asarray(self._nodal_masses * v)

    def inertial_force(self, z: Lanes, p: Parameters, velocity: Velocity) -> Velocity:
        """Zero: the mass matrix is constant."""
        return np.zeros_like(velocity)

    @property
    def _rest_load(self) -> Float[np.ndarray, "1 parameters"]:
        return np.zeros((1, len(self.parameters)))

    def _equilibrium(self) -> Float[np.ndarray, " unknowns"]:
        """Displacements at rest; refuse mechanisms."""
        p, drawn = self._rest_load, np.zeros((1, self.unknowns))
        z, found = correct_at_parameters(self, drawn, p)
        found &= np.abs(z).max() <= np.ptp(self.network.places, axis=0).max()
        stiffness = self.layout.dense(self.entries(z if found[0] else drawn, p))[0]
        values, vectors = np.linalg.eigh(stiffness)
        if np.abs(values).min() <= SINGULAR * np.abs(values).max():
            self._refuse_mechanism(vectors[:, int(np.argmin(np.abs(values)))])
        if not found[0] or values.min() < 0.0:
            raise InputError(
                "`rest` lengths must allow a stable equilibrium without load near the joints as "
                "drawn; Newton's method found none. Draw the joints closer to it."
            )
        return np.asarray(z[0])

    def _set_scales(self) -> None:
        """Measure moves by a typical one, and parameters by what makes it, if linearly.

        Typical is a tenth of a bar, or the move v along a parameter at which the change of
        stiffness, ½ vᵀ D²F[v, v], reaches the stiffness vᵀ F_z v, if that is smaller: the rise of
        a shallow arch, say.
        """
        count = len(self.parameters)
        z, p = (np.repeat(array, count, axis=0) for array in (self._start[None], self._rest_load))
        columns = self.parameter_derivative(z, p, np.eye(count))
        moves = self.solve(z, p, -columns[:, None]).x[:, 0]
        rates = np.maximum(np.abs(moves).max(axis=1), TINY)
        v = moves / rates[:, None]
        stiff = -(columns * v).sum(axis=1) / rates
        along = (v, np.zeros_like(p))
        bend = np.abs((self.second_derivative(z, p, along, along) * v).sum(axis=1))
        tenth = 0.1 * float(self.network.lengths.mean())
        typical = min(tenth, float((2.0 * stiff / np.maximum(bend, TINY)).min()))
        self.mass = np.full(self.unknowns, typical**-2)
        self.parameters = tuple(
            replace(each, scale=typical / rate)
            for each, rate in zip(self.parameters, rates.tolist(), strict=True)
        )

    def _refuse_mechanism(self, mode: Float[np.ndarray, " unknowns"]) -> None:
        moves = np.zeros(self.network.held.shape)
        moves[~self.network.held] = mode
        at, direction = direction_of_mechanism(moves)
        raise InputError(
            f"`truss` must not be a mechanism; joint {self.network.joints[at]} can move along "
            f"({direction}) without force. Add a bar or a support."
        )

    def options(self) -> dict[str, Any]:
        """Kind of strain, and masses at the joints."""
        strain = "green" if self.energies.green else "engineering"
        return {"strain": strain, **({"masses": dict(self._masses)} if self._masses else {})}

    def quantity(self, k: int) -> str:
        """Actuators are changes of length, loads are forces."""
        return "length" if k < len(self._actuators) else "force"

    def natural_guess(self, p: Parameters) -> Lanes:
        """The state at rest."""
        return np.repeat(self._start[None], len(p), axis=0)

    @cached_property
    def _symmetries(self) -> tuple[Symmetry, ...]:
        return symmetries(self)

    # --- descriptors ----------------------------------------------------------------------------

    written: ClassVar[Mapping[str, str]] = {
        "force(bar)": "force",
        "reaction(joint, axis)": "reaction",
        "utilisation(bar)": "utilisation",
        "max_utilisation": "max_utilisation",
        "max_shortening": "max_shortening",
        "displacement(joint, axis)": "displacement",
        "travel(load)": "travel",
        "effort(parameter)": "effort_of",
        "energy": "total_energy",
    }

    @check_arguments
    @remember_call
    def force(self, bar: str) -> Descriptor:
        """Force in a bar, positive in tension."""
        at = self.network.bar(bar)

        def value(z: Lanes, p: Parameters) -> Values:
            return self.energies.force(*self.lengths(z, p))[:, at].copy()

        name = self.network.members[at].name
        return self._make(f"force({name})", "force", value, f"N({name})")

    @check_arguments
    def reaction(self, joint: str, axis: str) -> Descriptor:
        """Force of a support on its joint along an axis that it holds."""
        at, along = self.network.held_move(joint, axis)

        def value(z: Lanes, p: Parameters) -> Values:
            return self.joint_forces(z, p)[:, at, along].copy()

        return self._make(f"reaction({joint},{axis})", "force", value)

    @property
    def support_reactions(self) -> tuple[Descriptor, ...]:
        """Forces of all supports along the axes that they hold."""
        joints, held = self.network.joints, np.argwhere(self.network.held).tolist()
        return tuple(self.reaction(joints[at], AXES[along]) for at, along in held)

    def _utilisations(self, z: Lanes, p: Parameters) -> BarValues:
        """Compression over the Euler load π² EI/l₀² [TimoshenkoGere1961]_; −∞ without EI."""
        given = [np.nan if bar.EI is None else float(bar.EI) for bar in self.network.members]
        squared, rest = self.lengths(z, p)
        share = -self.energies.force(squared, rest) * rest**2 / (np.pi**2 * np.array(given))
        return np.where(np.isnan(given), -np.inf, share)

    @check_arguments
    @remember_call
    def utilisation(self, bar: str) -> Descriptor:
        """Compression of a bar over its Euler load π² EI/l₀²."""
        at = self.network.bar(bar)
        name = self.network.members[at].name
        if self.network.members[at].EI is None:
            raise InputError(f"`utilisation({name})` must be of a bar with EI; got one without.")

        def value(z: Lanes, p: Parameters) -> Values:
            return self._utilisations(z, p)[:, at].copy()

        return self._make(f"utilisation({name})", "1", value, f"U({name})")

    @property
    @remember_call
    def max_utilisation(self) -> Descriptor:
        """Largest utilisation of the bars that have a bending stiffness."""
        if all(bar.EI is None for bar in self.network.members):
            raise InputError(
                "`max_utilisation` must be of a truss with EI; got no bar that has one."
            )

        def value(z: Lanes, p: Parameters) -> Values:
            return np.asarray(self._utilisations(z, p).max(axis=1))

        return self._make("max_utilisation", "1", value, "max U")

    @property
    def may_collapse(self) -> bool:
        """Green strain holds at length zero, too."""
        return not self.energies.green

    @check_arguments
    def displacement(self, joint: str, axis: str) -> Descriptor:
        """Displacement of a joint along an axis, from where it is drawn."""
        self.network.move(joint, axis)  # which has to be free
        return super().displacement(joint, axis)

    def first_move(self) -> Descriptor:
        """The first displacement."""
        return self.displacement(*self.network.moves[0].split("."))


def _rates(made: TrussNetwork, actuators: Rates) -> Float[np.ndarray, "bars actuators"]:
    rates = np.zeros((len(made.members), len(actuators)))
    for k, (name, given) in enumerate(actuators.items()):
        if not (given and all(given.values())):
            raise InputError(f"`actuators.{name}` must give rates by bar, not 0; got {given!r}.")
        for bar, rate in given.items():
            rates[made.bar(bar), k] = rate
    return rates
