"""The grid that ParaView opens: an unstructured grid made of hard links.

References
----------
VTKHDF file format 2.0, unstructured grid, https://docs.vtk.org/en/latest/vtk_file_formats/.
"""

import h5py
import numpy as np

from equimorph.storage.hdf import put

TYPES = {2: 3, 3: 5, 4: 10}
"""Cell types of VTK by their number of corners: line, triangle, tetrahedron."""


def link_grid(file: h5py.File, group: h5py.Group, size: int) -> None:
    """Add ``/VTKHDF`` to a file whose `group` holds an equilibrium set.

    Parameters
    ----------
    file
        Where the grid goes.
    group
        With ``embedding``, ``connectivity`` and arrays along the file's dimensions vertex and cell.
    size
        Corners of a cell.
    """
    grid = file.create_group("VTKHDF")
    grid.attrs["Version"] = np.array([2, 0])
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
    put(grid, "Types", np.full(corners // size, TYPES[size], dtype=np.uint8), ["cell"])
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
