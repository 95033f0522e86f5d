"""Values of exact states, events and optima as functions of a structure's data, with gradients.

Each value is a function that is stationary along the equilibrium set in the directions in which
its parameters are free: a fold is where the load is stationary, a pass where the Lagrangian is. So
its derivative by data of the structure is that along any way of the state with the data, dz with
``F_z dz + F_p dp = −F_x dx`` (the envelope theorem) [BonnansShapiro2000]_.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any, TypeVar

import numpy as np

from equimorph.arrays import Float, Lanes, Parameters, Some
from equimorph.equilibria import settle
from equimorph.equilibria.newton_step import free_directions
from equimorph.errors import InputError
from equimorph.model import Descriptor, remake
from equimorph.structures import State, Structure
from equimorph.tasks.designing.family import Carried, DesignFamily, Scalars, Vector, default_changes
from equimorph.tasks.optimising.programme import Objective, match_branches

Follow = Callable[[Structure, State], "Piece | None"]
Moved = TypeVar("Moved")
STRIDE = 0.05
"""Largest step, relative to the ranges of the variables, in which a value is followed."""
TRIALS = 2
"""Trials, each with a quarter of the steps before."""


@dataclass(frozen=True)
class Piece:
    """Values of a state that is stationary along the set, and how it is found again."""

    kind: str
    """What the state is: "start", "goal", "fold", "saddle", …."""
    state: State
    """The state."""
    values: Vector
    """Values there, which are made small or held below zero."""
    scalars: Scalars
    """Functions with these values; stationary along `tangents`."""
    free: Some
    """Places of the free parameters."""
    tangents: Carried
    """As many changes (dz, dp) along the set."""
    follow: Follow
    """The piece of another structure near a guess; None if there is none."""

    def slopes(self, family: DesignFamily, x: Vector) -> Float[np.ndarray, "m k"]:
        """Derivatives of the values by the scaled variables."""
        structure, here = self.state.structure, self._here
        count = len(x)

        def residual(made: Structure, z: Lanes, p: Parameters) -> Lanes:
            return made.residual(z, p)

        still = Carried(np.zeros_like(here.z), np.zeros_like(here.p))
        forces = [family.derivative(residual, x, k, here, still)[0] for k in range(count)]
        moves = self._moves(structure, np.array(forces))
        rows = [
            family.derivative(self.scalars, x, k, here, Carried(moves.z[[k]], moves.p[[k]]))[0]
            for k in range(count)
        ]
        return np.array(rows).T

    @property
    def _here(self) -> Carried:
        return Carried(self.state.z[None], self.state.p[None])

    def _moves(self, structure: Structure, forces: Float[np.ndarray, "k size"]) -> Carried:
        """Shortest moves onto the set of structures with other data, along the free parameters."""
        (here, along), (k, size) = (self._here, self.tangents), forces.shape
        d, scales = len(self.free), structure.scales
        directions = free_directions(structure, self.free, 1)[0]
        rhs = np.zeros((1, k, size + d))
        rhs[0, :, :size] = -forces
        z, p = (np.repeat(each, d, axis=0) for each in (here.z, here.p))
        columns = structure.parameter_derivative(z, p, directions)
        rows = along.z.copy()
        rows[:, : structure.unknowns] *= structure.mass
        corner = (along.p / scales) @ (directions / scales).T
        x = structure.solve(here.z, here.p, rhs, (columns[None], rows[None], corner[None])).x[0]
        return Carried(np.ascontiguousarray(x[:, :size]), x[:, size:] @ directions)


def follow_piece(piece: Piece, family: DesignFamily, x: Vector, to: Vector) -> Piece | None:
    """The piece at other variables, followed there in steps; None if it is lost."""
    least = max(1, int(np.ceil(np.abs(to - x).max(initial=0.0) / STRIDE)))
    for trial in range(TRIALS):
        found: Piece | None = piece
        steps = least * 4**trial
        for k in range(1, steps + 1):
            if found is not None:
                made = family.structure(x + (to - x) * (k / steps))
                found = found.follow(made, guess_on(made, found.state))
        if found is not None:
            return found
    return None


def guess_on(structure: Structure, state: State) -> State:
    """A state with the parameters that it has on another structure; no equilibrium of it yet."""
    p = state.p[None] + default_changes(state.structure, structure, state.p[None])
    return State(structure, state.z, p[0])


def stable_near(structure: Structure, state: State) -> State | None:
    """The stable equilibrium of another structure at the parameters of a state."""
    guess = guess_on(structure, state)
    found = settle(structure, guess.z[None], guess.p[None])
    good = bool(found.found[0]) and structure.index(found.z, guess.p[None])[0] == 0
    return State(structure, found.z[0], guess.p) if good else None


def value_piece(kind: str, state: State, objective: Objective, bound: float = 0.0) -> Piece:
    """Values of all branches of a descriptor at a stable state with given parameters."""
    old = state.structure
    values, places = objective.branches(state.z[None], state.p[None])
    real = np.isfinite(values[0])
    base = values[:, real], places[:, real]

    def scalars(made: Structure, z: Lanes, p: Parameters) -> Float[np.ndarray, "lanes m"]:
        there = replace(objective, descriptor=carry_over(objective.descriptor, old, made))
        lanes = (np.repeat(each, len(z), axis=0) for each in base)
        return match_branches((next(lanes), next(lanes)), there.branches(z, p)) - bound

    def follow(made: Structure, guess: State) -> Piece | None:
        found = stable_near(made, guess)
        return None if found is None else piece_at(found)

    def piece_at(here: State) -> Piece:
        found = scalars(here.structure, here.z[None], here.p[None])[0]
        none = Carried(np.zeros((0, len(here.z))), np.zeros((0, len(here.p))))
        return Piece(kind, here, found, scalars, np.zeros(0, int), none, follow)

    return piece_at(state)


def carry_over(value: Moved, old: Structure, new: Structure) -> Moved:
    """Descriptors and constraints of a structure, or records of them, made again for another one.

    Refused for a descriptor of the structure that does not remember how it was made.
    """
    if old is new or old.signature == new.signature:
        return value
    again: Moved = _make_again(value, old, new)
    return again


@lru_cache(maxsize=2048)
def _make_again(value: Any, old: Structure, new: Structure) -> Any:
    def swap(each: object) -> object:
        if isinstance(each, Structure):
            return new if each.signature == old.signature else each
        if isinstance(each, Descriptor) and each.origin == old.signature and each.made_by is None:
            raise InputError(
                "`family` needs descriptors that can be made for each structure: those of its "
                f"methods, or functions of these by `function_of`; got {each.name}."
            )
        return each

    return remake(value, swap)
