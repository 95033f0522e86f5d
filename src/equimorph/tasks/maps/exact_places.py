"""States at which causes of pairs of settings lie: the first one inside each pair that shows."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from jaxtyping import Bool, Float, Int

from equimorph.arrays import Lanes, Parameters
from equimorph.equilibria.critical import Test
from equimorph.equilibria.point_conditions import Vanishing
from equimorph.equilibria.settle import Guards, Settled, free_directions, settle
from equimorph.structures import Structure
from equimorph.tasks.maps.brackets import PARTS, SHRINKING, Brackets, Samples, sample_distance
from equimorph.tasks.maps.causes import Cause, Paths, TestsOf

Flags = Bool[np.ndarray, " pairs"]

BESIDE = 1.0 / PARTS**2
"""Distance from a place at which both sides are examined, as a share of the pair."""
CLOSE = 1e-8
"""Distance in units of the parameters' scales at which a map that looks smooth on both sides of a
place needs another cause: near a slightly unfolded pitchfork a cusp and a branch point of
the path lie 1e-7 to 1e-5 apart, and only one of them makes the map jump."""
SLACK = 1e-3
"""How far outside its bracket, in lengths of it, an exact place may lie."""
ONE_PLACE = 1e-7
"""Places closer than this, in units of the parameters' scales, are one."""
NEARBY = Guards(iterations=10, longest=np.inf, too_long=0.5, converged=1e-9)
"""The guesses are close: longer corrections, in the metric, lead elsewhere."""
TEST_DIFFERENCE = 1e-6
"""Step of differences of tests, in the metric: it sets the rate of Newton, not the error."""


@dataclass(frozen=True)
class Candidates:
    """Places found for causes of pairs: number of the cause (−1: none), kind, state, parameters."""

    cause: Int[np.ndarray, " pairs"]
    kind: np.ndarray
    z: Float[np.ndarray, "pairs size"]
    p: Float[np.ndarray, "pairs parameters"]

    @property
    def found(self) -> Flags:
        """Whether there is one."""
        return np.asarray(self.cause >= 0)

    def put(self, pairs: Int[np.ndarray, " some"], new: "Candidates") -> None:
        """Replace some."""
        for old, column in zip(vars(self).values(), vars(new).values(), strict=True):
            old[pairs] = column

    def take(self, pairs: Int[np.ndarray, " some"]) -> "Candidates":
        """Return some."""
        return Candidates(*(column[pairs] for column in vars(self).values()))


def candidates(paths: Paths, pairs: Brackets) -> Candidates:
    """The first cause of each pair that leads to a place inside.

    Where the map looks smooth close to it and a later cause leads to another place at which it does
    not, that one counts.
    """
    causes, places = paths.causes(pairs), paths.sheet.places
    best = _first(paths, pairs, causes, np.zeros(len(pairs), int))
    open_ = np.flatnonzero(best.found)
    open_ = open_[_looks_smooth(paths, pairs.take(open_), best.p[open_])]
    tried = best.cause.copy()
    while len(open_):
        first = np.full(len(pairs), len(causes))
        first[open_] = tried[open_] + 1
        others = _first(paths, pairs, causes, first)
        open_ = open_[others.found[open_]]
        tried[open_] = others.cause[open_]
        apart = np.abs(others.p[open_] - best.p[open_])[:, places].max(axis=1) > ONE_PLACE
        better = apart & ~_looks_smooth(paths, pairs.take(open_), others.p[open_])
        best.put(open_[better], others.take(open_[better]))
        open_ = open_[~better]
    return best


