"""Lines of drawings as the joints and edges of trusses and frames."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from scipy.spatial import cKDTree

from equimorph.argument_checks import check_arguments
from equimorph.argument_kinds import one_of
from equimorph.arrays import Float, Int
from equimorph.errors import InputError
from equimorph.io.formats import Drawing, read_compas, read_dxf, read_ply, read_vtk
from equimorph.linalg.graphs import components
from equimorph.model.units import LENGTH, UNITS

SAME_PLACE = 1e-6
"""Distance of ends that are one joint, relative to the size of the drawing."""
READERS: dict[str, Callable[[Path], Drawing]] = {
    ".dxf": read_dxf,
    ".json": read_compas,
    ".ply": read_ply,
    **dict.fromkeys((".vtk", ".vtp", ".vtu"), read_vtk),
}
LENGTHS = tuple(unit for unit, (_, dimension) in UNITS.items() if dimension == LENGTH)
AXES = "xyz"

Plane = Literal["xy", "xz", "yz"]


@dataclass(frozen=True, eq=False)
class Lines:
    """Joints of a drawing, and the lines between them.

    Parameters
    ----------
    places
        Of the joints, in units of `unit`.
    ends
        Joints that each line joins.
    unit
        Of length; "" if the file states none and none was given.
    axes
        Of the drawing, that the columns of `places` are along.
    """

    places: Float[np.ndarray, "joints space"]
    ends: Int[np.ndarray, "lines 2"]
    unit: str
    axes: str

    def __repr__(self) -> str:
        """Numbers of joints and lines, and the extent."""
        size = " × ".join(f"{each:.6g}" for each in np.ptp(self.places, axis=0))
        return f"Lines({len(self.places)} joints, {len(self.ends)} lines; {size} {self.unit})"

    @property
    def names(self) -> list[str]:
        """Names of the joints: J1, J2, … in the order of the file."""
        return [f"J{k}" for k in range(1, len(self.places) + 1)]

    @property
    def joints(self) -> dict[str, tuple[float | str, ...]]:
        """Places by name, as `Truss`, `Frame` and `SpatialFrame` take them.

        They are texts with their unit where it is known, for structures with `units`.
        """
        unit = self.unit
        rows = ([f"{x!r} {unit}" if unit else x for x in row] for row in self.places.tolist())
        return dict(zip(self.names, map(tuple, rows), strict=True))

    @property
    def edges(self) -> list[tuple[str, str]]:
        """Pairs of joints, as the structures take them for bars or members."""
        names = self.names
        return [(names[a], names[b]) for a, b in self.ends.tolist()]

    @check_arguments
    def nearest(self, place: Sequence[float]) -> str:
        """Name of the joint nearest to a place in the unit of the drawing.

        Raises
        ------
        InputError
            If the place has another number of coordinates.
        """
        if len(place) != self.places.shape[1]:
            raise InputError(
                f"`place` must have {self.places.shape[1]} coordinates; got {len(place)}."
            )
        return self.names[int(np.linalg.norm(self.places - np.array(place), axis=1).argmin())]

    @check_arguments
    def lowest(self, axis: Annotated[str, one_of(*AXES)], within: float | None = None) -> list[str]:
        """Names of the joints that lie lowest along an axis, such as those on the ground.

        Parameters
        ----------
        axis
            "x", "y" or "z".
        within
            Height up to which joints count, in the unit of the drawing; by default 1e-6 of its
            size.

        Raises
        ------
        InputError
            For an axis that the joints have no coordinate along.
        """
        if axis not in self.axes:
            raise InputError(f"`axis` must be one of {', '.join(self.axes)}; got {axis!r}.")
        height = self.places[:, self.axes.index(axis)]
        reach = SAME_PLACE * float(np.ptp(self.places, axis=0).max()) if within is None else within
        low = height <= height.min() + reach
        return [name for name, is_low in zip(self.names, low, strict=True) if is_low]


@check_arguments
def read_lines(
    path: str | Path,
    *,
    unit: Annotated[str, one_of(*LENGTHS)] | None = None,
    tolerance: float | None = None,
    plane: Plane | None = None,
) -> Lines:
    """Read the lines that another program drew, as joints and edges of a truss or frame.

    Lines and polylines are read, each piece by itself; of meshes without lines the edges of the
    faces. Formats: DXF (lines and polylines of the model space; extra `geometry`), legacy and XML
    files of VTK (extra `geometry`), PLY with edges or faces, and JSON of COMPAS (graphs, meshes,
    lines, polylines).

    Parameters
    ----------
    path
        Ending in ``.dxf``, ``.vtk``, ``.vtp``, ``.vtu``, ``.ply`` or ``.json``.
    unit
        Unit of length of the drawing; by default what a DXF file states, else none.
    tolerance
        Distance up to which ends of lines are one joint, in the unit of the drawing; by default
        1e-6 of its size.
    plane
        "xy", "xz" or "yz" for structures in the plane: the two coordinates that are kept. The
        drawing must lie in such a plane. None: all three.

    Raises
    ------
    InputError
        For another ending, a file that cannot be read or has no lines, curves, a line shorter than
        `tolerance`, a drawing that leaves the plane, or if a package is missing.

    Examples
    --------
    ``dome = em.io.read_lines("dome.dxf", unit="mm")``, and then
    ``em.Truss(dome.joints, dome.edges, {joint: "xyz" for joint in dome.lowest("z")},
    {"P": {dome.nearest((0, 0, 900)): (0, 0, -1)}}, units={"force": "N", "length": "m"})``
    """
    file = Path(path)
    reader = READERS.get(file.suffix.lower())
    if reader is None:
        raise InputError(f"`path` must end in {', '.join(READERS)}; got {file.name!r}.")
    if not file.is_file():
        raise InputError(f"`path` must be a file; got none at {file}.")
    drawing = reader(file)
    if not drawing.polylines:
        seen = f"it has {drawing.content}" if drawing.content else "it is empty"
        raise InputError(f"`{file.name}` must have lines; got a file without: {seen}.")
    pieces = [np.stack([line[:-1], line[1:]], axis=1) for line in drawing.polylines]
    segments = np.concatenate(pieces).astype(float)
    if not np.isfinite(segments).all():
        raise InputError(f"`{file.name}` must have finite coordinates; got others.")
    size = float(np.ptp(segments.reshape(-1, 3), axis=0).max())
    reach = SAME_PLACE * size if tolerance is None else tolerance
    places, ends = _join(segments, reach)
    axes = _axes(places, plane, reach)
    kept = [AXES.index(axis) for axis in axes]
    return Lines(np.ascontiguousarray(places[:, kept]), ends, unit or drawing.unit, axes)


def _join(
    segments: Float[np.ndarray, "segments 2 3"], reach: float
) -> tuple[Float[np.ndarray, "joints 3"], Int[np.ndarray, "lines 2"]]:
    """Joints in the order of the lines, and which two each line joins; each pair once."""
    every = segments.reshape(-1, 3)
    pairs = cKDTree(every).query_pairs(reach, output_type="ndarray")
    group = components(len(every), pairs)
    _, first, group = np.unique(group, return_index=True, return_inverse=True)
    rank = np.argsort(np.argsort(first))
    joint = rank[group]
    ends = joint.reshape(-1, 2)
    short = np.flatnonzero(ends[:, 0] == ends[:, 1])
    if len(short):
        place = ", ".join(f"{x:.6g}" for x in segments[short[0], 0])
        raise InputError(
            f"`tolerance` must be less than the length of every line; got {reach:.3g} and a line "
            f"at ({place}) whose ends it makes one joint."
        )
    _, kept = np.unique(np.sort(ends, axis=1), axis=0, return_index=True)
    return every[np.sort(first)], ends[np.sort(kept)]


def _axes(places: Float[np.ndarray, "joints 3"], plane: Plane | None, reach: float) -> str:
    if plane is None:
        return AXES
    (across,) = set(AXES) - set(plane)
    thickness = float(np.ptp(places[:, AXES.index(across)]))
    if thickness > reach:
        raise InputError(
            f"`plane` must hold the whole drawing; got {plane!r} and joints that differ by "
            f"{thickness:.6g} along {across}."
        )
    return plane
