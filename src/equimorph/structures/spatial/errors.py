"""Discretisation errors of rods in space, by solving again with a higher degree."""

import numpy as np

from equimorph.arrays import Lanes, Parameters, Values
from equimorph.structures.rod.discretisation import error_by_refinement
from equimorph.structures.spatial.fields import SpatialFields
from equimorph.structures.spatial.mechanics import SpatialMechanics

SAMPLES = np.linspace(0.0, 1.0, 25)
"""Arclengths at which strains and places are compared."""


def discretisation_error(
    rod: SpatialMechanics, finer: SpatialMechanics, z: Lanes, p: Parameters
) -> Values:
    """Twice the largest change of max |κ|, of strains and of places."""
    here, there = SpatialFields(rod), SpatialFields(finer)
    inner = finer.model.unknown_nodes
    nodal = np.einsum("mn,lna->lma", rod.mesh.interpolation(finer.mesh.nodes), rod.rotations(z, p))
    nodal /= np.linalg.norm(nodal, axis=-1, keepdims=True)
    parts = nodal[:, inner].reshape(len(z), -1), z[:, rod.unknowns :]
    start = np.concatenate(parts, axis=1)
    still, (one, none) = np.zeros_like(start), (np.ones(len(z)), np.zeros(len(z)))

    def correction(at: Lanes) -> Lanes:
        return finer.advance(at, p, np.zeros_like(p), still, one, none).dz

    def change(at: Lanes) -> Values:
        largest = np.abs(there.largest_curvature(at, p)[0] - here.largest_curvature(z, p)[0])
        new, old = there.at(at, p, SAMPLES), here.at(z, p, SAMPLES)
        strains = np.abs(new.strains - old.strains).max(axis=(1, 2))
        places = np.abs(new.places - old.places).max(axis=(1, 2))
        return np.asarray(np.maximum(largest, np.maximum(strains, places)))

    return error_by_refinement(start, correction, change)
