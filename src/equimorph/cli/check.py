"""``equimorph check``: say what running a study would compute."""

from pathlib import Path

from rich.markup import escape

from equimorph.cli.output import Output
from equimorph.model import names_of
from equimorph.structures import Structure
from equimorph.study import Problem, read_problem
from equimorph.study.lookup import Extent
from equimorph.study.memory import amount, estimated_memory
from equimorph.study.question import Question
from equimorph.tasks.maps.actuator_map import unloaded_base


def check_and_show(file: Path, *, as_json: bool = False) -> int:
    """Check a study, then show what running it would compute, as text or as data for programs.

    Raises `StudyError` with a line for each mistake of the study.
    """
    output = Output(as_json=as_json)
    _, study, problem = read_problem(file)
    counts = {"point": len(study.equilibria)}
    counts |= {table: len(sections) for table, sections in study.tasks.items()}
    asked = [_count(number, word) for word, number in counts.items() if number]
    what = " and ".join(filter(None, [", ".join(asked[:-1]), *asked[-1:]])) or "an equilibrium set"
    output.show(f"{escape(str(file))} is valid: it asks for {what}.")
    lines = _extents(problem)
    for line in lines:
        output.show(line)
    output.write_data({"study": str(file), "errors": [], "asks": counts, "computes": lines})
    return 0


def _extents(problem: Problem) -> list[str]:
    """Every parameter of the set and of each map with its values, also those at defaults."""
    extent, structure = problem.ground.extent, problem.structure
    lines = []
    if extent is not None:
        values = {
            each.name: extent.fixed.get(each.name, each.default) for each in structure.parameters
        }
        fixed = [
            f"{name} = {value:g}" for name, value in values.items() if name not in extent.box.names
        ]
        lines.append(_extent(structure, extent, fixed))
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
