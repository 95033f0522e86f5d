"""`equilibrium_set`: lift a grid, close the loops, and check what came out."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from equimorph.argument_checks import check_arguments
from equimorph.arrays import Place
from equimorph.manifold.complex.description import Frame, wrong_cells
from equimorph.manifold.complex.equilibrium_set import EquilibriumSet, with_audit
from equimorph.manifold.complex.kept_sets import Effort, question_of_set, recall_set
from equimorph.manifold.geometry.setting import Setting
from equimorph.manifold.lifting.cells import CellFinder, Cells, Outlook, account
from equimorph.manifold.lifting.completeness import Check, check, recover
from equimorph.manifold.lifting.crossing_branches import flood_crossings, ring_middles
from equimorph.manifold.lifting.endless import refuse_copies
from equimorph.manifold.lifting.flood import flood
from equimorph.manifold.lifting.grid import (
    Lines,
    bisect,
    grid_lines,
    grid_mesh,
    longest_edges,
)
from equimorph.manifold.lifting.hidden_islands import IslandFinder
from equimorph.manifold.lifting.layers import find_through_layers
from equimorph.manifold.lifting.pairing import Pairing, start_pairing
from equimorph.manifold.lifting.seeds import is_symmetric
from equimorph.manifold.lifting.spread import begun_without_copies, spread_seeds
from equimorph.manifold.lifting.strips import strips_astray
from equimorph.manifold.lifting.tile_rounds import TileRounds
from equimorph.manifold.lifting.tiles import cuts_between
from equimorph.manifold.lifting.twists import lift_between
from equimorph.manifold.lifting.unseen import UnseenFinder
from equimorph.manifold.question import intervals_of, limit_of, setting_of, tiles_of
from equimorph.manifold.refining.refine import refine_cells
from equimorph.manifold.sides import box_of, is_stuck_at_sides, trimmed, widened
from equimorph.model import Box, Constraint, Journal, Progress, Silent, Workers
from equimorph.structures import Structure

BISECTIONS = {1: 12, 2: 24, 3: 60}
"""Rounds by the number of free parameters: each cuts the longest edges of doubtful cells. Of 218
sets 189 needed none, and the others 9 at most."""
GRIDS = 2
"""Grids that are tried, each with twice the intervals, until refinement succeeds everywhere, and
over one parameter until nothing is missing. Of 525 sets two needed the second, and none
a third."""
CHEAP = 4
"""Multiplier for the number of completeness checks in 1-D sets and symmetric slices."""
SEARCHES = 10
"""Rounds of independent checks; what one round finds missing is lifted before the next. Of 301 sets
30 needed a second round, 15 a third, three a fourth, one six; one truss with hundreds of sheets
needed seven."""
RECOVERED = 200
"""Missing states, spread over all that were found, whose surroundings are lifted at once."""
MENDED = 8
"""Rounds of bisection around cells of a wrong sense: two tripods needed one and two."""
ROOM = 3.0
"""Default `room` of a set, see `Effort`: a truss with 220 states over a point needed 2.7 times what
was over its grid, and has no more than 66 003 equilibria."""


@check_arguments
def equilibrium_set(  # noqa: PLR0913  # the knobs of the public face, most by keyword
    structure: Structure,
    box: Box,
    *,
    fixed: Mapping[str, float] | None = None,
    within: Sequence[Constraint] = (),
    intervals: tuple[int, ...] | None = None,
    seed: int = 0,
    checks: int = 2,
    accuracy: float | None = None,
    limit: int | None = None,
    tiles: tuple[int, ...] | None = None,
    progress: Progress | None = None,
    journal: Journal | None = None,
    workers: Workers | None = None,
) -> EquilibriumSet:
    """All equilibria over a box in one to three parameters that are connected to the seeds.

    Sheet lifting: equilibria at both ends of every grid edge are paired by lifting the edge;
    around each triangle the curves close into loops that bound discs of the set; around each
    tetrahedron the discs close into spheres that bound balls. Folds and constraints carry exact
    vertices. The seeds are natural states over a coarse grid and the results of a random search.

    Parameters
    ----------
    box
        Ranges of the one, two or three free parameters.
    fixed
        Values of other parameters; those not named keep their defaults.
    within
        Constraints that cut the set off, like ``[arch.max_curvature <= 20]``. Those of the
        structure (`validity`), within which its energy holds, are added.
    intervals
        Grid intervals along each parameter; see `INTERVALS` for the defaults.
    seed
        Seed of the random generator; the result is deterministic.
    checks
        Random points, half of them below the set, half anywhere in the box, at which an independent
        search looks for equilibria that the set lacks; four times as many in diagrams over one
        parameter and in symmetric slices. In addition, Newton's method starts from 2000 random
        states, each over a different point, and beside what these lead to. What is found in this
        way is lifted like seeds, and new points are checked, until nothing is missing or ten rounds
        are over. Of more than two points a quarter is checked first. 0 disables all checks.
    accuracy
        Largest distance of the straight cells from the set, in the metric, to which the set is
        refined (see `refine`); without it, the set is not refined. If some edges cannot be bisected
        the grid is too coarse: one of twice the intervals is lifted, at most twice.
    limit
        Largest number of equilibria over the grid. Beyond it lifting stops, the set holds what is
        known by then, and its audit reports it (`stopped`); so where the division of all undecided
        cells would lead beyond it. Default: 60 000, or 30 per grid point if that is more; cells
        that are divided may bring up to three times what was there before.
    tiles
        Numbers of parts along each parameter into which the grid is cut: edges are lifted and cells
        closed in each part by itself, and glued. The set is the same, up to the order of its
        vertices and cells and to round-off; it does not depend on who lifts the tiles.
    progress
        Sink for progress reports; an exception that it raises cancels the computation.
    journal
        Stores the set, like `storage.open_journal`: a second call with the same journal reads it
        from there, bit for bit. While the set is computed, tiles that are finished are stored.
    workers
        Who lifts and closes the tiles; see `Workers`. Without tiles they have nothing to do.

    Returns
    -------
    The set with its audit; look at ``audit.clean``.

    Raises
    ------
    InputError
        If the box has more than three parameters, the grid has more points than `limit` (one
        million by default), a name is unknown, a parameter is both free and fixed, a value has no
        meaning, the accuracy is not positive, `within` holds anything but constraints, there are
        more tiles along a parameter than intervals, or the journal is that of another computation.
    """
    progress = progress or Silent()
    intervals = intervals_of(box, intervals)
    counts = tiles_of(intervals, tiles)
    room = ROOM if limit is None else 0.0
    effort = Effort(seed, checks, accuracy, limit_of(intervals, limit), counts, room)
    setting = setting_of(structure, box, fixed or {}, tuple(within))
    known = dict(fixed or {})
    order = _Order(setting, box, known, effort, progress, journal, workers)
    compute = partial(_on_grids, order, intervals)
    if journal is None:
        return compute()
    question = question_of_set(setting, box, intervals, effort)
    return recall_set(journal, question, setting, box, known, compute)


@dataclass(frozen=True)
class _Order:
    """A set that is asked for, over any grid, and who takes part in it."""

    setting: Setting
    box: Box
    fixed: Mapping[str, float]
    effort: Effort
    progress: Progress
    journal: Journal | None
    workers: Workers | None

    def rounds(self, lines: Lines) -> TileRounds | None:
        """Tiles of a grid, if it is cut into such."""
        if self.effort.tiles is None:
            return None
        return TileRounds(cuts_between(lines, self.effort.tiles), self.workers, self.journal)


def _on_grids(order: _Order, intervals: tuple[int, ...]) -> EquilibriumSet:
    """Lift a set over a grid, or over a finer one if that is too coarse."""
    for number in range(GRIDS):
        eset = _of_grid(order, intervals)
        if eset.audit.stopped:
            break
        if order.effort.accuracy is not None:
            eset = refine_cells(eset, order.effort.accuracy, order.progress)
        if eset.audit.unrefined == 0 or number == GRIDS - 1:
            break
        # odd numbers stay odd, which keeps lines of symmetry off the grid
        intervals = tuple(2 * n + n % 2 for n in intervals)
    return eset


def _of_grid(order: _Order, intervals: tuple[int, ...]) -> EquilibriumSet:
    """Lift a set over one grid, and where sides of the box hinder that, over sides moved outwards.

    They do where curves of singular states lie in a side, touch it, or meet it in a corner.
    """
    lines, box = grid_lines(order.box, intervals), order.box
    lifting = _start_lifting(order, lines)
    cells, eset = lifting.upright()
    early = is_stuck_at_sides(lifting.pairing, cells)
    if not early:
        cells, eset = _complete(lifting, cells, eset)
        if not is_stuck_at_sides(lifting.pairing, cells):
            return eset
    wide = widened(lines, order.setting.limits)
    effort = replace(order.effort, tiles=None)
    again = _start_lifting(replace(order, box=box_of(box.names, wide), effort=effort), wide)
    found = trimmed(_complete(again, *again.upright())[1], box)
    if sum(found.audit.faults.values()) < sum(eset.audit.faults.values()):
        return found
    return _complete(lifting, cells, eset)[1] if early else eset


def _start_lifting(order: _Order, lines: Lines) -> "_Lifting":
    """Points over the vertices of a grid from which it can be lifted."""
    order.progress.report("seeds", 0, 1)
    pairing = start_pairing(order.setting, grid_mesh(lines), order.effort.limit)
    pairing.points.over_vertices(*spread_seeds(pairing, lines, order.effort.seed, order.progress))
    return _Lifting(pairing, order, tuple(len(line) - 1 for line in lines), order.rounds(lines))


def _complete(
    lifting: "_Lifting", cells: Cells, eset: EquilibriumSet
) -> tuple[Cells, EquilibriumSet]:
    """Cells and set, with what the completeness checks find that it lacks."""
    order, effort = lifting.order, lifting.order.effort
    generator = np.random.default_rng([effort.seed, 1])
    recovered, islands = 0, IslandFinder()
    for number in range(SEARCHES):
        # what stays undecided in spite of bisection is not mended by more equilibria
        if lifting.pairing.is_full or lifting.given_up:
            found = Check(0, eset.points[:0])
            break
        points = _checks(effort.checks, order.setting)
        found = check(eset, generator, points, islands, order.progress, lacked=recovered > 0)
        lacking = len(found.missing)
        refuse_copies(eset, found.missing)
        if lacking == 0 or number == SEARCHES - 1:
            break
        recovered += lacking
        some = np.unique(np.linspace(0, lacking - 1, RECOVERED).astype(int))
        recover(lifting.pairing, found.missing[some])
        cells, eset = lifting.upright()
    return cells, lifting.with_checks(cells, eset, found, recovered)


class _Lifting:
    """A grid that is being lifted, with what has been seen of its cells."""

    def __init__(
        self,
        pairing: Pairing,
        order: _Order,
        intervals: tuple[int, ...],
        tiles: TileRounds | None,
    ) -> None:
        self.pairing, self.order, self.intervals, self.tiles = pairing, order, intervals, tiles
        self.finder, self.unseen = CellFinder(), UnseenFinder()
        self.given_up = False  # whether bisection did not help, or much is undecided

    def upright(self) -> tuple[Cells, EquilibriumSet]:
        """Cells and set; grid cells below those of a wrong sense are bisected and lifted again."""
        self._drop_copies()
        self.pairing.fit()
        cells, eset = self._lift()
        for _ in range(MENDED):
            if self.given_up or not _divide_wrong(self.pairing, eset):
                break
            cells, eset = self._lift()
        return cells, eset

    def _drop_copies(self) -> None:
        """Begin again without pieces that are copies of others, if there are such."""
        pairing = begun_without_copies(self.pairing, self.order.progress)
        if pairing is not self.pairing:
            self.pairing, self.finder, self.unseen = pairing, CellFinder(), UnseenFinder()

    def _lift(self) -> tuple[Cells, EquilibriumSet]:
        cells, bisected = self._lift_grid()
        order = self.order
        frame = Frame(order.setting, self.pairing.mesh, order.box, order.fixed, self.intervals)
        return cells, account(self.pairing, cells, frame, bisected)

    def _lift_grid(self) -> tuple[Cells, int]:
        """Flood, close, assemble; bisect what is not certain and go on.

        Tiles take part in the first round; the others touch few cells.
        """
        pairing, unseen = self.pairing, self.unseen
        bisected, outlook = 0, None
        rounds = BISECTIONS[pairing.mesh.dimension]
        for number in range(rounds):
            cells = self._lift_cells(self.tiles if number == 0 else None)
            self._make_room()
            outlook = (outlook or Outlook.of(pairing, cells)).renewed(pairing, cells)
            self.given_up = outlook.is_hopeless(pairing, cells)
            last = self.given_up or number == rounds - 1
            if cells.doubtful == 0 or last:
                cells = _look(pairing, cells, self.finder, unseen)
            if cells.doubtful == 0 or last:
                break
            bisected += cells.doubtful
            if lift_between(pairing, cells.doubtful_triangles):
                continue
            chosen, exits = cells.longest_edges(pairing.mesh), unseen.exits | ring_middles(pairing)
            exits |= strips_astray(pairing, cells.astray)
            used = pairing.mesh.edges_in_use  # the last look may be some rounds ago
            exits = {edge: share for edge, share in exits.items() if used[edge]}
            # first those through which tongues and strips leave their cells
            chosen = np.concatenate([np.array(list(exits), int), np.setdiff1d(chosen, list(exits))])
            pairing.use_mesh(bisect(pairing.mesh, chosen, exits))
        self.given_up |= Outlook.is_dim(cells)
        return cells, bisected

    def _make_room(self) -> None:
        """Let cells be divided over a grid with many equilibria, all of which are lifted."""
        pairing, effort = self.pairing, self.order.effort
        if pairing.limit == effort.limit and not pairing.is_full:
            pairing.limit = max(pairing.limit, int(effort.room * pairing.points.count))

    def _lift_cells(self, tiles: TileRounds | None) -> Cells:
        """Flood and close all cells, in tiles if there are such."""
        pairing, progress = self.pairing, self.order.progress
        flood_crossings(pairing, progress, tiles.flood if tiles else flood)
        progress.report("closing loops", 0, 1)
        close = partial(tiles.close, progress=progress) if tiles else None
        return find_through_layers(self.finder, pairing, close, progress)

    def with_checks(
        self, cells: Cells, eset: EquilibriumSet, found: Check, recovered: int
    ) -> EquilibriumSet:
        """The set with what the checks found in its audit."""
        box = self.order.box
        full = self.pairing.is_full or Outlook.is_crowded(self.pairing, cells)
        audit = replace(
            eset.audit,
            checked=found.found,
            missing=len(found.missing),
            recovered=recovered,
            descents=found.descents,
            left_out=found.left_out,
            on_lines=found.on_lines,
            starts=found.starts,
            arrived=found.arrived,
            stopped=self.pairing.points.count if full else 0,
            cell_size=_named(box, (box.upper - box.lower) / np.array(self.intervals)),
            touching=tuple(_named(box, place) for place in cells.touching),
            grazing=tuple(_named(box, place) for place in found.grazing),
        )
        return with_audit(eset, audit)


def _divide_wrong(pairing: Pairing, eset: EquilibriumSet) -> bool:
    """Bisect the grid cells below cells of a wrong index or sense, if there are any.

    So it is where a constraint bends sharply, and where two crossing curves meet: straight cells
    turn over there.
    """
    mesh = pairing.mesh
    if not eset.audit.wrong or mesh.dimension == 1 or pairing.is_full:
        return False
    middle = eset.coordinates[eset.cells[wrong_cells(eset)]].mean(axis=1)
    around = np.unique([mesh.locate(place) for place in middle])
    sides = mesh.sides[around] if mesh.dimension == 2 else mesh.sides[mesh.faces[around]]
    chosen = longest_edges(mesh, sides.reshape(len(around), -1))
    pairing.use_mesh(bisect(mesh, chosen))
    return True


def _named(box: Box, values: Place) -> tuple[tuple[str, float], ...]:
    """Values of the free parameters with their names."""
    return tuple(zip(box.names, values.tolist(), strict=True))


def _checks(checks: int, setting: Setting) -> int:
    """Points at which is checked: more where that is cheap, and where pieces hang together less."""
    return checks * (CHEAP if len(setting.free) == 1 or is_symmetric(setting) else 1)


def _look(pairing: Pairing, cells: Cells, finder: CellFinder, unseen: UnseenFinder) -> Cells:
    """Cells, doubtful where they hide something; found anew if folds turn sharply inside some."""
    tips = len(pairing.tips)
    cells = unseen.look(pairing, cells)
    if len(pairing.tips) == tips:
        return cells
    again = finder.find(pairing)
    doubtful = np.union1d(cells.doubtful_triangles, again.doubtful_triangles)
    return replace(again, doubtful_triangles=doubtful, touching=cells.touching)
