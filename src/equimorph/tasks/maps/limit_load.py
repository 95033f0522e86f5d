"""Limit-load maps: the largest load before the first critical point, over a grid of settings."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float, Int

from equimorph.equilibria import LimitLoad, TraceOptions, limit_load
from equimorph.errors import InputError
from equimorph.model import Constraint, Grid, Progress, Silent, parameter_vector, position
from equimorph.structures import State, States, Structure
from equimorph.tasks.maps.brackets import Brackets, grid_edges, narrowed
from equimorph.tasks.maps.curves import MapCurve, Places, curves_through, places_on
from equimorph.tasks.maps.natural import NaturalSheet, natural_sheet
from equimorph.tasks.maps.rays import KINDS, LOST, UNDEFINED, Rays
from equimorph.tasks.maps.samples import Samples

UNLOADED_DIVISIONS = 14


@dataclass(frozen=True, eq=False)
class LimitLoadMap:
    """Limit loads over a grid of settings, and the curves on which they jump or bend.

    Attributes
    ----------
    structure, grid, load, within, fixed, bound
        What was asked.
    value
        Limit load at every vertex of the grid; not a number where it is undefined or was lost.
    status
        Number in `KINDS` of what ended the path.
    states
        Critical states, row by row; not numbers where there is none.
    curves
        Where the map is not smooth.
    """

    structure: Structure
    grid: Grid
    load: str
    within: tuple[Constraint, ...]
    fixed: Mapping[str, float]
    bound: float
    value: Float[np.ndarray, "rows columns"]
    status: Int[np.ndarray, "rows columns"]
    states: States
    curves: tuple[MapCurve, ...]
    sheet: NaturalSheet

    def __repr__(self) -> str:
        """Size, how many of each status, and the curves."""
        shape = " × ".join(map(str, self.value.shape))
        counts = ", ".join(f"{n} {kind}" for kind, n in self.counts.items() if n)
        return f"LimitLoadMap({shape} settings: {counts}; {len(self.curves)} curves)"

    @property
    def counts(self) -> dict[str, int]:
        """Settings of each status."""
        return {kind: int((self.status == k).sum()) for k, kind in enumerate(KINDS)}

    def at(self, **setting: float) -> LimitLoad:
        """Limit load at one setting of the box, with its path.

        Raises
        ------
        InputError
            For names that are not those of the grid, a setting outside, or one without a natural
            state.
        """
        point = _point(self.grid, setting)
        z, found = self.sheet.states(point[None])
        if not found[0]:
            raise InputError(f"`setting` must have a natural state; got {setting}.")
        state = State(self.structure, z[0], self.sheet.parameters(point[None])[0])
        return limit_load(state, self.load, within=self.within, bound=self.bound)


def limit_load_map(  # noqa: PLR0913  # the knobs of the public face, most by keyword
    structure: Structure,
    grid: Grid,
    load: str,
    *,
    within: Sequence[Constraint] = (),
    fixed: Mapping[str, float] | None = None,
    bound: float = 100.0,
    options: TraceOptions | None = None,
    progress: Progress | None = None,
) -> LimitLoadMap:
    """Limit loads over a grid of settings, with the curves on which they jump or bend.

    From the natural state at every setting a ray in `load` is followed to the first loss of
    stability or constraint. On grid edges whose ends differ in status, or more than those of their
    neighbours, the cause is looked for: a state at which two tests vanish, found by Newton's method
    and confirmed by limit loads on both sides. Edges without a cause are divided, again and again.
    Places of one kind are connected to curves across the cells.

    Parameters
    ----------
    structure
        The structure; it must have natural states.
    grid
        Two parameters with their ranges and intervals.
    load
        Name of the parameter that grows from its unloaded value.
    within
        Constraints that end the paths, like ``[arch.max_curvature <= 10]``.
    fixed
        Values of other parameters; those not named keep their defaults.
    bound
        Largest load tried.
    options
        Step control.
    progress
        Told how far the computation is.

    Returns
    -------
    The map.

    Raises
    ------
    InputError
        For a grid that does not have two parameters, a load that is one of them, unknown names, or
        a bound that the unloaded structure exceeds.

    References
    ----------
    [Feher2025]_, section 3.2.1.
    """
    base = _unloaded(structure, grid, load, fixed or {}, bound)
    sink, constraints = progress or Silent(), tuple(within)
    sheet = natural_sheet(structure, grid, base)
    options = replace(options or TraceOptions(), record=False)
    rays = Rays(sheet, position(structure.parameters, load), constraints, float(bound), options)
    axes = grid.axes()
    settings = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 2)
    shape = (len(axes[0]), len(axes[1]))
    sink.report("limit loads", 0, 2)
    vertices = rays(settings)
    sink.report("limit loads", 1, 2)
    # close to a cusp the two folds are close together: shorter steps tell them apart
    careful = replace(rays, options=options.finer())
    places = (*places_on(careful, vertices, shape), _edge_of_definition(rays, vertices, shape))
    curves = curves_through(rays, places, shape)
    sink.report("limit loads", 2, 2)
    return LimitLoadMap(
        structure, grid, load, constraints, dict(fixed or {}), float(bound),
        vertices.value.reshape(shape), vertices.kind.reshape(shape),
        States(structure, vertices.z, vertices.p), curves, sheet,
    )  # fmt: skip


def _unloaded(
    structure: Structure, grid: Grid, load: str, fixed: Mapping[str, float], bound: float
) -> Float[np.ndarray, " parameters"]:
    """All parameters unloaded, with the lower corner of the grid; checks what was asked."""
    if len(grid.names) != 2:
        raise InputError(f"`grid` must have two parameters; got {', '.join(grid.names)}.")
    if load in grid.names or load in fixed:
        raise InputError(f"`load` must be neither in `grid` nor in `fixed`; got {load!r}.")
    place = position(structure.parameters, load)
    corner = dict(zip(grid.names, map(float, grid.box.lower), strict=True))
    base = parameter_vector(structure.parameters, {**structure.unloaded(), **fixed, **corner})
    if not bound > base[place]:
        raise InputError(f"`bound` must exceed {load} = {base[place]:g}; got {bound!r}.")
    return base


def _point(grid: Grid, setting: Mapping[str, float]) -> Float[np.ndarray, " 2"]:
    if set(setting) != set(grid.names):
        names = ", ".join(setting) or "nothing"
        raise InputError(f"`setting` must give {' and '.join(grid.names)}; got {names}.")
    point = np.array([float(setting[name]) for name in grid.names])
    if not grid.box.contains(point, slack=1e-12):
        raise InputError(f"`setting` must lie in {grid.box}; got {dict(setting)}.")
    return point


def _edge_of_definition(rays: Rays, vertices: Samples, shape: tuple[int, int]) -> Places:
    """Edges with a natural state that obeys the constraints at one end only, narrowed down."""
    edges = grid_edges(shape)
    start = replace(vertices, kind=np.where(vertices.kind < UNDEFINED, LOST, vertices.kind))
    out = start.kind[edges] != LOST
    at = np.flatnonzero(out[:, 0] != out[:, 1])
    pairs = Brackets(start.take(edges[at, 0]), start.take(edges[at, 1]), at)
    found = narrowed(rays.sheet.structure, rays.unloaded, pairs, UNLOADED_DIVISIONS)
    middle = 0.5 * (found.a.setting + found.b.setting)
    inside = found.a.where(found.a.kind == LOST, found.b)
    kind = np.full(len(found), "edge", dtype=object)
    return Places(found, kind, middle, inside.z, inside.p)
