"""The equilibrium set as a simplicial complex: lifting, folds, strata, audit."""

from equimorph.manifold.build import equilibrium_set as equilibrium_set
from equimorph.manifold.complex.audit import Audit as Audit
from equimorph.manifold.complex.description import overturned_cells as overturned_cells
from equimorph.manifold.complex.equilibrium_set import (
    Boundary as Boundary,
    BoundaryKind as BoundaryKind,
    Component as Component,
    EquilibriumSet as EquilibriumSet,
    Stratum as Stratum,
)
from equimorph.manifold.geometry.points import VertexKind as VertexKind
from equimorph.manifold.lookup.exact_states import StatesOver as StatesOver, lift_to as lift_to
from equimorph.manifold.queries.barriers import (
    Barriers as Barriers,
    SetBarriers as SetBarriers,
    barriers as barriers,
)
from equimorph.manifold.queries.components import Components as Components, components as components
from equimorph.manifold.queries.cusps import Cusps as Cusps, cusps as cusps
from equimorph.manifold.queries.edge_middles import (
    EdgeMiddles as EdgeMiddles,
    edge_middles as edge_middles,
)
from equimorph.manifold.queries.levels import (
    Division as Division,
    Level as Level,
    cell_sizes as cell_sizes,
    divided as divided,
    divided_by as divided_by,
    level_set as level_set,
    part as part,
    restricted as restricted,
    singular_set as singular_set,
)
from equimorph.manifold.queries.locate import Location as Location, Place as Place, locate as locate
from equimorph.manifold.queries.network_changes import (
    NetworkChanges as NetworkChanges,
    network_changes as network_changes,
)
from equimorph.manifold.queries.snap_graph import (
    Snap as Snap,
    SnapGraph as SnapGraph,
    snap_graph as snap_graph,
)
from equimorph.manifold.queries.stability_distance import (
    StabilityDistance as StabilityDistance,
    stability_distance as stability_distance,
)
from equimorph.manifold.question import INTERVALS as INTERVALS
from equimorph.manifold.refining.refine import refine as refine
