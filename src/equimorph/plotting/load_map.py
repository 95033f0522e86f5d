"""Maps of limit loads, with the curves on which they jump or bend."""

from matplotlib.axes import Axes

from equimorph.plotting.map_panel import CurveLook, Panel, draw_map
from equimorph.plotting.symbols import constraint_label, parameter_label
from equimorph.tasks import LimitLoadMap

_DASHED, _CHAIN, _DOTTED = (0, (6, 1.5)), (0, (4, 1.5, 1, 1.5)), (0, (1, 1.2))
_LOOKS = {
    "cusp": CurveLook("jump: two folds merge", True, {"linewidth": 1.5}),
    "grazing": CurveLook("jump: grazing", True, {"linewidth": 1.5, "linestyle": _DASHED}),
    "jump": CurveLook("jump", True, {"linewidth": 0.9, "linestyle": _DASHED}),
    "branch point": CurveLook("branch point", True, {"linewidth": 1.3, "linestyle": _CHAIN}),
    "exchange": CurveLook("stability / constraint", True, {"linewidth": 0.8}),
    "place": CurveLook("two extrema tie", False, {"linewidth": 1.0, "linestyle": _DOTTED}),
    "kink": CurveLook("kink", False, {"linewidth": 0.7, "linestyle": (0, (2, 1.5))}),
    "edge": CurveLook("", True, {"linewidth": 0.6}),
}


def load_map(lmap: LimitLoadMap, ax: Axes | None = None) -> Axes:
    """Limit loads over two actuators, with the curves on which they jump or bend.

    Cells that a jump crosses are cut along it; nothing is interpolated across. Contours are drawn
    where the map is smooth. Dots mark settings at which a constraint is met before stability is
    lost; settings without a limit load are hatched.

    Parameters
    ----------
    lmap
        The map.
    ax
        Where to draw; None makes a figure one column wide.

    Returns
    -------
    The axes.
    """
    panel = Panel(
        looks=_LOOKS,
        bar=f"limit load {parameter_label(lmap.structure, lmap.load)}",
        marked=lmap.where("constraint"),
        mark_label=f"{constraint_label(lmap.within)} first",
        ground_label="undefined",
        from_zero=True,
    )
    return draw_map(lmap, panel, ax)
