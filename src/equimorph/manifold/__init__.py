"""The equilibrium set as a simplicial complex: lifting, folds, strata, audit."""

from equimorph.manifold.audit import Audit
from equimorph.manifold.build import INTERVALS, equilibrium_set
from equimorph.manifold.equilibrium_set import (
    Boundary,
    Component,
    EquilibriumSet,
    Stratum,
)
from equimorph.manifold.locate import Location, Place, locate
from equimorph.manifold.over import StatesOver, lift_to
from equimorph.manifold.refinement import refine
from equimorph.manifold.snap_graph import Snap, SnapGraph, snap_graph
from equimorph.manifold.stability_distance import StabilityDistance, stability_distance

__all__ = [
    "INTERVALS",
    "Audit",
    "Boundary",
    "Component",
    "EquilibriumSet",
    "Location",
    "Place",
    "Snap",
    "SnapGraph",
    "StabilityDistance",
    "StatesOver",
    "Stratum",
    "equilibrium_set",
    "lift_to",
    "locate",
    "refine",
    "snap_graph",
    "stability_distance",
]
