"""Descriptors of a truss: bar forces, buckling utilisations, displacements, efforts."""

import re
from collections.abc import Callable

import numpy as np
from jaxtyping import Float

from equimorph.arrays import Lanes, Parameters, Values
from equimorph.errors import InputError
from equimorph.model import Descriptor, position
from equimorph.structures.truss.mechanics import TrussMechanics

WRITTEN = (
    "force(bar), utilisation(bar), max_utilisation, max_shortening, displacement(joint, axis), "
    "travel(load), effort(parameter), energy"
)
_CALL = re.compile(r"(\w+)(?:\(([\w-]+)(?:,(\w+))?\))?")


def force(truss: TrussMechanics, bar: str) -> Descriptor:
    """Force in a bar, positive in tension."""
    at = truss.network.bar(bar)

    def value(z: Lanes, p: Parameters) -> Values:
        return truss.energies.force(*truss.lengths(z, p))[:, at].copy()

    name = truss.network.bars[at].name
    return Descriptor(
        f"force({name})", truss.system.label("force"), value, f"N({name})", truss.signature
    )


def _utilisations(truss: TrussMechanics, z: Lanes, p: Parameters) -> Float[np.ndarray, "lanes b"]:
    """Compression over the Euler load π² EI/l₀² [TimoshenkoGere1961]_; −∞ for bars without EI."""
    given = [np.nan if bar.EI is None else float(bar.EI) for bar in truss.network.bars]
    squared, rest = truss.lengths(z, p)
    share = -truss.energies.force(squared, rest) * rest**2 / (np.pi**2 * np.array(given))
    return np.where(np.isnan(given), -np.inf, share)


def utilisation(truss: TrussMechanics, bar: str) -> Descriptor:
    """Compression of a bar over its Euler load."""
    at = truss.network.bar(bar)
    name = truss.network.bars[at].name
    if truss.network.bars[at].EI is None:
        raise InputError(f"`utilisation({name})` must be of a bar with EI; got one without.")

    def value(z: Lanes, p: Parameters) -> Values:
        return _utilisations(truss, z, p)[:, at].copy()

    return Descriptor(f"utilisation({name})", "1", value, f"U({name})", truss.signature)


def max_utilisation(truss: TrussMechanics) -> Descriptor:
    """Largest utilisation of the bars that have a bending stiffness."""
    if all(bar.EI is None for bar in truss.network.bars):
        raise InputError("`max_utilisation` must be of a truss with EI; got no bar that has one.")

    def value(z: Lanes, p: Parameters) -> Values:
        return np.asarray(_utilisations(truss, z, p).max(axis=1))

    return Descriptor("max_utilisation", "1", value, "max U", truss.signature)


def max_shortening(truss: TrussMechanics) -> Descriptor:
    """Largest shortening of a bar relative to its rest length, 1 − l/l₀."""

    def value(z: Lanes, p: Parameters) -> Values:
        return np.asarray(truss.shortenings(z, p).max(axis=1))

    return Descriptor("max_shortening", "1", value, "max(1 − l/l₀)", truss.signature)


def displacement(truss: TrussMechanics, joint: str, axis: str) -> Descriptor:
    """Displacement of a joint along an axis, from where it is drawn."""
    at = truss.network.move(joint, axis)
    name = f"displacement({joint},{axis})"
    symbol = f"u_{axis}({joint})"
    unit = truss.length_unit
    return Descriptor(name, unit, lambda z, p: z[:, at].copy(), symbol, truss.signature)


def effort(truss: TrussMechanics, parameter: str, sign: float = 1.0) -> Descriptor:
    """∂E/∂p of a parameter."""
    at = position(truss.parameters, parameter)
    unit = truss.system.label("length" if truss.parameters[at].role == "load" else "force")

    def value(z: Lanes, p: Parameters) -> Values:
        return sign * truss.effort(z, p)[:, at]

    name = f"{'effort' if sign > 0.0 else 'travel'}({parameter})"
    return Descriptor(name, unit, value, name, truss.signature)


def travel(truss: TrussMechanics, load: str) -> Descriptor:
    """Displacement along a load: the work per unit of its parameter."""
    if truss.parameters[position(truss.parameters, load)].role != "load":
        raise InputError(f"`travel({load})` must be that of a load; got an actuator.")
    return effort(truss, load, -1.0)


def elevation(truss: TrussMechanics) -> Descriptor:
    """The travel of the first load, or the first displacement."""
    for parameter in truss.parameters:
        if parameter.role == "load":
            return travel(truss, parameter.name)
    return displacement(truss, *truss.network.moves[0].split("."))


def descriptor_from_text(truss: TrussMechanics, text: str) -> Descriptor:
    """Descriptor written like ``force(A-B)``, ``displacement(B, y)`` or ``max_utilisation``."""
    found = _CALL.fullmatch(re.sub(r"\s", "", text))
    name, *given = found.groups() if found else ("", None, None)
    arguments = [each for each in given if each is not None]
    if name == "energy" and not arguments:
        label = truss.system.label("force·length")
        return Descriptor("energy", label, truss.energy, "E", truss.signature)
    makers: dict[tuple[str, int], Callable[..., Descriptor]] = {
        ("force", 1): force,
        ("utilisation", 1): utilisation,
        ("max_utilisation", 0): max_utilisation,
        ("max_shortening", 0): max_shortening,
        ("displacement", 2): displacement,
        ("travel", 1): travel,
        ("effort", 1): effort,
    }
    maker = makers.get((name, len(arguments)))
    if maker is None:
        raise InputError(f"`descriptor` must be one of {WRITTEN}; got {text!r}.")
    return maker(truss, *arguments)
