"""Discretisation errors of planar rods, by solving again with a higher degree."""

import numpy as np

from equimorph.arrays import Lanes, Parameters, Values
from equimorph.structures.rod.discretisation import error_by_refinement
from equimorph.structures.rod.mechanics import PlanarMechanics

SAMPLES = np.linspace(0.0, 1.0, 25)
"""Arclengths at which fields are compared."""


def discretisation_error(
    rod: PlanarMechanics, finer: PlanarMechanics, z: Lanes, p: Parameters
) -> Values:
    """Twice the largest change of max |κ|, of κ(s) and of y(s) after Newton on a finer rod."""
    matrix = rod.mesh.interpolation(finer.mesh.nodes[finer.unknown_nodes])
    fine = np.concatenate([rod.nodal_angles(z, p) @ matrix.T, z[:, rod.unknowns :]], axis=1)
    still = np.zeros((len(z), finer.size))
    one, none = np.ones(len(z)), np.zeros(len(z))

    def correction(at: Lanes) -> Lanes:
        return finer.advance(at, p, np.zeros_like(p), still, one, none).dz

    def change(at: Lanes) -> Values:
        largest = np.abs(finer.largest_curvature(at, p)[0] - rod.largest_curvature(z, p)[0])
        fields = np.abs(finer.fields(at, p, SAMPLES) - rod.fields(z, p, SAMPLES))
        return np.asarray(np.maximum(largest, fields[:, :, [1, 3]].max(axis=(1, 2))))

    return error_by_refinement(fine, correction, change)
