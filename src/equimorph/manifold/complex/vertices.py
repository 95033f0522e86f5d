"""Vertices of a complex that is being cut and rearranged: exact points with tangent frames."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from equimorph.arrays import Float, ItemFlags, VertexFlags, VertexNumbers
from equimorph.columns import Columns
from equimorph.manifold.geometry.crossings import crossing_frames
from equimorph.manifold.geometry.exact_points import Corrected
from equimorph.manifold.geometry.points import VertexKind, on_fold
from equimorph.manifold.geometry.setting import Setting, embed
from equimorph.manifold.geometry.tangents import (
    cap_slopes,
    fold_slopes,
    frames_in_embedding,
    tangent_frames,
)

ROOM = 4
"""Vertices that there is room for when they are copied, relative to those that there are."""
ON_BOUND = 1e-7
"""Absolute excess over a constraint below which a vertex lies on its bound."""


@dataclass
class _Room:
    """Arrays with room for vertices beyond those in use; the first who needs it takes it."""

    arrays: dict[str, np.ndarray]
    used: int


@dataclass(frozen=True)
class Vertices(Columns):
    """Exact points with their tangent frames."""

    z: Float[np.ndarray, "V size"]
    p: Float[np.ndarray, "V P"]
    kinds: VertexNumbers
    index: VertexNumbers
    grid_vertex: VertexNumbers
    place: Float[np.ndarray, "V coordinates"]
    frame: Float[np.ndarray, "V d full"]
    rows: Float[np.ndarray, "V d coordinates"]
    fold_slope: Float[np.ndarray, "V d"]
    """Slope, along the frame, of the fold test; zero off folds. The next columns are alike."""
    cap_slope: Float[np.ndarray, "V d"]
    crossing_slope: Float[np.ndarray, "V d"]
    shared: VertexNumbers
    """Number that vertices have in common which are the same point of several sheets; else −1."""
    room: _Room | None = field(default=None, repr=False, compare=False, kw_only=True)

    def __len__(self) -> int:
        """Return the number of vertices."""
        return len(self.z)

    @property
    def columns(self) -> dict[str, np.ndarray]:
        """All that is known of each vertex."""
        return {name: column for name, column in vars(self).items() if name != "room"}

    def join(self, *more: "Vertices", place: VertexNumbers | None = None) -> "Vertices":
        """Return these vertices and more: part by part, or each in its place behind these.

        Copied only if there is no room behind them, so that many additions cost as much as few.
        """
        room, sizes = self.room, [len(part) for part in more]
        count = len(self) + sum(sizes)
        if room is None or not self._before(room) or count > len(room.arrays["z"]):
            room = self._roomy(ROOM * count)
        behind = np.arange(count - len(self)) if place is None else place
        for each, own in zip(more, np.split(behind, np.cumsum(sizes)[:-1]), strict=bool(more)):
            for name, column in each.columns.items():
                room.arrays[name][len(self) + own] = column
        room.used = count
        return replace(self, **{k: array[:count] for k, array in room.arrays.items()}, room=room)

    def _before(self, room: _Room) -> bool:
        """Whether the room behind these vertices is free."""
        same = (column.base is room.arrays[name] for name, column in self.columns.items())
        return room.used == len(self) and all(same)

    def _roomy(self, capacity: int) -> _Room:
        """Return a copy of these vertices with room for more."""
        arrays = {}
        for name, column in self.columns.items():
            arrays[name] = np.empty((capacity, *column.shape[1:]), column.dtype)
            arrays[name][: len(self)] = column
        return _Room(arrays, len(self))


def vertices_of(
    setting: Setting,
    z: Float[np.ndarray, "V size"],
    p: Float[np.ndarray, "V P"],
    kinds: VertexNumbers,
    index: VertexNumbers,
    grid_vertex: VertexNumbers,
    rows: Float[np.ndarray, "V d coordinates"],
) -> Vertices:
    """Vertices with their frames; `rows` are nearby planes."""
    crossing = kinds == VertexKind.CROSSING
    d = len(setting.free)
    frame = np.empty((len(z), d, z.shape[1] + d))
    folds, caps, crossings = (np.zeros((len(z), d)) for _ in range(3))
    plain, met = np.flatnonzero(~crossing), np.flatnonzero(crossing)
    frame[plain] = tangent_frames(setting, z[plain], p[plain], rows[plain])
    if len(met):
        frame[met], crossings[met] = crossing_frames(setting, z[met], p[met], rows[met])
    capped = np.isin(kinds, (VertexKind.CAP, VertexKind.CORNER))
    capped[met] = on_constraints(setting, z[met], p[met])
    for out, function, wanted in (
        (folds, fold_slopes, on_fold(kinds)),
        (caps, cap_slopes, capped),
    ):
        own = np.flatnonzero(wanted)
        if len(own):
            out[own] = function(setting, z[own], p[own], frame[own])
    slopes = folds, caps, crossings
    return _with_slopes(setting, z, p, kinds, index, grid_vertex, frame, slopes)


def among_unframed(
    framed: Vertices,
    some: VertexFlags,
    place: Float[np.ndarray, "V coordinates"],
    known: Mapping[str, np.ndarray],
) -> Vertices:
    """Some vertices with their frames among others, whose frames and slopes are zeros.

    `known`: the other columns of all vertices, by name.
    """
    columns = {**known, "place": place, "shared": np.full(len(some), -1)}
    for name, column in framed.columns.items():
        if name not in columns:
            columns[name] = np.zeros((len(some), *column.shape[1:]), column.dtype)
            columns[name][some] = column
    return replace(framed, **columns, room=None)


def free_vertices(setting: Setting, at: Corrected) -> Vertices:
    """Vertices inside sheets."""
    count, d = at.frames.shape[:2]
    kinds, nowhere = np.full(count, VertexKind.REFINED), np.full(count, -1)
    none = np.zeros((count, d))
    slopes = none, none.copy(), none.copy()
    return _with_slopes(setting, at.z, at.p, kinds, at.index, nowhere, at.frames, slopes)


def _with_slopes(
    setting: Setting,
    z: Float[np.ndarray, "V size"],
    p: Float[np.ndarray, "V P"],
    kinds: VertexNumbers,
    index: VertexNumbers,
    grid_vertex: VertexNumbers,
    frame: Float[np.ndarray, "V d full"],
    slopes: tuple[Float[np.ndarray, "V d"], Float[np.ndarray, "V d"], Float[np.ndarray, "V d"]],
) -> Vertices:
    """Vertices with all that is known of them, in the coordinates of the embedding, too."""
    place, placed = embed(setting, z, p), frames_in_embedding(setting, frame)
    lone = np.full(len(kinds), -1)
    return Vertices(z, p, kinds, index, grid_vertex, place, frame, placed, *slopes, lone)


def on_constraints(
    setting: Setting, z: Float[np.ndarray, "n size"], p: Float[np.ndarray, "n P"]
) -> ItemFlags:
    """Whether states lie on the bound of a constraint."""
    out = np.zeros(len(z), bool)
    for constraint in setting.constraints if len(z) else ():
        out |= np.abs(constraint.excess(z, p)) < ON_BOUND
    return out
