"""Bisection of edges until none deviates, flips and collapses in between.

Bisection predicts a vertex from both ends of an edge. Where a fold or a constraint forms a narrow
tongue between them, the prediction fails: then the curve is followed from one end to the other.
"""

import numpy as np

from equimorph.arrays import Flags, Int, ItemFlags, Items, Pairs, Values
from equimorph.equilibria.critical import Critical, Test
from equimorph.equilibria.critical_tests import gap
from equimorph.equilibria.locus import Locus, Spots, nearest
from equimorph.equilibria.locus_events import Walks
from equimorph.equilibria.trace_locus import begin, passes, step, update
from equimorph.equilibria.trace_options import TraceOptions
from equimorph.manifold.complex.cuts import copies, duplicates, first_copies, with_copies
from equimorph.manifold.complex.edge_points import Places, chunks, on_all_edges, unmet
from equimorph.manifold.complex.marked_complex import CURVES, Fabric, FacetMark
from equimorph.manifold.complex.vertices import Vertices, vertices_of
from equimorph.manifold.geometry.points import CAP, CROSSING, FOLD
from equimorph.manifold.geometry.topology import keys_of
from equimorph.manifold.refining.deviation import Edges, Memory, choose_edges, update_edges
from equimorph.manifold.refining.patches import Patch, small_patch
from equimorph.manifold.refining.refill import flip, refill
from equimorph.model import Progress, Silent, worst_excess
from equimorph.tolerances import IN_BOX

ROUNDS = 200
"""Largest number of rounds of bisections."""
GROWN = 1.6
"""Growth of the number of tetrahedra after which slivers are removed again."""
PLACES = ((0.5,), (0.3, 0.7))
"""Where along an edge a vertex is tried, one group after the other; the first place of each group
counts at which one is found. A call for few edges costs as much as one for twice as many."""
HOPELESS = 60
"""Failed bisections, and a fiftieth of all edges, beyond which refinement ends."""
MOST = 4_000_000
"""Cells beyond which refinement ends."""


