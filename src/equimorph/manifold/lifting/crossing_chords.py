"""Whether the straight crossings of sheets in grid triangles show all that the curved ones do.

Between two nearly parallel pitchfork curves a side branch is a strip. Where it is narrower than the
grid and passes over a vertex, its edges show a crossing on each of two sides of a triangle, and
their chord would close the strip around the vertex; yet both crossings lead on through the third.
"""

import numpy as np

from equimorph.arrays import Bool
from equimorph.manifold.geometry.crossings import crossing_directions
from equimorph.manifold.geometry.exact_points import pin_crossings
from equimorph.manifold.lifting.cells import Cells
from equimorph.manifold.lifting.courses import ways_out
from equimorph.manifold.lifting.fold_chords import Turns, chords_across, lie_inside
from equimorph.manifold.lifting.pairing import Pairing
from equimorph.manifold.lifting.polygon_cuts import planes


def crossing_turns(pairing: Pairing, cells: Cells, wanted: Bool[np.ndarray, " T"]) -> Turns | None:
    """Crossings that lead through the third side of a triangle from both ends, and their middles.

    None if there are none. They are looked for in the flagged triangles.
    """
    points, setting = pairing.points, pairing.setting
    ends, triangle = chords_across(pairing, cells.crossings, wanted)
    if len(ends) == 0:
        return None
    used, place = np.unique(ends, return_inverse=True)
    along = crossing_directions(setting, points.z[used], points.p[used])
    across = np.stack([-along[:, 1], along[:, 0]], axis=-1)[place.reshape(ends.shape)]
    ways = ways_out(pairing, ends, triangle, across)
    chosen = ways.apexes[:, 0] == ways.apexes[:, 1]
    ends, triangle, across = ends[chosen], triangle[chosen], across[chosen]
    if len(ends) == 0:
        return None
    span = planes(pairing, triangle.tolist())
    middle = pin_crossings(setting, points, ends.tolist(), span)
    inside = middle.found & lie_inside(pairing, triangle, ends, middle.p)
    return Turns(ends, triangle, across, middle.z, middle.p, inside)
