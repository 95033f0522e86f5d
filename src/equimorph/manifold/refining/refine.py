"""Refinement: edges are bisected until straight cells are within a tolerance of the set.

The longest edge of a cell goes first, so that angles do not shrink from one bisection to the next
[Rivara1984]_. New vertices are predicted by the cubic that touches the tangent spaces at both ends
of the edge, and corrected orthogonally to the mean of both spaces; on folds, constraints and sides
of the box along these.

See docs/decisions.md, "Refinement bisects towards the cubic".
"""

from dataclasses import replace
from functools import partial

import numpy as np

from equimorph.argument_checks import check_arguments
from equimorph.manifold.complex.audit import Audit
from equimorph.manifold.complex.description import describe_again
from equimorph.manifold.complex.equilibrium_set import EquilibriumSet
from equimorph.manifold.complex.kept_sets import question_of_refinement, recall_set
from equimorph.manifold.complex.marked_complex import Fabric, fabric_of
from equimorph.manifold.refining.bisect import part_sheets, settle
from equimorph.manifold.refining.deviation import Memory, update_edges
from equimorph.manifold.refining.quality import (
    SHARP,
    qualities,
    smallest_angle,
    smallest_dihedral,
    smallest_free_angle,
)
from equimorph.manifold.refining.refill import refill
from equimorph.manifold.refining.repair import repair
from equimorph.model import Journal, Progress, Silent

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
        changed=_topology_change(eset.audit, out.audit),
        smallest_free_angle=smallest_free_angle(fabric),
    )
    return replace(out, audit=quality)


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
