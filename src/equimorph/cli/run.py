"""``equimorph run``: run a study and show its answers on the screen."""

from pathlib import Path

from rich.console import Console
from rich.table import Table

from equimorph.cli.compilation import compile_kernels, kernels_are_in_cache
from equimorph.cli.progress import ScreenProgress
from equimorph.manifold import EquilibriumSet
from equimorph.model import Descriptor
from equimorph.structures import States
from equimorph.study import Outcome, read_problem, run_study

COMPILED = "kernels that are compiled are kept; the study had not begun"
"""What is kept of a run that is interrupted while kernels are compiled."""


def run_and_show(file: Path, out: Path, *, replace: bool) -> None:
    """Run a study with progress on stderr, then print its answers.

    Parameters
    ----------
    file
        Study file.
    out
        Results folder.
    replace
        Replace the results of another study there.
    """
    screen = Console(highlight=False)
    _, _, problem = read_problem(file)
    if not kernels_are_in_cache():
        screen.print("The first run compiles the kernels: under a minute, and only once.")
        try:
            compile_kernels(problem)
        except KeyboardInterrupt:
            raise KeyboardInterrupt(COMPILED) from None
    with ScreenProgress() as progress:
        outcome = run_study(file, out, replace=replace, progress=progress)
    _show(outcome, screen)
    screen.print(f"Report: {out / 'index.html'}", soft_wrap=True)


def _show(outcome: Outcome, screen: Console) -> None:
    heights = outcome.problem.ground.height
    if outcome.equilibrium_set is not None:
        screen.print(_set_line(outcome.equilibrium_set, reused=outcome.reused), soft_wrap=True)
    for point, states in zip(outcome.problem.points, outcome.points, strict=True):
        where = ", ".join(f"{name} = {value:g}" for name, value in point.items())
        screen.print(f"Equilibria at {where}:", soft_wrap=True)
        screen.print(_table(heights, states))
    for each in outcome.answers:
        screen.print(each.question.kind.verdict(each.question, each.answer), soft_wrap=True)


def _set_line(eset: EquilibriumSet, *, reused: bool) -> str:
    audit = "clean" if eset.audit.clean else "NOT CLEAN, see the report"
    origin = "read from an earlier run" if reused else "computed"
    pieces = "1 component" if len(eset.components) == 1 else f"{len(eset.components)} components"
    return f"Equilibrium set {origin}: {len(eset.points)} vertices, {pieces}, audit {audit}."


def _table(heights: Descriptor, states: States) -> Table:
    table = Table(box=None, header_style="bold")
    for title in (heights.name, "index", "margin", "energy"):
        table.add_column(title, justify="right")
    values = zip(heights(states), states.index, states.margin, states.energy, strict=True)
    for height, index, margin, energy in values:
        table.add_row(f"{height:.5f}", str(index), f"{margin:.4f}", f"{energy:.5f}")
    return table
