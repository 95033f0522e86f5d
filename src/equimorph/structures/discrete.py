"""Structures of finitely many unknowns whose KKT matrix is sparse, and their natural states."""

from abc import abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import fields
from functools import cached_property

import numpy as np

from equimorph.argument_checks import check_arguments
from equimorph.arrays import Entries, Flags, Float, Lanes, Parameters, Values
from equimorph.errors import InputError
from equimorph.linalg.lanes import over_lanes
from equimorph.linalg.sparse import SparseLayout
from equimorph.structures.contract import Structure
from equimorph.structures.equations import Advance, Equations, JointEquations, Solver
from equimorph.structures.newton import Limits, newton
from equimorph.structures.states import State, natural_state

STEPS = 12
"""Steps of the continuation from the parameters where the natural state is given."""
SURE = Limits(iterations=12, longest=np.inf)
"""Newton's method at each of them."""
BALANCED = 1e-13
"""Largest residual of a guess that is an equilibrium already: round-off."""


def continue_equilibria(
    structure: Equations,
    guess: Callable[[Parameters], Lanes],
    start: Parameters,
    p: Parameters,
) -> tuple[Lanes, Flags]:
    """Equilibria at `p`, continued along the straight line in the parameters from `start`.

    The guess at `start` is corrected; each step predicts by the change of the guess and corrects
    by Newton. Lanes that do not converge are not found.
    """
    z, found = correct_at_parameters(structure, guess(start), start)
    if np.array_equal(start, p):
        return z, found
    before = start
    for k in range(1, STEPS + 1):
        here = start + (p - start) * (k / STEPS)
        z, good = correct_at_parameters(structure, z + guess(here) - guess(before), here)
        found, before = found & good, here
    return z, found


def correct_at_parameters(structure: Equations, z: Lanes, p: Parameters) -> tuple[Lanes, Flags]:
    """Newton at fixed parameters, and whether it settled; balanced guesses stay as they are."""
    balanced = _is_balanced(structure, z, p)
    found = newton(structure, z, p, SURE)
    z = np.where(balanced[:, None], z, found.z)
    good = balanced | found.found
    good[~good] = _is_balanced(structure, z[~good], p[~good])
    return z, good & np.isfinite(z).all(axis=1)


def _is_balanced(structure: Equations, z: Lanes, p: Parameters) -> Flags:
    return np.asarray(np.abs(structure.residual(z, p)).max(axis=1, initial=0.0) <= BALANCED)


BLOCK = 512
"""Lanes in one Newton step: the entries of their matrices then stay in the cache."""
NEAR = 0.1
"""Largest correction of a natural state, relative to the unknowns: given values may be rounded."""


