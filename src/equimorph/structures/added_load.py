"""A structure under one more dead load: a force dual to a descriptor."""

from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from equimorph.arrays import Flags, Float, Lanes, Parameters, Sides, Values, Velocity
from equimorph.errors import InputError
from equimorph.linalg import BorderedSolution, no_border, solve_bordered
from equimorph.model import Descriptor, Parameter
from equimorph.structures.contract import Structure
from equimorph.structures.equations import AnyBorder, Direction, Equations, Shift
from equimorph.structures.whole_turns import WholeTurns

SHIFT = -1.0
"""Of the spectrum in units of the metric: F_z itself is singular at folds."""


def dense_matrices(
    equations: Equations, z: Lanes, p: Parameters
) -> Float[np.ndarray, "lanes size size"]:
    """F_z, from solves with it and a shift."""
    lanes, size = len(z), equations.size
    units = np.repeat(np.eye(size)[None], lanes, axis=0)
    inverse = equations.solve_whole(z, p, units, np.full(lanes, SHIFT))
    out = np.linalg.inv(inverse.transpose(0, 2, 1))
    at = np.arange(equations.unknowns)
    out[:, at, at] += SHIFT * equations.mass
    return np.asarray(out)


Shifts = Float[np.ndarray, "shifts unknowns"]

PUSH = "push"
"""Name of the force, the last parameter."""
DIFFERENCE = 1e-3
"""Step of differences of the descriptor, in units of `reach`."""


