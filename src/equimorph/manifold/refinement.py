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
from equimorph.manifold.collapsing import collapse_edges
from equimorph.manifold.copies import copies, doubled, first_copies, with_copies
from equimorph.manifold.cusp_points import with_cusps_beside
from equimorph.manifold.equilibrium_set import EquilibriumSet
from equimorph.manifold.fabric import CURVES, HOLE, Fabric, edges_of, fabric_of
from equimorph.manifold.on_edges import chunks, recalled_on_edges
from equimorph.manifold.pairing import Setting
from equimorph.manifold.questions import question_of_refinement
from equimorph.manifold.reconnection import reconnect, smallest_dihedral
from equimorph.manifold.surgery import collapse, flip, smallest_angle
from equimorph.manifold.tangents import Cubics
from equimorph.manifold.topology import keys_of
from equimorph.model import Forgetful, Journal, Progress, Silent

ROUNDS = 200
ALTERNATIONS, FEWER = 8, 0.98
"""How often tetrahedra are reconnected and vertices taken out, as long as cells get fewer."""
GROWN = 1.6
"""How much more tetrahedra there are when slivers are taken away anew."""
PLANS = (3 * (False, True), 6 * (True,))
"""Whether all edges around overturned cells are cut, round by round, or only folds and constraints;
another plan if one fails."""
SHARE = {1: 1.0, 2: 0.75, 3: 2.0 / 3.0}
"""Part of the tolerance that edges may use up: inside a cell their deviations add up to 2d/(d + 1)
of the largest."""
PREFERENCE = 1.6
"""How much longer an edge must be than those that deviate to be bisected before them."""
COARSE = 4.0
"""Deviation, in tolerances, of edges whose halves are likely to deviate too much as well."""
BULGE = 0.5
"""How long edges on folds may be, relative to edges at their ends that could not be bisected."""
FEW = 50
"""Fewer than one in so many edges are bisected all at once."""
PLACES = (0.5, 0.3, 0.7)
"""Where along an edge a vertex is tried, one place after the other."""
HOPELESS = 60
"""Failed bisections, and a fiftieth of all edges, beyond which refinement ends."""
MOST = 2_000_000
"""Vertices beyond which refinement ends."""


