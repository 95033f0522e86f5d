"""``equimorph run``: run a study and show its answers on the screen."""

from collections.abc import Iterable
from pathlib import Path

from rich.markup import escape
from rich.table import Table

from equimorph.cli.output import Output
from equimorph.linalg.compile_ahead import calls_of, compile_ahead, compile_behind, known_calls
from equimorph.manifold import EquilibriumSet
from equimorph.model import Descriptor, Workers
from equimorph.structures import States
from equimorph.study import Outcome, read_problem, run_study, summary
from equimorph.tables import heading

COMPILED = "kernels that are compiled are kept; the study had not begun"
"""What is kept of a run that is interrupted while kernels are compiled."""


def run_and_show(
    file: Path, out: Path, output: Output, *, replace: bool, workers: Workers | None = None
) -> bool:
    """Run a study with progress on stderr and show its answers; say whether one was refused.

    With `replace` the results of another study in the folder give way. Workers lift the tiles of
    the set, and compute the rays of maps and the trials.
    """
    _, _, problem = read_problem(file)
    calls = calls_of(problem)
    needed = [each for each in calls if not each.is_loop]
    if not all(each.is_kept for each in needed):
        output.show("The first run compiles the kernels: under a minute, and only once.")
        try:
            compile_ahead(needed)
        except KeyboardInterrupt:
            raise KeyboardInterrupt(COMPILED) from None
    compile_behind(each for each in calls if each.is_loop)
    with output.progress() as progress:
        outcome = run_study(file, out, replace=replace, progress=progress, workers=workers)
    _show(outcome, output)
    report = out / "index.html"
    output.show(f"Report: {escape(str(report))}")
    if output.as_json:
        output.write_data({"study": str(file), "report": str(report), **summary(outcome)})
    return bool(outcome.refused)


def compile_all_of(files: Iterable[Path]) -> None:
    """Compile the kernels that studies need, with their loops behind; all where none is given."""
    calls = dict.fromkeys(each for file in files for each in calls_of(read_problem(file)[2]))
    if calls:
        compile_ahead(each for each in calls if not each.is_loop)
        compile_behind(each for each in calls if each.is_loop)
    else:
        compile_ahead(known_calls())


def _show(outcome: Outcome, output: Output) -> None:
    heights = outcome.problem.ground.height
    if outcome.equilibrium_set is not None:
        output.show(_set_line(outcome.equilibrium_set, reused=outcome.reused))
    for point, states in zip(outcome.problem.points, outcome.points, strict=True):
        where = ", ".join(f"{name} = {value:g}" for name, value in point.items())
        output.show(f"Equilibria at {where}:")
        output.show(_table(heights, states))
    for each in outcome.answers:
        output.show(each.line)


def _set_line(eset: EquilibriumSet, *, reused: bool) -> str:
    audit = "clean" if eset.audit.clean else "NOT CLEAN, see the report"
    origin = "read from an earlier run" if reused else "computed"
    pieces = "1 component" if len(eset.components) == 1 else f"{len(eset.components)} components"
    return f"Equilibrium set {origin}: {len(eset.points)} vertices, {pieces}, audit {audit}."


def _table(heights: Descriptor, states: States) -> Table:
    table = Table(box=None, header_style="bold")
    energy = states.structure.descriptor("energy").unit
    heads = (heading(heights.name, heights.unit), "index", "margin", heading("energy", energy))
    for head in heads:
        table.add_column(head, justify="right")
    values = zip(heights(states), states.index, states.margin, states.energy, strict=True)
    for height, index, margin, held in values:
        table.add_row(f"{height:.5f}", str(index), f"{margin:.4f}", f"{held:.5f}")
    return table