def settle(
    fabric: Fabric,
    tolerance: float,
    memory: Memory,
    progress: Progress | None = None,
    most: int = MOST,
) -> Fabric:
    """Bisect and flip until no edge deviates that can be bisected, or there are too many cells."""
    cells = len(fabric.cells)
    for _ in range(ROUNDS):
        edges = update_edges(fabric, memory)
        hopeless = memory.failures > max(HOPELESS, len(edges.ends) // 50)
        todo = ((edges.error > tolerance) | edges.pressing | edges.uneven) & ~edges.stuck
        if hopeless or len(fabric.cells) > most or not todo.any():
            break
        patch = small_patch(fabric, edges.ends[todo].ravel())
        if patch is not None:
            fabric = _settle_patch(patch, tolerance, memory, most)
            continue
        (progress or Silent()).report(
            "refining", int((edges.error <= tolerance).sum()), len(edges.error)
        )
        before = len(fabric.vertices)
        fabric = bisect(fabric, edges, choose_edges(edges, tolerance), memory)
        if fabric.dimension == 2:
            fabric = flip(fabric, memory.cut, since=before)
        elif fabric.dimension == 3 and len(fabric.cells) > GROWN * cells:
            fabric = refill(fabric, memory)
            cells = len(fabric.cells)
    return fabric


def _settle_patch(patch: Patch, tolerance: float, memory: Memory, most: int) -> Fabric:
    """Bisect and flip in a patch until no edge deviates there; return the whole fabric."""
    inner = memory.among(patch.inside)
    most -= len(patch.rest.cells)
    out = patch.replace_by(settle(patch.fabric, tolerance, inner, most=most))
    memory.learn(inner, patch.inside)
    return out


def part_sheets(fabric: Fabric, memory: Memory) -> Fabric:
    """Vertices on edges of several sheets that join the same two points of their crossing."""
    ends = duplicates(fabric)
    if len(ends) == 0:
        return fabric
    edges, base = update_edges(fabric, memory), len(fabric.vertices)
    those = np.flatnonzero(np.isin(keys_of(edges.ends, base), keys_of(ends, base)))
    return bisect(fabric, edges, those, memory)


def bisect(fabric: Fabric, edges: Edges, at_once: Items, memory: Memory) -> Fabric:
    """Put exact vertices on edges; remember where that failed."""
    ends = edges.ends
    at_once = at_once[first_copies(fabric, ends[at_once], edges.marks[at_once])]
    lowest = np.full(len(ends), np.iinfo(int).max)
    for side in edges.of_cells.T:
        np.minimum.at(lowest, side, fabric.cell_index)

    done, parts, left = _vertices_on(fabric, edges, at_once, lowest)
    for edge in left[on_plain_curves(fabric, ends[left], edges.marks[left])].tolist():
        led = follow_edge(fabric, ends[edge], int(edges.marks[edge]), int(lowest[edge]))
        if led is None:
            memory.lost.add((int(ends[edge, 0]), int(ends[edge, 1])))
            continue
        done.append(np.array([edge]))
        parts.append(led)
        left = left[left != edge]
    _, others = copies(fabric, ends[left])
    memory.stuck.update(map(tuple, np.concatenate([ends[left], others]).tolist()))
    memory.failures += len(left)
    if not done:
        return fabric
    at, rank = np.concatenate(done), np.empty(len(ends), int)
    rank[at_once] = np.arange(len(at_once))
    order = np.argsort(rank[at])
    place = np.empty(len(at), int)
    place[order] = np.arange(len(at))
    at, base = at[order], len(fabric.vertices)
    vertices = fabric.vertices.join(*parts, place=place)
    found = vertices.take(slice(base, None))
    if ((edges.marks[at] & CURVES) > 0).any():
        memory.stuck.clear()  # near a fold that is better resolved they may succeed
    whole, more = with_copies(fabric, ends[at], found)
    memory.cut = np.concatenate([memory.cut, whole])
    memory.put = np.concatenate([memory.put, base + np.arange(len(whole))])
    if more is not found:
        vertices = vertices.join(more.take(slice(len(found), None)))
        vertices.shared[base:] = more.shared  # in the room behind the vertices that there were
    return fabric.cut(whole, vertices) if len(at) else fabric


def _vertices_on(
    fabric: Fabric, edges: Edges, wanted: Items, lowest: Int[np.ndarray, " E"]
) -> tuple[list[Int[np.ndarray, " _"]], list[Vertices], Int[np.ndarray, " m"]]:
    """Edges with vertices on them, part by part, and those on which none was found."""
    done: list[Int[np.ndarray, " _"]] = []
    parts: list[Vertices] = []
    left = wanted
    for group in PLACES:
        if len(left) == 0:
            break
        own = [np.tile(some, len(group)) for some in chunks(left, edges.marks)]
        places = [
            Places(
                edges.ends[some],
                int(edges.marks[some[0]]),
                lowest[some],
                np.repeat(group, len(some) // len(group)),
            )
            for some in own
        ]
        tried = unmet(fabric, on_all_edges(fabric, places))
        for some, (found, vertices) in zip(own, tried, strict=True):
            first = np.zeros(len(some), bool)
            first[np.flatnonzero(found)[np.unique(some[found], return_index=True)[1]]] = True
            done.append(some[first])
            parts.append(vertices.take(first[found]) if len(group) > 1 else vertices)
        left = np.setdiff1d(left, np.concatenate([left[:0], *done]), assume_unique=True)
    return done, parts, left


FIRST, LEAST = 0.25, 1e-3
"""Longest and shortest step along a curve, relative to its edge."""
FARTHEST = 10.0
"""Length of a curve, relative to its edge, beyond which it is given up."""


def on_plain_curves(fabric: Fabric, edges: Pairs, marks: Items) -> ItemFlags:
    """Which edges over two parameters lie on one fold or constraint, and no other sheet crosses."""
    plain = (fabric.vertices.kinds[edges] != CROSSING).all(axis=1)
    return np.asarray(
        plain & np.isin(marks, (FacetMark.FOLD, FacetMark.CAP)) & (fabric.dimension == 2)
    )


def follow_edge(
    fabric: Fabric, edge: Int[np.ndarray, " 2"], mark: int, lowest: int
) -> Vertices | None:
    """Vertex halfway along the curve between the ends of an edge on a plain curve.

    `mark` says what the edge lies on and `lowest` is the adjacent index. None where the curve does
    not lead from one end to the other.
    """
    store, setting = fabric.vertices.take(edge), fabric.setting
    fold = mark == FacetMark.FOLD
    test = gap if fold else _excess(fabric)
    locus = Locus(setting.structure, store.p[0], setting.free, (test,), singular=fold)
    ends, found = nearest(locus, locus.join(store.z, store.p))
    length = float(np.linalg.norm(store.place[1] - store.place[0]))
    middle = _halfway(fabric, locus, ends, length, lowest) if found.all() else None
    if middle is None:
        return None
    z, p = locus.split(middle.x)
    kinds = np.array([FOLD if fold else CAP])
    return vertices_of(setting, z, p, kinds, middle.index, np.array([-1]), store.rows[:1])


def _excess(fabric: Fabric) -> Test:
    """Largest excess over the constraints."""

    def test(at: Critical) -> Values:
        return worst_excess(fabric.setting.constraints, at.z, at.p)

    return test


def _halfway(fabric: Fabric, locus: Locus, ends: Spots, length: float, lowest: int) -> Spots | None:
    """Point in the middle of the curve between two of its points, tried in both directions."""
    longest, shortest = FIRST * length, LEAST * length
    options = TraceOptions(first_step=longest, largest_step=longest, smallest_step=shortest)
    goal, start = ends.take(np.array([1])), ends.take(np.zeros(2, int))
    here = begin(locus, start.turn(np.array([-1.0, 1.0])), (), options)
    sides: list[list[Walks]] = [[], []]
    going = np.arange(2)
    while len(going):
        there, good = step(locus, here, (), options)
        good &= there.index == lowest
        for i in np.flatnonzero(good):
            lane = np.array([i])
            way = passes(locus, here.take(lane), float(there.travelled[i]), goal)
            if way is not None:
                return _nearest_to(sides[going[i]], 0.5 * way[0])
            sides[going[i]].append(there.take(lane))
        here = update(here, there, good)
        on = _inside(fabric, locus, here) & (here.length >= shortest)
        on &= here.travelled < FARTHEST * length
        here, going = here.take(on), going[on]
    return None


def _inside(fabric: Fabric, locus: Locus, here: Walks) -> Flags:
    """Which curves are inside the box."""
    p = locus.split(here.spots.x)[1][:, locus.free]
    low, high = fabric.box
    return np.asarray(((p >= low - IN_BOX) & (p <= high + IN_BOX)).all(axis=1))


def _nearest_to(walks: list[Walks], length: float) -> Spots | None:
    """The point of a curve at about a length; None if there is none between its ends."""
    if not walks:
        return None
    return min(walks, key=lambda walk: abs(float(walk.travelled[0]) - length)).spots
