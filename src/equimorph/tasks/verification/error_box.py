"""Boxes of errors around the segments of a proof: in parameters, and in data of the structure.

An error ε ∈ [−1, 1]ᵐ shifts the parameters by ``P ε`` and F by ``Σ xₖ Gₖ``, x a part of ε; states
follow by ``Z ε`` to first order, ``Z = −F_z⁻¹ (F_p P + G)``. The errors x of data count as further
parameters of F.
"""

from dataclasses import dataclass

import numpy as np

from equimorph.arrays import Float, Lanes, Parameters
from equimorph.columns import Columns
from equimorph.linalg.intervals import Interval, join, product
from equimorph.structures import Direction, Enclosed, States, Structure

Responses = Float[np.ndarray, "lanes m size"]


def enclose(structure: Structure, z: Interval, p: Interval) -> Enclosed:
    """F and its derivatives over boxes: enclosed, or sampled where the structure has no bounds."""
    return structure.enclosure(z, p) or sampled_enclosure(structure, z, p)


@dataclass(frozen=True)
class Deviation:
    """Change ``x G`` of F by an error of data, |x| ≤ 1: F is linear in x."""

    nominal: Structure
    """The structure without errors."""
    changed: Structure
    """The one at x = 1: G is the difference of their F."""
    far: Structure
    """One at a large x, from which bounds of G and its derivatives are narrow."""
    multiple: float
    """That x."""

    def force(self, z: Lanes, p: Parameters) -> Lanes:
        """G."""
        return np.asarray(self.changed.residual(z, p) - self.nominal.residual(z, p))

    def enclose(self, z: Interval, p: Interval) -> Enclosed:
        """G and its derivatives over boxes; G itself by its mean value."""
        slopes = self._change(z, p)
        here = self._change(Interval.at(z.middle), Interval.at(p.middle)).residual
        rows = join([slopes.matrix, slopes.columns], 2)
        room = rows.size @ np.concatenate([z.radius, p.radius], axis=1)[:, :, None]
        return Enclosed(here + Interval(-room, room)[:, :, 0], slopes.matrix, slopes.columns)

    def _change(self, z: Interval, p: Interval) -> Enclosed:
        near, far = enclose(self.nominal, z, p), enclose(self.far, z, p)
        pairs = [(getattr(near, name), getattr(far, name)) for name in vars(near)]
        return Enclosed(*((there - here) / self.multiple for here, there in pairs))


@dataclass(frozen=True)
class ErrorBox(Columns):
    """Errors of the parameters, which may differ from segment to segment, and of data."""

    steps: Float[np.ndarray, "lanes m parameters"]
    """Changes of all parameters by each error."""
    deviations: tuple[Deviation, ...] = ()
    """Errors of data."""

    @classmethod
    def none(cls, states: States) -> "ErrorBox":
        """No errors."""
        return cls(np.zeros((len(states), 0, states.p.shape[1])))

    def responses(self, states: States) -> Responses:
        """Linear changes of states by each error of parameters, then of data."""
        structure, z, p = states.structure, states.z, states.p
        lanes, m = self.steps.shape[:2]
        forces = [each.force(z, p) for each in self.deviations]
        if m + len(forces) == 0:
            return np.zeros((lanes, 0, structure.size))
        steps = [np.ascontiguousarray(self.steps[:, k]) for k in range(m)]
        columns = [structure.parameter_derivative(z, p, step) for step in steps]
        return structure.solve(z, p, -np.stack([*columns, *forces], axis=1)).x

    @property
    def widths(self) -> Parameters:
        """Half widths of the boxes of parameters."""
        return np.asarray(np.abs(self.steps).sum(axis=1))

    def enclose(self, structure: Structure, z: Interval, p: Interval) -> Enclosed:
        """F and its derivatives over boxes, for all errors of data; these are the last columns."""
        found, either = enclose(structure, z, p), Interval(-np.ones(1), np.ones(1))
        matrix, columns, own = found.matrix, found.columns, []
        for each in self.deviations:
            change = each.enclose(z, p)
            matrix, columns = matrix + either * change.matrix, columns + either * change.columns
            own.append(change.residual[:, :, None])
        return Enclosed(found.residual, matrix, join([columns, *own], 2))

    def remainder(self, found: Enclosed, responses: Responses) -> Interval:
        """F_z Z + F_p P + G over boxes: what the linear responses leave."""
        lanes, m, _ = self.steps.shape
        data = len(self.deviations)
        steps = np.zeros((lanes, m + data, self.steps.shape[2] + data))
        steps[:, :m, : self.steps.shape[2]] = self.steps
        steps[:, range(m, m + data), range(self.steps.shape[2], steps.shape[2])] = 1.0
        return product(responses, found.matrix) + product(steps, found.columns.transpose(0, 2, 1))


