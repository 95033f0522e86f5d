"""What a run of a study found."""

from dataclasses import dataclass

from equimorph.manifold import EquilibriumSet
from equimorph.structures import State, States
from equimorph.study.prepare import MapTask, Problem, Task
from equimorph.study.problem import Study
from equimorph.tasks import ActuatorMap, Route


@dataclass(frozen=True)
class RouteOutcome:
    """A route that was asked for: its ends, and the route or the refusal."""

    task: Task
    start: State
    goal: State
    route: Route

    @property
    def name(self) -> str:
        """Name in the study file; files of the route begin with it."""
        return self.task.section.name

    @property
    def arrived(self) -> bool:
        """Whether there is a route."""
        return self.route.arrived


@dataclass(frozen=True)
class MapOutcome:
    """A map that was asked for."""

    task: MapTask
    map: ActuatorMap

    @property
    def name(self) -> str:
        """Name in the study file; files of the map begin with it."""
        return self.task.section.name


@dataclass(frozen=True)
class Outcome:
    """All answers of a study.

    Parameters
    ----------
    study, problem
        What was asked.
    equilibrium_set
        The set in the box, if it was asked for.
    points
        Equilibria at each wanted point, in the order of the file.
    routes
        Each wanted route, in the order of the file.
    maps
        Each wanted map, in the order of the file.
    reused
        Whether the set was read from the folder instead of computed.
    seconds
        Wall time of each stage.
    """

    study: Study
    problem: Problem
    equilibrium_set: EquilibriumSet | None
    points: tuple[States, ...]
    routes: tuple[RouteOutcome, ...]
    maps: tuple[MapOutcome, ...]
    reused: bool
    seconds: dict[str, float]
