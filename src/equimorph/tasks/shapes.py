"""`solve_shape`: all equilibria of a set whose descriptors take given values."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from jaxtyping import Float, Int

from equimorph.equilibria import newton_at_targets
from equimorph.errors import InputError
from equimorph.manifold import EquilibriumSet
from equimorph.model import Constraint, Descriptor, position
from equimorph.structures import State, States
from equimorph.tasks.planning import plan
from equimorph.tasks.route import Route

OVERHANG = 0.5
"""How far beyond a cell, in barycentric coordinates, its linear prediction is still tried."""
SAME = 1e-6
"""Distance, in the metric and scaled parameters, below which two solutions are the same."""
AT_EDGE = 1e-9
"""By how much a solution may exceed the box or a constraint."""

Rank = Literal["route", "energy", "margin"]


@dataclass(frozen=True)
class Shapes:
    """Answer to "at which settings does the structure take this shape".

    Parameters
    ----------
    status
        "solved", or "refused" with the reason in `why`.
    states
        All solutions, best first: stable ones before unstable ones, then by rank.
    index
        Negative eigenvalues of each; 0 is stable.
    margin
        Stability margin of each.
    routes
        Way to each from the start, or why there is none; empty without a start.
    closest
        Vertex of the set whose descriptors come nearest to the targets, each measured by its range
        over the set, and how far it is from them: what is left where there is no solution.
    """

    status: Literal["solved", "refused"]
    why: str
    states: States
    index: Int[np.ndarray, " lanes"]
    margin: Float[np.ndarray, " lanes"]
    routes: tuple[Route, ...]
    closest: State
    miss: Mapping[str, float]

    def __repr__(self) -> str:
        """How many there are, or why there is none."""
        if self.status == "refused":
            return f"Shapes(refused: {self.why})"
        return f"Shapes({len(self)} states, {int(np.sum(self.index == 0))} of them stable)"

    def __len__(self) -> int:
        """Number of solutions."""
        return len(self.states)

    @property
    def solved(self) -> bool:
        """Whether there is a solution."""
        return self.status == "solved"

    @property
    def stable(self) -> States:
        """The stable solutions, best first."""
        mine: States = self.states[self.index == 0]
        return mine


def solve_shape(
    eset: EquilibriumSet,
    targets: Mapping[Descriptor, float],
    *,
    within: Sequence[Constraint] = (),
    start: State | None = None,
    rank: Rank | None = None,
) -> Shapes:
    """Find all states of a set at which descriptors take given values.

    Cells over which the linear interpolation of the descriptors comes near the targets predict
    states, which Newton corrects in the unknowns and the free parameters together; folds are no
    obstacle. A solution that no cell predicts would need two in one cell: refine the set there.

    Parameters
    ----------
    eset
        The set over the actuators.
    targets
        As many descriptors as the set has free parameters, with their values.
    within
        Constraints that solutions have to obey, beside those of the set.
    start
        Stable state from which to plan a route to each stable solution.
    rank
        "route" (shortest first; the default with a start), "energy" (lowest first; the default
        without) or "margin" (largest first).

    Returns
    -------
    The solutions. None is an answer: refused, with the vertex that comes nearest.

    Raises
    ------
    InputError
        For a number of targets that is not that of the free parameters, values that are not
        finite, an empty set, or a rank by routes without a start.
    """
    descriptors, wanted = tuple(targets), _numbers(eset, targets)
    rank = rank or ("energy" if start is None else "route")
    if rank not in ("route", "energy", "margin") or (rank == "route" and start is None):
        raise InputError(
            f"`rank` must be energy or margin, or route if there is a start; got {rank!r}."
        )
    values = np.stack([each.function(eset.points.z, eset.points.p) for each in descriptors], 1)
    found = _roots(eset, descriptors, values, wanted)
    for constraint in (*eset.constraints, *within):
        found = found[constraint.excess(found.z, found.p) <= AT_EDGE]
    index = found.index if len(found) else np.zeros(0, int)
    margin = found.margin if len(found) else np.zeros(0)
    routes = [] if start is None else [_route(eset, start, each, within) for each in found]
    energy = found.energy if len(found) else np.zeros(0)
    key = {"route": [each.length for each in routes], "energy": energy, "margin": -margin}[rank]
    order = np.lexsort((np.nan_to_num(np.asarray(key, float), nan=np.inf), index))
    closest, miss = _closest(eset, descriptors, values, wanted)
    why = "" if len(order) else _why(descriptors, wanted, miss)
    return Shapes(
        "refused" if why else "solved",
        why,
        found[order],
        index[order],
        margin[order],
        tuple(routes[k] for k in order) if routes else (),
        closest,
        miss,
    )


def _numbers(eset: EquilibriumSet, targets: Mapping[Descriptor, float]) -> Float[np.ndarray, " k"]:
    if len(targets) != len(eset.names):
        raise InputError(
            f"`targets` must give as many descriptors as the set has free parameters "
            f"({', '.join(eset.names)}); got {len(targets)}."
        )
    for descriptor, value in targets.items():
        if not np.isfinite(value):
            raise InputError(f"`targets` must be finite; got {descriptor.name} = {value!r}.")
    if not len(eset.cells):
        raise InputError("`eset` must have cells; got an empty set.")
    return np.array([float(value) for value in targets.values()])


def _roots(
    eset: EquilibriumSet,
    descriptors: tuple[Descriptor, ...],
    values: Float[np.ndarray, "V k"],
    wanted: Float[np.ndarray, " k"],
) -> States:
    """Exact solutions in the box, each once."""
    structure = eset.structure
    share, cells = _predicted(values[eset.cells], wanted)
    corners = eset.cells[cells]
    z = np.einsum("ck,cki->ci", share, eset.points.z[corners])
    p = np.einsum("ck,cki->ci", share, eset.points.p[corners])
    free = np.array([position(structure.parameters, name) for name in eset.names])
    p[:, free] = np.clip(p[:, free], eset.box.lower, eset.box.upper)
    if not len(z):
        return States(structure, z, p)
    many = np.repeat(wanted[None], len(z), axis=0)
    z, p, found = newton_at_targets(structure, (z, p), free, descriptors, many)
    found &= eset.box.contains(p[:, free], slack=AT_EDGE)
    found[found] &= structure.resolved(z[found], p[found])
    z, p = z[found], p[found]
    kept = _distinct(States(structure, z, p))
    return States(structure, z[kept], p[kept])


def _predicted(
    values: Float[np.ndarray, "C corners k"], wanted: Float[np.ndarray, " k"]
) -> tuple[Float[np.ndarray, "some corners"], Int[np.ndarray, " some"]]:
    """Barycentric coordinates at which cells take the values, in or near them; which cells."""
    low, high = values.min(axis=1), values.max(axis=1)
    reach = values.shape[2] * OVERHANG * (high - low)
    cells = np.flatnonzero(((low - reach <= wanted) & (wanted <= high + reach)).all(axis=1))
    sides = values[cells, 1:] - values[cells, :1]
    size = np.maximum(np.abs(sides).max(axis=(1, 2), initial=0.0), 1e-300)
    regular = np.abs(np.linalg.det(sides)) > 1e-12 * size ** sides.shape[1]
    cells, sides = cells[regular], sides[regular]
    gap = wanted - values[cells, 0]
    inner = np.linalg.solve(np.swapaxes(sides, 1, 2), gap[:, :, None])[:, :, 0]
    share = np.concatenate([1.0 - inner.sum(axis=1, keepdims=True), inner], axis=1)
    near = share.min(axis=1) >= -OVERHANG
    return share[near], cells[near]


def _distinct(states: States) -> Int[np.ndarray, " distinct"]:
    """First of each group of states that are the same."""
    structure = states.structure
    u = states.z[:, : structure.unknowns] * np.sqrt(structure.mass)
    place = np.concatenate([u, states.p / structure.scales], axis=1)
    kept: list[int] = []
    for i, own in enumerate(place):
        if not kept or np.linalg.norm(place[kept] - own, axis=1).min() > SAME:
            kept.append(i)
    return np.array(kept, dtype=int)


def _route(eset: EquilibriumSet, start: State, goal: State, within: Sequence[Constraint]) -> Route:
    return plan(eset, start, goal, within=within)


def _closest(
    eset: EquilibriumSet,
    descriptors: tuple[Descriptor, ...],
    values: Float[np.ndarray, "V k"],
    wanted: Float[np.ndarray, " k"],
) -> tuple[State, dict[str, float]]:
    spread = np.maximum(np.ptp(values, axis=0), 1e-300)
    best = int(np.argmin((((values - wanted) / spread) ** 2).sum(axis=1)))
    gaps = (values[best] - wanted).tolist()
    names = [each.name for each in descriptors]
    return eset.points[best], dict(zip(names, gaps, strict=True))


def _why(
    descriptors: tuple[Descriptor, ...],
    wanted: Float[np.ndarray, " k"],
    miss: Mapping[str, float],
) -> str:
    asked = ", ".join(f"{d.name} = {v:g}" for d, v in zip(descriptors, wanted, strict=True))
    gaps = ", ".join(f"{name} by {gap:.3g}" for name, gap in miss.items())
    return f"no state of the set has {asked}; the nearest vertex misses {gaps}"
