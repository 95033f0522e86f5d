"""The equilibrium set as a simplicial complex: lifting, folds, strata, audit."""

from equimorph.manifold.build import INTERVALS, equilibrium_set
from equimorph.manifold.complex.audit import Audit
from equimorph.manifold.complex.description import overturned_cells
from equimorph.manifold.complex.equilibrium_set import (
    Boundary,
    BoundaryKind,
    Component,
    EquilibriumSet,
    Stratum,
)
from equimorph.manifold.geometry.points import VertexKind
from equimorph.manifold.lookup.exact_states import StatesOver, lift_to
from equimorph.manifold.queries.barriers import Barriers, SetBarriers, barriers
from equimorph.manifold.queries.components import Components, components
from equimorph.manifold.queries.cusps import Cusps, cusps
from equimorph.manifold.queries.edge_middles import EdgeMiddles, edge_middles
from equimorph.manifold.queries.levels import (
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
from equimorph.manifold.queries.locate import Location, Place, locate
from equimorph.manifold.queries.network_changes import NetworkChanges, network_changes
from equimorph.manifold.queries.snap_graph import Snap, SnapGraph, snap_graph
from equimorph.manifold.queries.stability_distance import StabilityDistance, stability_distance
from equimorph.manifold.refining.refine import refine

__all__ = [
    "INTERVALS",
    "Audit",
    "Barriers",
    "Boundary",
    "BoundaryKind",
    "Component",
    "Components",
    "Cusps",
    "Division",
    "EdgeMiddles",
    "EquilibriumSet",
    "Level",
    "Location",
    "NetworkChanges",
    "Place",
    "SetBarriers",
    "Snap",
    "SnapGraph",
    "StabilityDistance",
    "StatesOver",
    "Stratum",
    "VertexKind",
    "barriers",
    "cell_sizes",
    "components",
    "cusps",
    "divided",
    "divided_by",
    "edge_middles",
    "equilibrium_set",
    "level_set",
    "lift_to",
    "locate",
    "network_changes",
    "overturned_cells",
    "part",
    "refine",
    "restricted",
    "singular_set",
    "snap_graph",
    "stability_distance",
]
