"""Vertices moved along the set to where the tetrahedra around them have larger angles.

Each stays on what it lies on: a fold, a constraint, sides of the box, or where these meet. A move
is searched for in the tangent space, where the smallest angle around is a function of few numbers,
and corrected orthogonally to it.
"""

from dataclasses import dataclass, replace
from itertools import product

import numpy as np
from jaxtyping import Bool, Float, Int

from equimorph.manifold.complex.edge_points import chunks
from equimorph.manifold.complex.marked_complex import (
    ON_CAP,
    ON_FOLD,
    SIDES,
    Fabric,
    held,
    squared_sides,
)
from equimorph.manifold.complex.vertices import Vertices, vertices_of
from equimorph.manifold.geometry.exact_points import Aim, corrected, lower_index
from equimorph.manifold.geometry.points import CAP, CORNER, FOLD, REFINED
from equimorph.manifold.geometry.setting import embed
from equimorph.manifold.geometry.tangents import split_step
from equimorph.manifold.refining.collapsing import Around
from equimorph.manifold.refining.deviations import deviations
from equimorph.manifold.refining.tetrahedra import Judge, determinants, smallest_angles, worth

GAIN = np.radians(0.2)
"""Least gain of the smallest angle around a vertex."""
SHARP = np.radians(10.0)
"""Vertices of tetrahedra with smaller dihedral angles are moved."""
PASSES = 6
"""How often vertices that are left because others beside them move are tried again."""
ROUNDS, FIRST = 8, 0.25
"""Steps of the search, and the length of the first relative to the cells around."""
ALLOWED = ON_FOLD | ON_CAP | (63 * SIDES)
"""What vertices may lie on that are moved."""

Rows = Int[np.ndarray, " n"]


@dataclass(frozen=True)
class _Stars:
    """Tetrahedra around vertices, vertex by vertex, seen from there.

    row: which vertex each is around; cells: with that vertex first; products: of the sides to the
    three others; along: these sides in the directions that the vertex may take; flat: in its
    tangent space.
    """

    row: Rows
    cells: Int[np.ndarray, "n 4"]
    index: Rows
    products: Float[np.ndarray, "n 3 3"]
    along: Float[np.ndarray, "n 3 k"]
    flat: Float[np.ndarray, "n 3 3"]
    turned: Float[np.ndarray, "n k 3"]
    """The directions in the tangent space."""


def relax(
    fabric: Fabric, judge: Judge, near: Bool[np.ndarray, " V"], limit: float
) -> tuple[Fabric, Judge]:
    """Move corners of sharp tetrahedra with a corner near, where the worst around gets better.

    No edge comes that deviates from the set by more than `limit`.
    """
    sharp = (judge.of(fabric, near) < SHARP) & near[fabric.cells].any(axis=1)
    chosen = np.unique(fabric.cells[sharp])
    for _ in range(PASSES):
        marks = fabric.vertex_marks[chosen]
        free = (marks & ~ALLOWED == 0) & (fabric.vertices.shared[chosen] < 0)
        chosen, marks = chosen[free], marks[free]
        if len(chosen) == 0:
            break
        around = Around(fabric.cells, len(fabric.vertices))
        old, parts = [], []
        for own in chunks(np.arange(len(chosen)), marks):
            found, vertices = _moved(fabric, judge, around, chosen[own], int(marks[own[0]]))
            old.append(chosen[own[found]])
            parts.append(vertices)
        fabric, judge, chosen = _best(fabric, judge, around, (np.concatenate(old), parts), limit)
    return fabric, judge


