"""`equilibrium_set`: lift a grid, close the loops, and check what came out."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Int

from equimorph.errors import InputError
from equimorph.manifold.accounting import account
from equimorph.manifold.bisection import bisect
from equimorph.manifold.cells import CellFinder, Cells
from equimorph.manifold.completeness import check, seeds_from
from equimorph.manifold.crossing_curves import flood_crossings
from equimorph.manifold.equilibrium_set import EquilibriumSet
from equimorph.manifold.flooding import flood
from equimorph.manifold.mesh import Lines, coarse_grid, grid_lines, grid_mesh
from equimorph.manifold.pairing import Pairing, Setting, start_pairing
from equimorph.manifold.refinement import check_accuracy, refine
from equimorph.manifold.seeds import Seeds, is_symmetric, seeds
from equimorph.model import (
    Box,
    Constraint,
    Progress,
    Silent,
    parameter_vector,
    position,
)
from equimorph.structures import Structure

COARSE = {1: 12, 2: 12, 3: 7}
"""Most intervals along each parameter of the coarse grid over which seeds are spread."""
BISECTIONS = {1: 12, 2: 24, 3: 60}
"""Rounds by the number of free parameters: each cuts the longest edges of doubtful cells."""
GRIDS = 3
"""Grids that are tried, each with twice the intervals, until refinement succeeds everywhere."""
CHEAP = 4
"""Times the independent checks in diagrams over one parameter, and in symmetric slices."""
SEARCHES = 4
"""Rounds of independent checks; what one round finds missing is lifted before the next."""
HOPELESS = 50
"""Doubtful grid cells, and four times what there were at first, beyond which bisection ends."""

INTERVALS = {1: (200,), 2: (47, 81), 3: (24, 24, 24)}
"""Of the grid, by the number of free parameters, if not given."""


def equilibrium_set(  # noqa: PLR0913  # the knobs of the public face, all by keyword
    structure: Structure,
    box: Box,
    *,
    fixed: Mapping[str, float] | None = None,
    within: Sequence[Constraint] = (),
    intervals: tuple[int, ...] | None = None,
    seed: int = 0,
    checks: int = 2,
    accuracy: float | None = None,
    progress: Progress | None = None,
) -> EquilibriumSet:
    """All equilibria over a box in one to three parameters that are connected to the seeds.

    Sheet lifting: equilibria at both ends of every grid edge are paired by lifting the edge;
    around each triangle the curves close into loops that bound discs of the set; around each
    tetrahedron the discs close into spheres that bound balls. Folds and constraints carry exact
    vertices. Seeds: natural states over a coarse grid, and random search.

    Parameters
    ----------
    box
        Ranges of the one, two or three free parameters.
    fixed
        Values of other parameters; those not named keep their defaults.
    within
        Constraints that cut the set off, like ``[arch.max_curvature <= 20]``.
    intervals
        Grid intervals along each parameter; see `INTERVALS` for the defaults.
    seed
        Of the random generator; the result is deterministic.
    checks
        Random points, half of them below the set, half anywhere in the box, at which an independent
        search looks for equilibria that the set lacks. They are added and lifted like seeds, and
        other points are checked, until nothing is missing or four rounds are over. Four times as
        many in diagrams over one parameter and in symmetric slices.
    accuracy
        Largest distance of the straight cells from the set, in the metric, to which the set is
        refined (see `refine`); it is left as it was lifted if not given. If some edges cannot be
        bisected the grid is too coarse: one of twice the intervals is lifted, at most twice.
    progress
        Sink for progress reports.

    Returns
    -------
    The set with its audit; look at ``audit.clean``.

    Raises
    ------
    InputError
        For a box in more than three parameters, unknown names, parameters both free and fixed,
        values without meaning, or an accuracy that is not positive.
    """
    progress = progress or Silent()
    if accuracy is not None:
        check_accuracy(accuracy)
    intervals = _intervals(box, intervals)
    setting = _setting(structure, box, fixed or {}, tuple(within))
    for number in range(GRIDS):
        eset = _of_grid(setting, (box, dict(fixed or {}), intervals), (seed, checks), progress)
        if accuracy is None:
            break
        eset = refine(eset, accuracy, progress)
        if eset.audit.unrefined == 0 or number == GRIDS - 1:
            break
        # odd numbers stay odd, which keeps lines of symmetry off the grid
        intervals = tuple(2 * n + n % 2 for n in intervals)
    return eset


def _of_grid(
    setting: Setting,
    given: tuple[Box, Mapping[str, float], tuple[int, ...]],
    effort: tuple[int, int],
    progress: Progress,
) -> EquilibriumSet:
    """Set over a grid, with checks.

    `given` are box, fixed values and intervals; `effort` the random seed and the number of checks.
    """
    box, _, intervals = given
    seed, checks = effort
    lines = grid_lines(box, intervals, _off_zero(setting))
    progress.report("seeds", 0, 1)
    pairing = start_pairing(setting, grid_mesh(lines))
    pairing.points.over_vertices(*_spread(setting, lines, seed, progress))
    generator = np.random.default_rng([seed, 1])
    recovered = 0
    finder = CellFinder()
    for number in range(SEARCHES):
        pairing.fit()
        cells, bisected = _lifted(pairing, finder, progress)
        eset = account(pairing, cells, given, bisected)
        found = check(eset, generator, _checks(checks, setting), progress)
        if found.lacking == 0 or number == SEARCHES - 1:
            break
        recovered += found.lacking
        pairing.points.over_vertices(*seeds_from(setting, pairing.mesh, found.missing))
    audit = replace(eset.audit, checked=found.found, missing=found.lacking, recovered=recovered)
    return replace(eset, audit=audit)


def _checks(checks: int, setting: Setting) -> int:
    """Points at which is checked: more where that is cheap, and where pieces hang together less."""
    return checks * (CHEAP if len(setting.free) == 1 or is_symmetric(setting) else 1)


def _intervals(box: Box, intervals: tuple[int, ...] | None) -> tuple[int, ...]:
    d = len(box.names)
    if d not in INTERVALS:
        raise InputError(
            f"`box` must have one, two or three parameters; got {d} ({', '.join(box.names)})."
        )
    if intervals is None:
        return INTERVALS[d]
    if len(intervals) != d or any(int(n) != n or n < 2 for n in intervals):
        number = ("one whole number", "two whole numbers", "three whole numbers")[d - 1]
        raise InputError(f"`intervals` must be {number} >= 2; got {intervals!r}.")
    return tuple(map(int, intervals))


def _setting(
    structure: Structure,
    box: Box,
    fixed: Mapping[str, float],
    within: tuple[Constraint, ...],
) -> Setting:
    both = set(box.names) & set(fixed)
    if both:
        raise InputError(f"`fixed` must not name a parameter of the box; got {', '.join(both)}.")
    free = np.array([position(structure.parameters, name) for name in box.names])
    for corner in (box.lower, box.upper):
        values = dict(zip(box.names, corner.tolist(), strict=True))
        base = parameter_vector(structure.parameters, {**fixed, **values})
    return Setting(structure, base, free, within)


def _off_zero(setting: Setting) -> tuple[bool, ...]:
    """Free parameters whose zero no line of the grid may hold: all.

    There much is symmetric, declared or not: a structure whose load is none may be its own image.
    """
    return (True,) * len(setting.free)


def _lifted(pairing: Pairing, finder: CellFinder, progress: Progress) -> tuple[Cells, int]:
    """Flood, close, assemble; bisect what is not certain and go on."""
    bisected = first = 0
    rounds = BISECTIONS[pairing.mesh.dimension]
    for number in range(rounds):
        flood_crossings(pairing, progress)
        progress.report("closing loops", 0, 1)
        cells = finder.find(pairing)
        doubtful = cells.doubtful
        first = doubtful if number == 0 else first
        # along a line where the set is singular doubt only multiplies; elsewhere it vanishes
        hopeless = doubtful > max(HOPELESS, 4 * first)
        if doubtful == 0 or hopeless or number == rounds - 1:
            break
        bisected += doubtful
        longest = _longest_edges(pairing, cells)
        pairing.use_mesh(bisect(pairing.mesh, longest, _off_zero(pairing.setting)))
    return cells, bisected


def _spread(setting: Setting, lines: Lines, seed: int, progress: Progress) -> Seeds:
    """Seeds, spread over a coarse grid in a box somewhat larger than that of the fine grid.

    So the flood of the fine grid starts everywhere at once, with many edges at a time, and on
    pieces, too, that hang together only beyond the box.
    """
    mesh, number = coarse_grid(lines, COARSE[len(lines)], setting.limits)
    pairing = start_pairing(setting, mesh)
    pairing.points.over_vertices(*seeds(setting, mesh, np.flatnonzero(number >= 0), seed))
    flood(pairing, progress)
    store = pairing.points
    vertex = store.vertex[: store.count]
    found = np.flatnonzero((vertex >= 0) & (number[vertex] >= 0))
    return number[vertex[found]], store.z[found], store.p[found], store.index[found]


def _longest_edges(pairing: Pairing, cells: Cells) -> Int[np.ndarray, " n"]:
    """Longest edge of each doubtful grid cell, relative to the box."""
    mesh = pairing.mesh
    size = np.ptp(mesh.vertices, axis=0)
    around = mesh.faces[cells.doubtful_tetrahedra]
    groups = [
        mesh.sides[cells.doubtful_triangles],
        mesh.sides[around].reshape(len(around), 12),
    ]
    longest = []
    for sides in groups:
        ends = mesh.vertices[mesh.edges[sides]] / size
        length = np.linalg.norm(ends[:, :, 0] - ends[:, :, 1], axis=2)
        longest.append(sides[np.arange(len(sides)), length.argmax(axis=1)])
    return np.unique(np.concatenate(longest))
