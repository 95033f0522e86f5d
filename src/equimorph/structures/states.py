"""Equilibrium states: a single one, and batches of them."""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from enum import StrEnum
from functools import cached_property
from typing import Any, Protocol, overload, runtime_checkable

import numpy as np

from equimorph.argument_checks import check_arguments
from equimorph.arrays import Determinants, Flags, Float, Int, Lanes, Parameters, Values
from equimorph.errors import InputError, MissingError
from equimorph.model import Descriptor, Drawing, names_of, position
from equimorph.structures.contract import Structure
from equimorph.structures.margin import stability_margin
from equimorph.structures.vibration import vibrations
from equimorph.tables import Column, Table, Tabular, heading, html_table, units_of

SHOWN = 20
"""Number of states that notebooks show."""


class SpaceStability(StrEnum):
    """Whether a planar state also resists movements out of its plane; true only if it does."""

    STABLE = "stable"
    UNSTABLE = "unstable"
    NOT_JUDGED = "not judged"

    def __bool__(self) -> bool:
        """Whether it is known to be stable."""
        return self is SpaceStability.STABLE


@dataclass(frozen=True, eq=False)
class States(Tabular):
    """A batch of equilibrium states of one structure, one per lane."""

    structure: Structure
    z: Lanes
    p: Parameters

    def __len__(self) -> int:
        """Number of states."""
        return len(self.z)

    def __iter__(self) -> Iterator["State"]:
        """Go through the states one by one."""
        return (State(self.structure, z, p) for z, p in zip(self.z, self.p, strict=True))

    @overload
    def __getitem__(self, key: int | np.int64) -> "State": ...
    @overload
    def __getitem__(self, key: str) -> Values: ...
    @overload
    def __getitem__(self, key: slice | np.ndarray | list[int]) -> "States": ...
    def __getitem__(self, key: Any) -> Any:
        """One state, a parameter of all states by name, or a sub-batch."""
        if isinstance(key, str):
            return self.p[:, position(self.structure.parameters, key)]
        if isinstance(key, int | np.integer):
            return State(self.structure, self.z[key], self.p[key])
        some = States(self.structure, self.z[key], self.p[key])
        if "index" in vars(self):  # what was computed is kept
            vars(some)["index"] = self.index[key]
        return some

    def __repr__(self) -> str:
        """Kind and number."""
        return f"States({self.structure.kind}: {len(self)})"

    def _repr_html_(self) -> str:
        """Table of parameters that differ, index, margin and energy, for notebooks."""
        shown, parameters = self[:SHOWN], self.structure.parameters
        names = [each.name for each in parameters if len(set(self[each.name].tolist())) != 1]
        units = units_of(parameters)
        energy = self.structure.descriptor("energy").unit
        columns = [*(shown[name] for name in names), shown.index, shown.margin, shown.energy]
        head = [
            *(heading(name, units[name]) for name in names),
            "index",
            "margin",
            heading("energy", energy),
        ]
        more = f", the first {SHOWN}" if len(self) > SHOWN else ""
        rows = [[k, *row] for k, row in enumerate(zip(*columns, strict=True))]
        return html_table(f"{self!r}{more}", ["", *head], rows)

    @property
    def table(self) -> Table:
        """Parameters, index, energy, and the descriptor that tells states apart; see `frame`."""
        return self.table_with({"index": self.index})

    def table_with(self, known: Mapping[str, Column], more: Iterable[Descriptor] = ()) -> Table:
        """Parameters, known columns, energy, what tells states apart and further descriptors."""
        shown = [self.structure.descriptor("energy"), self.structure.elevation, *more]
        measured = {each.name: each(self) for each in shown}
        units = units_of((*self.structure.parameters, *shown))
        return Table({**self.parameters, **known, **measured}, units)

    @property
    def parameters(self) -> dict[str, Values]:
        """All parameters by name, one number for each state."""
        return {name: self[name] for name in names_of(self.structure.parameters)}

    @cached_property
    def index(self) -> Int[np.ndarray, " lanes"]:
        """Negative eigenvalues of the constrained Hessian; 0 is stable."""
        return self.structure.index(self.z, self.p)

    @cached_property
    def inertia(self) -> tuple[Int[np.ndarray, " lanes"], Determinants]:
        """Index, counted at these states, and determinant of F_z, of one factorisation."""
        nothing = np.zeros((len(self.z), 0, self.p.shape[1]))
        told = self.structure.respond(self.z, self.p, nothing)
        return told.index, told.determinant

    @property
    def stable(self) -> "States":
        """The stable states."""
        keep = self.index == 0
        return States(self.structure, self.z[keep], self.p[keep])

    @cached_property
    def index_out_of_plane(self) -> Int[np.ndarray, " lanes"]:
        """Independent movements out of the plane that lower the energy.

        Raises
        ------
        InputError
            Where the structure has no stiffnesses out of its plane.
        """
        index = self.structure.index_out_of_plane(self.z, self.p)
        if index is None:
            raise MissingError(
                "`structure` must have stiffnesses out of its plane to be judged in space, like "
                f"Rod(..., torsion=0.77, lateral=1.0); got a {self.structure.kind} without."
            )
        return index

    @property
    def stable_in_space(self) -> "States":
        """The states that are stable in their plane and against movements out of it."""
        keep = (self.index == 0) & (self.index_out_of_plane == 0)
        return States(self.structure, self.z[keep], self.p[keep])

    @cached_property
    def margin(self) -> Values:
        """Smallest eigenvalue of the constrained Hessian with respect to the mass matrix."""
        return stability_margin(self.structure, self.z, self.p)

    @check_arguments
    def natural_frequencies(self, count: int = 1) -> Float[np.ndarray, "lanes count"]:
        """Lowest angular frequencies of small free vibrations, in radians per unit of time.

        The unit of time is the structure's `time_unit`: seconds where it has units, and
        T = √(m L/λ_cr) for rods without. Parameters rest.

        Raises
        ------
        InputError
            If a state is not stable, the structure has no mass, or it has fewer free movements.
        """
        return vibrations(self.structure, self.z, self.p, count).frequencies

    @cached_property
    def energy(self) -> Values:
        """Potential energy E."""
        return self.structure.energy(self.z, self.p) * self.structure.energy_scale

    @property
    def multipliers(self) -> Float[np.ndarray, "lanes constraints"]:
        """Multipliers λ of the constraints: the supports' forces on a rod."""
        return np.asarray(self.z[:, self.structure.unknowns :])

    @cached_property
    def residual(self) -> Values:
        """Largest absolute entry of F."""
        force = self.structure.residual(self.z, self.p)
        return np.asarray(np.maximum(force.max(axis=1), -force.min(axis=1)))

    @cached_property
    def error_estimate(self) -> Values:
        """Estimated discretisation error; see the structure for what it bounds."""
        return self.structure.error_estimate(self.z, self.p)

    @cached_property
    def resolved(self) -> Flags:
        """Whether the discretisation represents the states."""
        return self.structure.resolved(self.z, self.p)

    @check_arguments
    def shape(
        self, s: Float[np.ndarray, " points"] | None = None
    ) -> Float[np.ndarray, "lanes points space"]:
        """Coordinates to draw, in the structure's unit of length."""
        return self.structure.shape(self.z, self.p, s)

    @check_arguments
    def frames(
        self, s: Float[np.ndarray, " points"] | None = None
    ) -> Float[np.ndarray, "lanes points 3 3"] | None:
        """Cross-sections at the points of `shape`: columns tangent, normal, binormal.

        None if the structure has no cross-sections in space.
        """
        return self.structure.frames(self.z, self.p, s)

    def drawing(self) -> Drawing:
        """Supports, loads and actuators to draw around the shapes."""
        return self.structure.drawing(self.z, self.p)


