"""HDF5 pieces that h5netcdf (and so xarray) understands: named dimensions, text as JSON.

A file ends with a checksum of all its bytes, which HDF5 ignores: damage anywhere is found before
anything is read. In addition every array carries a checksum, for files that another program
has changed and so stripped of theirs.
"""

import hashlib
import io
import json
from collections.abc import Callable, Generator, Mapping, Sequence
from contextlib import contextmanager
from functools import partial
from importlib.metadata import version as release
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from equimorph.arrays import Shaped
from equimorph.errors import InputError
from equimorph.linalg.lanes import in_background
from equimorph.storage.files import replacing

BLOCK = 1 << 24
"""Bytes by which files in memory grow."""
PARAMETER, PARAMETER_UNIT = "parameter", "parameter_unit"
"""Coordinate of arrays with a column for each parameter, and the units along it."""
MARK = b"equimorph-sha256"
"""Precedes the checksum at the end of a file."""

DAMAGE = (OSError, RuntimeError, LookupError, ValueError, TypeError, AttributeError, MemoryError)
"""What the HDF5 library and readers of its content raise when the content makes no sense."""

# The name in netCDF-4 of a dimension without coordinates.
_BARE_DIMENSION = "This is a netCDF dimension but not a netCDF variable. %9d"


def put(
    group: h5py.Group,
    name: str,
    values: Shaped[np.ndarray, "..."],
    dimensions: Sequence[str],
    meaning: str = "",
    unit: str = "",
) -> h5py.Dataset:
    """Store an array with the names of its dimensions, its meaning and its unit.

    Dimensions, one name for each axis, are made in `group` unless it or a group above has them.
    People read the meaning, programs the attribute ``units``.
    """
    array = np.asarray(values)
    plain = array.size == 0 or array.dtype.kind in "OU"
    filters: dict[str, Any] = {} if plain else {"fletcher32": True}
    if array.dtype.kind in "iu" and not plain:
        # digits of computed numbers are random: compressing them saves a tenth in twenty times
        filters |= {"compression": "gzip", "compression_opts": 1, "shuffle": True}
    kind = h5py.string_dtype() if array.dtype.kind in "OU" else array.dtype
    dataset = group.create_dataset(name, data=array.astype(kind, copy=False), dtype=kind, **filters)
    _label(dataset, meaning, unit)
    for axis, (dimension, size) in enumerate(zip(dimensions, array.shape, strict=True)):
        dataset.dims[axis].attach_scale(_dimension(group, dimension, size))
    return dataset


def put_json(group: h5py.Group, name: str, content: Any) -> None:
    """Store plain data as one text; a dataset, because attributes end at 64 KiB."""
    group.create_dataset(name, data=json.dumps(content, ensure_ascii=False))


def get(group: h5py.Group, name: str) -> Shaped[np.ndarray, "..."]:
    """Read an array; texts as Python strings."""
    dataset = group[name]
    return np.asarray(
        dataset.asstr()[...] if h5py.check_string_dtype(dataset.dtype) else dataset[...]
    )


def get_json(group: h5py.Group, name: str) -> Any:
    """Read plain data."""
    return json.loads(group[name].asstr()[()])


def content(kind: str, version: int, fill: Callable[[h5py.File], None]) -> bytes:
    """Return the content of a new HDF5 file of ours, with its checksum; see `write`."""
    image = _image(kind, version, fill)
    return b"".join((image, MARK, hashlib.sha256(image).digest()))


def write(path: Path, kind: str, version: int, fill: Callable[[h5py.File], None]) -> Path:
    """Write a new HDF5 file of ours, of a kind and version, in one step.

    It is made in memory: on a full disk the HDF5 library fails late and leaves a wreck open, while
    bytes are written or not.
    """
    return _write_with_checksum(path, _image(kind, version, fill))


def extend(path: Path, kind: str, version: int, fill: Callable[[h5py.File], None]) -> Path:
    """Put more into a file of ours, in one step; refused as by `open_file`."""
    memory = io.BytesIO()
    with open_file(path, kind, version):
        memory.write(_strip_checksum(path.read_bytes()))
    with h5py.File(memory, "r+") as file:
        fill(file)
    return _write_with_checksum(path, memory.getvalue())


def _image(kind: str, version: int, fill: Callable[[h5py.File], None]) -> bytes:
    with h5py.File("memory", "w", driver="core", backing_store=False, block_size=BLOCK) as file:
        file.attrs.update(format=kind, version=version, release=release("equimorph"))
        fill(file)
        file.flush()
        return bytes(file.id.get_file_image())


