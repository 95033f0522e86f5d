"""What kinds have in common that take a way from outside: a schedule file, or steps."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from equimorph.errors import InputError
from equimorph.manifold import EquilibriumSet
from equimorph.model import Constraint, Schedule, names_of
from equimorph.structures import State
from equimorph.study.choose import choose_state
from equimorph.study.lookup import Ground, at_key, check_state, check_value, constraints_of
from equimorph.study.sections.ways import WaySection
from equimorph.tasks.verification import first_state


@dataclass(frozen=True)
class GivenWay:
    """A way that a study gives, with its constraints as objects."""

    key: str
    section: WaySection
    constraints: tuple[Constraint, ...]

    @property
    def schedule(self) -> Schedule | Sequence[Mapping[str, float]]:
        """As tasks take it."""
        file = self.section.schedule
        return (self.section.steps or []) if file is None else file.schedule

    def start(self, ground: Ground, eset: EquilibriumSet | None) -> State:
        """State in which it begins."""
        section = self.section
        if section.schedule is not None:
            with at_key(f"{self.key}.schedule"):
                return first_state(section.schedule.schedule, ground.structure)
        assert eset is not None
        assert section.start is not None
        return choose_state(eset, section.start, f"{self.key}.start")

    def bounds(self, eset: EquilibriumSet | None) -> tuple[Constraint, ...]:
        """Its constraints, and those of the set that it begins in."""
        of_set = () if eset is None or self.section.schedule is not None else eset.constraints
        return tuple(dict.fromkeys((*of_set, *self.constraints)))


def given_way(ground: Ground, section: WaySection, key: str) -> GivenWay:
    """Look up start, steps and constraints; a schedule must be one of this structure.

    Raises
    ------
    InputError
        For a schedule of other parameters, or names and values without meaning.
    """
    names = names_of(ground.structure.parameters)
    if section.schedule is not None and section.schedule.schedule.names != names:
        raise InputError(
            f"`{key}.schedule` must give the parameters {', '.join(names)}; "
            f"got {', '.join(section.schedule.schedule.names)}."
        )
    if section.start is not None:
        check_state(ground, section.start, f"{key}.start")
    for i, step in enumerate(section.steps or ()):
        with at_key(f"{key}.steps[{i}]"):
            for name, value in step.items():
                check_value(ground.structure, name, value)
    return GivenWay(key, section, constraints_of(ground.structure, section.within, f"{key}.within"))
