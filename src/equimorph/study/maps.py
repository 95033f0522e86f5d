"""Maps that a study asks for."""

from importlib.metadata import version
from typing import Any

from equimorph.model import Progress
from equimorph.storage.parts import MAP_PART
from equimorph.structures import Structure
from equimorph.study.checkpoints import Checkpoints
from equimorph.study.outcome import MapOutcome
from equimorph.study.prepare import MapTask, at_key
from equimorph.tasks import ActuatorMap, curvature_map, limit_load_map


def answered_map(
    structure: Structure, task: MapTask, answers: Checkpoints, progress: Progress
) -> MapOutcome:
    """Return the stored map, or compute it.

    Parameters
    ----------
    structure
        Of the study.
    task
        What is wanted.
    answers
        Where the map may be, and will be.
    progress
        Told how far the computation is.
    """

    def compute() -> ActuatorMap:
        with at_key(task.key):
            return _computed(structure, task, progress)

    asked = task.section.model_dump(mode="json", exclude={"name"})
    question = {"version": version("equimorph"), "structure": structure.identity(), "map": asked}
    return MapOutcome(task, answers.answer(question, MAP_PART, compute))


def _computed(structure: Structure, task: MapTask, progress: Progress) -> ActuatorMap:
    section = task.section
    common: dict[str, Any] = {
        "within": task.constraints,
        "fixed": section.fixed,
        "bound": section.bound,
        "progress": progress,
    }
    if section.at is None:
        return limit_load_map(structure, task.grid, section.load, **common)
    return curvature_map(
        structure, task.grid, section.load, section.at, descriptor=task.descriptor, **common
    )
