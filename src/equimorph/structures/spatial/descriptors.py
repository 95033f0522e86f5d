"""Descriptors of a rod in space."""

import re
from collections.abc import Callable

import numpy as np

from equimorph.arrays import Lanes, Parameters, Values
from equimorph.errors import InputError, suggestion
from equimorph.model import Descriptor
from equimorph.structures.rod.descriptors import check_arclength, name_at, read_fraction, symbol_at
from equimorph.structures.spatial.clearance import closest_approach, stations
from equimorph.structures.spatial.fields import Fields
from equimorph.structures.spatial.measured import MeasuredInSpace

COORDINATES = {"x": 0, "height": 1, "z": 2}
STRAINS = {"twist": 0, "side_curvature": 1, "curvature": 2}
SYMBOLS = {
    **{"x": "x", "height": "y", "z": "z", "bending": "|κ|"},
    **{"twist": "κ_t", "side_curvature": "κ_n", "curvature": "κ_b"},
    **{"turn": "a", "tilt": "b", "roll": "τ"},
}
ANGLES = ("turn", "tilt", "roll")
FORCES = {"lambda": 0, "mu": 1, "x": 0, "y": 1, "z": 2}
WRITTEN = (
    *("height(s)", "x(s)", "z(s)", "turn(s)", "tilt(s)", "roll(s)"),
    *("curvature(s)", "side_curvature(s)", "twist(s)", "bending(s)", "max_curvature"),
    *("energy", "clearance(s)", "support_force(x)", "end_couple(0, x)"),
)


def _pointwise(
    rod: MeasuredInSpace, name: str, s: float, quantity: str, of: Callable[[Fields], np.ndarray]
) -> Descriptor:
    """A field at one arclength."""
    at, unit = np.array([check_arclength(s)]), rod.units.value(quantity)

    def value(z: Lanes, p: Parameters) -> Values:
        return np.asarray(unit * of(rod.recovery.at(z, p, at)))

    written, symbol = name_at(name, float(at[0])), symbol_at(SYMBOLS[name], float(at[0]))
    return Descriptor(written, rod.units.label(quantity), value, symbol, rod.signature)


def coordinate(rod: MeasuredInSpace, name: str, s: float) -> Descriptor:
    """x(s), y(s) or z(s)."""
    axis = COORDINATES[name]
    return _pointwise(rod, name, s, "length", lambda fields: fields.places[:, 0, axis])


def strain(rod: MeasuredInSpace, name: str, s: float) -> Descriptor:
    """Twist, or curvature about n or b, at an arclength."""
    axis = STRAINS[name]
    return _pointwise(rod, name, s, "curvature", lambda fields: fields.strains[:, 0, axis])


def bending(rod: MeasuredInSpace, s: float) -> Descriptor:
    """Bending curvature √(κ_n² + κ_b²) at an arclength."""

    def size(fields: Fields) -> np.ndarray:
        return np.asarray(np.hypot(fields.strains[:, 0, 1], fields.strains[:, 0, 2]))

    return _pointwise(rod, "bending", s, "curvature", size)


def angle(rod: MeasuredInSpace, name: str, s: float) -> Descriptor:
    """Angle a, b or τ of the cross-section R = exp(e₃ a) exp(e₂ b) exp(e₁ τ) at an arclength.

    The tangent is (cos a cos b, sin a cos b, −sin b); a and τ lie between −π and π.
    """

    def found(fields: Fields) -> np.ndarray:
        r = fields.frames[:, 0]
        if name == "turn":
            return np.asarray(np.arctan2(r[:, 1, 0], r[:, 0, 0]))
        if name == "tilt":
            return np.asarray(-np.arcsin(np.clip(r[:, 2, 0], -1.0, 1.0)))
        return np.asarray(np.arctan2(r[:, 2, 1], r[:, 2, 2]))

    return _pointwise(rod, name, s, "angle", found)


def max_curvature(rod: MeasuredInSpace) -> Descriptor:
    """Largest bending curvature along the rod."""
    unit = rod.units.value("curvature")

    def value(z: Lanes, p: Parameters) -> Values:
        return np.asarray(unit * rod.recovery.largest_curvature(z, p)[0])

    def place(z: Lanes, p: Parameters) -> Values:
        return rod.recovery.largest_curvature(z, p)[1]

    label = rod.units.label("curvature")
    return Descriptor("max_curvature", label, value, "max |κ|", rod.signature, place)


