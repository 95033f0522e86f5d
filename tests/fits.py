"""Whether all that a figure draws lies inside what is saved of it."""

from itertools import product

from matplotlib.transforms import Bbox

from equimorph.plotting.style import label_boxes, touching, whole_figure

SIZES = (0.6, 1.0, 1.8)
"""Widths and heights relative to what a figure has by itself."""


def check_fit(figure, name=""):
    """Legends, labels and titles lie inside what is saved; tick labels do not touch."""
    whole = whole_figure(figure) or Bbox.from_bounds(0.0, 0.0, *figure.get_size_inches())
    pixels = whole.transformed(figure.dpi_scale_trans).padded(1.6)  # borders of letters
    legends = [*figure.legends, *(ax.get_legend() for ax in figure.axes if ax.get_legend())]
    boxes = [each.get_window_extent() for each in legends]
    boxes += [box for ax in figure.axes for axis in (ax.xaxis, ax.yaxis)
              for box in label_boxes(axis)]  # fmt: skip
    boxes += [ax.yaxis.label.get_window_extent() for ax in figure.axes if ax.axison]
    for box in boxes:
        assert all(pixels.contains(*corner) for corner in (box.min, box.max)), name
    for ax in figure.axes:
        if ax.name == "3d":
            pairs = product(label_boxes(ax.xaxis), label_boxes(ax.yaxis))
            assert not any(Bbox.intersection(*pair) for pair in pairs), name
        else:
            assert not touching(ax.xaxis), name
            assert not touching(ax.yaxis), name
