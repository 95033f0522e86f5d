"""Loads, couples, intrinsic curvatures and tendons of a rod, each with an amplitude."""

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Annotated, Any, ClassVar, Literal

import numpy as np

from equimorph.argument_checks import check_arguments
from equimorph.argument_notes import LOAD_DIRECTION
from equimorph.arrays import Float
from equimorph.errors import InputError
from equimorph.model import Rebuilt
from equimorph.structures.rod.discretisation import Mesh
from equimorph.structures.rod.profiles import (
    LoadShape,
    LoadSpec,
    ProfileSpec,
    at_nodes,
    inside,
    load_shape,
    profile,
)

ElementNodes = Float[np.ndarray, "elements order"]
DOWN = (0.0, -1.0)
"""Direction of gravity."""
SPATIAL = ("about", "binormal")
"""Fields of terms that differ from their defaults on rods in space only."""


def _check_stretch(start: float, stop: float) -> None:
    if not start < stop:
        raise InputError(f"`start` must be less than `stop`; got {start!r} and {stop!r}.")


def _in_plane(direction: Sequence[float]) -> tuple[float, float]:
    """Direction (x, y) of a load on a planar rod."""
    x, y, *z = map(float, direction)
    if any(z):
        raise InputError(
            f"`direction` must lie in the plane of the rod, z = 0; got {direction!r}. Loads across "
            "the plane need a `SpatialRod`."
        )
    return x, y


@dataclass(frozen=True, eq=False)
class Effects:
    """What a term of amplitude 1 does: see `structures.rod.general.model`.

    along, across: load cumulated from end A in x and y, `force` all of it; bending: the part of the
    moment that does not come from curvature; natural: intrinsic curvature; couples: (arclength,
    moment); pressure: towards the left of the rod; tension: of cables along the rod, and torsion:
    the torsional stiffness that they give it.
    """

    along: ElementNodes | float = 0.0
    across: ElementNodes | float = 0.0
    bending: ElementNodes | float = 0.0
    natural: ElementNodes | float = 0.0
    couples: tuple[tuple[float, float], ...] = ()
    force: tuple[float, float] = (0.0, 0.0)
    pressure: float = 0.0
    tension: ElementNodes | float = 0.0
    torsion: ElementNodes | float = 0.0


class Term(Rebuilt, ABC):
    """Something that acts on a rod in proportion to a parameter."""

    word: ClassVar[str]
    measure: ClassVar[str]
    """What the amplitude is: a key of `structures.units.LABELS`."""

    @property
    @abstractmethod
    def breaks(self) -> tuple[float, ...]:
        """Arclengths inside the rod where it is not smooth."""

    @abstractmethod
    def effects(self, mesh: Mesh) -> Effects:
        """Effects on the nodes of a mesh whose element ends meet the breaks."""

    def data(self) -> dict[str, Any]:
        """The term as plain data; `InputError` for a callable."""
        out: dict[str, Any] = {"term": self.word}
        for field in fields(self):  # type: ignore[arg-type]  # every term is a dataclass
            value = getattr(self, field.name)
            if callable(value):
                raise InputError(
                    f"`{field.name}` of a {self.word} must be a number or a table to be written "
                    "to a file; got a callable."
                )
            # kinks are those of a callable, and that is refused; some fields belong to space only
            silent = field.name in SPATIAL and value == field.default
            if field.name != "kinks" and not silent:
                out[field.name] = _plain(value)
        return out


