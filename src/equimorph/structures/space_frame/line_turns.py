"""Turns of frames in space about the line on which their joints lie: what tells them apart."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from equimorph.arrays import Float
from equimorph.structures.space_frame.model import ON_LINE, SpatialFrameModel
from equimorph.structures.spatial.phase_condition import phase_weight
from equimorph.structures.spatial.quaternions import FRAME

NEAR_LINE = 1e-12
"""Forces, strains, moves and turns across the line that are none: round-off of the way to them."""


@dataclass(frozen=True, eq=False)
class LineTurns:
    """Turns of a frame's states about the line on which its joints lie, if it has one."""

    model: SpatialFrameModel

    @cached_property
    def cross(self) -> Float[np.ndarray, "3 3"]:
        """J: velocity of a vector by a turn about the line."""
        line = np.zeros(3) if self.model.line is None else self.model.line
        return np.cross(line, np.eye(3)).T

    @cached_property
    def _turned_forces(self) -> tuple[np.ndarray, np.ndarray]:
        """J f of the forces f of each scalar: the multipliers that have it, and what is left."""
        model, m = self.model, self.model.multipliers
        forces = np.concatenate([model.forces.members, model.forces.supports], axis=1)
        turned = (forces @ self.cross.T).reshape(len(forces), -1).T
        own = forces[:m].reshape(m, turned.shape[0]).T
        rates = np.linalg.lstsq(own, turned, rcond=None)[0]
        return rates, turned - own @ rates

    @property
    def rates(self) -> Float[np.ndarray, "multipliers scalars"]:
        """Velocities of the multipliers, by the scalars."""
        return self._turned_forces[0]

    @cached_property
    def possible(self) -> bool:
        """Whether nothing but values of parameters may tell directions across the line apart."""
        model = self.model
        if model.line is None:
            return False
        along = np.concatenate([model.tangents.reshape(-1, 3), model.hinge_axes])
        ends = [_held(*each) for each in self._supports]
        forms = np.concatenate([np.array(ends).reshape(-1, 3, 3), model.yielding])
        apart = np.abs(self.cross @ forms - forms @ self.cross)
        bend, left = model.rigidity, self._turned_forces[1][:, : model.multipliers]
        return bool(
            np.abs(along @ self.cross.T).max() <= ON_LINE
            and (np.abs(bend[:, 1] - bend[:, 2]) <= ON_LINE * bend[:, 1]).all()
            and apart.max() <= ON_LINE * np.abs(forms).max()
            and np.abs(left).max(initial=0.0) <= ON_LINE
        )

    @property
    def _supports(self) -> list[tuple[np.ndarray, np.ndarray]]:
        return [(each.directions, each.stiffness) for each in self.model.network.supports]

    @cached_property
    def breaking(self) -> Float[np.ndarray, "some others"]:
        """Combinations of the parameters and 1 that are zero where states may be turned."""
        model, given = self.model, self.model.patterns
        rows = [self._turned_forces[1][:, model.multipliers :]]
        for vectors in (given.forces, given.lines, given.moves):
            across = (vectors @ self.cross.T).reshape(given.count, -1).T
            rows.append(np.pad(across, ((0, 0), (0, 1))))
        rows.append(model.strains[..., 1:].transpose(0, 2, 1).reshape(-1, given.count + 1))
        _, sizes, basis = np.linalg.svd(np.concatenate(rows), full_matrices=False)
        return np.asarray((sizes[:, None] * basis)[sizes > NEAR_LINE * sizes.max()])

    @cached_property
    def node_weights(self) -> Float[np.ndarray, " free"]:
        """Weights of the free nodes in the mean deflection: quadrature times g, as for rods.

        A node that is hinged deflects with its parent.
        """
        model = self.model
        starts = model.network.places[model.network.ends[:, 0]] / model.length
        at = starts[model.owner][:, None] + model.arclengths[..., None] * model.tangents
        along = at @ np.asarray(model.line)
        points = model.weights * phase_weight((along - along.min()) / np.ptp(along))
        total = np.zeros(len(model.turning))
        np.add.at(total, model.nodes, points)
        np.add.at(total, model.parents, total[model.hinged])
        return np.asarray(total[model.free])

    @cached_property
    def across(self) -> Float[np.ndarray, "2 3"]:
        """Unit vectors across the line: of phase 0, and a quarter turn on."""
        line = np.asarray(self.model.line)
        first = np.eye(3)[np.argmin(np.abs(line))]
        first = first - (first @ line) * line
        first /= np.linalg.norm(first)
        return np.stack([first, self.cross @ first])

    @cached_property
    def forms(self) -> Float[np.ndarray, "2 4 4"]:
        """Deflections ``q·A q`` of the line along `across` by unit quaternions q."""
        half = np.einsum("k,ec,kcab->eab", np.asarray(self.model.line), self.across, FRAME)
        return np.asarray(0.5 * (half + half.transpose(0, 2, 1)))


def _held(directions: np.ndarray, stiffness: np.ndarray) -> Float[np.ndarray, "3 3"]:
    """Projector on the directions in which a support holds its joint."""
    rigid = directions[np.isinf(stiffness)]
    return np.asarray(rigid.T @ rigid)
