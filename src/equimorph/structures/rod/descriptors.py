"""Descriptors of the rod."""

import re
from collections.abc import Callable

import numpy as np
from jaxtyping import Float

from equimorph.argument_vocabulary import SHARE
from equimorph.arrays import Lanes, Parameters, Values
from equimorph.errors import InputError, suggestion
from equimorph.model import Descriptor
from equimorph.structures.rod.discretisation import error_by_refinement
from equimorph.structures.rod.extrema import extreme_curvatures, peaks, stations
from equimorph.structures.rod.measured import Measured
from equimorph.structures.rod.mechanics import Mechanics
from equimorph.structures.rod.validity import clearance

Extrema = Float[np.ndarray, "lanes extrema"]

WRITTEN = (
    *("height(s)", "x(s)", "angle(s)", "curvature(s)", "max_curvature", "energy", "clearance(s)"),
    *("lateral_margin", "lateral_index"),
    *("support_force(lambda)", "support_force(mu)", "end_moment(0)", "end_moment(1)"),
)
SAMPLES = np.linspace(0.0, 1.0, 25)
_SYMBOLS = {0.5: "½", 1 / 3: "1/3", 2 / 3: "2/3", 0.25: "¼", 0.75: "¾"}


def check_arclength(s: float) -> float:
    """Refuse what is no arclength, in texts: numbers are checked before."""
    if not 0.0 <= s <= 1.0:
        raise InputError(f"`s` must be {SHARE.words}; got {s!r}.")
    return float(s)


def name_at(name: str, s: float) -> str:
    """Name at an arclength, from which the arclength is read back exactly: ``height(1/3)``."""
    nice = (f"{s:.6g}", *(f"{round(s * below)}/{below}" for below in (3, 6, 7, 9, 11, 12)))
    exact = (text for text in nice if read_fraction(text) == s)
    return f"{name}({next(exact, repr(s))})"


def symbol_at(letter: str, s: float) -> str:
    """Symbol at an arclength: ``y(½)``."""
    return f"{letter}({_SYMBOLS.get(s, f'{s:g}')})"


def _field(rod: Measured, s: float, which: int) -> Callable[[Lanes, Parameters], Values]:
    """θ, κ, x or y (0 … 3) at one arclength."""
    at, unit = np.array([s]), rod.units.value(("angle", "curvature", "length", "length")[which])

    def value(z: Lanes, p: Parameters) -> Values:
        return unit * rod.mechanics.fields(z, p, at)[:, 0, which]

    return value


def coordinate(rod: Measured, s: float, axis: int) -> Descriptor:
    """x(s) (axis 0) or y(s) (axis 1)."""
    at = check_arclength(s)
    name, symbol = name_at("height" if axis else "x", at), symbol_at("y" if axis else "x", at)
    unit = rod.units.label("length")
    return Descriptor(name, unit, _field(rod, at, 2 + axis), symbol, rod.signature)


def angle(rod: Measured, s: float) -> Descriptor:
    """θ(s)."""
    at = check_arclength(s)
    name, value = name_at("angle", at), _field(rod, at, 0)
    return Descriptor(name, "rad", value, symbol_at("θ", at), rod.signature)


def curvature(rod: Measured, s: float) -> Descriptor:
    """κ(s)."""
    at = check_arclength(s)
    name, value = name_at("curvature", at), _field(rod, at, 1)
    unit = rod.units.label("curvature")
    return Descriptor(name, unit, value, symbol_at("κ", at), rod.signature)


def max_curvature(rod: Measured) -> Descriptor:
    """max_s |κ(s)|."""
    unit = rod.units.value("curvature")

    def value(z: Lanes, p: Parameters) -> Values:
        return unit * rod.mechanics.largest_curvature(z, p)[0]

    def place(z: Lanes, p: Parameters) -> Values:
        return rod.mechanics.largest_curvature(z, p)[1]

    def branches(z: Lanes, p: Parameters) -> tuple[Extrema, Extrema]:
        at = stations(rod.mesh.breaks)
        found, places = peaks(np.abs(rod.mechanics.fields(z, p, at)[:, :, 1]), at)
        exact = extreme_curvatures(rod.mechanics, z, p, places)
        return unit * np.where(np.isfinite(found), exact, found), places

    label = rod.units.label("curvature")
    return Descriptor("max_curvature", label, value, "max |κ|", rod.signature, place, branches)


