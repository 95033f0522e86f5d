"""Regions of a set: their exact boundary by kinds, and their images in descriptor space."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np

from equimorph.arrays import Bool, Float, Int
from equimorph.errors import InputError
from equimorph.manifold import EquilibriumSet, cell_sizes
from equimorph.manifold.geometry.simplices import volumes
from equimorph.manifold.geometry.topology import facets_of, flags_of, pieces
from equimorph.manifold.lookup.cell_index import CellIndex
from equimorph.model import Descriptor
from equimorph.structures import States
from equimorph.tolerances import ON_SIDE

Kind = Literal["snap-through", "singular Jacobian", "actuator limit", "constraint", "open"]


@dataclass(frozen=True, eq=False)
class BoundaryPiece:
    """A connected piece of the boundary of a region, of one kind."""

    kind: Kind
    """Why motions end there. "snap-through": stability is lost. "singular Jacobian": the parameters
    cannot move the descriptors on. "actuator limit": a side of the box. "constraint". "open": the
    set is incomplete there."""
    detail: str
    """Which side of the box (``Theta = 2.5``) or constraint."""
    vertices: Int[np.ndarray, "..."]
    """Numbers of the region's vertices: one point (d = 1), a polyline, closed ones with the first
    repeated (d = 2), or triangles, one a row (d = 3)."""
    states: States
    """Exact states of `vertices` in order (of the corners of triangles, each once)."""
    values: Float[np.ndarray, "states k"]
    """Descriptors of `states`."""


@dataclass(frozen=True, eq=False)
class Region:
    """A connected region of stable states, as cells of a set, and its image under descriptors."""

    eset: EquilibriumSet
    """The region as a set; its boundary consists of exact states."""
    descriptors: tuple[Descriptor, ...]
    """Descriptors that the parameters control."""
    side: int
    """Sign of det J_S on it; 0 where the set was not cut along det J_S = 0."""
    singular: Bool[np.ndarray, " V"]
    """Vertices at which det J_S = 0."""

    def __repr__(self) -> str:
        """Number of cells and kinds of its boundary."""
        kinds = ", ".join(dict.fromkeys(piece.kind for piece in self.boundary))
        return f"Region({len(self.eset.cells)} cells; boundary: {kinds or 'none'})"

    @cached_property
    def values(self) -> Float[np.ndarray, "V k"]:
        """Descriptors at the vertices."""
        z, p = self.eset.points.z, self.eset.points.p
        return np.stack([each.function(z, p) for each in self.descriptors], axis=1)

    @cached_property
    def size(self) -> float:
        """Length, area or volume on the set, in the structure's metric and scaled parameters."""
        return float(cell_sizes(self.eset).sum())

    @property
    def steered(self) -> bool:
        """Whether there are as many descriptors as free parameters, so that images have a size."""
        return bool(self.values.shape[1] == len(self.eset.names))

    @cached_property
    def image_size(self) -> float:
        """Length, area or volume of the image, what is covered m times counted m times.

        Of the cells' chords: its error falls with the square of their size. 0 where there are not
        as many descriptors as free parameters.
        """
        return float(self._cell_images.sum()) if self.steered else 0.0

    @property
    def _cell_images(self) -> Float[np.ndarray, " C"]:
        return np.asarray(np.abs(volumes(self.values[self.eset.cells])))

    @cached_property
    def _index(self) -> CellIndex:
        return CellIndex.of(self.values[self.eset.cells], np.zeros(len(self.eset.cells)))

    def covering(self, places: Float[np.ndarray, "n k"]) -> Int[np.ndarray, " n"]:
        """How many states of the region show given values of the descriptors.

        Of the cells' chords: exact but for places as near to the boundary as chords are to arcs.

        Raises
        ------
        InputError
            If there are not as many descriptors as free parameters.
        """
        if not self.steered:
            raise InputError(
                f"`descriptors` must be {len(self.eset.names)} to cover values; "
                f"got {self.values.shape[1]}."
            )
        hits = self._index.near(places)
        return np.bincount(hits.point[hits.inside], minlength=len(places))

    @cached_property
    def areas(self) -> dict[int, float]:
        """Size of what is covered once, twice and so on, by the middles of the cells' images."""
        if not self.steered:
            return {}
        size = self._cell_images
        times = self.covering(self.values[self.eset.cells].mean(axis=1))
        sizes = {k: float(size[times == k].sum()) / k for k in range(1, times.max(initial=0) + 1)}
        return {k: area for k, area in sizes.items() if area > SLIVER * size.sum()}

    @property
    def multiplicity(self) -> int:
        """How many states of the region show the same descriptors, at most; 0 if not known."""
        return max(self.areas, default=0)

    @cached_property
    def boundary(self) -> tuple[BoundaryPiece, ...]:
        """Pieces of the boundary, of one kind each, as exact states."""
        return tuple(self._boundary())

    def _boundary(self) -> Iterator[BoundaryPiece]:
        facets, names = _outer(self.eset, self.singular)
        for kind, detail in dict.fromkeys(names):
            own = facets[[name == (kind, detail) for name in names]]
            for piece in pieces(own):
                vertices = np.atleast_1d(piece)
                flat = vertices if vertices.ndim == 1 else np.unique(vertices)
                states = self.eset.points[flat]
                yield BoundaryPiece(kind, detail, vertices, states, self.values[flat])


SLIVER = 1e-4
"""Share of the image below which what is covered again is a trace of chords instead of arcs."""


def _outer(
    eset: EquilibriumSet, singular: Bool[np.ndarray, " V"]
) -> tuple[Int[np.ndarray, "F d"], list[tuple[Kind, str]]]:
    """Facets of one cell, and what each of them lies on."""
    whole, d = eset.adjacency, len(eset.names)
    facets = whole.facets[whole.counts == 1]
    folded = flags_of(facets, facets_of(eset.folds, d))
    sides = _sides(eset, facets)
    names: list[tuple[Kind, str]] = []
    for facet, fold, side in zip(facets, folded, sides, strict=True):
        if singular[facet].all():
            names.append(("singular Jacobian", ""))
        elif fold:
            names.append(("snap-through", ""))
        elif side:
            names.append(("actuator limit", side))
        else:
            names.append(_active_constraint(eset, facet))
    return facets, names


def _sides(eset: EquilibriumSet, facets: Int[np.ndarray, "F d"]) -> list[str]:
    """Side of the box on which each facet lies, or nothing."""
    at, room = eset.coordinates[facets], ON_SIDE * (eset.box.upper - eset.box.lower)
    out = np.full(len(facets), "", dtype=object)
    for bounds in (eset.box.lower, eset.box.upper):
        on = (np.abs(at - bounds) <= room).all(axis=1)
        for k, name in enumerate(eset.names):
            out[on[:, k]] = f"{name} = {bounds[k]:g}"
    return [str(each) for each in out]


def _active_constraint(eset: EquilibriumSet, facet: Int[np.ndarray, " d"]) -> tuple[Kind, str]:
    """Which constraint is active on a facet."""
    states = eset.points[facet]
    if not eset.constraints:
        return "open", ""
    gaps = [np.abs(each.excess(states.z, states.p)).max() for each in eset.constraints]
    worst = int(np.argmin(gaps))
    active = gaps[worst] <= 1e-6 * eset.constraints[worst].size
    return ("constraint", str(eset.constraints[worst])) if active else ("open", "")