def total_energy(rod: MeasuredInSpace) -> Descriptor:
    """Potential energy E."""
    unit = rod.units.value("couple")

    def value(z: Lanes, p: Parameters) -> Values:
        return unit * rod.mechanics.energy(z, p)

    return Descriptor("energy", rod.units.energy_label, value, "E", rod.signature)


def support_force(rod: MeasuredInSpace, component: str) -> Descriptor:
    """Component of the force of the support at A on the rod."""
    if component not in FORCES:
        raise InputError(f"`component` must be 'x', 'y' or 'z'; got {component!r}.")
    axis, unit = FORCES[component], rod.units.value("force")

    def value(z: Lanes, p: Parameters) -> Values:
        return unit * rod.mechanics.support_forces(z, p)[:, axis]

    name = f"support_force({'xyz'[axis]})"
    return Descriptor(name, rod.units.label("force"), value, "λμν"[axis], rod.signature)


def end_couple(rod: MeasuredInSpace, end: int, component: str) -> Descriptor:
    """Component of the couple of the support at an end on the rod, about an axis in space."""
    if end not in {0, 1}:
        raise InputError(f"`end` must be 0 or 1; got {end!r}.")
    if component not in ("x", "y", "z"):
        raise InputError(f"`component` must be 'x', 'y' or 'z'; got {component!r}.")
    axis, unit = "xyz".index(component), rod.units.value("couple")

    def value(z: Lanes, p: Parameters) -> Values:
        return unit * rod.mechanics.end_couples(z, p)[:, end, axis]

    name, label = f"end_couple({end}, {component})", rod.units.label("couple")
    return Descriptor(name, label, value, f"M_{component}({end})", rod.signature)


def clearance(rod: MeasuredInSpace, apart: float) -> Descriptor:
    """Smallest distance between points that lie `apart` or further along the rod."""
    number = float(apart) if isinstance(apart, int | float) else np.nan
    if not 0.0 < number < 1.0:
        raise InputError(
            f"`apart` must be a share of the rod's length between 0 and 1; got {apart!r}."
        )
    unit = rod.units.value("length")

    def found(z: Lanes, p: Parameters) -> tuple[Values, Values]:
        return closest_approach(rod.recovery.at(z, p, stations()), number)

    def value(z: Lanes, p: Parameters) -> Values:
        return unit * found(z, p)[0]

    def place(z: Lanes, p: Parameters) -> Values:
        return found(z, p)[1]

    name, label = f"clearance({number:.9g})", rod.units.label("length")
    return Descriptor(name, label, value, "clearance", rod.signature, place)


def descriptor_from_text(rod: MeasuredInSpace, text: str) -> Descriptor:
    """Descriptor written as text."""
    match = re.fullmatch(r"\s*(\w+)\s*(?:\(\s*([^()]*?)\s*\))?\s*", text)
    name, argument = (match.group(1), match.group(2)) if match else ("", None)
    if argument is None and name in ("max_curvature", "energy"):
        return max_curvature(rod) if name == "max_curvature" else total_energy(rod)
    if argument is not None:
        made = _of_argument(rod, name, argument)
        if made is not None:
            return made
    raise InputError(
        f"`descriptor` must be one of {', '.join(WRITTEN)}; got {text!r}."
        f"{suggestion(text, WRITTEN)}"
    )


def _of_argument(rod: MeasuredInSpace, name: str, argument: str) -> Descriptor | None:
    """Descriptor of a name with something in parentheses; None for another name."""
    if name == "support_force":
        return support_force(rod, argument)
    if name == "end_couple":
        end, _, component = argument.partition(",")
        return end_couple(rod, int(end) if end.strip() in ("0", "1") else -1, component.strip())
    if name == "clearance":
        return clearance(rod, read_fraction(argument))
    return _of_arclength(rod, name, read_fraction(argument)) if name in SYMBOLS else None


def _of_arclength(rod: MeasuredInSpace, name: str, s: float) -> Descriptor:
    """Field at an arclength by its name."""
    if name in COORDINATES:
        return coordinate(rod, name, s)
    if name in STRAINS:
        return strain(rod, name, s)
    return bending(rod, s) if name == "bending" else angle(rod, name, s)
