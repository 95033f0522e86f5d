"""Vertices on edges of folds and constraints that bulge far out: the curve is followed to its end.

Bisection predicts a vertex from both ends of an edge. Where a fold or a constraint forms a narrow
tongue between them, the prediction fails, and only steps along the curve are reliable.
"""

import numpy as np
from jaxtyping import Bool, Int

from equimorph.arrays import Flags, Values
from equimorph.equilibria.critical import Critical, Test
from equimorph.equilibria.critical_tests import gap
from equimorph.equilibria.locus import Locus, Spots, nearest
from equimorph.equilibria.locus_events import Walks
from equimorph.equilibria.trace_locus import begin, passes, step, update
from equimorph.equilibria.trace_options import TraceOptions
from equimorph.manifold.complex.marked_complex import Fabric, FacetMark
from equimorph.manifold.complex.vertices import Vertices, vertices_of
from equimorph.manifold.geometry.points import CAP, CROSSING, FOLD
from equimorph.model import worst_excess
from equimorph.tolerances import IN_BOX

FIRST, LEAST = 0.25, 1e-3
"""Longest and shortest step along a curve, relative to its edge."""
FARTHEST = 10.0
"""Length of a curve, relative to its edge, beyond which it is given up."""


def on_plain_curves(
    fabric: Fabric, edges: Int[np.ndarray, "n 2"], marks: Int[np.ndarray, " n"]
) -> Bool[np.ndarray, " n"]:
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
