"""Refinement: edges are bisected until straight cells are within a tolerance of the set.

The longest edge of a cell goes first, so that angles do not shrink from one bisection to the next
[Rivara1984]_. New vertices are predicted by the cubic that touches the tangent spaces at both ends
of the edge, and corrected orthogonally to the mean of both spaces; on folds, constraints and sides
of the box along these.
"""

from dataclasses import dataclass, field, replace

import numpy as np
from jaxtyping import Bool, Float, Int

from equimorph.errors import InputError
from equimorph.manifold.accounting import Frame, Lifting, described
from equimorph.manifold.equilibrium_set import EquilibriumSet
from equimorph.manifold.fabric import (
    HOLE,
    ON_CAP,
    ON_FOLD,
    Fabric,
    edges_of,
    fabric_of,
)
from equimorph.manifold.on_edges import on_edges
from equimorph.manifold.pairing import Setting
from equimorph.manifold.surgery import collapse, flip, smallest_angle
from equimorph.manifold.tangents import Cubics
from equimorph.manifold.topology import keys_of
from equimorph.model import Progress, Silent

ROUNDS = 200
TIDIED = 2
"""How often slivers are taken away in between."""
SHARE = {1: 1.0, 2: 0.75, 3: 2.0 / 3.0}
"""Part of the tolerance that edges may use up: inside a cell their deviations add up to 2d/(d + 1)
of the largest."""
PREFERENCE = 1.6
"""How much longer an edge must be than those that deviate to be bisected before them."""
PLACES = (0.5, 0.3, 0.7)
"""Where along an edge a vertex is tried, one place after the other."""
HOPELESS = 60
"""Failed bisections, and a fiftieth of all edges, beyond which refinement ends."""
MOST = 2_000_000
"""Vertices beyond which refinement ends."""


def refine(
    eset: EquilibriumSet, accuracy: float, progress: Progress | None = None
) -> EquilibriumSet:
    """Return the set with cells so small that they are within a tolerance of it.

    Parameters
    ----------
    eset
        A set as it was lifted.
    accuracy
        Largest distance, in the metric of the embedding (configuration and scaled parameters),
        between the straight cells and the set.
    progress
        Sink for progress reports.

    Returns
    -------
    The refined set; its audit tells the largest deviation that remains, how many edges could not be
    bisected, and the smallest angle.

    Raises
    ------
    InputError
        If `accuracy` is not positive.
    """
    check_accuracy(accuracy)
    free = np.array([[q.name for q in eset.structure.parameters].index(n) for n in eset.names])
    base = eset.points.p[0].copy() if len(eset.points) else np.zeros(0)
    setting = Setting(eset.structure, base, free, eset.constraints)
    fabric = _tidied(fabric_of(setting, eset)) if len(eset.cells) else None
    if fabric is None:
        return eset
    memory = _Memory()
    fabric = _refined(fabric, SHARE[len(free)] * accuracy, memory, progress or Silent())
    edges = _known(fabric, memory)
    audit = eset.audit
    lifting = Lifting(
        audit.unpaired, audit.conflicts, audit.retraced,
        audit.parity_violations, audit.undecided, audit.bisected,
    )  # fmt: skip
    frame = Frame(setting, eset.mesh, eset.box, dict(eset.fixed), eset.intervals)
    out = described(frame, fabric.complex(), lifting)
    quality = replace(
        out.audit,
        checked=audit.checked,
        missing=audit.missing,
        recovered=audit.recovered,
        accuracy=accuracy,
        deviation=float(edges.error.max(initial=0.0) / SHARE[len(free)]),
        unrefined=int((edges.error > SHARE[len(free)] * accuracy).sum()),
        smallest_angle=smallest_angle(fabric),
    )
    return replace(out, audit=quality)


def check_accuracy(accuracy: float) -> None:
    """Refuse what is no accuracy."""
    if not 0.0 < accuracy < np.inf:
        raise InputError(f"`accuracy` must be positive and finite; got {accuracy!r}.")


@dataclass(frozen=True)
class _Edges:
    """Edges of a fabric, those of each cell, their marks, length and deviation from the set."""

    ends: Int[np.ndarray, "E 2"]
    of_cells: Int[np.ndarray, "C sides"]
    marks: Int[np.ndarray, " E"]
    length: Float[np.ndarray, " E"]
    error: Float[np.ndarray, " E"]
    stuck: Bool[np.ndarray, " E"]


@dataclass
class _Memory:
    """Deviations of edges that were measured before, and edges that could not be bisected."""

    keys: Int[np.ndarray, " n"] = field(default_factory=lambda: np.zeros(0, int))
    error: Float[np.ndarray, " n"] = field(default_factory=lambda: np.zeros(0))
    stuck: set[tuple[int, int]] = field(default_factory=set)
    failures: int = 0


