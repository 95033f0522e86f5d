"""Declarations of an energy: its unknowns, its parameters, and expressions in them."""

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Annotated, Any

import numpy as np

from equimorph.argument_checks import check_arguments
from equimorph.argument_kinds import is_listed, short
from equimorph.argument_notes import BOUNDS
from equimorph.argument_vocabulary import PERIOD
from equimorph.arrays import Float
from equimorph.errors import InputError
from equimorph.model import Parameter
from equimorph.structures.energy.expressions import (
    CONSTANTS,
    FORMULA,
    FUNCTIONS,
    SYMBOLS,
    expression,
    write_formulas,
)
from equimorph.structures.energy.tape import casadi, rough_operations

Formula = Annotated[Any, FORMULA]
_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]*")


@check_arguments
@dataclass(frozen=True)
class Unknown:
    """One unknown of an energy.

    Parameters
    ----------
    name
        As it stands in the expressions: letters, digits and underscores.
    natural
        Its value in the natural state: a number, or an expression in the parameters.
    guesses
        Range from which guesses are drawn. None: between `lower` and `upper` if both are finite,
        else within half a `period`, or 1, of the natural value.
    lower, upper
        Open limits of its meaning: states beyond them, behind a singularity of the energy say, do
        not count. A part of the set is cut out by constraints of the problem, not by these.
    mass
        Its weight in the metric; positive.
    unit
        Unit of the descriptor of its name.
    period
        Change after which a state is the same, like 2π of the angle of a pendulum. Searches find
        one of the states that differ by whole periods.
    """

    name: str
    natural: Formula = 0.0
    guesses: Annotated[Sequence[float], BOUNDS] | None = None
    lower: float = -np.inf
    upper: float = np.inf
    mass: float = 1.0
    unit: str = "1"
    period: Annotated[float, PERIOD] = np.inf

    def __post_init__(self) -> None:
        """Check the limits."""
        if np.isfinite(self.period) and np.isfinite([self.lower, self.upper]).any():
            raise InputError(
                f"`period` of {self.name} must not stand beside `lower` or `upper`; got "
                f"{self.period!r}. Bound what is drawn by `guesses`."
            )
        if not self.lower < self.upper:
            raise InputError(
                f"`lower` of {self.name} must be less than `upper`; got {self.lower!r} and "
                f"{self.upper!r}."
            )

    @property
    def range(self) -> tuple[float, float] | None:
        """Range of guesses; None for a neighbourhood of the natural value."""
        if self.guesses is not None:
            return float(self.guesses[0]), float(self.guesses[1])
        bounded = np.isfinite(self.lower) and np.isfinite(self.upper)
        return (self.lower, self.upper) if bounded else None

    @property
    def reach(self) -> float:
        """Largest distance of guesses from the natural value, where there is no range."""
        return 0.5 * self.period if np.isfinite(self.period) else 1.0


@dataclass(frozen=True)
class Formulas:
    """Scalar expressions: texts, numbers or CasADi graphs as given, or graphs as read."""

    energy: Any
    constraints: tuple[Any, ...]
    natural: tuple[Any, ...]
    draw: tuple[tuple[Any, Any], ...]
    forces: tuple[tuple[Any, Any], ...]
    descriptors: Mapping[str, Any]
    inertia: tuple[tuple[Any, ...], ...] = ()

    def flat(self) -> list[Any]:
        """All of them, one after the other."""
        points = [component for pair in (*self.draw, *self.forces) for component in pair]
        heavy = [entry for row in self.inertia for entry in row]
        rest = (*self.natural, *points, *self.descriptors.values(), *heavy)
        return [self.energy, *self.constraints, *rest]

    def fill(self, flat: Sequence[Any]) -> "Formulas":
        """Return the same with new expressions, in the order of `flat`."""
        each = iter(flat)
        return Formulas(
            next(each),
            tuple(next(each) for _ in self.constraints),
            tuple(next(each) for _ in self.natural),
            tuple((next(each), next(each)) for _ in self.draw),
            tuple((next(each), next(each)) for _ in self.forces),
            {name: next(each) for name in self.descriptors},
            tuple(tuple(next(each) for _ in row) for row in self.inertia),
        )

    def labels(self, unknowns: Sequence[Unknown]) -> list[str]:
        """Name of each for messages, in the order of `flat`."""
        points = [f"draw[{i}][{k}]" for i in range(len(self.draw)) for k in (0, 1)]
        points += [f"forces[{i}].force[{k}]" for i in range(len(self.forces)) for k in (0, 1)]
        named = [f"natural of {unknown.name}" for unknown in unknowns]
        constraints = [f"constraints[{i}]" for i in range(len(self.constraints))]
        described = [f"descriptors.{name}" for name in self.descriptors]
        heavy = [f"mass[{i}][{j}]" for i, row in enumerate(self.inertia) for j in range(len(row))]
        return ["energy", *constraints, *named, *points, *described, *heavy]


