"""All equilibria at given parameters, with an estimate of how many are missing.

See docs/decisions.md, "Searches follow lines through known equilibria".
"""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.special import gammaln, xlogy

from equimorph.door import door
from equimorph.equilibria.random_search import Ground, Pools, distinct
from equimorph.model import Constraint, parameter_vector
from equimorph.structures import States, Structure

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
        Whether each run found each equilibrium.

    References
    ----------
    [Chao1987]_, [Cormack1992]_
    """

    captured: Bool[np.ndarray, "runs found"]

    @property
    def runs(self) -> int:
        """Number of independent runs."""
        return int(self.captured.shape[0])

    @property
    def found(self) -> int:
        """Number of different equilibria found by all runs together."""
        return int(self.captured.shape[1])

    @property
    def per_run(self) -> tuple[int, ...]:
        """Number of equilibria found by each run."""
        return tuple(int(count) for count in self.captured.sum(axis=1))

    @property
    def estimate(self) -> float:
        """Chao's estimate of the number of equilibria, a lower bound if some are harder to find.

        ``S + (m−1)/m · f₁(f₁−1)/(2(f₂+1))`` after m runs, with f₁ and f₂ the numbers of equilibria
        found by exactly one and by exactly two runs.
        """
        times = self.captured.sum(axis=0)
        once, twice = int((times == 1).sum()), int((times == 2).sum())
        return self.found + (self.runs - 1) / self.runs * once * (once - 1) / (2.0 * (twice + 1.0))

    @property
    def upper(self) -> float:
        """Number of equilibria at about 95 % confidence, if all are as easy to find as those found.

        Largest number that the profile likelihood does not reject [Cormack1992]_; infinite where
        no equilibrium was found twice. Never below `estimate`.
        """
        if self.found == 0:
            return self.estimate
        if int(self.captured.sum()) == self.found:
            return np.inf
        number, best = self.found, self._log_likelihood(self.found)
        while best - self._log_likelihood(number + 1) <= 0.5 * REJECTED:
            number += 1
            best = max(best, self._log_likelihood(number))
        return max(self.estimate, float(number))

    def _log_likelihood(self, number: int) -> float:
        """Of `number` equilibria, at the most likely chance of a catch, the same for all."""
        trials, hits = self.runs * number, int(self.captured.sum())
        ways = gammaln(number + 1) - gammaln(number - self.found + 1)
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
        return (
            f"{self.found} found (in single runs {runs}); estimated {self.estimate:.1f}, "
            f"at most {self.upper:.0f} (95 %) if all are equally easy to find"
        )


Points = Float[np.ndarray, "points parameters"]

REPEATS = 3
"""Times that the runs at a point are made, at most: again while an equilibrium was found once."""


@dataclass(frozen=True, eq=False, repr=False)
class FoundStates(States):
    """What a search found: equilibria over one point, sorted by energy.

    Parameters
    ----------
    completeness
        Capture and recapture over the independent runs of the search; see `Completeness`.
    failures
        How many starts led to no equilibrium, by reason.
    """

    completeness: Completeness
    failures: Mapping[str, int]

    def __repr__(self) -> str:
        """How many, how many of them are stable, and how many there may be."""
        stable, kind = int((self.index == 0).sum()), self.structure.kind
        return f"FoundStates({kind}: {len(self)}, {stable} of them stable; {self.completeness})"


@door
def find_equilibria(
    structure: Structure,
    at: Mapping[str, float],
    *,
    within: Sequence[Constraint] = (),
    starts: int = 200,
    runs: int = 3,
    seed: int = 0,
) -> FoundStates:
    """Equilibria at parameters `at`, sorted by energy, with an estimate of how many are missing.

    Several independent runs, together in one batch. In each: Newton from random guesses of the
    structure; Newton homotopy from some of the guesses where Newton failed; Newton deflated by what
    was found. Then lines in random directions of the actuators and loads are laid through every
    equilibrium and followed both ways through folds: where they return to `at` they bring others,
    through which lines are laid again, until nothing new comes. Images under symmetries that leave
    `at` unchanged belong to each run. States that the discretisation does not resolve, or that
    violate `within`, are dropped. While only one run found some equilibrium, runs are added.

    Parameters
    ----------
    at
        All parameters without a default, by name.
    within
        Constraints that states must obey, like ``[arch.max_curvature <= 20]``.
    starts
        Number of random guesses of the first runs together.
    runs
        Number of independent runs; at most three times as many are made.
    seed
        Of the random generator.

    Raises
    ------
    InputError
        For unknown parameters or values without meaning, or less than one start or run.
    """
    points = parameter_vector(structure.parameters, at)[None]
    return search_points(structure, points, within=within, starts=starts, runs=runs, seed=seed)[0]


def search_points(
    structure: Structure,
    points: Points,
    *,
    within: Sequence[Constraint] = (),
    starts: int = 200,
    runs: int = 3,
    seed: int = 0,
) -> list[FoundStates]:
    """`find_equilibria` at many points of the parameter space together, in less time.

    Parameters
    ----------
    points
        All parameters of the structure, one point per row.

    Raises
    ------
    InputError
        For less than one start or run.
    """
    generator, guesses = np.random.default_rng(seed), -(-starts // runs)
    catches = [_Catch.empty(structure, point, tuple(within)) for point in points]
    todo = np.arange(len(points))
    for _ in range(REPEATS):
        ground = Ground(structure, np.repeat(points[todo], runs, axis=0), tuple(within))
        pools = Pools(ground, generator)
        pools.start(guesses)
        pools.spread()
        for number, point in enumerate(todo):
            catches[point] = catches[point].extended(pools, number * runs, runs)
        todo = np.array([point for point in todo if catches[point].doubtful], dtype=int)
        if len(todo) == 0:
            break
    return [catch.states() for catch in catches]


@dataclass(frozen=True)
class _Catch:
    """What all runs at one point found: every state with the number of its run."""

    ground: Ground
    z: Float[np.ndarray, "caught size"]
    run: Int[np.ndarray, " caught"]
    runs: int
    failures: Mapping[str, int]

    @classmethod
    def empty(
        cls,
        structure: Structure,
        point: Float[np.ndarray, " parameters"],
        within: tuple[Constraint, ...],
    ) -> "_Catch":
        """Before the first run."""
        ground = Ground(structure, point[None], within)
        return cls(ground, np.zeros((0, structure.size)), np.zeros(0, int), 0, {})

    def extended(self, pools: Pools, first: int, runs: int) -> "_Catch":
        """With the groups `first`, `first` + 1, ... of pools as further runs."""
        mine = np.flatnonzero((pools.group >= first) & (pools.group < first + runs))
        z, run = pools.z[mine], pools.group[mine] - first + self.runs
        valid = self.ground.excess(z, np.zeros(len(z), int)) <= 0.0
        counts = Counter(self.failures)
        for reason, group in pools.failures:
            counts[reason] += int(((group >= first) & (group < first + runs)).sum())
        return _Catch(
            self.ground,
            np.concatenate([self.z, z[valid]]),
            np.concatenate([self.run, run[valid]]),
            self.runs + runs,
            {reason: count for reason, count in counts.items() if count},
        )

    @property
    def kept(self) -> Int[np.ndarray, " found"]:
        """The different states, sorted by energy."""
        structure, at = self.ground.structure, distinct(self.ground.structure, self.z)
        energy = structure.energy(self.z[at], np.tile(self.ground.p, (len(at), 1)))
        return at[np.argsort(energy, kind="stable")]

    @property
    def captured(self) -> Bool[np.ndarray, "runs found"]:
        """Whether each run found each of the different states."""
        kept = self.z[self.kept]
        captured = np.zeros((self.runs, len(kept)), bool)
        if len(kept):
            n = self.ground.structure.unknowns
            gap = (self.z[:, None, :n] - kept[None, :, :n]) ** 2 @ self.ground.structure.mass
            captured[self.run, gap.argmin(axis=1)] = True
        return captured

    @property
    def doubtful(self) -> bool:
        """Whether a state was found only once in several runs: another one may be missing."""
        return self.runs > 1 and bool((self.captured.sum(axis=0) == 1).any())

    def states(self) -> FoundStates:
        """Return the result."""
        z = self.z[self.kept]
        p = np.tile(self.ground.p, (len(z), 1))
        completeness = Completeness(self.captured)
        return FoundStates(self.ground.structure, z, p, completeness, self.failures)
