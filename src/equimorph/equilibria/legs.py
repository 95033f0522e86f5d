"""Arguments of a lift: starts that are equilibria, and legs to follow one after the other."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np

from equimorph.arrays import Flags, Float, Lanes, Parameters, Some
from equimorph.equilibria.curves import Curve, ParameterLine
from equimorph.equilibria.prescribed_curves import (
    Pieces,
    SmoothCurve,
    TrackedCurve,
    approximate,
    interpolate,
)
from equimorph.errors import InputError
from equimorph.model import Constraint, Descriptor, Spline, position
from equimorph.structures import State, States, Structure

Value = float | np.ndarray | None
Waypoint = Mapping[Any, Value]
"""Values by the names of parameters, and by descriptors."""
Leg = Annotated[
    Waypoint | Callable[[float], Waypoint],
    "finite values by name, a `Spline` or a function of t from 0 to 1",
]

AT_START = 1e-8
"""Relative distance by which a curve may miss where it has to begin."""


def legs_of(to: Leg | Sequence[Leg]) -> list[Leg]:
    """All legs of `to`; refused if the list is empty, or holds anything but legs."""
    legs = [to] if isinstance(to, Mapping) or callable(to) else list(to)
    for leg in legs:
        if not (isinstance(leg, Mapping) or callable(leg)):
            raise InputError(f"`to` must be made of way-points and curves p(t); got {leg!r}.")
    if not legs:
        raise InputError("`to` must change at least one parameter; got no way-point or curve.")
    return legs


def way_points(
    structure: Structure, start: Float[np.ndarray, " parameters"], to: Waypoint | Sequence[Waypoint]
) -> list[Float[np.ndarray, " parameters"]]:
    """Corners of a polyline: each way-point changes some parameters and keeps the rest.

    Raises
    ------
    InputError
        If a parameter is unknown, a value has no meaning, or no way-point moves.
    """
    corners = [start]
    for step in [to] if isinstance(to, Mapping) else list(to):
        corners.append(replace_parameters(structure, corners[-1][None], step)[0])
    if all(np.array_equal(corner, start) for corner in corners):
        raise InputError("`to` must change at least one parameter; got the start itself.")
    return corners


def replace_parameters(structure: Structure, here: Parameters, values: Waypoint) -> Parameters:
    """Parameters with some of them replaced by one value, or by one for each lane."""
    if not isinstance(values, Mapping):
        raise InputError(f"`to` must give {{name: value}}; got {values!r}.")
    out = here.copy()
    for name, value in values.items():
        if isinstance(name, Descriptor):
            continue
        place = position(structure.parameters, name)
        if value is None:
            continue
        parameter, numbers = structure.parameters[place], _numbers(name, value, len(here))
        inside = parameter.admits(numbers)
        if not inside.all():
            parameter.check(float(numbers[~inside].ravel()[0]) if numbers.ndim else float(numbers))
        out[:, place] = numbers
    return out


def _numbers(name: str, value: Value, lanes: int) -> Float[np.ndarray, "*values"]:
    try:
        numbers = np.asarray(value, dtype=float)
    except (TypeError, ValueError):
        raise InputError(f"`{name}` must be a finite number; got {value!r}.") from None
    if numbers.ndim:
        _check_widths({name: numbers}, lanes)
    return numbers


def of_some(leg: Leg, lanes: Some, total: int) -> Leg:
    """Leg of selected lanes; a leg of all lanes may have a value for each."""
    if isinstance(leg, Spline):
        wide = {name: values for name, values in leg.samples.items() if values.ndim > 1}
        _check_widths({name: values[0] for name, values in wide.items()}, total)
        return Spline(leg.t, **{**leg.samples, **{n: v[:, lanes] for n, v in wide.items()}})
    if callable(leg):
        return lambda t: _of_some(leg(t), lanes, total)
    return _of_some(leg, lanes, total)


def _of_some(values: Waypoint, lanes: Some, total: int) -> Waypoint:
    if not isinstance(values, Mapping):
        return values
    wide = {key: v for key, v in values.items() if isinstance(v, np.ndarray) and v.ndim > 0}
    _check_widths(wide, total)
    return {**values, **{key: value[lanes] for key, value in wide.items()}}


def _check_widths(wide: Mapping[Any, np.ndarray], lanes: int) -> None:
    for key, value in wide.items():
        if value.shape != (lanes,):
            name = key.name if isinstance(key, Descriptor) else key
            raise InputError(
                f"`{name}` must be a number, or one for each of {lanes} states; "
                f"got an array of shape {value.shape}."
            )


@dataclass(frozen=True)
class Prepared:
    """A leg that begins at given states: its curve, and the unknowns to start with."""

    curve: Curve
    z: Lanes


def prepare_leg(states: States, leg: Leg) -> Prepared:
    """Curve of a leg from given states.

    Refused for an unknown parameter, a value without meaning, numbers of values that are not those
    of the states, a curve that is not smooth or begins elsewhere, or numbers of descriptors and
    unknown parameters that differ.
    """
    structure, here = states.structure, states.p
    first = leg(0.0) if callable(leg) else leg
    if not isinstance(first, Mapping):
        raise InputError(f"`to` must give {{name: value}}; got {first!r}.")
    if any(isinstance(key, Descriptor) or value is None for key, value in first.items()):
        return _track_descriptors(states, leg, first)
    if not callable(leg):
        stop = replace_parameters(structure, here, leg)
        start = structure.pick_on_orbits(states.z, here, stop)
        return Prepared(ParameterLine(structure, here.copy(), stop - here), start)
    base = here[:1] if (here == here[:1]).all() else here

    def at(t: float) -> Parameters:
        values = leg(t)
        return replace_parameters(structure, here if _wide(values) else base, values)

    names = [parameter.name for parameter in structure.parameters]
    pieces = _pieces(leg, at, here, names, structure.scales)
    return Prepared(SmoothCurve(structure, pieces, pieces.lengths(structure.scales)), states.z)


def _wide(values: Waypoint) -> bool:
    """Whether there is a value for each lane."""
    return isinstance(values, Mapping) and any(
        isinstance(v, np.ndarray) and v.ndim > 0 for v in values.values()
    )


def _pieces(
    leg: Callable[[float], Waypoint],
    at: Callable[[float], Parameters],
    here: Parameters,
    names: list[str],
    scales: Float[np.ndarray, " columns"],
) -> Pieces:
    """Polynomials of a smooth curve, which has to begin where the lanes are."""
    gap = np.abs(at(0.0) - here) / (scales + np.abs(here))
    if not (gap <= AT_START).all():
        lane, column = np.unravel_index(int(np.argmax(gap)), gap.shape)
        got = np.broadcast_to(at(0.0), here.shape)[lane, column]
        raise InputError(
            f"`to` must begin at the start, where {names[column]} = {here[lane, column]:.9g}; "
            f"got {got:.9g} at t=0."
        )
    if isinstance(leg, Spline):
        return interpolate(leg.t, at, len(here), 3)
    return approximate(at, len(here), scales)


def _track_descriptors(states: States, leg: Leg, first: Waypoint) -> Prepared:
    """Curve of a leg on which descriptors are prescribed and parameters are unknown."""
    structure, here = states.structure, states.p
    descriptors = tuple(key for key in first if isinstance(key, Descriptor))
    unknown = [key for key, value in first.items() if value is None and isinstance(key, str)]
    if len(descriptors) != len(unknown):
        raise InputError(
            f"`to` must leave as many parameters unknown (None) as it prescribes descriptors; got "
            f"{len(unknown)} and {len(descriptors)}."
        )
    free = np.array([position(structure.parameters, name) for name in unknown])
    now = np.stack([descriptor.function(states.z, here) for descriptor in descriptors], 1)
    start = np.concatenate([here, now], axis=1)

    def at(t: float) -> Parameters:
        values: Waypoint = leg(t) if callable(leg) else leg
        p = replace_parameters(structure, here, values)
        p[:, free] = here[:, free]
        columns = [_numbers(d.name, values.get(d), len(here)) for d in descriptors]
        return np.concatenate([p, *(np.broadcast_to(c, len(here))[:, None] for c in columns)], 1)

    names = [parameter.name for parameter in structure.parameters]
    scales = np.concatenate([structure.scales, np.ones(len(descriptors))])
    if callable(leg):
        pieces = _pieces(leg, at, start, [*names, *(d.name for d in descriptors)], scales)
    else:
        stop = at(1.0)
        line = lambda t: start + t * (stop - start)  # noqa: E731
        pieces = interpolate(np.array([0.0, 1.0]), line, len(here), 1)
    curve = TrackedCurve(structure, pieces, free, descriptors, pieces.lengths(scales))
    return Prepared(curve, curve.begin(states.z, here))


ON_BOUND = 1e-9
"""Relative excess up to which a start counts as on a bound: an earlier lift may end there."""
EQUILIBRIUM = 1e-8
"""Residual below which a state is an equilibrium."""


def check_start(state: State, within: Sequence[Constraint] = ()) -> None:
    """Raise `InputError` unless `state` is an equilibrium that obeys the constraints."""
    if not state.residual < EQUILIBRIUM:
        raise InputError(
            f"`state` must be an equilibrium (largest residual below {EQUILIBRIUM:g}); "
            f"got a residual of {state.residual:.2g}."
        )
    for constraint in within:
        if constraint.excess(state.z[None], state.p[None])[0] > ON_BOUND * constraint.size:
            value = constraint.descriptor(state)
            raise InputError(
                f"`state` must obey {constraint}; got {constraint.descriptor.name} = {value:.6g}."
            )


def check_starts(states: States) -> None:
    """Raise `InputError` unless all of one or more states are equilibria."""
    if len(states) == 0:
        raise InputError("`state` must hold at least one state; got none.")
    worst = int(np.argmax(states.residual))
    if not states.residual[worst] < EQUILIBRIUM:
        raise InputError(
            f"`state` must hold equilibria (largest residual below {EQUILIBRIUM:g}); got a "
            f"residual of {states.residual[worst]:.2g} in number {worst}."
        )


def check_isolated(structure: Structure, p: Parameters) -> None:
    """Raise `InputError` where equilibria are not isolated: a search would find no end of them."""
    free = structure.have_orbits(p)
    if free.any():
        at = ", ".join(
            f"{each.name}={value:g}"
            for each, value in zip(structure.parameters, p[np.argmax(free)], strict=True)
        )
        raise InputError(
            "`structure` must have isolated equilibria; got one whose states may be turned about "
            f"an axis for nothing at {at}. Give a rod phase=True, which picks one state of each "
            "orbit, and members of a frame unequal bending stiffnesses, or a load across the axis."
        )


def violations(states: States, within: Sequence[Constraint]) -> Flags:
    """Which states exceed a bound by more than round-off."""
    over = np.zeros(len(states), bool)
    for c in within:
        over |= c.excess(states.z, states.p) > ON_BOUND * c.size
    return over
