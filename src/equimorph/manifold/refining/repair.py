"""Overturned cells turned upright: around them, edges are cut and slivers taken away."""

from collections.abc import Callable

import numpy as np

from equimorph.arrays import CellFlags, EdgeFlags
from equimorph.manifold.complex.marked_complex import CURVES, Fabric, FacetMark
from equimorph.manifold.queries.cusps import with_cusps_beside
from equimorph.manifold.refining.bisect import bisect, settle
from equimorph.manifold.refining.deviation import Edges, Memory, near_lost, update_edges
from equimorph.manifold.refining.patches import Patch, patch_around
from equimorph.manifold.refining.quality import (
    SHARP,
    confined_angles,
    project_against_index,
    smallest_angles,
)
from equimorph.manifold.refining.refill import flip, refill

GROWN = 4
"""How much more cells a patch may get: where edges cannot be bisected, cuts around them go on."""
WORSE = 5
"""How many more cells may be bad until a plan is given up."""
TANGLED = 8
"""Edges that deviate and cannot be bisected, beyond which a patch is not repaired."""
RINGS, NEXT = 8, 2
"""Rings of cells around overturned ones that may be changed, and that are made finer."""

Step = Callable[[Fabric, float, Memory], Fabric]
"""What is done to a fabric, given the tolerance."""