class DiscreteStructure(JointEquations, Structure):
    """Structure with a sparse KKT matrix and a natural state known at the default parameters.

    Subclasses give `linearised` (F, F_p·dp and the entries of F_z in the order of the
    layout) and `natural_guess`, and the rest of the contract.
    """

    @cached_property
    def layout(self) -> SparseLayout:
        """Sparsity of F_z; by default every unknown acts on every other one."""
        return SparseLayout(*np.tril_indices(self.size), self.size, self.constraints)

    @abstractmethod
    def natural_guess(self, p: Parameters) -> Lanes:
        """Natural states with all loads at zero, exact at the default parameters at least."""

    def entries(self, z: Lanes, p: Parameters) -> Entries:
        """Entries of F_z in the order of `layout`."""
        return self.parts(z, p)[0]

    def solver(
        self, parts: tuple[np.ndarray, ...], z: Lanes, p: Parameters, shift: Values | None = None
    ) -> Solver:
        """Solves with F_z − shift·mass by sparse LDLᵀ."""
        entries = parts[0]
        if shift is not None:
            entries = entries.copy()
            entries[:, self.layout.diagonal[: self.unknowns]] -= shift[:, None] * self.mass
        return lambda rhs, border: self.layout.solve(entries, border, rhs)

    def advance(
        self, z: Lanes, p: Parameters, dp: Parameters, row: Lanes, corner: Values, defect: Values
    ) -> Advance:
        """One Newton step, block by block."""
        given = (z, p, dp, row, corner, defect)
        starts = range(0, max(len(z), 1), BLOCK)
        step = super().advance
        parts = [step(*(array[i : i + BLOCK] for array in given)) for i in starts]
        if len(parts) == 1:
            return parts[0]
        names = [field.name for field in fields(Advance)]
        return Advance(*(np.concatenate([getattr(part, name) for part in parts]) for name in names))

    # --- the natural state ----------------------------------------------------------------------

    @cached_property
    def _reference(self) -> Float[np.ndarray, " parameters"]:
        """Parameters at which the natural state is known: NaN for parameters without a default."""
        loads = self.unloaded()
        defaults = [
            loads.get(each.name, np.nan if each.default is None else each.default)
            for each in self.parameters
        ]
        return np.array(defaults)

    def check_natural_state(self, names: Sequence[str]) -> None:
        """Refuse a guess at the default parameters that is no equilibrium.

        `names` are those of the unknowns.
        """
        p = self._reference[None]
        if np.isnan(p).any():
            return
        guess = self.natural_guess(p)
        force = self.residual(guess, p)[0]
        if np.isfinite(force).all():
            z, found = correct_at_parameters(self, guess, p)
            before, after = guess[0, : self.unknowns], z[0, : self.unknowns]
            allowed = NEAR * (1.0 + np.abs(before).max())
            if found[0] and np.abs(after - before).max() <= allowed:
                return
        worst = int(np.argmax(np.where(np.isfinite(force), np.abs(force), np.inf)))
        broken = worst >= self.unknowns
        name = f"constraints[{worst - self.unknowns}]" if broken else f"dE/d{names[worst]}"
        raise InputError(
            "`natural` must be an equilibrium with all loads at zero; got "
            f"{name} = {force[worst]:.3g}. Give natural values closer to one."
        )

    def natural(self, p: Parameters) -> tuple[Lanes, Flags]:
        """Natural state, continued from the default parameters."""
        start = np.where(np.isnan(self._reference), p, self._reference)
        return continue_equilibria(self, self.natural_guess, start, p)

    @check_arguments
    def natural_state(self, **values: float) -> State:
        """Natural state at given parameters, all loads at zero.

        Raises
        ------
        InputError
            For unknown or meaningless parameters, a load that is not zero, or where the
            continuation from the default parameters does not converge.
        """
        return natural_state(self, **values)


def linearise(
    kernel: Callable[..., None],
    shared: tuple[object, ...],
    layout: SparseLayout,
    given: Sequence[np.ndarray],
) -> tuple[Lanes, Lanes, Entries]:
    """F, F_p·dp and the entries of F_z by a compiled kernel; the first array given is z."""
    z = np.ascontiguousarray(given[0])
    residual, column = np.empty_like(z), np.empty_like(z)
    entries = np.empty((len(z), len(layout.rows)))
    if len(z):
        inputs = [z, *(np.ascontiguousarray(array) for array in given[1:])]
        over_lanes(kernel, shared, inputs, [residual, column, entries])
    return residual, column, entries


def along_corners(
    corners: Float[np.ndarray, "lanes corners 2"], s: Float[np.ndarray, " points"]
) -> Float[np.ndarray, "lanes points 2"]:
    """Points of polylines; `s` runs from 0 to 1 from the first to the last corner."""
    last = corners.shape[1] - 1
    place = np.clip(np.asarray(s, dtype=float), 0.0, 1.0) * last
    at = np.minimum(place.astype(int), last - 1)
    share = (place - at)[:, None]
    return np.asarray((1.0 - share) * corners[:, at] + share * corners[:, at + 1])
