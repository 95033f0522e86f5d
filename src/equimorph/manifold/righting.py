"""Overturned cells turned upright: around them, edges are cut and slivers taken away."""

import numpy as np
from jaxtyping import Bool

from equimorph.manifold.corners import squeezed
from equimorph.manifold.cusp_points import with_cusps_beside
from equimorph.manifold.deviations import Memory, known, near_lost
from equimorph.manifold.fabric import CURVES, ON_CROSSING, Fabric
from equimorph.manifold.patches import Patch, patch_around
from equimorph.manifold.settling import bisected, settled, tidied
from equimorph.manifold.smoothing import SHARP
from equimorph.manifold.surgery import angles, flip

PLANS = (3 * (False, True), 6 * (True,))
"""Whether all edges around overturned cells are cut, round by round, or only folds and constraints;
another plan if one fails."""
GROWN = 4
"""How much more cells a patch may get: where edges cannot be bisected, cuts around them go on."""
TANGLED = 8
"""Edges that deviate and cannot be bisected, beyond which a patch is left alone."""
RINGS = 8
"""Rings of cells around overturned ones that may be changed."""


def righted(fabric: Fabric, tolerance: float, memory: Memory) -> Fabric:
    """Cells turned upright that bisection and flips have left overturned, as far as possible.

    One group after the other, with what is around it.
    """
    tried = np.zeros(len(fabric.vertices), bool)
    bad = fabric.cells[_bad(fabric)]
    if memory.lost:
        bad = bad[~near_lost(fabric, memory)[bad].any(axis=1)]
    while True:
        bad = bad[~tried[bad].all(axis=1)]  # the others stay as they are
        if len(bad) == 0:
            return fabric
        near = np.zeros(len(fabric.vertices), bool)
        near[bad[0]] = True
        patch = patch_around(fabric, near, RINGS)
        out, inner = _best(patch, tolerance, memory)
        fabric = patch.replaced(out)
        memory.learn(inner, patch.inside)
        tried |= patch.inside[: len(tried)]


def _best(patch: Patch, tolerance: float, memory: Memory) -> tuple[Fabric, Memory]:
    """What the plans make of a patch: that with the fewest faults, and what was learnt."""
    inner = memory.among(patch.inside)
    best, fewest = (patch.fabric, inner), _faults(patch.fabric, tolerance, inner)
    plans = PLANS if fewest[0] <= TANGLED else ()
    for plan in plans:
        fabric, inner = patch.fabric, memory.among(patch.inside)
        for widely in plan:
            if not any(fewest[1:]):
                return best
            if len(fabric.cells) > GROWN * len(patch.fabric.cells):
                break
            fabric = with_cusps_beside(fabric, _bad(fabric))
            fabric = settled(tidied(fabric, inner, fine=True), tolerance, inner)
            faults = _faults(fabric, tolerance, inner)
            if faults < fewest:
                best, fewest = (fabric, inner.copy()), faults
            fabric = _cut_around(fabric, inner, widely)
    return best


def _bad(fabric: Fabric) -> Bool[np.ndarray, " C"]:
    """Cells that are overturned, look backwards, or have a small angle where that can be helped."""
    over = fabric.overturned(fabric.cells, fabric.sense)
    return np.asarray(over | fabric.backward() | _sharp(fabric))


def _sharp(fabric: Fabric) -> Bool[np.ndarray, " C"]:
    """Cells with a small angle, unless they lie between curves that meet at one."""
    sharp = angles(fabric) < SHARP
    if not (fabric.marks & ON_CROSSING).any():
        return np.asarray(sharp)
    return np.asarray(sharp & ~squeezed(fabric, SHARP) if sharp.any() else sharp)


def _faults(fabric: Fabric, tolerance: float, memory: Memory) -> tuple[int, int, int, int]:
    """Numbers of edges that deviate, and of cells overturned, looking backwards, and sharp."""
    deviating = int((known(fabric, memory).error > tolerance).sum())
    over = int(fabric.overturned(fabric.cells, fabric.sense).sum())
    return deviating, over, int(fabric.backward().sum()), int(_sharp(fabric).sum())


def _cut_around(fabric: Fabric, memory: Memory, widely: bool) -> Fabric:
    """Edges cut on folds and constraints: chords of these that pass a vertex turn cells over.

    If not `widely`; else all edges of overturned cells and of those that touch them.
    """
    edges = known(fabric, memory)
    cells = _bad(fabric)
    wanted = (edges.marks & CURVES) > 0
    if widely:
        near = np.zeros(len(fabric.vertices), bool)
        near[fabric.cells[cells]] = True
        cells, wanted = near[fabric.cells].any(axis=1), np.ones_like(wanted)
    chosen = np.unique(edges.of_cells[cells])
    chosen = chosen[wanted[chosen] & ~edges.stuck[chosen]]
    chosen = chosen[np.argsort(-edges.length[chosen], kind="stable")]
    return flip(bisected(fabric, edges, chosen, memory), memory.cut)
