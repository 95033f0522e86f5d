"""How a limit load falls with an imperfection: smoothly or with a fractional power."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from jaxtyping import Float

from equimorph.equilibria import lift, limit_load
from equimorph.errors import InputError
from equimorph.model import Constraint, position
from equimorph.structures import State

SIZES = (1e-3, 3e-4, 1e-4, 3e-5)
"""Imperfections that are tried, in scales of the parameter, both signs."""
LAWS = {
    1.0: "smooth",
    0.5: "one-half power: an asymmetric branch point",
    2.0 / 3.0: "two-thirds power: a symmetric branch point",
}
"""Laws [Koiter1945]_ by their exponents."""
WITHIN = 0.03
"""By how much a fitted exponent may miss that of a law."""


@dataclass(frozen=True, eq=False)
class ImperfectionLaw:
    """``q_lim(ε) ≈ q_lim(0) + coefficient·|ε|^exponent``, for the sign of ε that is worse.

    Parameters
    ----------
    status
        "fitted", or "refused" with the reason in `why`.
    law
        Name of the law [Koiter1945]_: smooth, one-half or two-thirds power; "unknown".
    exponent
        As fitted.
    coefficient
        With the exponent of the law.
    perfect
        Limit load without the imperfection.
    sizes, loads
        Imperfections that were tried, with their signs, and limit loads.
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
        return next((power for power, name in LAWS.items() if name == self.law), self.exponent)

    def __repr__(self) -> str:
        """Name and formula."""
        if self.status != "fitted":
            return f"ImperfectionLaw(refused: {self.why})"
        formula = f"{self.perfect:.6g} {self.coefficient:+.4g} |ε|^{self.exponent:.3g}"
        return f"ImperfectionLaw({formula}; {self.law})"


def imperfection_law(
    start: State,
    load: str,
    imperfection: str,
    *,
    within: Sequence[Constraint] = (),
    sizes: Sequence[float] = SIZES,
) -> ImperfectionLaw:
    """Fit the law by which an imperfection lowers a limit load.

    The start is lifted to each imperfection, and its limit load found. The exponent is that of the
    two smallest ones with the next order removed; the coefficient is extrapolated to zero with the
    exponent of the law.

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
        Imperfections in scales of the parameter, three or more, in descending order.

    Returns
    -------
    The fitted law; or that no limit load was found at an imperfection.

    Raises
    ------
    InputError
        For unknown names, the same twice, or sizes that do not fall to above zero.
    """
    parameters = start.structure.parameters
    place = position(parameters, imperfection)
    position(parameters, load)
    tried = np.array(sizes, dtype=float)
    if load == imperfection:
        raise InputError(f"`imperfection` must not be the load; got {load!r}.")
    if len(tried) < 3 or not (tried > 0.0).all() or not (np.diff(tried) < 0.0).all():
        raise InputError(f"`sizes` must be three or more numbers > 0 that fall; got {sizes!r}.")
    perfect = limit_load(start, load, within=within)
    signed = np.concatenate([tried, -tried])
    loads = np.array([_limit(start, load, place, size, within) for size in signed])
    falls = (loads - perfect.value).reshape(2, -1)
    limited = np.isfinite(falls).all(axis=1)
    if not limited.any():
        why, nan = "no limit load was found at an imperfection, of either sign", float("nan")
        return ImperfectionLaw("refused", why, "unknown", nan, nan, perfect.value, signed, loads)
    # an asymmetric branch point limits the load for one sign only
    falls = falls[limited]
    falls = falls[int(np.argmin(falls[:, -1]))]
    exponent = _exponent(tried, falls)
    law = min(LAWS, key=lambda known: abs(known - exponent))
    if abs(law - exponent) > WITHIN:
        coefficient = float(falls[-1] / tried[-1] ** exponent)
        return ImperfectionLaw(
            "fitted", "", "unknown", exponent, coefficient / _unit(start, place, exponent),
            perfect.value, signed, loads,
        )  # fmt: skip
    coefficient = _extrapolated(tried, falls, law) / _unit(start, place, law)
    return ImperfectionLaw(
        "fitted", "", LAWS[law], exponent, coefficient, perfect.value, signed, loads
    )


def _unit(start: State, place: int, exponent: float) -> float:
    return float(start.structure.scales[place] ** exponent)


def _limit(start: State, load: str, place: int, size: float, within: Sequence[Constraint]) -> float:
    """Limit load with an imperfection; not a number where there is none."""
    parameter = start.structure.parameters[place]
    path = lift(start, {parameter.name: float(start.p[place] + size * parameter.scale)})
    if not path.arrived:
        return float("nan")
    found = limit_load(path.end.state, load, within=within)
    return found.value if found.kind in ("fold", "branch point", "constraint") else float("nan")


def _exponent(sizes: Float[np.ndarray, " n"], falls: Float[np.ndarray, " n"]) -> float:
    """Slope in logarithms, extrapolated along the sizes to a power of its own."""
    with np.errstate(divide="ignore", invalid="ignore"):
        slopes = np.diff(np.log(np.abs(falls))) / np.diff(np.log(sizes))
    return float(slopes[-1])


def _extrapolated(
    sizes: Float[np.ndarray, " n"], falls: Float[np.ndarray, " n"], exponent: float
) -> float:
    """Coefficient at zero: polynomial in ε^exponent through all of them."""
    x = sizes**exponent
    return float(np.polynomial.polynomial.polyfit(x, falls / x, len(x) - 1)[0])
