"""What is unknown in a calibration: values, offsets, gains of parameters; data of structures."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Literal, get_args

import numpy as np

from equimorph.argument_checks import check_arguments
from equimorph.arrays import Float, Parameters
from equimorph.errors import InputError
from equimorph.model import Rebuilt, position
from equimorph.structures import States, Structure

Kind = Literal["value", "offset", "gain", "data"]
Wanted = Mapping[str | tuple[str, ...], Kind]
Vector = Float[np.ndarray, " k"]


@check_arguments
@dataclass(frozen=True, eq=False)
class Family(Rebuilt):
    """Structures that differ in data other than parameters: a stiffness, a length, a rise.

    Parameters
    ----------
    make
        Structure of given data, by name: ``lambda EI: Rod(EI=EI, length=0.3, ...)``. All members
        have the same unknowns and parameters.
    nominal
        Data of the structure that the states belong to.
    """

    make: Callable[..., Structure]
    nominal: Mapping[str, float]


@dataclass(frozen=True, eq=False)
class Unknowns:
    """True parameters as linear functions of unknowns x: p = base + Σ xₖ columnₖ."""

    structure: Structure
    """The nominal one."""
    names: tuple[str, ...]
    """What each unknown is called."""
    start: Vector
    """Unknowns at which parameters and structure are the nominal ones."""
    base: Parameters
    columns: Float[np.ndarray, "k lanes parameters"]
    """Of the linear function, one lane per state."""
    family: Family | None
    data: Mapping[str, int]
    """Structures by the unknowns among their data: name and place among the unknowns."""

    def made(self, x: Vector) -> Structure:
        """Structure of some unknowns; refused if none has such data, like a negative stiffness."""
        values = {name: float(x[at]) for name, at in self.data.items()}
        of_data = list(self.data.values())
        if self.family is None or np.array_equal(x[of_data], self.start[of_data]):
            return self.structure
        return self.family.make(**{**self.family.nominal, **values})

    def parameters(self, x: Vector) -> Parameters:
        """All parameters of all states."""
        return np.asarray(self.base + np.einsum("k,klp->lp", x, self.columns))

    def outside(self, p: Parameters, structure: Structure) -> str:
        """Name of a parameter that leaves the limits of its meaning, or nothing."""
        for column, each in zip(p.T, structure.parameters, strict=True):
            if not ((each.lower < column) & (column < each.upper)).all():
                return each.name
        return ""


def unknowns(start: States, wanted: Wanted, family: Family | None = None) -> Unknowns:
    """Parameters as a linear function of the unknowns to fit.

    Refused if there is no unknown, a name or kind is not known, a parameter occurs in two unknowns,
    a value differs between the states, a gain multiplies zeros, data have no family or do not
    belong to it, or the nominal member of the family is another structure.
    """
    if not wanted:
        raise InputError("`unknown` must name at least one parameter; got nothing.")
    structure, base = start.structure, start.p.copy()
    names, first, columns = list[str](), list[float](), []
    used: set[str] = set()
    data: dict[str, int] = {}
    for key, kind in wanted.items():
        if kind == "data":
            data[_datum(key, family)] = len(names)
            names.append(str(key))
            first.append(float(family.nominal[str(key)]) if family else np.nan)
            columns.append(np.zeros_like(base))
            continue
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
    if family is not None:
        _check_family(structure, family)
    table = np.array(columns)
    return Unknowns(structure, tuple(names), np.array(first), base, table, family, data)


def _datum(key: Any, family: Family | None) -> str:
    """Name of an unknown among the data of a structure."""
    if family is None:
        raise InputError(
            f"`family` must be given to fit the data of a structure; got none for {key!r}."
        )
    if not isinstance(key, str) or key not in family.nominal:
        raise InputError(
            f"`unknown` must name data of the family ({', '.join(family.nominal)}); got {key!r}."
        )
    return key


def _check_family(structure: Structure, family: Family) -> None:
    member = family.make(**family.nominal)
    if member.signature != structure.signature:
        raise InputError(
            f"`family` must make the structure of the states from its nominal data; got {member!r} "
            f"with other data than {structure!r}."
        )


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
        raise InputError(f"`start` must have nonzero values of {words} for a gain; got zeros.")
