"""The least change of parameters that makes a state snap, and where it lands."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from equimorph.argument_checks import check_arguments
from equimorph.arrays import Flags, Float, Lanes, Parameters, Some, Values
from equimorph.equilibria import Landing, lift, snap_landing
from equimorph.manifold import EquilibriumSet, StabilityDistance, stability_distance
from equimorph.manifold.geometry.setting import embed
from equimorph.manifold.queries.least_squares import nearest
from equimorph.manifold.queries.locate import pieces_of
from equimorph.manifold.queries.nearest import Ground, SetPoints, points_at_vertices
from equimorph.manifold.queries.snap_graph import stability_boundary
from equimorph.structures import State, States

BEYOND = 1e-3
"""Part of a straight move by which it goes on beyond the fold that it is to meet."""
HALVINGS = 12
"""Bisections between a fold that snaps and a place that does not."""
BESIDE = 4
"""Number of boundary vertices towards which folds are tried near a place that does not snap."""
NEAR = 1e-3
"""Excess of a change over the infimum, relative to it, that will do: nearer, snaps are tiny."""
MOST_MOVES = 400
"""Vertices of the stability boundary, the nearest first, to which straight moves are tried."""


@dataclass(frozen=True, eq=False)
class LeastSnap:
    """The least change of parameters that makes a state snap, and where the snap lands.

    Parameters
    ----------
    status
        "found"; "infimum" where changes that lead to a snap come arbitrarily close to a length but
        do not attain it, with the reason in `why`: `change` is one of them; or "refused", also with
        the reason: no change is known in the box.
    distance
        As of `stability_distance`: where stability is lost, which need not snap, as at cusps.
    change
        Least change of each free parameter that leads to the snap.
    landing
        Where it lands; see `Landing`.
    fold
        Where the snap begins.
    infimum
        Length in scaled parameters below which no straight change is known to snap.
    """

    status: Literal["found", "infimum", "refused"]
    why: str
    distance: StabilityDistance
    change: dict[str, float]
    landing: Landing | None
    fold: State | None = None
    infimum: float = np.inf

    @property
    def states(self) -> States | None:
        """Where the snap begins, and where it ends; None without a snap."""
        lost, landing = self.fold or self.distance.nearest, self.landing
        if lost is None or landing is None:
            return None
        ends = lost, landing.state
        return States(
            lost.structure, np.array([end.z for end in ends]), np.array([end.p for end in ends])
        )

    def __repr__(self) -> str:
        """Change and landing."""
        if self.landing is None:
            return f"LeastSnap(refused: {self.why})"
        moves = ", ".join(f"{name} {value:+.6g}" for name, value in self.change.items())
        above = "" if self.status == "found" else f", infimum {self.infimum:.6g}"
        return f"LeastSnap({moves}: {self.landing}{above})"


@check_arguments
def least_snap(eset: EquilibriumSet, state: State) -> LeastSnap:
    """Find the least straight change of the free parameters that makes a stable state snap.

    With a load among the free parameters of the set this is the least change of actuators and load.
    The nearest loss of stability may cause no snap, as at the tip of a cusp, or no straight change
    may lead to it. Then straight changes to all vertices of the stability boundary are tried; the
    shortest one that snaps is followed along the boundary to where it is least, or bisected towards
    the nearest place that does not snap.

    Parameters
    ----------
    eset
        Equilibrium set over the parameters that may change.
    state
        A stable state of the set.

    Returns
    -------
    The change and the landing of the snap; or a refusal if no change in the box is known to snap.

    Raises
    ------
    InputError
        If the state is unstable or does not belong to the set.
    """
    distance = stability_distance(eset, state)
    moves = _Moves(eset, state)
    if distance.nearest is not None:
        landing = _landing(distance.nearest)
        if landing is not None:
            nearest = _Snap(distance.nearest, distance.in_parameters, landing)
            return moves.answer("found", "", distance, nearest, nearest.length)
    first = moves.shortest_to_the_boundary(distance.nearest)
    if first is None:
        return LeastSnap("refused", _why_none(distance), distance, {}, None)
    best, infimum = moves.shorten(first)
    if infimum == best.length:
        return moves.answer("found", "", distance, best, infimum)
    why = (
        f"snaps come as near as {infimum:.6g} in scaled parameters, where none begins; "
        f"this one is {best.length:.6g} away"
    )
    return moves.answer("infimum", why, distance, best, infimum)


def _why_none(distance: StabilityDistance) -> str:
    if distance.nearest is None:
        return "no loss of stability is known in the box of the set"
    return (
        f"nothing snaps at the nearest loss of stability, {distance.in_parameters:.6g} away in "
        "scaled parameters, and no straight change to the edge of stability in the box leads to a "
        "snap"
    )


def _landing(fold: State) -> Landing | None:
    """Landing of the snap at a critical state; None where nothing moves."""
    return next((each for each in snap_landing(fold) if each.status != "held"), None)


@dataclass(frozen=True)
class _Snap:
    """A snap that a straight change leads to, where that begins, and the length of the change."""

    fold: State
    length: float
    landing: Landing


@dataclass(frozen=True)
class _Moves:
    """Straight changes of the free parameters from a state."""

    eset: EquilibriumSet
    state: State

    def answer(
        self,
        status: Literal["found", "infimum"],
        why: str,
        distance: StabilityDistance,
        snap: _Snap,
        infimum: float,
    ) -> LeastSnap:
        """Put the answer together."""
        change = {name: snap.fold[name] - self.state[name] for name in self.eset.names}
        return LeastSnap(status, why, distance, change, snap.landing, snap.fold, infimum)

    def changes(self, z: Lanes, p: Parameters) -> Float[np.ndarray, "lanes d"]:
        """Changes of the free parameters from the state to others, in their scales."""
        setting = self.eset.setting
        return np.asarray((p - self.state.p)[:, setting.free] / setting.scales)

    def shortest_to_the_boundary(self, held: State | None) -> _Snap | None:
        """Shortest change that snaps, of those to places of the stability boundary.

        These are its vertices, and folds ever closer to a place `held` where nothing snaps: near
        the tip of a cusp the part of the folds that snaps may be shorter than an edge.
        """
        stratum, _ = pieces_of(self.eset, self.state)
        vertices = np.unique(stability_boundary(self.eset, stratum))
        some = self.eset.points[vertices]
        order = np.argsort(np.linalg.norm(self.changes(some.z, some.p), axis=1), kind="stable")
        p = some.p[order[:MOST_MOVES]]
        if held is not None:
            p = np.concatenate([self._around(held, vertices), p])
        return self.shortest(p)

    def _around(self, held: State, vertices: Some) -> Parameters:
        """Parameters of folds between a place and vertices of the boundary, ever nearer to it."""
        tip = self._spot(held)
        some = self.eset.points[vertices]
        place, here = (embed(self.eset.setting, each.z, each.p) for each in (some, tip))
        near = np.argsort(np.linalg.norm(place - here, axis=1), kind="stable")[:BESIDE]
        share = np.repeat(0.5 ** np.arange(HALVINGS), len(near))[:, None]
        each = np.tile(near, HALVINGS)
        between = SetPoints(
            (1.0 - share) * tip.z + share * some.z[each],
            (1.0 - share) * tip.p + share * some.p[each],
            np.repeat(tip.rows, len(each), axis=0),
        )
        on_fold, found = self._on_folds(between)
        return np.asarray(on_fold.p[found])

    def shortest(self, p: Parameters) -> _Snap | None:
        """Shortest change that snaps on the way to some parameters; None if there is none."""
        state, setting = self.state, self.eset.setting
        free, (lower, upper) = setting.free, setting.limits
        goals = (state.p + (1.0 + BEYOND) * (p - state.p))[:, free]
        goals = goals[((goals > lower) & (goals < upper)).all(axis=1)]
        if len(goals) == 0:
            return None
        z, base = (np.tile(each, (len(goals), 1)) for each in (state.z, state.p))
        to = {name: goals[:, k] for k, name in enumerate(self.eset.names)}
        ended = lift(States(state.structure, z, base), to)
        inside = self.eset.box.holds(ended.states.p[:, free], slack=1e-9)
        lost = np.flatnonzero(np.isin(ended.kind, ("fold", "branch point")) & inside)
        length = np.linalg.norm(self.changes(ended.states.z, ended.states.p), axis=1)
        order = lost[np.argsort(length[lost], kind="stable")]
        first = self._first_snap(ended.states, length, order)
        if first is None:
            return None
        # of those that are hardly longer, the longest: the nearer to a cusp, the smaller the snap
        hardly = order[
            (length[order] > first.length) & (length[order] < (1.0 + NEAR) * first.length)
        ]
        return self._first_snap(ended.states, length, hardly[::-1]) or first

    def _first_snap(self, folds: States, length: Values, order: Some) -> _Snap | None:
        for k in order.tolist():
            landing = _landing(folds[k])
            if landing is not None:
                return _Snap(folds[k], float(length[k]), landing)
        return None

    def shorten(self, snap: _Snap) -> tuple[_Snap, float]:
        """Snap as near as it comes on its fold, and the infimum of the lengths there.

        The nearest place of the fold is the answer if it snaps; else the fold is bisected between
        both.
        """
        here = self._spot(snap.fold)
        near, length, _ = nearest(self._folds, here, self.changes)
        attained = self.shortest(near.p)
        if attained is not None and attained.length <= snap.length:
            return attained, attained.length
        for _ in range(HALVINGS):
            if snap.length < (1.0 + NEAR) * length[0]:
                break
            midway = SetPoints(0.5 * (here.z + near.z), 0.5 * (here.p + near.p), here.rows)
            middle, found = self._on_folds(midway)
            if not found[0]:
                break
            between = self.shortest(middle.p)
            if between is None or between.length > snap.length:
                near, length = middle, np.linalg.norm(self.changes(middle.z, middle.p), axis=1)
            else:
                snap, here = between, middle
        return snap, min(snap.length, float(length[0]))

    @property
    def _folds(self) -> Ground:
        return Ground(self.eset.setting, self.eset, fold=True)

    def _on_folds(self, spot: SetPoints) -> tuple[SetPoints, Flags]:
        """Folds orthogonally above points, and whether there are any in the box."""
        frames, _ = self._folds.frames(spot)
        return self._folds.move(spot, frames, np.zeros(frames.shape[:2]))

    def _spot(self, fold: State) -> SetPoints:
        """A fold, with a basis of the tangent space there."""
        eset = self.eset
        vertices = np.unique(np.concatenate([np.ravel(piece) for piece in eset.folds]))
        place = embed(eset.setting, eset.points.z[vertices], eset.points.p[vertices])
        here = embed(eset.setting, fold.z[None], fold.p[None])
        closest = vertices[[np.linalg.norm(place - here, axis=1).argmin()]]
        spot = SetPoints(fold.z[None], fold.p[None], points_at_vertices(eset, closest).rows)
        return SetPoints(spot.z, spot.p, self._folds.frames(spot)[1])
