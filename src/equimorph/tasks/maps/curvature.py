"""Curvature-type maps: a descriptor of the first stable state at a given load on each path."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
from jaxtyping import Bool

from equimorph.equilibria import TraceOptions
from equimorph.equilibria.natural_sheet import natural_sheet
from equimorph.errors import InputError
from equimorph.model import Constraint, Descriptor, Grid, Progress, Silent, position
from equimorph.structures import States, Structure
from equimorph.tasks.maps.actuator_map import ActuatorMap, settings_of, unloaded_base
from equimorph.tasks.maps.curves import curves_through, places_on
from equimorph.tasks.maps.edge import edge_of_definition
from equimorph.tasks.maps.passages import KINDS, Passages


@dataclass(frozen=True, eq=False, repr=False)
class CurvatureMap(ActuatorMap):
    """A descriptor of the first stable state at a given load, over a grid of settings.

    Statuses: "stable": stable all along the path; "snaps": a real loading leaves the path at a fold
    or a subcritical branch point, and what it snaps to need not be the state of the map; "branches
    off": it leaves the path without a snap; "constraint": it met one; "none": the path leads to no
    stable state at this load.

    Kinds of curves: "fold": the state is a fold, and the map jumps; "jump": the path to it meets a
    branch point, and leads elsewhere; "snap": two folds of the path merge, the status changes and
    the value does not; "gap": there is a state on one side only, because the path meets a branch
    point, two folds of it merge, it touches a constraint, or reaches one with the load; "place":
    two extrema on the structure are equal; "edge": beyond it no unloaded state obeys the
    constraints. States of the curves are those where this happens, on the way to those of the map.
    All are exact where a cause is found: see `MapCurve.errors`.

    Attributes
    ----------
    at
        The given load.
    descriptor
        What the map shows.
    """

    kinds: ClassVar[tuple[str, ...]] = KINDS

    at: float
    descriptor: Descriptor

    @property
    def snaps(self) -> Bool[np.ndarray, "rows columns"]:
        """Settings whose real loading would snap on the way."""
        return self.where("snaps")


def curvature_map(  # noqa: PLR0913  # the knobs of the public face, most by keyword
    structure: Structure,
    grid: Grid,
    load: str,
    at: float,
    *,
    descriptor: Descriptor | None = None,
    within: Sequence[Constraint] = (),
    fixed: Mapping[str, float] | None = None,
    bound: float = 100.0,
    options: TraceOptions | None = None,
    progress: Progress | None = None,
) -> CurvatureMap:
    """Largest curvature, or another descriptor, of the first stable state at a load.

    From the natural state at every setting the path in `load` is followed, through folds, branch
    points and unstable parts, until a stable state with ``load = at`` is met for the first time.

    Parameters
    ----------
    structure
        The structure; it must have natural states.
    grid
        Two parameters with their ranges and intervals.
    load
        Name of the parameter along which the paths run.
    at
        Its value at which states are looked for; above the unloaded one.
    descriptor
        What is shown; without it the structure's largest curvature.
    within
        Constraints that end the paths, like ``[arch.max_curvature <= 20]``.
    fixed
        Values of other parameters; those not named keep their defaults.
    bound
        Largest load, of either sign, up to which paths are followed.
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
        loads out of order.

    References
    ----------
    [Feher2025]_, section 3.2.2.
    """
    base = unloaded_base(structure, grid, load, fixed or {})
    place = position(structure.parameters, load)
    if not base[place] < at < bound:
        raise InputError(
            f"`at` must lie between {load} = {base[place]:g} and `bound` = {bound:g}; got {at!r}."
        )
    shown = structure.descriptor("max_curvature") if descriptor is None else descriptor
    sink, constraints = progress or Silent(), tuple(within)
    settings, shape = settings_of(grid)
    sheet = natural_sheet(structure, grid, base)
    options = replace(
        options or TraceOptions(), record=False, through_folds=True, through_branch_points=True
    )
    paths = Passages(sheet, place, float(at), float(bound), shown, constraints, options)
    sink.report("paths", 0, 2)
    vertices = paths(settings)
    sink.report("paths", 1, 2)
    places = places_on(paths, vertices, shape)
    edge = edge_of_definition(sheet, constraints, settings, shape)
    curves = curves_through(sheet, (*places, edge), shape)
    sink.report("paths", 2, 2)
    return CurvatureMap(
        structure, grid, load, constraints, dict(fixed or {}),
        vertices.value.reshape(shape), vertices.kind.reshape(shape),
        States(structure, vertices.z, vertices.p), curves, sheet,
        float(bound), float(at), shown,
    )  # fmt: skip
