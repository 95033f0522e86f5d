"""Results as one HDF5 file for everybody: xarray opens its groups, ParaView its ``/VTKHDF``.

Groups: ``set`` (vertices and cells of the equilibrium set), ``equilibria/<number>`` (states
over one point each), ``routes/<name>`` and ``maps/<name>`` (one each), ``answers/<table>/<name>``
(to the other questions of a study; see `records`), and ``VTKHDF``, an unstructured grid whose
arrays are hard links to those of ``set``. The points of the grid are the free parameters and a
descriptor: that embedding is for looking at, the states are in ``set``.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import h5py

from equimorph.argument_checks import check_arguments
from equimorph.errors import InputError
from equimorph.manifold import EquilibriumSet
from equimorph.model import Descriptor
from equimorph.storage.hdf import (
    DAMAGE,
    ends_with_checksum,
    extend,
    get_json,
    open_file,
    put_json,
    write,
)
from equimorph.storage.owner import Owner
from equimorph.storage.records import label, read_record, write_record
from equimorph.storage.schemas import UnreadableError
from equimorph.storage.sets import link_grid, write_set
from equimorph.structures import States, Structure, from_identity
from equimorph.tasks.maps.actuator_map import ActuatorMap
from equimorph.tasks.route import Route

FORMAT = "equimorph results"
VERSION = 3
"""Version of the layout that is written, the newest that can be read."""
SET, ROUTES, MAPS, EQUILIBRIA, ANSWERS = "set", "routes", "maps", "equilibria", "answers"
STRUCTURE = "structure"
SCHEMAS = {ROUTES: "route", MAPS: "map", EQUILIBRIA: "states"}
"""Of groups in files of the first releases, which do not say."""


@dataclass(frozen=True)
class Results:
    """What a results file holds: a set, equilibria over points, and further answers.

    Routes and maps are there by name, other answers by table and name:
    ``results.answers["optimum"]["flattest"]``. What this release cannot read, because another
    release wrote it differently, is omitted and named in `unreadable`, with the reason.
    """

    equilibrium_set: EquilibriumSet | None
    routes: dict[str, Route]
    equilibria: tuple[States, ...]
    maps: dict[str, ActuatorMap] = field(default_factory=dict)
    answers: dict[str, dict[str, Any]] = field(default_factory=dict)
    unreadable: dict[str, str] = field(default_factory=dict)


@check_arguments
def write_results(
    path: str | Path,
    eset: EquilibriumSet | None,
    height: Descriptor,
    routes: Mapping[str, Route] | None = None,
    equilibria: Sequence[States] = (),
    maps: Mapping[str, ActuatorMap] | None = None,
    *,
    answers: Mapping[str, Mapping[str, Any]] | None = None,
    structure: Structure | None = None,
) -> Path:
    """Write an equilibrium set and what was found on it, and maps, in one step.

    Parameters
    ----------
    path
        Name of the file.
    eset
        The set, if there is one.
    height
        Coordinate after the free parameters in what ParaView shows.
    routes
        Routes by name.
    equilibria
        States over one point each.
    maps
        Maps by name.
    answers
        Other answers, by table and name.
    structure
        To which all belongs; needed where there is neither a set nor a map.

    Raises
    ------
    InputError
        If `path` cannot be written, the structure has a callable and cannot be written down, or
        none is known.
    """
    described: list[EquilibriumSet | ActuatorMap] = [] if eset is None else [eset]
    described += (maps or {}).values()
    structures = [*([] if structure is None else [structure]), *(d.structure for d in described)]
    if not structures:
        raise InputError("`structure` must be given where there is no set and no map; got none.")
    identity = structures[0].identity()

    def fill(file: h5py.File) -> None:
        put_json(file, STRUCTURE, identity)
        if eset is not None:
            label(file.create_group(SET), "set")
            write_set(file[SET], eset, height)
            link_grid(file, file[SET], eset.cells.shape[1])
        _add(file, routes or {}, equilibria, maps or {})
        for table, named in (answers or {}).items():
            for name, answer in named.items():
                write_record(file.create_group(f"{ANSWERS}/{table}/{name}"), answer)

    return write(Path(path), FORMAT, VERSION, fill)


@check_arguments
def append_results(
    path: str | Path,
    *,
    routes: Mapping[str, Route] | None = None,
    equilibria: Sequence[States] = (),
    maps: Mapping[str, ActuatorMap] | None = None,
) -> Path:
    """Add to a results file, in one step: readers find the old file or the new one.

    Parameters
    ----------
    path
        Name of a file that `write_results` or `save_set` wrote.
    routes, maps
        By names that the file does not have yet.
    equilibria
        States over one point each; they follow those that are there.

    Raises
    ------
    InputError
        If the file is missing, damaged or newer, cannot be written, has a route or map of such a
        name, or holds a set of another structure.
    """
    path = Path(path)

    def fill(file: h5py.File) -> None:
        for group, given in ((ROUTES, routes), (MAPS, maps)):
            known = [name for name in given or {} if f"{group}/{name}" in file]
            if known:
                raise InputError(f"`{group}` must have new names; got {', '.join(known)}.")
        signature = from_identity(get_json(file, STRUCTURE)).signature
        others = [*equilibria, *(amap.states for amap in (maps or {}).values())]
        others += [route.path.states for route in (routes or {}).values() if route.path]
        if any(states.structure.signature != signature for states in others):
            raise InputError(f"`{path}` must hold results of the same structure; got another one.")
        _add(file, routes or {}, equilibria, maps or {})

    return extend(path, FORMAT, VERSION, fill)


@check_arguments
def save_set(path: str | Path, eset: EquilibriumSet, height: Descriptor | None = None) -> Path:
    """Write an equilibrium set alone; see `write_results`.

    Parameters
    ----------
    path
        Name of the file.
    eset
        The set, over one, two or three parameters.
    height
        Coordinate after the free parameters in what ParaView shows; by default the descriptor that
        distinguishes the states of the structure.

    Raises
    ------
    InputError
        If `path` cannot be written, or the structure has a callable and cannot be written down.
    """
    return write_results(path, eset, height or eset.structure.elevation)


@check_arguments
def load_set(path: str | Path) -> EquilibriumSet:
    """Read the equilibrium set of a results file.

    Raises
    ------
    InputError
        If it is missing, no results file, newer than this release, truncated, damaged, or without
        a set.
    """
    with open_file(Path(path), FORMAT, VERSION) as file:
        if SET not in file:
            raise InputError(f"`{path}` must hold an equilibrium set; got a file without one.")
        eset: EquilibriumSet = read_record(file[SET], _owner(file), SET)
        return eset


def _add(
    file: h5py.File,
    routes: Mapping[str, Route],
    equilibria: Sequence[States],
    maps: Mapping[str, ActuatorMap],
) -> None:
    first = len(file[EQUILIBRIA]) if EQUILIBRIA in file else 0
    for number, states in enumerate(equilibria, first):
        write_record(file.create_group(f"{EQUILIBRIA}/{number}"), states)
    for name, route in routes.items():
        write_record(file.create_group(f"{ROUTES}/{name}"), route)
    for name, amap in maps.items():
        write_record(file.create_group(f"{MAPS}/{name}"), amap)


@check_arguments
def read_results(path: str | Path) -> Results:
    """Read what `write_results` wrote.

    Parameters
    ----------
    path
        Name of the file.

    Returns
    -------
    All that this release can read; `Results.unreadable` names the rest.

    Raises
    ------
    InputError
        If it is missing, no results file, newer than this release, truncated or damaged.
    """
    path = Path(path)
    with open_file(path, FORMAT, VERSION) as file:
        reader = _Reader(file, ends_with_checksum(path))
        eset = reader.read(SET, SET) if SET in file else None
        equilibria = reader.read_group(EQUILIBRIA)
        tables = list(file[ANSWERS]) if ANSWERS in file else []
        return Results(
            eset,
            reader.read_group(ROUTES),
            tuple(equilibria[number] for number in sorted(equilibria, key=int)),
            reader.read_group(MAPS),
            {table: reader.read_group(f"{ANSWERS}/{table}") for table in tables},
            reader.unreadable,
        )


class _Reader:
    """Reads the records of a file one by one, and names those that it cannot read."""

    def __init__(self, file: h5py.File, sealed: bool) -> None:
        self.unreadable: dict[str, str] = {}
        self._file, self._sealed, self._owner = file, sealed, _owner(file)

    def read_group(self, place: str) -> dict[str, Any]:
        """Read all records in a group, by name."""
        names = list(self._file[place]) if place in self._file else []
        found = {n: self.read(f"{place}/{n}", SCHEMAS.get(place, "record")) for n in names}
        return {n: each for n, each in found.items() if f"{place}/{n}" not in self.unreadable}

    def read(self, place: str, schema: str) -> Any:
        """Read one record; None where this release cannot."""
        try:
            return read_record(self._file[place], self._owner, schema)
        except UnreadableError as error:
            self.unreadable[place] = str(error)
        except DAMAGE as error:
            # A whole file makes sense to the release that wrote it: the record is another one.
            if not self._sealed:
                raise
            self.unreadable[place] = f"`record` must be one that this release can read: {error}"
        return None


def _owner(file: h5py.File) -> Owner:
    return Owner(from_identity(get_json(file, STRUCTURE)))
