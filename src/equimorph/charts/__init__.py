"""Internal parameterisation: coordinates of the equilibrium set, and where they fail."""

from equimorph.charts.chart import STATUSES, Chart, Charted
from equimorph.charts.domain import Domain, Edge
from equimorph.charts.projection import DescriptorChart, Projection
from equimorph.charts.sheets import Overlap

__all__ = [
    "STATUSES",
    "Chart",
    "Charted",
    "DescriptorChart",
    "Domain",
    "Edge",
    "Overlap",
    "Projection",
]
