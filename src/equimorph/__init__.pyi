"""The public face, for type checkers and for loading on first use.

Names stand in groups by what one wants to do, the most used first; the reference in `docs` has a
page for each group.
"""

from . import (
    charts as charts,
    cli as cli,
    cluster as cluster,
    control as control,
    dynamics as dynamics,
    equilibria as equilibria,
    errors as errors,
    explorer as explorer,
    io as io,
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

# Describe a structure
from .structures import (
    Rod as Rod,
    SpatialRod as SpatialRod,
    Spring as Spring,
    Truss as Truss,
    Frame as Frame,
    SpatialFrame as SpatialFrame,
    EnergyStructure as EnergyStructure,
    Bar as Bar,
    Member as Member,
    SpatialMember as SpatialMember,
    End as End,
    SpatialEnd as SpatialEnd,
    Unknown as Unknown,
    Structure as Structure,
)
from .model import (
    Parameter as Parameter,
)

# Sections, materials and loads
from .structures import (
    CrossSection as CrossSection,
    Strip as Strip,
    Round as Round,
    Tube as Tube,
    OwnSection as OwnSection,
    SectionProperties as SectionProperties,
    PointForce as PointForce,
    LineLoad as LineLoad,
    Couple as Couple,
    Pressure as Pressure,
    Tendon as Tendon,
    Curvature as Curvature,
)

# Measure and bound states
from .structures import (
    State as State,
    States as States,
    value_of as value_of,
    effort_of as effort_of,
    margin_of as margin_of,
    distance_to as distance_to,
    outside as outside,
    LateralMode as LateralMode,
    SpaceStability as SpaceStability,
)
from .model import (
    Descriptor as Descriptor,
    Constraint as Constraint,
    Disc as Disc,
    HalfPlane as HalfPlane,
    function_of as function_of,
    largest_of as largest_of,
)
from .equilibria import (
    worst_over as worst_over,
    stable_over as stable_over,
)

# Find equilibria and follow paths
from .structures import (
    natural_state as natural_state,
)
from .equilibria import (
    find_equilibria as find_equilibria,
    lift as lift,
    Path as Path,
    Lifts as Lifts,
    TraceOptions as TraceOptions,
    Event as Event,
    EventKind as EventKind,
    limit_load as limit_load,
    LimitLoad as LimitLoad,
    LimitLoads as LimitLoads,
    branches as branches,
    Branch as Branch,
    snap_landing as snap_landing,
    Landing as Landing,
)

# Energy barriers and transitions
from .equilibria import (
    transition_network as transition_network,
    TransitionNetwork as TransitionNetwork,
    EnergyBarrier as EnergyBarrier,
    EnergyPath as EnergyPath,
    load_cycle as load_cycle,
    LoadCycle as LoadCycle,
    Merge as Merge,
)
from .manifold import (
    barriers as barriers,
    SetBarriers as SetBarriers,
    Barriers as Barriers,
    network_changes as network_changes,
    NetworkChanges as NetworkChanges,
)
from .dynamics import (
    least_shock as least_shock,
    LeastShock as LeastShock,
    Shock as Shock,
)

# Words of multistable structures
from .tasks.words.strokes import (
    word_graph as word_graph,
)
from .tasks.words.word_graph import (
    WordGraph as WordGraph,
    WordMove as WordMove,
    WordRoute as WordRoute,
    word_graph_over as word_graph_over,
)
from .tasks.words.row import (
    Row as Row,
)

# Follow critical states
from .equilibria import (
    fold_curve as fold_curve,
    branch_curve as branch_curve,
    cusp_curve as cusp_curve,
    constraint_curve as constraint_curve,
    grazing_curve as grazing_curve,
    CriticalCurve as CriticalCurve,
)

# Compute all equilibria
from .model import (
    Box as Box,
    Grid as Grid,
)
from .manifold import (
    equilibrium_set as equilibrium_set,
    EquilibriumSet as EquilibriumSet,
    Audit as Audit,
    locate as locate,
    Location as Location,
    components as components,
    Components as Components,
    stability_distance as stability_distance,
    StabilityDistance as StabilityDistance,
    snap_graph as snap_graph,
    SnapGraph as SnapGraph,
)
from .explorer import (
    explore as explore,
)
from .progress import (
    ProgressBars as ProgressBars,
)

# Choose coordinates and preferred states
from .charts import (
    Projection as Projection,
    DescriptorChart as DescriptorChart,
    dissect as dissect,
    Atlas as Atlas,
    AtlasPath as AtlasPath,
    Chart as Chart,
    Charted as Charted,
    Domain as Domain,
    Overlap as Overlap,
    Transition as Transition,
    reduce as reduce,
    Reduction as Reduction,
    Barrier as Barrier,
    quasi_static as quasi_static,
    first_stable_on_path as first_stable_on_path,
)

# Plan motions without a snap
from .tasks.planning.planner import (
    plan as plan,
)
from .tasks.route import (
    Bottleneck as Bottleneck,
    Route as Route,
    Relaxation as Relaxation,
)
from .tasks.planning.route_classes import (
    alternatives as alternatives,
)
from .tasks.planning.smoothing import (
    smoothed as smoothed,
)
from .tasks.planning.sampling import (
    plan_sampled as plan_sampled,
    SamplingOptions as SamplingOptions,
)
from .tasks.planning.objectives import (
    peak as peak,
    least as least,
    Objective as Objective,
)
from .model import (
    Schedule as Schedule,
    Spline as Spline,
)
from .tasks.verification.schedule_check import (
    verify as verify,
    Verification as Verification,
)
from .tasks.verification.evidence import (
    ProofStatus as ProofStatus,
)
from .tasks.verification.proof import (
    Proof as Proof,
)
from .tasks.motion.tracking import (
    track as track,
    Tracking as Tracking,
)

# Find shapes, optima and what can be reached
from .tasks.shapes.solutions import (
    solve_shape as solve_shape,
    solve_shapes as solve_shapes,
    Shapes as Shapes,
)
from .tasks.optimising.optimum import (
    optimise as optimise,
    Optima as Optima,
    Optimum as Optimum,
)
from .tasks.optimising.certificates import (
    Certificate as Certificate,
)
from .tasks.optimising.robust import (
    robust_optimum as robust_optimum,
    RobustOptimum as RobustOptimum,
)
from .tasks.optimising.landscapes import (
    landscape as landscape,
    Landscape as Landscape,
)
from .tasks.optimising.moving_optimum import (
    follow_optimum as follow_optimum,
)
from .tasks.optimising.optimum_path import (
    FollowedOptimum as FollowedOptimum,
)
from .tasks.reach.reachable_sets import (
    reachable as reachable,
    attainable as attainable,
    Reach as Reach,
)

# Design structures for control
from .tasks.designing.design import (
    Design as Design,
    DesignFront as DesignFront,
    design as design,
    design_front as design_front,
)
from .tasks.designing.search import (
    DesignStep as DesignStep,
)
from .tasks.designing.questions import (
    LoadLimit as LoadLimit,
    StateValue as StateValue,
)
from .tasks.designing.bounds import (
    RouteExtreme as RouteExtreme,
)
from .tasks.designing.bounds import (
    DesignBound as DesignBound,
)
from .tasks.designing.column import (
    strongest_column as strongest_column,
    StrongestColumn as StrongestColumn,
)

# Map limit loads
from .tasks.maps.limit_load import (
    limit_load_map as limit_load_map,
    LimitLoadMap as LimitLoadMap,
)
from .tasks.maps.curvature import (
    curvature_map as curvature_map,
    CurvatureMap as CurvatureMap,
)
from .tasks.maps.curves import (
    MapCurve as MapCurve,
)
from .tasks.optimising.strength import (
    strongest as strongest,
    Strongest as Strongest,
    StrongestSettings as StrongestSettings,
)
from .tasks.robustness.derivatives import (
    limit_sensitivity as limit_sensitivity,
)

# Judge robustness
from .tasks.robustness.derivatives import (
    sensitivity as sensitivity,
    Sensitivity as Sensitivity,
)
from .tasks.robustness.imperfection import (
    imperfection_law as imperfection_law,
    ImperfectionLaw as ImperfectionLaw,
)
from .tasks.calibration.unknowns import (
    Family as Family,
)
from .tasks.robustness.room import (
    stable_room as stable_room,
    Room as Room,
)
from .tasks.verification.proof import (
    certify_box as certify_box,
    BoxProof as BoxProof,
)
from .tasks.robustness.error_model import (
    Errors as Errors,
)
from .tasks.robustness.survival import (
    survival as survival,
    survival_room as survival_room,
    SurvivalRoom as SurvivalRoom,
)
from .tasks.robustness.evidence import (
    Survival as Survival,
)
from .tasks.verification.tube import (
    TubeProof as TubeProof,
)
from .tasks.robustness.snaps import (
    least_snap as least_snap,
    LeastSnap as LeastSnap,
)
from .tasks.robustness.trials import (
    random_trials as random_trials,
    Trials as Trials,
)

# Learn from measurements
from .tasks.estimation import (
    estimate_state as estimate_state,
    StateEstimate as StateEstimate,
)
from .tasks.calibration.calibrate import (
    calibrate as calibrate,
    Calibration as Calibration,
)
from .tasks.calibration.measurements import (
    MeasuredShape as MeasuredShape,
    MeasuredValues as MeasuredValues,
)

# Move in time and control
from .model import (
    Rates as Rates,
)
from .tasks.timing.retiming import (
    retime as retime,
)
from .tasks.timing.speed import (
    speed_limit as speed_limit,
    SpeedLimit as SpeedLimit,
    deviation_bound as deviation_bound,
)
from .dynamics import (
    replay as replay,
    Replay as Replay,
    ReplaySettings as ReplaySettings,
    snap_in_time as snap_in_time,
    SnapInTime as SnapInTime,
    HeldLanding as HeldLanding,
    SimulatedPlant as SimulatedPlant,
)
from .control import (
    Controller as Controller,
    Belief as Belief,
    ControlStatus as ControlStatus,
)

# Compute on several cores
from .linalg import (
    set_threads as set_threads,
)
from .model import (
    Workers as Workers,
)

# Errors
from .errors import (
    EquimorphError as EquimorphError,
    InputError as InputError,
    CancelledError as CancelledError,
    LostWorkersError as LostWorkersError,
)

__version__: str
