"""Run a study and show its answers on the screen."""

from pathlib import Path

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from equimorph.cli.compilation import are_compiled, compile_kernels
from equimorph.cli.progress import ScreenProgress
from equimorph.manifold import EquilibriumSet
from equimorph.model import Box, Descriptor, names_of
from equimorph.structures import States, Structure
from equimorph.study import Outcome, Problem, RouteOutcome, read_problem, run_study
from equimorph.study.memory import amount, estimated_memory, intervals_of
from equimorph.tasks import unloaded_base


def check_and_show(file: Path) -> None:
    """Check a study, then print what running it would compute.

    Parameters
    ----------
    file
        Study file.
    """
    screen = Console(highlight=False)
    _, study, problem = read_problem(file)
    counts = {"point": len(study.equilibria), "route": len(study.routes), "map": len(study.maps)}
    asked = [_count(number, word) for word, number in counts.items() if number]
    what = " and ".join(asked) or "an equilibrium set"
    screen.print(f"{escape(str(file))} is a sound study with {what}.", soft_wrap=True)
    for line in _extents(problem):
        screen.print(line, soft_wrap=True)


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
    if not are_compiled():
        screen.print("The first run compiles the kernels: under a minute, and only once.")
        compile_kernels(problem)
    with ScreenProgress() as progress:
        outcome = run_study(file, out, replace=replace, progress=progress)
    _show(outcome, screen)
    screen.print(f"Report: {out / 'index.html'}", soft_wrap=True)


def _extents(problem: Problem) -> list[str]:
    """Every parameter of the set and of each map with its values, also those at defaults."""
    wanted, structure = problem.equilibrium_set, problem.structure
    lines = []
    if wanted is not None:
        values = {
            each.name: wanted.fixed.get(each.name, each.default) for each in structure.parameters
        }
        fixed = [
            f"{name} = {value:g}" for name, value in values.items() if name not in wanted.box.names
        ]
        lines.append(_extent(structure, wanted.box, wanted.intervals, fixed))
    for task in problem.maps:
        grid, load = task.grid, task.section.load
        base = unloaded_base(structure, grid, load, task.section.fixed).tolist()
        start = dict(zip(names_of(structure.parameters), base, strict=True))
        load_range = f"{load} from {start.pop(load):g} on"
        fixed = [f"{name} = {value:g}" for name, value in start.items() if name not in grid.names]
        words = _extent(structure, grid.box, intervals_of(task), [load_range, *fixed])
        lines.append(f"Map {task.section.name}: {words}")
    return lines


def _extent(structure: Structure, box: Box, intervals: tuple[int, int], others: list[str]) -> str:
    limits = zip(box.names, box.lower, box.upper, intervals, strict=True)
    free = [f"{name} from {low:g} to {up:g} in {n} intervals" for name, low, up, n in limits]
    memory = amount(estimated_memory(structure.size, intervals))
    return f"{', '.join(free)}; {', '.join(others)}. Memory: about {memory}."


def _count(number: int, word: str) -> str:
    return f"{number} {word}{'' if number == 1 else 's'}"


def _show(outcome: Outcome, screen: Console) -> None:
    heights = outcome.problem.height
    if outcome.equilibrium_set is not None:
        screen.print(_set_line(outcome.equilibrium_set, reused=outcome.reused), soft_wrap=True)
    for point, states in zip(outcome.problem.points, outcome.points, strict=True):
        where = ", ".join(f"{name} = {value:g}" for name, value in point.items())
        screen.print(f"Equilibria at {where}:", soft_wrap=True)
        screen.print(_table(heights, states))
    for each in outcome.routes:
        screen.print(_verdict(each), soft_wrap=True)
    for amap in outcome.maps:
        counts = ", ".join(f"{count} {kind}" for kind, count in amap.map.counts.items() if count)
        screen.print(f"Map {amap.name}: {counts}.", soft_wrap=True)


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


def _verdict(each: RouteOutcome) -> str:
    if not each.arrived:
        return f"Route {each.name}: [bold red]refused[/]. {escape(each.route.why)}"
    return (
        f"Route {each.name}: [bold green]arrived[/] without a snap, smallest margin "
        f"{each.route.margin:.3f}, length {each.route.length:.3f}."
    )
