"""Vertices on edges of folds and constraints that bulge far out: the curve is followed to its end.

Bisection predicts a vertex from both ends of an edge. Where a fold or a constraint forms a narrow
tongue between them, the prediction fails, and only steps along the curve are reliable.
"""

from dataclasses import replace

import numpy as np
from jaxtyping import Bool, Float, Int

from equimorph.manifold.complex.marked_complex import Fabric, FacetMark
from equimorph.manifold.complex.vertices import Vertices, vertices_of
from equimorph.manifold.geometry.exact_points import Aim, corrected, lower_index
from equimorph.manifold.geometry.points import CAP, CROSSING, FOLD
from equimorph.manifold.geometry.setting import Setting, embed
from equimorph.manifold.geometry.tangents import split_step
from equimorph.tolerances import IN_BOX

FIRST, LEAST = 0.25, 1e-3
"""First and least step along a curve, relative to its edge."""
FARTHEST = 10.0
"""Length of a curve, relative to its edge, beyond which it is given up."""
TURNING, CORNER = 0.8, 0.01
"""Least cosine between the directions before and after a step, unless it is that short."""
OFF = 0.5
"""Farthest correction of a step, relative to it."""


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
    start, goal = (fabric.vertices.take(edge[k : k + 1]) for k in range(2))
    chord = (goal.place - start.place)[0]
    way = _direction(fabric, start, mark)
    for sign in (1.0, -1.0) if way @ chord >= 0.0 else (-1.0, 1.0):
        found = _follow(fabric, (start, goal), sign * way, mark, lowest)
        if found is not None:
            return found
    return None


def _follow(
    fabric: Fabric,
    ends: tuple[Vertices, Vertices],
    way: Float[np.ndarray, " coordinates"],
    mark: int,
    lowest: int,
) -> Vertices | None:
    """Vertex in the middle of a curve that begins in a direction, if that ends where it should."""
    at, goal = ends
    length = float(np.linalg.norm(goal.place - at.place))
    size, total = FIRST * length, 0.0
    passed: list[Vertices] = []
    places: list[float] = []
    while total < FARTHEST * length and size >= LEAST * length:
        left = (goal.place - at.place)[0]
        gap = np.linalg.norm(left)
        arriving = abs(_direction(fabric, goal, mark) @ way) >= TURNING
        if passed and gap <= 1.5 * size and left @ way >= TURNING * gap and arriving:
            halfway = int(np.abs(np.array(places) - 0.5 * (total + gap)).argmin())
            return passed[halfway]
        new = _step(fabric, at, size * way, mark, lowest)
        onward = way if new is None else _direction(fabric, new, mark)
        onward = onward * np.sign(onward @ way)
        if new is None or (onward @ way < TURNING and size > CORNER * length):
            size *= 0.5
            continue
        total += float(np.linalg.norm(new.place - at.place))
        passed.append(new)
        places.append(total)
        at, way, size = new, onward, min(1.5 * size, FIRST * length)
    return None


def _direction(fabric: Fabric, at: Vertices, mark: int) -> Float[np.ndarray, " coordinates"]:
    """Unit vector along the curve at a vertex that is alone."""
    end = replace(fabric, vertices=at).end(np.zeros((1, 2), int), 0, mark)
    return np.asarray(end.allowed[0, :, 0] @ end.rows[0])


def _step(
    fabric: Fabric, at: Vertices, step: Float[np.ndarray, " coordinates"], mark: int, lowest: int
) -> Vertices | None:
    """Vertex after a step along the curve, corrected in the plane across it."""
    setting = fabric.setting
    along = np.einsum("dc,c->d", at.rows[0], step)
    dz, dp = split_step(setting, (along @ at.frame[0])[None])
    z, p = at.z + dz, at.p + dp
    size = float(np.linalg.norm(step))
    middle, rows = embed(setting, z, p), (step / size)[None, None]
    span, around = np.eye(fabric.dimension)[None], np.full(1, size)
    aim = Aim(setting, mark == FacetMark.FOLD, mark == FacetMark.CAP, span, middle, rows)
    pinned = corrected(aim, z, p, around)
    moved = np.linalg.norm(embed(setting, pinned.z, pinned.p) - middle)
    free = pinned.p[0, setting.free]
    inside = (free >= fabric.box[0] - IN_BOX).all() and (free <= fabric.box[1] + IN_BOX).all()
    if not (pinned.found[0] and inside and moved <= OFF * size):
        return None
    count = lower_index if mark == FacetMark.FOLD else _index
    index = count(setting, pinned.z, pinned.p)
    if index[0] != lowest:
        return None
    kinds = np.array([FOLD if mark == FacetMark.FOLD else CAP])
    return vertices_of(setting, pinned.z, pinned.p, kinds, index, np.array([-1]), at.rows)


def _index(
    setting: Setting, z: Float[np.ndarray, "n size"], p: Float[np.ndarray, "n P"]
) -> Int[np.ndarray, " n"]:
    return setting.structure.index(z, p)
