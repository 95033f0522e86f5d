"""Routes for many actuators: ``[[sampled_route]]``."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from rich.markup import escape as plain

from equimorph.equilibria import lift
from equimorph.errors import InputError
from equimorph.manifold import EquilibriumSet
from equimorph.model import Box, Constraint, Progress, names_of, parameter_vector
from equimorph.storage import write_schedule
from equimorph.structures import State, Structure
from equimorph.study import html
from equimorph.study.kinds.found import heading
from equimorph.study.kinds.kind import Figure, Kind
from equimorph.study.kinds.way import figures_of_way, pictures_of_way
from equimorph.study.lookup import (
    Ground,
    at_key,
    check_parameters,
    check_value,
    constraints_of,
)
from equimorph.study.names import schedule_table, task_files
from equimorph.study.sections.routes import NaturalSection, SampledRouteSection
from equimorph.tasks import Route, SamplingOptions, plan_sampled


@dataclass(frozen=True)
class SampledRouteTask:
    """A route that is wanted, with its names looked up."""

    key: str
    section: SampledRouteSection
    actuators: Box
    constraints: tuple[Constraint, ...]

    @property
    def files(self) -> str:
        """Beginning of the names of its files."""
        return task_files(SampledRouteKind.table, self.section.name)


class SampledRouteKind(Kind[SampledRouteSection, SampledRouteTask, Route]):
    """Routes by random trees of lifted edges, where no set can be computed."""

    table = "sampled_route"

    def prepared(self, ground: Ground, section: SampledRouteSection, key: str) -> SampledRouteTask:
        """Look up ends, actuators, loads and constraints."""
        structure = ground.structure
        for end, given in (("start", section.start), ("goal", section.goal)):
            if given is not None:
                _check_natural(structure, given, f"{key}.{end}")
        check_parameters(structure, section.actuators, f"{key}.actuators")
        check_parameters(structure, section.rates or (), f"{key}.rates")
        for i, leg in enumerate(section.loads):
            _check_values(structure, leg, f"{key}.loads[{i}]")
            both = [name for name in leg if name in section.actuators]
            if both:
                raise InputError(f"`{key}.loads[{i}]` must not move actuators; got {both[0]}.")
        sides = {name: (bounds[0], bounds[1]) for name, bounds in section.actuators.items()}
        with at_key(f"{key}.actuators"):
            box = Box(**sides)
        constraints = constraints_of(structure, section.within, f"{key}.within")
        return SampledRouteTask(key, section, box, constraints)

    def answer(
        self, ground: Ground, eset: EquilibriumSet | None, task: SampledRouteTask, sink: Progress
    ) -> Route:
        """Lift both ends from natural states, and let trees grow."""
        section, structure = task.section, ground.structure
        start = _state(structure, section.start, f"{task.key}.start")
        goal = None
        if section.goal is not None:
            goal = _state(structure, section.goal, f"{task.key}.goal")
        options = SamplingOptions(lifts=section.lifts, reach=section.reach, seed=section.seed)
        with at_key(task.key):
            return plan_sampled(
                start,
                goal,
                task.actuators,
                loads=section.loads,
                within=task.constraints,
                margin=section.margin,
                objective=section.wish,
                monitor=[ground.height],
                options=options,
            )

    def write_tables(self, task: SampledRouteTask, answer: Route, folder: Path) -> None:
        """Write the schedule."""
        if answer.schedule is not None:
            write_schedule(answer.schedule, folder / schedule_table(task.files))

    def figures(
        self, ground: Ground, eset: EquilibriumSet | None, task: SampledRouteTask, answer: Route
    ) -> Sequence[Figure]:
        """Parameters, shapes and margins."""
        return figures_of_way(None, task.files, answer)

    def report(self, task: SampledRouteTask, answer: Route, folder: Path) -> list[str]:
        """Verdict, schedule and figures."""
        head = heading(self.table, task.section.name)
        if not answer.arrived:
            return [head, html.refused(answer.why)]
        length = html.number(answer.length)
        return [
            head,
            '<p class="verdict"><strong>Arrived.</strong> Every state on the way is stable: '
            f"smallest margin {html.number(answer.margin)}, length {length}.</p>",
            html.schedule_links(schedule_table(task.files)),
            pictures_of_way(folder, task.files, "route"),
        ]

    def verdict(self, task: SampledRouteTask, answer: Route) -> str:
        """Say whether it arrived."""
        head = f"Sampled route {task.section.name}"
        if not answer.arrived:
            return f"{head}: [bold red]refused[/]. {plain(answer.why)}"
        return (
            f"{head}: [bold green]arrived[/] without a snap, smallest margin "
            f"{answer.margin:.3f}, length {answer.length:.3f}."
        )


def _check_natural(structure: Structure, given: NaturalSection, key: str) -> None:
    _check_values(structure, given.at, f"{key}.at")
    loaded = [name for name in structure.unloaded() if given.at.get(name, 0.0) != 0.0]
    if loaded:
        raise InputError(
            f"`{key}.at` must have no loads: that is where natural states are; got {loaded[0]} = "
            f"{given.at[loaded[0]]:g}. Put loads into `{key}.steps`."
        )
    for i, step in enumerate(given.steps):
        _check_values(structure, step, f"{key}.steps[{i}]")
    with at_key(f"{key}.at"):
        parameter_vector(structure.parameters, {**given.at, **structure.unloaded()})


def _check_values(structure: Structure, values: dict[str, float], key: str) -> None:
    with at_key(key):
        for name, value in values.items():
            check_value(structure, name, value)


def _state(structure: Structure, given: NaturalSection, key: str) -> State:
    """Return the natural state, lifted along the steps."""
    values = {**given.at, **structure.unloaded()}
    p = parameter_vector(structure.parameters, values)
    z, found = structure.natural(p[None])
    names = names_of(structure.parameters)
    if not found[0]:
        at = ", ".join(f"{name} = {value:g}" for name, value in zip(names, p, strict=True))
        raise InputError(f"`{key}.at` must have a natural state; none is found at {at}.")
    state = State(structure, z[0], p)
    if not given.steps:
        return state
    path = lift(state, [dict(step) for step in given.steps])
    if not path.arrived:
        raise InputError(
            f"`{key}.steps` must be steps that the structure can make; got a {path.end.kind} in "
            f"step {min(int(path.end.at) + 1, len(given.steps))}."
        )
    return path.end.state
