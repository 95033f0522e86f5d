"""What lanes leave behind as they march: steps in which something happened, and points."""

import numpy as np
from jaxtyping import Int

from equimorph.arrays import Lanes
from equimorph.equilibria.fronts import Bracket, Front
from equimorph.equilibria.records import kernels
from equimorph.equilibria.tracing import Points

Places = tuple[np.ndarray, ...]
Names = Int[np.ndarray, " points"]


class EventFile:
    """Steps in which something happened, until they are located: room for `room` of them."""

    def __init__(self, size: int, room: int) -> None:
        self.count = 0
        ends = tuple(np.empty((room, size)) for _ in range(4))
        self._buffer = (*ends, np.empty((6, room)), np.empty((4, room), np.int64))

    def add(self, tangent: Lanes, stops: int, places: Places, scalars: Places, active: int) -> None:
        """Copy such steps of all lanes, and end those lanes that they stop."""
        state = (places, *scalars, active, self._buffer, self.count)
        self.count = kernels.file_events(tangent, stops, *state)

    def drain(self) -> Bracket:
        """Hand out everything."""
        count, self.count = self.count, 0
        z0, tangent0, z1, tangent1 = (each[:count].copy() for each in self._buffer[:4])
        values, (lanes, what, before, after) = (each[:, :count].copy() for each in self._buffer[4:])
        return Bracket(
            lanes,
            Front(z0, values[0], tangent0, values[1], before),
            Front(z1, values[2], tangent1, values[3], after),
            values[4],
            values[5],
            what,
        )


class PointFile:
    """Regular points of all lanes, with the number of the try in which they were found."""

    def __init__(self, size: int, most: int) -> None:
        self._size, self._most, self._room = size, most, max(ROOM, 2 * most)
        self._count, self._buffer = 0, self._new()
        self._parts: list[tuple[Points, Names]] = []

    def _new(self) -> Places:
        room = self._room
        return np.empty((room, self._size)), np.empty((2, room)), np.empty((3, room), np.int64)

    def add(self, trial: Lanes, scalars: Places, active: int) -> None:
        """Copy the ends of good steps of lanes that go on."""
        if self._count + self._most > self._room:
            self._seal()
        count = self._count
        self._count = kernels.file_points(trial, *scalars, active, self._buffer, count)

    def _seal(self) -> None:
        z, values, names = self._buffer
        count = slice(0, self._count)
        lanes, index, tries = names[:, count]
        points = Points(lanes, values[0, count], z[count], values[1, count], index)
        self._parts.append((points, tries))
        self._count, self._buffer = 0, self._new()

    def parts(self) -> list[tuple[Points, Names]]:
        """Everything so far, in parts."""
        self._seal()
        return self._parts


ROOM = 4096
"""Points in one part."""
