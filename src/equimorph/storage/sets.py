"""Equilibrium sets as HDF5 groups, and the grid of a set that ParaView opens.

References
----------
VTKHDF file format 2.0, unstructured grid, https://docs.vtk.org/en/latest/vtk_file_formats/.
"""

from collections.abc import Sequence
from typing import Any

import h5py
import numpy as np

from equimorph.arrays import Float, Int
from equimorph.errors import InputError
from equimorph.manifold import Boundary, BoundaryKind, EquilibriumSet
from equimorph.manifold.complex.base_mesh import BaseMesh
from equimorph.model import Box, Descriptor
from equimorph.storage.hdf import add_dimension, get, get_json, put, put_json, put_parameters
from equimorph.storage.owner import Owner, words_of
from equimorph.storage.schemas import find_schema
from equimorph.structures import States
from equimorph.tables import units_of

ABOUT = "about"
GRID = ("vertices", "edges", "triangles", "sides", "tetrahedra", "faces")
"""Arrays of the triangulation of the box."""
INSIDE = ("Component", "Stratum", "Audit")
"""Records that a set consists of."""
LARGEST_RESIDUAL = 1e-6
"""Residual, in the units of the structure, beyond which a stored state is no equilibrium."""
SAMPLE = 1000
"""Number of states whose residuals are checked when a set is read."""
VTK_TYPES = {2: 3, 3: 5, 4: 10}
"""Cell types of VTK by the number of corners: line, triangle, tetrahedron."""


def write_set(group: h5py.Group, eset: EquilibriumSet, height: Descriptor | None = None) -> None:
    """Write a set into an empty group.

    `height` is the coordinate of the embedding after the free parameters; by default the descriptor
    that distinguishes states.
    """
    height = height or eset.structure.elevation
    points = eset.points
    # At the top, so that the arrays keep their dimensions where the grid links to them; further
    # sets of a file, as regions have them, keep theirs to themselves.
    top = group if "vertex" in group.file else group.file
    for name, size in (("vertex", len(points)), ("cell", len(eset.cells)), ("space", 3)):
        add_dimension(top, name, size)
    add_dimension(top, "corner", eset.cells.size)
    put(group, "z", points.z, ["vertex", "unknown"], "unknowns and multipliers")
    put_parameters(group, units_of(eset.structure.parameters), {"p": points.p}, "vertex")
    put(group, "kind", eset.kinds, ["vertex"], "see EquilibriumSet.kinds")
    put(group, "grid_vertex", eset.grid_vertex, ["vertex"], "vertex of the grid below, or -1")
    put(group, "index", eset.index, ["vertex"], "negative eigenvalues; 0 is stable")
    shown = [eset.structure.descriptor("energy"), height]
    for one in {d.name: d for d in [*shown, *(c.descriptor for c in eset.constraints)]}.values():
        name = one.name.replace("/", "_over_")
        if name not in group:
            put(group, name, one(points), ["vertex"], one.name, one.unit)
    each = f"vertices of each cell, {eset.cells.shape[1]} at a time"
    put(group, "connectivity", eset.cells.ravel(), ["corner"], each)
    put(group, "cell_index", eset.cell_index, ["cell"], "index of the stratum")
    put(group, "component", eset.component, ["cell"])
    put(group, "stratum", eset.stratum, ["cell"])
    put(group, "embedding", embedding(eset, height), ["vertex", "space"], "for looking at")
    for name in GRID:
        put(group, f"grid_{name}", getattr(eset.mesh, name), [f"grid_{name}_entry", f"of_{name}"])
    _put_chains(group, "fold", eset.folds)
    _put_chains(group, "crossing", eset.crossings)
    _put_chains(group, "boundary", [each.vertices for each in eset.boundaries])
    put_json(group, ABOUT, _about(eset))