def _moved(
    fabric: Fabric, judge: Judge, around: Around, chosen: Rows, mark: int
) -> tuple[Bool[np.ndarray, " n"], Vertices]:
    """Vertices with a mark where the angles around are larger, and which of them were found."""
    setting, store, d = fabric.setting, fabric.vertices, fabric.dimension
    none = np.zeros(len(chosen), bool)
    pairs = np.repeat(chosen[:, None], 2, axis=1)
    allowed = fabric.end(pairs, 0, mark).allowed
    if allowed.shape[2] == 0:
        return none, store.take(chosen[none])
    rows = np.swapaxes(allowed, 1, 2) @ store.rows[chosen]
    step = _search(_stars(fabric, judge, around, chosen, (allowed, rows)), len(chosen))
    far = np.linalg.norm(step, axis=1) > 0.0
    chosen, allowed, rows, step = chosen[far], allowed[far], rows[far], step[far]
    own = np.einsum("ndk,nk->nd", allowed, step)
    dz, dp = split_step(setting, np.einsum("nd,ndf->nf", own, store.frame[chosen]))
    z, p = store.z[chosen] + dz, store.p[chosen] + dp
    keep = held(mark, d)
    for k in keep:
        p[:, setting.free[k]] = store.p[chosen, setting.free[k]]
    span = np.tile(np.delete(np.eye(d), keep, axis=0), (len(chosen), 1, 1))
    fold, cap = bool(mark & ON_FOLD), bool(mark & ON_CAP)
    aim = Aim(setting, fold, cap, span, embed(setting, z, p), rows)
    aim = aim if keep else replace(aim, tangents=store.rows[chosen])
    pinned = corrected(aim, z, p, np.linalg.norm(step, axis=1))
    free, found = pinned.p[:, setting.free], pinned.found
    found &= ((free >= fabric.box[0]) & (free <= fabric.box[1])).all(axis=1)
    index = store.index[chosen]
    states = pinned.z[found], pinned.p[found]
    counted = lower_index(setting, *states) if fold else setting.structure.index(*states)
    found[found] = counted == index[found]
    kind = {(False, False): REFINED, (True, False): FOLD, (False, True): CAP, (True, True): CORNER}
    some = int(found.sum())
    states, others = (pinned.z[found], pinned.p[found]), (index[found], np.full(some, -1))
    kinds, planes = np.full(some, kind[fold, cap]), store.rows[chosen[found]]
    none[np.flatnonzero(far)[found]] = True
    return none, vertices_of(setting, states, kinds, others, planes)


def _stars(
    fabric: Fabric,
    judge: Judge,
    around: Around,
    chosen: Rows,
    directions: tuple[Float[np.ndarray, "n 3 k"], Float[np.ndarray, "n k coordinates"]],
) -> _Stars:
    """Tetrahedra around vertices that may take some directions."""
    row, cell = around.of(chosen)
    cells = fabric.cells[cell]
    at = np.argmax(cells == chosen[row, None], axis=1)
    # even permutations that bring each corner to the front
    order = np.array([[0, 1, 2, 3], [1, 0, 3, 2], [2, 0, 1, 3], [3, 0, 2, 1]])[at]
    cells = np.take_along_axis(cells, order, axis=1)
    place, store = judge.place, fabric.vertices
    sides = place[cells[:, 1:]] - place[cells[:, :1]]
    flat = sides @ np.swapaxes(store.rows[chosen[row]], 1, 2)
    flat[:, :, 0] *= judge.upright[chosen[row], None]
    turned = np.swapaxes(directions[0], 1, 2)[row].copy()
    turned[:, :, 0] *= judge.upright[chosen[row], None]
    along = sides @ np.swapaxes(directions[1][row], 1, 2)
    products = sides @ np.swapaxes(sides, 1, 2)
    index = fabric.cell_index[cell]
    return _Stars(row, cells, index, products, along, flat, turned)


def _search(stars: _Stars, count: int) -> Float[np.ndarray, "n k"]:
    """Steps after which the smallest angle around each vertex is largest, as far as it is found."""
    k = stars.along.shape[2]
    ways = np.array([way for way in product((-1, 0, 1), repeat=k) if any(way)], float)
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    if k == 3:
        ways = ways[np.abs(ways).max(axis=1) != np.sqrt(0.5)]
    first = np.searchsorted(stars.row, np.arange(count))
    squared = np.einsum("nii->ni", stars.products)
    reach = FIRST * np.sqrt(np.minimum.reduceat(squared.max(axis=1), first))
    step = np.zeros((count, k))
    best = worth(_angles(stars, step[None])[0], first)
    for _ in range(ROUNDS):
        trials = step + reach[:, None] * ways[:, None]
        found = np.stack([worth(each, first) for each in _angles(stars, trials)])
        own = found.argmax(axis=0)
        better = found.max(axis=0) > best
        best = np.where(better, found.max(axis=0), best)
        step = np.where(better[:, None], step + reach[:, None] * ways[own], step)
        reach = np.where(better, reach, 0.5 * reach)
    return step


