"""Where on its fold a route snaps best: straight moves there, and on from where the snap lands.

See docs/decisions.md, "A place of a snap is sought with what leads there and on".
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from equimorph.arrays import Flags, Parameters, Values
from equimorph.manifold import EquilibriumSet, Snap
from equimorph.manifold.queries.nearest import Ground, SetPoints, points_at_vertices
from equimorph.structures import State, States, join_states
from equimorph.structures.metric import metric_length, metric_places
from equimorph.tasks.planning.network import MATCH, Demands, lift_straight
from equimorph.tolerances import SAME_STATE

BEYOND = 5e-4
"""How far beyond the fold the parameters go, in their scales, so that the structure does snap."""
SHORT = 1e-4
"""Part of the way to a fold that is left out where its neighbourhood is lifted to."""
NEAR_FOLD = 0.05
"""Distance in the metric within which a lift that ends just before a fold has met it."""
ROUNDS, DIVISIONS = 3, 8
"""How often the neighbourhood of the best place is divided, and into how many parts."""


@dataclass(frozen=True)
class SnapPlace:
    """A place of a fold from which a route snaps."""

    fold: State
    landing: State
    """The place, and where the snap lands."""
    approach: State
    """State just before the fold, on the way there."""
    beyond: State
    """Equilibrium after the snap where the parameters have gone a little beyond the fold."""
    cost: float
    """Of the straight moves there and on."""


@dataclass(frozen=True)
class _Places:
    """Places of a fold, in order along it, with what straight moves there and on cost."""

    folds: SetPoints
    landings: States
    approach: States
    beyond: States
    cost: Values

    def best(self) -> SnapPlace | None:
        """The cheapest one that straight moves lead over."""
        k = int(self.cost.argmin())
        if not np.isfinite(self.cost[k]):
            return None
        fold = State(self.landings.structure, self.folds.z[k], self.folds.p[k])
        cost = float(self.cost[k])
        return SnapPlace(fold, self.landings[k], self.approach[k], self.beyond[k], cost)


def cheapest_place(
    eset: EquilibriumSet,
    snap: Snap,
    ends: tuple[State, State],
    demands: Demands,
    known: SnapPlace | None = None,
) -> SnapPlace | None:
    """Place of a fold with the cheapest straight moves from one state there, and on to another.

    Among the vertices of the fold, and a known place: from states close to the fold straight moves
    may lead to this one alone. Over two parameters also between the neighbours of the best one,
    which are divided again and again. None if straight moves lead over none of them.
    """
    folds, landings = _vertices(eset, snap, demands)
    if known is not None and len(landings):
        folds, landings = _with_place(folds, landings, known)
    places = _price(eset, folds, landings, ends, demands)
    for _ in range(ROUNDS if len(eset.names) == 2 else 0):
        if not np.isfinite(places.cost).any():
            return None
        places = _price(eset, *_between(eset, places, demands), ends, demands)
    return places.best() if len(places.cost) else None


def _vertices(eset: EquilibriumSet, snap: Snap, demands: Demands) -> tuple[SetPoints, States]:
    """Vertices of a run of the stability boundary, with landings lifted from the known ones."""
    ordered = snap.along if len(eset.names) == 2 else snap.vertices
    place = {vertex: k for k, vertex in enumerate(ordered.tolist())}
    known = np.array([place[vertex] for vertex in snap.vertices.tolist()])
    nearest = np.abs(np.arange(len(ordered))[:, None] - known).argmin(axis=1)
    landings = join_states(eset.structure, [snap.landings[k].state for k in nearest])
    return _land(points_at_vertices(eset, ordered), landings, demands)


def _with_place(folds: SetPoints, landings: States, known: SnapPlace) -> tuple[SetPoints, States]:
    """Folds in order, and landings, with a known place where it makes their chain least longer."""
    structure, fold, landed = landings.structure, known.fold, known.landing
    place = metric_places(structure, folds.z, folds.p)
    gap = np.linalg.norm(place - metric_places(structure, fold.batch.z, fold.batch.p), axis=1)
    if gap.min() < SAME_STATE:
        return folds, landings
    longer = gap[:-1] + gap[1:] - np.linalg.norm(np.diff(place, axis=0), axis=1)
    at = int(np.concatenate([gap[:1], longer, gap[-1:]]).argmin())
    rows = np.insert(folds.rows, at, folds.rows[int(gap.argmin())], axis=0)
    z, p = np.insert(folds.z, at, fold.z, axis=0), np.insert(folds.p, at, fold.p, axis=0)
    landed_z = np.insert(landings.z, at, landed.z, axis=0)
    landed_p = np.insert(landings.p, at, landed.p, axis=0)
    return SetPoints(z, p, rows), States(structure, landed_z, landed_p)


def _between(eset: EquilibriumSet, places: _Places, demands: Demands) -> tuple[SetPoints, States]:
    """Places between the best one and its neighbours, these among them, and their landings."""
    best, last = int(places.cost.argmin()), len(places.cost) - 1
    ends = sorted({max(best - 1, 0), best, min(best + 1, last)})
    share = np.linspace(0.0, 1.0, DIVISIONS + 1)[:-1]
    at = np.concatenate([*(a + share for a, _ in pairwise(ends)), [ends[-1]]])
    low = np.floor(at).astype(int)
    high, part = np.minimum(low + 1, last), (at - low)[:, None]
    folds = places.folds
    guess = SetPoints(
        (1.0 - part) * folds.z[low] + part * folds.z[high],
        (1.0 - part) * folds.p[low] + part * folds.p[high],
        folds.rows[low],
    )
    ground = Ground(eset.setting, eset, fold=True)
    frames, _ = ground.frames(guess)
    exact, found = ground.move(guess, frames, np.zeros(frames.shape[:2]))
    return _land(exact.take(found), places.landings[low[found]], demands)


def _land(folds: SetPoints, landings: States, demands: Demands) -> tuple[SetPoints, States]:
    """Folds with landings lifted there from near ones, where that is possible."""
    z, there, _ = lift_straight(landings, folds.p, demands)
    states = States(landings.structure, z, folds.p)
    there[there] = demands.admissible(states[there])
    return folds.take(there), states[there]


def _price(
    eset: EquilibriumSet,
    folds: SetPoints,
    landings: States,
    ends: tuple[State, State],
    demands: Demands,
) -> _Places:
    """Costs of straight moves from one end to each fold, and from its landing to the other end."""
    structure, before, count = eset.structure, ends[0], len(landings)
    exact = States(structure, folds.z, folds.p)
    starts, goals = (
        States(structure, np.tile(each.z, (count, 1)), np.tile(each.p, (count, 1))) for each in ends
    )
    short = folds.p - SHORT * (folds.p - before.p)
    z, there, cost = lift_straight(starts, short, demands)
    approach = States(structure, z, short)
    there &= _near(approach, exact, NEAR_FOLD)
    past = _beyond(eset, before.p, folds.p)
    there &= eset.box.holds(past[:, eset.setting.free])
    z, onward, overshoot = lift_straight(landings, past, demands)
    beyond = States(structure, z, past)
    z, arrived, rest = lift_straight(beyond, goals.p, demands)
    arrived &= _near(States(structure, z, goals.p), goals, MATCH)
    total = cost + overshoot + rest + _last_steps(approach, exact, demands)
    good = there & onward & arrived
    return _Places(folds, landings, approach, beyond, np.where(good, total, np.inf))


def _last_steps(approach: States, folds: States, demands: Demands) -> Values:
    """Costs of the chords from just before the folds to these."""
    number = np.arange(len(folds))
    both = join_states(folds.structure, (approach, folds))
    return demands.objective.costs(both, number, number + len(folds))


def _near(states: States, others: States, within: float) -> Flags:
    return np.asarray(metric_length(states.structure, states.z - others.z) < within)


def _beyond(eset: EquilibriumSet, before: Parameters, folds: Parameters) -> Parameters:
    """Parameters a little beyond folds, seen from parameters before them."""
    scales = eset.structure.scales
    step = (folds - before) / scales
    size = np.maximum(np.linalg.norm(step, axis=1, keepdims=True), 1e-300)
    return np.asarray(folds + BEYOND * step / size * scales)
