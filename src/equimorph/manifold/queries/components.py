"""Connected pieces of a set, of its stable part, or of the part that obeys constraints."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from equimorph.argument_checks import check_arguments
from equimorph.arrays import Float, Int
from equimorph.errors import InputError
from equimorph.manifold.complex.equilibrium_set import Component, EquilibriumSet
from equimorph.manifold.queries.levels import cell_sizes, part, restricted
from equimorph.manifold.queries.locate import cell_of
from equimorph.model import Constraint
from equimorph.structures import State


@dataclass(frozen=True, eq=False)
class Components:
    """Connected pieces of a set, or of a part of it, by size, the largest first.

    Parameters
    ----------
    eset
        The requested part, cut exactly along its constraints, as a set. Its
        `component` gives the number of the piece that each cell belongs to.
    sizes
        Length, area or volume of each piece in the metric of the set: configuration and scaled
        parameters.
    uncut
        Number of edges across the bounds of constraints on which no state on the bound was found:
        the adjacent cells are omitted, so that pieces connected there may appear separate.
    """

    eset: EquilibriumSet
    sizes: Float[np.ndarray, " pieces"]
    uncut: int

    def __len__(self) -> int:
        """Number of pieces."""
        return len(self.sizes)

    def __getitem__(self, number: int) -> EquilibriumSet:
        """One of the pieces as a set."""
        if not 0 <= number < len(self):
            raise IndexError(f"there are {len(self)} pieces; got number {number}")
        return part(self.eset, self.eset.component == number)

    def __iter__(self) -> Iterator[EquilibriumSet]:
        """Go through the pieces."""
        return (self[number] for number in range(len(self)))

    @property
    def about(self) -> tuple[Component, ...]:
        """Cells, Euler characteristic, loops and indices of each piece."""
        return self.eset.components

    @check_arguments
    def number_of(self, state: State) -> int | None:
        """Number of the piece that a state lies on; None if it is in no piece.

        Raises
        ------
        InputError
            If the state has other fixed parameters than the set, or lies beyond its box.
        """
        here = {name: state[name] for name in self.eset.names}
        if not np.allclose(self.eset.parameters_at(here), state.p, rtol=0, atol=1e-9):
            raise InputError(
                f"`state` must have the fixed parameters of the set ({dict(self.eset.fixed)}); "
                f"got {state.parameters}."
            )
        if len(self) == 0 or not all(each.holds(state.batch)[0] for each in self.eset.constraints):
            return None
        cell = cell_of(self.eset, state)
        return int(self.eset.component[cell]) if cell >= 0 else None

    @check_arguments
    def joined(self, one: State, other: State) -> bool:
        """Whether two states lie on the same piece.

        On the stable part this means that one can be moved to the other without a snap and within
        the constraints, as far as the cells of the set resolve them.
        """
        first, second = self.number_of(one), self.number_of(other)
        return first is not None and first == second

    @cached_property
    def _lines(self) -> tuple[str, ...]:
        """Every piece in one line."""
        return tuple(
            f"  {number}: size {size:.4g}, {each.cells} cells, "
            f"{'index' if len(each.indices) == 1 else 'indices'} "
            f"{', '.join(map(str, each.indices))}, Euler characteristic {each.euler_characteristic}"
            for number, (size, each) in enumerate(zip(self.sizes, self.about, strict=True))
        )

    def __repr__(self) -> str:
        """Every piece in one line."""
        rules = "".join(f", {each}" for each in self.eset.constraints)
        uncut = f"; {self.uncut} edges could not be cut" if self.uncut else ""
        head = f"Components over {self.eset.box}{rules}: {len(self)}{uncut}"
        return "\n".join([head, *self._lines])


@check_arguments
def components(
    eset: EquilibriumSet, *, stable: bool = False, within: Sequence[Constraint] = ()
) -> Components:
    """Connected pieces of a set: of all of it, its stable part, or the part within constraints.

    Cells are connected if they share a facet; a shared cusp or other corner does not count. Stable
    sheets that separate at a supercritical branch point are one piece, because a quasi-static
    motion can lead from one to the other.

    Parameters
    ----------
    stable
        Whether only stable states count.
    within
        Further constraints that states must obey. The set is cut exactly along their bounds: new
        vertices there are polished to round-off. A bound is detected where a constraint changes
        sign between vertices; strips of violation narrower than a cell are missed.

    Raises
    ------
    InputError
        If `within` holds anything but constraints.

    Examples
    --------
    >>> from equimorph import Box, Spring, equilibrium_set
    >>> spring = Spring()
    >>> eset = equilibrium_set(spring, Box(F=(-0.4, 0.4)), fixed={"x_l": 0.7}, intervals=(9,))
    >>> len(components(eset)), len(components(eset, stable=True))
    (1, 2)
    >>> len(components(eset, stable=True, within=[spring.angle >= 0]))
    1
    """
    known = part(eset, eset.cell_index == 0) if stable else eset
    before = known.audit.unrefined
    for each in dict.fromkeys(within):
        if each not in known.constraints and len(known.cells):
            known = restricted(known, each)
    sizes = np.bincount(known.component, cell_sizes(known), len(known.components))
    order = np.argsort(-sizes, kind="stable")
    return Components(_renumber(known, order), sizes[order], known.audit.unrefined - before)


def _renumber(eset: EquilibriumSet, order: Int[np.ndarray, " pieces"]) -> EquilibriumSet:
    """The set with its components in another order."""
    number = np.argsort(order)
    return replace(
        eset,
        component=number[eset.component],
        components=tuple(eset.components[old] for old in order),
        strata=tuple(replace(each, component=int(number[each.component])) for each in eset.strata),
    )
