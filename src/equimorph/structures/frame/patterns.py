"""Effects of the parameters of a frame, loads and actuators, as arrays."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
from jaxtyping import Bool, Float

from equimorph.argument_kinds import is_listed, is_number, one_of
from equimorph.errors import InputError
from equimorph.structures.frame.network import WEIGHT, FrameNetwork
from equimorph.structures.network import check_parameter_names, vector

Loads = Annotated[
    Mapping[str, Mapping[str, Sequence[float]]],
    "forces or line loads of finite numbers by joint or member, by the name of the load, like "
    "`{'F': {'B': (0, -1)}}`",
]
Effects = Mapping[
    Annotated[str, one_of("curvature", "length", "move", "turn")],
    Mapping[str, float | Sequence[float]],
]
Actuators = Annotated[
    Mapping[str, Effects],
    "effects of finite numbers (curvature, length, move, turn) by the name of the actuator, like "
    "`{'a': {'curvature': {'A-B': 1.0}}}`",
]
KINDS = ("curvature", "length", "move", "turn")


@dataclass(frozen=True, eq=False)
class Patterns:
    """Forces, couples, line loads, curvatures, elongations, moves and turns by parameter.

    factors: parameters that multiply weights, and are numbers without unit.
    """

    forces: Float[np.ndarray, "parameters joints 2"]
    couples: Float[np.ndarray, "parameters joints"]
    lines: Float[np.ndarray, "parameters members 2"]
    curvature: Float[np.ndarray, "parameters members"]
    length: Float[np.ndarray, "parameters members"]
    moves: Float[np.ndarray, "parameters joints 2"]
    turns: Float[np.ndarray, "parameters joints"]
    factors: Bool[np.ndarray, " parameters"]

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
            self.curvature * length,
            self.length / length,
            self.moves / length,
            self.turns,
            self.factors,
        )

    def unit(self, k: int) -> str:
        """Unit of a parameter; "1" if it stands for several kinds."""
        given = {
            "force": self.forces,
            "force·length": self.couples,
            "force/length": self.lines,
            "1/length": self.curvature,
            "length": np.concatenate([self.length, self.moves[..., 0], self.moves[..., 1]], axis=1),
            "rad": self.turns,
        }
        found = [unit for unit, array in given.items() if array[k].any()]
        return found[0] if len(found) == 1 and not self.factors[k] else "1"

    def typical(self, k: int) -> float:
        """Value of a non-dimensional parameter that bends a member of length 1 by about 1."""
        euler = 10.0
        sizes = (
            np.abs(self.forces[k]).max(initial=0.0) / euler,
            np.abs(self.lines[k]).max(initial=0.0) / euler,
            np.abs(self.couples[k]).max(initial=0.0) / 2.0,
            np.abs(self.curvature[k]).max(initial=0.0),
            np.abs(self.length[k]).max(initial=0.0) * 10.0,
            np.abs(self.moves[k]).max(initial=0.0) * 10.0,
            np.abs(self.turns[k]).max(initial=0.0),
        )
        return 1.0 / float(max(sizes))


def patterns(made: FrameNetwork, actuators: Actuators, loads: Loads) -> Patterns:
    """Patterns of all parameters, actuators first.

    Raises
    ------
    InputError
        For names without meaning or used twice, unknown joints or members, or a parameter that has
        no effect.
    """
    check_parameter_names([*actuators, *loads])
    count, joints, members = len(actuators) + len(loads), len(made.joints), len(made.members)
    both, single = (count, joints, 2), (count, joints)
    found = Patterns(
        np.zeros(both), np.zeros(single), np.zeros((count, members, 2)),
        np.zeros((count, members)), np.zeros((count, members)), np.zeros(both), np.zeros(single),
        np.zeros(count, bool),
    )  # fmt: skip
    for k, (name, given) in enumerate(actuators.items()):
        _fill_actuator(made, found, k, f"actuators.{name}", given)
    for k, (name, forces) in enumerate(loads.items(), len(actuators)):
        _fill_load(made, found, k, f"loads.{name}", forces)
    return found


def _number(value: Any, what: str) -> float:
    if not (is_number(value) and value):
        raise InputError(f"`{what}` must be a finite number other than 0; got {value!r}.")
    return float(value)


def _fill_actuator(made: FrameNetwork, into: Patterns, k: int, what: str, given: Effects) -> None:
    if not given:
        raise InputError(f"`{what}` must have an effect ({', '.join(KINDS)}); got none.")
    for kind, table in given.items():
        where = f"{what}.{kind}"
        if not table:
            raise InputError(f"`{where}` must say where it acts; got an empty table.")
        for name, value in table.items():
            here = f"{where}.{name}"
            if kind == "move":
                _fill_move(made, into, k, here, name, value)
            elif kind == "turn":
                into.turns[k, made.support_place(name, "angle")[0]] = _number(value, here)
            else:
                member, sign = made.member(name)
                array = into.curvature if kind == "curvature" else into.length
                array[k, member] = _number(value, here) * (sign if kind == "curvature" else 1.0)


def _fill_move(
    made: FrameNetwork, into: Patterns, k: int, what: str, name: Any, given: Any
) -> None:
    move = vector(given if is_listed(given) else [given], [2], what)
    for axis, value in enumerate(move):
        if value:
            into.moves[k, made.support_place(name, "xy"[axis])[0], axis] = value
    if not any(move):
        raise InputError(f"`{what}` must not be zero; got {given!r}.")


def _fill_load(
    made: FrameNetwork, into: Patterns, k: int, what: str, given: Mapping[str, Sequence[float]]
) -> None:
    for name, value in given.items():
        here = f"{what}.{name}"
        if name == WEIGHT:
            weights = np.array([float(member.weight or 0.0) for member in made.members])
            if not weights.any():
                raise InputError(f"`{here}` must act on members with a weight; got none that has.")
            into.factors[k] = True
            into.lines[k] += weights[:, None] * np.array(vector(value, [2], here))
        elif name in made.joints:
            force = vector(value, [2, 3], here)
            joint = made.joint(name)
            into.forces[k, joint] = force[:2]
            into.couples[k, joint] = force[2] if len(force) == 3 else 0.0
            if into.couples[k, joint] and not made.rigid[joint]:
                raise InputError(
                    f"`{here}` must have no couple where every member is hinged; got {value!r}."
                )
        elif "-" in name:
            into.lines[k, made.member(name)[0]] += vector(value, [2], here)
        else:
            made.joint(name)
    _check_effect(made, into, k, what)


def _check_effect(made: FrameNetwork, into: Patterns, k: int, what: str) -> None:
    """Refuse a load that supports alone bear."""
    fast = np.isinf(made.supports)
    forces, couples = into.forces[k], into.couples[k]
    if not (forces[~fast[:, :2]].any() or couples[~fast[:, 2]].any() or into.lines[k].any()):
        raise InputError(f"`{what}` must act on a member, or on a joint that is free to move.")
