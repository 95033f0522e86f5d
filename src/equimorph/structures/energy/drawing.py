"""Supports and forces that the author of an energy puts on the points of its line."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np

from equimorph.argument_kinds import is_number, one_of, short
from equimorph.argument_vocabulary import FINITE
from equimorph.arrays import Bool, Float
from equimorph.errors import InputError
from equimorph.model import Drawing, Forces, Support, SupportKind
from equimorph.structures.energy.expressions import POINT

DrawnSupport = Annotated[
    Mapping[Annotated[str, one_of("point", "kind", "angle")], Any],
    "tables of point, kind and angle, like `{'point': 0, 'kind': 'pin'}`",
]
DrawnForce = Annotated[
    Mapping[Annotated[str, one_of("point", "force")], Any],
    "tables of point and force, like `{'point': 1, 'force': [0, 'F']}`",
]


@dataclass(frozen=True)
class Mark:
    """A support on a point of the line that is drawn; angle: of its direction, in radians."""

    point: int
    kind: SupportKind
    angle: float = 0.0

    def data(self) -> dict[str, Any]:
        """Return what it is made from."""
        return {"point": self.point, "kind": str(self.kind), "angle": self.angle}


def marks_of(given: Sequence[DrawnSupport], points: int) -> tuple[Mark, ...]:
    """Supports from tables with the keys point, kind and angle.

    Unknown kinds, and points that are not drawn, are refused.
    """
    found: list[Mark] = []
    for i, data in enumerate(given):
        point = _point(data, points, f"supports[{i}]")
        kind, angle = data.get("kind", "pin"), data.get("angle", 0.0)
        if not isinstance(kind, str) or kind not in list(SupportKind):
            raise InputError(
                f"`supports[{i}].kind` must be one of {', '.join(SupportKind)}; got {kind!r}."
            )
        if not (is_number(angle) and FINITE.holds(angle)):
            raise InputError(
                f"`supports[{i}].angle` must be a finite number in radians; got {angle!r}."
            )
        found.append(Mark(point, SupportKind(kind), float(angle)))
    return tuple(found)


def forces_of(
    given: Sequence[DrawnForce], points: int
) -> tuple[tuple[int, ...], tuple[tuple[Any, Any], ...]]:
    """Points on which forces act, and their components, from tables with point and force.

    Forces that have not two components, and points that are not drawn, are refused.
    """
    places, vectors = [], []
    for i, data in enumerate(given):
        places.append(_point(data, points, f"forces[{i}]"))
        force: Any = data.get("force")
        if not POINT.fits(force):
            raise InputError(f"`forces[{i}].force` must be {POINT.words}; got {short(force)}.")
        vectors.append((force[0], force[1]))
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


def _point(data: Mapping[str, Any], points: int, what: str) -> int:
    at = data.get("point")
    if not (type(at) is int and 0 <= at < points):
        raise InputError(
            f"`{what}.point` must be the number of a point of `draw`, counted from 0; got {at!r}."
        )
    return at
