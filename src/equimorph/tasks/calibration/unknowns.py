"""What is unknown in a calibration: values, offsets and gains of parameters."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
from jaxtyping import Float

from equimorph.errors import InputError
from equimorph.model import position
from equimorph.structures import States, Structure

Kind = Literal["value", "offset", "gain"]
Wanted = Mapping[str | tuple[str, ...], Kind]
Vector = Float[np.ndarray, " k"]
Parameters = Float[np.ndarray, "lanes parameters"]


@dataclass(frozen=True, eq=False)
class Unknowns:
    """True parameters as linear functions of unknowns x: p = base + Σ xₖ columnₖ.

    Attributes
    ----------
    names
        What each unknown is called.
    start
        Unknowns at which the parameters are the nominal ones.
    base, columns
        Of the linear function, one lane per state.
    """

    structure: Structure
    names: tuple[str, ...]
    start: Vector
    base: Parameters
    columns: Float[np.ndarray, "k lanes parameters"]

    def parameters(self, x: Vector) -> Parameters:
        """All parameters of all states."""
        return np.asarray(self.base + np.einsum("k,klp->lp", x, self.columns))

    def outside(self, p: Parameters) -> str:
        """Name of a parameter that leaves the limits of its meaning, or nothing."""
        for column, each in zip(p.T, self.structure.parameters, strict=True):
            if not ((each.lower < column) & (column < each.upper)).all():
                return each.name
        return ""


def unknowns(start: States, wanted: Wanted) -> Unknowns:
    """Linear function of the unknowns that are wanted.

    Raises
    ------
    InputError
        For nothing, an unknown name or kind, a parameter in two unknowns, a value that differs
        between the states, or a gain of zeros.
    """
    if not wanted:
        raise InputError("`unknown` must name at least one parameter; got nothing.")
    structure, base = start.structure, start.p.copy()
    names, first, columns = [], [], []
    used: set[str] = set()
    for key, kind in wanted.items():
        group = (key,) if isinstance(key, str) else tuple(key)
        places = [position(structure.parameters, name) for name in group]
        _check(kind, group, start.p[:, places], used)
        used |= set(group)
        column = np.zeros_like(base)
        column[:, places] = start.p[:, places] if kind == "gain" else 1.0
        if kind != "offset":
            base[:, places] = 0.0
        first.append({"value": start.p[0, places[0]], "offset": 0.0, "gain": 1.0}[kind])
        words = " and ".join(group)
        names.append(words if kind == "value" else f"{kind} of {words}")
        columns.append(column)
    return Unknowns(structure, tuple(names), np.array(first), base, np.array(columns))


def _check(kind: str, group: tuple[str, ...], nominal: Parameters, used: set[str]) -> None:
    words = " and ".join(group)
    if kind not in get_args(Kind):
        raise InputError(
            f"`unknown` must be one of {', '.join(get_args(Kind))} for {words}; got {kind!r}."
        )
    twice = used & set(group) or len(set(group)) < len(group)
    if twice:
        raise InputError(f"`unknown` must name a parameter once; got {words} again.")
    if kind == "value" and np.ptp(nominal) > 0.0:
        raise InputError(
            f"`start` must have one value of {words}, to start from; got several. "
            "Fit its offset, or make them equal."
        )
    if kind == "gain" and not nominal.any():
        raise InputError(f"`start` must have {words} other than zero for a gain; got zeros.")
