"""Limit-load maps: the largest load before the first critical point, over a grid of settings."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

from equimorph.arrays import Settings, Values
from equimorph.equilibria import LimitLoad, TraceOptions, limit_load
from equimorph.equilibria.natural_sheet import natural_sheet
from equimorph.errors import InputError
from equimorph.model import Constraint, Grid, Progress, Silent, position
from equimorph.structures import States, Structure
from equimorph.tasks.maps.actuator_map import ActuatorMap, settings_of, unloaded_base
from equimorph.tasks.maps.curves import curves_through, places_on
from equimorph.tasks.maps.edge import edge_of_definition
from equimorph.tasks.maps.rays import KINDS, Rays


@dataclass(frozen=True, eq=False, repr=False)
class LimitLoadMap(ActuatorMap):
    """Limit loads over a grid of settings, and the curves on which they jump or bend.

    Kinds of curves: "cusp": two folds of the path merge, and the limit load jumps; "branch point":
    the path meets one; "grazing": the path touches a constraint, and the limit load jumps;
    "exchange": loss of stability and a constraint, or two constraints, exchange their roles;
    "place": two extrema on the structure meet a constraint together; "edge": beyond it no unloaded
    state obeys the constraints; "jump" and "kink": none of these was found to be the reason. All
    but these two are exact: see `MapCurve.errors`.
    """

    kinds: ClassVar[tuple[str, ...]] = KINDS

    def at(self, **setting: float) -> LimitLoad:
        """Limit load at one setting of the box, with its path.

        Raises
        ------
        InputError
            For names that are not those of the grid, a setting outside, or one without a natural
            state.
        """
        return limit_load(self.rest(setting), self.load, within=self.within, bound=self.bound)

    def rays(self, settings: Settings) -> Values:
        """Limit loads at many settings; not numbers where there is none."""
        place = position(self.structure.parameters, self.load)
        options = TraceOptions(record=False)
        return Rays(self.sheet, place, self.within, self.bound, options)(settings).value


def limit_load_map(
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
    base = unloaded_base(structure, grid, load, fixed or {})
    place = position(structure.parameters, load)
    if not bound > base[place]:
        raise InputError(f"`bound` must exceed {load} = {base[place]:g}; got {bound!r}.")
    sink, constraints = progress or Silent(), tuple(within)
    settings, shape = settings_of(grid)
    sheet = natural_sheet(structure, grid, base)
    options = replace(options or TraceOptions(), record=False)
    rays = Rays(sheet, place, constraints, float(bound), options)
    sink.report("limit loads", 0, 2)
    vertices = rays(settings)
    sink.report("limit loads", 1, 2)
    # close to a cusp the two folds are close together: shorter steps tell them apart
    careful = replace(rays, options=options.finer())
    places = places_on(careful, vertices, shape)
    edge = edge_of_definition(sheet, constraints, settings, shape)
    curves = curves_through(sheet, (*places, edge), shape)
    sink.report("limit loads", 2, 2)
    return LimitLoadMap(
        structure, grid, load, constraints, dict(fixed or {}),
        vertices.value.reshape(shape), vertices.kind.reshape(shape),
        States(structure, vertices.z, vertices.p), curves, sheet, float(bound),
    )  # fmt: skip
