"""The audit of an equilibrium set: what was checked, and what was found.

See docs/decisions.md, "What is not resolved is counted, not lifted".
"""

from dataclasses import dataclass

from scipy.special import betaincinv

from equimorph.tables import html_table

SMALL_RESIDUAL = 1e-9
"""Largest residual of a clean set."""
NECKS = (
    "necks are found where two sheets approach each other over a whole cell, and may be joined "
    "wrongly where another fold is in the same cell"
)
"""What the check of approaching sheets means, and where it does not apply."""


@dataclass(frozen=True)
class Audit:
    """Numbers that tell whether a set can be trusted.

    Must be zero for a clean set: `unpaired` (curves that could not be lifted), `conflicts` left,
    `parity_violations`, `undecided` triangles, orientation `contradictions`, `non_manifold` edges
    and vertices (around which cells are neither a ball nor half of one).
    `retraced` conflicts were resolved by finer steps, `bisected` triangles by subdivision.
    Facets at which two sheets cross (`crossings`: four cells each, whose orientations cancel) are
    not counted among the non-manifold ones.
    `overturned` cells project against the orientation that their index demands: slivers at folds.
    `wrong` cells, which must be none, do so away from folds and are no slivers, have a vertex whose
    negative eigenvalues, counted anew at every vertex, are not those of their index, or one beyond
    a constraint, as where a descriptor jumps.
    Of the equilibria found by random search at random points, `recovered` were missing and have
    been added; in the last round, `missing` of `checked` were, which must be zero too. Of the
    random `starts` of these searches `arrived` led to a state: where few do, the searches miss more
    than `missing_at_most` says.

    `descents` counts how descents from vertices of the strata of index one, and from folds, ended;
    `on_lines` how many equilibria random lines in actuators and loads met that begin at vertices of
    all strata and return to the same parameters. What these found and the set lacked has been
    added, too; so have mirror images of its strata, and islands inside cells to which the
    determinant of F_z leads. Closed pieces narrower than `cell_size`, the widths of the grid's
    cells by parameter, may escape all of this. Where two sheets approach each other inside a cell
    they are followed to where they are nearest, and cells with a neck inside are bisected;
    `touching`, of which there must be none, are the points at which they touch, like the tip of a
    cone, or are nearer than states can be told apart.
    Sheets that lie beyond the box may end in a side of it, in a fold that lies in the side or
    touches it: that is no part of the set, and `grazing` has a point of each such side.

    Vertices that the discretisation does not resolve (`unresolved`) belong to a set where curves
    lead to them; the searches found `left_out` others, which it lacks, and which must be zero, too:
    finer elements resolve them (`Rod.resolving`), or a constraint excludes them.

    `stopped`, which must be zero, is the number of equilibria at which lifting stopped because it
    exceeded the limit, or would have when undecided cells are halved; much is unpaired and
    undecided then. Where much is undecided, no completeness checks are made.

    Of refined sets: the `accuracy` that was asked for, the largest `deviation` of straight cells
    from the set as their edges show it, how many edges are `unrefined` (they could not be
    bisected), by how much the numbers of pieces and of boundary loops and the Euler characteristic
    `changed`, the `smallest_angle` of the triangles in degrees, that of those that are not squeezed
    between a crossing and another curve (`smallest_free_angle`: two such curves may meet at a small
    angle, or run side by side), and the `smallest_dihedral` angle of the tetrahedra. All are zero
    otherwise; `unrefined` and `changed` must be zero.
    """

    vertices: int
    cells: int
    unpaired: int
    conflicts: int
    retraced: int
    parity_violations: int
    undecided: int
    bisected: int
    non_manifold: int
    contradictions: int
    overturned: int
    euler_characteristic: int
    components: int
    loops: tuple[tuple[str, int], ...]
    largest_residual: float
    checked: int
    missing: int
    recovered: int
    accuracy: float = 0.0
    deviation: float = 0.0
    unrefined: int = 0
    smallest_angle: float = 0.0
    crossings: int = 0
    smallest_dihedral: float = 0.0
    changed: int = 0
    smallest_free_angle: float = 0.0
    wrong: int = 0
    descents: tuple[tuple[str, int], ...] = ()
    stopped: int = 0
    cell_size: tuple[tuple[str, float], ...] = ()
    touching: tuple[tuple[tuple[str, float], ...], ...] = ()
    unresolved: int = 0
    left_out: int = 0
    on_lines: int = 0
    grazing: tuple[tuple[tuple[str, float], ...], ...] = ()
    starts: int = 0
    arrived: int = 0

    def __repr__(self) -> str:
        """Whether it is clean, else what is not; sizes."""
        faults = ", ".join(f"{name} {count}" for name, count in self.faults.items())
        large = f"largest residual {self.largest_residual:.1e}"
        state = "clean" if self.clean else f"NOT clean: {faults or large}"
        return f"Audit({state}; {self.vertices} equilibria, {self.cells} cells)"

    def _repr_html_(self) -> str:
        """Table of all that was checked, for notebooks."""
        state = "clean" if self.clean else "NOT clean"
        return html_table(f"Audit: {state}", [], self.rows())

    @property
    def missing_at_most(self) -> float:
        """Upper 95 % confidence limit of the share of equilibria that are missing.

        It refers to what the independent search finds at random points, each state as often as it
        is found: those that are hard to find count for less. It is the largest share for which at
        most `missing` of `checked` has a probability of 5 % (Clopper and Pearson); 1 without
        checks.
        """
        if self.missing >= self.checked:
            return 1.0
        return float(betaincinv(self.missing + 1, self.checked - self.missing, 0.95))

    @property
    def clean(self) -> bool:
        """Whether there are no `faults`, and residuals are at round-off."""
        return not self.faults and self.largest_residual < SMALL_RESIDUAL

    @property
    def faults(self) -> dict[str, int]:
        """Everything that must be zero and is not, by name."""
        names = (
            "unpaired",
            "conflicts",
            "parity_violations",
            "undecided",
            "non_manifold",
            "contradictions",
            "wrong",
            "missing",
            "unrefined",
            "changed",
            "stopped",
            "left_out",
        )
        counts = {name: getattr(self, name) for name in names} | {"touching": len(self.touching)}
        return {name: count for name, count in counts.items() if count}

    def rows(self) -> list[tuple[str, str]]:
        """Lines to print: each quantity with its value."""
        loops = ", ".join(f"{count} {kind}" for kind, count in self.loops) or "none"
        refined = [
            ("deviation of cells", f"{self.deviation:.1e} (asked for: {self.accuracy:.1e})"),
            ("edges too long", str(self.unrefined)),
            ("smallest angle", f"{self.smallest_angle:.1f}°"),
        ]
        if self.changed:
            refined.append(("changes of topology", str(self.changed)))
        if self.crossings and self.smallest_free_angle:
            refined.append(("smallest angle off crossings", f"{self.smallest_free_angle:.1f}°"))
        if self.smallest_dihedral:
            refined.append(("smallest dihedral angle", f"{self.smallest_dihedral:.1f}°"))
        stopped = ("lifting stopped", f"at {self.stopped} equilibria: no room within the limit")
        return [
            *([stopped] if self.stopped else []),
            ("equilibria (vertices)", str(self.vertices)),
            ("cells", str(self.cells)),
            ("curves not paired", str(self.unpaired)),
            ("conflicting pairs", f"{self.conflicts} ({self.retraced} resolved by finer steps)"),
            ("parity violations", str(self.parity_violations)),
            ("undecided triangles", f"{self.undecided} ({self.bisected} resolved by bisection)"),
            ("non-manifold edges and vertices", str(self.non_manifold)),
            *([("edges where sheets cross", str(self.crossings))] if self.crossings else []),
            ("orientation contradictions", str(self.contradictions)),
            ("overturned cells", str(self.overturned)),
            ("cells of a wrong index or sense", str(self.wrong)),
            ("components", str(self.components)),
            ("Euler characteristic", str(self.euler_characteristic)),
            ("boundary loops", loops),
            ("largest residual", f"{self.largest_residual:.1e}"),
            (
                "completeness check",
                f"{self.missing} of {self.checked} equilibria found at random points are missing, "
                f"{self.recovered} added before; with 95 % confidence fewer than "
                f"{_percent(self.missing_at_most)} of what such searches meet is missing; states "
                f"that they meet rarely may be missing more often{self._arrivals}"
                if self.checked
                else "not made: pieces that the seeds do not reach may be missing",
            ),
            ("descents from unstable strata", self._descents),
            ("lines through all strata", self._lines),
            *([("not resolved", self._unresolved)] if self.unresolved + self.left_out else []),
            *([("sheets touch", self._touching)] if self.touching else []),
            *([("sheets end in sides", self._grazing)] if self.grazing else []),
            *([("closed pieces, necks", self._unseen)] if self.cell_size else []),
            *(refined if self.accuracy else []),
        ]

    @property
    def _arrivals(self) -> str:
        """How many starts of the searches arrived; nothing where none were counted."""
        return f"; {self.arrived} of {self.starts} starts arrived" if self.starts else ""

    @property
    def _touching(self) -> str:
        """Where sheets touch: one line."""
        return f"in one point (cone point) at {_at(self.touching)}"

    @property
    def _grazing(self) -> str:
        """In which sides sheets end that are no part of the set: one line."""
        return (
            f"which lie beyond the box, in folds as at {_at(self.grazing)}: singular states over "
            "the sides alone, which the set leaves out"
        )

    @property
    def _unresolved(self) -> str:
        """What the discretisation does not resolve: one line."""
        found = f", and {self.left_out} states found besides, which are left out"
        return (
            f"{self.unresolved} vertices{found if self.left_out else ''}; of such states any "
            "number may be missing: take more elements (`resolving`), or bound the set below them"
        )

    @property
    def _unseen(self) -> str:
        """Below which size pieces may be missing: one line."""
        size = ", ".join(f"{name} {width:.2g}" for name, width in self.cell_size)
        searched = ", but for those that Newton's method met from random guesses"
        found = searched if self.checked else ""
        return f"may be missed below {size}{found}; {NECKS}"

    @property
    def _lines(self) -> str:
        """What lines beyond the box say: one line."""
        if not self.checked:
            return "not made"
        return f"met {self.on_lines} equilibria; sheets that join others beyond the box are met so"

    @property
    def _descents(self) -> str:
        """What descents say: one line."""
        if not self.checked:
            return "not made"
        ends = ", ".join(f"{count} {outcome}" for outcome, count in self.descents)
        return (
            f"{ends or 'no unstable stratum'}; no stable sheet is missing unless every sheet of "
            "index one beside it is missing as well"
        )


def _at(places: tuple[tuple[tuple[str, float], ...], ...]) -> str:
    """Points by the names of their parameters."""
    return "; ".join(", ".join(f"{name} = {value:.6g}" for name, value in at) for at in places)


def _percent(share: float) -> str:
    """A share in per cent with two digits, never rounded to none."""
    return f"{100.0 * share:.2g} %" if share < 0.01 else f"{100.0 * share:.0f} %"
