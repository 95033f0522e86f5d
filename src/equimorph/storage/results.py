"""Results as one HDF5 file for everybody: xarray opens its groups, ParaView its ``/VTKHDF``.

Groups: ``set`` (vertices and cells of the equilibrium set), ``equilibria/<number>`` (states
over one point each), ``routes/<name>`` and ``maps/<name>`` (one each), ``answers/<table>/<name>``
(to the other questions of a study), and ``VTKHDF``, an unstructured grid whose arrays are hard
links to those of ``set``. The points of the grid are the free parameters and a descriptor: that
embedding is for looking at, the states are in ``set``.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import h5py

from equimorph.errors import InputError
from equimorph.manifold import EquilibriumSet
from equimorph.model import Descriptor
from equimorph.storage import map_group, route_group, set_group, states_group
from equimorph.storage.hdf import extend, get_json, opened, put_json, write
from equimorph.storage.parts import PARTS, Part
from equimorph.storage.vtkhdf import link_grid
from equimorph.structures import States, Structure, from_identity
from equimorph.tasks import ActuatorMap, Route

FORMAT = "equimorph results"
VERSION = 2
SET, ROUTES, MAPS, EQUILIBRIA, ANSWERS = "set", "routes", "maps", "equilibria", "answers"
STRUCTURE, KIND = "structure", "kind"


@dataclass(frozen=True)
class Answer:
    """An answer to a question of a study, and how such answers are stored."""

    part: Part[Any]
    value: Any


@dataclass(frozen=True)
class Results:
    """What a results file holds: a set, equilibria over points, and what else was asked for.

    Routes and maps are there by name, other answers by table and name:
    ``results.answers["optimum"]["flattest"]``.
    """

    equilibrium_set: EquilibriumSet | None
    routes: dict[str, Route]
    equilibria: tuple[States, ...]
    maps: dict[str, ActuatorMap] = field(default_factory=dict)
    answers: dict[str, dict[str, Any]] = field(default_factory=dict)


def write_results(
    path: str | Path,
    eset: EquilibriumSet | None,
    height: Descriptor,
    routes: Mapping[str, Route] | None = None,
    equilibria: Sequence[States] = (),
    maps: Mapping[str, ActuatorMap] | None = None,
    *,
    answers: Mapping[str, Mapping[str, Answer]] | None = None,
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
            set_group.write(file.create_group(SET), eset, height)
            link_grid(file, file[SET], eset.cells.shape[1])
        _add(file, routes or {}, equilibria, maps or {})
        for table, named in (answers or {}).items():
            for name, answer in named.items():
                group = file.create_group(f"{ANSWERS}/{table}/{name}")
                group.attrs[KIND] = answer.part.kind
                answer.part.write(group, answer.value)

    return write(Path(path), FORMAT, VERSION, fill)


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
        tells the structure's states apart.

    Raises
    ------
    InputError
        If `path` cannot be written, or the structure has a callable and cannot be written down.
    """
    return write_results(path, eset, height or eset.structure.elevation)


def load_set(path: str | Path) -> EquilibriumSet:
    """Read the equilibrium set of a results file.

    Raises
    ------
    InputError
        If it is missing, no results file, newer than this release, truncated, damaged, or without
        a set.
    """
    with opened(Path(path), FORMAT, VERSION) as file:
        if SET not in file:
            raise InputError(f"`{path}` must hold an equilibrium set; got a file without one.")
        return set_group.read(file[SET], from_identity(get_json(file, STRUCTURE)))


def _add(
    file: h5py.File,
    routes: Mapping[str, Route],
    equilibria: Sequence[States],
    maps: Mapping[str, ActuatorMap],
) -> None:
    first = len(file[EQUILIBRIA]) if EQUILIBRIA in file else 0
    for number, states in enumerate(equilibria, first):
        states_group.write(file.create_group(f"{EQUILIBRIA}/{number}"), states)
    for name, route in routes.items():
        route_group.write(file.create_group(f"{ROUTES}/{name}"), route)
    for name, amap in maps.items():
        map_group.write(file.create_group(f"{MAPS}/{name}"), amap)


def read_results(path: str | Path) -> Results:
    """Read what `write_results` wrote.

    Parameters
    ----------
    path
        Name of the file.

    Raises
    ------
    InputError
        If it is missing, no results file, newer than this release, truncated or damaged.
    """
    with opened(Path(path), FORMAT, VERSION) as file:
        structure = from_identity(get_json(file, STRUCTURE))
        eset = set_group.read(file[SET], structure) if SET in file else None
        names = list(file[ROUTES]) if ROUTES in file else []
        routes = {name: route_group.read(file[ROUTES][name], structure) for name in names}
        count = len(file[EQUILIBRIA]) if EQUILIBRIA in file else 0
        equilibria = tuple(
            states_group.read(file[f"{EQUILIBRIA}/{number}"], structure) for number in range(count)
        )
        names = list(file[MAPS]) if MAPS in file else []
        maps = {name: map_group.read(file[MAPS][name], structure) for name in names}
        answers = {
            table: {name: _answer(group, structure) for name, group in named.items()}
            for table, named in (file[ANSWERS].items() if ANSWERS in file else ())
        }
    return Results(eset, routes, equilibria, maps, answers)


def _answer(group: h5py.Group, structure: Structure) -> Any:
    return PARTS[group.attrs[KIND]].read(group, structure)
