"""The equilibrium set as a simplicial complex: lifting, folds, strata, audit."""

from equimorph.manifold.audit import Audit
from equimorph.manifold.build import INTERVALS, equilibrium_set
from equimorph.manifold.components import Components, components
from equimorph.manifold.cusp_points import Cusps, cusps
from equimorph.manifold.equilibrium_set import (
    Boundary,
    Component,
    EquilibriumSet,
    Stratum,
)
from equimorph.manifold.levels import (
    Division,
    Level,
    cell_sizes,
    divided,
    divided_by,
    level_set,
    part,
    restricted,
    singular_set,
)
from equimorph.manifold.locate import Location, Place, locate
from equimorph.manifold.querying.moves import lift_to
from equimorph.manifold.refinement import refine
from equimorph.manifold.snap_graph import Snap, SnapGraph, snap_graph
from equimorph.manifold.stability_distance import StabilityDistance, stability_distance
from equimorph.manifold.states_over import StatesOver

__all__ = [
    "INTERVALS",
    "Audit",
    "Boundary",
    "Component",
    "Components",
    "Cusps",
    "Division",
    "EquilibriumSet",
    "Level",
    "Location",
    "Place",
    "Snap",
    "SnapGraph",
    "StabilityDistance",
    "StatesOver",
    "Stratum",
    "cell_sizes",
    "components",
    "cusps",
    "divided",
    "divided_by",
    "equilibrium_set",
    "level_set",
    "lift_to",
    "locate",
    "part",
    "refine",
    "restricted",
    "singular_set",
    "snap_graph",
    "stability_distance",
]
