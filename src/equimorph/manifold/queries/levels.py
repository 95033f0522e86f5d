"""Level sets: exact vertices where a function on the set vanishes, and complexes cut along them."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from equimorph.argument_checks import check_arguments
from equimorph.arrays import CellFlags, CellNumbers, Float, Int, ItemFlags, Items, VertexFlags
from equimorph.errors import InputError
from equimorph.manifold.complex.cuts import (
    ROUND_OFF,
    Cut,
    Ends,
    Function,
    Values,
    cut_between,
    roots,
)
from equimorph.manifold.complex.description import describe_again
from equimorph.manifold.complex.equilibrium_set import EquilibriumSet
from equimorph.manifold.complex.marked_complex import Fabric, FacetMark, ends_of_changes, fabric_of
from equimorph.manifold.complex.vertices import Vertices
from equimorph.manifold.geometry.points import VertexKind, on_fold
from equimorph.manifold.geometry.setting import Setting, embed
from equimorph.manifold.geometry.tangents import split_step
from equimorph.manifold.geometry.topology import adjacency, pieces
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
    return _level(eset, lambda v: descriptor.function(v.z, v.p) - value)


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
    return _level(eset, lambda v: jacobian(eset.setting, v, descriptors))


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
    fabric = fabric_of(eset)
    return _divide(eset, _cut(fabric, lambda v: jacobian(fabric.setting, v, descriptors)))


@check_arguments
def divided_by(eset: EquilibriumSet, constraint: Constraint) -> Division:
    """Cut a set exactly along the bound of a constraint; the side is -1 where it is obeyed."""
    return _divide(eset, _cut_at_bound(eset, constraint))


def _divide(eset: EquilibriumSet, cut: "Cut") -> Division:
    nothing = np.zeros(len(cut.values), bool)
    whole = part_of(eset, cut.fabric, np.ones(len(cut.fabric.cells), bool), nothing, cut.lost)
    side = np.sign(cut.values[cut.fabric.cells].sum(axis=1)).astype(int)
    on_level, number = np.zeros(len(whole.points), bool), cut.fabric.numbers
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
    inside = (cut.values[cut.fabric.cells] <= 0.0).all(axis=1)
    constraints = (*eset.constraints, constraint)
    setting = replace(eset.setting, constraints=constraints)
    return part_of(eset, replace(cut.fabric, setting=setting), inside, cut.on_level, cut.lost)


def cell_sizes(eset: EquilibriumSet) -> Float[np.ndarray, " C"]:
    """Lengths, areas or volumes of the cells in the metric of the embedding."""
    corners = embed(eset.setting, eset.points.z, eset.points.p)[eset.cells]
    sides = corners[:, 1:] - corners[:, :1]
    gram = sides @ np.swapaxes(sides, 1, 2)
    share = {1: 1.0, 2: 0.5, 3: 1.0 / 6.0}[len(eset.names)]
    return np.asarray(share * np.sqrt(np.maximum(np.linalg.det(gram), 0.0)))


@check_arguments
def part(eset: EquilibriumSet, cells: CellFlags) -> EquilibriumSet:
    """Selected cells as a set, like the stable ones: ``eset.cell_index == 0``."""
    fabric = fabric_of(eset, np.zeros(len(eset.points), bool))
    nothing = np.zeros(len(fabric.vertices), bool)
    return part_of(eset, fabric, cells, nothing, 0)


def _level(eset: EquilibriumSet, function: Function) -> Level:
    cut = _cut(fabric_of(eset), function)
    store, whole = cut.fabric.vertices, adjacency(cut.fabric.cells)
    facets = whole.facets[cut.on_level[whole.facets].all(axis=1)]
    facets = np.unique(np.sort(cut.fabric.points[facets], axis=1), axis=0)
    used, inverse = np.unique(facets, return_inverse=True)
    states = States(eset.structure, store.z[used], store.p[used])
    return Level(states, tuple(pieces(inverse.reshape(facets.shape))), cut.lost)


def _cut_at_bound(eset: EquilibriumSet, constraint: Constraint) -> Cut:
    excess = constraint.excess(eset.points.z, eset.points.p)
    fabric = fabric_of(eset, ends_of_changes(eset.cells, excess))
    return _cut(fabric, lambda v: constraint.excess(v.z, v.p))


def _cut(fabric: Fabric, function: Function) -> Cut:
    """Put vertices where a function vanishes on edges, until no edge crosses its level."""
    values = function(fabric.vertices)
    values = np.where(np.abs(values) <= ROUND_OFF * np.abs(values).max(initial=0.0), 0.0, values)

    def between(
        fabric: Fabric, ends: Ends, mark: int, index: Items, known: Float[np.ndarray, "n 2"]
    ) -> tuple[ItemFlags, Vertices]:
        return roots(fabric, ends, mark, index, known, lambda at, _: function(at))

    return cut_between(fabric, values, between, function)


def part_of(
    eset: EquilibriumSet, fabric: Fabric, cells: CellFlags, on_level: VertexFlags, lost: int
) -> EquilibriumSet:
    """Some cells of a fabric as a set; facets on the level lie on a constraint.

    `lost`: how many edges could not be cut.
    """
    whole = adjacency(fabric.cells[cells]) if cells.any() else None
    facets, marks = fabric.facets, fabric.marks
    if whole is not None:
        outer = whole.facets[whole.counts == 1]
        capped = outer[on_level[outer].all(axis=1)]
        facets = np.concatenate([facets, capped])
        marks = np.concatenate([marks, np.full(len(capped), FacetMark.CAP)])
    kinds = fabric.vertices.kinds.copy()
    plain = on_level & (kinds != VertexKind.CROSSING)
    kinds[plain] = np.where(
        on_fold(kinds[plain]),
        VertexKind.CORNER,
        VertexKind.CAP,
    )
    fabric = replace(
        fabric.only(cells),
        vertices=replace(fabric.vertices, kinds=kinds),
        facets=facets[(marks & FacetMark.HOLE) == 0],
        marks=marks[(marks & FacetMark.HOLE) == 0],
    )
    out = describe_again(eset, fabric.complex(), fabric.setting)
    return replace(out, audit=replace(out.audit, unrefined=out.audit.unrefined + lost))
