"""Parts of a study's results as files of their own, from which an interrupted run goes on."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Generic, TypeVar

import h5py

from equimorph.manifold import EquilibriumSet
from equimorph.model import Descriptor
from equimorph.storage import map_group, record_group, route_group, set_group, states_group
from equimorph.storage.hdf import content, get_json, opened, put_json
from equimorph.structures import State, States, Structure, from_identity
from equimorph.tasks import ActuatorMap, Calibration, Route

FORMAT = "an equimorph checkpoint"
VERSION = 1
STRUCTURE, FOUND = "structure", "found"
START, GOAL, ROUTE, OTHERS = "start", "goal", "route", "others"

Answer = TypeVar("Answer")


@dataclass(frozen=True)
class Journey:
    """Start, goal, the route between them or its refusal, and other routes, if any were wanted."""

    start: State
    goal: State
    route: Route
    others: tuple[Route, ...] = ()

    @property
    def all(self) -> tuple[Route, ...]:
        """Every route, the best first."""
        return (self.route, *self.others)


@dataclass(frozen=True)
class Part(Generic[Answer]):
    """How one kind of answer is written into an HDF5 group and read back.

    Parameters
    ----------
    kind
        Of the answer, in a word.
    write
        Writes it into an empty group.
    read
        Reads it, for a structure.
    """

    kind: str
    write: Callable[[h5py.Group, Answer], None]
    read: Callable[[h5py.Group, Structure], Answer]

    def content(self, answer: Answer) -> bytes:
        """Return the content of a file that holds an answer."""
        return content(
            FORMAT, VERSION, lambda file: self.write(file.create_group(self.kind), answer)
        )

    def load(self, path: Path, structure: Structure) -> Answer:
        """Read the answer that a file holds.

        Raises
        ------
        InputError
            If the file is missing, damaged, or holds something else.
        """
        with opened(path, FORMAT, VERSION) as file:
            return self.read(file[self.kind], structure)


def set_part(height: Descriptor) -> Part[EquilibriumSet]:
    """Equilibrium sets, with a descriptor as third coordinate of their embedding."""
    return Part("set", lambda group, eset: set_group.write(group, eset, height), set_group.read)


STATES_PART: Part[States] = Part("states", states_group.write, states_group.read)
MAP_PART: Part[ActuatorMap] = Part("map", map_group.write, map_group.read)


def _write_journey(group: h5py.Group, journey: Journey) -> None:
    states_group.write(group.create_group(START), journey.start.batch)
    states_group.write(group.create_group(GOAL), journey.goal.batch)
    route_group.write(group.create_group(ROUTE), journey.route)
    for number, route in enumerate(journey.others):
        route_group.write(group.create_group(f"{OTHERS}/{number}"), route)


def _read_journey(group: h5py.Group, structure: Structure) -> Journey:
    start, goal = (states_group.read(group[end], structure)[0] for end in (START, GOAL))
    count = len(group[OTHERS]) if OTHERS in group else 0
    others = (route_group.read(group[f"{OTHERS}/{k}"], structure) for k in range(count))
    return Journey(start, goal, route_group.read(group[ROUTE], structure), tuple(others))


JOURNEY_PART: Part[Journey] = Part("journey", _write_journey, _read_journey)


def _write_calibration(group: h5py.Group, found: Calibration) -> None:
    put_json(group, STRUCTURE, found.states.structure.identity())
    record_group.write(group.create_group(FOUND), found)


def _read_calibration(group: h5py.Group, _: Structure) -> Calibration:
    fitted = from_identity(get_json(group, STRUCTURE))
    found = record_group.read(group[FOUND], fitted)
    assert isinstance(found, Calibration)
    return found


CALIBRATION_PART: Part[Calibration] = Part("calibration", _write_calibration, _read_calibration)
"""Calibrations: their states belong to a structure with the data that were found."""

RECORD_PART: Part[Any] = Part("record", record_group.write, record_group.read)
"""Results of tasks that are records."""

PARTS: dict[str, Part[Any]] = {
    each.kind: each for each in (STATES_PART, MAP_PART, JOURNEY_PART, CALIBRATION_PART, RECORD_PART)
}
"""How answers are read, by their kinds."""
