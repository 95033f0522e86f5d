"""Refill: stars of edges and vertices are filled again where their cells get better.

Candidates are the flip of an edge (triangles), the best filling of the ring around an edge and
three cells in place of two around a facet (tetrahedra) [Freitag1997]_, the collapse of a vertex
into one of its neighbours, and the same star with its vertex moved along the set. One rule decides
about all of them: there must be fewer poor cells or a better worst one, no edge that deviates from
the set by more than a limit, and none that was bisected before. Marked facets (folds, constraints,
crossings, sides of the box) and the rim of a patch stay what they are.

See docs/decisions.md, "One rule for refills".
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from equimorph.arrays import Bool, Edges, Float, VertexFlags
from equimorph.manifold.complex.marked_complex import TETRAHEDRA, TRIANGLES, Fabric
from equimorph.manifold.geometry.topology import among, keys_of, rows_of
from equimorph.manifold.refining.deviation import Memory, deviations
from equimorph.manifold.refining.edge_stars import reconnections
from equimorph.manifold.refining.kernels import flip_edges
from equimorph.manifold.refining.patches import small_patch
from equimorph.manifold.refining.quality import qualities, qualities_near
from equimorph.manifold.refining.stars import GAIN, Quality, Refills, gains, hopeful, with_exact
from equimorph.manifold.refining.vertex_stars import collapses, moves

ROUNDS = {2: (2, 3), 3: (6, 12)}
"""How often all candidates are tried in turn, around what changed, by the dimension; for coarse and
for fine cells."""
RECONNECTIONS, COLLAPSES, MOVES = 20, 3, 6
"""How often candidates of a kind are looked for in a round, as long as some help."""
STEEPER = 1e-3
"""Least gain of a flip: minus the sum of the cotangents of both opposite angles."""
OPPOSITE = np.array([[1, 2], [2, 0], [0, 1]])
"""The other corners of triangles."""
SHORT = 0.05
"""Ratio of the lengths of two edges of a triangle below which the shorter one counts as poor."""

Near = VertexFlags
NewNear = Bool[np.ndarray, " new_vertices"]
NewQuality = Float[np.ndarray, " new_cells"]
Candidates = Callable[[Fabric, Quality, Near], Refills]
"""Refills that could be done, of fabric, qualities of its cells and vertices to look at."""


def refill(
    fabric: Fabric,
    memory: Memory,
    limit: float = np.inf,
    *,
    fine: bool = False,
    short: float = SHORT,
) -> Fabric:
    """Refill stars as long as cells get better; no edge comes that deviates by more than `limit`.

    Where cells are `fine` already, vertices are moved, too, and edges collapsed that are shorter
    than a share `short` of their neighbours: on coarse cells these may keep two folds apart.
    """
    if fabric.dimension < TRIANGLES:
        return fabric
    near = np.ones(len(fabric.vertices), bool)
    touched = ~near
    for _ in range(ROUNDS[fabric.dimension][fine]):
        patch = small_patch(fabric, np.flatnonzero(near))
        part = fabric if patch is None else patch.fabric
        part, near = _refill_once(part, memory, limit, near, short if fine else None)
        fabric = part if patch is None else patch.replace_by(part)
        touched = _extend(touched, fabric) | near
        if not near.any():
            break
    memory.forget(touched)
    return fabric


def _refill_once(
    fabric: Fabric, memory: Memory, limit: float, near: Near, short: float | None
) -> tuple[Fabric, NewNear]:
    """Try all candidates around some vertices, one kind after the other; and what changed.

    `short` is None where cells are not fine.
    """
    fabric, changed = _reconnect(fabric, memory)
    quality = qualities_near(fabric, near | changed)
    for candidates, passes in _kinds(fabric, memory, short):
        found = repeat(candidates, passes, fabric, quality, near, memory, limit)
        fabric, quality, own = found
        near, changed = _extend(near, fabric), _extend(changed, fabric) | own
    return fabric, changed


def _reconnect(fabric: Fabric, memory: Memory) -> tuple[Fabric, Near]:
    """Flip edges of triangles; and the corners of the cells that this changed."""
    changed = np.zeros(len(fabric.vertices), bool)
    if fabric.dimension == TRIANGLES:
        before = fabric.cells
        fabric = flip(fabric, memory.past_edges(fabric)[0])
        changed[fabric.cells[(fabric.cells != before).any(axis=1)]] = True
    return fabric, changed


def _kinds(fabric: Fabric, memory: Memory, short: float | None) -> list[tuple[Candidates, int]]:
    """Functions that return candidates, and how often each is called in a round."""
    but, _ = memory.past_edges(fabric)
    rings = partial(reconnections, but=but)
    return [
        *([(rings, RECONNECTIONS)] if fabric.dimension == TETRAHEDRA else []),
        (partial(collapses, short=short or 0.0), COLLAPSES),
        *([(moves, MOVES)] if short is not None else []),
    ]


def repeat(
    candidates: Candidates,
    passes: int,
    fabric: Fabric,
    quality: Quality,
    near: Near,
    memory: Memory,
    limit: float,
) -> tuple[Fabric, NewQuality, NewNear]:
    """Apply the best candidates again and again, around what changed before; and what changed."""
    changed = np.zeros(len(fabric.vertices), bool)
    for _ in range(passes):
        best = _best(candidates(fabric, quality, near), quality, memory, limit)
        refills, come = best.refills, best.come
        # vertices that were found stay, even if unused: what follows would copy all others
        fabric = refills.fabric
        if refills.count == 0:
            break
        near = best.beaten
        near[fabric.cells[refills.gone]] = True
        near[refills.come] = True
        changed = _extend(changed, fabric) | near
        fabric, quality = _apply(refills, quality, come)
    return fabric, quality, _extend(changed, fabric)


def _extend(near: Bool[np.ndarray, " old"], fabric: Fabric) -> NewNear:
    """Flags of vertices, false for those added since."""
    return np.pad(near, (0, len(fabric.vertices) - len(near)))


@dataclass(frozen=True)
class _Best:
    """Refills that help, with the qualities of the cells that come; and vertices of the beaten.

    beaten: corners of the stars of other refills that help, too, and overlap with these.
    """

    refills: Refills
    come: Float[np.ndarray, " come"]
    beaten: Near


def _best(refills: Refills, quality: Quality, memory: Memory, limit: float) -> _Best:
    """Refills that help, the best first, with stars that do not overlap."""
    quality = with_exact(refills, quality)
    refills = refills.take(hopeful(refills, quality))
    come = qualities(refills.fabric.vertices, refills.come, refills.index)
    gain = gains(refills, quality, come)
    kept = gain > GAIN
    come, gain, refills = come[kept[refills.come_row]], gain[kept], refills.take(kept)
    allowed = _admissible(refills, memory, limit)
    kept = _apart(refills, np.where(allowed, gain, -1.0))
    beaten = np.zeros(len(refills.fabric.vertices), bool)
    beaten[refills.fabric.cells[refills.gone[(allowed & ~kept)[refills.gone_row]]]] = True
    return _Best(refills.take(kept), come[kept[refills.come_row]], beaten)


def _admissible(refills: Refills, memory: Memory, limit: float) -> Bool[np.ndarray, " refills"]:
    """Whether no edge comes that was bisected, while its vertex stays, or deviates too much."""
    fabric, base = refills.fabric, len(refills.fabric.vertices)
    row, key = refills.new_edges
    good, near = np.ones(refills.count, bool), np.zeros(base, bool)
    near[rows_of(key, base, 2)] = True
    cut, on_edge = memory.past_edges(fabric, near)
    order = np.argsort(keys_of(cut, base))
    known, on_edge = keys_of(cut, base)[order], on_edge[order]
    back = np.flatnonzero(among(key, known))
    good[row[back[~refills.vanishes(row[back], on_edge[np.searchsorted(known, key[back])])]]] = (
        False
    )
    if np.isfinite(limit):
        kept = good[row]
        row, key = row[kept], key[kept]
        error = deviations(fabric, rows_of(key, base, 2), refills.edge_marks(row, key))
        good[row[error > limit]] = False
    return good


def _apart(refills: Refills, gain: Float[np.ndarray, " refills"]) -> Bool[np.ndarray, " refills"]:
    """Refills with some gain, the best first, without those that touch what an earlier one does."""
    row, claims = refills.claims
    order = np.argsort(row, kind="stable")
    ends = np.searchsorted(row[order], np.arange(refills.count + 1))
    _, claims = np.unique(claims[order], return_inverse=True)
    touched, kept = np.zeros(len(claims), bool), np.zeros(refills.count, bool)
    best = np.argsort(-gain, kind="stable")
    for number in best[gain[best] > 0.0].tolist():
        own = claims[ends[number] : ends[number + 1]]
        if not touched[own].any():
            touched[own] = True
            kept[number] = True
    return kept


def _apply(
    refills: Refills, quality: Quality, come: Float[np.ndarray, " come"]
) -> tuple[Fabric, NewQuality]:
    """Fabric and qualities of its cells after some refills."""
    fabric = refills.fabric
    stays, left = np.ones(len(fabric.cells), bool), np.ones(len(fabric.facets), bool)
    stays[refills.gone] = False
    left[refills.lost] = False
    fabric = replace(
        fabric,
        cells=np.concatenate([fabric.cells[stays], refills.come]),
        cell_index=np.concatenate([fabric.cell_index[stays], refills.index]),
        squared=np.concatenate([fabric.squared[stays], refills.squared]),
        facets=np.concatenate([fabric.facets[left], refills.new]),
        marks=np.concatenate([fabric.marks[left], refills.marks]),
    )
    return fabric, np.concatenate([quality[stays], come])


def flip(fabric: Fabric, but: Edges | None = None, since: int = 0) -> Fabric:
    """Flip edges of triangles whose opposite angles add up to more than π, if nothing folds over.

    And those whose flip leaves fewer cells overturned, whatever the angles. Edges between the pairs
    of vertices `but` do not come into being. Where nothing was left to be flipped before the
    vertices from the number `since` on were added, only their surroundings are looked at.
    """
    cells, squared = fabric.cells.copy(), fabric.squared.copy()
    fixed = fabric.facets
    if but is not None:
        near = np.zeros(len(fabric.vertices), bool)
        near[cells] = True
        fixed = np.concatenate([fixed, but[near[but[:, 0]] & near[but[:, 1]]]])
    place, rows = fabric.vertices.place, fabric.vertices.rows
    flat = np.ascontiguousarray(place[:, -TRIANGLES:])
    sense = np.where(fabric.cell_index % 2 == 0, 1, -1)
    parts = (fabric.cell_index, sense, np.ascontiguousarray(fixed), place, rows, flat, OPPOSITE)
    count = flip_edges(cells, squared, *parts, STEEPER, since)
    return replace(fabric, cells=cells, squared=squared) if count else fabric
