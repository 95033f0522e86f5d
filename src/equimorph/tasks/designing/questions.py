"""What a design is asked for: limit loads, extrema along routes, values of states; bounds on them.

A question answers for one structure of a family, near its answer for another one, by a full
computation: a lift, or an equilibrium set with its lowest way. Each answer consists of pieces that
can be followed, and differentiated, by the data of the structure.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np

from equimorph.argument_checks import check_arguments
from equimorph.arrays import Float, Lanes, Parameters
from equimorph.equilibria import LimitLoad, limit_load, settle
from equimorph.equilibria.newton_step import free_directions
from equimorph.equilibria.point_conditions import Fold, Values
from equimorph.equilibria.sensitivity import slopes_along
from equimorph.equilibria.settle import Guards, Settled
from equimorph.equilibria.trace_options import VIOLATIONS
from equimorph.model import Constraint, position
from equimorph.structures import State, Structure
from equimorph.tasks.designing.family import Carried
from equimorph.tasks.designing.pieces import Piece, carry_over, stable_near, value_piece
from equimorph.tasks.optimising.programme import Objective
from equimorph.tasks.planning.objectives import Extreme


@dataclass(frozen=True)
class Answer:
    """What a question has for an answer, on one structure."""

    value: float
    """In its own sign; NaN if it has none."""
    pieces: tuple[Piece, ...] = ()
    """Their largest value is made small."""
    bounds: tuple[Piece, ...] = ()
    """Pieces whose values must not be positive."""
    near: tuple[State, ...] = ()
    """States near which the question is asked of the next structure."""
    found: Any = None
    """The limit load, or the bottleneck of the route."""
    why: str = ""
    """Why it has no value."""


class Question(Protocol):
    """A number that depends on the structure; `sign` times it is made small."""

    @property
    def states(self) -> tuple[State, ...]:
        """Its states, on the structure that the variables start with."""

    @property
    def sign(self) -> float:
        """1 if it is made small, −1 if large."""

    def answer(self, structure: Structure, near: Sequence[State]) -> Answer:
        """Answer for a structure, from scratch; states are sought near those of another one."""


def no_answer(why: str) -> Answer:
    """No value, and why."""
    return Answer(np.nan, why=why)


@check_arguments
@dataclass(frozen=True, eq=False)
class StateValue:
    """Value of a descriptor at a stable state, whose parameters a design keeps.

    Parameters
    ----------
    state
        The state on the structure that the variables start with.
    extreme
        `peak(descriptor)`: made small; `least(descriptor)`: made large.
    """

    state: State
    extreme: Extreme

    @property
    def states(self) -> tuple[State, ...]:
        """The state."""
        return (self.state,)

    @property
    def sign(self) -> float:
        """1 if the value is made small."""
        return self.extreme.sign

    def answer(self, structure: Structure, near: Sequence[State]) -> Answer:
        """By Newton's method from the state nearby."""
        here = stable_near(structure, near[0] if near else self.state)
        if here is None:
            return no_answer("the state is lost or no longer stable")
        descriptor = carry_over(self.extreme.descriptor, self.state.structure, structure)
        piece = value_piece("state", here, Objective(descriptor, self.sign))
        return Answer(descriptor(here), (piece,), (), (here,), here)


@check_arguments
@dataclass(frozen=True, eq=False)
class LoadLimit:
    """Objective of a design: the limit load on the path from a state, which is maximised.

    Parameters
    ----------
    start
        Stable state on the structure that the variables start with.
    load
        Parameter that grows.
    within
        Constraints that end the path.
    bound
        Largest load tried; see `limit_load`.
    """

    start: State
    load: str
    within: Sequence[Constraint] = ()
    bound: float | None = None
    sign: float = field(default=-1.0, init=False)

    def __post_init__(self) -> None:
        """Check the name of the load."""
        position(self.start.structure.parameters, self.load)

    @property
    def states(self) -> tuple[State, ...]:
        """The start of the path."""
        return (self.start,)

    def answer(self, structure: Structure, near: Sequence[State]) -> Answer:
        """By the path from the state nearby to the first fold or constraint."""
        start = stable_near(structure, near[0] if near else self.start)
        if start is None:
            return no_answer("the state at the start of the path is lost or no longer stable")
        within = carry_over(tuple(self.within), self.start.structure, structure)
        limit = limit_load(start, self.load, within=within, bound=self.bound)
        if limit.kind == "none below the bound":
            return Answer(limit.value, (), (), (start,), limit)
        if limit.kind != "fold" and limit.kind not in VIOLATIONS:
            return no_answer(f"the path ends at a {limit.kind}, which has no derivative")
        met = None if limit.kind == "fold" else _met(limit, within)
        piece = limit_piece(limit.state, self.load, met)
        if piece is None:
            return no_answer("the end of the path is lost")
        return Answer(limit.value, (piece,), (), (start,), limit)


def _met(limit: LimitLoad, within: Sequence[Constraint]) -> Constraint:
    excess = [each.excess(limit.state.z[None], limit.state.p[None])[0] for each in within]
    return within[int(np.argmax(excess))]


def limit_piece(guess: State, load: str, met: Constraint | None) -> Piece | None:
    """Fold, or state at which a constraint is met, near a guess along a load; None if lost.

    Its value is minus the load. At a fold ``dq/dx = −(φᵀF_x)/(φᵀF_q)``, at a constraint on S
    ``dq/dx = −S_x/S_q``, both along the set.
    """
    old, at = guess.structure, position(guess.structure.parameters, load)

    def find(made: Structure, near: State) -> Piece | None:
        free = np.array([at])
        target: Fold | Values
        constraint = carry_over(met, old, made)
        if constraint is None:
            target, guards = Fold(), Guards(lower_index=np.zeros(1, int))
        else:
            bound = np.array([[constraint.bound]])
            target, guards = Values((constraint.descriptor.function,), bound), Guards()
        here = settle(
            made, near.z[None], near.p[None], free_directions(made, free, 1), [target], guards
        )
        if not here.found[0]:
            return None
        state = State(made, here.z[0], here.p[0])
        along = Carried(
            here.frames[0, :, : made.size],
            here.frames[0, :, made.size :] @ free_directions(made, free, 1)[0],
        )
        weight = 0.0
        if constraint is not None:
            weight = float(along.p[0, at]) / _slope(made, constraint, here, along)

        def scalars(there: Structure, z: Lanes, p: Parameters) -> Float[np.ndarray, "lanes m"]:
            value = -p[:, [at]]
            if met is None:
                return value
            return value + weight * carry_over(met, old, there).excess(z, p)[:, None]

        kind = "fold" if met is None else "constraint"
        return Piece(kind, state, np.array([-here.p[0, at]]), scalars, free, along, find)

    return find(old, guess)


def _slope(made: Structure, met: Constraint, here: Settled, along: Carried) -> float:
    """Slope of the excess over a constraint along the set."""
    ways = along.z[None], along.p[None]
    return float(slopes_along(made, here.z, here.p, *ways, [met.excess])[0, 0, 0])
