"""Results as one HDF5 file for everybody: xarray opens its groups, ParaView its ``/VTKHDF``.

Groups: ``set`` (vertices and triangles of the equilibrium set), ``equilibria/<number>`` (states
over one point each), ``routes/<name>`` and ``maps/<name>`` (one each), and ``VTKHDF``, an
unstructured grid whose arrays are hard links to those of ``set``. The points of the grid are the
free parameters and a descriptor: that embedding is for looking at, the states are in ``set``.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import h5py

from equimorph.manifold import EquilibriumSet
from equimorph.model import Descriptor
from equimorph.storage import map_group, route_group, set_group, states_group
from equimorph.storage.files import write_bytes
from equimorph.storage.hdf import content, get_json, opened, put_json
from equimorph.storage.vtkhdf import link_grid
from equimorph.structures import States, from_identity
from equimorph.tasks import ActuatorMap, Route

FORMAT = "equimorph results"
VERSION = 1
SET, ROUTES, MAPS, EQUILIBRIA = "set", "routes", "maps", "equilibria"
STRUCTURE = "structure"


@dataclass(frozen=True)
class Results:
    """What a results file holds: a set, routes and maps by name, and equilibria over points."""

    equilibrium_set: EquilibriumSet
    routes: dict[str, Route]
    equilibria: tuple[States, ...]
    maps: dict[str, ActuatorMap] = field(default_factory=dict)


def write_results(
    path: str | Path,
    eset: EquilibriumSet,
    height: Descriptor,
    routes: Mapping[str, Route] | None = None,
    equilibria: Sequence[States] = (),
    maps: Mapping[str, ActuatorMap] | None = None,
) -> Path:
    """Write an equilibrium set and what was found on it, in one step.

    Parameters
    ----------
    path
        Name of the file.
    eset
        The set.
    height
        Third coordinate of the surface that ParaView shows.
    routes
        Routes by name.
    equilibria
        States over one point each.
    maps
        Maps by name.

    Raises
    ------
    InputError
        If `path` cannot be written, or the structure has a callable and cannot be written down.
    """
    identity = eset.structure.identity()

    def fill(file: h5py.File) -> None:
        put_json(file, STRUCTURE, identity)
        set_group.write(file.create_group(SET), eset, height)
        link_grid(file, file[SET])
        for number, states in enumerate(equilibria):
            states_group.write(file.create_group(f"{EQUILIBRIA}/{number}"), states)
        for name, route in (routes or {}).items():
            route_group.write(file.create_group(f"{ROUTES}/{name}"), route)
        for name, amap in (maps or {}).items():
            map_group.write(file.create_group(f"{MAPS}/{name}"), amap)

    return write_bytes(Path(path), content(FORMAT, VERSION, fill))


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
        eset = set_group.read(file[SET], structure)
        names = list(file[ROUTES]) if ROUTES in file else []
        routes = {name: route_group.read(file[ROUTES][name], structure) for name in names}
        count = len(file[EQUILIBRIA]) if EQUILIBRIA in file else 0
        equilibria = tuple(
            states_group.read(file[f"{EQUILIBRIA}/{number}"], structure) for number in range(count)
        )
        names = list(file[MAPS]) if MAPS in file else []
        maps = {name: map_group.read(file[MAPS][name], structure) for name in names}
    return Results(eset, routes, equilibria, maps)