UnknownSpec = Annotated[
    Unknown | str | Mapping[str, Any] | Annotated[Any, SYMBOLS],
    "names, unknowns, their data, or symbols of casadi.SX",
]
ParameterSpec = Annotated[
    Parameter | Mapping[str, Any], "parameters, like `Parameter(...)`, or their data"
]


def unknowns_of(given: UnknownSpec | Sequence[UnknownSpec]) -> tuple[Unknown, ...]:
    """Unknowns from names, symbols, `Unknown`s or their data."""
    unknowns: list[Unknown] = []
    several: Any = given if is_listed(given) else [given]
    for each in several:
        if isinstance(each, Unknown):
            unknowns.append(each)
        elif isinstance(each, Mapping):
            unknowns.append(_build(Unknown, each, "unknowns"))
        else:
            unknowns += [Unknown(name) for name in _symbol_names(each)]
    if not unknowns:
        raise InputError("`unknowns` must name at least one unknown; got none.")
    return tuple(unknowns)


def periods_of(unknowns: Sequence[Unknown], size: int) -> Float[np.ndarray, "periods size"]:
    """Changes of z by the periods of the unknowns, one for each that has one."""
    periods = np.array([each.period for each in unknowns])
    return np.asarray(np.diag(periods)[np.isfinite(periods)] @ np.eye(len(unknowns), size))


def parameters_of(given: Iterable[ParameterSpec]) -> tuple[Parameter, ...]:
    """Parameters from `Parameter`s or their data."""
    made = []
    for each in given:
        one: Parameter = (
            each if isinstance(each, Parameter) else _build(Parameter, each, "parameters")
        )
        default = one.default
        if one.role == "load" and default is None:
            default = 0.0
        made.append(replace(one, default=None if default is None else one.check(default)))
    return tuple(made)


def data_of(one: Parameter | Unknown) -> dict[str, Any]:
    """Return the data of a parameter or unknown, without infinite limits."""
    return {
        key: value
        for key, value in asdict(one).items()
        if value is not None and not (isinstance(value, float) and np.isinf(value))
    }


def _build(kind: Any, data: Any, what: str) -> Any:
    defaults = {"unit": "1", "scale": 1.0, "role": "actuator"} if kind is Parameter else {}
    if not ("name" in data and set(data) <= set(kind.__dataclass_fields__)):
        fields = ", ".join(kind.__dataclass_fields__)
        raise InputError(f"`{what}` must hold {kind.__name__}s ({fields}); got {data!r}.")
    return kind(**{**defaults, **data})


def _symbol_names(given: Any) -> list[str]:
    if isinstance(given, str):
        return [given]
    if isinstance(given, casadi().SX) and given.is_valid_input():
        return [entry.name() for entry in given.elements()]
    raise InputError(
        f"`unknowns` must be names, symbols of casadi.SX or Unknowns; got {short(given)}."
    )