def repair(fabric: Fabric, tolerance: float, memory: Memory) -> Fabric:
    """Cells turned upright that bisection and flips have left overturned, as far as possible.

    One group after the other, with its surroundings.
    """
    tried = np.zeros(0, bool)
    bad = fabric.cells[_bad(fabric)]
    while True:
        tried = np.pad(tried, (0, len(fabric.vertices) - len(tried)))
        bad = bad[~tried[bad].all(axis=1)]  # the rest stays as it is
        if memory.lost:
            bad = bad[~near_lost(fabric, memory)[bad].any(axis=1)]
        if len(bad) == 0:
            return fabric
        near = np.zeros(len(fabric.vertices), bool)
        near[bad[0]] = True
        patch = patch_around(fabric, near, RINGS)
        # cells next to the rim, which stays, may still be turned inside another patch
        tried |= patch_around(fabric, near, RINGS // 2).inside
        out, inner = _best(patch, tolerance, memory)
        beyond = bad[~patch.inside[bad].all(axis=1)]
        bad = np.concatenate([beyond, out.cells[_bad(out)]])
        fabric = patch.replace_by(out)
        memory.learn(inner, patch.inside)


def _best(patch: Patch, tolerance: float, memory: Memory) -> tuple[Fabric, Memory]:
    """What the plans make of a patch: that with the fewest faults, and what was learnt."""
    inner = memory.among(patch.inside)
    best, fewest = (patch.fabric, inner), _faults(patch.fabric, tolerance, inner)
    plans, most = PLANS if fewest[0] <= TANGLED else (), GROWN * len(patch.fabric.cells)
    hopeless = WORSE * (1 + sum(fewest[1:]))
    for plan in plans:
        fabric, inner = patch.fabric, memory.among(patch.inside)
        if plan is MERGING:
            if any(fewest[:3]):
                continue
            fabric, inner = best[0], best[1].copy()
        for step in plan:
            if not any(fewest[1:]):
                return best
            fabric = step(with_cusps_beside(fabric, _bad(fabric)), tolerance, inner)
            fabric = settle(refill(fabric, inner, fine=True), tolerance, inner, most=most)
            faults = _faults(fabric, tolerance, inner)
            if len(fabric.cells) > most or sum(faults[1:]) > hopeless:
                break
            if faults < fewest:
                best, fewest = (fabric, inner.copy()), faults
    return best


def _bad(fabric: Fabric) -> CellFlags:
    """Cells that are overturned, look backwards, or have a small angle where that can be helped."""
    over = project_against_index(fabric.vertices, fabric.cells, fabric.cell_index)
    return np.asarray(over | fabric.looks_back(fabric.cells) | _sharp(fabric))


def _sharp(fabric: Fabric) -> CellFlags:
    """Cells with a small angle, unless they lie between curves that meet at one."""
    sharp = smallest_angles(fabric.squared) < SHARP
    if not (fabric.marks & FacetMark.CROSSING).any():
        return np.asarray(sharp)
    return np.asarray(sharp & ~confined_angles(fabric, SHARP) if sharp.any() else sharp)


def _faults(fabric: Fabric, tolerance: float, memory: Memory) -> tuple[int, int, int, int]:
    """Numbers of edges that deviate, and of cells overturned, looking backwards, and sharp."""
    deviating = int((update_edges(fabric, memory).error > tolerance).sum())
    over = int(project_against_index(fabric.vertices, fabric.cells, fabric.cell_index).sum())
    return (
        deviating,
        over,
        int(fabric.looks_back(fabric.cells).sum()),
        int(_sharp(fabric).sum()),
    )


def _as_it_is(fabric: Fabric, tolerance: float, memory: Memory) -> Fabric:
    del tolerance, memory
    return fabric


def _curves_cut(fabric: Fabric, tolerance: float, memory: Memory) -> Fabric:
    """Chords of folds and constraints that pass a vertex turn cells over."""
    del tolerance
    edges = update_edges(fabric, memory)
    return _cut(fabric, edges, _bad(fabric), (edges.marks & CURVES) > 0, memory)


def _all_cut(fabric: Fabric, tolerance: float, memory: Memory) -> Fabric:
    """All edges of bad cells and of those that touch them."""
    del tolerance
    edges, near = update_edges(fabric, memory), np.zeros(len(fabric.vertices), bool)
    near[fabric.cells[_bad(fabric)]] = True
    everything = np.ones(len(edges.ends), bool)
    return _cut(fabric, edges, near[fabric.cells].any(axis=1), everything, memory)


def _cut(
    fabric: Fabric, edges: Edges, cells: CellFlags, wanted: EdgeFlags, memory: Memory
) -> Fabric:
    """Bisect the required edges of cells, the longest first."""
    chosen = np.unique(edges.of_cells[cells])
    chosen = chosen[wanted[chosen] & ~edges.stuck[chosen]]
    chosen = chosen[np.argsort(-edges.length[chosen], kind="stable")]
    return flip(bisect(fabric, edges, chosen, memory), memory.cut)


def _finer(share: float) -> Step:
    """Bad cells and what is around them made so much finer than elsewhere."""

    def step(fabric: Fabric, tolerance: float, memory: Memory) -> Fabric:
        near = np.zeros(len(fabric.vertices), bool)
        near[fabric.cells[_bad(fabric)]] = True
        patch = patch_around(fabric, near, NEXT)
        inner = memory.among(patch.inside)
        most = GROWN * len(patch.fabric.cells)
        out = patch.replace_by(settle(patch.fabric, share * tolerance, inner, most=most))
        memory.learn(inner, patch.inside)
        return out

    return step


def _merge(short: float) -> Step:
    """Vertices merged whose distance is less than that share of the edges around."""

    def step(fabric: Fabric, tolerance: float, memory: Memory) -> Fabric:
        del tolerance
        return refill(fabric, memory, fine=True, short=short)

    return step


MERGING = (_as_it_is, *(_merge(short) for short in (0.1, 0.2, 0.4)))
"""What is done next where nothing but angles is bad."""
PLANS = (
    MERGING,
    (_as_it_is, *(3 * (_curves_cut, _all_cut))),
    MERGING,
    tuple(_finer(share) for share in (0.5, 0.25, 0.12, 0.06, 0.03, 0.015)),
)
"""Steps, one after the other, until nothing is bad; another plan if one fails. Of 102 patches the
first plan mended 11, the second 85, the third 2, the fourth 3; further plans never began."""
