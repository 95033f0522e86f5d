"""Quasi-static shape control of soft, morphing structures.

Names are loaded when they are first used, so that importing the package costs nothing.
"""

from importlib import import_module
from typing import Any

__version__ = "0.1.0"

_HOMES = {
    "equimorph.errors": ("CancelledError", "EquimorphError", "InputError"),
    "equimorph.model": (
        "Box",
        "Constraint",
        "Descriptor",
        "Disc",
        "Grid",
        "HalfPlane",
        "Parameter",
        "Rates",
        "Schedule",
        "Spline",
        "combined",
        "largest_of",
    ),
    "equimorph.structures": (
        "Bar",
        "Couple",
        "Curvature",
        "End",
        "EnergyStructure",
        "Frame",
        "LineLoad",
        "Member",
        "PointForce",
        "Pressure",
        "Rod",
        "Spring",
        "State",
        "States",
        "Structure",
        "Tendon",
        "Truss",
        "Unknown",
        "distance_to",
        "effort_of",
        "margin_of",
        "outside",
        "value_of",
    ),
    "equimorph.equilibria": (
        "Branch",
        "CriticalCurve",
        "Event",
        "Landing",
        "Lifts",
        "LimitLoad",
        "LimitLoads",
        "Path",
        "TraceOptions",
        "branch_curve",
        "branches",
        "constraint_curve",
        "cusp_curve",
        "find_equilibria",
        "fold_curve",
        "grazing_curve",
        "held_over",
        "lift",
        "limit_load",
        "snap_landing",
        "worst_over",
    ),
    "equimorph.manifold": (
        "Audit",
        "Components",
        "EquilibriumSet",
        "Location",
        "SnapGraph",
        "StabilityDistance",
        "components",
        "equilibrium_set",
        "locate",
        "snap_graph",
        "stability_distance",
    ),
    "equimorph.charts": (
        "Atlas",
        "AtlasPath",
        "Barrier",
        "Chart",
        "Charted",
        "DescriptorChart",
        "Domain",
        "Overlap",
        "Projection",
        "Reduction",
        "Transition",
        "dissect",
        "first_stable_on_path",
        "highest",
        "lowest",
        "nearest",
        "quasi_static",
        "reduce",
    ),
    "equimorph.tasks": (
        "Calibration",
        "Certificate",
        "CurvatureMap",
        "Family",
        "FollowedOptimum",
        "ImperfectionLaw",
        "Landscape",
        "LeastSnap",
        "LimitLoadMap",
        "MapCurve",
        "MeasuredShape",
        "MeasuredValues",
        "Objective",
        "Optima",
        "Optimum",
        "Proof",
        "Reach",
        "RobustOptimum",
        "Room",
        "Route",
        "SamplingOptions",
        "Sensitivity",
        "Shapes",
        "StateEstimate",
        "Strongest",
        "StrongestSettings",
        "Tracking",
        "Trials",
        "Verification",
        "alternatives",
        "attainable",
        "calibrate",
        "curvature_map",
        "estimate_state",
        "follow_optimum",
        "imperfection_law",
        "landscape",
        "least_snap",
        "limit_load_map",
        "limit_sensitivity",
        "optimise",
        "plan",
        "plan_sampled",
        "random_trials",
        "reachable",
        "robust_optimum",
        "sensitivity",
        "smoothed",
        "solve_shape",
        "solve_shapes",
        "stable_room",
        "strongest",
        "track",
        "verify",
    ),
}
_HOME = {name: home for home, names in _HOMES.items() for name in names}
_LAYERS = ("errors", "linalg", "model", "structures", "equilibria", "manifold", "charts",
           "tasks", "plotting", "storage", "study", "paper", "cli")  # fmt: skip

__all__ = [  # noqa: PLE0604  # names are listed with their homes above
    "__version__",
    *_HOME,
]


def __getattr__(name: str) -> Any:
    """Load a public name or a layer on first use."""
    if name in _HOME:
        return getattr(import_module(_HOME[name]), name)
    if name in _LAYERS:
        return import_module(f"equimorph.{name}")
    raise AttributeError(f"module 'equimorph' has no attribute {name!r}")


def __dir__() -> list[str]:
    """Public names and layers."""
    return sorted([*__all__, *_LAYERS])
