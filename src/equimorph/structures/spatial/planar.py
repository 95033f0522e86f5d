"""A rod in space that bends in a plane of its clamps, as a planar rod: guesses of its states.

See docs/decisions.md, "Planar guesses in space".
"""

from functools import cached_property

import numpy as np

from equimorph.arrays import Float, Parameters
from equimorph.structures.newton import Limits, newton
from equimorph.structures.rod.general import GeneralMechanics
from equimorph.structures.rod.model import Densities, RodModel
from equimorph.structures.spatial.model import SpatialModel
from equimorph.structures.spatial.quaternions import product, turn_about
from equimorph.structures.spatial.windings import WINDING

Rotations = Float[np.ndarray, "lanes nodes 4"]
BINORMAL = 2
"""Axis about which a rod bends in the plane of the drawing; the other one is 1."""
STRAIGHT = 1e-6
"""Largest angle of a rod that does not bend."""
STEPS = Limits(iterations=40)
"""Of Newton's method in the plane, whose steps may be long: bending is quadratic in the angle."""


class PlanarPart:
    """What of a rod in space acts in one plane, and the rotations that are turns in it.

    Twist and bending out of the plane, loads across it and angles of clamps out of it are left out.
    """

    def __init__(self, model: SpatialModel, axis: int, windings: int = 0) -> None:
        """Bend about the axis of the cross-sections with this number, 1 or 2, and wind."""
        self.model, self.axis, self.windings = model, axis, windings
        self.turn = WINDING * windings
        self.across, self.sign = 3 - axis, 1.0 if axis == BINORMAL else -1.0
        count = model.multipliers
        plane = np.abs(model.reaction[[0, self.across], :count]).sum(axis=0) > 0.0
        self.held = np.flatnonzero(plane)
        """Multipliers that are forces in the plane."""

    @cached_property
    def mechanics(self) -> GeneralMechanics:
        """The planar rod, in the same parameters."""
        model, mesh, axis = self.model, self.model.mesh, self.axis
        kept = np.concatenate([self.held, np.arange(model.multipliers, model.scalars)])
        slopes = mesh.reference.derivative / mesh.lengths[:, None, None]
        rigidity, bending = model.stiffness[..., axis], model.moment[kept, ..., axis]
        stiffness = np.einsum("eki,ek,ekj->eij", slopes, mesh.element_weights * rigidity, slopes)
        element_slope = np.einsum("eki,ek,jek->jei", slopes, mesh.element_weights, bending)
        slope = np.zeros((len(kept), len(mesh.nodes)))
        for e, nodes in enumerate(mesh.element_nodes):
            slope[:, nodes] += element_slope[:, e]
        along, across = model.force[kept, ..., 0], self.sign * model.force[kept, ..., self.across]
        tension, torsion = model.tension[kept], model.torsion[kept]
        fields = Densities(
            along, across, bending, tension, torsion, rigidity, model.softness[..., 0]
        )
        none = np.zeros((2, len(kept)))
        turned = model.turned[:, BINORMAL - axis][:, kept]
        turned[1, -1] += self.turn
        rows = np.array([[0], [self.across]]), kept
        return GeneralMechanics(
            RodModel(
                mesh=mesh,
                names=model.names,
                multipliers=len(self.held),
                held=model.held,
                quadratic=model.quadratic[np.ix_(kept, kept)],
                reaction=model.reaction[rows],
                origin=model.origin[rows],
                from_start=(model.from_start[0], model.from_start[self.across]),
                springs_along=model.springs_along,
                stiffness=0.5 * (stiffness + stiffness.transpose(0, 2, 1)),
                bending_stiffness=stiffness,
                nodal=fields,
                fine=fields,
                slope=slope,
                element_slope=element_slope,
                turned=turned,
                springs=np.zeros(2),
                rest=none,
                pressure=none[0],
                closing=np.zeros((2, 2)),
            )
        )

    def bend(
        self, between: Rotations, p: Parameters, generator: np.random.Generator
    ) -> tuple[Rotations, Float[np.ndarray, "lanes multipliers"]]:
        """Rotations and multipliers to which random planar guesses lead, or those of the guesses.

        `between`: rotations that the angles of the clamps, taken linearly between these, stand for.
        They are turned by what the planar rod turns more. Where that is nothing guesses stay.
        """
        rod, unit = self.mechanics, np.eye(3)[self.axis]
        guess, straight = rod.sample(p, generator), rod.straight_angles(p)
        met = newton(rod, guess, p, STEPS)
        bent = np.abs(rod.nodal_angles(met.z, p) - straight).max(axis=1) > STRAIGHT
        z = np.where((met.found & bent)[:, None], met.z, guess)
        more = rod.nodal_angles(z, p) - straight + self.turn * self.model.mesh.nodes
        forces = np.zeros((len(p), self.model.multipliers))
        forces[:, self.held] = z[:, rod.unknowns :]
        return product(turn_about(more[None], unit)[0], between), forces