def read_set(group: h5py.Group, owner: Owner) -> EquilibriumSet:
    """Read what `write_set` wrote.

    Raises `ValueError` if the parts do not belong together. Raises `InputError` if the states are
    no equilibria of the structure.
    """
    about = get_json(group, ABOUT)
    d = len(about["box"])
    chains = zip(_chains(group, "boundary", d), about["boundary_kinds"], strict=True)
    eset = EquilibriumSet(
        structure=owner.structure,
        box=Box(**about["box"]),
        fixed=about["fixed"],
        constraints=tuple(map(owner.constraint, about["constraints"])),
        intervals=tuple(about["intervals"]),
        points=States(owner.structure, get(group, "z"), get(group, "p")),
        kinds=get(group, "kind"),
        index=get(group, "index"),
        cells=get(group, "connectivity").reshape(-1, d + 1),
        cell_index=get(group, "cell_index"),
        component=get(group, "component"),
        stratum=get(group, "stratum"),
        folds=tuple(_chains(group, "fold", d)),
        boundaries=tuple(Boundary(vertices, BoundaryKind(kind)) for vertices, kind in chains),
        components=tuple(_build("Component", each, about) for each in about["components"]),
        strata=tuple(_build("Stratum", each, about) for each in about["strata"]),
        audit=_build("Audit", about["audit"], about),
        # sets over two parameters were once stored without tetrahedra
        mesh=BaseMesh(
            **{name: get(group, f"grid_{name}") for name in GRID if f"grid_{name}" in group}
        ),
        grid_vertex=get(group, "grid_vertex"),
        # older files have none
        crossings=tuple(_chains(group, "crossing", d)) if "crossing_end" in group else (),
    )
    _check_parts(eset)
    _check_states(eset)
    return eset


def _check_parts(eset: EquilibriumSet) -> None:
    """All arrays fit together, and every number of a thing is that of one."""
    points, count, cells = eset.points, len(eset.points), len(eset.cells)
    shapes = (points.z.shape, points.p.shape)
    sizes = eset.structure.size, len(eset.structure.parameters)
    pieces = [*eset.folds, *eset.crossings, *(each.vertices for each in eset.boundaries)]
    fits = (
        shapes == ((count, sizes[0]), (count, sizes[1])),
        all(len(each) == count for each in (eset.kinds, eset.index, eset.grid_vertex)),
        all(len(each) == cells for each in (eset.cell_index, eset.component, eset.stratum)),
        all(_below(each, count) for each in (eset.cells, *pieces)),
        _below(eset.component, len(eset.components)),
        _below(eset.stratum, len(eset.strata)),
        _below(eset.grid_vertex + 1, len(eset.mesh.vertices) + 1),
        _below(eset.mesh.cells, len(eset.mesh.vertices)),
        bool(np.isfinite(points.z).all() and np.isfinite(points.p).all()),
    )
    if not all(fits):
        raise ValueError("the arrays of the set do not belong together")


def _below(numbers: Int[np.ndarray, "..."], count: int) -> bool:
    return bool(((numbers >= 0) & (numbers < count)).all())


def _check_states(eset: EquilibriumSet) -> None:
    """Some of the states, spread over all, are equilibria."""
    some = np.unique(np.linspace(0, max(len(eset.points) - 1, 0), SAMPLE).astype(int))
    states = eset.points[some[some < len(eset.points)]]
    largest = float(states.residual.max(initial=0.0))
    if not largest <= LARGEST_RESIDUAL:
        raise InputError(
            "`path` must hold equilibria of its structure; got states with a residual of "
            f"{largest:.1e}. Compute the set again."
        )


def _about(eset: EquilibriumSet) -> dict[str, object]:
    box = eset.box
    sides = zip(box.names, box.lower.tolist(), box.upper.tolist(), strict=True)
    return {
        "box": {name: [low, high] for name, low, high in sides},
        "fixed": dict(eset.fixed),
        "constraints": [words_of(each) for each in eset.constraints],
        "intervals": list(eset.intervals),
        "boundary_kinds": [each.kind for each in eset.boundaries],
        "components": [find_schema("Component").values(each) for each in eset.components],
        "strata": [find_schema("Stratum").values(each) for each in eset.strata],
        "audit": find_schema("Audit").values(eset.audit),
        "versions": {name: find_schema(name).change.version for name in INSIDE},
    }