Tensor = Float[np.ndarray, "lanes size entries entries"]

DIFFERENCE = 1e-4
"""Step of the central differences that give F_z independently of the solver."""
ROUNDING = 1e-13
"""Relative error assumed for every entry of F."""
MOST_ENTRIES = 80
"""Unknowns, multipliers and parameters up to which all second derivatives are formed."""
CORNERS = 4
"""Random corners of each box at which second derivatives are sampled."""
SAFETY = 2.0
"""Factor on the largest change of a second derivative seen in the box."""


def allows_sampling(structure: Structure) -> bool:
    """Whether the second derivatives are few enough."""
    return structure.size + len(structure.parameters) <= MOST_ENTRIES


def sampled_enclosure(structure: Structure, z: Interval, p: Interval) -> Enclosed:
    """F, F_z and F_p at the centres of boxes, with changes by the second derivatives.

    Second derivatives are taken at the centre and at random corners: an estimate, not a proof.
    """
    here, reach = (z.middle, p.middle), (z.radius, p.radius)
    size = structure.size
    first = np.concatenate([_matrix(structure, *here), _columns(structure, *here)], axis=2)
    both = np.concatenate(reach, axis=1)[:, :, None]
    change = np.zeros_like(first)
    if both.any():
        change = (_second_derivatives(structure, *here, reach) @ both[:, None])[..., 0]
    rounding = ROUNDING * (np.abs(first[:, :, :size]) @ np.abs(here[0])[:, :, None])
    moved = (np.abs(first) @ both + rounding)[:, :, 0]
    derivatives = Interval.around(first, change)
    return Enclosed(
        Interval.around(structure.residual(*here), moved),
        derivatives[:, :, :size],
        derivatives[:, :, size:],
    )


def _matrix(structure: Structure, z: Lanes, p: Parameters) -> Float[np.ndarray, "lanes size size"]:
    """F_z by central differences of F."""
    lanes, size = z.shape
    steps = DIFFERENCE * np.eye(size)
    many = np.repeat(p, size, axis=0)
    ahead, behind = (
        structure.residual((z[:, None] + sign * steps).reshape(-1, size), many)
        for sign in (1.0, -1.0)
    )
    rows = ((ahead - behind) / (2.0 * DIFFERENCE)).reshape(lanes, size, size)
    return np.asarray(0.5 * (rows + rows.transpose(0, 2, 1)))


def _columns(
    structure: Structure, z: Lanes, p: Parameters
) -> Float[np.ndarray, "lanes size parameters"]:
    """F_p."""
    units = np.eye(p.shape[1])
    columns = [structure.parameter_derivative(z, p, np.tile(one, (len(p), 1))) for one in units]
    return np.stack(columns, axis=2)


def _second_derivatives(structure: Structure, z: Lanes, p: Parameters, reach: Direction) -> Tensor:
    """|D²F| at the centre of boxes, and twice its largest change to a corner."""
    generator = np.random.default_rng(7)
    centre = _tensor(structure, z, p)
    change = np.zeros_like(centre)
    for _ in range(CORNERS):
        sides = [generator.choice([-1.0, 1.0], each.shape) * each for each in reach]
        there = _tensor(structure, z + sides[0], p + sides[1])
        change = np.maximum(change, np.abs(there - centre))
    return np.asarray(np.abs(centre) + SAFETY * change)


def _tensor(structure: Structure, z: Lanes, p: Parameters) -> Tensor:
    """All second derivatives of F by unknowns, multipliers and parameters."""
    lanes, size, count = len(z), structure.size, structure.size + len(structure.parameters)
    first, second = np.triu_indices(count)
    units = np.eye(count)
    table = np.empty((lanes, size, count, count))
    for lane in range(lanes):
        v, w = ((units[at, :size], units[at, size:]) for at in (first, second))
        here, there = (np.tile(each[lane], (len(first), 1)) for each in (z, p))
        values = structure.second_derivative(here, there, v, w).T
        table[lane][:, first, second] = values
        table[lane][:, second, first] = values
    return table
