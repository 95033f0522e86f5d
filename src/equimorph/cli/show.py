"""Run a study and show its answers on the screen."""

from pathlib import Path

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from equimorph.cli.compilation import are_compiled, compile_kernels
from equimorph.cli.progress import ScreenProgress
from equimorph.manifold import EquilibriumSet
from equimorph.model import Descriptor, names_of
from equimorph.structures import States, Structure
from equimorph.study import Outcome, Problem, read_problem, run_study
from equimorph.study.lookup import Extent
from equimorph.study.memory import amount, estimated_memory
from equimorph.study.question import Question
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
    counts = {"point": len(study.equilibria)}
    counts |= {table: len(sections) for table, sections in study.tasks.items()}
    asked = [_count(number, word) for word, number in counts.items() if number]
    what = " and ".join(filter(None, [", ".join(asked[:-1]), *asked[-1:]])) or "an equilibrium set"
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


def reproduce_and_show(out: Path) -> None:
    """Compute the article anew with progress on stderr, then print where the report is.

    Parameters
    ----------
    out
        Folder for figures and the report.
    """
    from equimorph.paper import reproduce  # noqa: PLC0415  # studies do not need it

    screen = Console(highlight=False)
    with ScreenProgress() as progress:
        found = reproduce(out, progress=progress)
    rows = [row for example in found.numbers for row in found.rows(example)]
    table = Table(box=None, header_style="bold")
    for title in ("what", "theirs", "ours"):
        table.add_column(title, justify="left" if title == "what" else "right")
    for quoted, ours in rows:
        table.add_row(quoted.what, f"{quoted.theirs:g}", f"{ours:.6g}")
    screen.print(table)
    screen.print(f"Report: {out / 'index.html'}", soft_wrap=True)


def _extents(problem: Problem) -> list[str]:
    """Every parameter of the set and of each map with its values, also those at defaults."""
    wanted, structure = problem.ground.extent, problem.structure
    lines = []
    if wanted is not None:
        values = {
            each.name: wanted.fixed.get(each.name, each.default) for each in structure.parameters
        }
        fixed = [
            f"{name} = {value:g}" for name, value in values.items() if name not in wanted.box.names
        ]
        lines.append(_extent(structure, wanted, fixed))
    for question in problem.questions:
        own = question.kind.extent(question)
        if own is not None:
            words = _extent(structure, own, _values_of_map(question))
            lines.append(f"{question.title}: {words}")
    return lines


def _values_of_map(question: Question) -> list[str]:
    """Where its load begins, and the parameters that keep their values."""
    structure, grid, load = question.structure, question["grid"], question["load"]
    base = unloaded_base(structure, grid, load, question["fixed"] or {}).tolist()
    start = dict(zip(names_of(structure.parameters), base, strict=True))
    load_range = f"{load} from {start.pop(load):g} on"
    others = (f"{name} = {value:g}" for name, value in start.items() if name not in grid.names)
    return [load_range, *others]


def _extent(structure: Structure, extent: Extent, others: list[str]) -> str:
    box = extent.box
    limits = zip(box.names, box.lower, box.upper, extent.intervals, strict=True)
    free = [f"{name} from {low:g} to {up:g} in {n} intervals" for name, low, up, n in limits]
    memory = amount(estimated_memory(structure.size, extent.intervals))
    return f"{', '.join(free)}; {', '.join(others)}. Memory: about {memory}."


def _count(number: int, word: str) -> str:
    if number == 1 or word.endswith("s"):
        return f"{number} {word}"
    ends = {"y": f"{word[:-1]}ies", "h": f"{word}es"}
    return f"{number} {ends.get(word[-1], word + 's')}"


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
