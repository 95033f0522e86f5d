"""Kinds of questions that a study may ask, in the order in which they are answered."""

from typing import Any

from equimorph.study.kinds.estimate import EstimateKind
from equimorph.study.kinds.kind import Kind
from equimorph.study.kinds.map import MapKind
from equimorph.study.kinds.optimum import OptimumKind
from equimorph.study.kinds.route import RouteKind
from equimorph.study.kinds.shape import ShapeKind
from equimorph.study.kinds.track import TrackKind

KINDS: tuple[Kind[Any, Any, Any], ...] = (
    RouteKind(),
    ShapeKind(),
    OptimumKind(),
    TrackKind(),
    EstimateKind(),
    MapKind(),
)
