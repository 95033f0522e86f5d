"""Where descriptors vanish along paths that go on."""

import numpy as np

from equimorph.arrays import Lanes, Some, Values
from equimorph.equilibria.curves import Curve
from equimorph.equilibria.hidden_events import fronts
from equimorph.equilibria.locate import locate_root
from equimorph.equilibria.steps import Bracket, Points
from equimorph.model import Descriptor

NOTHING = 1e-9
"""Value, relative to the largest on the path, that counts as zero: it may begin or end there."""


def vanishing_points(curve: Curve, points: Points, descriptor: Descriptor) -> Points:
    """Exact states between the points of paths at which a descriptor changes its sign.

    Parameters
    ----------
    curve
        The curves of all lanes.
    points
        Their points, from the start on, sorted by lane and length. Where the sign changes twice
        between two of them, it is not seen.
    descriptor
        Any that is continuous along the paths.
    """
    values = descriptor.function(*curve.take(points.lanes).states(points.z, points.t))
    known = np.abs(values) > NOTHING * np.abs(values).max(initial=0.0)
    step = (np.diff(points.lanes) == 0) & known[1:] & known[:-1]
    first = np.flatnonzero(step & (values[1:] * values[:-1] < 0.0))
    if len(first) == 0:
        return points.take(first)
    here, sign = curve.take(points.lanes[first]), np.sign(values[first])

    def against(some: Some, z: Lanes, t: Values) -> Values:
        return np.asarray(-sign[some] * descriptor.function(*here.take(some).states(z, t)))

    before, after = (fronts(curve.take(points.lanes[at]), points, at) for at in (first, first + 1))
    way, what = points.travelled[first + 1] - points.travelled[first], np.zeros(len(first), int)
    numbers, begun = np.arange(len(first)), points.travelled[first]
    bracket = Bracket(numbers, before, after, way, begun, what)
    root = locate_root(here, bracket, against)
    found = Points(
        points.lanes[first], points.travelled[first] + root.step, root.z, root.t,
        points.index[first],
    )  # fmt: skip
    return found.take(np.flatnonzero(root.found))
