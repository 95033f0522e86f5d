"""All derivatives that a structure must offer, from the graph of its energy."""

from collections.abc import Sequence
from functools import cached_property
from typing import Any

import numpy as np

from equimorph.linalg.sparse import SparseLayout
from equimorph.structures.energy.tape import Tape, casadi, tape


class Derivatives:
    """L = E + λ·c and its derivatives, as tapes made on first use.

    Parameters
    ----------
    u, p
        Columns of symbols.
    energy, constraints
        Graphs of E and of each c in them.
    """

    def __init__(self, u: Any, p: Any, energy: Any, constraints: Sequence[Any]) -> None:
        ca = casadi()
        multipliers = ca.SX.sym("multiplier", len(constraints))
        self._z, self._p, self._energy = ca.vertcat(u, multipliers), p, energy
        gaps = ca.vertcat(ca.SX(0, 1), *constraints)
        self._lagrangian = energy + ca.dot(multipliers, gaps)
        self._force = ca.gradient(self._lagrangian, self._z)
        self._dp = ca.SX.sym("dp", p.numel())
        self._entries, self.layout = self._triangle(len(constraints))

    def _triangle(self, multipliers: int) -> tuple[Any, SparseLayout]:
        """Entries of the lower triangle of F_z, the diagonal complete, and their layout."""
        ca, size = casadi(), self._z.numel()
        lower = ca.tril(ca.jacobian(self._force, self._z))
        rows, columns = (np.array(each, dtype=int) for each in lower.sparsity().get_triplet())
        missing = np.setdiff1d(np.arange(size), rows[rows == columns])
        entries = ca.vertcat(*lower.nonzeros(), ca.SX.zeros(len(missing)))
        rows, columns = (np.concatenate([each, missing]) for each in (rows, columns))
        return entries, SparseLayout(rows, columns, size, multipliers)

    def tape(self, expressions: Any) -> Tape:
        """Tape of expressions in (z, p)."""
        return tape((self._z, self._p), expressions)

    @cached_property
    def energy(self) -> Tape:
        """E(z, p)."""
        return self.tape(self._energy)

    @cached_property
    def residual(self) -> Tape:
        """F(z, p)."""
        return self.tape(self._force)

    @cached_property
    def matrix(self) -> Tape:
        """Entries of F_z at (z, p)."""
        return self.tape(self._entries)

    @cached_property
    def effort(self) -> Tape:
        """∂L/∂p at (z, p)."""
        return self.tape(casadi().gradient(self._lagrangian, self._p))

    @cached_property
    def _column(self) -> Any:
        return casadi().jtimes(self._force, self._p, self._dp)

    @cached_property
    def column(self) -> Tape:
        """F_p·dp at (z, p, dp)."""
        return tape((self._z, self._p, self._dp), self._column)

    @cached_property
    def step(self) -> Tape:
        """F, F_p·dp and the entries of F_z at (z, p, dp)."""
        outputs = casadi().vertcat(self._force, self._column, self._entries)
        return tape((self._z, self._p, self._dp), outputs)

    @cached_property
    def second(self) -> Tape:
        """D²F[v, w] at (z, p, v_z, v_p, w_z, w_p)."""
        ca = casadi()
        place = ca.vertcat(self._z, self._p)
        v, w = ca.SX.sym("v", place.numel()), ca.SX.sym("w", place.numel())
        once = ca.jtimes(self._force, place, v)
        return tape((place, v, w), ca.jtimes(once, place, w))