class Symbols:
    """The symbols of all unknowns and parameters, and formulas read with them."""

    def __init__(
        self,
        unknowns: Sequence[Unknown],
        parameters: Sequence[Parameter],
        definitions: Mapping[str, Any],
        formulas: Formulas,
    ) -> None:
        ca = casadi()
        names = [unknown.name for unknown in unknowns] + [each.name for each in parameters]
        _check_names([*names, *definitions])
        _check_words(formulas.descriptors)
        given = [*definitions.values(), *formulas.flat()]
        graphs = [each for each in given if isinstance(each, ca.SX)]
        found: dict[str, Any] = {}
        for symbol in ca.symvar(ca.vertcat(*graphs)) if graphs else ():
            if symbol.name() in found:
                raise InputError(
                    f"`energy` must use one symbol per name; got two of {symbol.name()}."
                )
            found[symbol.name()] = symbol
        unknown = sorted(set(found) - set(names))
        if unknown:
            raise InputError(
                f"`energy` must use unknowns and parameters only; got the symbol {unknown[0]}. "
                "Name it in `unknowns` or `parameters`."
            )
        self.all = [found[name] if name in found else ca.SX.sym(name) for name in names]
        self.u = ca.vertcat(*self.all[: len(unknowns)])
        self.p = ca.vertcat(*self.all[len(unknowns) :])
        known = dict(zip(names, self.all, strict=True))
        for name, text in definitions.items():
            known[name] = expression(text, known, f"definitions.{name}")
        labels = formulas.labels(unknowns)
        graphs = [
            expression(each, known, label)
            for each, label in zip(formulas.flat(), labels, strict=True)
        ]
        self.formulas = formulas.fill(graphs)
        self._check(names)

    def _check(self, names: Sequence[str]) -> None:
        """Refuse energies that are rough, and symbols that have no effect."""
        ca = casadi()
        physics = ca.vertcat(self.formulas.energy, *self.formulas.constraints)
        everything = ca.vertcat(*self.all)
        rough = rough_operations(physics, everything)
        if rough:
            raise InputError(
                "`energy` and `constraints` must be twice differentiable; got "
                f"{', '.join(rough)}. Replace fabs(x) by sqrt(x**2 + small**2), for example."
            )
        used = ca.which_depends(physics, everything, 1, False)
        for name, counts in zip(names, used, strict=True):
            if not counts:
                raise InputError(
                    f"`{name}` must appear in the energy or a constraint; it does not."
                )
        free = {symbol.name() for symbol in ca.symvar(ca.vertcat(*self.formulas.natural))}
        wrong = sorted(free & {symbol.name() for symbol in self.u.elements()})
        if wrong:
            raise InputError(f"`natural` must depend on parameters only; got {wrong[0]}.")
        for i, constraint in enumerate(self.formulas.constraints):
            if not any(ca.which_depends(constraint, self.u, 1, False)):
                raise InputError(f"`constraints[{i}]` must depend on an unknown; it does not.")
        if len(self.formulas.constraints) >= self.u.numel():
            raise InputError(
                f"`constraints` must be fewer than the {self.u.numel()} unknowns; "
                f"got {len(self.formulas.constraints)}."
            )

    def texts(self) -> tuple[dict[str, str], Formulas]:
        """Definitions and formulas as texts."""
        definitions, flat = write_formulas(self.formulas.flat(), self.all)
        return definitions, self.formulas.fill(flat)


def _check_words(names: Iterable[str]) -> None:
    for name in names:
        if not _NAME.fullmatch(name):
            raise InputError(
                f"`name` must be a letter, then letters, digits and underscores; got {name!r}."
            )


def _check_names(names: Sequence[str]) -> None:
    _check_words(names)
    taken = {*CONSTANTS, *FUNCTIONS}
    for name in names:
        if name in taken:
            raise InputError(f"`name` must be given once, and be no function; got {name} again.")
        taken.add(name)


def mass_rows(given: Sequence[Any], unknowns: int) -> tuple[tuple[Any, ...], ...]:
    """Rows of a mass matrix from its diagonal or its rows; none where nothing is given.

    Other numbers of rows, or of entries in one, are refused.
    """
    if not len(given):
        return ()
    listed = [is_listed(row) for row in given]
    sizes = [len(row) if lined else 1 for row, lined in zip(given, listed, strict=True)]
    if len(given) != unknowns or (any(listed) and sizes != [unknowns] * unknowns):
        raise InputError(
            f"`mass` must have one formula for each of the {unknowns} unknowns, or as many rows of "
            f"as many; got {short(given)}."
        )
    if all(listed):
        return tuple(tuple(row) for row in given)
    diagonal = enumerate(given)
    return tuple(tuple(each if i == j else 0.0 for j in range(unknowns)) for i, each in diagonal)


def points_of(draw: Sequence[Sequence[Any]]) -> tuple[tuple[Any, Any], ...]:
    """Points to draw: none, or at least two, of two coordinates each."""
    if len(draw) == 1:
        raise InputError("`draw` must have at least two points; got one.")
    return tuple((point[0], point[1]) for point in draw)


def check_promise(coercive: bool, constraints: int) -> None:
    """Refuse the promise of growth beside constraints."""
    if coercive and constraints:
        raise InputError(
            f"`coercive` must be False for energies with constraints; got {constraints} of them."
        )
