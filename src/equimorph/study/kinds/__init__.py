"""Kinds of questions that a study may ask, in the order in which they are answered."""

from typing import Any

from equimorph.study.kinds.calibration import CalibrationKind
from equimorph.study.kinds.estimate import EstimateKind
from equimorph.study.kinds.follow import FollowKind
from equimorph.study.kinds.imperfection import ImperfectionKind
from equimorph.study.kinds.kind import Kind
from equimorph.study.kinds.landscape import LandscapeKind
from equimorph.study.kinds.map import MapKind
from equimorph.study.kinds.optimum import OptimumKind
from equimorph.study.kinds.reach import ReachKind
from equimorph.study.kinds.room import RoomKind
from equimorph.study.kinds.route import RouteKind
from equimorph.study.kinds.sampled_route import SampledRouteKind
from equimorph.study.kinds.sensitivity import SensitivityKind
from equimorph.study.kinds.shape import ShapeKind
from equimorph.study.kinds.snap import SnapKind
from equimorph.study.kinds.snap_graph import SnapGraphKind
from equimorph.study.kinds.strongest import StrongestKind
from equimorph.study.kinds.track import TrackKind
from equimorph.study.kinds.trials import TrialsKind
from equimorph.study.kinds.verify import VerifyKind

KINDS: tuple[Kind[Any, Any, Any], ...] = (
    RouteKind(),
    ShapeKind(),
    OptimumKind(),
    LandscapeKind(),
    TrackKind(),
    FollowKind(),
    SampledRouteKind(),
    ReachKind(),
    VerifyKind(),
    SensitivityKind(),
    ImperfectionKind(),
    RoomKind(),
    SnapKind(),
    SnapGraphKind(),
    TrialsKind(),
    EstimateKind(),
    CalibrationKind(),
    MapKind(),
    StrongestKind(),
)
