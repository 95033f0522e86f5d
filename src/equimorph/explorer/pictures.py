"""Pictures of many states as mean + coefficients · modes, which works for every structure.

A picture is everything that a structure says of itself to draw, as one list of numbers: the points
of its shape, places and directions of supports, forces, couples and actuators, all as lengths in
the drawing. Over a set of at most three dimensions a few dozen modes (principal components) give
all pictures within `FIDELITY`.
"""

import base64
import json
import zlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from equimorph.arrays import Float, Num, UInt16, Values
from equimorph.model import Couples, Drawing, Forces
from equimorph.structures import States

TOP = 65535
"""Largest number of 16 bits."""
LEVEL = 7
"""Of compression: the highest one, 9, takes ten times as long for 1.3 % less."""
_KINDS = {"u1": "u8", "u2": "u16", "i4": "i32", "f4": "f32"}


def pack(arrays: Mapping[str, Num[np.ndarray, "..."]]) -> tuple[list[dict[str, Any]], str]:
    """Directory of arrays, and their bytes, compressed and written in base 64.

    The page unpacks the text. Whole numbers are written as differences from row to row, every
    column by itself, and all numbers byte by byte (all first bytes, then all second ones), which
    compresses best.

    `arrays`: by name, with one or two axes, of 8 or 16 bits without sign, of 32 bits, or single
    floats. Returns name, kind, rows and columns of each, in the order of the bytes; the bytes as
    text.
    """
    directory: list[dict[str, Any]] = []
    chunks = []
    for name, array in arrays.items():
        rows = array.reshape(len(array), array.shape[1] if array.ndim > 1 else 1)
        columns = np.ascontiguousarray(rows.T)
        if array.dtype.kind != "f" and len(rows):
            first = columns[:, :1]
            steps = np.diff(columns.astype(np.int64), axis=1).astype(columns.dtype)
            columns = np.ascontiguousarray(np.concatenate([first, steps], axis=1))
        planes = columns.reshape(-1).view(np.uint8).reshape(-1, array.dtype.itemsize).T
        chunks.append(planes.tobytes())
        kind = _KINDS[array.dtype.str[1:]]
        directory.append({"name": name, "kind": kind, "rows": len(rows), "columns": rows.shape[1]})
    return directory, base64.b64encode(zlib.compress(b"".join(chunks), LEVEL)).decode("ascii")


def quantise(values: Values) -> tuple[UInt16[np.ndarray, " lanes"], float, float]:
    """Finite values as whole numbers of 16 bits; the lowest value, and the value of one step."""
    known = np.where(np.isfinite(values), values, np.nan)
    if not np.isfinite(known).any():
        return np.zeros(len(values), np.uint16), 0.0, 0.0
    low = float(np.nanmin(known))
    step = float(np.nanmax(known) - low) / TOP
    shares = np.nan_to_num((known - low) / (step or 1.0), nan=0.0)
    return np.round(shares).astype(np.uint16), low, step


def json_in_html(data: Any) -> str:
    """JSON that can stand inside a script element: no character of it ends the element."""
    text = json.dumps(data, ensure_ascii=False, allow_nan=False, separators=(",", ":"))
    return text.replace("<", "\\u003c").replace("\u2028", "\\u2028").replace("\u2029", "\\u2029")


FIDELITY = 2e-4
"""Largest error of a point of a picture at a vertex, as a share of the size of the structure."""
_STEP = 3e-5
"""Step of the coefficients, as a share of the size; rounding adds about twice this."""
_SAMPLE, _WORST, _ROUNDS = 1500, 300, 4
"""Pictures from which modes are computed, the worst ones that are added, and how often."""
_AT_ONCE = 8192
"""Pictures in memory at once."""
_MODES_AT_ONCE = 4
"""Modes between two looks at the error."""
_DIRECTION, _LINE_LOAD, _FORCE, _COUPLE = 0.05, 0.09, 0.15, 0.06
"""Lengths of unit directions, of the longest arrows of line loads and forces, and of the largest
couple in a picture, as shares of the size of the structure."""
_RIBBON = 0.02
"""Half the width of a drawn strip, as a share of the size of the structure."""