def support_force(rod: Measured, component: str) -> Descriptor:
    """λ or μ."""
    if component not in {"lambda", "mu"}:
        raise InputError(f"`component` must be 'lambda' or 'mu'; got {component!r}.")
    axis, unit = int(component == "mu"), rod.units.value("force")

    def value(z: Lanes, p: Parameters) -> Values:
        return unit * rod.mechanics.support_forces(z, p)[:, axis]

    symbol = "λ" if component == "lambda" else "μ"
    name = f"support_force({component})"
    return Descriptor(name, rod.units.label("force"), value, symbol, rod.signature)


def end_moment(rod: Measured, end: int) -> Descriptor:
    """Couple of the support at an end on the rod."""
    if end not in {0, 1}:
        raise InputError(f"`end` must be 0 or 1; got {end!r}.")

    unit = rod.units.value("couple")

    def value(z: Lanes, p: Parameters) -> Values:
        return unit * rod.mechanics.end_moments(z, p)[:, end]

    label = rod.units.label("couple")
    return Descriptor(f"end_moment({end})", label, value, f"M({end})", rod.signature)


def descriptor_from_text(rod: Measured, text: str) -> Descriptor:
    """Descriptor written as text."""
    match = re.fullmatch(r"\s*(\w+)\s*(?:\(\s*([^()]*?)\s*\))?\s*", text)
    name, argument = (match.group(1), match.group(2)) if match else ("", None)
    if argument is None and name in {"max_curvature", "energy"}:
        return max_curvature(rod) if name == "max_curvature" else total_energy(rod)
    if argument is not None and name == "support_force":
        return support_force(rod, argument)
    if argument is not None and name == "clearance":
        return clearance(rod, read_fraction(argument))
    if argument in {"0", "1"} and name == "end_moment":
        return end_moment(rod, int(argument))
    if argument is not None and name in {"height", "x", "angle", "curvature"}:
        s = read_fraction(argument)
        if name in {"height", "x"}:
            return coordinate(rod, s, int(name == "height"))
        return angle(rod, s) if name == "angle" else curvature(rod, s)
    raise InputError(
        f"`descriptor` must be one of {', '.join(WRITTEN)}; got {text!r}."
        f"{suggestion(text, WRITTEN)}"
    )


def total_energy(rod: Measured) -> Descriptor:
    """Potential energy E."""
    unit = rod.units.value("couple")

    def value(z: Lanes, p: Parameters) -> Values:
        return unit * rod.mechanics.energy(z, p)

    return Descriptor("energy", rod.units.energy_label, value, "E", rod.signature)


def read_fraction(text: str) -> float:
    """Number written like ``0.5`` or ``1/3``."""
    try:
        above, _, below = text.partition("/")
        return float(above) / float(below or 1.0)
    except (ValueError, ZeroDivisionError):
        raise InputError(f"`s` must be a number or a fraction like 1/3; got {text!r}.") from None


def discretisation_error(rod: Mechanics, finer: Mechanics, z: Lanes, p: Parameters) -> Values:
    """Twice the largest change of max |κ|, of κ(s) and of y(s) after Newton on a finer rod."""
    matrix = rod.mesh.interpolation(finer.mesh.nodes[finer.unknown_nodes])
    fine = np.concatenate([rod.nodal_angles(z, p) @ matrix.T, z[:, rod.unknowns :]], axis=1)
    still = np.zeros((len(z), finer.size))
    one, none = np.ones(len(z)), np.zeros(len(z))

    def correction(at: Lanes) -> Lanes:
        return finer.advance(at, p, np.zeros_like(p), still, one, none).dz

    def change(at: Lanes) -> Values:
        largest = np.abs(finer.largest_curvature(at, p)[0] - rod.largest_curvature(z, p)[0])
        fields = np.abs(finer.fields(at, p, SAMPLES) - rod.fields(z, p, SAMPLES))
        return np.asarray(np.maximum(largest, fields[:, :, [1, 3]].max(axis=(1, 2))))

    return error_by_refinement(fine, correction, change)