def _angles(stars: _Stars, steps: Float[np.ndarray, "ways n k"]) -> Float[np.ndarray, "ways T"]:
    """Smallest angle of each tetrahedron after steps of the vertices; if turned, how far, negative.

    As the volume relative to that of three sides at right angles.
    """
    s = steps[:, stars.row]
    dots = np.einsum("nik,wnk->wni", stars.along, s)
    size = np.einsum("wnk,wnk->wn", s, s)
    g = stars.products - dots[..., :, None] - dots[..., None, :] + size[..., None, None]
    g = g.reshape(-1, 3, 3)
    a, b, c = g[:, 0, 0], g[:, 1, 1], g[:, 2, 2]
    lengths = [a, b, c, a + b - 2 * g[:, 0, 1], a + c - 2 * g[:, 0, 2], b + c - 2 * g[:, 1, 2]]
    angle = smallest_angles(np.stack(lengths, axis=1))
    flat = stars.flat - np.einsum("wnk,nkd->wnd", s, stars.turned)[:, :, None]
    volume = determinants(flat.reshape(-1, 3, 3)) / np.sqrt(np.maximum(a * b * c, 1e-300))
    return np.where(volume > 0.0, angle, volume).reshape(len(steps), -1)


def _best(
    fabric: Fabric, judge: Judge, around: Around, moved: tuple[Rows, list[Vertices]], limit: float
) -> tuple[Fabric, Judge, Rows]:
    """Those moves carried out that help, the best first, with stars that do not overlap.

    And the vertices of those that help but do.
    """
    old, parts = moved
    if len(old) == 0:
        return fabric, judge, old
    base = len(fabric.vertices)
    more = replace(fabric, vertices=fabric.vertices.joined(*parts))
    judge = Judge(more, np.concatenate([judge.upright, judge.upright[old]]))
    row, cell = around.of(old)
    before, new = fabric.cells[cell], fabric.cells[cell].copy()
    new[new == old[row, None]] = (base + row)[(new == old[row, None]).any(axis=1)]
    index = fabric.cell_index[cell]
    first = np.searchsorted(row, np.arange(len(old)))
    worths = [worth(judge.qualities(each, index), first) for each in (before, new)]
    gain = worths[1] - worths[0]
    if np.isfinite(limit):
        ends = np.concatenate([new[:, [i, j]] for i in range(4) for j in range(i + 1, 4)])
        mine = np.tile(row, 6)
        fresh = (ends >= base).any(axis=1)
        ends, mine = ends[fresh], mine[fresh]
        olds = np.sort(np.where(ends >= base, old[np.maximum(ends - base, 0)], ends), axis=1)
        errors = deviations(more, np.sort(ends, axis=1), fabric.edge_marks(olds))
        gain[mine[errors > limit]] = -1.0
    order = np.argsort(-gain, kind="stable")
    taken, target, left = np.zeros(base, bool), np.arange(len(more.vertices)), []
    ends = np.append(first, len(row))
    for number in order[gain[order] > GAIN].tolist():
        star = before[ends[number] : ends[number + 1]].ravel()
        if taken[star].any():
            left.append(number)
            continue
        taken[star] = True
        target[old[number]] = base + number
    cells, squared = target[fabric.cells], fabric.squared.copy()
    new = (cells >= base).any(axis=1)
    squared[new] = squared_sides(more.vertices.place, cells[new])
    facets = target[fabric.facets]
    return replace(more, cells=cells, squared=squared, facets=facets), judge, old[left]
