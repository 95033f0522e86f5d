"""Internal parameterisation: coordinates of the equilibrium set, and where they fail."""

from equimorph.charts.barriers import Barrier
from equimorph.charts.chart import STATUSES, Chart, Charted
from equimorph.charts.domain import Domain, Edge
from equimorph.charts.path_rules import first_stable_on_path, quasi_static
from equimorph.charts.projection import DescriptorChart, Projection
from equimorph.charts.reducing import Reduction, reduce
from equimorph.charts.rules import Rule, highest, lowest, nearest
from equimorph.charts.sheets import Overlap

__all__ = [
    "STATUSES",
    "Barrier",
    "Chart",
    "Charted",
    "DescriptorChart",
    "Domain",
    "Edge",
    "Overlap",
    "Projection",
    "Reduction",
    "Rule",
    "first_stable_on_path",
    "highest",
    "lowest",
    "nearest",
    "quasi_static",
    "reduce",
]