def _first(
    paths: Paths, pairs: Brackets, causes: Sequence[Cause], first: Int[np.ndarray, " pairs"]
) -> Candidates:
    """What the first successful one among the causes from number `first` on leads to."""
    count, structure = len(pairs), paths.sheet.structure
    moving = np.argmax(np.abs(pairs.b.setting - pairs.a.setting), axis=1)
    axis, kind = paths.sheet.places[moving], np.full(count, "", dtype=object)
    out = Candidates(np.full(count, -1), kind, pairs.a.z.copy(), pairs.a.p.copy())
    for k, cause in enumerate(causes):
        some = np.flatnonzero((~out.found & (first <= k))[cause.lanes])
        at, start = cause.lanes[some], cause.start.take(some)
        if not len(at):
            continue
        free = np.stack([axis[at], np.full(len(at), paths.load)], axis=1)
        tests = partial(_of_some, cause.tests, some)
        exact = correct_singular_states(structure, start.z, start.p, free, tests)
        z, p, good = exact.z, exact.p, exact.found
        good &= _within(pairs.take(at), p[:, paths.sheet.places])
        many = int(good.sum())
        kinds = np.full(many, cause.kind, dtype=object)
        out.put(at[good], Candidates(np.full(many, k), kinds, z[good], p[good]))
    return out


def _of_some(
    tests: TestsOf, some: Int[np.ndarray, " some"], lanes: Int[np.ndarray, " fewer"]
) -> tuple[Test, Test]:
    """Tests of lanes, given by their numbers in a selection."""
    return tests(some[lanes])


def _within(brackets: Brackets, place: Float[np.ndarray, "brackets 2"]) -> Flags:
    """Whether places lie in their brackets."""
    a, b = brackets.a.setting, brackets.b.setting
    room = SLACK * np.abs(b - a) + 1e-9
    return np.asarray(
        ((place >= np.minimum(a, b) - room) & (place <= np.maximum(a, b) + room)).all(axis=1)
    )


def _looks_smooth(paths: Paths, pairs: Brackets, p: Float[np.ndarray, "pairs parameters"]) -> Flags:
    """Whether a map looks smooth at places on pairs, seen from close by on both sides."""
    count, places = len(pairs), paths.sheet.places
    if count == 0:
        return np.zeros(0, bool)
    length = pairs.b.setting - pairs.a.setting
    share = CLOSE / np.linalg.norm(length / paths.sheet.structure.scales[places], axis=1)
    room = share[:, None] * length
    beside = paths(np.concatenate([p[:, places] - room, p[:, places] + room]))
    left, right = beside.take(np.arange(count)), beside.take(np.arange(count, 2 * count))
    sure = paths.known(left) & paths.known(right) & (share < BESIDE)
    return np.asarray(sure & ~is_sharp(paths, left, right, pairs, share))


def is_sharp(
    paths: Paths,
    left: Samples,
    right: Samples,
    pairs: Brackets,
    share: float | Float[np.ndarray, " pairs"],
) -> Flags:
    """Whether a map differs more between both sides of places than a smooth one would.

    `left`, `right`: samples at a distance of `share`, relative to the pair, on each side of the
    places. Kinds may differ, too.
    """
    structure = paths.sheet.structure
    now, before = (
        sample_distance(structure, left, right),
        sample_distance(structure, pairs.a, pairs.b),
    )
    usual = (2.0 * share) ** SHRINKING * before
    return np.asarray(np.isinf(now) | (np.isfinite(before) & (now > usual)))


def correct_singular_states(
    structure: Structure,
    z: Lanes,
    p: Parameters,
    free: Int[np.ndarray, "lanes 2"],
    tests: TestsOf,
) -> Settled:
    """States near guesses at which two tests vanish, in two parameters.

    Newton's method on F = 0 and the tests, in a basis of the kernel of [F_z F_p] that is regular at
    folds, branch points and cusps.

    Parameters
    ----------
    structure
        The structure.
    z, p
        Guesses.
    free
        Columns of the two parameters that vary, for each lane.
    tests
        Tests that vanish on the lanes with given numbers; see
        `equimorph.equilibria.critical_tests`.
    """
    vanishing = Vanishing(tests, np.arange(len(z)), TEST_DIFFERENCE, one_sided=True, at_null=True)
    return settle(structure, z, p, free_directions(structure, free, len(z)), [vanishing], NEARBY)
