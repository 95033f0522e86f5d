"""`reachable` and `attainable`: what stable motions lead to from a state, and what bounds it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np

from equimorph.argument_checks import check_arguments
from equimorph.arrays import Bool, Float, Int
from equimorph.errors import InputError
from equimorph.manifold import Division, EquilibriumSet, divided, part, refine
from equimorph.manifold.complex.equilibrium_set import check_cells
from equimorph.manifold.geometry.topology import labels
from equimorph.model import Constraint, Descriptor
from equimorph.structures import State, States
from equimorph.tasks.reach.query import Answer, query_region
from equimorph.tasks.reach.regions import BoundaryPiece, Region
from equimorph.tasks.stable_part import cell_near, stable_piece
from equimorph.tasks.start import check_stable

FINER = (0.1, 0.03)
"""Accuracies of a set, tried in turn if edges could not be cut."""


@dataclass(frozen=True, eq=False)
class Reach:
    """Reachable or attainable set of a stable state, with its boundary by kinds.

    Parameters
    ----------
    status, why
        Always "found"; `why` names what could not be cut exactly.
    start
        The state.
    descriptors
        Descriptors that the parameters control.
    regions
        Regions of the stable piece of the start; the first is that of the start, whose image is
        the reachable (or attainable) set.
    whole
        The stable piece of the start, uncut, for queries.
    within
        Constraints in addition to those of the set.
    """

    status: Literal["found"]
    why: str
    start: State
    descriptors: tuple[Descriptor, ...]
    regions: tuple[Region, ...]
    whole: EquilibriumSet
    within: tuple[Constraint, ...]

    def __repr__(self) -> str:
        """The start's region and the number of regions."""
        return f"Reach({self.home} of {len(self.regions)}; from {self.start})"

    @property
    def home(self) -> Region:
        """Region of the start."""
        return self.regions[0]

    @property
    def boundary(self) -> tuple[BoundaryPiece, ...]:
        """Boundary of the start's region, in pieces."""
        return self.home.boundary

    @property
    def states(self) -> States:
        """Vertices of the start's region."""
        return self.home.eset.points

    @cached_property
    def margin(self) -> Float[np.ndarray, " V"]:
        """Stability margin at the vertices of the start's region."""
        return self.states.margin

    @check_arguments
    def query(self, targets: Mapping[Descriptor, float]) -> Answer:
        """Whether the structure can reach given values of the descriptors; if not, why.

        The answer is decided by lifting; a state of the start's region with these values is not
        enough.

        Raises
        ------
        InputError
            If descriptors are not those of the set, or values are not finite.
        """
        return query_region(self.start, self.regions, self.whole, targets, self.within)


@check_arguments
def reachable(
    eset: EquilibriumSet,
    state: State,
    descriptors: Sequence[Descriptor],
    *,
    within: Sequence[Constraint] = (),
    accuracy: float | None = None,
) -> Reach:
    """Find all values of descriptors that a continuous motion reaches from a state.

    The stable piece of the set around the state is cut, at exact states, along constraints and
    along ``det J_S = 0``, where the free parameters do not control the descriptors. On each region
    the descriptors are local coordinates; its image may cover values more than once.

    Parameters
    ----------
    eset
        Equilibrium set over the actuators.
    state
        A stable state of the set.
    descriptors
        As many as the set has free parameters.
    within
        Constraints in addition to those of the set.
    accuracy
        Refine the piece to this accuracy first; see `refine`.

    Returns
    -------
    The regions, the start's first, with their boundaries by kind; `Reach.query` answers whether
    given values can be reached.

    Raises
    ------
    InputError
        If `state` is not a stable state of the set or violates a constraint, or there is another
        number of descriptors.

    Examples
    --------
    >>> import equimorph as em
    >>> spring = em.Spring()
    >>> eset = em.equilibrium_set(spring, em.Box(F=(-0.3, 0.3)), fixed={"x_l": 0.8}, intervals=(9,))
    >>> start = max(eset.at(F=0.0).stable, key=spring.angle)
    >>> reach = em.reachable(eset, start, [spring.angle])
    >>> sorted(piece.kind for piece in reach.boundary)
    ['actuator limit', 'snap-through']
    """
    piece = _stable_piece(eset, state, tuple(within))
    if accuracy is not None:
        piece = refine(piece, accuracy)
    cut = divided(piece, descriptors)
    for finer in FINER if cut.lost else ():
        # chords that leave the set where its boundary is hollow cannot be cut: flips, smaller cells
        piece = refine(piece, finer)
        cut = divided(piece, descriptors)
        if not cut.lost:
            break
    label = _pieces_beside_level(cut)
    own = label[cell_near(cut.eset, state)]
    order = [own, *(k for k in range(label.max() + 1) if k != own)]
    regions = tuple(
        _region(cut.eset, label == k, tuple(descriptors), cut.side, cut.on_level) for k in order
    )
    why = f"{cut.lost} edges could not be cut where det J_S = 0" if cut.lost else ""
    return Reach("found", why, state, tuple(descriptors), regions, piece, tuple(within))


@check_arguments
def attainable(
    eset: EquilibriumSet,
    state: State,
    descriptors: Sequence[Descriptor] = (),
    *,
    within: Sequence[Constraint] = (),
) -> Reach:
    """Find all states that a stable motion of the parameters reaches from a state.

    Like `reachable`, but not cut along ``det J_S = 0``: the parameters may also move where they do
    not control the descriptors.

    Parameters
    ----------
    eset
        Equilibrium set over the actuators.
    state
        A stable state of the set.
    descriptors
        Any number of descriptors; their values form the image of the region.
    within
        Constraints in addition to those of the set.

    Returns
    -------
    One region with its boundary by kinds.

    Raises
    ------
    InputError
        If `state` is no stable state of the set or violates a constraint.
    """
    piece = _stable_piece(eset, state, tuple(within))
    nowhere = np.zeros(len(piece.points), bool)
    region = Region(piece, tuple(descriptors), 0, nowhere)
    return Reach("found", "", state, tuple(descriptors), (region,), piece, tuple(within))


def _stable_piece(
    eset: EquilibriumSet, state: State, within: tuple[Constraint, ...]
) -> EquilibriumSet:
    """Stable cells around a state that obey all constraints."""
    check_cells(eset)
    check_stable("state", state)
    for constraint in within:
        if constraint.excess(state.z[None], state.p[None])[0] > 0.0:
            raise InputError(f"`state` must obey {constraint}; got {state}, which does not.")
    piece = stable_piece(eset, state, within)
    if piece is None:
        raise InputError(f"`state` must be a state of the set; got {state}, which is not.")
    return piece


def _pieces_beside_level(cut: Division) -> Int[np.ndarray, " C"]:
    """Pieces of a set between facets on the level; cells on different sides never belong together.

    The latter matters only where the set could not be cut.
    """
    whole = cut.eset.adjacency
    wall = cut.on_level[whole.facets].all(axis=1)[whole.across]
    sides = cut.side[whole.links]
    return labels(len(cut.eset.cells), whole.links[~wall & (sides[:, 0] == sides[:, 1])])


def _region(
    eset: EquilibriumSet,
    cells: Bool[np.ndarray, " C"],
    descriptors: tuple[Descriptor, ...],
    side: Int[np.ndarray, " C"],
    on_level: Bool[np.ndarray, " V"],
) -> Region:
    used = np.unique(eset.cells[cells])
    sign = int(np.sign(side[cells].sum()))
    return Region(part(eset, cells), descriptors, sign, on_level[used])
