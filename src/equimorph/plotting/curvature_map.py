"""Maps of the largest curvature at a load, with the settings whose real loading would snap."""

from matplotlib.axes import Axes

from equimorph.plotting.map_panel import CurveLook, Panel, draw_map
from equimorph.plotting.symbols import descriptor_label, symbol
from equimorph.tasks import CurvatureMap

_DASHED, _DOTTED = (0, (6, 1.5)), (0, (1, 1.2))
_LOOKS = {
    "fold": CurveLook("barrier: fold", True, {"linewidth": 1.5}),
    "jump": CurveLook("barrier", True, {"linewidth": 1.5, "linestyle": _DASHED}),
    "snap": CurveLook("edge of snapping", True, {"linewidth": 0.8, "linestyle": (0, (3, 1.5))}),
    "gap": CurveLook("edge of a gap", True, {"linewidth": 0.8}),
    "place": CurveLook("two extrema tie", False, {"linewidth": 1.0, "linestyle": _DOTTED}),
    "edge": CurveLook("", True, {"linewidth": 0.6}),
}


def curvature_map(cmap: CurvatureMap, ax: Axes | None = None) -> Axes:
    """Largest curvature, or another descriptor, of the first stable state at a load.

    Cells that a barrier crosses are cut along it; nothing is interpolated across. Dots mark
    settings whose real loading would snap on the way; settings without a state are hatched.

    Parameters
    ----------
    cmap
        The map.
    ax
        Where to draw; None makes a figure one column wide.

    Returns
    -------
    The axes.
    """
    panel = Panel(
        looks=_LOOKS,
        bar=f"{descriptor_label(cmap.descriptor)} at {symbol(cmap.load)} = {cmap.at:g}",
        marked=cmap.snaps,
        mark_label="snaps on the way",
        ground_label="no stable state",
        from_zero=False,
    )
    return draw_map(cmap, panel, ax)
