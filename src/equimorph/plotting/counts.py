"""Regions of the plane of free parameters by the number of equilibria over them."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import BoundaryNorm, ListedColormap
from matplotlib.patches import PathPatch
from scipy import ndimage
from scipy.spatial import cKDTree

from equimorph.arrays import Float
from equimorph.charts.regions import Regions, empty_regions, loop_area
from equimorph.manifold import EquilibriumSet
from equimorph.model import Constraint
from equimorph.plotting import style
from equimorph.plotting.curves import boundary_pieces
from equimorph.plotting.labels import constraint_label

_CUT: dict[str, Any] = {
    "facecolor": "#f2f2f2", "edgecolor": style.FAINT, "hatch": "////", "linewidth": 0.0,
    "zorder": 1,
}  # fmt: skip
"""Of regions beyond a constraint, at which the set is cut."""
_SAME_PLACE = 1e-6
"""Distance of coinciding places, relative to the box."""
_INVISIBLE = 1e-4
"""Area, as a share of the box, below which slivers of the mesh are no region of their own."""
_RASTER = 160
"""Pixels, each way, of the raster on which the places of the counts are chosen."""
_ROOM = 0.03
"""Radius of the free disc that a number needs, as a share of the picture."""


def shade_regions(ax: Axes, eset: EquilibriumSet, regions: Regions) -> int:
    """Fill the regions of constant count; return the largest count that can be seen."""
    visible = _INVISIBLE * float(np.prod(eset.box.upper - eset.box.lower))
    largest = max((k for k, area in regions.areas().items() if area > visible), default=0)
    shades = style.count_shades(largest)
    for level, shade in zip(regions.levels[:largest], shades[1:], strict=True):
        ax.add_patch(style.area(level, facecolor=shade, edgecolor="none", zorder=1))
    return largest


def hatch_cut(
    ax: Axes, eset: EquilibriumSet, regions: Regions, *, stable_only: bool
) -> list[PathPatch]:
    """Hatch the regions without equilibria that a constraint bounds: the set is cut there."""
    caps = [line for line, low in boundary_pieces(eset, box=False) if low == 0 or not stable_only]
    if not caps:
        return []
    at_cap = eset.coordinates[np.concatenate(caps)]
    size = eset.box.upper - eset.box.lower
    label = f"cut at {constraint_label(eset.constraints)}"
    tree, patches = cKDTree(at_cap / size), []
    for loops in empty_regions(regions, eset.box.lower, eset.box.upper):
        near, _ = tree.query(np.concatenate(loops) / size)
        if near.min() <= _SAME_PLACE:
            patches.append(style.area(loops, **_CUT, label=label))
            ax.add_patch(patches[-1])
    return patches


def write_counts(
    ax: Axes,
    regions: Regions,
    largest: int,
    taken: Float[np.ndarray, "places 2"],
    hatched: Sequence[PathPatch],
) -> None:
    """Write the count into every region that is not hatched, at the place with the most room."""
    low, high = np.array([ax.get_xlim(), ax.get_ylim()]).T
    step = (high - low) / _RASTER
    x, y = (low[i] + step[i] * (np.arange(_RASTER) + 0.5) for i in (0, 1))
    count = np.minimum(regions.raster(x, y), largest)
    column, row = np.clip(((taken - low) / step).astype(int), 0, _RASTER - 1).T
    free = np.ones_like(count, dtype=bool)
    free[row, column] = False
    centres = np.stack(np.meshgrid(x, y), axis=2).reshape(-1, 2)
    for patch in hatched:
        free[patch.get_path().contains_points(centres).reshape(free.shape) & (count == 0)] = False
    shades = style.count_shades(largest)
    for number in np.unique(count).tolist():
        pieces, many = ndimage.label(count == number)
        for piece in range(1, many + 1):
            # A rim of zeros: the frame of the picture is an edge, too.
            inside = np.pad((pieces == piece) & free, 1)
            if inside.sum() < np.pi * (_ROOM * _RASTER) ** 2:
                continue
            room = ndimage.distance_transform_edt(inside)[1:-1, 1:-1]
            j, i = np.unravel_index(room.argmax(), room.shape)
            if room[j, i] > _ROOM * _RASTER:
                text = ax.text(x[i], y[j], str(number), ha="center", va="center", zorder=5)
                text.set_path_effects(style.rim(1.5, shades[number]))


def least_count(eset: EquilibriumSet, regions: Regions, hatched: Sequence[PathPatch]) -> int:
    """Zero where regions without equilibria can be seen that are not hatched, else one."""
    box = float(np.prod(eset.box.upper - eset.box.lower))
    patches = [loop for patch in hatched for loop in patch.get_path().to_polygons()]
    hidden = sum(loop_area(np.asarray(loop)) for loop in patches)
    bare = box - sum(regions.areas().values()) - hidden
    return 0 if bare > _INVISIBLE * box or not regions.largest else 1


def count_bar(ax: Axes, least: int, largest: int, what: str) -> None:
    """Colour bar with one shade per count."""
    counts = list(range(least, largest + 1))
    shades = ListedColormap(style.count_shades(largest)[least:])
    norm = BoundaryNorm(np.arange(least, largest + 2) - 0.5, len(counts))
    bar = style.colour_bar(ax, ScalarMappable(norm, shades), what)
    bar.set_ticks(counts, labels=[str(k) for k in counts])
    bar.ax.tick_params(length=0)


def label_of_counts(what: str, constraints: Sequence[Constraint]) -> str:
    """What the colours count; the set has no states beyond its constraints."""
    if len(constraints) != 1:
        return f"number of {what}" + (" of the set" if constraints else "")
    sign = "≤" if constraints[0].sense == "<=" else "≥"
    return f"{what}, {constraint_label(constraints).replace('=', sign)}"
