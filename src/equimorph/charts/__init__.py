"""Internal parameterisation: coordinates of the equilibrium set, and where they fail."""

from equimorph.charts.atlas import Atlas as Atlas, Leaf as Leaf, Transition as Transition
from equimorph.charts.barriers import Barrier as Barrier
from equimorph.charts.chart import (
    STATUSES as STATUSES,
    Chart as Chart,
    Charted as Charted,
    DescriptorChart as DescriptorChart,
    Projection as Projection,
)
from equimorph.charts.dissection import dissect as dissect
from equimorph.charts.domain import Domain as Domain, Edge as Edge, Overlap as Overlap
from equimorph.charts.path_rules import (
    first_stable_on_path as first_stable_on_path,
    quasi_static as quasi_static,
    rule_from as rule_from,
)
from equimorph.charts.paths import AtlasPath as AtlasPath
from equimorph.charts.reduction import Reduction as Reduction, reduce as reduce
from equimorph.charts.rules import (
    Rule as Rule,
    highest as highest,
    lowest as lowest,
    nearest as nearest,
)