class Pushed(Structure):
    """A structure with the energy ``E − f S`` of a force f that works on a descriptor S.

    If S is a displacement, f is a point force that keeps its direction. Derivatives of S are
    differenced: the gradient to fourth order, the Hessian, of relative accuracy 1e-6, to second.

    Parameters
    ----------
    structure
        What is pushed.
    along
        The descriptor; a smooth function of the unknowns.
    scale
        Force that counts as one unit of length in the parameter space, in units of
        `Structure.energy` over the descriptor's.
    reach
        Change of the unknowns over which the descriptor keeps its slope, in their units.
    """

    kind: ClassVar[str] = "pushed structure"

    def __init__(self, structure: Structure, along: Descriptor, scale: float, reach: float) -> None:
        self._base, self._along, self._step = structure, along, DIFFERENCE * reach
        self.unknowns, self.constraints = structure.unknowns, structure.constraints
        self.mass, self.energy_scale = structure.mass, structure.energy_scale
        self.unresolved, self.longest_step = structure.unresolved, structure.longest_step
        unit = structure.effort_unit(Parameter(PUSH, along.unit, 1.0, "load"))
        self.parameters = (*structure.parameters, Parameter(PUSH, unit, scale, "load", 0.0))

    def identity(self) -> dict[str, Any]:
        """Refuse: a descriptor may be any function.

        Raises
        ------
        InputError
            Always.
        """
        raise InputError("`structure` must be one that can be written down; got a pushed one.")

    # --- the descriptor -------------------------------------------------------------------------

    def _values(self, z: Lanes, p: Parameters, shifts: Shifts) -> Float[np.ndarray, "lanes shifts"]:
        """S at all shifts of the unknowns."""
        at = np.repeat(z, len(shifts), axis=0)
        at[:, : self.unknowns] += np.tile(shifts, (len(z), 1))
        own = np.repeat(p[:, : len(self._base.parameters)], len(shifts), axis=0)
        return self._along.function(at, own).reshape(len(z), len(shifts))

    def gradient(self, z: Lanes, p: Parameters) -> Velocity:
        """∂S/∂u."""
        units = self._step * np.eye(self.unknowns)
        found = self._values(z, p, np.concatenate([units, -units, 2.0 * units, -2.0 * units]))
        ahead, behind, twice, back = found.reshape(len(z), 4, self.unknowns).transpose(1, 0, 2)
        return np.asarray((8.0 * (ahead - behind) - (twice - back)) / (12.0 * self._step))

    @cached_property
    def _pairs(self) -> tuple[Shifts, np.ndarray, np.ndarray]:
        i, j = np.triu_indices(self.unknowns)
        units = self._step * np.eye(self.unknowns)
        both = units[i] + units[j]
        nothing = np.zeros((1, self.unknowns))
        return np.concatenate([both, -both, units, -units, nothing]), i, j

    def hessian(self, z: Lanes, p: Parameters) -> Float[np.ndarray, "lanes unknowns unknowns"]:
        """∂²S/∂u²."""
        shifts, i, j = self._pairs
        found, n = self._values(z, p, shifts), self.unknowns
        pairs = found[:, : len(i)] + found[:, len(i) : 2 * len(i)]
        alone = found[:, -2 * n - 1 : -n - 1] + found[:, -n - 1 : -1]
        out = np.empty((len(z), n, n))
        bent = (pairs - alone[:, i] - alone[:, j] + 2.0 * found[:, -1:]) / (2.0 * self._step**2)
        out[:, i, j] = out[:, j, i] = bent
        return out

    # --- the contract ---------------------------------------------------------------------------

    def _own(self, p: Parameters) -> Float[np.ndarray, "lanes own"]:
        return np.ascontiguousarray(p[:, :-1])

    def energy(self, z: Lanes, p: Parameters) -> Values:
        """E − f S."""
        own = self._own(p)
        return np.asarray(self._base.energy(z, own) - p[:, -1] * self._along.function(z, own))

    def effort(self, z: Lanes, p: Parameters) -> Parameters:
        """Those of the structure, and −S."""
        own = self._own(p)
        return np.column_stack([self._base.effort(z, own), -self._along.function(z, own)])

    def residual(self, z: Lanes, p: Parameters) -> Lanes:
        """F − f ∂S/∂u."""
        out = self._base.residual(z, self._own(p))
        out[:, : self.unknowns] -= p[:, -1:] * self.gradient(z, p)
        return out

    def parameter_derivative(self, z: Lanes, p: Parameters, dp: Parameters) -> Lanes:
        """F_p·dp − df ∂S/∂u; descriptors do not depend on the parameters that move."""
        out = self._base.parameter_derivative(z, self._own(p), self._own(dp))
        out[:, : self.unknowns] -= dp[:, -1:] * self.gradient(z, p)
        return out

    def second_derivative(self, z: Lanes, p: Parameters, v: Direction, w: Direction) -> Lanes:
        """D²F without f D³S, whose part at folds is small."""
        n = self.unknowns
        inner = [(each[0], self._own(each[1])) for each in (v, w)]
        out = self._base.second_derivative(z, self._own(p), *inner)
        bent = self.hessian(z, p)
        for one, other in ((v, w), (w, v)):
            out[:, :n] -= one[1][:, -1:] * (bent @ other[0][:, :n, None])[:, :, 0]
        return out

    def solve(
        self, z: Lanes, p: Parameters, rhs: Sides, border: AnyBorder = None, shift: Shift = None
    ) -> BorderedSolution:
        """Solve with F_z − f ∂²S/∂u² − shift·mass, bordered, by dense factors."""
        n = self.unknowns
        matrix = dense_matrices(self._base, z, self._own(p))
        matrix[:, :n, :n] -= p[:, -1:, None] * self.hessian(z, p)
        if shift is not None:
            matrix[:, np.arange(n), np.arange(n)] -= shift[:, None] * self.mass
        columns, rows, corner = no_border(len(z), self.size) if border is None else border
        return solve_bordered(matrix, columns, rows, corner, rhs)

    def natural(self, p: Parameters) -> tuple[Lanes, Flags]:
        """Natural states of the structure."""
        return self._base.natural(self._own(p))

    def in_reach(self, p: Parameters) -> Flags:
        """Whether there may be states of the structure."""
        return self._base.in_reach(self._own(p))

    def sample(self, p: Parameters, generator: np.random.Generator) -> Lanes:
        """Guesses of the structure."""
        return self._base.sample(self._own(p), generator)

    @property
    def guesses_per_start(self) -> float:
        """Those of the structure."""
        return self._base.guesses_per_start

    def special_guesses(self, p: Parameters) -> Float[np.ndarray, "guesses lanes size"]:
        """Guesses of the structure to which random ones rarely lead."""
        return self._base.special_guesses(self._own(p))

    def as_guess(self, mean: Lanes) -> Lanes:
        """Guesses of the structure at means of states."""
        return self._base.as_guess(mean)

    def resolved(self, z: Lanes, p: Parameters) -> Flags:
        """Whether the structure's discretisation represents states."""
        return self._base.resolved(z, self._own(p))

    def may_resolve(self, z: Lanes, p: Parameters) -> Flags:
        """Whether finer discretisations of the structure may resolve states."""
        return self._base.may_resolve(z, self._own(p))

    @property
    def whole_turns(self) -> WholeTurns:
        """Whole turns of the structure."""
        return self._base.whole_turns

    def shape(
        self, z: Lanes, p: Parameters, s: Float[np.ndarray, " points"] | None = None
    ) -> Float[np.ndarray, "lanes points space"]:
        """Coordinates to draw."""
        return self._base.shape(z, self._own(p), s)