def _write_with_checksum(path: Path, image: bytes) -> Path:
    """Write content, and behind it its checksum, which another thread finds meanwhile."""
    checksum = hashlib.sha256()
    (summed,) = in_background([partial(checksum.update, image)])
    with replacing(path) as incomplete:
        incomplete.write_bytes(image)
        summed.result()
        with incomplete.open("ab") as file:
            file.write(MARK + checksum.digest())
    return path


@contextmanager
def open_file(path: Path, kind: str, version: int) -> Generator[h5py.File]:
    """Open a file of ours for reading.

    Parameters
    ----------
    path
        Name of the file.
    kind
        What its attribute ``format`` must say.
    version
        The newest version that can be read.

    Raises
    ------
    InputError
        If it is missing, no HDF5 file, of another kind, newer, truncated or damaged.
    """
    try:
        _strip_checksum(path.read_bytes())
        with h5py.File(path, "r") as file:
            _check_kind(file, path, kind, version)
            yield file
    except InputError:
        raise
    except FileNotFoundError as error:
        raise InputError(f"`{path}` must be a file; got none.") from error
    except DAMAGE as error:
        raise InputError(
            f"`{path}` must be a whole HDF5 file; got a damaged or truncated one, or no HDF5 file "
            "at all. Compute it again."
        ) from error


def ends_with_checksum(path: Path) -> bool:
    """Whether a file ends with a checksum; one that another program has changed does not."""
    size = len(MARK) + hashlib.sha256().digest_size
    return path.read_bytes()[-size:].startswith(MARK)


def _strip_checksum(content: bytes) -> bytes:
    """Content without its checksum, if it has one, which must be right."""
    start = len(content) - len(MARK) - hashlib.sha256().digest_size
    place = content.rfind(MARK)
    if place < 0:
        return content
    if place != start:
        raise ValueError("something was appended")
    seal = memoryview(content)[start + len(MARK) :]
    if hashlib.sha256(memoryview(content)[:start]).digest() != seal:
        raise ValueError("the checksum is another one")
    return content[:start]


def _check_kind(file: h5py.File, path: Path, kind: str, version: int) -> None:
    if file.attrs.get("format") != kind:
        raise InputError(f"`{path}` must hold {kind}; got another HDF5 file.")
    if not 1 <= file.attrs["version"] <= version:
        raise InputError(
            f"`{path}` must have a version up to {version}; got {file.attrs['version']}. "
            "Read it with the equimorph that wrote it, or a newer one."
        )


def add_dimension(group: h5py.Group, name: str, size: int) -> h5py.Dataset:
    """Name a dimension, visible in `group` and in all groups below it."""
    # A dimension without coordinates stores nothing.
    dimension = group.create_dataset(name, shape=(size,), dtype=">f4")
    dimension.make_scale(_BARE_DIMENSION % size)
    return dimension


def put_coordinate(
    group: h5py.Group, name: str, values: Shaped[np.ndarray, " n"], meaning: str, unit: str = ""
) -> None:
    """Store the places along a dimension of the same name, before the arrays that use it."""
    texts = values.dtype.kind in "OU"
    kind = h5py.string_dtype() if texts else values.dtype
    data = values.astype(kind, copy=False)
    dataset = group.create_dataset(name, data=data, dtype=kind, fletcher32=not texts)
    dataset.make_scale(name)
    _label(dataset, meaning, unit)


def put_parameters(
    group: h5py.Group,
    units: Mapping[str, str],
    arrays: Mapping[str, Shaped[np.ndarray, "..."]],
    dimension: str,
) -> None:
    """Store arrays, by name, with a column for each parameter, which names and units label.

    The rows are those of a dimension.
    """
    if PARAMETER not in group:
        put_coordinate(group, PARAMETER, np.array([*units], object), "name of the parameter")
        each = np.array([*units.values()], object)
        put(group, PARAMETER_UNIT, each, [PARAMETER], "unit of the parameter")
    for name, values in arrays.items():
        dataset = put(group, name, values, [dimension, PARAMETER], "parameters")
        dataset.attrs["coordinates"] = PARAMETER_UNIT


def _label(dataset: h5py.Dataset, meaning: str, unit: str) -> None:
    for key, text in (("long_name", meaning), ("units", unit)):
        if text:
            dataset.attrs[key] = text


def _dimension(group: h5py.Group, name: str, size: int) -> h5py.Dataset:
    """Nearest dimension of this name and size, in the group or above it, else a new one."""
    place = group
    while True:
        known = place.get(name)
        if isinstance(known, h5py.Dataset) and known.is_scale and known.shape == (size,):
            return known
        if place.name == "/":
            return add_dimension(group, name if name not in group else f"{name}_{size}", size)
        place = place.parent
