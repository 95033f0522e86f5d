"""How complete a search is: capture and recapture over its independent runs."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.special import gammaln, xlogy

from equimorph.arrays import Bool
from equimorph.structures import Structure

CONFIDENCE = 0.95
"""Confidence level of the bound on the probability that one more run finds a new equilibrium."""
REJECTED = 2.706
"""Fall of twice the log-likelihood at the end of a one-sided interval of 95 %."""


@dataclass(frozen=True)
class Completeness:
    """Which of several independent runs found which equilibrium.

    An estimate, not a promise: what no run can reach is not counted.

    Parameters
    ----------
    captured
        Whether each run found each equilibrium; no run found those that descents and searches
        between minima have added.
    unresolved
        Starts that led to states which the discretisation does not resolve, and which may obey the
        constraints; all of them if nothing was found.
    cause
        What is told of such states, and what helps; see `Structure.unresolved`.
    starts, arrived
        Random guesses of all runs, and those of them that led to a state that counts: where few
        arrive, the runs share their luck, and the estimates mean little.

    References
    ----------
    [Chao1987]_, [Cormack1992]_
    """

    captured: Bool[np.ndarray, "runs found"]
    unresolved: int = 0
    starts: int = 0
    arrived: int = 0
    cause: str = Structure.unresolved

    @property
    def runs(self) -> int:
        """Number of independent runs."""
        return int(self.captured.shape[0])

    @property
    def found(self) -> int:
        """Number of different equilibria found by all runs together, and those added to them."""
        return int(self.captured.shape[1])

    @property
    def added(self) -> int:
        """Number of them that no run found: recaptures that failed."""
        return int((~self.captured.any(axis=0)).sum())

    @property
    def per_run(self) -> tuple[int, ...]:
        """Number of equilibria found by each run."""
        return tuple(int(count) for count in self.captured.sum(axis=1))

    @property
    def estimate(self) -> float:
        """Chao's estimate of the number of equilibria, a lower bound if some are harder to find.

        ``S + (m−1)/m · f₁(f₁−1)/(2(f₂+1))`` after m runs, with S, f₁ and f₂ the numbers of
        equilibria found by any run, by exactly one and by exactly two. Those added to them are some
        of the rest.
        """
        times = self.captured.sum(axis=0)
        once, twice = int((times == 1).sum()), int((times == 2).sum())
        rest = (self.runs - 1) / self.runs * once * (once - 1) / (2.0 * (twice + 1.0))
        return float(max(self.found, self.found - self.added + rest))

    @property
    def upper(self) -> float:
        """Number of equilibria at about 95 % confidence, if all are as easy to find as those found.

        Largest number that the profile likelihood of the runs does not reject [Cormack1992]_;
        infinite where no equilibrium was found twice, or some that are not resolved, or where none
        was found and no random guess led to any state. So it is where more were found, others being
        added to those of the runs: then these are harder to find. Never below `estimate`.
        """
        if self.unresolved or (self.found == 0 and self.starts > 0 and self.arrived == 0):
            return np.inf
        bound = self._bound_of_runs
        return np.inf if self.found > bound else max(self.estimate, bound)

    @cached_property
    def _bound_of_runs(self) -> float:
        """Largest number that is not rejected by what runs found."""
        number = self.found - self.added
        if int(self.captured.sum()) == number:
            return np.inf if self.found else 0.0
        best = self._log_likelihood(number)
        while best - self._log_likelihood(number + 1) <= 0.5 * REJECTED:
            number += 1
            best = max(best, self._log_likelihood(number))
        return float(number)

    def _log_likelihood(self, number: int) -> float:
        """Of `number` equilibria, at the most likely chance of a catch, the same for all."""
        trials, hits = self.runs * number, int(self.captured.sum())
        seen = int(self.captured.any(axis=0).sum())
        ways = gammaln(number + 1) - gammaln(number - seen + 1)
        chance = hits / trials
        return float(ways + xlogy(hits, chance) + xlogy(trials - hits, 1.0 - chance))

    @property
    def detectable(self) -> float:
        """Chance per run from which on an equilibrium is among those found, at 95 % confidence.

        One that a run finds with probability p escapes all m runs with probability (1 − p)^m.
        """
        return float(1.0 - (1.0 - CONFIDENCE) ** (1.0 / self.runs))

    def __str__(self) -> str:
        """One line with all numbers."""
        runs = ", ".join(str(count) for count in self.per_run)
        found = f"{self.found} found" + (f" (in single runs {runs})" if self.found else "")
        if self.unresolved:
            return (
                f"{found}; there may be any number more, as {self.unresolved} starts led to where "
                f"{self.cause}, or exclude such states by a constraint"
            )
        if self.found > self._bound_of_runs:
            why = f"as no run found {self.added} of them"
            return f"{found}; there may be any number more, {why}{self._arrivals}"
        return (
            f"{found}; estimated {self.estimate:.1f}, at most {self.upper:.0f} (95 %) if all are "
            f"equally easy to find{self._arrivals}"
        )

    @property
    def _arrivals(self) -> str:
        """How many starts arrived; nothing where none were counted."""
        return f"; {self.arrived} of {self.starts} starts arrived" if self.starts else ""
