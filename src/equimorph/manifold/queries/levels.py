"""Level sets: exact vertices where a function on the set vanishes, and complexes cut along them."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from equimorph.argument_checks import check_arguments
from equimorph.arrays import CellFlags, CellNumbers, Float, Int, ItemFlags, Items, VertexFlags
from equimorph.errors import InputError
from equimorph.manifold.complex.cuts import (
    ROUND_OFF,
    Ends,
    Function,
    Values,
    cut_between,
    roots,
)
from equimorph.manifold.complex.description import describe_again
from equimorph.manifold.complex.equilibrium_set import EquilibriumSet
from equimorph.manifold.complex.excerpts import (
    Recut,
    changing_cells,
    excerpt_of,
    fabric_of,
    sheets_of,
)
from equimorph.manifold.complex.kept_tables import kept, places_of
from equimorph.manifold.complex.marked_complex import Fabric
from equimorph.manifold.complex.vertices import Vertices
from equimorph.manifold.geometry.setting import Setting
from equimorph.manifold.geometry.simplices import sizes_of
from equimorph.manifold.geometry.tangents import split_step
from equimorph.manifold.geometry.topology import adjacency, count_corners, pieces
from equimorph.model import Constraint, Descriptor
from equimorph.structures import States

DIFFERENCE = 1e-3
"""Step, in the metric, of central differences of fourth order: they err by about 1e-12."""


@dataclass(frozen=True)
class Level:
    """Where a function on the set vanishes: exact states, and how they hang together.

    pieces: points (d = 1), polylines, closed ones with the first point repeated (d = 2), or
    triangles, one a row (d = 3), as numbers of states. lost: edges on which no state was found; the
    level is interrupted there.
    """

    states: States
    pieces: tuple[Int[np.ndarray, "..."], ...]
    lost: int


@check_arguments
def level_set(eset: EquilibriumSet, descriptor: Descriptor, value: float) -> Level:
    """States of a set at which a descriptor has a value, polished to round-off.

    Raises
    ------
    InputError
        If `value` is not finite, or what is no descriptor is given.
    """
    return _level(_cut(eset, lambda v: descriptor.function(v.z, v.p) - value))


@check_arguments
def singular_set(eset: EquilibriumSet, descriptors: Sequence[Descriptor]) -> Level:
    """States at which the Jacobian of the descriptors, one per free parameter, is singular.

    ``det J_S = 0``, with derivatives of the descriptors along the set; so it is smooth at folds. It
    needs a set that can be oriented.

    Raises
    ------
    InputError
        If there is another number of descriptors, or anything but descriptors.
    """
    _check_count(eset, descriptors)
    return _level(_cut_where_singular(eset, descriptors))


def _check_count(eset: EquilibriumSet, descriptors: Sequence[Descriptor]) -> None:
    d = len(eset.names)
    if len(descriptors) != d:
        raise InputError(
            f"`descriptors` must be {d}, one per free parameter of the set; got {len(descriptors)}."
        )


@dataclass(frozen=True, eq=False)
class Division:
    """A set cut along a level into cells on one side or the other.

    on_level: vertices on the level. side: sign of the function on each cell. lost: edges that cross
    the level but could not be cut.
    """

    eset: EquilibriumSet
    on_level: VertexFlags
    side: CellNumbers
    lost: int


@check_arguments
def divided(eset: EquilibriumSet, descriptors: Sequence[Descriptor]) -> Division:
    """Cut a set exactly where the Jacobian of descriptors is singular; see `singular_set`.

    Raises
    ------
    InputError
        If there are not as many descriptors as free parameters.
    """
    _check_count(eset, descriptors)
    return _divide(_cut_where_singular(eset, descriptors))


@check_arguments
def divided_by(eset: EquilibriumSet, constraint: Constraint) -> Division:
    """Cut a set exactly along the bound of a constraint; the side is -1 where it is obeyed."""
    return _divide(_cut_at_bound(eset, constraint))


@dataclass(frozen=True, eq=False)
class Cutting:
    """A set cut along a level: its cells, values at their vertices, edges that could not be cut."""

    recut: Recut
    values: Values
    lost: int

    @property
    def on_level(self) -> VertexFlags:
        """Vertices on the level."""
        return np.asarray(self.values == 0.0)


def _divide(cut: Cutting) -> Division:
    whole = whole_set(cut.recut, cut.lost)
    side = np.sign(cut.values[cut.recut.cells].sum(axis=1)).astype(int)
    on_level, number = np.zeros(len(whole.points), bool), cut.recut.numbers
    on_level[number[cut.on_level & (number >= 0)]] = True
    return Division(whole, on_level, side, cut.lost)


def jacobian(setting: Setting, at: Vertices, descriptors: Sequence[Descriptor]) -> Values:
    """det of the derivatives of descriptors along orthonormal, coherently oriented tangents."""
    columns = []
    for k in range(at.frame.shape[1]):
        dz, dp = split_step(setting, DIFFERENCE * at.frame[:, k])
        slope = np.zeros((len(descriptors), len(at)))
        for steps, weight in ((-2, 1.0), (-1, -8.0), (1, 8.0), (2, -1.0)):
            there = (at.z + steps * dz, at.p + steps * dp)
            slope += weight * np.stack([each.function(*there) for each in descriptors])
        columns.append(slope / (12.0 * DIFFERENCE))
    return np.asarray(np.linalg.det(np.moveaxis(np.stack(columns), 2, 0)))


@check_arguments
def restricted(eset: EquilibriumSet, constraint: Constraint) -> EquilibriumSet:
    """Part of a set that obeys a further constraint, cut exactly along it.

    The audit counts edges that could not be cut as `unrefined`; there whole cells are left out.

    Raises
    ------
    InputError
        If it is no constraint.
    """
    cut = _cut_at_bound(eset, constraint)
    inside = (cut.values[cut.recut.cells] <= 0.0).all(axis=1)
    constraints = (*eset.constraints, constraint)
    setting = replace(eset.setting, constraints=constraints)
    return part_of(cut.recut, inside, cut.on_level, cut.lost, setting)


def cell_sizes(eset: EquilibriumSet) -> Float[np.ndarray, " C"]:
    """Lengths, areas or volumes of the cells in the metric of the embedding."""
    return sizes_of(places_of(eset), eset.cells)


@check_arguments
def part(eset: EquilibriumSet, cells: CellFlags) -> EquilibriumSet:
    """Selected cells as a set, like the stable ones: ``eset.cell_index == 0``."""
    recut = excerpt_of(eset, np.zeros(len(eset.cells), bool)).put_back()
    return part_of(recut, cells, np.zeros(len(recut.points), bool), 0)


def _level(cut: Cutting) -> Level:
    recut, level = cut.recut, cut.on_level
    d = len(recut.eset.names)
    whole = adjacency(recut.cells[count_corners(level, recut.cells) >= d])
    facets = whole.facets[level[whole.facets].all(axis=1)]
    facets = np.unique(np.sort(recut.points[facets], axis=1), axis=0)
    used, inverse = np.unique(facets, return_inverse=True)
    found = pieces(inverse.reshape(facets.shape))
    return Level(recut.states(used), tuple(found), cut.lost)


def _cut_at_bound(eset: EquilibriumSet, constraint: Constraint) -> Cutting:
    return _cut(eset, lambda v: constraint.excess(v.z, v.p))


def _cut(eset: EquilibriumSet, function: Callable[[Vertices | States], Values]) -> Cutting:
    """Cut a set where a function of its states vanishes."""
    return cut_along(eset, function(eset.points)[sheets_of(eset).origin], function)


def _cut_where_singular(eset: EquilibriumSet, descriptors: Sequence[Descriptor]) -> Cutting:
    """Cut a set where the Jacobian of descriptors is singular."""

    def function(at: Vertices) -> Values:
        return jacobian(eset.setting, at, descriptors)

    return cut_along(eset, function(framed_vertices(eset)), function)


@kept
def framed_vertices(eset: EquilibriumSet) -> Vertices:
    """The vertices of a set with tangent frames that are oriented alike."""
    return fabric_of(eset).vertices


def cut_along(eset: EquilibriumSet, values: Values, function: Function) -> Cutting:
    """Put vertices where a function vanishes on edges of a set, until no edge crosses its level.

    values: of the function at the vertices of the set's sheets.
    """
    values = np.where(np.abs(values) <= ROUND_OFF * np.abs(values).max(initial=0.0), 0.0, values)

    def between(
        fabric: Fabric, ends: Ends, mark: int, index: Items, known: Float[np.ndarray, "n 2"]
    ) -> tuple[ItemFlags, Vertices]:
        return roots(fabric, ends, mark, index, known, lambda at, _: function(at))

    excerpt = excerpt_of(eset, changing_cells(sheets_of(eset).cells, values))
    if len(excerpt.numbers) == 0:
        return Cutting(excerpt.put_back(), values, 0)
    cut = cut_between(excerpt.fabric, values[excerpt.used], between, function)
    recut = excerpt.put_back(cut.fabric)
    return Cutting(recut, np.concatenate([values, cut.values[len(excerpt.used) :]]), cut.lost)


def whole_set(recut: Recut, lost: int = 0) -> EquilibriumSet:
    """A set that was cut, with all of its cells; `lost`: how many edges could not be cut."""
    nothing = np.zeros(len(recut.points), bool)
    return part_of(recut, np.ones(len(recut.cells), bool), nothing, lost)


def part_of(
    recut: Recut,
    cells: CellFlags,
    on_level: VertexFlags,
    lost: int,
    setting: Setting | None = None,
) -> EquilibriumSet:
    """Some cells of a set that was cut as a set; facets on the level lie on a constraint.

    `lost`: how many edges could not be cut; setting: with further constraints, if there are any.
    """
    eset = recut.eset
    out = describe_again(eset, recut.complex(cells, on_level), setting or eset.setting)
    return replace(out, audit=replace(out.audit, unrefined=out.audit.unrefined + lost))