Pictures = Float[np.ndarray, "lanes numbers"]
Rows = Float[np.ndarray, "modes numbers"]
Coefficients = Float[np.ndarray, "lanes modes"]


@dataclass(frozen=True)
class Scales:
    """Size of the structure, and what arrows are compared with.

    size: larger side of the box around the shapes; line_load, force, couple: the largest ones.
    """

    size: float
    line_load: float
    force: float
    couple: float

    def of_forces(self, forces: Forces) -> float:
        """Length of an arrow per force."""
        most = self.line_load if forces.distributed else self.force
        longest = _LINE_LOAD if forces.distributed else _FORCE
        return longest * self.size / most if most > 0.0 else 0.0


@dataclass(frozen=True, eq=False)
class Gallery:
    """Pictures of all states, packed."""

    layout: list[dict[str, Any]]
    """Parts of a picture in the order of its numbers, as plain data for the page."""
    space: int
    """2 or 3: coordinates of a point."""
    size: float
    """Size of the structure in its unit of length."""
    mean: Float[np.ndarray, " numbers"]
    modes: Rows
    """Numbers of the mean picture, and of the modes; the largest number of a mode is 1."""
    low: Float[np.ndarray, " modes"]
    step: Float[np.ndarray, " modes"]
    """Lowest coefficient of each mode, and the value of one step."""
    coefficients: UInt16[np.ndarray, "lanes modes"]
    """Steps above the lowest."""
    error: float
    """Largest error of a number of a picture without rounding, as a share of the size."""


def gallery(states: States) -> Gallery:
    """Pictures of states, at least one, within `FIDELITY`.

    Modes come from a sample; the pictures that they give worst are added to it, a few times.
    """
    scales = _scales(states)
    layout = _picture(states[:1], scales)[1]
    chosen = np.unique(np.linspace(0, len(states) - 1, _SAMPLE).astype(int))
    for _ in range(_ROUNDS):
        sample = _picture(states[chosen], scales)[0]
        mean = sample.mean(axis=0)
        modes = _modes(sample - mean, 0.5 * FIDELITY * scales.size)
        parts = [_project(whole - mean, modes) for whole in _all(states, scales)]
        errors = np.concatenate([error for _, error in parts]) / scales.size
        worst = np.argsort(errors)[-_WORST:]
        if errors.max() <= FIDELITY or np.isin(worst, chosen).all():
            break
        chosen = np.unique(np.concatenate([chosen, worst]))
    coefficients = np.concatenate([each for each, _ in parts])
    low = coefficients.min(axis=0)
    step = np.maximum(_STEP * scales.size, np.ptp(coefficients, axis=0) / TOP)
    whole = np.round((coefficients - low) / step).astype(np.uint16)
    space = states[:1].shape().shape[2]
    return Gallery(layout, space, scales.size, mean, modes, low, step, whole, float(errors.max()))


def _all(states: States, scales: Scales) -> Iterator[Pictures]:
    for first in range(0, len(states), _AT_ONCE):
        yield _picture(states[first : first + _AT_ONCE], scales)[0]


def _modes(centred: Pictures, tolerance: float) -> Rows:
    """As few principal components as give all pictures within a tolerance, largest number 1."""
    rows = _components(centred)
    rest, count = centred.copy(), 0
    while count < len(rows) and np.abs(rest).max(initial=0.0) > tolerance:
        some = rows[count : count + _MODES_AT_ONCE]
        rest -= (rest @ some.T) @ some
        count += len(some)
    kept = rows[: max(count, 1)]
    return np.asarray(kept / np.abs(kept).max(axis=1, keepdims=True))