@runtime_checkable
class Points(Protocol):
    """What has unknowns and parameters: states, one or several, and points of other records."""

    @property
    def z(self) -> Float[np.ndarray, "..."]:
        """Unknowns and multipliers."""

    @property
    def p(self) -> Float[np.ndarray, "..."]:
        """Parameters."""


def join_states(structure: Structure, parts: Iterable[Points]) -> States:
    """States of several batches, and single ones, one after the other.

    Parameters
    ----------
    structure
        To which all belong.
    parts
        Any number of them, also none.
    """
    given = list(parts)
    z, p = [np.zeros((0, structure.size))], [np.zeros((0, len(structure.parameters)))]
    for each in given:
        alone = each.z.ndim == 1
        z.append(each.z[None] if alone else each.z)
        p.append(each.p[None] if alone else each.p)
    states = States(structure, np.concatenate(z), np.concatenate(p))
    if given and all("index" in vars(each) for each in given):
        vars(states)["index"] = np.concatenate([vars(each)["index"] for each in given])
    return states


@dataclass(frozen=True, eq=False)
class State:
    """One equilibrium state: unknowns and multipliers z, and all parameters p."""

    structure: Structure
    z: Float[np.ndarray, " size"]
    p: Float[np.ndarray, " parameters"]

    @cached_property
    def batch(self) -> States:
        """The state as a batch of one."""
        return States(self.structure, self.z[None].copy(), self.p[None].copy())

    def __getitem__(self, name: str) -> float:
        """Parameter by name."""
        return float(self.p[position(self.structure.parameters, name)])

    def __repr__(self) -> str:
        """Kind, parameters and index."""
        values = ", ".join(f"{name}={value:.6g}" for name, value in self.parameters.items())
        return f"State({self.structure.kind}: {values}; index {self.index})"

    def _repr_html_(self) -> str:
        """Table of parameters, index, margin and energy, for notebooks."""
        rows = [[each.name, self[each.name], each.unit] for each in self.structure.parameters]
        energy = self.structure.descriptor("energy")
        rows += [["index", self.index, ""], ["margin", self.margin, ""]]
        rows += [["energy", self.energy, energy.unit]]
        stability = "stable" if self.stable else "unstable"
        head = ("", "value", "unit")
        return html_table(f"State of a {self.structure.kind}, {stability}", head, rows)

    @property
    def parameters(self) -> dict[str, float]:
        """All parameters by name."""
        names = names_of(self.structure.parameters)
        return dict(zip(names, map(float, self.p), strict=True))

    @property
    def index(self) -> int:
        """Negative eigenvalues of the constrained Hessian; 0 is stable."""
        return int(self.batch.index[0])

    @property
    def stable(self) -> bool:
        """Whether the state is a strict constrained minimum of the energy in its plane."""
        return self.index == 0

    @property
    def stable_in_space(self) -> SpaceStability:
        """Whether it also resists all movements out of the plane; true if it is known to.

        "not judged" where the structure has no stiffnesses out of its plane.
        """
        if not self.stable:
            return SpaceStability.UNSTABLE
        index = self.structure.index_out_of_plane(self.z[None], self.p[None])
        if index is None:
            return SpaceStability.NOT_JUDGED
        return SpaceStability.STABLE if index[0] == 0 else SpaceStability.UNSTABLE

    @property
    def margin(self) -> float:
        """Smallest eigenvalue of the constrained Hessian with respect to the mass matrix."""
        return float(self.batch.margin[0])

    @check_arguments
    def natural_frequencies(self, count: int = 1) -> Float[np.ndarray, " count"]:
        """Lowest angular frequencies of small free vibrations; see `States.natural_frequencies`.

        Examples
        --------
        A cantilever without load, 1.8751²/(2π) and 4.6941²/(2π) per T:

        >>> from equimorph import PointForce, Rod
        >>> rod = Rod(ends=("clamped", "free"), loads={"P": PointForce(1.0)})
        >>> rod.natural_state().natural_frequencies(2).round(4).tolist()
        [0.5596, 3.5069]
        """
        return np.asarray(self.batch.natural_frequencies(count)[0])

    @property
    def energy(self) -> float:
        """Potential energy E."""
        return float(self.batch.energy[0])

    @property
    def multipliers(self) -> Float[np.ndarray, " constraints"]:
        """Multipliers λ of the constraints: the support's force on a rod."""
        return np.asarray(self.batch.multipliers[0])

    @property
    def residual(self) -> float:
        """Largest absolute entry of F."""
        return float(self.batch.residual[0])

    @property
    def error_estimate(self) -> float:
        """Estimated discretisation error; see the structure for what it bounds."""
        return float(self.batch.error_estimate[0])

    @property
    def resolved(self) -> bool:
        """Whether the discretisation represents the state."""
        return bool(self.batch.resolved[0])

    @check_arguments
    def shape(
        self, s: Float[np.ndarray, " points"] | None = None
    ) -> Float[np.ndarray, "points space"]:
        """Coordinates to draw, in the structure's unit of length."""
        return np.asarray(self.batch.shape(s)[0])


@check_arguments
def natural_state(structure: Structure, /, **values: float) -> State:
    """Natural state of any structure: unloaded, at given or default values of the parameters.

    Parameters
    ----------
    structure
        The structure.
    **values
        Values of parameters by name, in their units; loads are those of `Structure.unloaded`.

    Raises
    ------
    InputError
        If a parameter is unknown, has no meaning or is a load, or if no natural state is found.

    Examples
    --------
    >>> from equimorph import Spring, natural_state
    >>> natural_state(Spring(), x_l=0.8)
    State(spring: x_l=0.8, F=0, k=1; index 0)
    """
    p = structure.natural_parameters(values)
    z, found = structure.natural(p[None])
    if not found[0]:
        settings = ", ".join(f"{name}={value:g}" for name, value in values.items())
        raise InputError(
            f"`{structure.kind}` must have a natural state; none is found at "
            f"{settings or 'the defaults'}, coming from the defaults."
        )
    return State(structure, z[0], p)
