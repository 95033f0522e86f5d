"""Results as one HDF5 file for everybody: xarray opens its groups, ParaView its ``/VTKHDF``.

Groups: ``set`` (vertices and triangles of the equilibrium set), ``routes/<name>`` (one each), and
``VTKHDF``, an unstructured grid whose arrays are hard links to those of ``set``. The points of the
grid are the free parameters and a descriptor: that embedding is for looking at, the states are in
``set``.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from importlib.metadata import version as release
from pathlib import Path

import h5py

from equimorph.manifold import EquilibriumSet
from equimorph.model import Descriptor
from equimorph.storage import route_group, set_group
from equimorph.storage.files import replacing
from equimorph.storage.hdf import get_json, opened, put_json
from equimorph.storage.vtkhdf import link_grid
from equimorph.structures import from_identity
from equimorph.tasks import Route

FORMAT = "equimorph results"
VERSION = 1
SET, ROUTES, STRUCTURE = "set", "routes", "structure"


@dataclass(frozen=True)
class Results:
    """What a results file holds: a set, and routes on it by name."""

    equilibrium_set: EquilibriumSet
    routes: dict[str, Route]


def write_results(
    path: str | Path,
    eset: EquilibriumSet,
    height: Descriptor,
    routes: Mapping[str, Route] | None = None,
) -> Path:
    """Write an equilibrium set and routes on it, in one step.

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

    Raises
    ------
    InputError
        If `path` cannot be written, or the structure has a callable and cannot be written down.
    """
    identity = eset.structure.identity()
    with replacing(Path(path)) as partial, h5py.File(partial, "w") as file:
        file.attrs.update(format=FORMAT, version=VERSION, release=release("equimorph"))
        put_json(file, STRUCTURE, identity)
        set_group.write(file.create_group(SET), eset, height)
        link_grid(file, file[SET])
        for name, route in (routes or {}).items():
            route_group.write(file.create_group(f"{ROUTES}/{name}"), route)
    return Path(path)


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
    return Results(eset, routes)
