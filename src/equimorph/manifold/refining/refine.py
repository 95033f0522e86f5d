"""Refinement: edges are bisected until straight cells are within a tolerance of the set.

The longest edge of a cell goes first, so that angles do not shrink from one bisection to the next
[Rivara1984]_. New vertices are predicted by the cubic that touches the tangent spaces at both ends
of the edge, and corrected orthogonally to the mean of both spaces; on folds, constraints and sides
of the box along these.

See docs/decisions.md, "Refinement bisects towards the cubic".
"""

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np

from equimorph.argument_checks import check_arguments
from equimorph.arrays import CellFlags, EdgeFlags
from equimorph.manifold.complex.audit import Audit
from equimorph.manifold.complex.description import describe_again
from equimorph.manifold.complex.equilibrium_set import EquilibriumSet, with_audit
from equimorph.manifold.complex.excerpts import fabric_of
from equimorph.manifold.complex.kept_sets import question_of_refinement, recall_set
from equimorph.manifold.complex.marked_complex import CURVES, Fabric, FacetMark
from equimorph.manifold.queries.cusps import with_cusps_beside
from equimorph.manifold.refining.bisect import bisect, part_sheets, settle
from equimorph.manifold.refining.deviation import Edges, Memory, near_lost, update_edges
from equimorph.manifold.refining.patches import Patch, patch_around
from equimorph.manifold.refining.quality import (
    SHARP,
    confined_angles,
    project_against_index,
    qualities,
    smallest_angle,
    smallest_angles,
    smallest_dihedral,
    smallest_free_angle,
)
from equimorph.manifold.refining.refill import flip, refill
from equimorph.model import Journal, Progress, Silent

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
    return fabric


def _curves_cut(fabric: Fabric, tolerance: float, memory: Memory) -> Fabric:
    """Chords of folds and constraints that pass a vertex turn cells over."""
    edges = update_edges(fabric, memory)
    return _cut(fabric, edges, _bad(fabric), (edges.marks & CURVES) > 0, memory)


def _all_cut(fabric: Fabric, tolerance: float, memory: Memory) -> Fabric:
    """All edges of bad cells and of those that touch them."""
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


TRIALS = 4
"""How often slivers of tetrahedra are taken away and edges are cut in turn."""
SHARE = {1: 1.0, 2: 0.75, 3: 2.0 / 3.0}
"""Part of the tolerance that edges may use up: inside a cell their deviations add up to 2d/(d + 1)
of the largest."""


@check_arguments
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
        Keeps the refined set when it is found; see `equilibrium_set`.

    Returns
    -------
    The refined set; its audit gives the largest remaining deviation, the number of edges that could
    not be bisected, and the smallest angle.

    Raises
    ------
    InputError
        If `accuracy` is not positive, or the journal is of something else.
    """
    compute = partial(refine_cells, eset, accuracy, progress or Silent())
    if journal is None:
        return compute()
    question = question_of_refinement(eset, accuracy)
    return recall_set(journal, question, eset.setting, eset.box, eset.fixed, compute)


def refine_cells(eset: EquilibriumSet, accuracy: float, progress: Progress) -> EquilibriumSet:
    """Return the set with cells so small that they are within a tolerance of it."""
    if len(eset.cells) == 0:
        return eset
    memory = Memory()
    fabric = refill(fabric_of(eset), memory)
    fabric = _settle_and_repair(fabric, SHARE[len(eset.names)] * accuracy, memory, progress)
    fabric = part_sheets(fabric, memory)
    edges = update_edges(fabric, memory)
    out = describe_again(eset, fabric.complex(), fabric.setting)
    quality = replace(
        out.audit,
        accuracy=accuracy,
        deviation=float(edges.error.max(initial=0.0) / SHARE[len(eset.names)]),
        unrefined=int((edges.error > SHARE[len(eset.names)] * accuracy).sum()),
        smallest_angle=smallest_angle(fabric),
        smallest_dihedral=smallest_dihedral(fabric),
        changed=eset.audit.changed + _topology_change(eset.audit, out.audit),
        smallest_free_angle=smallest_free_angle(fabric),
    )
    return with_audit(out, quality)


def _topology_change(before: Audit, after: Audit) -> int:
    """Change of the topology, which must be zero."""
    counts = np.array(
        [
            (audit.components, audit.euler_characteristic, sum(n for _, n in audit.loops))
            for audit in (before, after)
        ]
    )
    return int(np.abs(counts[0] - counts[1]).sum())


def _settle_and_repair(
    fabric: Fabric, tolerance: float, memory: Memory, progress: Progress
) -> Fabric:
    """Bisect and flip until nothing changes; then remove slivers, and begin again."""
    fabric = settle(fabric, tolerance, memory, progress)
    fabric = settle(refill(fabric, memory, fine=True), tolerance, memory, progress)
    if fabric.dimension == 1:
        return fabric
    return (_better_tetrahedra if fabric.dimension == 3 else repair)(fabric, tolerance, memory)


def _better_tetrahedra(fabric: Fabric, tolerance: float, memory: Memory) -> Fabric:
    """Remove slivers where no edge deviates afterwards; else bisect further edges, and so on."""
    best, fewest = fabric, None
    for _ in range(TRIALS):
        fabric = refill(fabric, memory, fine=True, limit=tolerance)
        # edges that come to lie on a fold may deviate from it
        fabric = settle(fabric, tolerance, memory)
        faults = (
            int((update_edges(fabric, memory).error > tolerance).sum()),
            int((qualities(fabric.vertices, fabric.cells, fabric.cell_index) < SHARP).sum()),
        )
        if fewest is not None and faults >= fewest:
            return best
        best, fewest = fabric, faults
        if not any(faults):
            return best
        fabric = settle(refill(fabric, memory, fine=True), tolerance, memory)
    return best
