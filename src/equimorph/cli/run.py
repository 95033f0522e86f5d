"""``equimorph run``: run a study and show its answers on the screen.

Before the first run, two processes compile the kernels. What follows curves and joins surfaces does
not depend on the structure: one process compiles it on a small spring, while the other compiles the
kernels of the study's structure.
"""

import subprocess
import sys
from pathlib import Path

import numpy as np
from rich.markup import escape
from rich.table import Table

from equimorph.cli.output import Output
from equimorph.equilibria import find_equilibria, limit_load
from equimorph.equilibria.step_kernels import proceed
from equimorph.linalg.compiled import is_kept
from equimorph.manifold import EquilibriumSet, equilibrium_set
from equimorph.model import Box, Constraint, Descriptor, Workers
from equimorph.structures import Spring, States
from equimorph.study import Outcome, Problem, read_problem, run_study, summary

COMPILED = "kernels that are compiled are kept; the study had not begun"
"""What is kept of a run that is interrupted while kernels are compiled."""
_MARCH = f"from {__name__} import march; march()"


def run_and_show(
    file: Path, out: Path, output: Output, *, replace: bool, workers: Workers | None = None
) -> bool:
    """Run a study with progress on stderr, then show its answers.

    Parameters
    ----------
    file
        Study file.
    out
        Results folder.
    output
        What to write, and where.
    replace
        Replace the results of another study there.
    workers
        Who computes the rays of maps and the trials.

    Returns
    -------
    Whether a question was refused.
    """
    _, _, problem = read_problem(file)
    if not kernels_are_in_cache():
        output.show("The first run compiles the kernels: under a minute, and only once.")
        try:
            compile_kernels(problem)
        except KeyboardInterrupt:
            raise KeyboardInterrupt(COMPILED) from None
    with output.progress() as progress:
        outcome = run_study(file, out, replace=replace, progress=progress, workers=workers)
    _show(outcome, output)
    report = out / "index.html"
    output.show(f"Report: {escape(str(report))}")
    if output.as_json:
        output.write_data({"study": str(file), "report": str(report), **summary(outcome)})
    return bool(outcome.refused)


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
    for title in (heights.name, "index", "margin", "energy"):
        table.add_column(title, justify="right")
    values = zip(heights(states), states.index, states.margin, states.energy, strict=True)
    for height, index, margin, energy in values:
        table.add_row(f"{height:.5f}", str(index), f"{margin:.4f}", f"{energy:.5f}")
    return table


def kernels_are_in_cache() -> bool:
    """Whether an earlier run left the kernels that every study needs."""
    return is_kept(proceed)


def compile_kernels(problem: Problem) -> None:
    """Compile what a study needs, so that the run itself finds it on disk.

    Parameters
    ----------
    problem
        The study; its set is not computed.
    """
    with subprocess.Popen(
        [sys.executable, "-c", _MARCH], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    ):
        evaluate(problem)


def march() -> None:
    """Find, follow and join the equilibria of a small spring."""
    spring = Spring()
    box = Box(x_l=(0.4, 1.4), F=(-0.3, 0.3))
    equilibrium_set(spring, box, intervals=(4, 4))
    find_equilibria(spring, {"x_l": 0.8, "F": 0.0})
    limit_load(spring.natural_state(x_l=0.8), "F")


def evaluate(problem: Problem) -> None:
    """Evaluate everything that the structure of a study knows of one state."""
    structure, values = problem.structure, dict[str, float]()
    constraints: tuple[Constraint, ...] = ()
    for each in structure.parameters:
        values[each.name] = 0.3 * each.scale if each.default is None else each.default
    for extent in [*problem.extents.values()][:1]:
        box, constraints = extent.box, extent.constraints
        values |= dict(zip(box.names, (box.lower + box.upper) / 2, strict=True))
        values |= dict(extent.fixed)
    values |= dict(structure.unloaded())
    p = np.array([[values[each.name] for each in structure.parameters]])
    structure.natural(p)
    z = structure.sample(p, np.random.default_rng(0))  # natural states need not exist here
    zero, one = np.zeros(1), np.ones_like(p)
    structure.advance(z, p, one, z, zero, zero)
    structure.second_derivative(z, p, (z, one), (z, one))
    structure.effort(z, p)
    structure.index(z, p)
    structure.resolved(z, p)
    structure.error_estimate(z, p)
    structure.shape(z, p)
    for shown in (problem.ground.height, *(limit.descriptor for limit in constraints)):
        shown.function(z, p)
