"""From a study file to the objects of the library, with the key of whatever does not fit."""

from collections.abc import Mapping
from dataclasses import dataclass

from equimorph.structures import Structure, from_identity
from equimorph.study.kinds import KINDS
from equimorph.study.kinds.kind import Asked
from equimorph.study.lookup import Extent, Ground, at_key, check_point, extent_of_set
from equimorph.study.problem import Study
from equimorph.study.sections.structures import StructureSection


@dataclass(frozen=True)
class Problem:
    """A study whose names all mean something."""

    ground: Ground
    points: tuple[dict[str, float], ...]
    tasks: tuple[Asked, ...]
    """Questions, kind by kind, in the order of the file."""

    @property
    def structure(self) -> Structure:
        """Of the whole study."""
        return self.ground.structure

    @property
    def extents(self) -> Mapping[str, Extent]:
        """Every grid over which something is computed, by its key in the study file."""
        own = {} if self.ground.extent is None else {"set": self.ground.extent}
        found = {each.key: each.kind.extent(each.task) for each in self.tasks}
        return own | {key: extent for key, extent in found.items() if extent is not None}


def prepare(study: Study) -> Problem:
    """Build the structure of a study and look up all its names.

    Parameters
    ----------
    study
        A study whose keys and types are right.

    Raises
    ------
    InputError
        For a parameter or descriptor that the structure does not have, a value without meaning, or
        a point outside the box; the line names the key.
    """
    with at_key("structure"):
        structure = build_structure(study.structure)
    wanted = study.equilibrium_set
    ground = Ground(structure, None if wanted is None else extent_of_set(structure, wanted))
    for i, point in enumerate(study.equilibria):
        check_point(ground.box, point.at, f"equilibria[{i}].at")
    tasks = []
    for kind in KINDS:
        for i, section in enumerate(study.tasks[kind.table]):
            key = f"{kind.table}[{i}]"
            tasks.append(Asked(kind, key, section, kind.prepared(ground, section, key)))
    return Problem(ground, tuple(point.at for point in study.equilibria), tuple(tasks))


def build_structure(section: StructureSection) -> Structure:
    """Structure that a section describes; what it leaves out takes the structure's default."""
    return from_identity(section.model_dump(exclude_none=True))
