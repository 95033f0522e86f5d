"""How a limit load falls with an imperfection: smoothly or with a fractional power."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal

import numpy as np

from equimorph.argument_checks import check_arguments
from equimorph.arrays import Float
from equimorph.equilibria import LimitLoad, lift, limit_load
from equimorph.equilibria.trace_options import VIOLATIONS
from equimorph.errors import InputError
from equimorph.model import Constraint, position
from equimorph.structures import State

Sizes = Float[np.ndarray, " tried"]
Falls = Float[np.ndarray, "2 tried"]

SIZES = (1e-3, 3e-4, 1e-4, 3e-5)
"""Imperfections that are tried first, in scales of the parameter, both signs."""
FINER, MOST_SIZES = 10.0**-0.5, 10
"""Ratio of further, smaller sizes, and how many are tried until two fits agree."""
RESOLVED = 1e-9
"""Change of the limit load that exceeds round-off, relative to the load or to its scale."""
UNFOLDED = 100.0
"""Residual at a branch point, relative to that of the perfect one, which is a fold overlooked."""
FITTED = 5
"""Smallest sizes through which a law is fitted: the larger ones only add higher orders."""
LIMITS = ("fold", "branch point", *VIOLATIONS)
"""Ends of paths that are limit loads."""
ROUND_OFF = 1e-15
"""Residual that any state may have, in the structure's scale of forces."""
WITHIN = 0.03
"""Largest difference of a fitted exponent from that of a law."""
SETTLED = 1e-3
"""Disagreement of fits with and without the largest size, above which smaller ones are tried."""


@dataclass(frozen=True)
class Law:
    """How the change of a limit load begins [Koiter1945]_.

    The change is a power series in ``x = sign(ε)·|ε|^(1/root)`` that begins with ``|ε|^power``.
    """

    name: str
    """In words."""
    power: float
    """Exponent of |ε|."""
    root: int
    """Root of the imperfection in whose powers the series proceeds."""
    both_signs: bool | None
    """Whether the load changes in the same way for both signs of ε, in the leading order; None if
    only one sign limits the load, or has to."""


LAWS = (
    Law("smooth", 1.0, 1, False),
    Law("one-half power: an asymmetric branch point", 0.5, 2, None),
    Law("two-thirds power: a symmetric branch point", 2.0 / 3.0, 3, True),
    Law("quadratic: smooth, without a first order", 2.0, 1, True),
    Law("|ε|: an asymmetric point, imperfect in the second order", 1.0, 1, None),
    Law("four-thirds power: a symmetric point, imperfect in the second order", 4.0 / 3.0, 3, True),
)
"""Known laws; of those with one exponent the first that fits is taken."""


@dataclass(frozen=True, eq=False)
class ImperfectionLaw:
    """``q_lim(ε) ≈ q_lim(0) + coefficient·|ε|^exponent``, for the sign of ε that is worse.

    Parameters
    ----------
    status
        "fitted", or "refused" with the reason in `why`.
    law
        Name of the law [Koiter1945]_, see `LAWS`: smooth, one-half or two-thirds power at branch
        points; their squares where the imperfection only counts in the second order; "unknown".
    exponent
        Fitted exponent, extrapolated to zero imperfection.
    coefficient
        Coefficient for the exponent of the law.
    perfect
        Limit load without the imperfection.
    sizes, loads
        Imperfections that were tried, with their signs, in the unit of the parameter, and limit
        loads.
    """

    status: Literal["fitted", "refused"]
    why: str
    law: str
    exponent: float
    coefficient: float
    perfect: float
    sizes: Float[np.ndarray, " tried"]
    loads: Float[np.ndarray, " tried"]

    @property
    def power(self) -> float:
        """Exponent to which the coefficient belongs: of the law, or as fitted if unknown."""
        return next((law.power for law in LAWS if law.name == self.law), self.exponent)

    def __repr__(self) -> str:
        """Name and formula."""
        if self.status != "fitted":
            return f"ImperfectionLaw(refused: {self.why})"
        formula = f"{self.perfect:.6g} {self.coefficient:+.4g} |ε|^{self.exponent:.3g}"
        return f"ImperfectionLaw({formula}; {self.law})"