def _build(name: str, values: dict[str, Any], about: dict[str, Any]) -> Any:
    """Record inside a set; older files give no versions."""
    version = about.get("versions", {}).get(name, 1)
    return find_schema(name).build(version, _tuples(values))


def _tuples(value: Any) -> Any:
    """Plain data from JSON, which knows no tuples, as a frozen dataclass holds it."""
    if isinstance(value, dict):
        return {name: _tuples(each) for name, each in value.items()}
    return tuple(_tuples(each) for each in value) if isinstance(value, list) else value


def embedding(eset: EquilibriumSet, height: Descriptor) -> Float[np.ndarray, "vertices 3"]:
    """Points in space: the free parameters, then the height, then zeros; the first three."""
    columns = [eset.coordinates, height(eset.points), np.zeros(len(eset.points))]
    return np.ascontiguousarray(np.column_stack(columns)[:, :3])


def _put_chains(group: h5py.Group, name: str, chains: Sequence[Int[np.ndarray, "..."]]) -> None:
    """Write vertices of pieces one after the other, and where each of them ends."""
    flat = [chain.ravel() for chain in chains]
    joined = np.concatenate([np.zeros(0, dtype=np.int64), *flat])
    ends = np.cumsum([len(chain) for chain in flat], dtype=np.int64)
    put(group, f"{name}_vertex", joined, [f"{name}_entry"], f"vertices of each {name} in order")
    put(group, f"{name}_end", ends, [name], f"entries before the end of each {name}")


def _chains(group: h5py.Group, name: str, d: int) -> list[Int[np.ndarray, "..."]]:
    """Pieces as they are in a set over d parameters; see `Boundary`."""
    ends, joined = get(group, f"{name}_end"), get(group, f"{name}_vertex")
    if len(joined) != (ends[-1] if len(ends) else 0) or (np.diff(ends, prepend=0) < 0).any():
        raise ValueError(f"pieces named {name} do not end where they should")
    flat = np.split(joined, ends[:-1]) if len(ends) else []
    return [piece.reshape(-1, 3) for piece in flat] if d == 3 else list(flat)


def link_grid(file: h5py.File, group: h5py.Group, size: int) -> None:
    """Add ``/VTKHDF`` to a file whose `group` holds a set of cells with `size` corners.

    The group has ``embedding``, ``connectivity`` and arrays along the dimensions vertex and cell.
    """
    grid = file.create_group("VTKHDF")
    grid.attrs["Version"] = np.array([1, 0])  # as later ones for one grid; older readers warn
    grid.attrs["Type"] = np.bytes_("UnstructuredGrid")
    grid["Points"], grid["Connectivity"] = group["embedding"], group["connectivity"]
    points, corners = len(group["embedding"]), len(group["connectivity"])
    for name, number in (
        ("NumberOfPoints", points),
        ("NumberOfCells", corners // size),
        ("NumberOfConnectivityIds", corners),
    ):
        put(grid, name, np.array([number], dtype=np.int64), ["piece"])
    put(grid, "Offsets", np.arange(0, corners + 1, size, dtype=np.int64), ["offset"])
    put(grid, "Types", np.full(corners // size, VTK_TYPES[size], dtype=np.uint8), ["cell"])
    for kind, dimension in (("PointData", "vertex"), ("CellData", "cell")):
        fields = grid.create_group(kind)
        for name, dataset in group.items():
            if _lies_along(dataset, file[dimension]):
                fields[name] = dataset


def _lies_along(dataset: h5py.Dataset, dimension: h5py.Dataset) -> bool:
    """Whether an array has one number for each entry of a dimension."""
    if dataset.ndim != 1 or dataset.is_scale:
        return False
    return any(scale == dimension for scale in dataset.dims[0].values())
