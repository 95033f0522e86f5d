"""What the Lagrangians of rods in the plane and in space have in common."""

from abc import ABC
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar, TypeVar

import numpy as np

from equimorph.arrays import Float
from equimorph.structures.material_points import SupportSpring, SupportSprings
from equimorph.structures.rod.discretisation import Mesh
from equimorph.structures.rod.ends import FREE, Axis, compliance

Rows = Float[np.ndarray, "axes scalars"]
Model = TypeVar("Model", bound="RodLagrangian")


@dataclass(frozen=True, eq=False)
class RodLagrangian(ABC):
    """Lagrangian of a rod in its unknowns and its *scalars* y = (multipliers, parameters, 1)."""

    rows: ClassVar[tuple[str, ...]]
    """Further fields whose first axis counts the scalars."""
    last: ClassVar[tuple[str, ...]]
    """Further fields whose last axis counts the scalars."""

    mesh: Mesh
    names: tuple[str, ...]
    """Parameters."""
    multipliers: int
    """Number of supports that act against each other along an axis."""
    held: tuple[bool, bool]
    """Whether the rotations of the ends are prescribed."""
    quadratic: Float[np.ndarray, "scalars scalars"]
    """Q of the part ½ yᵀ Q y."""
    reaction: Float[np.ndarray, "axes scalars"]
    """Force of the support at A."""
    origin: Float[np.ndarray, "axes scalars"]
    """Coordinates of end A, or of end B where `from_start` is False. Like all rows, they combine
    the scalars."""
    from_start: tuple[bool, ...]
    springs_along: SupportSprings
    """Springs of the ends along axes."""

    @property
    def scalars(self) -> int:
        """Number of multipliers and parameters, and 1 for the constant."""
        return self.multipliers + len(self.names) + 1

    def map_scalars(
        self: Model, names: Sequence[str], matrix: Float[np.ndarray, "scalars others"]
    ) -> Model:
        """The same rod in new parameters ``y``, of which its scalars are ``matrix @ y``."""
        quadratic = matrix.T @ self.quadratic @ matrix
        mapped: dict[str, Any] = {each: map_rows(matrix, getattr(self, each)) for each in self.rows}
        mapped |= {
            each: getattr(self, each) @ matrix for each in ("reaction", "origin", *self.last)
        }
        return replace(self, names=tuple(names), quadratic=quadratic, **mapped)


def map_rows(
    matrix: Float[np.ndarray, "scalars others"], rows: Float[np.ndarray, "scalars ..."]
) -> Float[np.ndarray, "others ..."]:
    """Coefficients of the scalars ``matrix @ y`` as coefficients of y."""
    return np.asarray(np.einsum("jk,j...->k...", matrix, rows))


@dataclass(frozen=True, eq=False)
class SupportEnergy:
    """Energy of the supports ½ yᵀ Q y, and what follows from them; rows combine the scalars y.

    reaction: force of the support at A; origin: coordinates of end A, or of end B along axes in
    which A is free (`from_start` is False).
    """

    quadratic: Float[np.ndarray, "scalars scalars"]
    reaction: Rows
    origin: Rows
    from_start: tuple[bool, ...]
    springs: SupportSprings


def support_energy(
    axes: Sequence[Axis], forces: Float[np.ndarray, "scalars axes"], place: Mapping[str, int]
) -> SupportEnergy:
    """Energy of the supports along axes in which the ends are held, free or on springs.

    With λ the force of the support at A, F that of all loads, x the place of B's support, and
    compliances c: ``−(λ + F) x − ½ c_A λ² − ½ c_B (λ + F)²``, end A at ``−c_A λ``, end B at
    ``x + c_B (λ + F)``. Without opposed supports λ is −F or 0.

    `forces`: total force of all loads as a combination of the scalars; multipliers come first in
    these. `place`: scalars of the parameters by name.
    """
    count, multiplier = len(forces), 0
    quadratic = np.zeros((count, count))
    reactions, origin = np.zeros((2, forces.shape[1], count))
    from_start, soft = [], []
    multipliers = sum(axis.opposed for axis in axes)
    for axis in axes:
        unit = np.array(axis.unit)
        total = forces @ unit
        reaction, site = np.zeros(count), np.zeros(count)
        if axis.opposed:
            reaction[multiplier] = 1.0
            site[place[axis.name]] = 1.0
            multiplier += 1
        elif axis.last == FREE:
            reaction = -total
        rest = reaction + total
        reactions += np.outer(unit, reaction)
        quadratic -= np.outer(rest, site) + np.outer(site, rest)
        if axis.first != FREE:
            quadratic -= compliance(axis.first) * np.outer(reaction, reaction)
            origin -= compliance(axis.first) * np.outer(unit, reaction)
        if axis.last != FREE:
            quadratic -= compliance(axis.last) * np.outer(rest, rest)
        if axis.first == FREE:
            origin += compliance(axis.last) * np.outer(unit, rest)
        soft += _springs_of(axis, reaction[:multipliers], rest[:multipliers])
        from_start.append(axis.first != FREE)
    springs = SupportSprings.of(soft, multipliers, forces.shape[1])
    return SupportEnergy(quadratic, reactions, origin, tuple(from_start), springs)


def _springs_of(
    axis: Axis, first: Float[np.ndarray, " multipliers"], last: Float[np.ndarray, " multipliers"]
) -> list[SupportSpring]:
    """Stiffness, gap and moves of the springs at A and B; the rod is drawn from the first held."""
    unit, drawn_from_last = np.array([axis.unit]), axis.first == FREE
    both = (axis.first, first, not drawn_from_last), (axis.last, -last, drawn_from_last)
    return [
        SupportSpring(held, gap, unit if moves else 0.0 * unit)
        for held, gap, moves in both
        if not isinstance(held, str)
    ]