@check_arguments
def imperfection_law(
    start: State,
    load: str,
    imperfection: str,
    *,
    within: Sequence[Constraint] = (),
    sizes: Sequence[float] = SIZES,
) -> ImperfectionLaw:
    """Fit the law by which an imperfection lowers a limit load.

    The start is lifted to each imperfection, and its limit load found. With each known law, the
    exponent and the coefficient are extrapolated to zero: interpolation by a power series in the
    root of the imperfection that belongs to the law, through the smallest sizes. Where both signs
    limit the load, their mean or difference leaves out every other order. Smaller sizes are added
    until fits with and without the largest one agree; those whose change is lost in round-off, or
    whose path is not distinguished from the perfect one, do not count.

    Parameters
    ----------
    start
        Stable state of the perfect structure, usually unloaded.
    load
        Name of the parameter that grows up to the limit load.
    imperfection
        Name of the parameter that is zero for the perfect structure.
    within
        Constraints that end the paths.
    sizes
        Imperfections in scales of the parameter that are tried first, three or more, in descending
        order.

    Returns
    -------
    The fitted law; or the reason of a refusal: no limit load at imperfections, or no change of
    it beyond round-off.

    Raises
    ------
    InputError
        If names are unknown or equal, or sizes are not positive and decreasing.
    """
    parameters = start.structure.parameters
    place = position(parameters, imperfection)
    position(parameters, load)
    tried = np.array(sizes, dtype=float)
    if load == imperfection:
        raise InputError(f"`imperfection` must not be the load; got {load!r}.")
    if len(tried) < 3 or not (np.diff(tried) < 0.0).all():
        raise InputError(
            f"`sizes` must be three or more positive numbers in decreasing order; got {sizes!r}."
        )
    trials = _Trials(start, load, place, tuple(within))
    loads = trials.loads(tried)
    while (fit := _best_fit(tried, trials.falls(loads))).error > SETTLED:
        if len(tried) >= MOST_SIZES or trials.lost_in_round_off(loads[:, -1]):
            break
        finer = FINER * tried[-1:]
        tried, loads = np.append(tried, finer), np.append(loads, trials.loads(finer), axis=1)
    why = "" if np.isfinite(fit.exponent) else trials.why(loads)
    return ImperfectionLaw(
        "refused" if why else "fitted",
        why,
        fit.name,
        fit.exponent,
        fit.coefficient / parameters[place].scale ** fit.power,
        trials.perfect.value,
        parameters[place].scale * np.concatenate([tried, -tried]),
        loads.ravel(),
    )


@dataclass(frozen=True)
class _Trials:
    """Limit loads of the structure with imperfections."""

    start: State
    load: str
    place: int
    within: tuple[Constraint, ...]

    @cached_property
    def perfect(self) -> LimitLoad:
        """Limit load without imperfection."""
        found = limit_load(self.start, self.load, within=self.within)
        return found if found.kind in LIMITS else replace(found, value=float("nan"))

    @cached_property
    def noise(self) -> float:
        """Change of the limit load that exceeds round-off."""
        parameters = self.start.structure.parameters
        scale = parameters[position(parameters, self.load)].scale
        return float(RESOLVED * max(abs(self.perfect.value), scale))

    def falls(self, loads: Falls) -> Falls:
        """Changes of the limit load; NaN where there is none, or none above round-off."""
        falls = loads - self.perfect.value
        return np.where(np.abs(falls) > self.noise, falls, np.nan)

    def lost_in_round_off(self, loads: Float[np.ndarray, " tried"]) -> bool:
        """Whether limit loads exist, but do not differ from that without imperfection."""
        falls = np.abs(loads - self.perfect.value)
        return bool(np.isfinite(falls).any() and not (falls > self.noise).any())

    def why(self, loads: Falls) -> str:
        """Why no law was fitted."""
        if self.perfect.kind not in LIMITS:
            return f"no limit load without the imperfection: {self.perfect.kind}"
        if (np.isfinite(loads).sum(axis=1) < 3).all():
            return "fewer than three imperfections of one sign have a known limit load"
        return "imperfections of these sizes do not change the limit load beyond round-off"

    def loads(self, sizes: Sizes) -> Float[np.ndarray, "2 tried"]:
        """Limit loads for both signs, positive ones first; NaN where no limit load exists."""
        return np.array([[self._load(sign * size) for size in sizes] for sign in (1.0, -1.0)])

    def _load(self, size: float) -> float:
        parameter = self.start.structure.parameters[self.place]
        imperfect = float(self.start.p[self.place] + size * parameter.scale)
        path = lift(self.start, {parameter.name: imperfect})
        if not path.arrived:
            return float("nan")
        found = limit_load(path.end.state, self.load, within=self.within)
        limited = found.kind in LIMITS and not self._overlooks_fold(found)
        return found.value if limited else float("nan")

    def _overlooks_fold(self, found: LimitLoad) -> bool:
        """Whether a fold near the perfect branch point was taken for a branch point.

        Imperfections near round-off unfold it by less than a path can tell; what they leave at the
        point, which is none of their equilibria, is a residual.
        """
        if not found.kind == self.perfect.kind == "branch point":
            return False
        return _residual(found.state) > UNFOLDED * max(_residual(self.perfect.state), ROUND_OFF)


