"""Internal parameterisation: coordinates of the equilibrium set, and where they fail."""

from equimorph.charts.atlas import Atlas, Leaf, Transition
from equimorph.charts.barriers import Barrier
from equimorph.charts.chart import STATUSES, Chart, Charted, DescriptorChart, Projection
from equimorph.charts.dissection import dissect
from equimorph.charts.domain import Domain, Edge, Overlap
from equimorph.charts.path_rules import first_stable_on_path, quasi_static, rule_from
from equimorph.charts.paths import AtlasPath
from equimorph.charts.reduction import Reduction, reduce
from equimorph.charts.rules import Rule, highest, lowest, nearest

__all__ = [
    "STATUSES",
    "Atlas",
    "AtlasPath",
    "Barrier",
    "Chart",
    "Charted",
    "DescriptorChart",
    "Domain",
    "Edge",
    "Leaf",
    "Overlap",
    "Projection",
    "Reduction",
    "Rule",
    "Transition",
    "dissect",
    "first_stable_on_path",
    "highest",
    "lowest",
    "nearest",
    "quasi_static",
    "reduce",
    "rule_from",
]
