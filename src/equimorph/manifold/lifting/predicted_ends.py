"""Where rays end, predicted by tangents, and the known points there.

See docs/decisions.md, "Every point is corrected once, and rays are matched by tangents".
"""

from dataclasses import dataclass

import numpy as np

from equimorph.arrays import Flags, Lanes, Numbers, Values
from equimorph.columns import Columns
from equimorph.linalg.lanes import over_lanes
from equimorph.manifold.lifting.edges import LONGEST
from equimorph.manifold.lifting.kernels import flag_first_of_alike, match_rays
from equimorph.manifold.lifting.pairing import Pairing, Rays
from equimorph.marching.kernels import LEAST_COSINE, MULTIPLIER_WEIGHT

REACH = 0.1
"""Distance of a known point from where it is predicted, over the step, up to which the ray ends
there; Newton's method may go 0.25 in its first correction, and from one end only."""
NEW, TOO_LONG = -1, -2
"""Partners of rays whose ends are not known, and of those that one step cannot lift."""


@dataclass(frozen=True)
class Ends(Columns):
    """Predicted ends of rays, lengths of the steps there, and known points or `NEW`, `TOO_LONG`."""

    vertices: Numbers
    index: Numbers
    guesses: Lanes
    lengths: Values
    partners: Numbers

    def first_of_alike(self, pairing: Pairing) -> Flags:
        """Which ends are new, and not where earlier ones are."""
        new = np.flatnonzero(self.partners == NEW)
        order = new[np.argsort(self.vertices[new], kind="stable")]
        first = np.zeros(len(self.partners), bool)
        flag_first_of_alike(
            pairing.setting.structure.mass, order, self.vertices, self.index, self.guesses,
            self.lengths, REACH, first,
        )  # fmt: skip
        return first


def match_ends(pairing: Pairing, rays: Rays) -> Ends:
    """Predict the ends of rays, and match them with known points."""
    setting, points, mesh, slopes = pairing.setting, pairing.points, pairing.mesh, pairing.slopes
    slopes.fit(setting, points)
    structure, count = setting.structure, len(rays.points)
    start, vertices = mesh.edges[rays.edges, rays.sides], mesh.edges[rays.edges, 1 - rays.sides]
    weights = np.full(structure.size, MULTIPLIER_WEIGHT)
    weights[: structure.unknowns] = structure.mass
    ends = Ends(
        vertices,
        points.index[rays.points],
        np.empty((count, structure.size)),
        np.empty(count),
        np.empty(count, int),
    )
    known = points.head, points.following, points.z, points.index, slopes.tangents, slopes.index
    over_lanes(
        match_rays,
        (structure.unknowns, weights, setting.scales, *known, LONGEST, REACH, LEAST_COSINE),
        (rays.points, vertices, mesh.vertices[vertices] - mesh.vertices[start]),
        (ends.guesses, ends.lengths, ends.partners),
    )
    return ends
