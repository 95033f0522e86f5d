"""Supports and forces that the author of an energy puts on the points of its line."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Bool, Float

from equimorph.errors import InputError
from equimorph.model import Drawing, Forces, Support, SupportKind


@dataclass(frozen=True)
class Mark:
    """A support on a point of the line that is drawn; angle: of its direction, in radians."""

    point: int
    kind: SupportKind
    angle: float = 0.0

    def data(self) -> dict[str, Any]:
        """Return what it is made from."""
        return {"point": self.point, "kind": str(self.kind), "angle": self.angle}


def marks_of(given: Iterable[Any], points: int) -> tuple[Mark, ...]:
    """Supports from tables with the keys point, kind and angle.

    Raises
    ------
    InputError
        For another key, an unknown kind, or a point that is not drawn.
    """
    found = []
    for i, table in enumerate(given):
        data = _table(table, {"point", "kind", "angle"}, f"supports[{i}]")
        point = _point(data, points, f"supports[{i}]")
        kind, angle = data.get("kind", "pin"), data.get("angle", 0.0)
        if kind not in list(SupportKind):
            raise InputError(
                f"`supports[{i}].kind` must be one of {', '.join(SupportKind)}; got {kind!r}."
            )
        if not (isinstance(angle, int | float) and np.isfinite(angle)):
            raise InputError(
                f"`supports[{i}].angle` must be a finite number in radians; got {angle!r}."
            )
        found.append(Mark(point, SupportKind(kind), float(angle)))
    return tuple(found)


def forces_of(
    given: Iterable[Any], points: int
) -> tuple[tuple[int, ...], tuple[tuple[Any, Any], ...]]:
    """Points on which forces act, and their components, from tables with point and force.

    Raises
    ------
    InputError
        For another key, a force that has not two components, or a point that is not drawn.
    """
    places, vectors = [], []
    for i, table in enumerate(given):
        data = _table(table, {"point", "force"}, f"forces[{i}]")
        places.append(_point(data, points, f"forces[{i}]"))
        force = data.get("force")
        pair = () if isinstance(force, str) or not isinstance(force, Sequence) else tuple(force)
        if len(pair) != 2:
            raise InputError(f"`forces[{i}].force` must be two expressions [x, y]; got {force!r}.")
        vectors.append((pair[0], pair[1]))
    return tuple(places), tuple(vectors)


def energy_drawing(
    corners: Float[np.ndarray, "lanes points 2"],
    fixed: Bool[np.ndarray, " written"],
    marks: Sequence[Mark],
    places: Sequence[int],
    vectors: Float[np.ndarray, "lanes places 2"],
) -> Drawing:
    """Supports as marked, pins on other points that no unknown moves, and forces."""
    lanes, marked = len(corners), {mark.point for mark in marks}
    pins = [Mark(int(at), SupportKind.PIN) for at in np.flatnonzero(fixed) if at not in marked]
    supports = tuple(
        Support(
            mark.kind,
            corners[:, mark.point],
            np.tile([np.cos(mark.angle), np.sin(mark.angle)], (lanes, 1)),
        )
        for mark in (*marks, *pins)
    )
    forces = (Forces(corners[:, list(places)], vectors),) if places else ()
    return Drawing(supports, forces)


def _table(given: Any, keys: set[str], what: str) -> Mapping[str, Any]:
    if not (isinstance(given, Mapping) and set(given) <= keys):
        raise InputError(f"`{what}` must be a table of {', '.join(sorted(keys))}; got {given!r}.")
    return given


def _point(data: Mapping[str, Any], points: int, what: str) -> int:
    at = data.get("point")
    if not (isinstance(at, int) and 0 <= at < points):
        raise InputError(
            f"`{what}.point` must be the number of a point of `draw`, counted from 0; got {at!r}."
        )
    return at
