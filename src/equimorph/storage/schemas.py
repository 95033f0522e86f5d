"""Schemas: under which names records and their fields stand in files, and how older ones are read.

A record is one of our frozen dataclasses. Files name it by its schema, not by its class, and give
the version of the schema with it. A class or field may be renamed at any time: say so in
`CHANGES`, and raise the version there. A record that this release cannot read is named, and the
rest of its file is read.
"""

import pkgutil
from collections.abc import Mapping
from dataclasses import MISSING, Field, dataclass, field, fields, is_dataclass
from functools import cache
from importlib import import_module
from types import ModuleType
from typing import Any

from equimorph import tasks
from equimorph.dynamics import LeastShock, Replay, Shock
from equimorph.equilibria import (
    Completeness,
    EnergyBarrier,
    Event,
    Landing,
    LimitLoad,
    Path,
    TransitionNetwork,
)
from equimorph.equilibria.minima_graph import Argument
from equimorph.errors import InputError
from equimorph.manifold import Audit, Component, Snap, StabilityDistance, Stratum
from equimorph.model import Schedule
from equimorph.tasks.maps.actuator_map import ActuatorMap
from equimorph.tasks.reach.query import Answer
from equimorph.tasks.reach.regions import Region

OTHERS = (
    *(Audit, Component, Stratum, Snap, StabilityDistance),
    *(Event, Landing, LimitLoad, Path, Replay, Schedule, Answer, Region),
    *(TransitionNetwork, Completeness, Argument, EnergyBarrier, LeastShock, Shock),
)
"""Records of the layers below the tasks, and those whose names other dataclasses have, too."""


class UnreadableError(InputError):
    """One record of a file cannot be read by this release; the rest of the file can."""


@dataclass(frozen=True)
class Change:
    """How a record changed since files were first written."""

    version: int = 1
    """Of the schema: 1, and one more for each change that older releases cannot read."""
    schema: str | None = None
    """Name in files, where the class is called otherwise now."""
    renamed: Mapping[str, str] = field(default_factory=dict)
    """Names of fields in older versions, with those of today."""
    added: Mapping[str, Any] = field(default_factory=dict)
    """Values for fields that older versions lack; defaults of the class need not be repeated."""
    removed: tuple[str, ...] = ()
    """Fields of older versions that are no longer there."""


CHANGES: Mapping[str, Change] = {
    "Audit": Change(version=9),
    "Completeness": Change(version=3),  # older ones neither count starts nor say what helps
    "LeastSnap": Change(version=2),
    "Proof": Change(version=3, removed=("status",)),  # it follows from `why` and `bounds`
    "RobustOptimum": Change(version=2),  # older ones have no number of exchanges
    "Route": Change(version=4),  # older ones have no bottleneck, survival or relaxations
    "Schedule": Change(version=3),  # older ones have no times, or no units of descriptors
    # older ones do not count what is not resolved
    "Shapes": Change(version=3, renamed={"wanted": "targets"}),
    "Tracking": Change(version=2),  # older ones say nothing of it
}
"""Changes by class; a class that is not listed is as it was in version 1."""


@dataclass(frozen=True)
class Schema:
    """How a kind of record stands in files."""

    name: str
    kind: type
    change: Change

    @property
    def fields(self) -> list[Field[Any]]:
        """Fields that are written."""
        return [each for each in fields(self.kind) if each.metadata.get("kept", True)]

    def values(self, record: Any) -> dict[str, Any]:
        """Return the values of a record, under the names that they have in files."""
        return {each.name: getattr(record, each.name) for each in self.fields}

    def build(self, version: int, values: Mapping[str, Any]) -> Any:
        """Return the record that has values, as a version of this schema names them.

        Raises `UnreadableError` if this release does not know the version or one of the fields, or
        lacks one.
        """
        change = self.change
        here = {change.renamed.get(name, name): value for name, value in values.items()
                if name not in change.removed}  # fmt: skip
        known = {each.name: each for each in self.fields}
        needed = {n for n, each in known.items() if each.default is each.default_factory is MISSING}
        missing = needed - here.keys()
        filled = {name: change.added[name] for name in missing if name in change.added}
        strange, lacking = sorted(here.keys() - known.keys()), sorted(missing - filled.keys())
        if version > change.version or strange or lacking:
            raise UnreadableError(
                f"`record` must be one that this release can read ({self.name}, version "
                f"{change.version} with {', '.join(known)}); got version {version} with "
                f"{', '.join(values)}. Compute it again, or read it with the release that wrote it."
            )
        return self.kind(**here, **filled)


def schema_of(record: Any) -> Schema | None:
    """Return the schema of a record; None for what is no record of ours."""
    found = schemas().get(_name(type(record)))
    return found if found is not None and found.kind is type(record) else None


def find_schema(name: str) -> Schema:
    """Return the schema that a file names.

    Raises `UnreadableError` if this release has none.
    """
    if name not in schemas():
        raise UnreadableError(
            f"`record` must be of a kind that this release knows; got {name}. Compute it again, or "
            "read it with the release that wrote it."
        )
    return schemas()[name]


def build(kind: type, values: Mapping[str, Any], version: int = 1) -> Any:
    """Return a record of a kind with a special layout; see `Schema.build`."""
    return find_schema(_name(kind)).build(version, values)


@cache
def schemas() -> dict[str, Schema]:
    """All records, by the names of their schemas; those of tasks are found by themselves."""
    # maps have a special layout
    found = [kind for kind in _dataclasses(tasks) if not issubclass(kind, ActuatorMap)]
    kinds = [*found, *OTHERS]
    return {
        _name(kind): Schema(_name(kind), kind, CHANGES.get(kind.__name__, Change()))
        for kind in kinds
    }


def _name(kind: type) -> str:
    return CHANGES.get(kind.__name__, Change()).schema or kind.__name__


def _dataclasses(package: ModuleType) -> list[type]:
    """Dataclasses that the modules of a package define."""
    found: list[type] = []
    for module in pkgutil.walk_packages(package.__path__, f"{package.__name__}."):
        inside = vars(import_module(module.name)).values()
        found += [each for each in inside
                  if isinstance(each, type) and is_dataclass(each)
                  and each.__module__ == module.name]  # fmt: skip
    return found