def refine(
    eset: EquilibriumSet,
    accuracy: float,
    progress: Progress | None = None,
    journal: Journal | None = None,
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
        Sink for progress reports; one that raises an exception cancels.
    journal
        Keeps new vertices as soon as they are found, to go on from; see `equilibrium_set`.

    Returns
    -------
    The refined set; its audit tells the largest deviation that remains, how many edges could not be
    bisected, and the smallest angle.

    Raises
    ------
    InputError
        If `accuracy` is not positive, or the journal is of something else.
    """
    check_accuracy(accuracy)
    if journal is not None:
        journal.begin(question_of_refinement(eset, accuracy))
    return refined(eset, accuracy, progress or Silent(), journal or Forgetful())


def refined(
    eset: EquilibriumSet, accuracy: float, progress: Progress, journal: Journal
) -> EquilibriumSet:
    """Return a refined set; a journal that has begun goes on."""
    free = np.array([[q.name for q in eset.structure.parameters].index(n) for n in eset.names])
    base = eset.points.p[0].copy() if len(eset.points) else np.zeros(0)
    setting = Setting(eset.structure, base, free, eset.constraints)
    if len(eset.cells) == 0:
        return eset
    memory = _Memory(journal)
    fabric = _tidied(fabric_of(setting, eset), memory)
    fabric = _refined(fabric, SHARE[len(free)] * accuracy, memory, progress)
    fabric = _told_apart(fabric, memory)
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
        smallest_dihedral=smallest_dihedral(fabric),
    )
    return replace(out, audit=quality)


def check_accuracy(accuracy: float) -> None:
    """Refuse what is no accuracy."""
    if not 0.0 < accuracy < np.inf:
        raise InputError(f"`accuracy` must be positive and finite; got {accuracy!r}.")


@dataclass(frozen=True)
class _Edges:
    """Edges of a fabric, those of each cell, their marks, length and deviation from the set.

    stuck: cannot be bisected; pressing: must be, whatever they deviate.
    """

    ends: Int[np.ndarray, "E 2"]
    of_cells: Int[np.ndarray, "C sides"]
    marks: Int[np.ndarray, " E"]
    length: Float[np.ndarray, " E"]
    error: Float[np.ndarray, " E"]
    stuck: Bool[np.ndarray, " E"]
    pressing: Bool[np.ndarray, " E"]

    def deviating(self, tolerance: float) -> Bool[np.ndarray, " E"]:
        """Edges that should be bisected now, and can be.

        Where folds and constraints bulge far out between their vertices, they come first: edges
        beside them would cross them.
        """
        first = (self.error > COARSE * tolerance) & ((self.marks & CURVES) > 0)
        first = (first | self.pressing) & ~self.stuck
        return first if first.any() else np.asarray((self.error > tolerance) & ~self.stuck)


@dataclass
class _Memory:
    """Deviations of edges that were measured before, and edges that could not be bisected."""

    journal: Journal
    keys: Int[np.ndarray, " n"] = field(default_factory=lambda: np.zeros(0, int))
    """Of the edges whose deviation is known; so numbered that they stay when vertices are added."""
    error: Float[np.ndarray, " n"] = field(default_factory=lambda: np.zeros(0))
    stuck: set[tuple[int, int]] = field(default_factory=set)
    cut: Int[np.ndarray, "m 2"] = field(default_factory=lambda: np.zeros((0, 2), int))
    """Edges that were bisected: flips must not bring them back."""
    failures: int = 0


def _refined(fabric: Fabric, tolerance: float, memory: _Memory, progress: Progress) -> Fabric:
    """Bisect and flip until nothing is left to do; then take slivers away, and begin again."""
    fabric = _settled(fabric, tolerance, memory, progress)
    fabric = _settled(_tidied(fabric, memory), tolerance, memory, progress)
    return _righted(fabric, tolerance, memory, progress) if fabric.dimension == 2 else fabric


def _righted(fabric: Fabric, tolerance: float, memory: _Memory, progress: Progress) -> Fabric:
    """Cells turned upright that bisection and flips have left overturned, as far as possible."""
    first, best, fewest = fabric, fabric, _faults(fabric, tolerance, memory)
    for plan in PLANS:
        fabric = first
        for widely in plan:
            if fewest[1] == 0:
                return best
            fabric = with_cusps_beside(fabric, fabric.overturned(fabric.cells, fabric.sense))
            fabric = _settled(_tidied(fabric, memory), tolerance, memory, progress)
            faults = _faults(fabric, tolerance, memory)
            if faults < fewest:
                best, fewest = fabric, faults
            fabric = _cut_around(fabric, memory, widely)
    return best


def _settled(fabric: Fabric, tolerance: float, memory: _Memory, progress: Progress) -> Fabric:
    """Bisect and flip until no edge deviates that can be bisected."""
    cells = len(fabric.cells)
    for _ in range(ROUNDS):
        edges = _known(fabric, memory)
        hopeless = memory.failures > max(HOPELESS, len(edges.ends) // 50)
        if hopeless or len(fabric.vertices) > MOST or not edges.deviating(tolerance).any():
            break
        progress.report("refining", int((edges.error <= tolerance).sum()), len(edges.error))
        fabric = _bisect(fabric, edges, _chosen(edges, tolerance), memory)
        if fabric.dimension == 2:
            fabric = flip(fabric, memory.cut)
        elif fabric.dimension == 3 and len(fabric.cells) > GROWN * cells:
            fabric = _tidied(fabric, memory)
            cells = len(fabric.cells)
    return fabric


def _told_apart(fabric: Fabric, memory: _Memory) -> Fabric:
    """Vertices on edges of several sheets that join the same two points of their crossing."""
    ends = doubled(fabric)
    if len(ends) == 0:
        return fabric
    edges, base = _known(fabric, memory), len(fabric.vertices)
    chosen = np.flatnonzero(np.isin(keys_of(edges.ends, base), keys_of(ends, base)))
    return _bisect(fabric, edges, chosen, memory)


def _faults(fabric: Fabric, tolerance: float, memory: _Memory) -> tuple[int, int]:
    """Numbers of edges that deviate, and of cells that are overturned."""
    deviating = int((_known(fabric, memory).error > tolerance).sum())
    return deviating, int(fabric.overturned(fabric.cells, fabric.sense).sum())


def _cut_around(fabric: Fabric, memory: _Memory, widely: bool) -> Fabric:
    """Edges cut on folds and constraints: chords of these that pass a vertex turn cells over.

    If not `widely`; else all edges of overturned cells and of those that touch them.
    """
    edges = _known(fabric, memory)
    cells = fabric.overturned(fabric.cells, fabric.sense)
    wanted = (edges.marks & CURVES) > 0
    if widely:
        near = np.zeros(len(fabric.vertices), bool)
        near[fabric.cells[cells]] = True
        cells, wanted = near[fabric.cells].any(axis=1), np.ones_like(wanted)
    chosen = np.unique(edges.of_cells[cells])
    chosen = chosen[wanted[chosen] & ~edges.stuck[chosen]]
    chosen = chosen[np.argsort(-edges.length[chosen], kind="stable")]
    return flip(_bisect(fabric, edges, chosen, memory), memory.cut)


def _tidied(fabric: Fabric, memory: _Memory) -> Fabric:
    """Take slivers away."""
    if fabric.dimension == 3:
        for _ in range(ALTERNATIONS):
            cells = len(fabric.cells)
            fabric = collapse_edges(reconnect(fabric, memory.cut), memory.cut)
            if len(fabric.cells) > FEWER * cells:
                break
        return reconnect(fabric, memory.cut)
    if fabric.dimension == 1:
        return fabric
    return flip(collapse(flip(fabric, memory.cut), passes=4), memory.cut)


def _known(fabric: Fabric, memory: _Memory) -> _Edges:
    """Edges with their deviations; only those that are new are measured."""
    base = len(fabric.vertices)
    ends, of_cells = edges_of(fabric.cells, base)
    marks = fabric.edge_marks(ends)
    keys = _keys(ends)
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
    failed = np.zeros(len(ends), bool)
    if memory.stuck:
        refused = np.array(sorted(memory.stuck))
        failed = np.isin(keys_of(ends, base), keys_of(refused, base))
    pressing = _pressing(ends, marks, length, failed)
    return _Edges(ends, of_cells, marks, length, error, stuck | failed, pressing)


def _pressing(
    ends: Int[np.ndarray, "E 2"],
    marks: Int[np.ndarray, " E"],
    length: Float[np.ndarray, " E"],
    failed: Bool[np.ndarray, " E"],
) -> Bool[np.ndarray, " E"]:
    """Longer edges on folds and constraints next to edges that could not be bisected.

    Those may cross a fold that bulges out between its vertices.
    """
    reach = np.full(int(ends.max(initial=0)) + 1, np.inf)
    for side in range(2):
        np.minimum.at(reach, ends[failed, side], length[failed])
    short = np.minimum(reach[ends[:, 0]], reach[ends[:, 1]])
    return np.asarray(((marks & CURVES) > 0) & (length > BULGE * short))


def _keys(ends: Int[np.ndarray, "E 2"]) -> Int[np.ndarray, " E"]:
    """Numbers of edges with sorted ends that stay the same while vertices are added."""
    return np.asarray(ends[:, 1] * (ends[:, 1] - 1) // 2 + ends[:, 0])


def _deviations(
    fabric: Fabric, ends: Int[np.ndarray, "E 2"], marks: Int[np.ndarray, " E"]
) -> Float[np.ndarray, " E"]:
    """How far the set is from straight edges."""
    out = np.zeros(len(ends))
    for own in chunks(np.arange(len(ends)), marks):
        first, second = (fabric.end(ends[own], side, int(marks[own[0]])) for side in range(2))
        out[own] = Cubics(first, second).error
    return out


def _chosen(edges: _Edges, tolerance: float) -> Int[np.ndarray, " n"]:
    """Edges to be bisected now, those first that cells with several are to be cut at first.

    Those that deviate so much that their halves may, too; of the others, those that all cells
    around them want to be cut at first: the rest may then be within the tolerance, or flipped.
    """
    deviating = edges.deviating(tolerance)
    few = np.count_nonzero(deviating) * FEW < len(deviating)
    coarse, _ = _closed(edges, deviating & (few | (edges.error > COARSE * tolerance)))
    wanted, weight = _closed(edges, coarse | deviating)
    cells = edges.of_cells[wanted[edges.of_cells].any(axis=1)]
    longest = cells[np.arange(len(cells)), weight[cells].argmax(axis=1)]
    around = np.bincount(edges.of_cells.ravel(), minlength=len(weight))
    agreed = np.bincount(longest, minlength=len(weight)) == around
    out = np.flatnonzero(coarse | (agreed & wanted))
    return out[np.argsort(-weight[out], kind="stable")]


def _closed(
    edges: _Edges, wanted: Bool[np.ndarray, " E"]
) -> tuple[Bool[np.ndarray, " E"], Float[np.ndarray, " E"]]:
    """Wanted edges and what follows; and by how much cells prefer to be cut at each edge.

    In every cell with a wanted edge the longest one is wanted, too, if that is longer by more than
    `PREFERENCE`.
    """
    wanted = wanted & ~edges.stuck
    weight = np.where(wanted, PREFERENCE, 1.0) * edges.length
    weight[edges.stuck] = -1.0
    while True:
        cells = edges.of_cells[wanted[edges.of_cells].any(axis=1)]
        longest = cells[np.arange(len(cells)), weight[cells].argmax(axis=1)]
        more = longest[~wanted[longest]]
        if len(more) == 0:
            return wanted, weight
        wanted[more] = True
        weight[more] = PREFERENCE * edges.length[more]


def _bisect(
    fabric: Fabric, edges: _Edges, chosen: Int[np.ndarray, " n"], memory: _Memory
) -> Fabric:
    """Put exact vertices on edges; remember where that failed."""
    ends = edges.ends
    chosen = chosen[first_copies(fabric, ends[chosen], edges.marks[chosen])]
    lowest = np.full(len(ends), np.iinfo(int).max)
    for side in edges.of_cells.T:
        np.minimum.at(lowest, side, fabric.cell_index)

    parts, done = [], []
    for some in chunks(chosen, edges.marks):
        own, mark = some, int(edges.marks[some[0]])
        for t in PLACES:
            given = (ends[own], mark, lowest[own], np.full(len(own), t))
            found, vertices = recalled_on_edges(memory.journal, fabric, *given)
            parts.append(vertices)
            done.append(own[found])
            own = own[~found]
            if len(own) == 0:
                break
        _, others = copies(fabric, ends[own])
        memory.stuck.update(map(tuple, np.concatenate([ends[own], others]).tolist()))
        memory.failures += len(own)
    if not done:
        return fabric
    more = parts[0].joined(*parts[1:])
    at = np.concatenate(done)
    rank = np.empty(len(ends), int)
    rank[chosen] = np.arange(len(chosen))
    order = np.argsort(rank[at])
    at, more = at[order], more.take(order)
    if ((edges.marks[at] & CURVES) > 0).any():
        memory.stuck.clear()  # beside a fold that is better known they may succeed
    whole, more = with_copies(fabric, ends[at], more)
    memory.cut = np.concatenate([memory.cut, whole])
    return fabric.bisected(whole, more) if len(at) else fabric
