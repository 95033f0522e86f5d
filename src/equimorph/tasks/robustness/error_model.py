"""Errors of parameters and of a structure's own data, and the structures that have them."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from equimorph.argument_checks import check_arguments
from equimorph.argument_kinds import as_array, short
from equimorph.arrays import Float, Lanes, Parameters
from equimorph.equilibria import settle
from equimorph.errors import InputError
from equimorph.model import Constraint, names_of
from equimorph.structures import State, Structure, from_identity
from equimorph.structures.quantities import find_descriptor
from equimorph.tasks.verification.error_box import Deviation

Offsets = Float[np.ndarray, "trials names"]

TRANSFERS = (1, 8, 64)
"""Steps in which a state is carried over to a structure with other data, if fewer do not do."""
FAR = (4.0, 0.25)
"""Factors on data at which F is compared with its linear law."""
LINEAR = 1e-9
"""Relative deviation from a linear law that is round-off."""
SAMPLES = 6
"""Random states and parameters at which the law is examined."""

_QUANTITY = re.compile(r"\s*([-+]?[\d.]+(?:[eE][-+]?\d+)?)\s*([^\d\s].*)")


@check_arguments
@dataclass(frozen=True)
class Errors:
    """Errors that a route has to survive: a box, or normally distributed ones.

    Parameters
    ----------
    sizes
        By name, in the unit of each parameter: actuators, loads, or patterns of intrinsic curvature
        and load of amplitude 0. Other names are data of the structure that are numbers (EI of a
        rod, E of its section, EA of bars), with errors as shares of their values: 0.05 is 5 %,
        in common where there are several. Half widths of the box; with a `probability` standard
        deviations.
    probability
        With which the route has to survive, shown by random trials; None: it must do so for all
        errors of the box, which is proved, or supported where bounds are sampled.
    correlation
        Matrix of the correlations of the errors, in the order of `sizes`; with a probability only.
    trials
        Number of random trials.
    seed
        Seed of the random numbers.

    Raises
    ------
    InputError
        If there is no size, one is not positive, or the correlation is no correlation matrix.

    Examples
    --------
    >>> import equimorph as em
    >>> em.Errors({"Theta": 0.02, "q": 0.05})
    Errors(Theta ± 0.02, q ± 0.05)
    >>> em.Errors({"Theta": 0.01}, probability=0.99)
    Errors(Theta ~ 0.01: 0.99 in 1000 trials)
    """

    sizes: Mapping[str, float]
    probability: float | None = None
    correlation: Sequence[Sequence[float]] | None = None
    trials: int = 1000
    seed: int = 0

    def __post_init__(self) -> None:
        """Check what a signature cannot tell."""
        if not self.sizes:
            raise InputError("`sizes` must name at least one error; got none.")
        if self.correlation is None:
            return
        count = len(self.sizes)
        if self.probability is None or not _is_correlation(self.correlation, count):
            raise InputError(
                f"`correlation` must be a correlation matrix of {count} errors, positive definite "
                f"with ones on its diagonal, beside a probability; got {short(self.correlation)}."
            )

    def __repr__(self) -> str:
        """Sizes, and the probability."""
        asked = (
            "" if self.probability is None else f": {self.probability:g} in {self.trials} trials"
        )
        return f"Errors({self}{asked})"

    def __str__(self) -> str:
        """Half widths, or standard deviations."""
        sign = "±" if self.probability is None else "~"
        return ", ".join(f"{name} {sign} {size:g}" for name, size in self.sizes.items())

    @property
    def widths(self) -> Float[np.ndarray, " names"]:
        """Sizes as an array."""
        return np.array([float(size) for size in self.sizes.values()])

    def random(self) -> Offsets:
        """Errors of all trials, normally distributed."""
        count = len(self.sizes)
        drawn = np.random.default_rng(self.seed).normal(size=(self.trials, count))
        if self.correlation is not None:
            drawn = drawn @ np.linalg.cholesky(np.array(self.correlation, float)).T
        return np.asarray(drawn * self.widths)

    def scaled(self, factor: float) -> "Errors":
        """The same errors, larger or smaller."""
        sizes = {name: factor * float(size) for name, size in self.sizes.items()}
        return Errors(sizes, self.probability, self.correlation, self.trials, self.seed)


def _is_correlation(given: Sequence[Sequence[float]], count: int) -> bool:
    try:
        matrix = as_array(given)
    except (TypeError, ValueError):
        return False
    right = matrix.shape == (count, count) and np.array_equal(matrix, matrix.T)
    right = right and np.allclose(np.diag(matrix), 1.0)
    return right and bool(np.linalg.eigvalsh(matrix)[0] > 0.0)


def errors_of(given: Mapping[str, float] | Errors) -> Errors:
    """Errors that a caller passes; sizes alone are the half widths of a box."""
    return given if isinstance(given, Errors) else Errors(given)


@dataclass(frozen=True)
class ErringStructure:
    """A structure, and errors of its parameters and data.

    Raises
    ------
    InputError
        For a name that is neither a parameter nor data of the structure, or a share of 1 and more.
    """

    structure: Structure
    errors: Errors

    def __post_init__(self) -> None:
        """Check names, and that both ends of each error make a structure."""
        names = names_of(self.structure.parameters)
        for name in self.data:
            share = float(self.errors.sizes[name])
            if not share < 1.0:
                raise InputError(f"`{name}` must have an error below 1, a share; got {share!r}.")
            if _scale(self._identity, name, 1.0)[1] == 0:
                raise InputError(
                    f"`survive` must name parameters ({', '.join(names)}) or numbers that the "
                    f"{self.structure.kind} was made from; got {name!r}."
                )

    @cached_property
    def data(self) -> tuple[str, ...]:
        """Names that are not those of parameters."""
        own = names_of(self.structure.parameters)
        return tuple(name for name in self.errors.sizes if name not in own)

    @cached_property
    def _identity(self) -> dict[str, Any]:
        return self.structure.identity()

    @property
    def steps(self) -> Float[np.ndarray, "m parameters"]:
        """Change of all parameters by each error of a parameter at its size."""
        return np.asarray((self.errors.widths[:, None] * self._columns)[self._columns.any(axis=1)])

    @cached_property
    def _columns(self) -> Float[np.ndarray, "names parameters"]:
        own = names_of(self.structure.parameters)
        return np.array([[float(name == each) for each in own] for name in self.errors.sizes])

    def shifts(self, offsets: Offsets) -> Parameters:
        """Errors of all parameters."""
        return np.asarray(offsets @ self._columns)

    def shares(self, offsets: Offsets) -> Float[np.ndarray, "trials data"]:
        """Errors of the data."""
        names = list(self.errors.sizes)
        return np.asarray(offsets[:, [names.index(name) for name in self.data]])

    def made(self, shares: Sequence[float]) -> Structure:
        """Structure with relative errors of the data; refused if none has such data."""
        identity = self._identity
        for name, share in zip(self.data, shares, strict=True):
            identity = _scale(identity, name, 1.0 + share)[0]
        return from_identity(identity) if any(shares) else self.structure

    def carry(self, start: State, shares: Sequence[float]) -> State | None:
        """State of the structure with such data next to a state; None if there is none."""
        for steps in TRANSFERS:
            z, found = start.z[None], True
            for k in range(1, steps + 1):
                made = self.made([k / steps * share for share in shares])
                near = settle(made, z, start.p[None])
                z, found = near.z, bool(near.found[0])
                if not found:
                    break
            if found and made.index(z, start.p[None])[0] == 0:
                return State(made, z[0], start.p)
        return None

    def constraints(
        self, within: Sequence[Constraint], structure: Structure
    ) -> tuple[Constraint, ...]:
        """Constraints on a structure with other data."""
        if structure is self.structure:
            return tuple(within)
        return tuple(
            replace(each, descriptor=find_descriptor(structure, each.descriptor.name))
            for each in within
        )

    @cached_property
    def deviations(self) -> tuple[Deviation, ...] | None:
        """Errors of data for a proof; None where F is not linear in some measure of them."""
        found = [self._deviation(name) for name in self.data]
        linear = tuple(each for each in found if each is not None)
        if len(linear) < len(found) or (len(found) > 1 and not self._additive(linear)):
            return None
        return linear

    def _deviation(self, name: str) -> Deviation | None:
        """Error of one datum; F is linear in a measure x of it like EI, 1/EI or E."""
        size = float(self.errors.sizes[name])
        place = self._examples
        base = self.structure.residual(*place)
        ends = [self._with(name, sign * size) for sign in (-1.0, 1.0)]
        moves = [each.residual(*place) - base for each in ends]
        worse = int(np.abs(moves[1]).max() > np.abs(moves[0]).max())
        changed, g = ends[worse], moves[worse]
        checks = [self._with(name, 0.5 * sign * size) for sign in (-1.0, 1.0)]
        far = [self._with(name, factor - 1.0) for factor in FAR]
        others = [ends[1 - worse], *checks, *far]
        multiples = [_multiple(each.residual(*place) - base, g) for each in others]
        if not np.isfinite(multiples).all() or np.abs(multiples[:3]).max() > 1.0 + LINEAR:
            return None
        best = int(np.abs(multiples[3:]).argmax())
        return Deviation(self.structure, changed, far[best], float(multiples[3 + best]))

    def _with(self, name: str, share: float) -> Structure:
        return self.made([share if each == name else 0.0 for each in self.data])

    def _additive(self, deviations: Sequence[Deviation]) -> bool:
        """Whether the changes of F by several errors add up."""
        place, base = self._examples, self.structure.residual(*self._examples)
        total = sum(each.force(*place) for each in deviations)
        sizes = [float(self.errors.sizes[name]) for name in self.data]
        signs = [
            1.0 if each.changed.signature == self._with(name, size).signature else -1.0
            for each, name, size in zip(deviations, self.data, sizes, strict=True)
        ]
        every = self.made([sign * size for sign, size in zip(signs, sizes, strict=True)])
        gap = np.abs(every.residual(*place) - base - total).max()
        return bool(gap <= LINEAR * np.abs(total).max())

    @cached_property
    def _examples(self) -> tuple[Lanes, Parameters]:
        """Random states and parameters."""
        generator = np.random.default_rng(5)
        size, count = self.structure.size, len(self.structure.parameters)
        middle = np.array([each.default or 0.0 for each in self.structure.parameters])
        moves = generator.uniform(0.1, 0.5, size=(SAMPLES, count)) * self.structure.scales
        return generator.normal(size=(SAMPLES, size)), middle + moves


def _multiple(change: Lanes, g: Lanes) -> float:
    """Factor of g that is a change of F; not a number if none is."""
    multiple = float((change * g).sum() / (g * g).sum()) if g.any() else np.nan
    good = np.abs(change - multiple * g).max() <= LINEAR * max(1.0, abs(multiple)) * np.abs(g).max()
    return multiple if good else np.nan


def _scale(data: Any, name: str, factor: float) -> tuple[Any, int]:
    """Plain data with all numbers of a name multiplied, and how many there are."""
    if isinstance(data, Mapping):
        pairs = [
            (_times(value, factor), 1) if key == name and _is_quantity(value)
            else _scale(value, name, factor)
            for key, value in data.items()
        ]  # fmt: skip
        found = dict(zip(data, (value for value, _ in pairs), strict=True))
        return found, sum(count for _, count in pairs)
    if isinstance(data, list | tuple):
        pairs = [_scale(value, name, factor) for value in data]
        return [value for value, _ in pairs], sum(count for _, count in pairs)
    return data, 0


def _is_quantity(value: Any) -> bool:
    """Whether plain data are a number, or a text with a unit."""
    if isinstance(value, str):
        return _QUANTITY.fullmatch(value) is not None
    return isinstance(value, int | float) and not isinstance(value, bool)


def _times(value: Any, factor: float) -> Any:
    """Quantity multiplied by a number; unchanged by 1."""
    if not isinstance(value, str) or factor == 1.0:
        return factor * value if factor != 1.0 else value
    found = _QUANTITY.fullmatch(value)
    assert found is not None
    return f"{factor * float(found[1])!r} {found[2]}"
