"""Shapes of structures in space as VTP files: tubes and ribbons, or centre lines with frames.

References
----------
VTK XML formats, https://docs.vtk.org/en/latest/vtk_file_formats/.
"""

from pathlib import Path

import numpy as np

from equimorph.argument_checks import check_arguments
from equimorph.array_types import Int, Shaped
from equimorph.errors import InputError
from equimorph.model import names_of
from equimorph.storage.files import write_bytes
from equimorph.storage.surface import vtp_file
from equimorph.structures import States
from equimorph.structures.solids import RADIUS, solids

Columns = dict[str, Shaped[np.ndarray, "..."]]


@check_arguments
def write_shapes(path: str | Path, states: States, *, lines: bool = False) -> Path:
    """Write what states of a structure in space look like, for ParaView.

    By default the surfaces of tubes and ribbons as figures show them, with normals and `white` that
    is positive on the stripe of a tube and on the back of a ribbon; with `lines` the centre lines,
    with `tangent`, `normal`, `binormal` of rods and a `radius` for the Tube filter. Every point has
    the number of its `state` and all parameters.

    Parameters
    ----------
    path
        Name of the file, ending in ``.vtp``.
    states
        At least one, of a structure in space.
    lines
        Whether to write lines instead of surfaces.

    Raises
    ------
    InputError
        For another ending, a planar structure, no states, or if `path` cannot be written.
    """
    path = Path(path)
    if path.suffix.lower() != ".vtp":
        raise InputError(f"`path` must end in .vtp; got {path.name!r}.")
    if not len(states) or states[:1].shape().shape[2] != 3:
        raise InputError(
            f"`states` must be states of a structure in space, one at least; got {states!r}."
        )
    return write_bytes(path, _centre_lines(states) if lines else _surfaces(states))


def _size(states: States) -> float:
    return float(np.ptp(states.shape().reshape(-1, 3), axis=0).max()) or 1.0


def _by_state(states: States, owner: Int[np.ndarray, " points"]) -> Columns:
    """Number and parameters of the state that each point belongs to."""
    names = names_of(states.structure.parameters)
    return {"state": owner, **{name: states[name][owner] for name in names}}


def _surfaces(states: States) -> bytes:
    meshes = solids(states, _size(states))
    counts = [3 * len(mesh.corners) for mesh in meshes]
    columns = _by_state(states, np.repeat(np.arange(len(states)), counts))
    columns["normals"] = np.concatenate([mesh.normals.reshape(-1, 3) for mesh in meshes])
    columns["white"] = np.repeat(np.concatenate([mesh.white for mesh in meshes]), 3)
    points = np.concatenate([mesh.corners.reshape(-1, 3) for mesh in meshes])
    ends = 3 * np.arange(1, len(points) // 3 + 1)
    return vtp_file(points, "Polys", np.arange(len(points)), ends, columns, {})


def _centre_lines(states: States) -> bytes:
    shapes = states.shape()
    count, each = shapes.shape[:2]
    columns = _by_state(states, np.repeat(np.arange(count), each))
    frames = states.frames()
    if frames is not None:
        for k, name in enumerate(("tangent", "normal", "binormal")):
            columns[name] = frames[..., k].reshape(-1, 3)
    columns["radius"] = np.full(count * each, RADIUS * _size(states))
    ends = each * np.arange(1, count + 1)
    points = shapes.reshape(-1, 3)
    return vtp_file(points, "Lines", np.arange(len(points)), ends, columns, {})
