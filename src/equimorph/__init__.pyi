"""The public face, for type checkers and for loading on first use."""

from . import (
    charts as charts,
    cli as cli,
    control as control,
    dynamics as dynamics,
    equilibria as equilibria,
    errors as errors,
    explorer as explorer,
    linalg as linalg,
    manifold as manifold,
    model as model,
    paper as paper,
    plotting as plotting,
    storage as storage,
    structures as structures,
    study as study,
    tasks as tasks,
)
from .charts import (
    Atlas as Atlas,
    AtlasPath as AtlasPath,
    Barrier as Barrier,
    Chart as Chart,
    Charted as Charted,
    DescriptorChart as DescriptorChart,
    Domain as Domain,
    Overlap as Overlap,
    Projection as Projection,
    Reduction as Reduction,
    Transition as Transition,
    dissect as dissect,
    first_stable_on_path as first_stable_on_path,
    highest as highest,
    lowest as lowest,
    nearest as nearest,
    quasi_static as quasi_static,
    reduce as reduce,
)
from .control import (
    Belief as Belief,
    Controller as Controller,
    ControlStatus as ControlStatus,
)
from .dynamics import (
    HeldLanding as HeldLanding,
    Replay as Replay,
    ReplaySettings as ReplaySettings,
    SimulatedPlant as SimulatedPlant,
    SnapInTime as SnapInTime,
    replay as replay,
    snap_in_time as snap_in_time,
)
from .equilibria import (
    Branch as Branch,
    CriticalCurve as CriticalCurve,
    Event as Event,
    EventKind as EventKind,
    Landing as Landing,
    Lifts as Lifts,
    LimitLoad as LimitLoad,
    LimitLoads as LimitLoads,
    Path as Path,
    TraceOptions as TraceOptions,
    branch_curve as branch_curve,
    branches as branches,
    constraint_curve as constraint_curve,
    cusp_curve as cusp_curve,
    find_equilibria as find_equilibria,
    fold_curve as fold_curve,
    grazing_curve as grazing_curve,
    held_over as held_over,
    lift as lift,
    limit_load as limit_load,
    snap_landing as snap_landing,
    worst_over as worst_over,
)
from .errors import (
    CancelledError as CancelledError,
    EquimorphError as EquimorphError,
    InputError as InputError,
)
from .explorer import explore as explore
from .manifold import (
    Audit as Audit,
    Components as Components,
    EquilibriumSet as EquilibriumSet,
    Location as Location,
    SnapGraph as SnapGraph,
    StabilityDistance as StabilityDistance,
    components as components,
    equilibrium_set as equilibrium_set,
    locate as locate,
    snap_graph as snap_graph,
    stability_distance as stability_distance,
)
from .model import (
    Box as Box,
    Constraint as Constraint,
    Descriptor as Descriptor,
    Disc as Disc,
    Grid as Grid,
    HalfPlane as HalfPlane,
    Parameter as Parameter,
    Rates as Rates,
    Schedule as Schedule,
    Spline as Spline,
    combined as combined,
    largest_of as largest_of,
)
from .structures import (
    Bar as Bar,
    Couple as Couple,
    CrossSection as CrossSection,
    Curvature as Curvature,
    End as End,
    EnergyStructure as EnergyStructure,
    Frame as Frame,
    LateralMode as LateralMode,
    LineLoad as LineLoad,
    Member as Member,
    OwnSection as OwnSection,
    PointForce as PointForce,
    Pressure as Pressure,
    Rod as Rod,
    Round as Round,
    SectionProperties as SectionProperties,
    SpaceStability as SpaceStability,
    SpatialEnd as SpatialEnd,
    SpatialFrame as SpatialFrame,
    SpatialMember as SpatialMember,
    SpatialRod as SpatialRod,
    Spring as Spring,
    State as State,
    States as States,
    Strip as Strip,
    Structure as Structure,
    Tendon as Tendon,
    Truss as Truss,
    Tube as Tube,
    Unknown as Unknown,
    distance_to as distance_to,
    effort_of as effort_of,
    margin_of as margin_of,
    natural_state as natural_state,
    outside as outside,
    value_of as value_of,
)
from .tasks.calibration.calibrate import (
    Calibration as Calibration,
    calibrate as calibrate,
)
from .tasks.calibration.measurements import (
    MeasuredShape as MeasuredShape,
    MeasuredValues as MeasuredValues,
)
from .tasks.calibration.unknowns import (
    Family as Family,
)
from .tasks.estimation import (
    StateEstimate as StateEstimate,
    estimate_state as estimate_state,
)
from .tasks.maps.curvature import (
    CurvatureMap as CurvatureMap,
    curvature_map as curvature_map,
)
from .tasks.maps.curves import (
    MapCurve as MapCurve,
)
from .tasks.maps.limit_load import (
    LimitLoadMap as LimitLoadMap,
    limit_load_map as limit_load_map,
)
from .tasks.motion.tracking import (
    Tracking as Tracking,
    track as track,
)
from .tasks.optimising.certificates import (
    Certificate as Certificate,
)
from .tasks.optimising.landscapes import (
    Landscape as Landscape,
    landscape as landscape,
)
from .tasks.optimising.moving_optimum import (
    follow_optimum as follow_optimum,
)
from .tasks.optimising.optimum import (
    Optima as Optima,
    Optimum as Optimum,
    optimise as optimise,
)
from .tasks.optimising.optimum_path import (
    FollowedOptimum as FollowedOptimum,
)
from .tasks.optimising.robust import (
    RobustOptimum as RobustOptimum,
    robust_optimum as robust_optimum,
)
from .tasks.optimising.strength import (
    Strongest as Strongest,
    StrongestSettings as StrongestSettings,
    strongest as strongest,
)
from .tasks.planning.objectives import (
    Objective as Objective,
)
from .tasks.planning.planner import (
    plan as plan,
)
from .tasks.planning.route_classes import (
    alternatives as alternatives,
)
from .tasks.planning.sampling import (
    SamplingOptions as SamplingOptions,
    plan_sampled as plan_sampled,
)
from .tasks.planning.smoothing import (
    smoothed as smoothed,
)
from .tasks.reach.reachable_sets import (
    Reach as Reach,
    attainable as attainable,
    reachable as reachable,
)
from .tasks.robustness.derivatives import (
    Sensitivity as Sensitivity,
    limit_sensitivity as limit_sensitivity,
    sensitivity as sensitivity,
)
from .tasks.robustness.imperfection import (
    ImperfectionLaw as ImperfectionLaw,
    imperfection_law as imperfection_law,
)
from .tasks.robustness.room import (
    Room as Room,
    stable_room as stable_room,
)
from .tasks.robustness.snaps import (
    LeastSnap as LeastSnap,
    least_snap as least_snap,
)
from .tasks.robustness.trials import (
    Trials as Trials,
    random_trials as random_trials,
)
from .tasks.route import (
    Route as Route,
)
from .tasks.shapes.solutions import (
    Shapes as Shapes,
    solve_shape as solve_shape,
    solve_shapes as solve_shapes,
)
from .tasks.timing.retiming import (
    retime as retime,
)
from .tasks.timing.speed import (
    SpeedLimit as SpeedLimit,
    deviation_bound as deviation_bound,
    speed_limit as speed_limit,
)
from .tasks.verification.proof import (
    Proof as Proof,
    ProofStatus as ProofStatus,
)
from .tasks.verification.schedule_check import (
    Verification as Verification,
    verify as verify,
)

__version__: str
