"""Lines of VTK files, legacy and XML, by pyvista."""

from pathlib import Path

import numpy as np

from equimorph.array_types import Int
from equimorph.errors import InputError
from equimorph.io.drawing import Drawing, Polyline, count_words, edges_of_faces
from equimorph.optional_packages import load_package

LINE, POLYLINE = 3, 4
"""Numbers of VTK for cells that are lines."""
POLYGONS = (5, 7, 9)
"""Numbers of triangles, polygons and quadrilaterals."""


def read_vtk(path: Path) -> Drawing:
    """Read lines and polylines; of meshes without lines the edges of their polygons.

    Raises
    ------
    InputError
        If the file holds no polygonal data or unstructured grid, or pyvista is not installed.
    """
    pyvista = load_package("pyvista", "geometry", "read_lines")
    try:
        grid = pyvista.read(path).cast_to_unstructured_grid()
    except (OSError, ValueError, AttributeError, RuntimeError) as error:
        raise InputError(f"`{path.name}` must be a mesh of VTK; got: {error}.") from error
    points, kinds = np.asarray(grid.points, dtype=float), np.asarray(grid.celltypes)
    cells = _cells(grid.cells.tolist())
    found: list[Polyline] = [
        points[cell] for cell, kind in zip(cells, kinds, strict=True) if kind in (LINE, POLYLINE)
    ]
    if not found:
        polygons = [cell for cell, kind in zip(cells, kinds, strict=True) if kind in POLYGONS]
        found = edges_of_faces(points, polygons)
    return Drawing(found, content=count_words(f"cells of type {kind}" for kind in kinds.tolist()))


def _cells(flat: list[int]) -> list[Int[np.ndarray, " corners"]]:
    """Corners of each cell, of a list in which their number precedes them."""
    found: list[Int[np.ndarray, " corners"]] = []
    at = 0
    while at < len(flat):
        found.append(np.array(flat[at + 1 : at + 1 + flat[at]]))
        at += 1 + flat[at]
    return found