def _residual(state: State) -> float:
    return float(np.abs(state.structure.residual(state.z[None], state.p[None])).max())


@dataclass(frozen=True)
class _Fit:
    """A law fitted to the falls of a limit load, and the difference of two of its fits."""

    name: str
    power: float
    exponent: float
    coefficient: float
    error: float


def _best_fit(sizes: Sizes, falls: Falls) -> _Fit:
    """Fit of the law whose exponent is the nearest; not numbers where too few falls are known."""
    enough = np.flatnonzero(np.isfinite(falls).sum(axis=1) > 2)
    if len(enough) == 0:
        nan = float("nan")
        return _Fit("unknown", nan, nan, nan, np.inf)
    # an asymmetric branch point limits the load for one sign only
    worse = int(min(enough, key=lambda side: falls[side][np.isfinite(falls[side])][-1]))
    fits = [_Part.of(law, falls, worse).fit(law, sizes) for law in LAWS]
    known = [fit for fit in fits if abs(fit.exponent - fit.power) < WITHIN]
    if known:
        return min(known, key=lambda fit: abs(fit.exponent - fit.power))
    last = np.flatnonzero(np.isfinite(falls[worse]))[-2:]
    slope = _exponent(sizes[last], falls[worse, last], 1.0)
    coefficient = float(falls[worse, last[-1]] / sizes[last[-1]] ** slope)
    return _Fit("unknown", slope, slope, coefficient, np.inf)


@dataclass(frozen=True)
class _Part:
    """What a law describes of the falls, and the power of |ε| by which its orders grow."""

    falls: Float[np.ndarray, " tried"]
    step: float

    @classmethod
    def of(cls, law: Law, falls: Falls, worse: int) -> "_Part":
        """The part even or odd in ε, which has every other order only, or one side.

        Where both signs limit the load, the larger part says which laws can hold; for others, no
        falls are left.
        """
        mean, half = falls.mean(axis=0), 0.5 * (falls[worse] - falls[1 - worse])
        both = np.flatnonzero(np.isfinite(mean))
        if len(both) < 3 or law.both_signs is None:
            return cls(falls[worse], 1.0 / law.root)
        even = bool(abs(mean[both[-1]]) > abs(half[both[-1]]))
        part = mean if even else half
        return cls(part if even == law.both_signs else np.full(len(part), np.nan), 2.0 / law.root)

    def fit(self, law: Law, sizes: Sizes) -> _Fit:
        """Exponent and coefficient at zero; not numbers where the falls cannot be of this law."""
        some = np.flatnonzero(np.isfinite(self.falls))[-FITTED:]
        falls, nan = self.falls[some], float("nan")
        if len(some) < 3 or np.ptp(np.sign(falls)) > 0.0:
            return _Fit(law.name, law.power, nan, nan, np.inf)
        exponents = [_exponent(sizes[k], self.falls[k], self.step) for k in (some, some[1:])]
        coefficients = [
            _coefficient(sizes[k], self.falls[k], law.power, self.step) for k in (some, some[1:])
        ]
        error = max(abs(np.diff(exponents)[0]), abs(1.0 - coefficients[1] / coefficients[0]))
        return _Fit(law.name, law.power, exponents[0], coefficients[0], float(error))


def _exponent(sizes: Sizes, falls: Float[np.ndarray, " tried"], step: float) -> float:
    """``log|fall| = log|c| + exponent·log|ε| + b₁ x + b₂ x² + …`` with ``x = |ε|^step``."""
    relative = sizes / sizes[0]
    orders = [relative ** (step * k) for k in range(1, len(sizes) - 1)]
    columns = np.stack([np.ones(len(sizes)), np.log(relative), *orders], axis=1)
    return float(np.linalg.solve(columns, np.log(np.abs(falls)))[1])


def _coefficient(
    sizes: Sizes, falls: Float[np.ndarray, " tried"], power: float, step: float
) -> float:
    """Coefficient at zero: ``fall/|ε|^power`` by a polynomial in ``|ε|^step`` through all."""
    x = (sizes / sizes[0]) ** step
    return float(np.polynomial.polynomial.polyfit(x, falls / sizes**power, len(x) - 1)[0])
