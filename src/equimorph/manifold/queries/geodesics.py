"""Shortest curves on a set from a state to folds, as chains of points."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from equimorph.arrays import Float
from equimorph.manifold.complex.equilibrium_set import EquilibriumSet
from equimorph.manifold.geometry.setting import embed
from equimorph.manifold.geometry.tangents import frames_in_embedding
from equimorph.manifold.queries.nearest import Ground, SetPoints
from equimorph.tolerances import LAST_STEP

SWEEPS, HALVINGS = 60, 8
"""Largest number of sweeps that straighten a chain, and of lengths of a step that are tried."""
ROUND_OFF = 1e-14
"""Decrease of the sum of squared links, relative to it, that round-off hides: that of the places is
larger than that of the links between them."""
SAME = 1e-4
"""Distance of the points of two chains, in links, below which both become one."""
FIRST, LAST = np.array([0]), np.array([-1])


@dataclass(frozen=True)
class _Move:
    """Step of Gauss–Newton of one chain for the sum of its squared links.

    The points between its ends move by `step` along `frames`, the last one by `end` along `edge`.
    gain: by how much the sum falls if it is quadratic.
    """

    inner: SetPoints
    frames: Float[np.ndarray, "inner d full"]
    step: Float[np.ndarray, "inner d"]
    last: SetPoints
    edge: Float[np.ndarray, "1 k full"]
    end: Float[np.ndarray, "1 k"]
    gain: float

    @property
    def size(self) -> float:
        """Largest entry of the step."""
        return float(max(np.abs(each).max(initial=0.0) for each in (self.step, self.end)))


class Chains:
    """Chains of points on the set from a state to folds, each pulled straight: discrete geodesics.

    The sum of squared links is least where every point lies in the middle of its neighbours as seen
    along its tangent space, and the last link is orthogonal to the fold. All chains move side by
    side.
    """

    def __init__(self, eset: EquilibriumSet, ways: Sequence[SetPoints]) -> None:
        self.setting, self.chains = eset.setting, list(ways)
        self.on_set, self.on_fold = Ground(self.setting, eset), Ground(self.setting, eset, True)

    @property
    def lengths(self) -> list[float]:
        """Sums of the links."""
        return [float(self._links(chain).sum()) for chain in self.chains]

    def straighten(self, links: int) -> list[int]:
        """Straighten the chains with `links` links each, and keep one of those that become one.

        Returns the numbers that those kept had before.
        """
        self._divide(links)
        moving = list(range(len(self.chains)))
        numbers = moving
        for _ in range(SWEEPS):
            if not moving:
                break
            left, kept = self._sweep(moving), self._different()
            moving = [place for place, i in enumerate(kept) if i in left]
            self.chains = [self.chains[i] for i in kept]
            numbers = [numbers[i] for i in kept]
        return numbers

    def _different(self) -> list[int]:
        """Numbers of the chains that no earlier one is at the same place as."""
        kept, places = list[int](), list[Float[np.ndarray, "points coordinates"]]()
        for i, chain in enumerate(self.chains):
            place, near = self._places(chain), SAME * self._links(chain).max()
            others = (each for each in places if len(each) == len(place))
            if all(np.linalg.norm(place - each, axis=1).max() > near for each in others):
                kept.append(i)
                places.append(place)
        return kept

    def _links(self, chain: SetPoints) -> Float[np.ndarray, " links"]:
        return np.asarray(np.linalg.norm(np.diff(self._places(chain), axis=0), axis=1))

    def _energy(self, chain: SetPoints) -> float:
        return float((self._links(chain) ** 2).sum())

    def _places(self, chain: SetPoints) -> Float[np.ndarray, "points coordinates"]:
        return embed(self.setting, chain.z, chain.p)

    def _divide(self, links: int) -> None:
        """Put equidistant points on the set along the chains."""
        near = [self._equidistant(chain, links) for chain in self.chains]
        moved, good = self.on_set.project(SetPoints.concatenate(near))
        for i, chain in enumerate(near):
            # the ends are what they were, and points that are not found are left out
            begin = i * (links + 1)
            inner = 1 + np.flatnonzero(good[begin + 1 : begin + links])
            exact = chain.with_rows(inner, moved.take(begin + inner))
            self.chains[i] = exact.take(np.concatenate([[0], inner, [links]]))

    def _equidistant(self, chain: SetPoints, links: int) -> SetPoints:
        """Points at equal distances along a chain of straight links."""
        length = np.concatenate([[0.0], np.cumsum(self._links(chain))])
        at = np.linspace(0.0, length[-1], links + 1)
        before = np.clip(np.searchsorted(length, at, side="right") - 1, 0, len(length) - 2)
        gap = np.maximum(length[before + 1] - length[before], 1e-300)
        share = np.clip((at - length[before]) / gap, 0.0, 1.0)[:, None]
        z, p = (
            (1.0 - share) * column[before] + share * column[before + 1]
            for column in (chain.z, chain.p)
        )
        return SetPoints(z, p, chain.rows[np.where(share[:, 0] < 0.5, before, before + 1)])

    def _sweep(self, moving: Sequence[int]) -> list[int]:
        """One step of some chains towards straight ones; which of them are not straight yet."""
        moves = dict(zip(moving, self._moves([self.chains[i] for i in moving]), strict=True))
        energy = {i: self._energy(self.chains[i]) for i in moving}
        todo = [i for i in moving if moves[i].gain > ROUND_OFF * energy[i]]
        left = [i for i in todo if moves[i].size >= LAST_STEP]
        for share in 0.5 ** np.arange(HALVINGS):
            if not todo:
                break
            tried = self._move([moves[i] for i in todo], float(share))
            for i, chain in zip(todo.copy(), tried, strict=True):
                if chain is None:
                    continue
                whole = SetPoints.concatenate([self.chains[i].take(FIRST), chain])
                if self._energy(whole) < energy[i]:
                    self.chains[i] = whole
                    todo.remove(i)
        return [i for i in left if i not in todo]

    def _moves(self, chains: Sequence[SetPoints]) -> Iterator[_Move]:
        """Steps of chains, with the tangent spaces of all their points from one call."""
        inner = SetPoints.concatenate([chain.take(slice(1, -1)) for chain in chains])
        last = SetPoints.concatenate([chain.take(LAST) for chain in chains])
        frames, rows = self.on_set.frames(inner)
        edges, edge_rows = self.on_fold.frames(last)
        inner, last = SetPoints(inner.z, inner.p, rows), SetPoints(last.z, last.p, edge_rows)
        ends = np.cumsum([len(chain.z) - 2 for chain in chains])[:-1]
        for i, own in enumerate(np.split(np.arange(len(inner.z)), ends)):
            edge = edges[i : i + 1]
            step = self._step(chains[i], frames[own], edge)
            tip = last.take(np.array([i]))
            yield _Move(inner.take(own), frames[own], step[0], tip, edge, step[1], step[2])

    def _move(self, moves: Sequence[_Move], share: float) -> list[SetPoints | None]:
        """Chains without their first points after a share of each step; None: not on the set."""
        frames, step = np.concatenate([m.frames for m in moves]), [m.step for m in moves]
        edge, end = np.concatenate([m.edge for m in moves]), [m.end for m in moves]
        inner = SetPoints.concatenate([m.inner for m in moves])
        goal = SetPoints.concatenate([m.last for m in moves])
        middle, good = self.on_set.move(inner, frames, share * np.concatenate(step))
        there = np.ones(len(moves), bool)
        if edge.shape[1]:
            goal, there = self.on_fold.move(goal, edge, share * np.concatenate(end))
        ends = np.cumsum([len(m.step) for m in moves])[:-1]
        owns = np.split(np.arange(len(frames)), ends)
        return [
            SetPoints.concatenate([middle.take(own), goal.take(np.array([i]))])
            if there[i] and good[own].all()
            else None
            for i, own in enumerate(owns)
        ]

    def _step(
        self,
        chain: SetPoints,
        frames: Float[np.ndarray, "inner d full"],
        edge: Float[np.ndarray, "1 k full"],
    ) -> tuple[Float[np.ndarray, "inner d"], Float[np.ndarray, "1 k"], float]:
        """Step of Gauss–Newton for the sum of squared links, and the decrease that it predicts."""
        place = self._places(chain)
        inner, d = frames.shape[:2]
        k = edge.shape[1]
        # directions of all points one below the other, and whose they are
        rows = frames_in_embedding(self.setting, frames).reshape(inner * d, place.shape[1])
        rows = np.concatenate([rows, frames_in_embedding(self.setting, edge)[0]])
        owner = np.concatenate([np.repeat(np.arange(inner), d), np.full(k, inner)])
        pull = np.empty_like(place[1:])
        pull[:-1] = 2.0 * place[1:-1] - place[:-2] - place[2:]
        pull[-1] = place[-1] - place[-2]
        apart = np.abs(owner[:, None] - owner)
        weight = np.where(apart == 1, -1.0, np.where(apart == 0, 2.0, 0.0))
        weight[owner == inner] *= np.where(owner == inner, 0.5, 1.0)
        matrix = weight * (rows @ rows.T)
        gradient = np.einsum("rc,rc->r", rows, pull[owner])
        step = -np.linalg.solve(matrix, gradient)
        gain = -float(step @ gradient)
        return step[: inner * d].reshape(inner, d), step[inner * d :].reshape(1, k), gain
