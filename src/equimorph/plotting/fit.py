"""Figures that fit: whatever the names and the size, nothing is cut off and tick labels stay apart.

Frames have fixed places, which is right for usual names; what does not fit is found on the boxes
that are drawn.
"""

from itertools import pairwise

from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, MaxNLocator, NullLocator
from matplotlib.transforms import Bbox

APART = 1.0
"""Pixels between tick labels."""
EDGE = 0.03
"""Inches around what reaches beyond a figure."""
SLACK = 0.015
"""Inches beyond a figure that are the empty border of a letter's box."""
FEWEST = 1
"""Intervals between ticks at the least."""


def whole_figure(figure: Figure) -> Bbox | None:
    """Box of a figure in inches with all that is drawn; None if nothing leaves the figure.

    Tick labels that would touch are thinned out first.
    """
    drawn = figure.get_tightbbox()  # which also puts all frames into their places
    plane = [ax for ax in figure.axes if ax.name != "3d"]
    thinned = [_thin_out(axis) for ax in plane for axis in (ax.xaxis, ax.yaxis)]
    thinned += [_clear_corner(ax) for ax in figure.axes if ax.name == "3d"]
    if any(thinned):
        drawn = figure.get_tightbbox()
    inside = Bbox.from_bounds(0.0, 0.0, *figure.get_size_inches())
    roomy = inside.padded(SLACK)
    if all(roomy.contains(*corner) for corner in (drawn.min, drawn.max)):
        return None
    return Bbox.union([inside, drawn.padded(EDGE)])


def label_boxes(axis: Axis) -> list[Bbox]:
    """Boxes of the tick labels that are drawn, in pixels, along the axis."""
    ax = axis.axes
    if not (ax.get_visible() and axis.get_visible() and ax.axison):
        return []
    low, high = sorted(axis.get_view_interval())
    slack = 1e-9 * (high - low)
    shown = [
        tick.label1
        for tick in axis.get_major_ticks()
        if low - slack <= tick.get_loc() <= high + slack
        and tick.label1.get_visible()
        and tick.label1.get_text()
    ]
    return [each.get_window_extent() for each in shown]


def touching(axis: Axis) -> bool:
    """Whether two neighbouring tick labels of an axis touch."""
    return any(
        Bbox.intersection(one.padded(0.5 * APART), other.padded(0.5 * APART)) is not None
        for one, other in pairwise(label_boxes(axis))
    )


def _clear_corner(ax: Axes) -> bool:
    """Leave out the outer ticks of x in space where a label touches one of y, and say whether."""
    across = [box.padded(0.5 * APART) for box in label_boxes(ax.yaxis)]
    along = [box.padded(0.5 * APART) for box in label_boxes(ax.xaxis)]
    if not any(Bbox.intersection(one, other) is not None for one in along for other in across):
        return False
    low, high = sorted(ax.xaxis.get_view_interval())
    inside = [each for each in ax.xaxis.get_majorticklocs() if low <= each <= high]
    ax.xaxis.set_major_locator(FixedLocator(inside[1:-1]))
    return True


def _thin_out(axis: Axis) -> bool:
    """Take fewer ticks until their labels stand apart, and say whether; chosen places stay."""
    if isinstance(axis.get_major_locator(), FixedLocator | NullLocator) or not touching(axis):
        return False
    count = len(label_boxes(axis))
    while touching(axis) and count > FEWEST:
        count -= 1
        bins, steps = max(count - 1, FEWEST), [1, 2, 2.5, 5, 10]
        axis.set_major_locator(MaxNLocator(nbins=bins, steps=steps, min_n_ticks=1))
    if touching(axis):
        low, high = sorted(axis.get_view_interval())
        inside = [each for each in axis.get_majorticklocs() if low <= each <= high]
        axis.set_major_locator(FixedLocator(inside[:1]))
    return True