def _plain(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        return value.tolist()
    if isinstance(value, str | int | float):
        return value
    return [_plain(item) for item in value]


def _interior(points: Sequence[float]) -> tuple[float, ...]:
    return tuple(float(s) for s in points if 0.0 < s < 1.0)


@check_arguments
@dataclass(frozen=True, eq=False)
class LineLoad(Term):
    """Dead load along the rod: the amplitude times ``shape(s) · direction`` per arclength.

    The default is a uniform load downward; self-weight of a rod on a plane inclined by α is
    ``LineLoad(direction=(sin α, −cos α))``.

    Parameters
    ----------
    shape
        "uniform", "left-half", a table [[s, Q], ...] or a callable Q(s); s runs from 0 to 1.
    direction
        Its horizontal and vertical part, and on a rod in space also the part along z.
    kinks
        Arclengths where a callable is not smooth.
    """

    shape: LoadSpec = "uniform"
    direction: Annotated[Sequence[float], LOAD_DIRECTION] = DOWN
    kinks: Sequence[float] = ()
    word: ClassVar[str] = "line load"
    measure: ClassVar[str] = "line"

    def __post_init__(self) -> None:
        """Check the shape."""
        self.density()

    def density(self) -> LoadShape:
        """Q(s)."""
        return load_shape(self.shape, self.kinks, "shape")

    @property
    def breaks(self) -> tuple[float, ...]:
        """Kinks of the shape."""
        return _interior(self.density().kinks.tolist())

    def effects(self, mesh: Mesh) -> Effects:
        """Load cumulated from end A."""
        x, y = _in_plane(self.direction)
        rho = self.density().cumulate(mesh)
        total = float(rho[-1, -1])
        return Effects(along=x * rho, across=y * rho, force=(x * total, y * total))


@check_arguments
@dataclass(frozen=True, eq=False)
class PointForce(Term):
    """Dead force at arclength s: the amplitude times `direction`.

    Parameters
    ----------
    s
        Where it acts, from 0 to 1.
    direction
        Its horizontal and vertical part, and on a rod in space also the part along z; downward by
        default.
    """

    s: float
    direction: Annotated[Sequence[float], LOAD_DIRECTION] = DOWN
    word: ClassVar[str] = "point force"
    measure: ClassVar[str] = "force"

    @property
    def breaks(self) -> tuple[float, ...]:
        """Its place."""
        return _interior([self.s])

    def effects(self, mesh: Mesh) -> Effects:
        """Load cumulated from end A: a step."""
        x, y = _in_plane(self.direction)
        step = np.ones((1, mesh.degree + 1)) * inside(self.s, 2.0, mesh)[:, None]
        return Effects(along=x * step, across=y * step, force=(x, y))


@check_arguments
@dataclass(frozen=True, eq=False)
class Couple(Term):
    """Couple at arclength s, positive counterclockwise: its work is the amplitude times θ(s)."""

    s: float
    word: ClassVar[str] = "couple"
    measure: ClassVar[str] = "couple"

    @property
    def breaks(self) -> tuple[float, ...]:
        """Its place."""
        return _interior([self.s])

    def effects(self, mesh: Mesh) -> Effects:
        """A jump of the moment."""
        return Effects(couples=((float(self.s), 1.0),))


@check_arguments
@dataclass(frozen=True, eq=False)
class Curvature(Term):
    """Intrinsic curvature: the amplitude times ``pattern(s)`` from `start` to `stop`.

    A segment of a soft arm, or a bilayer that swells.

    Parameters
    ----------
    pattern
        A number, a table [[s, f], ...] or a callable.
    start, stop
        Where it begins and ends.
    about
        Axis of the cross-section about which it turns: "b", the binormal, as in the plane; on a rod
        in space also "n", out of the plane, or "t", as an intrinsic twist.
    """

    pattern: ProfileSpec = 1.0
    start: float = 0.0
    stop: float = 1.0
    kinks: Sequence[float] = ()
    about: Literal["t", "n", "b"] = "b"
    word: ClassVar[str] = "curvature"
    measure: ClassVar[str] = "curvature"

    def __post_init__(self) -> None:
        """Check pattern and stretch."""
        _check_stretch(self.start, self.stop)
        self.profile()

    def profile(self) -> LoadShape:
        """Its pattern."""
        return profile(self.pattern, "pattern", self.kinks)

    @property
    def breaks(self) -> tuple[float, ...]:
        """Its ends, and the pattern's kinks."""
        return _interior([self.start, self.stop, *self.profile().kinks.tolist()])

    def effects(self, mesh: Mesh) -> Effects:
        """Intrinsic curvature."""
        if self.about != "b":
            raise InputError(
                f"`about` must be 'b' on a planar rod; got {self.about!r}. Twist and curvature out "
                "of the plane need a `SpatialRod`."
            )
        there = inside(self.start, self.stop, mesh)[:, None]
        return Effects(natural=there * at_nodes(self.profile(), mesh))


@check_arguments
@dataclass(frozen=True, eq=False)
class Tendon(Term):
    """Cable guided along the rod at an offset from its axis, pulled with a given tension.

    Between `start` and `stop` the cable at offset d(s), positive to the left of the axis, has the
    length ``∫ (1 + ε − d θ') ds``: tension T bends the rod as the moment T d does, compresses a
    rod with axial stiffness, and works on the shortening. Friction is left out. Out of the plane it
    stiffens the rod against twist by T d².

    Parameters
    ----------
    offset
        d(s), in the user's unit of length: a number, a table [[s, d], ...] or a callable.
    start, stop
        Where the cable is anchored.
    binormal
        Offset along the binormal, of a cable on a rod in space.
    """

    offset: ProfileSpec
    start: float = 0.0
    stop: float = 1.0
    kinks: Sequence[float] = ()
    binormal: Any = 0.0
    word: ClassVar[str] = "tendon"
    measure: ClassVar[str] = "tension"

    def __post_init__(self) -> None:
        """Check offsets and stretch."""
        _check_stretch(self.start, self.stop)
        self.profiles()

    def profiles(self) -> tuple[LoadShape, LoadShape]:
        """Offsets to the left of the axis and along the binormal."""
        aside = profile(self.binormal, "binormal", self.kinks)
        return profile(self.offset, "offset", self.kinks), aside

    @property
    def breaks(self) -> tuple[float, ...]:
        """Its ends, and the offsets' kinks."""
        kinks = [s for each in self.profiles() for s in each.kinks.tolist()]
        return _interior([self.start, self.stop, *kinks])

    def effects(self, mesh: Mesh) -> Effects:
        """A moment T d, a thrust T, and a torsional stiffness T d²."""
        if self.binormal != 0.0:
            raise InputError(
                f"`binormal` must be 0 on a planar rod; got {self.binormal!r}. A cable beside the "
                "plane needs a `SpatialRod`."
            )
        there = inside(self.start, self.stop, mesh)[:, None]
        along, offset = there * np.ones(mesh.degree + 1), at_nodes(self.profiles()[0], mesh)
        return Effects(bending=there * offset, tension=along, torsion=there * offset**2)


@check_arguments
@dataclass(frozen=True, eq=False)
class Pressure(Term):
    """Pressure all along a rod, as of a gas in the chamber that it closes.

    The amplitude is a force per arclength, normal to the rod wherever it turns, towards its left
    (upward on an arch from A to B) if positive. Between held ends its potential is −p times the
    area V between the rod and its chord. Each end may also move along a line, free or on a spring:
    pressure then has the potential −p (V ± ½ X Y), with the chord's components X and Y along and
    across the line (`closing` in `structures/rod/pressure.py` derives it). An end that moves in x
    and y makes pressure a follower load without a potential, which `Rod` refuses.
    """

    word: ClassVar[str] = "pressure"
    measure: ClassVar[str] = "line"

    @property
    def breaks(self) -> tuple[float, ...]:
        """None."""
        return ()

    def effects(self, mesh: Mesh) -> Effects:
        """A unit of pressure."""
        return Effects(pressure=1.0)


TermSpec = Annotated[
    Term | Mapping[str, Any],
    'a term, like `PointForce(1.0)`, or its data, like `{"term": "couple", "s": 0.5}`',
]
Terms = Annotated[
    Mapping[str, TermSpec | Sequence[TermSpec]],
    'terms, or lists of terms, by name, like `{"P": PointForce(1.0)}`',
]
TERMS: dict[str, type[Term]] = {
    kind.word: kind for kind in (LineLoad, PointForce, Couple, Curvature, Tendon, Pressure)
}
REFUSED = {
    "follower": "a follower load has no potential, so that equilibria are no critical points",
}


def term(data: Any, name: str) -> Term:
    """Term of plain data, or the term itself; follower loads are refused with the reason."""
    if isinstance(data, Term):
        return data
    content = dict(data) if isinstance(data, Mapping) else {}
    word = str(content.pop("term", None))
    for key, why in REFUSED.items():
        if key in word:
            raise InputError(
                f"`{name}` must be conservative; got {word!r}: {why}. Use a dead load, whose "
                "direction stays."
            )
    if word not in TERMS:
        raise InputError(
            f"`{name}` must be a term ({', '.join(TERMS)}), one or a list; got {data!r}."
        )
    return TERMS[word](**content)
