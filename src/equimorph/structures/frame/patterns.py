"""Loads and actuators of frames: what each parameter does to joints and to pieces of members."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np

from equimorph.argument_kinds import is_listed, is_number, one_of
from equimorph.arrays import Bool, Float
from equimorph.errors import InputError
from equimorph.structures.frame.any_network import PRESSURE, WEIGHT, AnyFrameNetwork
from equimorph.structures.network import check_parameter_names, vector

Loads = Annotated[
    Mapping[str, Mapping[str, Sequence[float] | Sequence[str]]],
    "forces or line loads of finite numbers by joint or member, or the joints of a chain under "
    "'pressure', by the name of the load, like `{'F': {'B': (0, -1)}}`, in space "
    "`{'F': {'B': (0, 0, -1)}}`, or `{'p': {'pressure': ['A', 'B', 'C', 'A']}}`",
]
KINDS = ("curvature", "length", "move", "turn")
Effects = Mapping[Annotated[str, one_of(*KINDS)], Mapping[str, float | Sequence[float]]]
Actuators = Annotated[
    Mapping[str, Effects],
    "effects of finite numbers (curvature, length, move, turn) by the name of the actuator, like "
    "`{'a': {'length': {'A-B': 1.0}}}`",
]
EULER = 10.0
"""Force that buckles a pinned rod of unit length and stiffness, about."""
OUTER_COUPLE = 2.0
"""Couple that bends such a rod by about 1."""
TENTH = 0.1
"""Move or elongation that does."""


@dataclass(frozen=True, eq=False)
class Patterns:
    """Forces, couples, line loads, strains, elongations, moves, turns and pressures by parameter.

    strains: the curvature, or in space twist and curvatures about n and b; turns: angles of the
    joints, or in space rotation vectors of the bodies; pressures: towards the left of the pieces;
    factors: parameters that multiply weights, and are numbers without unit.
    """

    forces: Float[np.ndarray, "parameters joints space"]
    couples: Float[np.ndarray, "parameters joints"]
    lines: Float[np.ndarray, "parameters pieces space"]
    strains: Float[np.ndarray, "parameters pieces axes"]
    length: Float[np.ndarray, "parameters pieces"]
    moves: Float[np.ndarray, "parameters joints space"]
    turns: Float[np.ndarray, "parameters turning axes"]
    pressures: Float[np.ndarray, "parameters pieces"]
    factors: Bool[np.ndarray, " parameters"]

    @classmethod
    def none(cls, made: AnyFrameNetwork, count: int) -> "Patterns":
        """Parameters without any effect."""
        joints, pieces, axes = len(made.joints), len(made.ends), made.axes_of_turns
        forces, moves = np.zeros((2, count, joints, made.space))
        return cls(
            forces, np.zeros((count, joints)), np.zeros((count, pieces, made.space)),
            np.zeros((count, pieces, axes)), np.zeros((count, pieces)), moves,
            np.zeros((count, made.turning_places, axes)), np.zeros((count, pieces)),
            np.zeros(count, bool),
        )  # fmt: skip

    @property
    def count(self) -> int:
        """Number of parameters."""
        return len(self.forces)

    def scaled(self, length: float, bending: float) -> "Patterns":
        """The same with lengths in units of `length`, bending stiffnesses of `bending`."""
        force = bending / length**2
        return Patterns(
            self.forces / force,
            self.couples / (force * length),
            self.lines * (length / force),
            self.strains * length,
            self.length / length,
            self.moves / length,
            self.turns,
            self.pressures * (length / force),
            self.factors,
        )

    def quantity(self, k: int) -> str:
        """What a parameter measures; "1" if it stands for several kinds."""
        given = {
            "force": self.forces[k].any(),
            "force·length": self.couples[k].any(),
            "force/length": self.lines[k].any() or self.pressures[k].any(),
            "1/length": self.strains[k].any(),
            "length": self.length[k].any() or self.moves[k].any(),
            "rad": self.turns[k].any(),
        }
        found = [quantity for quantity, some in given.items() if some]
        return found[0] if len(found) == 1 and not self.factors[k] else "1"

    def typical(self, k: int) -> float:
        """Value of a non-dimensional parameter that bends a member of length 1 by about 1."""
        sizes = (
            np.abs(self.forces[k]).max(initial=0.0) / EULER,
            np.abs(self.lines[k]).max(initial=0.0) / EULER,
            np.abs(self.pressures[k]).max(initial=0.0) / EULER,
            np.abs(self.couples[k]).max(initial=0.0) / OUTER_COUPLE,
            np.abs(self.strains[k]).max(initial=0.0),
            np.abs(self.length[k]).max(initial=0.0) / TENTH,
            np.abs(self.moves[k]).max(initial=0.0) / TENTH,
            np.abs(self.turns[k]).max(initial=0.0),
        )
        return 1.0 / float(max(sizes))


def patterns(
    made: AnyFrameNetwork, actuators: Mapping[str, Effects], loads: Mapping[str, Any]
) -> Patterns:
    """Patterns of all parameters, actuators first.

    Refused for names without meaning or used twice, unknown joints or members, or a parameter that
    has no effect.
    """
    check_parameter_names([*actuators, *loads])
    found = Patterns.none(made, len(actuators) + len(loads))
    for k, (name, given) in enumerate(actuators.items()):
        _fill_actuator(made, found, k, f"actuators.{name}", given)
    for k, (name, forces) in enumerate(loads.items(), len(actuators)):
        _fill_load(made, found, k, f"loads.{name}", forces)
    _refuse_longer_under_pressure(made, found)
    return found


def _refuse_longer_under_pressure(made: AnyFrameNetwork, given: Patterns) -> None:
    both = np.flatnonzero(given.pressures.any(axis=0) & given.length.any(axis=0))
    if len(both):
        raise InputError(
            f"`actuators` must not change the length of members under pressure; got "
            f"{made.edge_names[both[0]]}: pressure on an axis that lengthens is not modelled."
        )


def _fill_actuator(
    made: AnyFrameNetwork, into: Patterns, k: int, what: str, given: Effects
) -> None:
    if not given:
        raise InputError(f"`{what}` must have an effect ({', '.join(KINDS)}); got none.")
    for kind, table in given.items():
        if not table:
            raise InputError(f"`{what}.{kind}` must say where it acts; got an empty table.")
        for name, value in table.items():
            here = f"{what}.{kind}.{name}"
            sizes = {"length": 1, "move": made.space}
            change = _numbers(value, sizes.get(kind, made.axes_of_turns), here)
            if kind == "turn":
                into.turns[k, made.place_of_turn(name)] += change
            elif kind == "move":
                made.check_move(name, change, here)
                into.moves[k, made.joint(name)] += change
            else:
                _fill_pieces(made, into, k, name, change if kind == "curvature" else change[0])


def _fill_pieces(made: AnyFrameNetwork, into: Patterns, k: int, name: str, change: Any) -> None:
    """Strains of the pieces of a member, or a change of its length."""
    pieces = made.pieces_of(name)
    whole = made.lengths[[at for at, _ in pieces]].sum()
    for at, sign in pieces:
        if np.ndim(change):
            into.strains[k, at] += change * made.signs_of_strains(sign)
        else:
            into.length[k, at] += change * made.lengths[at] / whole


def _numbers(value: Any, size: int, what: str) -> Float[np.ndarray, " size"]:
    """Numbers that are not all 0; one may be given as it is."""
    if size == 1 and not (is_number(value) and value):
        raise InputError(f"`{what}` must be a finite number other than 0; got {value!r}.")
    given = value if is_listed(value) else [value]
    found = np.array(vector(list(given), [size], what), dtype=float)
    if not found.any():
        raise InputError(f"`{what}` must not be zero; got {value!r}.")
    return found


def _fill_load(
    made: AnyFrameNetwork, into: Patterns, k: int, what: str, given: Mapping[str, Sequence[Any]]
) -> None:
    for name, value in given.items():
        here = f"{what}.{name}"
        if name == PRESSURE:
            into.pressures[k] = made.press(value, here)
        elif not all(map(is_number, value)):
            raise InputError(f"`{here}` must be finite numbers; got {value!r}.")
        elif name in made.joints:
            _fill_force(made, into, k, name, here, value)
        else:
            _fill_line(made, into, k, name, here, np.array(vector(value, [made.space], here)))
    acting = into.lines[k].any() or into.pressures[k].any()
    if not acting and made.bears(into.forces[k], into.couples[k]):
        raise InputError(f"`{what}` must act on a member, or on a joint that is free to move.")


def _fill_force(
    made: AnyFrameNetwork, into: Patterns, k: int, name: str, here: str, value: Sequence[float]
) -> None:
    force, joint = np.array(vector(value, made.sizes_of_loads, here)), made.joint(name)
    into.forces[k, joint] += force[: made.space]
    into.couples[k, joint] += force[made.space :].sum()
    if into.couples[k, joint] and not made.has_rigid_member(joint):
        raise InputError(
            f"`{here}` must have no couple where every member is hinged; got {value!r}."
        )


def _fill_line(
    made: AnyFrameNetwork,
    into: Patterns,
    k: int,
    name: str,
    here: str,
    line: Float[np.ndarray, " space"],
) -> None:
    if name == WEIGHT:
        weights = made.weights
        if not weights.any():
            raise InputError(f"`{here}` must act on members with a weight; got none that has.")
        into.factors[k] = True
        into.lines[k] += weights[:, None] * line
    elif "-" in name:
        into.lines[k, [at for at, _ in made.pieces_of(name)]] += line
    else:
        made.joint(name)
