"""The cheap way over an edge: one predictor step to its other end, verified."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Int

from equimorph.arrays import Flags, Lanes
from equimorph.equilibria import ParameterLine
from equimorph.equilibria.curves import correction_size, squared_length
from equimorph.model import Constraint

LONGEST = 0.5
"""Step in the metric above which the cheap way is not tried."""


@dataclass(frozen=True)
class Direct:
    """Points over the other ends, their index, and which of them can be trusted."""

    z: Lanes
    index: Int[np.ndarray, " lanes"]
    good: Flags


def lift_directly(
    line: ParameterLine,
    z: Lanes,
    index: Int[np.ndarray, " lanes"],
    constraints: tuple[Constraint, ...],
    steps: int = 1,
) -> Direct:
    """Tangent predictor over the edge, Newton at its end, and the tests of a safe step.

    An edge can be cut into equal `steps`; each must be safe. A lane is good if the first correction
    is below a quarter of the step, later ones shrink at least by half, the index is that of the
    start, the tangents differ by less than acos 0.9, and no constraint is violated. Points are
    polished to round-off.
    """
    if steps == 1:
        return _step(line, z, index, constraints)
    lanes, out, good = np.arange(len(z)), z.copy(), np.zeros(len(z), bool)
    for number in range(steps):
        start = line.start[lanes] + (number / steps) * line.velocity[lanes]
        part = ParameterLine(line.structure, start, line.velocity[lanes] / steps)
        direct = _step(part, out[lanes], index[lanes], constraints)
        lanes = lanes[direct.good]
        out[lanes] = direct.z[direct.good]
    good[lanes] = True
    return Direct(out, index, good)


def _step(
    line: ParameterLine,
    z: Lanes,
    index: Int[np.ndarray, " lanes"],
    constraints: tuple[Constraint, ...],
) -> Direct:
    """One step over each line, verified."""
    lanes = len(z)
    structure, weight = line.structure, line.weight
    still, one, none = np.zeros_like(z), np.ones(lanes), np.zeros(lanes)
    first = line.advance(z, none, still, one, none)
    tangent = first.tangent_z
    length = np.sqrt(squared_length(structure, weight, tangent, one))
    out, good = z + tangent, (length < LONGEST) & (first.index == index)
    size, last = np.full(lanes, np.inf), 0.25 * length
    end_tangent, end_index = np.zeros_like(z), np.full(lanes, -1)
    todo = np.flatnonzero(good)
    for _ in range(7):
        here = line.take(todo)
        count = len(todo)
        step = here.advance(out[todo], one[:count], still[:count], one[:count], none[:count])
        size[todo] = correction_size(structure, here.weight, step.dz, none[:count])
        alive = size[todo] <= np.maximum(last[todo], 1e-11)
        out[todo[alive]] += step.dz[alive]
        good[todo[~alive]] = False
        last[todo] = 0.5 * size[todo]
        end_tangent[todo], end_index[todo] = step.tangent_z, step.index
        # the last correction of a quadratic iteration is squared by applying it
        todo = todo[alive & (size[todo] > 1e-8)]
        if len(todo) == 0:
            break
    good &= (size <= 1e-8) & (end_index == index)
    n = structure.unknowns
    product = (tangent[:, :n] * end_tangent[:, :n]) @ structure.mass + weight**2
    end_length = np.sqrt(squared_length(structure, weight, end_tangent, one))
    good &= product >= 0.9 * length * end_length
    lanes_good = np.flatnonzero(good)
    p = line.take(lanes_good).parameters(one[: len(lanes_good)])
    for constraint in constraints:
        good[lanes_good] &= constraint.excess(out[lanes_good], p) <= 0.0
    return Direct(out, end_index, good)
