"""Effects of the parameters of a frame in space, loads and actuators, as arrays."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from jaxtyping import Bool, Float

from equimorph.argument_kinds import is_number, one_of
from equimorph.errors import InputError
from equimorph.structures.network import check_parameter_names, vector
from equimorph.structures.space_frame.network import WEIGHT, SpatialNetwork

KINDS = ("curvature", "length", "move", "turn")
SpatialLoads = Annotated[
    Mapping[str, Mapping[str, Sequence[float]]],
    "forces or line loads (x, y, z) of finite numbers by joint or member, by the name of the load, "
    "like `{'F': {'B': (0, 0, -1)}}`",
]
SpatialEffects = Mapping[Annotated[str, one_of(*KINDS)], Mapping[str, float | Sequence[float]]]
SpatialActuators = Annotated[
    Mapping[str, SpatialEffects],
    "effects of finite numbers (curvature, length, move, turn) by the name of the actuator, like "
    "`{'a': {'move': {'A': (1, 0, 0)}}}`",
]
EULER = 10.0
"""Force that buckles a pinned rod of unit length and stiffness, about."""


@dataclass(frozen=True, eq=False)
class SpatialPatterns:
    """Forces, line loads, strains, elongations, moves and turns by parameter.

    strains: twist, curvatures about n and b; turns: rotation vectors, by body; factors: parameters
    that multiply weights, and are numbers without unit.
    """

    forces: Float[np.ndarray, "parameters joints 3"]
    lines: Float[np.ndarray, "parameters pieces 3"]
    strains: Float[np.ndarray, "parameters pieces 3"]
    length: Float[np.ndarray, "parameters pieces"]
    moves: Float[np.ndarray, "parameters joints 3"]
    turns: Float[np.ndarray, "parameters bodies 3"]
    factors: Bool[np.ndarray, " parameters"]

    @property
    def count(self) -> int:
        """Number of parameters."""
        return len(self.forces)

    def scaled(self, length: float, bending: float) -> "SpatialPatterns":
        """The same with lengths in units of `length`, bending stiffnesses of `bending`."""
        force = bending / length**2
        return SpatialPatterns(
            self.forces / force,
            self.lines * (length / force),
            self.strains * length,
            self.length / length,
            self.moves / length,
            self.turns,
            self.factors,
        )

    def unit(self, k: int) -> str:
        """Unit of a parameter; "1" if it stands for several kinds."""
        given = {
            "force": self.forces[k].any(),
            "force/length": self.lines[k].any(),
            "1/length": self.strains[k].any(),
            "length": self.length[k].any() or self.moves[k].any(),
            "rad": self.turns[k].any(),
        }
        found = [unit for unit, some in given.items() if some]
        return found[0] if len(found) == 1 and not self.factors[k] else "1"

    def typical(self, k: int) -> float:
        """Value of a non-dimensional parameter that bends a member of length 1 by about 1."""
        sizes = (
            np.abs(self.forces[k]).max(initial=0.0) / EULER,
            np.abs(self.lines[k]).max(initial=0.0) / EULER,
            np.abs(self.strains[k]).max(initial=0.0),
            np.abs(self.length[k]).max(initial=0.0) * 10.0,
            np.abs(self.moves[k]).max(initial=0.0) * 10.0,
            np.abs(self.turns[k]).max(initial=0.0),
        )
        return 1.0 / float(max(sizes))


def spatial_patterns(
    made: SpatialNetwork, actuators: SpatialActuators, loads: SpatialLoads
) -> SpatialPatterns:
    """Patterns of all parameters, actuators first.

    Raises
    ------
    InputError
        For names without meaning or used twice, unknown joints or members, or a parameter that has
        no effect.
    """
    check_parameter_names([*actuators, *loads])
    count, joints, pieces = len(actuators) + len(loads), len(made.joints), len(made.owner)
    found = SpatialPatterns(
        np.zeros((count, joints, 3)), np.zeros((count, pieces, 3)), np.zeros((count, pieces, 3)),
        np.zeros((count, pieces)), np.zeros((count, joints, 3)),
        np.zeros((count, len(made.bodies), 3)), np.zeros(count, bool),
    )  # fmt: skip
    for k, (name, given) in enumerate(actuators.items()):
        _fill_actuator(made, found, k, f"actuators.{name}", given)
    for k, (name, forces) in enumerate(loads.items(), len(actuators)):
        _fill_load(made, found, k, f"loads.{name}", forces)
    return found


def _fill_actuator(
    made: SpatialNetwork, into: SpatialPatterns, k: int, what: str, given: SpatialEffects
) -> None:
    if not given:
        raise InputError(f"`{what}` must have an effect ({', '.join(KINDS)}); got none.")
    for kind, table in given.items():
        if not table:
            raise InputError(f"`{what}.{kind}` must say where it acts; got an empty table.")
        for name, value in table.items():
            here = f"{what}.{kind}.{name}"
            if kind == "length":
                _fill_length(made, into, k, here, value)
            else:
                _fill_vector(made, into, k, here, _three(value, here))


def _three(value: float | Sequence[float], what: str) -> Float[np.ndarray, "3"]:
    """Three numbers, not all 0."""
    given = value if isinstance(value, Sequence | np.ndarray) else [float(value)]
    found = np.array(vector(list(given), [3], what), dtype=float)
    if not found.any():
        raise InputError(f"`{what}` must not be zero; got {value!r}.")
    return found


def _fill_length(
    made: SpatialNetwork, into: SpatialPatterns, k: int, what: str, value: float | Sequence[float]
) -> None:
    if not (is_number(value) and value):
        raise InputError(f"`{what}` must be a finite number other than 0; got {value!r}.")
    pieces = [at for at, _ in made.pieces_of(what.rsplit(".", maxsplit=1)[-1])]
    lengths = made.drawn_lengths[pieces]
    into.length[k, pieces] += float(value) * lengths / lengths.sum()  # type: ignore[arg-type]


def _fill_vector(
    made: SpatialNetwork, into: SpatialPatterns, k: int, what: str, value: Float[np.ndarray, "3"]
) -> None:
    *_, kind, name = what.split(".")
    if kind == "turn":
        into.turns[k, made.held_body(name)] += value
    elif kind == "move":
        joint = made.joint(name)
        if not made.supports[joint].holds(value):
            written = ", ".join(f"{x:g}" for x in value)
            raise InputError(
                f"`{what}` must be along directions that the support of {name} holds; got "
                f"({written})."
            )
        into.moves[k, joint] += value
    else:
        for piece, sign in made.pieces_of(name):
            # from the other end the tangent and the binormal are reversed, the normal is not
            into.strains[k, piece] += value * np.array([1.0, sign, 1.0])


def _fill_load(
    made: SpatialNetwork,
    into: SpatialPatterns,
    k: int,
    what: str,
    given: Mapping[str, Sequence[float]],
) -> None:
    for name, value in given.items():
        here = f"{what}.{name}"
        force = np.array(vector(value, [3], here))
        if name == WEIGHT:
            weights = np.array([made.made[m].weight or 0.0 for m in made.owner.tolist()])
            if not weights.any():
                raise InputError(f"`{here}` must act on members with a weight; got none that has.")
            into.factors[k] = True
            into.lines[k] += weights[:, None] * force
        elif name in made.joints:
            into.forces[k, made.joint(name)] += force
        elif "-" in name:
            for piece, _ in made.pieces_of(name):
                into.lines[k, piece] += force
        else:
            made.joint(name)
    _check_effect(made, into, k, what)


def _check_effect(made: SpatialNetwork, into: SpatialPatterns, k: int, what: str) -> None:
    """Refuse a load that supports alone bear."""
    borne = all(
        support.holds(force) and np.isinf(support.stiffness).all()
        for support, force in zip(made.supports, into.forces[k], strict=True)
        if force.any()
    )
    if borne and not into.lines[k].any():
        raise InputError(f"`{what}` must act on a member, or on a joint that is free to move.")
