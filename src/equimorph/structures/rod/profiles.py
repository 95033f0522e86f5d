"""Functions of the arclength: shapes of line loads, profiles of stiffness and curvature."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np

from equimorph.argument_kinds import one_of
from equimorph.arrays import Float
from equimorph.errors import InputError
from equimorph.structures.rod.discretisation import Mesh
from equimorph.structures.unit_system import Quantity

Shape = Callable[[Float[np.ndarray, " points"]], Float[np.ndarray, " points"]]
Table = Annotated[
    Sequence[Sequence[float]] | Float[np.ndarray, "rows 2"],
    "a table [[s, f], ...] of finite numbers",
]
LoadSpec = Annotated[
    Annotated[str, one_of("uniform", "left-half")] | Table | Shape,
    "'uniform', 'left-half', a table [[s, Q], ...] of finite numbers, or a function",
]

NAMED: dict[str, list[list[float]]] = {
    "uniform": [[0.0, 1.0], [1.0, 1.0]],
    "left-half": [[0.0, 2.0], [0.5, 2.0], [0.5, 0.0], [1.0, 0.0]],
}
_GAUSS, _GAUSS_WEIGHTS = np.polynomial.legendre.leggauss(24)


@dataclass(frozen=True, eq=False)
class LoadShape:
    """A load shape: a name or a table that can be written down, or a callable that cannot.

    A table [[s, Q], ...] is linear between its points; a repeated s is a jump.
    """

    identity: Any
    density: Shape
    kinks: Float[np.ndarray, " kinks"]

    def cumulate(self, mesh: Mesh) -> Float[np.ndarray, "elements order"]:
        """ρ at the nodes of each element, by a Gauss rule of 24 points between nodes."""
        t = np.concatenate([[0.0], mesh.reference.nodes])
        rho = np.empty((mesh.elements, mesh.degree + 1))
        start = 0.0
        for e, (left, length) in enumerate(zip(mesh.breaks[:-1], mesh.lengths, strict=True)):
            widths = np.diff(t) * length
            points = left + length * t[:-1, None] + 0.5 * widths[:, None] * (_GAUSS + 1.0)
            values = self.density(points.ravel()).reshape(points.shape)
            rho[e] = start + np.cumsum(0.5 * widths * (values @ _GAUSS_WEIGHTS))
            start = rho[e, -1]
        return rho


def load_shape(
    spec: LoadSpec, kinks: Sequence[float] = (), name: str = "load", symbol: str = "Q"
) -> LoadShape:
    """Make a load shape of a name, a table [[s, Q], ...] or a callable Q(s) with its `kinks`.

    `name` and `symbol` are what the messages call it. Refused for a table that does not run from 0
    to 1, or values of a callable that are not finite.
    """
    if isinstance(spec, str):
        return _from_table(spec, np.array(NAMED[spec]), name, symbol)
    if callable(spec):
        return _from_callable(spec, kinks, name, symbol)
    same = len({len(row) for row in spec}) < 2
    table = np.array(spec, dtype=float) if same else np.zeros((0, 0))
    return _from_table(table.tolist(), table, name, symbol)


def _from_table(
    identity: Any, table: Float[np.ndarray, "..."], name: str, symbol: str
) -> LoadShape:
    if table.ndim != 2 or table.shape[1] != 2 or len(table) < 2:
        raise InputError(
            f"`{name}` must be a table of rows [s, {symbol}]; got shape {table.shape}."
        )
    s, q = table[:, 0], table[:, 1]
    falls = np.flatnonzero(np.diff(s) < 0)
    if s[0] != 0.0 or s[-1] != 1.0 or len(falls):
        wrong = s[falls[0] : falls[0] + 2] if len(falls) else s[[0, -1]]
        raise InputError(
            f"`{name}` must be a table with s rising from 0 to 1; got s "
            f"{'falling' if len(falls) else 'rising'} from {wrong[0]:g} to {wrong[1]:g}."
        )
    inside = np.unique(s[(s > 0) & (s < 1)])

    def density(points: Float[np.ndarray, " points"]) -> Float[np.ndarray, " points"]:
        right = np.clip(np.searchsorted(s, points, side="right"), 1, len(s) - 1)
        width = np.where(s[right] > s[right - 1], s[right] - s[right - 1], 1.0)
        share = np.clip((points - s[right - 1]) / width, 0.0, 1.0)
        return np.asarray((1.0 - share) * q[right - 1] + share * q[right])

    return LoadShape(identity, density, inside)


def _from_callable(function: Shape, kinks: Sequence[float], name: str, symbol: str) -> LoadShape:
    at = np.unique(np.asarray(kinks, dtype=float))

    def density(points: Float[np.ndarray, " points"]) -> Float[np.ndarray, " points"]:
        values = np.broadcast_to(np.asarray(function(points), dtype=float), points.shape)
        if not np.isfinite(values).all():
            bad = points[~np.isfinite(values)][0]
            raise InputError(f"`{name}` must be finite; got {symbol}({bad:g}) = {values.min()}.")
        return values

    return LoadShape(None, density, at)


ProfileSpec = Annotated[
    float | Table | Shape,
    "a finite number, a table [[s, f], ...] of finite numbers, or a function",
]
MeasuredProfile = Annotated[
    Quantity | Table | Shape,
    "a finite number, a text with its unit, a table [[s, f], ...] of finite numbers, or a function",
]
INWARD = 1e-13
"""Share of an element by which ends are moved inward: values may differ on the sides of a jump."""


def profile(spec: ProfileSpec, name: str, kinks: Sequence[float] = ()) -> LoadShape:
    """Profile f(s) of a number, a table [[s, f], ...] or a callable with its `kinks`.

    Refused as for `load_shape`.
    """
    if not isinstance(spec, int | float | np.integer | np.floating):
        return load_shape(spec, kinks, name, "f")
    value = float(spec)

    def constant(points: Float[np.ndarray, " points"]) -> Float[np.ndarray, " points"]:
        return np.full(points.shape, value)

    return LoadShape(value, constant, np.zeros(0))


def at_nodes(shape: LoadShape, mesh: Mesh) -> Float[np.ndarray, "elements order"]:
    """Values at the nodes of each element, one-sided at its ends."""
    t = INWARD + (1.0 - 2.0 * INWARD) * mesh.reference.nodes
    points = mesh.breaks[:-1, None] + mesh.lengths[:, None] * t
    return np.asarray(shape.density(points.ravel()).reshape(points.shape))


def inside(start: float, stop: float, mesh: Mesh) -> Float[np.ndarray, " elements"]:
    """1 for elements between two arclengths, 0 elsewhere; both are element ends."""
    middle = 0.5 * (mesh.breaks[1:] + mesh.breaks[:-1])
    return np.asarray(((start < middle) & (middle < stop)).astype(float))