def _refined(fabric: Fabric, tolerance: float, memory: _Memory, progress: Progress) -> Fabric:
    """Bisect and flip until nothing is left to do; then take slivers away, and begin again."""
    tidied = 0
    for _ in range(ROUNDS):
        edges = _known(fabric, memory)
        wanted = (edges.error > tolerance) & ~edges.stuck
        hopeless = memory.failures > max(HOPELESS, len(edges.ends) // 50)
        if hopeless or len(fabric.vertices) > MOST:
            break
        if not wanted.any():
            if tidied == TIDIED:
                break
            tidied += 1
            cells, fabric = fabric.cells, _tidied(fabric)
            if fabric.cells is cells:
                break
            continue
        progress.report("refining", int((edges.error <= tolerance).sum()), len(edges.error))
        fabric = _bisect(fabric, edges, _terminal(edges, wanted), memory)
        if fabric.dimension == 2:
            fabric = flip(fabric, passes=2)
    return fabric


def _tidied(fabric: Fabric) -> Fabric:
    """Take slivers away."""
    if fabric.dimension != 2:
        return fabric
    return flip(collapse(flip(fabric, passes=4), passes=4), passes=4)


def _known(fabric: Fabric, memory: _Memory) -> _Edges:
    """Edges with their deviations; only those that are new are measured."""
    base = len(fabric.vertices)
    ends, of_cells = edges_of(fabric.cells, base)
    marks = fabric.edge_marks(ends)
    # keys that stay the same while vertices are added
    keys = ends[:, 1] * (ends[:, 1] - 1) // 2 + ends[:, 0]
    at = np.minimum(np.searchsorted(memory.keys, keys), max(len(memory.keys) - 1, 0))
    old = memory.keys[at] == keys if len(memory.keys) else np.zeros(len(keys), bool)
    error = np.empty(len(keys))
    error[old] = memory.error[at[old]]
    new = np.flatnonzero(~old)
    error[new] = _deviations(fabric, ends[new], marks[new])
    order = np.argsort(keys)
    memory.keys, memory.error = keys[order], error[order]
    length = np.empty(len(ends))
    length[of_cells] = np.sqrt(fabric.squared)
    stuck = (marks & HOLE) > 0
    if memory.stuck:
        refused = np.array(sorted(memory.stuck))
        stuck |= np.isin(keys_of(ends, base), keys_of(refused, base))
    return _Edges(ends, of_cells, marks, length, error, stuck)


def _deviations(
    fabric: Fabric, ends: Int[np.ndarray, "E 2"], marks: Int[np.ndarray, " E"]
) -> Float[np.ndarray, " E"]:
    """How far the set is from straight edges."""
    out = np.zeros(len(ends))
    for mark in np.unique(marks).tolist():
        own = np.flatnonzero(marks == mark)
        for some in np.array_split(own, len(own) // 8192 + 1):
            first, second = (fabric.end(ends[some, side], mark) for side in range(2))
            out[some] = Cubics(first, second).error
    return out


def _terminal(edges: _Edges, wanted: Bool[np.ndarray, " E"]) -> Int[np.ndarray, " n"]:
    """Edges to be bisected now: those that all cells around them choose.

    A cell with a wanted edge chooses the longest of these, or its longest edge, which is wanted
    then, too, if that is longer by more than `PREFERENCE`.
    """
    chosen, sides = wanted.copy(), edges.of_cells
    own = np.arange(len(sides))
    while True:
        weight = np.where(edges.stuck, -1.0, np.where(chosen, PREFERENCE, 1.0) * edges.length)
        rank = np.empty(len(weight), int)
        rank[np.argsort(weight, kind="stable")] = np.arange(len(weight))
        choice = sides[own, rank[sides].argmax(axis=1)]
        active = chosen[sides].any(axis=1)
        count = np.count_nonzero(chosen)
        chosen[choice[active]] = True
        if np.count_nonzero(chosen) == count:
            break
    around = np.bincount(sides.ravel(), minlength=len(weight))
    agreeing = np.bincount(choice[active], minlength=len(weight))
    return np.flatnonzero((agreeing == around) & chosen & ~edges.stuck)


def _bisect(
    fabric: Fabric, edges: _Edges, chosen: Int[np.ndarray, " n"], memory: _Memory
) -> Fabric:
    """Put exact vertices on edges; remember where that failed."""
    ends, parts, done = edges.ends, [], []
    lowest = np.full(len(ends), np.iinfo(int).max)
    for side in edges.of_cells.T:
        np.minimum.at(lowest, side, fabric.cell_index)
    for mark in np.unique(edges.marks[chosen]).tolist():
        own = chosen[edges.marks[chosen] == mark]
        for t in PLACES:
            places = np.full(len(own), t)
            found, vertices = on_edges(fabric, ends[own], mark, lowest[own], places)
            parts.append(vertices)
            done.append(own[found])
            own = own[~found]
            if len(own) == 0:
                break
        memory.stuck.update(map(tuple, ends[own].tolist()))
        memory.failures += len(own)
    if not done:
        return fabric
    more = parts[0]
    for part in parts[1:]:
        more = more.joined(part)
    at = np.concatenate(done)
    if np.isin(edges.marks[at], (ON_FOLD, ON_CAP)).any():
        memory.stuck.clear()  # beside a fold that is better known they may succeed
    return fabric.bisected(ends[at], more) if len(at) else fabric