def _components(centred: Pictures) -> Rows:
    """Principal components, the largest first.

    They are eigenvectors of the products of the pictures' numbers, or of the pictures if these are
    fewer: that takes a tenth of the time of singular values, and loses components far below
    `FIDELITY` only.
    """
    if len(centred) >= centred.shape[1]:
        return np.linalg.eigh(centred.T @ centred)[1].T[::-1]
    of_pictures = np.linalg.eigh(centred @ centred.T)[1][:, ::-1]
    return np.linalg.qr(centred.T @ of_pictures)[0].T


def _project(centred: Pictures, modes: Rows) -> tuple[Coefficients, Values]:
    """Coefficients of pictures, and the largest error of each."""
    found = centred @ modes.T / (modes**2).sum(axis=1)
    return found, np.abs(centred - found @ modes).max(axis=1)


def size_of(states: States) -> float:
    """Larger side of the box around a shape, the largest of a sample of the states."""
    some = states[np.unique(np.linspace(0, len(states) - 1, _SAMPLE).astype(int))]
    return float(np.ptp(some.shape(), axis=1).max()) or 1.0


def _scales(states: States) -> Scales:
    """What lengths in pictures refer to, from a sample of the states."""
    some = states[np.unique(np.linspace(0, len(states) - 1, _SAMPLE).astype(int))]
    drawing = some.drawing()
    most = {
        distributed: max(
            (
                float(np.linalg.norm(each.vectors, axis=2).max(initial=0.0))
                for each in drawing.forces
                if each.distributed == distributed
            ),
            default=0.0,
        )
        for distributed in (True, False)
    }
    couple = max((float(np.abs(each.moments).max(initial=0.0)) for each in drawing.couples),
                 default=0.0)  # fmt: skip
    return Scales(size_of(states), most[True], most[False], couple)


def _picture(states: States, scales: Scales) -> tuple[Pictures, list[dict[str, Any]]]:
    """Pictures of a batch, and their layout."""
    shape, drawing = states.shape(), states.drawing()
    pieces: list[tuple[dict[str, Any], Float[np.ndarray, "lanes ..."]]] = [
        ({"what": "line", "points": shape.shape[1]}, shape)
    ]
    frames = states.frames() if states.structure.flatness > 1.0 else None
    if frames is not None:
        part = {"what": "ribbon", "points": shape.shape[1]}
        pieces.append((part, _RIBBON * scales.size * frames[..., 2]))
    pieces += _surroundings(drawing, scales)
    flat = [array.reshape(len(states), -1) for _, array in pieces]
    return np.concatenate(flat, axis=1), [part for part, _ in pieces]


def _surroundings(
    drawing: Drawing, scales: Scales
) -> list[tuple[dict[str, Any], Float[np.ndarray, "lanes ..."]]]:
    """Supports, forces, couples and actuators with their numbers."""
    pieces: list[tuple[dict[str, Any], Float[np.ndarray, "lanes ..."]]] = []
    for support in drawing.supports:
        both = np.stack([support.places, _DIRECTION * scales.size * support.directions], axis=1)
        pieces.append(({"what": "support", "kind": str(support.kind)}, both))
    for forces in drawing.forces:
        both = np.concatenate([forces.places, scales.of_forces(forces) * forces.vectors], axis=1)
        count = forces.places.shape[1]
        part = {"what": "forces", "distributed": forces.distributed, "points": count}
        pieces.append((part, both))
    pieces += [_couples(couples, scales) for couples in drawing.couples]
    for each in drawing.actuators:
        part = {"what": "actuator", "kind": str(each.kind), "points": each.line.shape[1]}
        pieces.append((part, each.line))
    return pieces


def _couples(
    couples: Couples, scales: Scales
) -> tuple[dict[str, Any], Float[np.ndarray, "lanes numbers"]]:
    length = _COUPLE * scales.size / scales.couple if scales.couple > 0.0 else 0.0
    lanes, count = couples.moments.shape
    numbers = [couples.places.reshape(lanes, -1), length * couples.moments]
    return {"what": "couples", "points": count}, np.concatenate(numbers, axis=1)
